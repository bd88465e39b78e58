"""Draw pictures of deformed bodies: by matplotlib in the plane, by pyvista in 3D.

Bodies of degree 2 are drawn with curved edges. Where a contact is small beside its body
in the plane, a picture of its surroundings shows it, with its gap magnified. A body in
3D is seen twice: from above with the foundation, and from the other side and below
without it, to show the contact. Between two bodies nothing else is drawn.

Symbols: u^ and sigma^ admissible displacement and stress, X position before the
deformation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run, error_of
from erc_contact.model.copies import shown_copies
from erc_contact.model.stress import tells_out_of_plane
from erc_contact.output.apart import greatest_gap, greatest_share, pairs_of, shifts
from erc_contact.output.drawing import only_turned, weighted_level
from erc_contact.output.foundations import (
    CLOSED_COLOUR,
    DISPLACEMENT_SHARE,
    STILL_SHARE,
    SYMMETRY_COLOUR,
    UNSEEN,
    MovingFoundation,
    closed_part,
    drawn_foundation,
    foundation_of,
    greatest_factor,
    ground,
    round_factor,
)
from erc_contact.output.gallery import Gallery
from erc_contact.output.gathered import (
    WholeContact,
    colours_in_words,
    is_symmetry,
    letters_of,
    mean_normal,
    upward,
    whole_body,
)
from erc_contact.output.maps import Scale, draw_map
from erc_contact.output.windows import near_window, window_near
from erc_contact.results.stresses import linear_mises
from namedmesh.base.checks import positive
from namedmesh.base.names import in_picture
from namedmesh.base.ranks import gather_rows, greatest
from namedmesh.for_solvers import in_space
from namedmesh.pictures import (
    DIVISIONS,
    ShownPart,
    Skin,
    draw_figure,
    images,
    only_in_2d,
    outline,
    sample,
    skin_of,
    straight,
    views_of,
)

STRAIN_ROUND_OFF = 1e-12
"""Strain that is round-off, over the displacement over the size of the body [-]."""
ROOM = 0.08
"""Room for what a body touches in a picture, over the diagonal of its window [-]."""
COLOURED_SHARE = 0.998
"""Share of the volume whose stress is below the top of the colour scale [-].

