"""Put temperatures on the body, and the strains and moduli that depend on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from erc_contact.decks.affine import Affine, fitted
from erc_contact.decks.histories import Entry
from erc_contact.decks.nodal import NodalTable
from erc_contact.decks.plan import Heat
from erc_contact.decks.reading import DeckReading, MaterialCards
from namedmesh.for_solvers import DeckMesh


def temperatures_of(reading: DeckReading) -> np.ndarray | None:
    """Return temperatures at the end of the deck, at all points; None without any."""
    changes = _changes(reading)
    if not changes and not reading.initial:
        return None
    temperatures = _initial(reading)
    for entry, change in changes:
        temperatures += entry.factor(reading.steps.end) * change
    return temperatures


def heat_of(reading: DeckReading) -> list[Entry]:
    """Return the changes of temperature, as values in the whole body."""
    result = []
    for entry, change in _changes(reading):
        result.append(replace(entry, what=Heat(_field(reading.mesh, change))))
    return result


def at_temperatures(
    mesh: DeckMesh, rows: Sequence[Sequence[float]], count: int, temperatures: np.ndarray | None
) -> list[Any]:
    """Return the values of a table by temperature in a body: numbers or callables of x.

    Args:
        mesh: The mesh.
        rows: ``count`` values, then the temperature.
        count: Number of values.
        temperatures: Temperatures at all points; None takes the first row.
    """
    if len(rows) == 1 or temperatures is None:
        return list(rows[0][:count])
    result = []
    for values in _interpolated(rows, count, temperatures):
        field = _field(mesh, values)
        result.append(field.value if isinstance(field, Affine) else field)
    return result


def expansions_of(
    reading: DeckReading,
    materials: Mapping[str, MaterialCards],
    temperatures: np.ndarray | None,
) -> dict[str, Any]:
    """Return the coefficient of expansion of each region [1/temperature].

    A coefficient alpha(T) of a deck is the mean from the temperature Z of ``ZERO`` on:
    the strain is ``alpha(T) (T - Z) - alpha(T_0) (T_0 - Z)`` with the temperature T_0
    of the beginning. The coefficient here is this strain over T - T_0.
    """
    mesh = reading.mesh
    result: dict[str, Any] = {}
    for region, material in materials.items():
        rows = material.expansion
        if len(rows) <= 1 or temperatures is None:
            result[region] = rows[0][0] if rows else 0.0
            continue
        reading.told.assume(
            material.card, f"{material.name!r}: expansion is taken at the last temperatures"
        )
        before = _initial(reading)
        (now,) = _interpolated(rows, 1, temperatures)
        (first,) = _interpolated(rows, 1, before)
        strain = now * (temperatures - material.zero) - first * (before - material.zero)
        rise = temperatures - before
        warms = rise != 0.0
        mean = np.where(warms, strain / np.where(warms, rise, 1.0), now)
        field = _field(mesh, mean)
        result[region] = field.value if isinstance(field, Affine) else field
    return result


def _changes(reading: DeckReading) -> list[tuple[Entry, np.ndarray]]:
    """Return what temperatures change, at all points: entries with their changes.

    Sets of nodes that warm up together are one field.
    """
    initial = _initial(reading)
    together: dict[Any, tuple[Entry, np.ndarray]] = {}
    for entry in reading.steps.entries.get("warmth", []):
        history = (tuple(entry.times), tuple(entry.factors))
        _, change = together.setdefault(history, (entry, np.zeros(len(initial))))
        nodes = entry.what.nodes
        change[nodes] = entry.what.values - initial[nodes]
    return list(together.values())


def _initial(reading: DeckReading) -> np.ndarray:
    """Return the temperatures at the beginning, at all points."""
    initial = np.zeros(len(reading.mesh.x))
    for node, value in reading.initial.items():
        initial[node] = value
    return initial


def _interpolated(
    rows: Sequence[Sequence[float]], count: int, temperatures: np.ndarray
) -> list[np.ndarray]:
    """Return the values of a table at temperatures, column by column."""
    given = [row[count] if len(row) > count else 0.0 for row in rows]
    return [np.interp(temperatures, given, [row[i] for row in rows]) for i in range(count)]


def _field(mesh: DeckMesh, values: np.ndarray) -> Affine | NodalTable:
    """Return values at all points as a linear function, else as a table."""
    every = np.flatnonzero(mesh.node_is_used)
    x = mesh.mesh.points[every, : mesh.d]
    return fitted(x, values[every]) or NodalTable(*mesh.with_values(values))
