"""Energies and resultants of bodies that supports leave rigid motions, iteratively."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.linear.hierarchy import free_motions
from erc_contact.newton.linear.krylov import fgmres
from erc_contact.newton.linear.multigrid import Multigrid

DISTANCE_TOLERANCE = 0.1
"""Tolerance of the linear solve that measures the distance to the solution [-]."""


def rough_energy(elastic: Multigrid, force: PETSc.Vec) -> float:
    """Estimate ``R.K^-1 R`` of forces R, where a weak glue holds a loose body."""
    weak = elastic.weak_glue()
    u = force.duplicate()
    glue_force = force.duplicate()

    def weakly_glued(y: PETSc.Vec, result: PETSc.Vec) -> None:
        elastic.times(y, result)
        weak.mult(y, glue_force)
        result.axpy(1.0, glue_force)

    fgmres(weakly_glued, elastic.cycle, force, u, DISTANCE_TOLERANCE)
    energy = float(force.dot(u))
    for done in (weak, u, glue_force):
        done.destroy()
    return energy


def imbalance(elastic: Multigrid, x: PETSc.Vec, other_forces: PETSc.Vec, least: float) -> float:
    """Return the resultant of K x on free motions over the contact forces [-].

    It is round-off.

    Args:
        elastic: The elastic equations of a model with free motions.
        x: The unknowns, in any scale.
        other_forces: What the contact forces are beside K x, in the same scale; they
            become the contact forces, in place.
        least: Contact forces of round-off, below which they do not count less.
    """
    forces = elastic.matrix.createVecRight()
    elastic.times(x, forces)
    motions = free_motions(elastic.model, elastic.matrix)
    resultants = [motion.dot(forces) for motion in motions.getVecs()]
    other_forces.axpy(1.0, forces)
    other_forces.array[elastic.fixed] = 0.0
    size = max(other_forces.norm(), least)
    forces.destroy()
    for motion in motions.getVecs():
        motion.destroy()
    motions.destroy()
    return float(np.linalg.norm(resultants)) / size
