"""Measure how far a stress is from equilibrium, and refuse a pair that is not in it.

A pair bounds the error only if sigma^ is in equilibrium. So each pair proves itself:
whatever made sigma^, these forces are computed from its coefficients, and are zero but
for round-off.

- In each sub-simplex: the coefficients of ``div sigma^ + f``, times its volume.
- Between two sub-simplices of a cell: the jumps of ``sigma^ n``, times the area.
- On each facet of a cell: ``sigma^ n`` less the traction of the facet, times the area.
  The two cells of a facet have opposite tractions: on one rank they are the same
  numbers, and between two ranks their sum is computed.
- On each facet of the boundary: its moments less the moments of loads, r^ and the
  pull of springs, but for components that a support holds.
- On each contact: what pulls in r^, and what is beyond its friction bound.
- On each rigid face: the resultants of its free motions less the given ones.
- On the sides of copies under a mean stress: their resultants less the given ones.

With these, the resultant and the moment of all forces on each body are zero, too: they
are sums of them.

They are compared with the greatest force that the stress of the same body has on a
facet, ``max |sigma^| |F|``. This is the size of what cancels in each of them, and also
of the nodal forces that are balanced before: round-off is a multiple of it, in any
units, with tiny loads as with large ones, and for each body alone. Where nothing is
loaded, sigma^ is zero, and so must be what is missing. Three sizes may be greater: the
last digit of the greatest force on any body, as one solve is for all; where a body
moves far, the last digit of ``C eps(u)``; and where a cell is flat, the last digit of a
stress that is mapped to it.

Symbols: d dimension, k degree, n cells, m coefficients of a facet, N_k of a cell,
s Mandel components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.elastic import greatest_moduli, strain_digits
from erc_contact.admissible.rebalance import nodal_forces
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import NotBalanced
from erc_contact.model.given_forces import given_forces
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_faces import RigidFace
from erc_contact.model.motions.rigid_motions import greatest_of_bodies
from erc_contact.model.space import Space
from namedmesh.base.percent import place_words
from namedmesh.simplex import local_facet_nodes

UNBALANCED = 1e-9
"""Missing force, over the greatest one on a facet, from which a pair is refused [-].

