"""Carry the state of a law, and a displacement, to another mesh of the body.

A mesh that refines the last one has the same state: points inside its cells lie in the
cells that were cut. On any other mesh the state is interpolated at points inside the
cells, and what the interpolation changes is measured (``moved``). A point takes the
state of its own body, also where bodies overlap: while the old cells of points are
looked for, the bodies stand beside each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.law.law_entries import StateField
from erc_contact.model.law.law_state import LawState, polynomials_in_cells
from erc_contact.model.motions.rigid_motions import bodies_of_nodes
from erc_contact.model.space import Space
from erc_contact.scene.potential import Potential, remembers
from namedmesh.base.ranks import distinct_rows
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import NO_TAG, tag_table
from namedmesh.simplex import measures

PADDINGS = (1e-3, 1e-2, 1e-1)
"""How far the new mesh may bulge beyond the old one, over the extent of the body [-].

They are tried one after the other.
"""
PLACE_OF_BODY = 2.0
"""Distance of bodies that stand beside each other, over the extent of all [-]."""


def carry_state(state: StateField, space: Space) -> StateField:
    """Return the state on another mesh of the body; collective."""
    old = state.values.function_space
    new = polynomials_in_cells(space, state.size)
    if old.mesh is space.mesh and old.ufl_element() == new.function_space.ufl_element():
        return state
    # A degree more tells what the new mesh does not represent.
    finer = polynomials_in_cells(space, state.size, more=1)
    with _side_by_side([space, state.space]):
        covers = [_interpolate(state.values, function, space) for function in (new, finer)]
    if not all(covers):
        raise InputError(
            "after: the mesh of that solution does not cover the body, so plastic strain and "
            "hardening are not known everywhere. Give a solution on a mesh of the same body."
        )
    cells = space.owned_cells
    of_old = LawState(space, finer).in_cells(cells)
    points = finer.function_space.element.interpolation_points
    of_new = space.everywhere(new)(space.cell_points(points, cells), cells)
    volume = measures(space.cell_corners()[cells])
    sums = []
    for field in (of_new - of_old, of_old):
        local = float(volume @ (field**2).sum(axis=-1).mean(axis=1))
        sums.append(space.comm.allreduce(local, MPI.SUM))
    moved = float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0 else 0.0
    return LawState(space, new, moved)


def state_of(space: Space, potential: Potential, before: StateField | None) -> StateField | None:
    """Return the state of a body before a load step; None of laws without; collective.

    Args:
        space: The mesh.
        potential: The law.
        before: The state at the end of the last step, None at first.
    """
    if not remembers(potential):
        return None
    return LawState.at_rest(space, potential) if before is None else carry_state(before, space)


def carry_displacement(u: fem.Function, old: Space, space: Space) -> fem.Function | None:
    """Return a displacement of another mesh on a mesh; collective.

    Where parts of one body touch, it may be the displacement of either part. It is None
    where the other mesh does not cover the mesh.
    """
    result = space.function()
    if u.function_space.mesh is not space.mesh:
        with _side_by_side([space, old]):
            return result if _interpolate(u, result, space) else None
    result.interpolate(u)
    return result


def _interpolate(old: fem.Function, new: fem.Function, space: Space) -> bool:
    """Interpolate a function of another mesh at the nodes of a function; collective.

    The meshes are in units of their extent, see :func:`_side_by_side`.

    Returns:
        Whether the other mesh covers these nodes.
    """
    cells = space.owned_cells
    spaces = new.function_space, old.function_space
    for padding in PADDINGS:
        data = fem.create_interpolation_data(*spaces, cells, padding=padding)
        is_found = bool((data.src_owner >= 0).all())
        if space.comm.allreduce(is_found, MPI.LAND):
            new.interpolate_nonmatching(old, cells, interpolation_data=data)
            new.x.scatter_forward()
            return True
    return False


@contextmanager
def _side_by_side(spaces: Sequence[Space]) -> Iterator[None]:
    """Let the bodies of two meshes stand beside each other, in units of their extent.

    DOLFINx compares distances with fixed numbers: in a body of 1e-9 all cells are near.
    The bodies stay where they are unless both meshes have the same ones.
    """
    length = spaces[0].domain.extent
    numbers = _same_bodies(spaces)
    if spaces[0].mesh is spaces[1].mesh:
        spaces, numbers = spaces[:1], numbers[:1]
    places = [space.mesh.geometry.x.copy() for space in spaces]
    try:
        for space, number in zip(spaces, numbers, strict=True):
            geometry = space.mesh.geometry
            geometry.x[:] /= length
            along = np.zeros(len(geometry.x))
            along[cell_nodes(geometry)] = number[:, None]
            geometry.x[:, 0] += PLACE_OF_BODY * along
        yield
    finally:
        for space, x in zip(spaces, places, strict=True):
            space.mesh.geometry.x[:] = x


def _same_bodies(spaces: Sequence[Space]) -> list[np.ndarray]:
    """Number the bodies of two meshes alike, by their regions; collective.

    Returns:
        The number of the body of each cell of each mesh, shape (cells,). All are zero
        where the meshes have other bodies, as after a joint was tied.
    """
    regions = [_regions_of_bodies(space) for space in spaces]
    names = [sorted(set(of_bodies)) for _, of_bodies in regions]
    numbers = []
    for of_cells, of_bodies in regions:
        number = np.zeros(len(of_bodies), dtype=int)
        if names[0] == names[1]:
            number[:] = [names[0].index(name) for name in of_bodies]
        numbers.append(number[of_cells])
    return numbers


def _regions_of_bodies(space: Space) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Return the body of each cell here, and the regions of each body; collective."""
    body, count = bodies_of_nodes(space)
    of_cells = body[space.nodes[:, 0]]
    tags = space.domain.cell_tags
    region = np.full(len(of_cells), NO_TAG) if tags is None else tag_table(tags)
    pairs = distinct_rows(space.comm, np.column_stack([of_cells, region]))
    return of_cells, [tuple(pairs[pairs[:, 0] == number, 1].tolist()) for number in range(count)]