A singular corner would else take all colours.
"""


def draw_deformed(
    error: ConstitutiveError | Run,
    path: str | Path | None = None,
    factor: float | None = None,
    *,
    pull: float | None = None,
    stress: str = "admissible",
    mirrored: bool = False,
    whole: bool = False,
    ax: Any = None,
) -> Any:
    """Draw the deformed body on its foundation, or several bodies; collective.

    The colours show the von Mises stress of sigma^, or of another stress. Points of the
    body are drawn at X + factor u^. The foundation is drawn as it is, and not
    magnified: what is flat is flat. It is moved with the body, so that what is closed
    looks closed as nearly as a rigid motion can make it
    (:mod:`erc_contact.output.foundations`). It is left out where it would be far from
    the body. Orange lines show what is closed, in 3D its border, and black ones the
    outline of the body before the deformation.

    Two bodies are drawn as far from each other as they are, times the factor: what is
    closed touches. A gap between them that is data is drawn on the side that the
    contact is named after: the body moves as a rigid one, or has a recess.

    The von Mises stress is computed from the mean of the stress in each element; for
    degree 2 it is linear there (:func:`erc_contact.results.stresses.vertex_stress`). If
    the material does not tell the stress out of plane (``out_of_plane``), only the part
    in plane counts.

    Args:
        error: The error whose admissible pair is drawn, or a history.
        path: Picture file, or None.
        factor: Magnification of u^ [-]. By default the largest u^ is drawn with 6% of
            the body's size, or with less if otherwise a closed contact would look open
            or entered by more than 0.3% of the size, as a curved body on a plane does.
            A displacement that is larger than 5% of the size is not magnified. Of
            several bodies the deformation of each, and gap and jump between two, are
            drawn with at most 6% of the size of the smaller one. With a factor of your
            own the title says how much a contact with a foundation looks open or
            entered.
        pull: Distance by which bodies that face each other are pulled apart in the
            picture, to show what is between them [length]; None pulls nothing apart.
        stress: "admissible" for sigma^, "best" for the mean of sigma^ and C eps(u^),
            whose error is known best, "elastic" for C eps(u^).
        mirrored: Whether an axisymmetric body is drawn on both sides of its axis.
        whole: Whether the copies are drawn, too, that make the whole of a body with
            planes of symmetry or sectors; of periodic sides the next copies.
        ax: Axes of matplotlib to draw on, in 2D; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.

    Raises:
        InputError: If the distance is not > 0, the stress is another one, axes are
            given in 3D, a body is to be mirrored that is not axisymmetric, or the whole
            of a body that has no copies.
    """
    error = error_of(error)
    admissible = error.admissible
    model = error.model
    space = model.space
    if pull is not None:
        positive("draw_deformed: pull", pull, "a distance > 0 [length], or None")
    if mirrored:
        only_turned("draw_deformed: mirrored", space)
    copies = shown_copies(model, "draw_deformed: whole") if whole else []
    # All ranks ask for the size, which is collective; rank 0 alone draws.
    size = model.domain.extent
    d = space.d
    body, gathered_contacts = whole_body(admissible)
    cells = gather_mises(admissible, stress)
    up = upward(admissible.model)
    letters = letters_of(space)
    # A rigid motion has stresses of round-off.
    strain = greatest(space.comm, admissible.displacement.x.array) / size
    only_round_off = error.scale == 0 or error.solution.at_rest
    least = STRAIN_ROUND_OFF * strain * model.stiffest()
    part = "" if tells_out_of_plane(model) else " of the plane part"
    kind = "" if stress == "admissible" else f" ({stress})"
    label = f"von Mises stress{kind}{part} [force/area]"

    def draw(ax: Any) -> Any:
        only_in_2d("draw_deformed", ax, d)
        contacts = gathered_contacts
        times = factor
        if times is None:
            times = round_factor(greatest_magnification(body, contacts, size))
        if pairs_of(contacts):
            shift = shift_of(body, contacts, times, pull or 0.0)
            body["points"] = body["points"] + shift
            contacts = [_shift(contact, shift) for contact in contacts]
        foundations = _foundations(contacts)
        skin = skin_of(body["points"], body["cells"], d)
        x = skin.points + times * body["u"]
        scale = mises_scale(cells, label)
        colours = mises_on_skin(skin, cells)
        # Round-off would else fill the whole range of colours.
        if only_round_off or colours.max() <= least:
            colours = 0 * colours
        closed = _closed_lines(contacts, x)
        # Copies move as the body is drawn, with their magnified jump.
        motions = [(turn, shift + times * jump) for (turn, shift), jump in copies[1:]]
        before = outline(body, d)
        lines = [*before, *images(before, [motion for motion, _ in copies[1:]])]
        lines += [*closed, *images(closed, motions)]
        grounds = _grounds(foundations, times, size, float(np.ptp(x, axis=0).max()))
        title = _title(contacts, foundations, times, size, pull)
        if closed:
            title += colours_in_words(contacts)
        views = views_of(d, up)
        drawn = (skin, x, colours, scale, views, lines, grounds, title, letters)
        return draw_map(ax, *drawn, mirrored=mirrored, motions=motions)

    return draw_figure(space.comm, path, ax, draw, model.scene.label)


def draw_near(
    error: ConstitutiveError | Run,
    contact: str,
    path: str | Path | None = None,
    *,
    ax: Any = None,
) -> Any:
    """Draw the deformed body near a contact, in the plane; collective.

    The picture has what is closed and what has yielded, with three quarters as much
    beside it. Points are drawn at ``X + s (u^ - u_0)``, and the foundation at ``X + s
    (g n - u_0)``: gap and displacement are magnified alike, so that what is closed
    looks closed, and an imprint is seen below the ball that made it.

    Args:
        error: The error whose admissible pair is drawn, or a history.
        contact: Name of the contact.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact has this name, or nothing is closed or has yielded in
            a small part of a body in the plane.
    """
    error = error_of(error)
    window = window_near("draw_near", error, contact)
    assert window is not None
    body, gathered_contacts = whole_body(error.admissible)
    cells = gather_mises(error.admissible)
    letters = letters_of(error.model.space)
    name = error.model.contact(contact).name

    def draw(ax: Any) -> Any:
        x = body["points"][:, :2]
        inside = np.all((x >= window[0]) & (x <= window[1]), axis=1)
        u = body["u"][inside]
        frame = (u.min(axis=0) + u.max(axis=0)) / 2
        size = float(np.linalg.norm(window[1] - window[0]))
        largest = float(np.linalg.norm(u - frame, axis=1).max(initial=0.0))
        factor = round_factor(DISPLACEMENT_SHARE * size / largest if largest > 0 else 1.0)
        contacts = gathered_contacts
        skin = skin_of(body["points"], body["cells"], 2)
        drawn = skin.points + factor * (body["u"] - frame)
        if pairs_of(contacts):
            drawn = drawn + shift_of(body, contacts, factor)
        seen = inside[cells["vertices"]].any(axis=1)
        cells_seen = {key: values[seen] for key, values in cells.items()}
        scale = mises_scale(cells_seen, "von Mises stress [force/area]")
        colours = mises_on_skin(skin, cells)
        (n,) = (mean_normal(each) for each in contacts if each.traction.contact.name == name)
        closed = _closed_lines(contacts, drawn)
        lines = outline(body, 2) + closed
        alone = _on_foundations(contacts)
        grounds: list[ShownPart] = []
        for foundation in _with_gaps(alone, factor, frame[:2]):
            grounds += ground(foundation, size)
        title = f"near {contact}: displacement and gap × {factor:g}"
        title += colours_in_words(contacts) if closed else ""
        where = (skin, drawn, colours, scale, views_of(2, np.eye(3)[1]), lines, grounds, title)
        return draw_map(ax, *where, letters, window=_with_room(window, n))

    return draw_figure(error.model.space.comm, path, ax, draw, error.model.scene.label)


def add_near(gallery: Gallery, error: ConstitutiveError, contact: str, code: str) -> None:
    """Add :func:`draw_near` of a contact to a gallery if it shows more; collective.

    Args:
        gallery: The gallery.
        error: The error.
        contact: Name of the contact.
        code: The error as a user writes it.
    """
    if near_window(error, contact) is None:
        return
    file = f"near_{contact}.png"
    words = f"The deformed body near {contact}, with the gap magnified as the displacement."
    line = f'erc_contact.output.draw_near({code}, "{contact}", "{file}")'
    gallery.add(file, words, line, partial(draw_near, error, contact), is_body=True)


def _with_room(window: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return a window with room for what a body touches, along the normal n (2,)."""
    room = ROOM * float(np.linalg.norm(window[1] - window[0])) * n
    return np.array([window[0] + np.minimum(room, 0.0), window[1] + np.maximum(room, 0.0)])


