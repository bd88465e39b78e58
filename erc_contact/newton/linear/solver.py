"""The elastic solver of a solution, as later stages see it, whichever it is.

A contact solve makes it, and the solution keeps it as ``Solution.stiffness``. Its
factor or hierarchy takes most of the memory of a solution. The contact solve leaves it
there for the next stage that solves. Each stage does so inside ``with
elastic.in_memory()``, which owns the factor and frees it on exit: the rebalance of the
admissible stress, bounds that solve, the Coulomb certificate. A later stage makes it
again. If no stage follows, it goes with the solution.

Symbols: K elastic stiffness with the supports [force/length]; S its Schur complement on
the nodes of all contacts.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, ClassVar, Protocol

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.model.model import Model


class Traces(Protocol):
    """Represent the body as its contact sees it, by a surface.

    Forces and displacements of the surface are the same on all ranks.

    Attributes:
        motions: Rigid motions of the body that no support holds, at the nodes of the
            surface [-], shape (K, n, d).
        tolerance: Relative accuracy that a norm may have [-].
        cheap: Whether the members are cheap beside a linear solve.
    """

    motions: np.ndarray
    tolerance: ClassVar[float]
    cheap: ClassVar[bool]

    def lift(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """Return the forces ``S y`` that hold the displacement y [force]; collective.

        Both have the shape (n, d). Nodes of contacts beside the surface do not move.
        Four digits of the energy are right if it may be rough, else ten.
        """

    def move(self, f: np.ndarray) -> np.ndarray:
        """Return the displacement ``S^+ f`` under forces f [length]; collective.

        Both have the shape (n, d). Nodes of contacts beside the surface are free of
        forces. The forces do no work on the free motions.
        """


class ElasticSolver(Protocol):
    """Solve the elastic equations of a model for the stages after a contact solve.

    Attributes:
        iterative: Whether it solves by iterations, to a tolerance.
        factorised: Whether a factor or a hierarchy is in memory.
        contact_size: Number of unknowns at contact nodes; 0 without contact.
    """

    iterative: ClassVar[bool]
    contact_size: int

    @property
    def factorised(self) -> bool: ...  # noqa: D102

    def load_vector(self) -> fem.Function:
        """Return the nodal forces of the loads [force], not yet summed over ranks."""

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Return the displacement u of ``K u = b`` [length]; collective.

        Args:
            b: Nodal forces [force].
            supports: Whether fixed components take the values of the supports; without,
                u is a correction.
            tolerance: Residual over the right side that is enough [-]; a factor goes to
                round-off.
        """

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Return the displacement u of ``(K + C) u = b`` [length]; collective.

        It is zero where supports fix it.

        Args:
            springs: C, stiffness at the contact [force/length]; without rows and
                columns of fixed components.
            b: Nodal forces [force].
            near: A displacement that may be near [length].
        """

    def traces(self, numbers: np.ndarray) -> Traces:
        """Return the body as a surface sees it; collective.

        Args:
            numbers: Global numbers of nodes of contacts, the same on all ranks, shape
                (n,).
        """

    def of_model(self, model: Model) -> Any:
        """Return the equations of a model with other loads and values; collective.

        They share the factor or hierarchy.
        """

    def hand_to(self, model: Model) -> Any:
        """Return the equations of a model that own the factor or hierarchy; collective.

        See :meth:`.elastic.ElasticEquations.hand_to`.
        """

    def in_memory(self) -> AbstractContextManager[None]:
        """Own the factor or hierarchy inside a `with`; collective."""
