"""PETSc's algebraic multigrid for elastic bodies: options and near null space."""

from __future__ import annotations

from collections.abc import Mapping

from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.motions.rigid_shapes import translations_and_rotations
from erc_contact.newton.linear.mumps import AMF
from namedmesh.base.communicators import lasting

AMG_PREFIX = "erc_contact_elastic_"
"""Prefix of PETSc options, as in ``-erc_contact_elastic_pc_type hypre``."""
OPTIONS = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.02,
    "pc_gamg_coarse_eq_limit": 500,
    "pc_gamg_aggressive_coarsening": 2,
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "sor",
}
"""Options that the user's override."""
FACTOR_OPTIONS = {
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_7": AMF,
}
"""Options of a factor in place of algebraic multigrid, which the user's override, too.

A tangent with friction is not symmetric.
"""
RICHARDSON = 2
"""Greatest number of ranks with Richardson's method as smoother.

Each rank makes its symmetric sweeps alone. Where n ranks meet the sweeps may go n
times as far as the whole matrix allows, and from twice on the cycle is not positive
definite: it was 2.1 times on three ranks with nu = 0.49, and 2.5 times on eight.
Chebyshev's method estimates this number and goes less far, in as few cycles.
"""


def with_defaults(pc: PETSc.PC) -> None:
    """Set up algebraic multigrid from PETSc's options, and :data:`OPTIONS`."""
    smoother = "richardson" if pc.comm.size <= RICHARDSON else "chebyshev"
    with_options(pc, {**OPTIONS, "mg_levels_ksp_type": smoother})


def with_factor(pc: PETSc.PC) -> None:
    """Set up a factor from PETSc's options, and :data:`FACTOR_OPTIONS`."""
    with_options(pc, FACTOR_OPTIONS)


def with_options(pc: PETSc.PC, defaults: Mapping[str, object]) -> None:
    """Set up a preconditioner from PETSc's options, and defaults beside them.

    PETSc reads options from a table of the process. Defaults are put there for as long
    as it reads, so that they override nothing of the user's.
    """
    options = PETSc.Options()
    prefix = pc.getOptionsPrefix()
    added = []
    for name, value in defaults.items():
        if not options.hasName(prefix + name):
            options[prefix + name] = value
            added.append(prefix + name)
    pc.setFromOptions()
    pc.setUp()  # the levels read their options here
    for name in added:
        options.delValue(name)


def rigid_motions(space: fem.FunctionSpace, matrix: PETSc.Mat) -> PETSc.NullSpace:
    """Return the rigid motions of the plane or of space at the nodes of a space.

    They are the near null space that the aggregates keep.
    """
    index_map = space.dofmap.index_map
    x = space.tabulate_dof_coordinates()[: index_map.size_local, : space.dofmap.bs]
    # Rotations are about the middle: far from the origin they would be translations.
    middle = lasting(space.mesh.comm).allreduce(x.sum(axis=0), MPI.SUM) / index_map.size_global
    motions = translations_and_rotations(x - middle)
    vectors = []
    for k in range(motions.shape[2]):
        vector = matrix.createVecRight()
        vector.array[:] = motions[:, :, k].ravel()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=orthonormal(vectors), comm=matrix.comm)


def orthonormal(vectors: list[PETSc.Vec]) -> list[PETSc.Vec]:
    """Orthonormalise vectors in place, and return them."""
    for k, vector in enumerate(vectors):
        for _ in range(2):  # once loses digits
            for before in vectors[:k]:
                vector.axpy(-vector.dot(before), before)
            vector.normalize()
    return vectors
