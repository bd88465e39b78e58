"""Small rigid motions by which supports of a scene are moved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.motions.rigid_faces import bind_rigid
from erc_contact.model.space import Space
from erc_contact.scene.support import Displacement, Rigid

Shift = float | Callable[[Ufl], Ufl]
"""Type of a component of a motion: a number, or a callable of the position."""


@dataclass(frozen=True, eq=False)
class VirtualMotion:
    """Represent a rigid motion ``W(x) = a + omega x (x - c)``.

    Attributes:
        translation: a, shape (d,).
        rotation: omega, shape (1,) in the plane, counterclockwise, (3,) in 3D.
        centre: c [length], shape (d,).
    """

    translation: np.ndarray
    rotation: np.ndarray
    centre: np.ndarray

    @classmethod
    def along(cls, a: np.ndarray) -> VirtualMotion:
        """Return the translation by a vector."""
        turns = 1 if len(a) == 2 else 3
        return cls(a, np.zeros(turns), np.zeros(len(a)))

    @property
    def spin(self) -> np.ndarray:
        """Return the matrix B with ``B x = omega x x``, shape (d, d)."""
        if len(self.translation) == 2:
            return self.rotation[0] * np.array([[0.0, -1.0], [1.0, 0.0]])
        return np.cross(self.rotation, np.eye(3)).T

    def at(self, x: np.ndarray) -> np.ndarray:
        """Return the motion at positions, shapes (..., d)."""
        return np.asarray(self.translation + (x - self.centre) @ self.spin.T)

    def nodal(self, space: Space) -> fem.Function:
        """Return the motion at the nodes of a mesh, where it is exact."""
        motion = space.function()
        x = space.V.tabulate_dof_coordinates()[:, : space.d]
        motion.x.array[:] = self.at(x).ravel()
        return motion

    def size(self, space: Space) -> float:
        """Return its largest displacement on a mesh; collective."""
        values = self.nodal(space).x.array.reshape(-1, space.d)
        largest = float(np.linalg.norm(values, axis=1).max(initial=0.0))
        return float(space.comm.allreduce(largest, MPI.MAX))

    def freedoms(self, centre: np.ndarray) -> np.ndarray:
        """Return its translation at a point and its rotation, shape (freedoms,)."""
        return np.concatenate([self.at(centre), self.rotation])

    def component(self, direction: np.ndarray, t: float) -> Shift:
        """Return t W along a unit vector, as a component of a support may be."""
        row = t * (direction @ self.spin)
        constant = float(t * (direction @ self.translation))
        if not row.any():
            return constant
        return partial(_affine, constant, row.tolist(), self.centre.tolist())

    def moves(self, space: Space, support: Displacement | Rigid) -> bool:
        """Tell whether a support has components that move; collective."""
        moved = self.move(space, support, 1.0)
        if isinstance(support, Rigid) and isinstance(moved, Rigid):
            return moved.motions != support.motions
        return moved != support

    def move(self, space: Space, support: Displacement | Rigid, t: float) -> Displacement | Rigid:
        """Return a support moved by t W, in the components that it has; collective."""
        if isinstance(support, Displacement):
            values = []
            for unit, value in zip(np.eye(space.d), support.value, strict=True):
                values.append(shift_value(value, self.component(unit, t)))
            return Displacement(support.facets, tuple(values))
        shifts = t * self.freedoms(bind_rigid(space, support).about)
        motions = tuple(map(shift_value, support.motions, shifts.tolist()))
        displacement = motions[: space.d]
        rotation = motions[space.d :]
        return replace(support, displacement=displacement, rotation=rotation)


def _affine(constant: float, row: list[float], centre: list[float], x: Ufl) -> Ufl:
    """Return ``constant + row . (x - centre)``."""
    value: Ufl = constant
    for i, factor in enumerate(row):
        value = value + factor * (x[i] - centre[i])
    return value


def shift_value(value: Any, shift: Shift) -> Any:
    """Return a component of a support, or a gap, and a shift; None where it is free."""
    if value is None or (not callable(shift) and shift == 0):
        return value
    if callable(value) or callable(shift):
        return partial(_sum_at, value, shift)
    return float(value + shift)


def _sum_at(value: Any, shift: Any, x: Ufl) -> Ufl:
    """Return the sum of a value and a shift at a position."""
    of_value = field_of(value, x) if callable(value) else value
    of_shift = field_of(shift, x) if callable(shift) else shift
    return of_value + of_shift
