"""Follow what a deck prescribes through its steps: ramps, jumps and amplitudes.

A step ends in its values. Without an amplitude a value goes there linearly from the
value at the end of the step before, or jumps if the step says AMPLITUDE=STEP.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

AT_ONCE = 1e-9
"""Part of a step in which a value jumps [-]."""
FOREVER = float("inf")
"""End of what stays."""

Key = tuple[Any, ...]
"""What tells things that a deck prescribes from each other."""


@dataclass(frozen=True)
class Amplitude:
    """Hold an amplitude: factors by time.

    Attributes:
        times: The times, shape (n,).
        factors: The factors there.
        total: Whether the times are counted from the beginning, not of the step.
    """

    times: tuple[float, ...]
    factors: tuple[float, ...]
    total: bool = False


@dataclass
class Entry:
    """Hold something that a deck prescribes, with its factor in time.

    Attributes:
        what: The thing itself, with its full values.
        key: Entries of the same key are one thing that changes.
        times: Times of its factor, increasing.
        factors: Factors at these times.
        begin: Time from which it is there.
        end: Time from which it is not there.
        step: Number of the step that says it, 0 before all steps.
    """

    what: Any
    key: Key
    times: list[float]
    factors: list[float]
    begin: float
    end: float = FOREVER
    step: int = 0

    def factor(self, t: float) -> float:
        """Return the factor at a time."""
        return float(np.interp(t, self.times, self.factors))

    def is_there(self, t: float) -> bool:
        """Tell whether it is there at a time; the end of a step belongs to the step."""
        return self.begin < t <= self.end or (t == self.begin == 0.0)


@dataclass
class Steps:
    """Collect what the steps of a deck prescribe.

    Attributes:
        number: Number of the step, from 1; 0 before all steps.
        begin: Time at which the step begins.
        end: Time at which it ends.
        is_inside: Whether a step has begun and not ended.
        jumps: Whether values jump at its begin.
        times: Ends of all steps so far.
        entries: What is prescribed, by its kind.
    """

    number: int = 0
    begin: float = 0.0
    end: float = 0.0
    is_inside: bool = False
    jumps: bool = False
    times: list[float] = field(default_factory=list)
    entries: dict[str, list[Entry]] = field(default_factory=dict)
    _renewed: dict[str, set[Key]] = field(default_factory=dict)

    def open(self, *, jumps: bool) -> None:
        """Begin a step, of period 1 until its procedure says so."""
        self.number += 1
        self.begin = self.end
        self.end = self.begin + 1.0
        self.is_inside = True
        self.jumps = jumps
        self._renewed = {}

    def last(self, period: float) -> None:
        """Give the step a period."""
        self.end = self.begin + period

    def close(self) -> None:
        """End a step: what it has replaced by OP=NEW fades or is free."""
        for kind, kept in self._renewed.items():
            for entry in self.entries.get(kind, []):
                is_earlier = entry.step < self.number
                if entry.key not in kept and is_earlier and entry.end == FOREVER:
                    self.fade(entry)
                    if kind == "held":
                        entry.end = self.begin
        self.times.append(self.end)
        self.is_inside = False

    def renew(self, kind: str) -> None:
        """Say that a card with OP=NEW replaces all earlier entries of its kind."""
        if self.is_inside:
            self._renewed.setdefault(kind, set())

    def add(self, kind: str, key: Key, what: Any, amplitude: Amplitude | None) -> None:
        """Add something that is prescribed from here on."""
        entries = self.entries.setdefault(kind, [])
        if not self.is_inside:  # from the beginning
            entries.append(Entry(what, key, [0.0], [1.0], 0.0))
            return
        before = [entry for entry in entries if entry.key == key and entry.end == FOREVER]
        if kind in self._renewed:
            self._renewed[kind].add(key)
        for entry in before:
            self.fade(entry)
        times, factors = self._factors(amplitude)
        entries.append(Entry(what, key, times, factors, self.begin, step=self.number))

    def stay(self, kind: str, key: Key, what: Any) -> None:
        """Add something that is there in full from the begin of the step."""
        for entry in self.entries.get(kind, []):
            if entry.key == key and entry.end == FOREVER:
                entry.end = self.begin
        self.add(kind, key, what, None)
        added = self.entries[kind][-1]
        added.times, added.factors = [self.begin], [1.0]

    def acting(self, kind: str, key: Key) -> list[Entry]:
        """Return entries of earlier steps with other keys that still act in the end."""
        earlier = [entry for entry in self.entries.get(kind, []) if entry.step < self.number]
        return [entry for entry in earlier if entry.key != key and entry.factor(self.end)]

    def _factors(self, amplitude: Amplitude | None) -> tuple[list[float], list[float]]:
        """Return times and factors of something that begins in this step."""
        if amplitude is None:
            reached = self.end
            if self.jumps:
                reached = self.begin + AT_ONCE * (self.end - self.begin)
            return [self.begin, reached], [0.0, 1.0]
        shift = 0.0 if amplitude.total else self.begin
        times = [shift + time for time in amplitude.times]
        return times, list(amplitude.factors)

    def fade(self, entry: Entry) -> None:
        """Let an entry end with this step."""
        reached = self.end
        if self.jumps:
            reached = self.begin + AT_ONCE * (self.end - self.begin)
        now = entry.factor(self.begin)
        earlier = [i for i, time in enumerate(entry.times) if time < self.begin]
        entry.times = [*(entry.times[i] for i in earlier), self.begin, reached]
        entry.factors = [*(entry.factors[i] for i in earlier), now, 0.0]
