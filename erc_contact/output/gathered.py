"""Gather meshes and contacts of all ranks on rank 0 for pictures and files.

Symbols: r^ admissible contact traction, u^ admissible displacement, w^ its value on a
contact: on a foundation u^, between two bodies the jump of u^; w^_n its part along the
normal of the contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.contact.contact_values import gap_at_nodes, slip_at
from erc_contact.model.contact.trace import split
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.base.ranks import gather_rows
from namedmesh.for_solvers import in_space
from namedmesh.pictures import number_cells
from namedmesh.simplex import at_nodes

SAME_GAP = 1e-12
"""Difference of a gap from its drawn part that is round-off, over the greatest [-]."""
OF_FACETS = ("x", "gap", "gap_left", "slip", "place", "drawn", "status", "partners")
"""Fields of a contact that are gathered as they are."""
AXIS = 1e-6
"""Difference from 1 of the cosine with a coordinate axis that counts as none [-]."""


@dataclass(frozen=True, eq=False)
class WholeContact:
    """Hold the n facets of a contact on all ranks; on rank 0.

    Attributes:
        traction: r^ on these facets. Of ``traction.contact`` only the normals belong
            to them.
        x: Positions of the nodes of each facet [length], shape (n, m, 3).
        vertices: Global numbers of the vertices of each facet, shape (n, d).
        gap: The gap g at the nodes of each facet before the deformation [length], shape
            (n, m).
        gap_left: The gap that is left there, g - w^_n [length], shape (n, m).
        slip: Tangential part of w^ there, less the tangential deflection of a compliant
            foundation, or of its change since the last step of a history [length],
            shape (n, m, d).
        place: Positions of the nodes on the true surface, where it is known [length],
            shape (n, m, d).
        status: OPEN, SLIP, STICK or CLOSED of each facet, shape (n,), see
            :func:`erc_contact.results.contact_status`.
        partners: Global numbers of the facing nodes of the other body, shape (n, m);
            (0, m) on a foundation.
        drawn: The part of the gap with which both bodies are drawn [length], shape (n,
            m).
        letters: Names of the coordinates.
    """

    traction: ContactTraction
    x: np.ndarray
    vertices: np.ndarray
    gap: np.ndarray
    gap_left: np.ndarray
    slip: np.ndarray
    place: np.ndarray
    drawn: np.ndarray
    status: np.ndarray
    partners: np.ndarray
    letters: str = "xyz"

    def missing(self, factor: float) -> WholeContact:
        """Return the contact with the gap that a picture must add, over its factor.

        It magnifies the gap by the factor, and the mesh has the part that is drawn.
        """
        gap = self.gap - self.drawn / factor
        round_off = SAME_GAP * abs(self.drawn).max(initial=0.0)
        return replace(self, gap=np.where(abs(gap) <= round_off, 0.0, gap))

    @property
    def d(self) -> int:
        """Return the dimension of the body."""
        return self.traction.values.shape[-1]

    @property
    def degree(self) -> int:
        """Return the degree of r^."""
        return 1 if self.x.shape[1] == self.d else 2


def letters_of(space: Space) -> str:
    """Return the names of the coordinates of a scene."""
    return space.section.letters


def mean_normal(surface: WholeContact) -> np.ndarray:
    """Compute the normal of a contact, out of the body, shape (d,).

    If it varies, this is the unit vector of its mean. It is zero if the mean is zero,
    as around a closed contact.
    """
    area = surface.traction.area
    n = area @ surface.traction.contact.direction
    length = np.linalg.norm(n)
    n = n / length if length > AXIS * area.sum() else 0 * n
    # Round-off must not turn an axis.
    axis = np.eye(len(n))[abs(n).argmax()]
    return np.sign(n) * axis if abs(n).max() > 1 - AXIS else n


def upward(model: Model) -> np.ndarray:
    """Find the upward direction of a picture, shape (3,); collective.

    It is the coordinate axis, with its sign, that points away from the first
    foundation. Between two bodies neither is the lower one: without a foundation it is
    the axis across the first contact.
    """
    total = np.zeros(3)
    on_foundations = [contact for contact in model.contacts if contact.against is None]
    for contact in (on_foundations or model.contacts)[:1]:
        side = contact.trace.here
        total[: model.space.d] = side.owned_areas @ contact.direction
    total = np.array(model.space.comm.allgather(total)).sum(axis=0)
    # Without a contact, y is upward.
    axis = int(abs(total).argmax()) if total.any() else 1
    # The normal points from the body to the foundation, which is below.
    sign = -1.0 if on_foundations and total[axis] > 0 else 1.0
    return np.eye(3)[axis] * sign


def whole_contact(admissible: Admissible, traction: ContactTraction) -> WholeContact | None:
    """Gather the facets of a contact on rank 0; None on other ranks; collective.

    The facets of a pair belong to the side that the scene names first.
    """
    space = admissible.model.space
    contact = traction.contact
    owned = contact.trace.here.owned
    gap = gap_at_nodes(space, contact)
    u = admissible.displacement.x.array
    w_n = split(contact.trace.of(u), contact.trace.normals).normal
    r = np.matmul(at_nodes(space.d - 1, space.degree), traction.values)
    slip = slip_at(space, contact, u, r, space.facet_points)
    nodes = traction.nodes
    partners = contact.trace.partners
    drawn = (contact.to_partners * contact.trace.normals).sum(axis=-1)
    if contact.gap_beside_facets is not None:
        # Facets stand for the true surfaces.
        drawn += space.evaluate(contact.gap_beside_facets, space.facet_points, contact.facets)
    place = space.true_places(contact.facets)
    if contact.is_exchanged:
        place = place + contact.to_partners
        nodes, partners = partners, nodes
    parts = gather_rows(
        space.comm,
        area=traction.area[owned],
        values=contact.sign * traction.values[owned],
        friction_bound=traction.friction_bound[owned],
        direction=contact.sign * contact.direction[owned],
        normals=contact.sign * contact.trace.normals_at_vertices[owned],
        nodes=space.global_numbers(nodes[owned]),
        x=space.V.tabulate_dof_coordinates()[nodes[owned]],
        gap=gap[owned],
        gap_left=(gap - w_n)[owned],
        status=admissible.status(admissible.traction(contact.name))[owned],
        slip=contact.sign * slip[owned],
        place=place[owned],
        drawn=drawn[owned],
        partners=space.global_numbers(partners[owned[: len(partners)]]),
    )
    if not parts:
        return None
    # Of the contact only the normals belong to all ranks.
    turns = contact.trace.corner_normals is not None
    of_corners = parts["normals"] if turns else None
    trace = replace(contact.trace, direction=parts["direction"], corner_normals=of_corners)
    whole_traction = ContactTraction(
        replace(contact, trace=trace, is_exchanged=False),
        area=parts["area"],
        values=parts["values"],
        friction_bound=parts["friction_bound"],
        nodes=parts["nodes"],
    )
    fields = {name: parts[name] for name in OF_FACETS}
    return WholeContact(
        whole_traction,
        vertices=parts["nodes"][:, : space.d],
        letters=letters_of(space),
        **fields,
    )


def whole_contacts(admissible: Admissible) -> list[WholeContact]:
    """Gather the contacts that have facets on rank 0; collective.

    Other ranks get an empty list.
    """
    contacts = []
    for traction in admissible.tractions_per_area:
        contact = whole_contact(admissible, traction)
        if contact is not None and len(contact.x) > 0:
            contacts.append(contact)
    return contacts


def is_symmetry(contact: WholeContact) -> bool:
    """Tell whether a contact is a plane of symmetry, or a side of copies.

    They have no foundation.
    """
    data = contact.traction.contact
    plain = data.friction is None and data.gap is None and len(contact.partners) == 0
    return data.is_periodic or (data.bilateral and plain)


def colours_in_words(contacts: Sequence[WholeContact]) -> str:
    """Say what the colours of lines in a picture mean."""
    symmetries = [is_symmetry(contact) for contact in contacts]
    words = "" if all(symmetries) else "\norange: closed contact"
    kinds = set()
    for contact in contacts:
        if is_symmetry(contact):
            is_periodic = contact.traction.contact.is_periodic
            kinds.add("sides of copies" if is_periodic else "plane of symmetry")
    return words + (f"\nblue: {', '.join(sorted(kinds))}" if kinds else "")


def body_nodes(space: Space) -> dict[str, np.ndarray]:
    """Return the owned part of a mesh, with all nodes of the displacement.

    Returns:
        The same as :func:`namedmesh.pictures.grids.body_mesh`:
        "points", shape (n, 3), and "cells", shape (m, N).
    """
    cells = space.nodes[: space.domain.owned_cells]
    x = space.V.tabulate_dof_coordinates()
    return number_cells(x, cells, space.V.dofmap.index_map, space.d)


def nodal_displacement(admissible: Admissible) -> np.ndarray:
    """Return u^ at the points of :func:`body_nodes` [length], shape (n, 3)."""
    model = admissible.model
    owned = model.space.V.dofmap.index_map.size_local
    return in_space(admissible.displacement.x.array.reshape(-1, model.space.d)[:owned])


def whole_body(
    admissible: Admissible,
) -> tuple[dict[str, np.ndarray], list[WholeContact]]:
    """Gather the nodes with u^ and the contacts on rank 0; collective.

    Returns:
        The arrays of :func:`body_nodes`, and at these points "u", u^ [length], and
        "still", which components supports hold at zero, shape (n, 3) each; the contacts
        that have facets. Other ranks get none of them.
    """
    model = admissible.model
    space = model.space
    u = nodal_displacement(admissible)
    prescribed = model.prescribed.x.array.reshape(-1, space.d)[: len(u)]
    still = np.zeros(u.shape, dtype=bool)
    still[:, : space.d] = model.held[: len(u)] & (prescribed == 0.0)
    body = gather_rows(space.comm, **body_nodes(space), u=u, still=still)
    return body, whole_contacts(admissible)
