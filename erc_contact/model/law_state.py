"""Hold the state of a law before a load step: plastic strain and hardening, say.

It is what the body remembers, tensors and numbers at each point, as a polynomial of
degree k-1 in each cell. The law of a load step is a potential for this state. The state
after the step follows from the strain at its end.

A mesh that refines the last one has the same state: its cells inherit the polynomials.
On any other mesh the state is interpolated at points inside the cells, and what the
interpolation changes is measured (``moved``). The search for the old cell of a point
does not know bodies: where bodies overlap, it may find a cell of the other body.

Symbols: k degree of the displacement, n cells, q points of a cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.named import INSIDE_CELLS
from erc_contact.mesh.simplex import measures
from erc_contact.model.expressions import Everywhere
from erc_contact.model.law_entries import StateField, entries, size_of
from erc_contact.model.space import Space
from erc_contact.scene.potential import Potential, Remembering, Shapes, remembers

ValuesAt = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A function of points (n, q, d) of cells (n,) that returns values (n, q, size)."""
PADDINGS = (1e-3, 1e-2, 1e-1)
"""How far the new mesh may bulge beyond the old one, over the extent of the body [-].

They are tried one after the other.
"""


class LawState:
    """Hold a state as a function of the cells; construction is collective.

    Args:
        values: The entries, tensors in Mandel components, shape (size,) at each point.

    Attributes:
        values: As given.
        size: Number of components.
        varies_in_cells: Whether they vary inside cells.
        moved: What the interpolation on another mesh changed: the root of the mean
            square of the difference at points, over the root of the mean square of the
            state [-].
    """

    def __init__(self, values: fem.Function, moved: float = 0.0) -> None:
        self.values = values
        (self.size,) = values.ufl_shape
        self.varies_in_cells = values.ufl_element().embedded_superdegree > 0
        self.moved = moved
        self._at = Everywhere(values, values.function_space.mesh)

    @classmethod
    def at_rest(cls, space: Space, potential: Remembering) -> LawState:
        """Return the state of a body that has not been loaded: zero."""
        return cls(_function(space, size_of(potential.state)))

    def at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the entries at points (n, q, d) of cells (n,), shape (n, q, size)."""
        return self._at(x, cells)

    def ufl(self, shapes: Shapes) -> dict[str, Ufl]:
        """Return the entries of the state by their names, UFL."""
        return entries(shapes, [self.values[i] for i in range(self.size)])

    def in_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the values at the nodes inside cells (n,), shape (n, q, size)."""
        blocks = self.values.x.array.reshape(-1, self.size)
        return np.asarray(blocks[self.values.function_space.dofmap.list[cells]])

    @classmethod
    def of(cls, space: Space, size: int, values_at: ValuesAt) -> LawState:
        """Return a field by its values at points of cells; collective.

        Args:
            space: The mesh.
            size: Number of components.
            values_at: Gives them at points of cells.
        """
        values = _function(space, size)
        W = values.function_space
        cells = space.owned_cells
        x = space.cell_points(W.element.interpolation_points, cells)
        blocks = values.x.array.reshape(-1, size)
        blocks[W.dofmap.list[cells].ravel()] = values_at(x, cells).reshape(-1, size)
        values.x.scatter_forward()
        return cls(values)

    def on(self, space: Space) -> LawState:
        """Return the state on another mesh of the body; collective."""
        old = self.values.function_space
        new = _function(space, self.size)
        if old.mesh is space.mesh and old.ufl_element() == new.function_space.ufl_element():
            return self
        # A degree more tells what the new mesh does not carry.
        finer = _function(space, self.size, more=1)
        for function in (new, finer):
            if not _interpolate(self.values, function, space):
                raise InputError(
                    "after: the mesh of that solution does not cover the body, so plastic strain "
                    "and hardening are not known everywhere. Give a solution on a mesh of the same "
                    "body."
                )
        cells = space.owned_cells
        of_old = LawState(finer).in_cells(cells)
        points = finer.function_space.element.interpolation_points
        of_new = Everywhere(new, space.mesh)(space.cell_points(points, cells), cells)
        volume = measures(space.cell_corners()[cells])
        sums = []
        for field in (of_new - of_old, of_old):
            local = float(volume @ (field**2).sum(axis=-1).mean(axis=1))
            sums.append(space.comm.allreduce(local, MPI.SUM))
        return LawState(new, float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0 else 0.0)


def state_of(space: Space, potential: Potential, before: StateField | None) -> StateField | None:
    """Return the state of a body before a load step; None of laws without; collective.

    Args:
        space: The mesh.
        potential: The law.
        before: The state at the end of the last step, None at first.
    """
    if not remembers(potential):
        return None
    return LawState.at_rest(space, potential) if before is None else before.on(space)


def carry_displacement(u: fem.Function, space: Space) -> fem.Function | None:
    """Return a displacement of another mesh on a mesh; collective.

    Where parts of the body touch, it may be the displacement of either part. It is None
    where the other mesh does not cover the mesh.
    """
    result = space.function()
    if u.function_space.mesh is not space.mesh:
        return result if _interpolate(u, result, space) else None
    result.interpolate(u)
    return result


def _function(space: Space, size: int, more: int = 0) -> fem.Function:
    """Return polynomials of degree k-1 (and more) in each cell, zero everywhere."""
    return space.domain.function(INSIDE_CELLS, space.degree - 1 + more, (size,))


def _interpolate(old: fem.Function, new: fem.Function, space: Space) -> bool:
    """Interpolate a function of another mesh at the nodes of a function; collective.

    Returns:
        Whether the other mesh covers these nodes.
    """
    cells = space.owned_cells
    spaces = new.function_space, old.function_space
    meshes = list(dict.fromkeys(V.mesh for V in spaces))
    with _in_units_of(space.domain.extent, meshes):
        for padding in PADDINGS:
            data = fem.create_interpolation_data(*spaces, cells, padding=padding)
            is_found = bool((data.src_owner >= 0).all())
            if space.comm.allreduce(is_found, MPI.LAND):
                new.interpolate_nonmatching(old, cells, interpolation_data=data)
                new.x.scatter_forward()
                return True
    return False


@contextmanager
def _in_units_of(length: float, meshes: Sequence[dmesh.Mesh]) -> Iterator[None]:
    """Measure meshes by a length while DOLFINx looks for points in them.

    It compares distances with fixed numbers: in a body of 1e-9 all cells are near.
    """
    places = [mesh.geometry.x.copy() for mesh in meshes]
    try:
        for mesh in meshes:
            mesh.geometry.x[:] /= length
        yield
    finally:
        for mesh, x in zip(meshes, places, strict=True):
            mesh.geometry.x[:] = x
