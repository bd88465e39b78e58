"""Matrices that move contact forces to the unknowns that they do work on.

The assembled forces of a contact stand at the nodes of its cells. The solver's unknowns
(:mod:`erc_contact.model.coordinates`) move other nodes, too:

- what does work on u, such as a foundation at the node of a pair, does so by ``u = T
  x`` on a second unknown: ``(T - I)^T``;
- the force on a jump that is a sum of unknowns does so on each of them: ``D^T``
  (:mod:`erc_contact.newton.jump_sums`).

The first forces are those of test functions without jumps. Those of the second kind are
the forces that tested jumps of one colour add to them.
"""

from __future__ import annotations

from petsc4py import PETSc

from erc_contact.newton.forms import ContactForms


def moved_forces(forms: ContactForms) -> list[tuple[tuple[float, ...], PETSc.Mat]]:
    """Return what is added to assembled forces; collective.

    Args:
        forms: The equations of the method.

    Returns:
        Factors of tested jumps, and the matrix from the forces that are assembled with
        them to forces on unknowns; nothing where unknowns are displacements.
    """
    model = forms.model
    moved = []
    alike: PETSc.Mat | None = None
    if forms.test_alike:
        alike = model.coordinates.other_unknowns.copy()
        moved.append((forms.no_jumps, alike))
    if not forms.jump_sums.any:
        return moved
    for colour in range(forms.jump_sums.count):
        sums = forms.jump_sums.of_colour(colour)
        matrix = forms.jump_sums.matrix(sums, 0.0).transpose()
        if alike is not None:
            # The forces with tested jumps contain those without.
            alike.axpy(-1.0, matrix, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        moved.append((forms.jumps_of(colour), matrix))
    return moved
