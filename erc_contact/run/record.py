"""A run as plain data, which JSON can hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any, Protocol

from erc_contact.base.code import code_of
from erc_contact.base.versions import machine, versions
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.model.forces import Force
from erc_contact.run.step import Step

NUMBERS = ("relative", "total", "absolute", "scale", "bulk_error", "contact_error", "geometry_error", "degree")
"""Numbers of the best error."""


class Run(Protocol):
    """An adaptive run, as far as it is recorded. A ``History`` has these members."""

    @property
    def steps(self) -> tuple[Step, ...]:
        """The rows."""

    @property
    def accuracy(self) -> float:
        """The prescribed relative error."""

    @property
    def reached(self) -> bool:
        """Whether it was reached."""

    @property
    def outcome(self) -> str:
        """Why the run ended."""

    @property
    def best(self) -> ConstitutiveError:
        """The best result."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """The arguments of the run by their names."""


def record(run: Run, forces: Mapping[str, Force]) -> dict[str, Any]:
    """The rows of a run, its best error, forces on the body, settings and software; numbers that are none are None."""
    error = {name: getattr(run.best, name) for name in NUMBERS}
    if isinstance(run.best, ConstitutiveError):  # one that is read from a folder has no more
        error["oscillations"] = asdict(run.best.oscillations)
    return _plain(
        {
            "outcome": run.outcome,
            "reached": run.reached,
            "accuracy": run.accuracy,
            "error": error,
            "forces": {name: {"force": of.force.tolist(), "moment": of.moment.tolist()} for name, of in forces.items()},
            "steps": [asdict(step) for step in run.steps],
            "settings": {name: code_of(one) for name, one in run.settings.items()},
            "versions": versions(),
            "machine": {**machine(), "ranks": run.best.domain.mesh.comm.size},
        }
    )


def _plain(value: Any) -> Any:
    """Data without nan and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not isfinite(value) else value