def _with_gaps(contacts: Sequence[WholeContact], factor: float, frame: np.ndarray) -> list[Any]:
    """Draw foundations at ``X + s (g n - u_0)``, as lines for pyvista."""
    drawn = []
    for surface in contacts:
        n = surface.traction.contact.direction[:, None]
        position = surface.place + factor * (surface.gap[..., None] * n - frame)
        points, parts = sample(position, 1, DIVISIONS)
        line = straight(in_space(points), parts)
        line.point_data["normal"] = in_space(np.repeat(n[:, 0], len(points) // len(n), axis=0))
        drawn.append(line)
    return drawn


def gather_mises(admissible: Admissible, stress: str = "admissible") -> dict[str, np.ndarray]:
    """Gather the von Mises stress of all cells on rank 0; collective.

    Returns:
        "stress" [force/area], see :func:`erc_contact.results.stresses.linear_mises`,
        "volume" of the cells and the global numbers of their "vertices".
    """
    model = admissible.model
    owned = model.domain.owned_cells
    return gather_rows(
        model.space.comm,
        stress=linear_mises(admissible, stress),
        volume=admissible.cell_geometry.volume[:owned],
        vertices=model.space.global_numbers(admissible.cell_geometry.vertices[:owned]),
    )


def shift_of(
    body: Mapping[str, np.ndarray],
    contacts: Sequence[WholeContact],
    factor: float,
    pull: float = 0.0,
) -> np.ndarray:
    """Compute :func:`erc_contact.output.apart.shifts` of all pairs, shape (n, 3)."""
    pairs = [pair.missing(factor) for pair in pairs_of(contacts)]
    motions = [foundation_of(pair).motion for pair in pairs]
    return shifts(body, pairs, motions, factor, pull)


def magnification(error: ConstitutiveError) -> float:
    """Find the greatest magnification of a deformed body [-]; collective.

    It is infinite if nothing moves.
    """
    model = error.model
    size = model.domain.extent
    body, contacts = whole_body(error.admissible)
    factor = np.inf
    if model.space.comm.rank == 0:
        factor = greatest_magnification(body, contacts, size)
    return model.space.comm.bcast(factor)


def greatest_magnification(
    body: Mapping[str, np.ndarray], contacts: Sequence[WholeContact], size: float
) -> float:
    """Find the greatest magnification of a picture by default [-]; on rank 0.

    Args:
        body: The mesh with u^ at its nodes.
        contacts: Contacts with facets.
        size: Size of all bodies [length].
    """
    largest = float(np.linalg.norm(body["u"], axis=1).max())
    magnified = max(largest, greatest_gap(contacts))
    factor = greatest_factor(_foundations(contacts), magnified, size)
    pairs = pairs_of(contacts)
    if pairs:
        share = greatest_share(body, pairs)
        factor = min(factor, DISPLACEMENT_SHARE / max(share, STILL_SHARE))
    return factor


def _foundations(contacts: Sequence[WholeContact]) -> list[MovingFoundation]:
    """Fit the foundations of contacts with a foundation; on rank 0."""
    return [foundation_of(contact) for contact in _on_foundations(contacts)]


def _on_foundations(contacts: Sequence[WholeContact]) -> list[WholeContact]:
    """Return the contacts with a foundation, without planes of symmetry."""
    alone = [contact for contact in contacts if len(contact.partners) == 0]
    return [contact for contact in alone if not is_symmetry(contact)]


def _shift(contact: WholeContact, shift: np.ndarray) -> WholeContact:
    """Move a contact, and so its foundation, with the nodes of its body.

    The shifts of all nodes have the shape (n, 3) [length].
    """
    of_nodes = shift[contact.traction.nodes][..., : contact.d]
    return replace(contact, place=contact.place + of_nodes)


def mises_scale(cells: Mapping[str, np.ndarray], label: str) -> Scale:
    """Find the colours of the von Mises stress in all cells."""
    from matplotlib.colors import Normalize  # noqa: PLC0415

    of_cells = cells["stress"].max(axis=1)
    top = weighted_level(of_cells, cells["volume"], COLOURED_SHARE)
    return Scale(Normalize(0, top or 1.0), "max", label)


def mises_on_skin(skin: Skin, cells: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the stress as :meth:`Skin.of_parts` takes it [force/area].

    It has one value for each cell, or three for each triangle.
    """
    stress = cells["stress"]
    if stress.shape[1] == 1:
        return stress[:, 0]
    # The vertices of a cell and the corners of its triangles have other orders.
    vertices = cells["vertices"][skin.cell, None]
    corners = (vertices == skin.triangles[:, :3, None]).argmax(axis=2)
    return np.take_along_axis(stress[skin.cell], corners, axis=1)


def _grounds(
    foundations: Sequence[MovingFoundation], factor: float, size: float, drawn_size: float
) -> list[ShownPart]:
    """Draw the foundations.

    Args:
        foundations: The foundations.
        factor: Magnification of the displacement [-].
        size: Size of the body, the diagonal of its box [length].
        drawn_size: Longest side of the box of the body as it is drawn [length].
    """
    grounds: list[ShownPart] = []
    for foundation in foundations:
        grounds += ground(drawn_foundation(foundation, factor, size), drawn_size)
    return grounds


def _closed_lines(contacts: Sequence[WholeContact], x: np.ndarray) -> list[ShownPart]:
    """Draw the lines that show what is closed, for nodes at x [length], (n, 3)."""
    closed: list[ShownPart] = []
    for contact in contacts:
        for nodes in (contact.traction.nodes, contact.partners):
            lines = closed_part(contact, nodes, x)
            if lines is not None:
                colour = SYMMETRY_COLOUR if is_symmetry(contact) else CLOSED_COLOUR
                closed.append((lines, {"color": colour, "line_width": 8.0}))
    return closed


def _title(
    contacts: Sequence[WholeContact],
    foundations: Sequence[MovingFoundation],
    factor: float,
    size: float,
    pull: float | None,
) -> str:
    """Say what a picture of a deformed body magnifies, and what then looks wrong."""
    title = f"displacement × {factor:g}"
    pairs = pairs_of(contacts)
    gaps = [pair for pair in pairs if pair.missing(factor).gap.any()]
    with_gap = [in_picture(pair.traction.contact.name) for pair in gaps]
    if with_gap:
        title = f"displacement and gap × {factor:g}, gap drawn on {', '.join(with_gap)}"
    if pairs and pull is not None:
        title += f"\nbodies pulled apart by {pull:g} [length]"
    if factor != 1.0 and any(foundation.moves for foundation in foundations):
        title += ", foundation moved with it"
    if any(each.surface.traction.contact.stiffness is not None for each in foundations):
        title += "\nthe foundation is drawn without its deflection"
    entry = max((foundation.entry(factor) for foundation in foundations), default=0.0)
    if entry > 1.1 * UNSEEN * size:  # more than rounding of the magnification makes of it
        title += f"\nand so the contact looks open or entered by up to {entry:.2g} [length]"
    return title
