"""PETSc's algebraic multigrid for elastic bodies: its options, and the rigid motions that its aggregates keep."""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.model import Model

PREFIX = "erc_contact_elastic_"
"""Prefix of PETSc options of the solver of elastic equations, as in ``-erc_contact_elastic_pc_type hypre``."""
OPTIONS = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.02,
    "pc_gamg_coarse_eq_limit": 500,
    "pc_gamg_aggressive_coarsening": 2,
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "sor",
}
"""Options that the user's override."""
RICHARDSON = 2
"""Greatest number of ranks with Richardson's method as smoother. The symmetric sweeps
are those of each rank alone. Where n ranks meet they may go n times as far as the whole
matrix allows, and from twice on the cycle is not positive definite: it was 2.1 times on
three ranks with nu = 0.49, and 2.5 times on eight. Chebyshev's method estimates this
number and goes less far, in as few cycles.
"""


def with_defaults(pc: PETSc.PC) -> None:
    """Set a preconditioner from PETSc's options, and from :data:`OPTIONS` where the user gives none."""
    options, prefix = PETSc.Options(), pc.getOptionsPrefix()
    smoother = "richardson" if pc.comm.size <= RICHARDSON else "chebyshev"
    wanted = {**OPTIONS, "mg_levels_ksp_type": smoother}
    ours = {
        prefix + name: value for name, value in wanted.items() if not options.hasName(prefix + name)
    }
    for name, value in ours.items():
        options[name] = value
    pc.setFromOptions()
    pc.setUp()  # the levels read their options here
    for name in ours:
        options.delValue(name)


def rigid_motions(model: Model, matrix: PETSc.Mat) -> PETSc.NullSpace:
    """The rigid motions of the plane or of space at the nodes: the near null space of the aggregates."""
    x = model.V.tabulate_dof_coordinates()[: model.V.dofmap.index_map.size_local, : model.d]
    x = x - model.comm.allreduce(x.sum(axis=0), MPI.SUM) / model.V.dofmap.index_map.size_global
    vectors = []
    for k in range(model.d):
        vectors.append(matrix.createVecRight())
        vectors[-1].array[k :: model.d] = 1.0
    for i in range(model.d):
        for j in range(i):
            vectors.append(matrix.createVecRight())
            vectors[-1].array[i :: model.d] = x[:, j]
            vectors[-1].array[j :: model.d] = -x[:, i]
    return PETSc.NullSpace().create(vectors=orthonormal(vectors), comm=matrix.comm)


def orthonormal(vectors: list[PETSc.Vec]) -> list[PETSc.Vec]:
    """The vectors orthonormalised, in place."""
    for k, vector in enumerate(vectors):
        for _ in range(2):  # once loses digits
            for before in vectors[:k]:
                vector.axpy(-vector.dot(before), before)
            vector.normalize()
    return vectors
