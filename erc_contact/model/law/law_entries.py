"""Order the entries of a state of a law as components, tensors in Mandel components."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.material import in_tensor, mandel_basis
from erc_contact.scene.potential import Remembering, Shapes


class StateField(Protocol):
    """Describe the state of a body, see :class:`.law_state.LawState`."""

    space: Any
    values: Any
    size: int
    varies_in_cells: bool
    moved: float

    def at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the entries at points of cells, shape (n, q, size)."""

    def ranges(self, corners: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bound the entries in pieces of cells, shape (n, size) each."""

    def ufl(self, shapes: Shapes) -> dict[str, Ufl]:
        """Return the entries by their names, UFL."""


def size_of(shapes: Shapes) -> int:
    """Return the number of components of a state."""
    return sum(6 if shape else 1 for shape in shapes.values())


def place_of(shapes: Shapes, name: str) -> slice:
    """Return the place of an entry among the components of a state."""
    names = list(shapes)
    before = {entry: shapes[entry] for entry in names[: names.index(name)]}
    begin = size_of(before)
    return slice(begin, begin + size_of({name: shapes[name]}))


def state_after(potential: Remembering, strain: Ufl, values: Mapping[str, Ufl]) -> Ufl:
    """Return the components of the state after a load step, UFL (size,).

    Args:
        potential: The law.
        strain: The strain at its end, UFL (3, 3).
        values: Parameters, and the state before it.
    """
    new = potential.new_state(strain, **values)
    basis = [ufl.as_tensor(tensor.tolist()) for tensor in mandel_basis(3)]
    components: list[Ufl] = []
    for name, shape in potential.state.items():
        components += [ufl.inner(tensor, new[name]) for tensor in basis] if shape else [new[name]]
    return ufl.as_vector(components)


def entries(shapes: Shapes, components: Sequence[Ufl]) -> dict[str, Ufl]:
    """Return the entries of a state by their names from its components, UFL."""
    values = {}
    place = 0
    for name, shape in shapes.items():
        if shape:
            values[name] = in_tensor(components[place : place + 6])
            place += 6
        else:
            values[name] = components[place]
            place += 1
    return values
