"""Show deformed bodies in 3D, coloured by stress, error and pressure.

The values are gathered on rank 0, which writes the page
(:mod:`erc_contact.output.view_page`).

Symbols: X position before the deformation, u and u^ displacement of a solution and of
an admissible pair, sigma^ admissible stress, r^ admissible contact traction, eps_E
share of one element of the relative error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from erc_contact.base.exceptions import on_rank
from erc_contact.base.views import view_of
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import LoadingHistory
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.model import Model
from erc_contact.model.profile import profile_traction, profile_weights
from erc_contact.model.space import Space
from erc_contact.model.stress import tells_out_of_plane
from erc_contact.model.von_mises import von_mises
from erc_contact.newton.solution import Solution
from erc_contact.output.apart import pairs_of
from erc_contact.output.deformed import COLOURED_SHARE, magnification, shift_of
from erc_contact.output.drawing import weighted_level
from erc_contact.output.foundations import DISPLACEMENT_SHARE, STILL_SHARE, round_factor
from erc_contact.output.gathered import body_nodes, upward, whole_body
from erc_contact.output.view_page import Colours, ShownStep, View, page_of, that_fit
from erc_contact.results.stresses import mean_stress
from namedmesh.base.ranks import gather_rows, greatest
from namedmesh.for_solvers import in_space
from namedmesh.pictures import skin_of, views_of
from namedmesh.simplex import measures

MOST_FRAMES = 60
"""Greatest number of steps of a view."""
BAND = 0.025
"""Width of a band that shows a contact in the plane, over the size of the body [-]."""
ERROR = "error of each element [%]"
"""Name of the colours of eps_E."""
PRESSURE = "pressure of contacts [force/area]"
"""Name of the colours of the pressure."""


@view_of.register
def show_error(error: ConstitutiveError) -> View:
    """Show the deformed body of an error with stress, error and pressure; collective.

    Points are drawn at X + s u^ with the magnification s of
    :func:`erc_contact.output.draw_deformed`, which the page tells. The colours are the
    von Mises stress of the mean of sigma^ in each element, eps_E, or the mean pressure
    of r^ on each facet of a contact. Elements are drawn with straight edges, and
    foundations are not drawn.

    Args:
        error: The error.

    Returns:
        The page, empty on all ranks but rank 0.

    Raises:
        InputError: If the mesh is too large for a page below 3 MB.

    Example:
        >>> view = ec.output.show_error(error)  # or error.show()
        >>> view.save("results/view.html")
    """
    return _view_of_errors([error], [""])


def show_history(history: LoadingHistory) -> View:
    """Show the body of a loading history at its steps; collective.

    It is shown as by :func:`show_error`, with one magnification at all steps, a slider
    and a button that plays it. Where the steps do not fit in a page below 3 MB, some of
    them are left out, evenly in time.

    Args:
        history: The history.

    Returns:
        The page, empty on all ranks but rank 0.

    Raises:
        InputError: If the last mesh is too large for such a page.

    Example:
        >>> view = ec.output.show_history(evolution)  # or evolution.show()
        >>> view.save("results/view.html")
    """
    count = len(history.errors)
    places = np.unique(np.linspace(0, count - 1, MOST_FRAMES).round().astype(int))
    time = history.column("time")
    words = [f"t = {time[i]:.4g}" for i in places]
    return _view_of_errors([history.errors[i] for i in places], words)


def _view_of_errors(errors: Sequence[ConstitutiveError], words: Sequence[str]) -> View:
    """Show errors one after another, with words about each; collective."""
    factor = round_factor(min(magnification(error) for error in errors))
    drawn = []
    for error, about in zip(errors, words, strict=True):
        pair = error.admissible
        model = error.model
        means = [traction.values.mean(axis=1) for traction in pair.tractions_per_area]
        body, contacts = whole_body(pair)
        values = {"stress": von_mises(mean_stress(pair)), "error": 100 * error.indicators}
        pieces = _pieces_of(model.space, model.contacts, means)
        cells = gather_rows(model.space.comm, **values)
        if body and pairs_of(contacts):
            body["points"] = body["points"] + shift_of(body, contacts, factor)
        drawn.append((body, cells, pieces, about))
    last = errors[-1].model
    colours = {"stress": _of_stress(last), "error": Colours(ERROR, logarithmic=True)}
    return _view(last, drawn, colours, factor)


@view_of.register
def show_solution(solution: Solution) -> View:
    """Show the deformed body of a solution with stress and pressure; collective.

    Points are drawn at X + s u. The colours are the von Mises stress of C eps(u) in the
    middle of each element, or the mean pressure of the method's traction on each facet
    of a contact. All else is as in :func:`show_error`, but that a gap between two
    bodies is not magnified.

    Args:
        solution: The solution.

    Returns:
        The page, empty on all ranks but rank 0.

    Raises:
        InputError: If the mesh is too large for a page below 3 MB.

    Example:
        >>> view = ec.output.show_solution(solution)  # or solution.show()
        >>> view.save("results/view.html")
    """
    model = solution.model
    space = model.space
    size = model.domain.extent
    largest = greatest(space.comm, solution.u.x.array)
    moves = largest > STILL_SHARE * size
    factor = round_factor(DISPLACEMENT_SHARE * size / largest if moves else 1.0)
    weights = profile_weights(space)
    means = []
    for contact in model.contacts:
        traction = profile_traction(space, contact, solution.traction(contact))
        means.append(np.einsum("q,fqi->fi", weights, traction))
    pieces = _pieces_of(space, model.contacts, means)
    owned = space.V.dofmap.index_map.size_local
    u = in_space(solution.u.x.array.reshape(-1, space.d)[:owned])
    body = gather_rows(space.comm, **body_nodes(space), u=u)
    cells = gather_rows(space.comm, stress=solution.mises_at_middles())
    return _view(model, [(body, cells, pieces, "")], {"stress": _of_stress(model)}, factor)


def _of_stress(model: Model) -> Colours:
    """Return the colours of the von Mises stress."""
    part = "" if tells_out_of_plane(model) else " of the plane part"
    return Colours(model.scene.label(f"von Mises stress{part} [force/area]"))


def _pieces_of(
    space: Space, contacts: Sequence[ContactOnMesh], means: Sequence[np.ndarray]
) -> dict[str, np.ndarray]:
    """Gather the facets of contacts on rank 0, both sides of a pair; collective.

    Args:
        space: The space.
        contacts: The contacts.
        means: Mean traction on the facets of each contact [force/area], shape (f, d).

    Returns:
        Global numbers of "vertices", shape (n, d), "normals" out of the body, shape (n,
        d), and the "pressure" [force/area], shape (n,).
    """
    d = space.d
    vertices = [np.zeros((0, d), dtype=np.int64)]
    normals = [np.zeros((0, d))]
    pressures = [np.zeros(0)]
    for contact, mean in zip(contacts, means, strict=True):
        trace = contact.trace
        owned = trace.here.owned
        pressure = -split(mean, contact.direction).normal
        for nodes, sign in ((trace.here.nodes, 1.0), (trace.partners, -1.0)):
            # A foundation has no partners.
            of_side = np.flatnonzero(owned[: len(nodes)])
            vertices.append(space.global_numbers(nodes[of_side, :d]))
            normals.append(sign * contact.direction[of_side])
            pressures.append(pressure[of_side])
    return gather_rows(
        space.comm,
        vertices=np.concatenate(vertices),
        normals=np.concatenate(normals),
        pressure=np.concatenate(pressures),
    )


def _view(
    model: Model,
    drawn: Sequence[tuple[dict[str, np.ndarray], dict[str, np.ndarray], Any, str]],
    colours: dict[str, Colours],
    factor: float,
) -> View:
    """Make the view of gathered bodies; collective.

    Args:
        model: The model of the last body.
        drawn: Body, values in cells, pieces of contacts and words of each step.
        colours: Kinds of the values in cells, by their names.
        factor: Magnification of the displacement [-].
    """
    d = model.space.d
    up = upward(model)
    pages = [""]

    def write() -> None:
        steps = [_step(d, factor, *parts) for parts in drawn]
        # A singular corner would else take all colours of the stress.
        most = max(_most_of_volume(d, body, cells["stress"]) for body, cells, _, _ in drawn)
        colours["stress"] = replace(colours["stress"], most=most)
        if any(len(pieces["pressure"]) for _, _, pieces, _ in drawn):
            colours["pressure"] = Colours(model.scene.label(PRESSURE), of_contacts=True)
        axes = next(iter(views_of(d, up).values()))
        pages[0] = page_of(that_fit(steps), colours, axes, f"displacement × {factor:g}")

    on_rank(model.space.comm, 0, write)
    return View(pages[0])


def _most_of_volume(d: int, body: dict[str, np.ndarray], values: np.ndarray) -> float:
    """Return the value below which nearly all of the volume is."""
    volumes = measures(body["points"][body["cells"][:, : d + 1], :d])
    return weighted_level(values, volumes, COLOURED_SHARE)


def _step(
    d: int,
    factor: float,
    body: dict[str, np.ndarray],
    of_cells: dict[str, np.ndarray],
    pieces: dict[str, np.ndarray],
    words: str,
) -> ShownStep:
    """Make what is drawn of a gathered body, in its deformed position.

    Args:
        d: Dimension.
        factor: Magnification of the displacement [-].
        body: Nodes, elements and displacement, from ``whole_body``.
        of_cells: Values of all elements by their names.
        pieces: Facets of contacts, from :func:`_pieces_of`.
        words: Words about the step.
    """
    skin = skin_of(body["points"], body["cells"][:, : d + 1], d)
    x = body["points"] + factor * body["u"]
    # Nodes inside a body in 3D are not seen.
    seen, triangles = np.unique(skin.triangles, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    corners, parts = _of_contacts(x, pieces)
    values = {}
    for name, of_cell in of_cells.items():
        values[name] = np.append(of_cell[skin.cell], np.full(len(parts), np.nan))
    pressure = np.repeat(pieces["pressure"], len(parts) // max(len(pieces["pressure"]), 1))
    values["pressure"] = np.append(np.full(len(triangles), np.nan), pressure)
    return ShownStep(
        np.concatenate([x[seen], corners]),
        np.concatenate([triangles, len(seen) + parts]),
        len(triangles),
        values,
        words,
    )


def _of_contacts(x: np.ndarray, pieces: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles that show facets of contacts: bands in the plane.

    Args:
        x: Nodes as they are drawn [length], shape (n, 3).
        pieces: Facets of contacts, from :func:`_pieces_of`.

    Returns:
        Corners [length], shape (c, 3), and their numbers in each triangle, shape (m,
        3); the triangles of a facet follow one another.
    """
    corners = x[pieces["vertices"]]
    count, d = pieces["vertices"].shape
    of_facet = np.array([[0, 1, 2]])
    if d == 2:
        width = BAND * float(np.linalg.norm(np.ptp(x, axis=0)))
        inside = corners - width * in_space(pieces["normals"])[:, None]
        corners = np.concatenate([corners, inside], axis=1)
        of_facet = np.array([[0, 1, 2], [1, 3, 2]])
    first = corners.shape[1] * np.arange(count)
    triangles = first[:, None, None] + of_facet
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)