Nodal forces are balanced to 1e-12 before, and the tests, extreme shapes and units among
them, leave at most 2e-12. What is left out of a bound of e is then below 1e-9 of the
stress, where no digit that is shown sees it.
"""
GOLDEN = 0.6180339887498949
"""Weights of the nodes of a facet are the fractional parts of its multiples [-]."""


Found = tuple[str, np.ndarray, np.ndarray]
"""In words, where forces are missing; the forces [force], and the cell of each."""


@dataclass(frozen=True, eq=False)
class Given:
    """Hold what sigma^ is to be in equilibrium with.

    Attributes:
        boundary: Moments of loads, r^ and the pull of springs on facets of the boundary
            [force], shape (facets, m, d).
        fixed: Components of facets whose traction is not given, shape (facets, d).
        tractions: r^ on each contact.
    """

    boundary: np.ndarray
    fixed: np.ndarray
    tractions: Sequence[ContactTraction]


def proved_imbalance(
    model: Model,
    cells: CellGeometry,
    u: fem.Function,
    of_cells: tuple[np.ndarray, np.ndarray],
    moment: np.ndarray,
    given: Given,
) -> float:
    """Return the greatest missing force over the greatest force [-]; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        u: The displacement [length].
        of_cells: Greatest missing force in each owned cell, and greatest force [force].
        moment: Moments of the facet tractions [force], shape (facets, m, d).
        given: What they balance.

    Raises:
        NotBalanced: If it is more than round-off.
    """
    space = model.space
    missing, size = of_cells
    greatest = _by_body(model, cells, size)
    # One solve is for all bodies: the greatest forces set its last digits.
    greatest = np.maximum(greatest, np.finfo(float).eps / UNBALANCED * greatest.max())
    of_boundary = _of_boundary(space, cells, moment, given)
    found = [("in a cell", missing, np.arange(len(size))), ("on the boundary", *of_boundary)]
    if space.comm.size > 1:
        found.append(("between two ranks", *_between_ranks(space, cells, moment)))
    found += [_of_law(traction) for traction in given.tractions]
    for face in model.loose_faces:
        found.append(_of_face(space, cells, face, moment))
    found += _of_sides(model, moment)
    amounts = np.concatenate([of_place for _, of_place, _ in found])
    nodes = cells.nodes[np.concatenate([of_cells for _, _, of_cells in found]), 0]
    most = greatest_of_bodies(space.comm, model.bodies, nodes, amounts)
    ratio = float(_ratios(most, greatest).max())
    if ratio > UNBALANCED:
        digits = strain_digits(cells, u, len(size)) * greatest_moduli(model, cells, len(size))
        area = _greatest_areas(cells, len(size))
        of_digits = _by_body(model, cells, digits * area)
        of_shapes = _by_body(model, cells, size * _shape_digits(cells, area))
        digits_of_body = np.maximum(of_digits, of_shapes) / UNBALANCED
        worst = _worst(model, cells, found, np.maximum(greatest, digits_of_body))
        ratio = worst.ratio
        if ratio > UNBALANCED:
            raise NotBalanced(str(worst))
    return ratio


def _by_body(model: Model, cells: CellGeometry, forces: np.ndarray) -> np.ndarray:
    """Return the greatest of some forces of owned cells in each body; collective."""
    return greatest_of_bodies(model.space.comm, model.bodies, cells.nodes[: len(forces), 0], forces)


def _greatest_areas(cells: CellGeometry, count: int) -> np.ndarray:
    """Return the area of the greatest facet of each cell, shape (count,)."""
    return np.asarray(np.linalg.norm(cells.area[:count], axis=2).max(axis=1, initial=0.0))


def _shape_digits(cells: CellGeometry, area: np.ndarray) -> np.ndarray:
    """Return the last digit of a stress that is mapped to each cell [-].

    A cell of size h and least height a is mapped by numbers up to h/a, twice.

    Args:
        cells: Geometry.
        area: Area of the greatest facet of the first cells [length^(d-1)].
    """
    d = cells.d
    height = d * cells.volume[: len(area)] / area
    return np.asarray(np.finfo(float).eps * (area ** (1 / (d - 1)) / height) ** 2)


def _worst(model: Model, cells: CellGeometry, found: list[Found], scales: np.ndarray) -> _Worst:
    """Return the greatest missing force in the scale of its body; collective."""
    body, _ = model.bodies
    worst = _Worst(0.0, 0.0, "", ())
    for where, amounts, of_cells in found:
        ratios = _ratios(amounts, scales[body[cells.nodes[of_cells, 0]]])
        if ratios.max(initial=0.0) > worst.ratio:
            at = int(np.argmax(ratios))
            middle = cells.corners[of_cells[at]].mean(axis=0)
            worst = _Worst(float(ratios[at]), float(amounts[at]), where, tuple(middle.tolist()))
    return max(model.space.comm.allgather(worst), key=lambda found: found.ratio)


@dataclass(frozen=True)
class _Worst:
    """Hold the greatest missing force, in the unit of the greatest force on a facet.

    Attributes:
        ratio: Missing force over the greatest force on a facet of its body [-].
        force: Missing force [force].
        where: What it is missing in.
        place: A point there [length].
    """

    ratio: float
    force: float
    where: str
    place: tuple[float, ...]

    def __str__(self) -> str:
        """Say what is missing and where."""
        where = f"{self.where} near {place_words(self.place)}"
        return (
            f"The reconstructed stress is not in equilibrium, so that it certifies nothing: "
            f"{where} a force of {self.force:.3g} is missing, {self.ratio:.1e} "
            f"of the greatest on a facet of this body ({UNBALANCED:g} is allowed). Look for flat "
            "cells there, and for loads, moduli and lengths that are too far apart for double "
            "precision."
        )


def _ratios(amounts: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return forces over scales [-], infinite for no numbers and for scales of zero."""
    amounts, scales = np.broadcast_arrays(amounts, scales)
    infinite = np.full(amounts.shape, np.inf)
    ratios = np.divide(amounts, scales, where=scales > 0, out=infinite)
    return np.where(amounts == 0.0, 0.0, np.nan_to_num(ratios, nan=np.inf))


