"""Numbers of reference cases: intervals, what others say, and how a run yields them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

Probe = Callable[[ec.ConstitutiveError], float]
"""Type of what reads a number without a bound from the fields of a mesh."""

UP = (0.0, 1.0)
"""Direction of a force in the plane [-]."""
FOURIER = "Fourier integrals"
"""Source of numbers of :mod:`reference_fourier`, in words."""
FINE = "elements of degree 4 to 7"
"""Source of numbers of a second code with mesh lines on the rim of the contact."""
LAST_MESHES = 3
"""Number of meshes whose spread is the estimate of a number without a bound."""
ROUND_OFF = 1e-9
"""Share of a number by which a closed form may lie outside [-]."""


@dataclass(frozen=True)
class Other:
    """Hold what somebody else says of a number.

    Attributes:
        source: Who, in words.
        value: The number.
        exact: Whether it is a closed form, or a converged one, of the same problem.
        rounding: Half a unit of its last digit.
        approximate: Whether it is of a simpler problem: a half-plane, a beam.
    """

    source: str
    value: float
    exact: bool = False
    rounding: float = 0.0
    approximate: bool = False


@dataclass(frozen=True)
class Number:
    """Hold a number in an interval.

    Attributes:
        quantity: Its name.
        unit: Its unit.
        value: Middle of the interval, or the number of the finest mesh.
        low: Lower end.
        high: Upper end.
        kind: "proved" or "estimate".
        how: Where the interval is from.
        others: What others say.
    """

    quantity: str
    unit: str
    value: float
    low: float
    high: float
    kind: str
    how: str
    others: list[Other] = field(default_factory=list)


@dataclass
class Result:
    """Hold the outcome of a case.

    Attributes:
        cells: Number of cells of the finest mesh.
        unknowns: Number of unknowns there.
        eps: Relative error there, with the error of flat facets [-].
        numbers: The numbers.
        seconds: Processor time of the case, without compilers.
    """

    cells: int
    unknowns: int
    eps: float
    numbers: list[Number]
    seconds: float = 0.0


def intersection(
    quantity: str, unit: str, bounds: list[ec.Bounds], how: str, factor: float = 1.0
) -> Number:
    """Return a number, times a factor, from proved intervals or the last estimate.

    Raises:
        ValueError: If proved intervals do not meet.
    """
    proved = [each for each in bounds if each.guaranteed]
    trusted = proved or bounds[-1:]
    largest_low = max(each.low for each in trusted)
    least_high = min(each.high for each in trusted)
    # Intervals of no width may miss each other by round-off.
    if largest_low > least_high + ROUND_OFF * abs(least_high):
        raise ValueError(f"{quantity}: proved intervals do not meet, {bounds}.")
    ends = (factor * largest_low, factor * least_high)
    low, high = min(ends), max(ends)
    kind = "proved" if proved else "estimate"
    return Number(quantity, unit, (low + high) / 2, low, high, kind, how)


class Meshes:
    """Run a scene to an accuracy, and read numbers from each mesh of the run."""

    def __init__(
        self,
        scene: ec.Scene,
        domain: ec.Domain,
        accuracy: float,
        probes: Mapping[str, Probe] | None = None,
        **options: Any,
    ) -> None:
        """Run; the probes are read on each mesh."""
        self.energies: list[ec.Bounds] = []
        self.read: dict[str, list[float]] = {name: [] for name in probes or {}}

        def record(error: ec.ConstitutiveError, step: ec.Step) -> None:
            self.energies.append(ec.potential_energy(error))
            for name, probe in (probes or {}).items():
                self.read[name].append(float(probe(error)))

        options = {"degree": 2, **options}
        history = ec.adapt(scene, domain, accuracy, callback=record, **options)
        self.error = history.error

    def energy(self, quantity: str, unit: str, factor: float = 1.0) -> Number:
        """Return the potential energy times a factor, from all meshes if proved."""
        return intersection(quantity, unit, self.energies, "energies", factor)

    def force(self, part: str, direction: tuple[float, ...], unit: str, name: str) -> Number:
        """Return the force of the foundation or other body along a direction."""
        bounds = ec.resultant(self.error, part, direction)
        if bounds.weighted:
            raise ValueError(f"The resultant of {part} is weighted.")
        return intersection(name, unit, [bounds], "lifting bound")

    def goal(self, goal: Any, unit: str, name: str, factor: float = 1.0) -> Number:
        """Return the difference-quotient bound, of a contact also the lifting bound.

        Not with Coulomb's friction, of which the difference quotient knows too little.
        """
        bounds = [ec.interval(self.error, goal)]
        contacts = [contact.facets for contact in self.error.model.scene.contacts]
        # A stress intensity factor has no part.
        if getattr(goal, "part", None) in contacts:
            lifted = ec.resultant(self.error, goal.part, goal.direction)
            if not lifted.weighted:
                bounds.append(lifted)
        return intersection(name, unit, bounds, "difference-quotient bound", factor)

    def probe(self, name: str, unit: str, factor: float = 1.0) -> Number:
        """Return what a probe read on the last mesh, and the spread of the last."""
        values = [factor * value for value in self.read[name][-LAST_MESHES:]]
        spread = max(values) - min(values)
        last = values[-1]
        return Number(name, unit, last, last - spread, last + spread, "estimate", "last meshes")

    def result(self, *numbers: Number) -> Result:
        """Return the outcome of the case."""
        model = self.error.model
        return Result(
            self.error.domain.cells,
            model.space.d * model.space.node_count,
            self.error.total,
            [*numbers],
        )


def says(number: Number, *others: Other) -> Number:
    """Add to a number what others say of it."""
    number.others.extend(others)
    return number


def exactly(number: Number, value: float, source: str = "closed form") -> Number:
    """Add to a number its closed form."""
    return says(number, Other(source, float(value), exact=True))


def is_inside(number: Number, other: Other) -> bool:
    """Tell whether a figure lies in an interval, up to its rounding and round-off."""
    slack = other.rounding + ROUND_OFF * max(abs(number.value), abs(other.value))
    return number.low - slack <= other.value <= number.high + slack


def opening_ends(contact: str, reach: float = 1.3) -> Probe:
    """Read where the gap of a contact opens: its power 2/3 is smooth and zero there."""

    def read(error: ec.ConstitutiveError) -> float:
        profile = error.profile(contact)
        x, gap = profile["x"], profile["gap"]
        outermost = x[profile["pressure"] > 0].max()
        near = (x > outermost) & (x < reach * outermost) & (gap > 0)
        if np.count_nonzero(near) < 8:
            return float(outermost)
        cubic = np.polynomial.Polynomial.fit(x[near], gap[near] ** (2 / 3), 3)
        roots = cubic.roots()
        real = roots[abs(roots.imag) < ROUND_OFF].real
        return float(real[np.argmin(abs(real - outermost))])

    return read


def pressure_at(contact: str, place: float, reach: float, axis: str = "x") -> Probe:
    """Read the pressure at a place, by a parabola through the points near it."""

    def read(error: ec.ConstitutiveError) -> float:
        profile = error.profile(contact)
        away = profile[axis] - place
        near = abs(away) < reach
        if np.count_nonzero(near) < 4:
            near = abs(away) <= np.sort(abs(away))[3]
        return float(np.polyfit(away[near], profile["pressure"][near], 2)[-1])

    return read


@dataclass(frozen=True)
class Told:
    """Hold a number that is read from each mesh, and its reference.

    Attributes:
        probe: How it is read.
        unit: Its unit.
        value: The reference.
    """

    probe: Probe
    unit: str
    value: float


def moved(place: tuple[float, float], component: int, value: float) -> Told:
    """Tell a component of u^ at a place."""
    return Told(lambda error: float(error.at(place).displacement[0, component]), "length", value)


def run(scene: ec.Scene, domain: ec.Domain, accuracy: float, told: Mapping[str, Told]) -> Meshes:
    """Run a scene, and read the numbers that are told from each mesh."""
    return Meshes(scene, domain, accuracy, {name: each.probe for name, each in told.items()})


def beside(meshes: Meshes, told: Mapping[str, Told], source: str = "closed form") -> list[Number]:
    """Return numbers of probes beside their references."""
    return [
        says(meshes.probe(name, each.unit), Other(source, each.value))
        for name, each in told.items()
    ]
