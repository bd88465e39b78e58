"""Checks of the arguments of a contact solve, before UFL or PETSc fail at them."""

from __future__ import annotations

from collections.abc import Hashable
from numbers import Integral
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks

METHOD = ("multiplier", "in_layer", "equations", "traction", "projected")
"""Members of a method."""
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
            f"scene is {checks.description(scene)}; give a Scene: "
            "Scene(material, supports=[...], ...)."
        )
    if not isinstance(domain, Domain):
        raise InputError(
            f"domain is {checks.description(domain)}; give a Domain: rectangle(...), "
            "read_mesh(...), Domain(mesh, ...)."
        )
    if isinstance(degree, bool) or not isinstance(degree, Integral) or degree not in (1, 2):
        raise InputError(f"degree is {degree!r}; allowed are the whole numbers 1 and 2.")
    if solver not in SOLVERS:
        raise InputError(f"solver is {solver!r}; allowed are {', '.join(map(repr, SOLVERS))}.")
    if method is not None:
        _check_method(method)
    if start is not None and not isinstance(start, Solution):
        raise InputError(
            f"start is {checks.description(start)}; give a Solution, e.g. of solve() on another "
            "mesh, or None."
        )


def _check_method(method: Any) -> None:
    """Check that an object is a contact method.

    Raises:
        InputError: If it is none.
    """
    missing = [member for member in METHOD if not hasattr(method, member)]
    if isinstance(method, type) or "equations" in missing:
        raise InputError(
            f"method is {method!r}; give an object: Nitsche(), AugmentedLagrangian(), or None."
        )
    wrong = ""
    if missing:
        wrong = f"has no {', '.join(missing)}"
    elif not isinstance(method, Hashable):
        wrong = "is not hashable; make it a frozen dataclass"
    if wrong:
        raise InputError(
            f"method is {checks.description(method)}, which {wrong}. "
            f"A method has {', '.join(METHOD)}."
        )
