"""Two levels of a hierarchy: elements of degree 2 above elements of degree 1.

The fine matrix has degree 2. A displacement of degree 1 has degree 2, too:
with this interpolation P the coarse matrix is ``P^T A P``, the stiffness of degree 1,
with an eighth of the unknowns in 3D. Algebraic multigrid goes on from there. It
makes aggregates of the few entries of degree 1, where rigid motions at the vertices say
all; on the matrix of degree 2 its set-up costs more than all cycles of a linear solve.
Where a factor of degree 1 costs no more than a cycle or two, as in assemblies of small
solids and in layers, it takes the place of algebraic multigrid.

The smoother is Chebyshev's method with the diagonal, which does not know ranks. The
blocks of the nodes need as many cycles, and PETSc keeps their inverses when the matrix
changes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.linear.amg import (
    AMG_PREFIX,
    rigid_motions,
    with_defaults,
    with_factor,
    with_options,
)
from erc_contact.newton.linear.changed import DIFFERENT
from erc_contact.newton.linear.factor_cost import factor_below

FINE_PREFIX = "erc_contact_degree_2_"
"""Prefix of PETSc options, as in ``-erc_contact_degree_2_mg_levels_ksp_max_it 3``.

The smoother may ask for products with the fine matrix and for its diagonal only.
"""
FINE_OPTIONS = {
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.3",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_pc_type": "jacobi",
}
"""Options that the user's override.

The smoother's greatest eigenvalue is estimated for the glued contact. A tangent may
have 1.3 of it, and beyond its interval Chebyshev's method amplifies: with PETSc's 1.1
for 1.3 an assembly of 18 solids took 805 cycles, not 293. A cube takes 50, not 53.
"""
CYCLES_BELOW = 2
"""Cycles on the coarse matrix in one cycle on both.

They cost a third of a cycle, and save a sixth of the cycles of a contact solve.
"""


class TwoLevels:
    """Hold a cycle for a matrix of degree 2 with a matrix of degree 1 below it.

    Construction is collective.

    Args:
        model: The scene on a mesh.
        matrix: The fine matrix, for displacements, which is multiplied only [-].
        terms: The terms of which it is the sum, K first [force/length].
        scale: Factor of their sum in the fine matrix [length/force].
        diagonal: Diagonal of the sum where supports fix a component, also of the coarse
            matrix [force/length].

    Attributes:
        interpolation: P; its rows and columns are zero where supports fix a component.
        coarse: The coarse matrix.
        pc: PETSc's preconditioner of the fine matrix, a cycle on both levels.
        algebraic: Preconditioner of the coarse matrix, algebraic multigrid or a factor.
    """

    def __init__(
        self,
        model: Model,
        matrix: PETSc.Mat,
        terms: Sequence[PETSc.Mat],
        scale: float,
        diagonal: float,
    ) -> None:
        vertices = model.domain.function("Lagrange", 1, (model.space.d,)).function_space
        fixed = _fixed_at_vertices(model, vertices)
        self.interpolation = _interpolation(model, vertices, fixed)
        self.coarse = _coarse_sum(terms, self.interpolation)
        on_diagonal = self.coarse.createVecRight()
        on_diagonal.array[fixed] = diagonal
        self.coarse.setDiagonal(on_diagonal, addv=PETSc.InsertMode.ADD)
        on_diagonal.destroy()
        self.coarse.scale(scale)
        self.coarse.setNearNullSpace(rigid_motions(vertices, self.coarse))
        self.coarse.setOption(PETSc.Mat.Option.SPD, True)

        self.pc = PETSc.PC().create(matrix.comm)
        self.pc.setOptionsPrefix(FINE_PREFIX)
        self.pc.setOperators(matrix)
        self.pc.setType("mg")
        self.pc.setMGLevels(2)
        self.pc.setMGInterpolation(1, self.interpolation)
        below = self.pc.getMGCoarseSolve()
        below.setOperators(self.coarse)
        self.algebraic = below.getPC()
        self.algebraic.setOptionsPrefix(AMG_PREFIX)
        if factor_below(self.coarse, terms[0]):
            below.setType("preonly")
            with_factor(self.algebraic)
        else:
            below.setType("richardson")
            below.setNormType(PETSc.KSP.NormType.NONE)
            below.setTolerances(max_it=CYCLES_BELOW)
            with_defaults(self.algebraic)
        with_options(self.pc, FINE_OPTIONS)
        below.destroy()

    def keep(self) -> None:
        """Keep what costs most to make, also when the entries of the matrix change.

        That is the interpolation and the estimated eigenvalues. The smoother's diagonal
        and what is below follow their matrices.
        """
        self.pc.setReusePreconditioner(True)
        smoother = self.pc.getMGSmoother(1)
        diagonal = smoother.getPC()
        diagonal.setReusePreconditioner(False)
        self.algebraic.setReusePreconditioner(False)
        diagonal.destroy()
        smoother.destroy()

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        for petsc_object in (self.pc, self.algebraic, self.interpolation, self.coarse):
            petsc_object.destroy()


def _coarse_sum(terms: Sequence[PETSc.Mat], interpolation: PETSc.Mat) -> PETSc.Mat:
    """Return ``P^T A P`` for the sum A of terms."""
    stiffness, *changes = terms
    total = stiffness.ptap(interpolation)
    for change in changes:
        coarse = change.ptap(interpolation)
        total.axpy(1.0, coarse, DIFFERENT)
        coarse.destroy()
    return total


def _fixed_at_vertices(model: Model, vertices: fem.FunctionSpace) -> np.ndarray:
    """Return the degrees of freedom of this rank that supports fix at vertices."""
    index_map = vertices.dofmap.index_map
    node_count = index_map.size_local + index_map.num_ghosts
    fixed = np.zeros((node_count, model.space.d), dtype=bool)
    fixed[vertices.dofmap.list] = model.fixed[model.space.vertices]
    return np.flatnonzero(fixed[: index_map.size_local])


def _interpolation(model: Model, vertices: fem.FunctionSpace, fixed: np.ndarray) -> PETSc.Mat:
    """Return P; all that supports fix is zero in it."""
    interpolation = fp.interpolation_matrix(vertices, model.space.V)
    interpolation.assemble()
    at_vertices, at_nodes = interpolation.createVecs()
    at_vertices.set(1.0)
    at_vertices.array[fixed] = 0.0
    owned = at_nodes.getLocalSize()
    at_nodes.array[:] = ~model.fixed.ravel()[:owned]
    interpolation.diagonalScale(at_nodes, at_vertices)
    at_vertices.destroy()
    at_nodes.destroy()
    return interpolation
