"""Other solutions of a scene with friction, each with its error."""

from __future__ import annotations

from dataclasses import replace

from erc_contact.admissible.equilibrate import equilibrate
from erc_contact.base.exceptions import raise_together, together
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.runs import Run, error_of
from erc_contact.model.contact.friction import depends_on_pressure
from erc_contact.newton.deflation import other_states
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.solution import Solution
from erc_contact.scene.potential import refuse_potential
from namedmesh.base.checks import whole


def other_solutions(solution: Solution | Run, most: int = 4) -> list[ConstitutiveError]:
    """Look for other solutions of a scene on the same mesh; collective.

    Newton's method, repelled by the solutions that it knows, starts from states with
    other friction and from moved ones. It uses the direct solver, and costs some tens
    of Newton steps with dense algebra of the contact.

    Args:
        solution: A solution, or a history, whose solution is taken.
        most: How many are looked for.

    Returns:
        The errors of other solutions of the discrete problem, with their solutions in
        ``error.solution``. The errors tell which of them are near a solution of the
        scene. An empty list does not prove that there is no other one;
        :func:`coulomb_certificate` may.

    Raises:
        InputError: If ``most`` is not a whole number > 0.

    Example:
        >>> ec.other_solutions(solution)
        []
    """
    solution = solution if isinstance(solution, Solution) else error_of(solution).solution
    model = solution.model
    start = "Solve from other starts, solve(start=), or with another method."
    refuse_potential(solution.scene.material, "other_solutions()", start)
    comm = model.space.comm
    raise_together(comm, None)
    most = together(comm, whole, "other_solutions: most", most, 1)
    # Without friction that depends on the pressure there is no other solution.
    frictions = [contact.friction for contact in model.contacts]
    if not any(depends_on_pressure(friction) for friction in frictions):
        return []
    # The stiffness of the solution has lost its factor, or is iterative.
    stiffness = stiffness_of(model)
    if not stiffness.contact_size:
        return []
    errors = []
    for state in other_states(stiffness, solution.method, solution.u, most):
        found = replace(
            solution,
            u=state.u,
            multipliers=state.multipliers,
            newton_steps=0,
            reason="found beside another solution",
            distance=state.distance,
            least_singular_value=state.least_singular_value,
            stiffness=stiffness,
            seconds=0.0,
        )
        errors.append(constitutive_error(equilibrate(found)))
    return errors
