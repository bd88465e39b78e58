"""Checks of the arguments of a contact solve, so that no message of UFL or PETSc is needed."""

from __future__ import annotations

from collections.abc import Hashable
from numbers import Integral
from typing import Any

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene

METHOD = ("multiplier", "in_layer", "equations", "traction", "projected")
"""What a method has."""
SOLVERS = ("auto", "direct", "iterative")
"""The solvers by name."""


def check_arguments(
    scene: Any, domain: Any, method: Any, degree: Any, solver: Any, start: Any = None
) -> None:
    """Check the types of the arguments of :func:`erc_contact.newton.solve.solve`.

    Raises:
        InputError: If an argument has another type.
    """
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene is {checks.description(scene)}; give a Scene: Scene(material, supports=[...], ...)."
        )
    if not isinstance(domain, Domain):
        raise InputError(
            f"domain is {checks.description(domain)}; give a Domain: rectangle(...), read_mesh(...), Domain(mesh, ...)."
        )
    if isinstance(degree, bool) or not isinstance(degree, Integral) or degree not in (1, 2):
        raise InputError(f"degree is {degree!r}; allowed are the whole numbers 1 and 2.")
    if solver not in SOLVERS:
        raise InputError(f"solver is {solver!r}; allowed are {', '.join(map(repr, SOLVERS))}.")
    missing = [] if method is None else [member for member in METHOD if not hasattr(method, member)]
    if isinstance(method, type) or "equations" in missing:
        raise InputError(
            f"method is {method!r}; give an object: Nitsche(), AugmentedLagrangian(), or None."
        )
    if missing or not isinstance(method, Hashable):
        wrong = (
            f"has no {', '.join(missing)}"
            if missing
            else "is not hashable; make it a frozen dataclass"
        )
        raise InputError(
            f"method is {checks.description(method)}, which {wrong}. A method has {', '.join(METHOD)}."
        )
    if start is not None and not isinstance(start, Solution):
        raise InputError(
            f"start is {checks.description(start)}; give a Solution, e.g. of solve() on another mesh, or None."
        )
