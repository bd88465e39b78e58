"""Measure what a displacement loses on its way from the cells of a file to a mesh.

The displacement u_f of a file lives in its own cells, hexahedra for instance; u is what
the mesh of a certificate has of it at its nodes, and u^ is u where u keeps supports and
gaps. The error e of u^ is not the error of u_f. But any displacement that keeps
supports and gaps has an error with sigma^, and need not live on the mesh. So take

    v = u^ + chi (u_f - u),

with chi linear in each cell of the mesh, 0 at the vertices on contacts, tied joints and
springs, and 1 at all other vertices. There v is u^; on supports u_f - u is zero, as
both have the prescribed values at nodes, if these are linear on each facet. With the
error e_v of v and sigma^, and

    e_T = |(1 - chi) (u_f - u)|,    |w|^2 = int C eps(w) : eps(w),

the bound of what the file has is

    |u_f + (u^ - u) - u_ex| <= e_v + e_T.

e_T is *the cost of the transfer*, and comes from the cells at contacts alone. Rigid
motions and displacements that are linear cost nothing on any mesh; neither do
displacements on triangles and tetrahedra whose nodes the mesh has.

Both are integrated by quadrature, of degree 2k in the sub-simplices of sigma^. Where
cells of the file end inside cells of the mesh, the strain of u_f jumps between its
points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, cell_geometry
from erc_contact.admissible.elastic import CHUNK, CellStrains
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.reference import mandel
from erc_contact.model.model import Model
from namedmesh.for_solvers import FieldOnMesh
from namedmesh.simplex import barycentric, lagrange, rule

COARSE_RULE = 4
"""Degree of the quadrature of e_T in each cell."""


@dataclass(frozen=True, eq=False)
class Lost:
    """Hold what a displacement has lost at points of some cells.

    Attributes:
        cells: The cells, shape (n,).
        x: The points [length], shape (n, q, d).
        strain: Strain of u_f - u in Mandel components, shape (n, q, s).
        of_chi: Strain of chi (u_f - u), the same shape.
    """

    cells: np.ndarray
    x: np.ndarray
    strain: np.ndarray
    of_chi: np.ndarray


def transfer_squares(
    model: Model, u: fem.Function, field: FieldOnMesh
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the squares of what is lost in the owned cells; collective.

    Args:
        model: The scene on the mesh.
        u: The displacement at its nodes [length].
        field: The displacement of the file.

    Returns:
        The squares of e_T and of ``|u_f - u|`` [force length], shape (owned,) each.
    """
    cells = cell_geometry(model.space)
    points, weights = rule(model.space.d, COARSE_RULE)
    stiffness = model.constitution.stiffness
    cost, whole = np.zeros((2, model.domain.owned_cells))
    for lost in _lost(model, cells, u, field, points):
        volume = cells.volume[lost.cells]
        for squares, strain in ((cost, lost.strain - lost.of_chi), (whole, lost.strain)):
            stress = stiffness.times(strain, lost.x, lost.cells)
            squares[lost.cells] = (stress * strain).sum(axis=2) @ weights * volume
    return cost, whole


def gain_in_file(pair: Admissible, u: fem.Function, field: FieldOnMesh) -> float:
    """Compute ``e_v^2 - e^2`` [force length], mostly negative; collective.

    Args:
        pair: The admissible pair of u.
        u: The displacement of the file at the nodes of the mesh [length].
        field: The displacement of the file.
    """
    model = pair.model
    cells = pair.cell_geometry
    _, points, weights = macro_points(model.space.d, model.space.degree)
    places = np.matmul(barycentric(points), cells.corners[: model.domain.owned_cells])
    stress = pair.stress_at_macro_points(places)
    on_mesh = CellStrains.of(model.space, cells, pair.displacement)
    law = model.constitution
    law.stiffness, law.metric  # noqa: B018 - all ranks make them together
    gain = 0.0
    for lost in _lost(model, cells, u, field, points):
        here = lost.cells
        strain = on_mesh.at_points(slice(here[0], here[-1] + 1), points, lost.x)
        before = law.squares(strain, stress[here], lost.x, here)[..., 0]
        after = law.squares(strain + lost.of_chi, stress[here], lost.x, here)[..., 0]
        gain += float(cells.volume[here] @ ((after - before) @ weights))
    return float(model.space.comm.allreduce(gain, MPI.SUM))


def _lost(
    model: Model, cells: CellGeometry, u: fem.Function, field: FieldOnMesh, points: np.ndarray
) -> Iterator[Lost]:
    """Iterate over owned cells, with what they lose at reference points (q, d)."""
    space = model.space
    d = space.d
    places = barycentric(points)
    on_mesh = CellStrains.of(space, cells, u)
    shape = lagrange(d, space.degree, points)
    nodal = u.x.array.reshape(-1, d)[cells.nodes]
    chi = _chi(model)[cells.vertices]
    # The gradients of the barycentric coordinates sum to zero.
    slope = np.einsum("ni,nij->nj", chi[:, 1:] - chi[:, :1], cells.inverse)
    owned = model.domain.owned_cells
    for begin in range(0, owned, CHUNK):
        here = np.arange(begin, min(begin + CHUNK, owned), dtype=np.int32)
        chunk = slice(begin, begin + len(here))
        x = np.matmul(places, cells.corners[chunk])
        values, gradients = field.in_cells(here, x)
        # The displacement of the mesh is without the jumps at cuts of preloads.
        flat = x.reshape(-1, d)
        values -= model.jumps_at(np.repeat(here, x.shape[1]), flat).reshape(x.shape)
        gradients -= model.jump_gradients(here)[:, None]
        in_mesh = mandel(0.5 * (gradients + gradients.swapaxes(2, 3)))
        in_file = space.section.strain_at(in_mesh, partial(np.asarray, values), x)
        strain = in_file - on_mesh.at_points(chunk, points, x)
        difference = values - np.matmul(shape, nodal[chunk])
        outer = difference[..., :, None] * slope[chunk, None, None, :]
        of_slope = mandel(0.5 * (outer + outer.swapaxes(2, 3)))
        of_chi = (chi[chunk] @ places.T)[..., None] * strain
        of_chi[..., : of_slope.shape[2]] += of_slope
        yield Lost(here, x, strain, of_chi)


def _chi(model: Model) -> np.ndarray:
    """Return chi at the nodes on this rank, of which that at vertices counts."""
    chi = np.ones(len(model.space.V.tabulate_dof_coordinates()))
    sides = [spring.side for spring in model.springs]
    for contact in (*model.contacts, *model.ties):
        sides += [side for side in (contact.trace.here, contact.trace.there) if side is not None]
    for side in sides:
        chi[side.nodes] = 0.0
    return chi
