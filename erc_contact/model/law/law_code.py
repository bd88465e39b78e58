"""Compile the parts of a law with a convex potential as functions of numbers.

All that the law knows of a point, a strain or stress, parameters and state, are numbers
in a row. So each part of a law is compiled once, for all data and meshes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from mpi4py import MPI

from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import OfNumbers, line, stand_in
from erc_contact.model.data.symbolic import without_derivatives, without_variables
from erc_contact.model.law.law_entries import entries, size_of, state_after
from erc_contact.scene.material import in_tensor, mandel_basis
from erc_contact.scene.potential import Potential, gives_conjugate, remembers


class Derivatives:
    """Differentiate a potential at a strain of space, in UFL.

    Args:
        potential: The potential.
        eps: The strain, UFL (3, 3).
        rows: Components of ``mandel_basis(3)`` by which it is differentiated.
        values: Parameters and state of the potential, UFL.
    """

    def __init__(
        self, potential: Potential, eps: Ufl, rows: Sequence[int], values: Mapping[str, Ufl]
    ) -> None:
        self._amounts = []
        for tensor in mandel_basis(3)[list(rows)]:
            amount = ufl.variable(ufl.as_ufl(0.0))
            eps += amount * ufl.as_tensor(tensor.tolist())
            self._amounts.append(amount)
        self.energy = potential.potential(eps, **values)

    def stress(self) -> Ufl:
        """Return the components of psi' [force/area], UFL (s,)."""
        return ufl.as_vector([ufl.diff(self.energy, amount) for amount in self._amounts])

    def tangent(self) -> Ufl:
        """Return psi'' [force/area], UFL (s, s)."""
        size = len(self._amounts)
        matrix = [[ufl.as_ufl(0.0)] * size for _ in range(size)]
        for i, amount in enumerate(self._amounts):
            slope = ufl.diff(self.energy, amount)
            for j in range(i + 1):
                matrix[i][j] = matrix[j][i] = ufl.diff(slope, self._amounts[j])
        return ufl.as_matrix(matrix)


class LawKind(NamedTuple):
    """Hold what decides on the code of a law beside its potential.

    Attributes:
        names: Names of the parameters that are numbers of a point.
        constants: Values of all other parameters, the same at all points. A compiled
            part has them as constants, which are not copied to each point.
        is_plane: Whether bodies are in plane strain.
        known: Components of ``mandel_basis(3)`` that stresses of the law have: the
            components of the body, in plane strain the component out of plane as last.
        comm: The ranks that compile together.
    """

    names: tuple[str, ...]
    constants: Mapping[str, float]
    is_plane: bool
    known: tuple[int, ...]
    comm: MPI.Comm


class LawCode:
    """Hold the compiled parts of a law, each a function of the numbers of a point.

    Args:
        potential: The potential.
        kind: The kind of the law.

    Attributes:
        row: The numbers of a point: six components of a strain or stress, parameters
            by ``names``, state.
        place_of_state: Place of the state among them.
        has_conjugate: Whether the conjugate is given; else it is looked for.
    """

    def __init__(self, potential: Potential, kind: LawKind) -> None:
        names = kind.names
        self.potential = potential
        self.known = list(kind.known)
        self.kind = kind
        self.has_conjugate = gives_conjugate(potential)
        self._attributes = dict(getattr(potential, "__dict__", {}))
        shapes = getattr(potential, "state", {})
        self.place_of_state = 6 + len(names)
        size = self.place_of_state + size_of(shapes)
        self.row = stand_in((size,), 0)
        self._values = {name: self.row[6 + i] for i, name in enumerate(names)}
        state = [self.row[i] for i in range(self.place_of_state, size)]
        self._values |= entries(shapes, state)
        for name, value in kind.constants.items():
            self._values[name] = compiled.constant(line(), value)

    def is_of(self, potential: Potential) -> bool:
        """Tell whether a law is of the same class, with equal attributes as before."""
        now = getattr(potential, "__dict__", {})
        if type(self.potential) is not type(potential) or now.keys() != self._attributes.keys():
            return False
        return all(_are_equal(now[name], value) for name, value in self._attributes.items())

    @cached_property
    def energy(self) -> OfNumbers:
        """Compile psi as a function of a strain."""
        return self._compile(self._derivatives().energy)

    @cached_property
    def stress(self) -> OfNumbers:
        """Compile psi' as a function of a strain."""
        return self._compile(self._derivatives().stress())

    @cached_property
    def tangent(self) -> OfNumbers:
        """Compile psi'' as a function of a strain."""
        return self._compile(self._derivatives().tangent())

    @cached_property
    def conjugate(self) -> OfNumbers:
        """Compile psi*, in plane strain with derivatives by the stress out of plane."""
        if not self.kind.is_plane:
            return self._compile(self.potential.conjugate(self._tensor, **self._values))
        out = ufl.variable(ufl.as_ufl(0.0))
        normal = ufl.as_tensor(np.diag([0.0, 0.0, 1.0]).tolist())
        energy = self.potential.conjugate(self._tensor + out * normal, **self._values)
        slope = ufl.diff(energy, out)
        return self._compile(ufl.as_vector([energy, slope, ufl.diff(slope, out)]))

    @cached_property
    def dual(self) -> OfNumbers:
        """Compile psi*' as a function of a stress."""
        stress = ufl.variable(self._tensor)
        slope = ufl.diff(self.potential.conjugate(stress, **self._values), stress)
        basis = mandel_basis(3)[self.known]
        components = [ufl.inner(ufl.as_tensor(tensor.tolist()), slope) for tensor in basis]
        return self._compile(ufl.as_vector(components))

    @cached_property
    def new_state(self) -> OfNumbers:
        """Compile the state after a load step as a function of a strain."""
        assert remembers(self.potential)
        return self._compile(state_after(self.potential, self._tensor, self._values))

    @property
    def _tensor(self) -> Ufl:
        """Return the strain or stress of a point, UFL (3, 3)."""
        return in_tensor([self.row[i] for i in range(6)])

    def _derivatives(self) -> Derivatives:
        """Return the derivatives of psi as functions of numbers."""
        return Derivatives(self.potential, self._tensor, self.known, self._values)

    def _compile(self, expression: Ufl) -> OfNumbers:
        """Compile an expression of numbers at points; collective."""
        plain = without_variables(without_derivatives(expression))
        return OfNumbers(plain, self.kind.comm, is_matrix=True)


def _are_equal(value: Any, before: Any) -> bool:
    """Tell whether an attribute of a law has the value that it had before.

    An array or a dictionary may have changed in place, so it must be the same object.
    """
    if value is before:
        return True
    if type(value) is not type(before) or not isinstance(value, Hashable):
        return False
    answer = value == before
    # Values of other libraries may compare entry by entry.
    return isinstance(answer, bool | np.bool_) and bool(answer)


_recent: deque[LawCode] = deque(maxlen=8)
"""The laws that were used last: all meshes and steps of a run have the same ones."""


def law_code(potential: Potential, kind: LawKind) -> LawCode:
    """Return the code of a law, the same for all its meshes; see :class:`LawCode`."""
    for code in _recent:
        if code.is_of(potential) and code.kind == kind:
            return code
    _recent.append(LawCode(potential, kind))
    return _recent[-1]
