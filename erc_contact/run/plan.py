"""Check what a run is asked for: an adaptive run, or each step of a loading history.

A Function of DOLFINx among the values of a scene lives on one mesh, and so does the
scene: a run makes further meshes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import ufl
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.code import arguments
from erc_contact.base.exceptions import InputError
from erc_contact.base.logs import log_of
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.strategy import Mark, Strategy
from erc_contact.newton.arguments import check_arguments
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.run.step import Step
from erc_contact.scene.goal import GOALS, Goal
from erc_contact.scene.potential import BY_FORCE, refuse_potential
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.percent import percent
from namedmesh.for_solvers import Bodies

DECISIVE = ("method", "strategy", "degree", "stop", "tighten", "goal")
"""Arguments that decide on the meshes of a run and on their errors."""
SETTINGS = (*DECISIVE, "solver", "max_cells", "max_steps")
"""All arguments of a run beside scene, domain and accuracy, those that decide first."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Hold what :func:`erc_contact.run.adapt.adapt` was asked for, see there.

    Attributes:
        after: The solution of the last step of a loading history, or None.
    """

    scene: Scene
    accuracy: float
    method: Method | None
    strategy: Strategy
    degree: int
    stop: str
    solver: str
    tighten: int
    max_cells: int
    max_steps: int
    goal: Goal | None = None
    callback: Callable[[ConstitutiveError, Step], object] | None = None
    after: Solution | None = None

    def arguments(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the arguments of these names."""
        return {name: getattr(self, name) for name in names}


def make_plan(
    scene: Scene, domain: Domain, strategy: Any, callback: Any = None, **arguments: Any
) -> Plan:
    """Check the arguments of a run and return its plan.

    Raises:
        InputError: If an argument cannot be worked with.
    """
    accuracy = checks.accuracy("accuracy", arguments["accuracy"])
    arguments["accuracy"] = accuracy
    for name, least in (("tighten", 0), ("max_cells", 1), ("max_steps", 1)):
        arguments[name] = checks.whole(name, arguments[name], least)
    if arguments["stop"] not in ("converged", "certified"):
        raise InputError(f'stop is {arguments["stop"]!r}; allowed are "converged" and "certified".')
    check_arguments(scene, domain, arguments["method"], arguments["degree"], arguments["solver"])
    if arguments["max_steps"] > 1:
        # a finite element function is defined on one mesh alone
        check_no_functions(scene, domain)
    if accuracy > 1:
        log_of(domain.comm).warning(
            f"accuracy is {accuracy:g}, a relative error of {percent(accuracy)}: any mesh reaches "
            f"it. For {accuracy:g}% write {accuracy / 100:g}."
        )
    strategy = Mark() if strategy is None else strategy
    if isinstance(strategy, type) or not callable(getattr(strategy, "next", None)):
        raise InputError(
            f"strategy is {strategy!r}; give an object, e.g. Mark(), SizeMap(), Uniform()."
        )
    check_callback(callback)
    goal = arguments.get("goal")
    if goal is not None and not isinstance(goal, GOALS):
        raise InputError(
            f"goal is {goal!r}; give a Resultant(part, direction), or another of"
            f" {', '.join(kind.__name__ for kind in GOALS)}, or None."
        )
    if goal is not None:
        refuse_potential(scene.material, "A run with a goal", BY_FORCE)
    return Plan(scene=scene, strategy=strategy, callback=callback, **arguments)


def check_callback(callback: Any) -> None:
    """Check what is called after each mesh or step.

    Raises:
        InputError: If it cannot be called.
    """
    if callback is not None and not callable(callback):
        raise InputError(
            f"callback is {callback!r}; give a function of two arguments, "
            "the error and the row, or None."
        )


def check_no_functions(scene: Scene, domain: Bodies) -> None:
    """Check that the callables of a scene return no Functions; collective.

    Only then can the scene be put on further meshes.

    Raises:
        InputError: If one does, on all ranks.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    named = [name for name, value in _callables(scene) if _has_function(value, x)]
    names = [name for of_rank in domain.comm.allgather(named) for name in of_rank]
    if names:
        raise InputError(
            f"{names[0]} returns a Function, which lives on one mesh, and a run makes further"
            " ones. Give UFL of x; or solve on this mesh alone: ec.solve, ec.equilibrate and"
            " ec.constitutive_error, or max_steps=1."
        )


def _callables(scene: Scene) -> Iterator[tuple[str, Any]]:
    """List the callables of x among the values of a scene, with names for messages."""
    owners: list[Any] = [scene.material, *scene.supports, *scene.loads, *scene.contacts]
    owners += scene.strains
    for contact in scene.contacts:
        if hasattr(contact.friction, "friction_bound"):
            owners.append(contact.friction)
    for owner in owners:
        facets = getattr(owner, "facets", None)
        what = type(owner).__name__
        if facets:
            what += f"({facets!r})"
        for name, argument in arguments(owner).items():
            for value in _entries(argument):
                if callable(value):
                    yield f"{what}: {name}", value


def _entries(argument: Any) -> Iterator[Any]:
    """List the values in mappings, rows and components of an argument."""
    values = argument.values() if isinstance(argument, Mapping) else argument
    if not isinstance(argument, Mapping | list | tuple):
        yield argument
        return
    for value in values:
        yield from _entries(value)


def _has_function(value: Any, x: Ufl) -> bool:
    """Tell whether a callable of x returns UFL with a Function.

    A callable that fails is reported when the scene meets its mesh.
    """
    try:
        result = field_of(value, x)
        parts = result if isinstance(result, list | tuple) else [result]
        terminals = []
        for part in parts:
            terminals += traverse_unique_terminals(ufl.as_ufl(part))
    except Exception:
        return False
    return any(isinstance(terminal, ufl.Coefficient) for terminal in terminals)
