"""Put preloads on a mesh: the jump across a cut as a given strain.

The sides of a cut are one on the mesh, and the displacement is

    u = u_c + q psi,    psi = chi d in the cells of the first side, else 0,

with u_c continuous, q the shift, d the axis, and chi the P1 function that is 1 at the
vertices of the cut and 0 at all others. So the jump is q d exactly, and the stress is

    sigma = C (eps(u_c) - eps_0),    eps_0 = -q eps(psi),

the stress of a given strain that is constant in cells. A law with a potential takes the
strain of u itself, ``eps(u_c) - eps_0``, so that it may yield at the cut as elsewhere.
What the package calls the displacement is u_c. It differs from u in the cells of the
first side that touch the cut, and nowhere else.

If a cut parts a body in two, the half W on one side is in balance with the force F of
the cut, the loads, and the contacts. With the motion of this half along the axis,

    int r . d + f(d) + F(d) = -F    over the half,

so that the traction r of contacts tells the force of the cut, and the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.motions.rigid_motions import bodies_of_nodes
from erc_contact.model.space import Space
from erc_contact.scene.material import mandel_basis
from erc_contact.scene.tied import Preload, Tied
from namedmesh.base.names import listed
from namedmesh.base.ranks import union
from namedmesh.for_solvers import inner_facets
from namedmesh.simplex import barycentric

NO_DIRECTION = 0.1
"""Length of the mean of unit normals below which a cut has no axis [-]."""
ACROSS = 1e-8
"""Cosine of an angle that counts as a right one [-]."""


@dataclass(frozen=True, eq=False)
class PreloadOnMesh:
    """Hold a preload on a mesh.

    Attributes:
        name: Name of the first side.
        against: Name of the other side.
        axis: d, unit vector out of the first side [-], shape (d,).
        on_cut: Which nodes of this rank are on the cut, shape (nodes,).
        weights: chi at the vertices of each cell of this rank, zero in cells that are
            not of the first side [-], shape (cells, d+1).
        gradient: Gradient of chi in these cells [1/length], a DG0 Function.
    """

    name: str
    against: str
    axis: np.ndarray
    on_cut: np.ndarray
    weights: np.ndarray
    gradient: fem.Function

    def strain(self, shift: float) -> Ufl:
        """Return the given strain eps_0 of a shift [length], UFL (d, d)."""
        mesh = self.gradient.function_space.mesh
        components = []
        for component in shift * self.axis:
            components.append(compiled.constant(mesh, float(-component)))
        return ufl.sym(ufl.outer(ufl.as_vector(components), self.gradient))


def bind_preloads(
    space: Space, ties: Sequence[Tied], joints: Sequence[ContactOnMesh]
) -> list[PreloadOnMesh]:
    """Put the preloads among tied joints on a mesh; collective.

    Args:
        space: The mesh, on which the joints are glued.
        ties: The joints of the scene.
        joints: The same on the mesh.

    Raises:
        InputError: If the normals of a cut have no mean, or it ends inside a body.
    """
    preloads = []
    for tie, joint in zip(ties, joints, strict=True):
        if isinstance(tie, Preload):
            preloads.append(_bind_preload(space, joint))
    return preloads


def shifts_of(ties: Sequence[Tied]) -> dict[str, float]:
    """Return the shifts of the preloads among tied joints by their names [length]."""
    shifts = {}
    for tie in ties:
        if isinstance(tie, Preload):
            assert tie.shortening is not None, "a scene is solved with the shifts of its preloads"
            shifts[tie.facets] = float(tie.shortening)
    return shifts


def jumps_at(
    preloads: Sequence[PreloadOnMesh],
    shifts: Mapping[str, float],
    cell: np.ndarray,
    x: np.ndarray,
    corners: np.ndarray,
) -> np.ndarray:
    """Return the sum of ``q psi`` of preloads at points of cells [length], (n, d).

    Args:
        preloads: The preloads.
        shifts: q of each by its name [length].
        cell: Cell of each point, shape (n,).
        x: The points [length], shape (n, d).
        corners: Vertices of all cells [length], shape (cells, d+1, d).
    """
    total = np.zeros(x.shape)
    for preload in preloads:
        of_cells = corners[cell]
        inverse = np.linalg.inv(of_cells[:, 1:] - of_cells[:, :1])
        local = np.einsum("ni,nij->nj", x - of_cells[:, 0], inverse)
        chi = (barycentric(local) * preload.weights[cell]).sum(axis=1)
        total += shifts[preload.name] * chi[:, None] * preload.axis
    return total


def jump_gradients(
    preloads: Sequence[PreloadOnMesh], shifts: Mapping[str, float], cells: np.ndarray, d: int
) -> np.ndarray:
    """Return the derivatives of the sum of ``q psi`` in cells [-], shape (n, d, d)."""
    total = np.zeros((len(cells), d, d))
    for preload in preloads:
        slopes = preload.gradient.x.array.reshape(-1, d)[cells]
        total += shifts[preload.name] * preload.axis[:, None] * slopes[:, None, :]
    return total


def jump_strains(
    space: Space, preloads: Sequence[PreloadOnMesh], shifts: Mapping[str, float]
) -> np.ndarray:
    """Return the strain ``-eps_0`` of the jumps of preloads in cells of this rank [-].

    Args:
        space: The mesh.
        preloads: The preloads.
        shifts: q of each by its name [length].

    Returns:
        Mandel components of the mesh, shape (cells, s).
    """
    slopes = jump_gradients(preloads, shifts, np.arange(len(space.nodes)), space.d)
    return np.asarray(np.einsum("nij,sij->ns", slopes, mandel_basis(space.d)))


def check_beside_cuts(
    space: Space,
    preloads: Sequence[PreloadOnMesh],
    held: Sequence[tuple[str, np.ndarray, np.ndarray]],
    contacts: Sequence[ContactOnMesh],
) -> None:
    """Check that nothing reads the displacement of the cells beside cuts; collective.

    Args:
        space: The mesh.
        preloads: The preloads.
        held: Name, facets and held components of each support and spring.
        contacts: The contacts.

    Raises:
        InputError: If a support or a spring holds these cells along the axis, or a
            contact with friction or with a normal along the axis touches them.
    """
    for preload in preloads:
        holding = set()
        for name, facets, components in held:
            if preload.axis[components].any() and _touches(preload, facets).any():
                holding.add(name)
        for contact in contacts:
            for side in (contact.trace.here, contact.trace.there):
                reads = abs(space.outward_normals(side.facets) @ preload.axis) > ACROSS
                reads |= contact.friction is not None
                if (reads & _touches(preload, side.facets)).any():
                    holding.add(contact.name)
        names = sorted(union(space.comm, holding))
        if names:
            raise InputError(
                f"Preload({preload.name!r}): {listed(names)} acts on cells of {preload.name!r} at"
                " the cut, which the shift moves. Put the cut where the body is free, or name"
                f" {preload.against!r} first if its cells are."
            )


def _touches(preload: PreloadOnMesh, facets: np.ndarray) -> np.ndarray:
    """Tell which facets (cell, local facet) psi moves, shape (f,)."""
    cell, opposite = facets.T
    weights = preload.weights[cell]
    # A facet has all vertices of its cell but the opposite one, which has its number.
    weights[np.arange(len(cell)), opposite] = 0.0
    return np.asarray(weights.any(axis=1))


def _bind_preload(space: Space, joint: ContactOnMesh) -> PreloadOnMesh:
    """Put a preload on a mesh, given its cut as a tied joint; collective."""
    axis = _axis(space, joint)
    if space.axisymmetric and axis[0] != 0.0:
        raise InputError(
            f"Preload({joint.name!r}): the axis of the cut is {tuple(axis.tolist())}; the cut"
            " through an axisymmetric bolt is level, with the axis (0, 1)."
        )
    first, _ = space.sides_of_joint(joint.side_names)
    is_first = first.x.array > 0.5
    marks = space.function()
    marks.x.array.reshape(-1, space.d)[joint.trace.here.nodes] = 1.0
    # A rank may see a node without the facet: its owner sees all.
    marks.x.scatter_forward()
    on_cut = marks.x.array.reshape(-1, space.d)[:, 0] > 0.5
    _check_whole(space, joint, is_first, on_cut)
    weights = np.where(is_first[:, None], on_cut[space.vertices], False).astype(float)
    gradient = space.domain.function("DG", 0, (space.d,))
    of_cells = gradient.x.array.reshape(-1, space.d)
    touching = np.flatnonzero(weights.any(axis=1))
    corners = space.cell_corners()[touching]
    slopes = np.linalg.inv(corners[:, 1:] - corners[:, :1])
    rises = weights[touching, 1:] - weights[touching, :1]
    of_cells[touching] = np.einsum("nji,ni->nj", slopes, rises)
    name, against = joint.side_names
    return PreloadOnMesh(name, against, axis, on_cut, weights, gradient)


def _axis(space: Space, joint: ContactOnMesh) -> np.ndarray:
    """Return the mean outward unit normal of the first side; collective."""
    side = joint.trace.here
    local = side.owned_areas @ space.outward_normals(side.facets)
    local = np.append(local, side.owned_areas.sum())
    total = space.comm.allreduce(local)
    mean = total[:-1] / total[-1]
    length = float(np.linalg.norm(mean))
    if length < NO_DIRECTION:
        raise InputError(
            f"Preload({joint.name!r}): the normals of the cut have no mean, so that it has no"
            " axis; cut the body across, by a plane."
        )
    axis: np.ndarray = mean / length
    # Round-off of a plane along an axis would be a motion across it.
    axis[abs(axis) < ACROSS] = 0.0
    return axis / np.linalg.norm(axis)


def _check_whole(
    space: Space, joint: ContactOnMesh, is_first: np.ndarray, on_cut: np.ndarray
) -> None:
    """Check that the sides of a cut are connected through the cut alone; collective.

    Args:
        space: The mesh.
        joint: The cut.
        is_first: Which cells of this rank are of the first side, shape (cells,).
        on_cut: Which nodes are on the cut, shape (nodes,).

    Raises:
        InputError: If cells of the first side share a facet at the cut with others.
    """
    facets, cells = inner_facets(space.mesh)
    crosses = is_first[cells[:, 0]] != is_first[cells[:, 1]]
    crosses &= ~np.isin(facets, space.facet_numbers(joint.trace.here.facets))
    crosses &= (cells < space.domain.owned_cells).any(axis=1)
    first, second = space.vertices[cells[crosses]].swapaxes(0, 1)
    # The vertices of a facet are those that both of its cells have.
    shared = (first[:, :, None] == second[:, None]).any(axis=2)
    torn = bool((shared & on_cut[first]).any())
    error = None
    if space.comm.allreduce(int(torn)):
        error = InputError(
            f"Preload({joint.name!r}): the cut ends inside the body, where a shift cannot end:"
            f" cells of {joint.name!r} and of {joint.against!r}, or of a third region, share"
            " facets beside it. Let the cut go through the whole section of a body."
        )
    raise_together(space.comm, error)


def motions_of_halves(
    model: Any, forces: Mapping[str, float]
) -> tuple[list[fem.Function], list[float]]:
    """Return motions of halves of bolts, and works on them; collective.

    Args:
        model: The scene on a mesh.
        forces: The force of each bolt by the name of its preload [force].

    Returns:
        Translations of halves that contacts alone hold, along the axis out of them [-].
        The work of the loads and of the force of the cut on them [force].
    """
    motions = []
    works = []
    for preload in model.preloads:
        half = _free_half(model, preload) if preload.name in forces else None
        if half is not None:
            motion, work = half
            motions.append(motion)
            works.append(work + forces[preload.name])
    return motions, works


def _free_half(model: Any, preload: PreloadOnMesh) -> tuple[fem.Function, float] | None:
    """Return the motion of a half and the work of the loads on it; collective.

    None if the cut parts no body, or supports or springs hold both halves.
    """
    space = model.space
    body, count = bodies_of_nodes(space, preload.on_cut)
    of_first = preload.weights.any(axis=1)
    touching = preload.on_cut[space.vertices].any(axis=1)
    halves = []
    for cells in (of_first, touching & ~of_first):
        numbers = np.zeros(count, dtype=bool)
        nodes = space.nodes[cells].ravel()
        numbers[body[nodes[~preload.on_cut[nodes]]]] = True
        halves.append(np.logical_or.reduce(space.comm.allgather(numbers)))
    if (halves[0] & halves[1]).any():
        return None
    held = np.zeros(count, dtype=bool)
    held[body[(model.held_or_anchored & (preload.axis != 0.0)).any(axis=1)]] = True
    for spring in model.springs:
        held[body[spring.side.nodes.ravel()]] = True
    held = np.logical_or.reduce(space.comm.allgather(held))
    for half, sign in zip(halves, (1.0, -1.0), strict=True):
        if not (half & held).any():
            motion = space.function()
            motion.x.array.reshape(-1, space.d)[half[body]] = sign * preload.axis
            return motion, _work_of_loads(model, half[body], sign * preload.axis, motion)
    return None


def _work_of_loads(
    model: Any, is_of_half: np.ndarray, axis: np.ndarray, motion: fem.Function
) -> float:
    """Return the work of the loads on a half along an axis [force]; collective.

    Cells at the cut have their share of the loads, too.
    """
    space = model.space
    indicator = space.indicator(is_of_half[space.nodes].any(axis=1))
    direction = compiled.constant(space.mesh, axis)
    work = 0.0
    loads = model.loads(indicator * direction)
    if loads is not None:
        work += fem.assemble_scalar(compiled.form(loads))
    if model.face_forces is not None:
        # Each of these forces is at the node of its owner alone.
        work += float(model.face_forces.x.array @ motion.x.array)
    return float(space.comm.allreduce(work, MPI.SUM))
