"""Check what a run is asked for: an adaptive run, or each step of a loading history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.strategy import Mark, Strategy
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.tables import describe_shape
from erc_contact.model.functions import check_no_functions
from erc_contact.newton.arguments import check_arguments
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.run.step import Step
from erc_contact.scene.goal import GOALS, Goal
from erc_contact.scene.potential import BY_FORCE, refuse_potential
from erc_contact.scene.scene import Scene

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


def checked_plan(
    scene: Scene, domain: Domain, strategy: Any, callback: Any = None, **arguments: Any
) -> Plan:
    """Check the arguments of a run and return its plan.

    Raises:
        InputError: If an argument cannot be worked with.
    """
    accuracy = checks.accuracy("accuracy", arguments["accuracy"])
    arguments["accuracy"] = accuracy
    arguments["tighten"] = checks.whole("tighten", arguments["tighten"], 0)
    arguments["max_cells"] = checks.whole("max_cells", arguments["max_cells"], 1)
    arguments["max_steps"] = checks.whole("max_steps", arguments["max_steps"], 1)
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


def check_folder(checkpoint: Any, domain: Domain) -> None:
    """Check that a run can be kept, before anything is solved.

    Raises:
        InputError: If this is no name of a folder, or the true shape of the body cannot
            be written.
    """
    if not isinstance(checkpoint, str | Path):
        raise InputError(f"checkpoint is {checkpoint!r}; give the name of a folder, or None.")
    describe_shape(domain.geometry)
