"""The elastic stiffness of a model with loose rigid faces, factorised and condensed.

The factor is made with the faces at rest; their motions are added
(:mod:`erc_contact.newton.linear.face_motions`).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from dolfinx import fem

from erc_contact.model.model import Model
from erc_contact.newton.linear.face_motions import EliminatedFaces, FaceMotions
from erc_contact.newton.linear.mumps import Factor
from erc_contact.newton.linear.stiffness import Stiffness


class LooseStiffness(Stiffness):
    """Solve the elastic equations of a model with loose rigid faces with a factor."""

    def solve_glued(self, b: fem.Function, *, supports: bool = True) -> fem.Function:
        """Solve ``(K + D) w = b``, see :meth:`Stiffness.solve_glued`."""
        w = super().solve_glued(b, supports=supports)
        self._motions.move(w, b)
        return w

    @cached_property
    def _faces(self) -> EliminatedFaces:
        """Return the equations of the faces."""
        return EliminatedFaces(self)

    @cached_property
    def _motions(self) -> FaceMotions:
        """Return the motions of the faces; they outlive the factor."""
        return FaceMotions(self, self._faces, self._solver().solve)

    def _move_by(self, forces: fem.Function) -> fem.Function:
        """Return the glued displacement of forces on unknowns."""
        u = super()._move_by(forces)
        self._motions.move(u, None)
        return u

    def _solve_under(self, b: fem.Function, solver: Factor) -> fem.Function:
        """Return the displacement under nodal forces b by a solver [length]."""
        u = super()._solve_under(b, solver)
        FaceMotions(self, self._faces, solver.solve).move(u, b)
        return u

    def _condense(self) -> None:
        """Factorise with the Schur complement on L of the body with loose faces."""
        # MUMPS has the Schur complement only until the factor has solved for once.
        super()._condense()
        at_layer = [self.gather(motion) for motion in self._motions.displacements]
        if self.schur is not None:
            self.schur = self._motions.soften(self.schur, np.column_stack(at_layer))


def stiffness_of(model: Model) -> Stiffness:
    """Return the factorised stiffness of a model, with or without loose rigid faces."""
    return LooseStiffness(model) if model.loose_faces else Stiffness(model)
