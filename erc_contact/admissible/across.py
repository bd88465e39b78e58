"""Forces between copies of a body with which an elastic change fits across the sides.

What is missing in equilibrium moves each copy as if it were cut off. The copies hold
each other: opposite forces on both sides close the jump that opens there,

    B (u + K^+ B^T W t) = J,    W t the forces of tractions t.

Conjugate gradients find t, with an elastic solve a step. No t does work on a jump that
is free: tractions keep their resultants where a mean stress gives them, and the balance
on rigid motions. So the forces are in equilibrium after any step.

Symbols: B u jump of a displacement between both sides; J the jump that is given; K^+
displacement of copies that are cut off under forces; W area of each node of a facet.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.balance_parts import Motion, jump_of
from erc_contact.model.model import Model
from erc_contact.newton.linear.solver import ElasticSolver

FIT_STEPS = 60
"""Limit of the steps; 5 to 30 are usual."""
FITS = 1e-5
"""Jump at the end, over the jump at the begin [-]."""
SMALL_JUMP = 1e-11
"""Jump that is round-off of the displacement, over the greatest one [-]."""
ZERO_WORK = 1e-12
"""Share of a work that counts as none [-]."""


class Across:
    """Close the jump of a displacement across the sides of copies.

    Args:
        model: The scene on a mesh.
        motions: Motions and jumps on which tractions of the sides may do no work.
    """

    def __init__(self, model: Model, motions: Sequence[Motion]) -> None:
        self._model = model
        self._sides = [contact for contact in model.contacts if contact.is_periodic]
        weights = []
        free = []
        for contact in self._sides:
            side = contact.trace.here
            share = side.owned_areas / side.nodes.shape[1]
            weights.append(np.repeat(share, side.nodes.shape[1] * side.d))
            free.append(~contact.trace.fixed(model.fixed).ravel())
        self._weight = np.concatenate(weights)
        self._free = np.concatenate(free)
        self._shapes = np.zeros((len(motions), len(self._weight)))
        for shape, motion in zip(self._shapes, motions, strict=True):
            shape[:] = np.concatenate([jump_of(c, motion).ravel() for c in self._sides])
        local = (self._shapes * self._weight) @ self._shapes.T
        products = model.space.comm.allreduce(local, MPI.SUM)
        self._inverse = np.linalg.pinv(products, rcond=ZERO_WORK, hermitian=True)

    def forces(self, elastic: ElasticSolver, u: fem.Function) -> tuple[fem.Function, fem.Function]:
        """Return the forces that close the jump of u, and what they move; collective.

        Args:
            elastic: The elastic solver.
            u: A displacement [length].

        Returns:
            Nodal forces [force], not yet summed over ranks, and the displacement by
            them [length].
        """
        space = self._model.space
        forces, moved = space.function(), space.function()
        left = -self._without_motions(self._jump(u, given=True))
        square = begin = self._dot(left, left)
        size = space.comm.allreduce(abs(u.x.array).max(initial=0.0), MPI.MAX)
        area = space.comm.allreduce(float(self._weight.sum()), MPI.SUM)
        small = (SMALL_JUMP * size) ** 2 * area
        traction = left.copy()
        for _ in range(FIT_STEPS):
            if square <= max(FITS**2 * begin, small):
                break
            step_forces = self._back(traction)
            step = elastic.solve(step_forces, supports=False, tolerance=FITS / 10)
            closes = self._without_motions(self._jump(step))
            curvature = self._dot(traction, closes)
            # Where supports hold what faces, nothing moves.
            if not curvature > 0.0:
                break
            length = square / curvature
            forces.x.array[:] += length * step_forces.x.array
            moved.x.array[:] += length * step.x.array
            left -= length * closes
            before, square = square, self._dot(left, left)
            traction = left + square / before * traction
        return forces, moved

    def _jump(self, u: fem.Function, *, given: bool = False) -> np.ndarray:
        """Return the jump of u, less the given jump, at nodes of facets [length]."""
        jumps = []
        for contact in self._sides:
            jump = contact.trace.of(u.x.array)
            jumps.append((jump - given * contact.given_jump).ravel())
        return np.where(self._free, np.concatenate(jumps), 0.0)

    def _back(self, traction: np.ndarray) -> fem.Function:
        """Return the nodal forces of tractions [force], not yet summed over ranks."""
        forces = self._model.space.function()
        begin = 0
        for contact in self._sides:
            shape = contact.trace.here.places.shape
            end = begin + int(np.prod(shape))
            on_facets = (self._weight * traction)[begin:end].reshape(shape)
            forces.x.array[:] += contact.trace.back(on_facets).ravel()
            begin = end
        return forces

    def _without_motions(self, jump: np.ndarray) -> np.ndarray:
        """Return what a jump has beside the motions."""
        works = self._model.space.comm.allreduce(self._shapes @ (self._weight * jump), MPI.SUM)
        beside: np.ndarray = jump - (self._inverse @ works) @ self._shapes
        return beside

    def _dot(self, first: np.ndarray, second: np.ndarray) -> float:
        """Return the integral of a product over the sides; collective."""
        local = float((self._weight * first) @ second)
        return self._model.space.comm.allreduce(local, MPI.SUM)