def _of_boundary(
    space: Space, cells: CellGeometry, moment: np.ndarray, given: Given
) -> tuple[np.ndarray, np.ndarray]:
    """Return the missing force on each facet of the boundary [force], and its cell."""
    cell = cells.side[0] // (cells.d + 1)
    is_owned = (cell >= 0) & (cell < space.domain.owned_cells)
    facets = np.flatnonzero(is_owned & ~cells.has_second)
    difference = moment[facets] - given.boundary[facets]
    difference *= ~given.fixed[facets, None]
    # The moments of a constant traction are its force over their number.
    missing = np.linalg.norm(difference, axis=2).max(axis=1, initial=0.0) * moment.shape[1]
    return missing, cell[facets]


def _of_law(traction: ContactTraction) -> Found:
    """Return by how much coefficients of r^ pull, or are beyond the friction bound."""
    side = traction.contact.trace.here
    pressure, shear, bound = traction.in_law()
    pull = np.zeros_like(pressure) if traction.contact.bilateral else -pressure
    beyond = np.maximum(pull, shear - bound).max(axis=1, initial=0.0)
    forces = (beyond * traction.area)[side.owned]
    return f"in the law of Contact({traction.contact.name!r})", forces, side.facets[side.owned, 0]


def _of_face(space: Space, cells: CellGeometry, face: RigidFace, moment: np.ndarray) -> Found:
    """Return the force missing in the resultants of a rigid face; collective.

    Moments are divided by the size of the body.
    """
    facets = space.facet_numbers(face.facets)
    on_face = np.zeros_like(moment)
    on_face[facets] = moment[facets]
    nodal = nodal_forces(space, cells, on_face, None)
    nodal.x.scatter_reverse(la.InsertMode.add)
    works = face.work(nodal.x.array.reshape(-1, space.d)) - face.resultants
    missing = abs(works / face.sizes)[face.free].max(initial=0.0)
    # Each rank with a part of the face tells it.
    cell = face.facets[:1, 0]
    return f"in the resultants of {face.what}", np.full(len(cell), missing), cell


def _of_sides(model: Model, moment: np.ndarray) -> list[Found]:
    """Return what is missing in given resultants on sides of copies; collective."""
    found = []
    for given in given_forces(model.scene, model):
        if given.of_sides:
            side = given.contact.trace.here
            facets = model.space.facet_numbers(side.facets[side.owned])
            # The given force acts on the other side.
            of_rank = float(moment[facets].sum(axis=(0, 1)) @ given.direction)
            missing = abs(model.space.comm.allreduce(of_rank) + given.force)
            # Each rank with a part of the sides tells it.
            cell = side.facets[:1, 0]
            found.append((f"in the force {given.name}", np.full(len(cell), missing), cell))
    return found


def _between_ranks(
    space: Space, cells: CellGeometry, moment: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the missing force on each facet between two ranks [force], and its cell.

    The rank of each of the two cells has its own moments. Moments of one side are minus
    moments of the other side: a sum over the ranks shows it, with weights of nodes that
    no order changes.
    """
    d = cells.d
    cell = cells.side // (d + 1)
    is_mine = (cells.side >= 0) & (cell < space.domain.owned_cells)
    facets = np.flatnonzero(cells.has_second & (is_mine[0] != is_mine[1]))
    sign = np.where(is_mine[0, facets], 1.0, -1.0)
    of_cell, i = np.divmod(cells.side[0, facets], d + 1)
    nodes = cells.nodes[of_cell[:, None], local_facet_nodes(d, cells.degree)[i]]
    weight = 1.0 + (space.global_numbers(nodes) * GOLDEN) % 1.0
    total = la.vector(space.mesh.topology.index_map(d - 1), d)
    rows = total.array.reshape(-1, d)
    rows[facets] = sign[:, None] * np.einsum("fm,fmi->fi", weight, moment[facets])
    total.scatter_reverse(la.InsertMode.add)
    total.scatter_forward()
    mine = np.where(is_mine[0, facets], cell[0, facets], cell[1, facets])
    return np.linalg.norm(rows[facets], axis=1), mine
