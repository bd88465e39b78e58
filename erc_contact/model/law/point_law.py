"""Evaluate a law with a convex potential at points of cells.

Tensors are in Mandel components of space, of which a body in plane strain has xx, yy
and xy, and an axisymmetric body rr, zz, rz and hoop.

Symbols: s number of components that the body has, n cells, q points of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import NamedTuple

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import OfNumbers, definite_inverses
from erc_contact.model.data.ranges import Ranges, ranges_of
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.law.law_code import LawKind, law_code
from erc_contact.model.law.law_entries import StateField
from erc_contact.model.space import Space
from erc_contact.scene.material import HOOP_ROWS
from erc_contact.scene.potential import Potential, tells_convexity
from namedmesh.base.communicators import lasting

STEPS_OUT_OF_PLANE = 40
"""Limit of the steps to the stress out of plane.

psi* at any stress out of plane bounds its minimum from above.
"""
AT_MINIMUM = 1e-15
"""Share of psi* that a last such step may gain [-]."""
STEPS_TO_SUPREMUM = 50
"""Limit of Newton steps to a conjugate that is not given."""
HALVINGS = 20
"""Limit of halvings of such a step."""
SHARE_OF_GAP = 1e-10
"""Share of Fenchel's gap that a last such step may gain [-]."""


class Search(NamedTuple):
    """Say where the search for psi* at points starts, and when it ends.

    Attributes:
        near: Stress out of plane from which it starts [force/area], shape (n, q).
        beside: ``psi - sigma : eps`` [force/area], shape (n, q), which makes Fenchel's
            gap with psi*. The search ends at a small share of the gap; by default at
            round-off.
        strain: Strain from which the search for a conjugate that is not given starts
            [-], shape (n, q or 1, s).
    """

    near: np.ndarray
    beside: np.ndarray | float = np.inf
    strain: np.ndarray | float = 0.0


class PointLaw:
    """Evaluate a potential, its derivatives and its conjugate at points of cells.

    Points x are given for cells, shapes (n, q, d) and (n,).

    Args:
        space: The mesh.
        potential: The potential.
        parameters: Its parameters, scalar UFL. Construction is collective.
        state: The state of the body before the load step; None of laws without.

    Attributes:
        rows: The components of ``mandel_basis(3)`` that the body has.
        is_plane: Whether the body is in plane strain, with a stress out of plane.
        state: As given.
    """

    def __init__(
        self,
        space: Space,
        potential: Potential,
        parameters: Mapping[str, Ufl],
        state: StateField | None = None,
    ) -> None:
        values = {name: space.everywhere(value) for name, value in parameters.items()}
        plain = {
            name: float(value.plain) for name, value in values.items() if value.plain is not None
        }
        # A law whose parameters vary in part has them all at each point: of all laws
        # there are two kinds of code only.
        constants = plain if len(plain) == len(values) else {}
        of_points = {name: value for name, value in values.items() if name not in constants}
        self._parameters = list(of_points.values())
        self.state = state
        self.is_plane = space.section.rows == 2
        # The last of these, out of plane or hoop, is no component of plane strain.
        known = list(HOOP_ROWS) if space.d == 2 else list(range(6))
        self.rows = known[:-1] if self.is_plane else known
        self.varies_in_cells = any(varies_in_cells(value) for value in parameters.values())
        if state is not None:
            self.varies_in_cells |= state.varies_in_cells
        self._given_data: np.ndarray | None = None
        self._ranges: list[Ranges | None] = []
        if self.varies_in_cells:
            self._ranges = [ranges_of(parameters[name], space.mesh) for name in of_points]
        self._convexity = None
        if tells_convexity(potential):
            share = ufl.as_ufl(potential.convexity(**parameters))
            self._convexity = space.everywhere(share)
        comm = lasting(space.comm)
        kind = LawKind(tuple(of_points), constants, self.is_plane, tuple(known), comm)
        self._code = law_code(potential, kind)

    @property
    def has_convexity(self) -> bool:
        """Tell whether the law tells how convex it is."""
        return self._convexity is not None

    # -- data: the parameters of points and the state

    def data_at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the parameters of points and the state, shape (n, q, m)."""
        if self._given_data is not None:
            return self._given_data
        data = np.zeros((*x.shape[:2], self._code.row.ufl_shape[0] - 6))
        for i, value in enumerate(self._parameters):
            data[..., i] = value(x, cells)
        if self.state is not None:
            data[..., len(self._parameters) :] = self.state.at(x, cells)
        return data

    @property
    def knows_ranges(self) -> bool:
        """Tell whether data vary in cells, and :meth:`data_ranges` bounds them."""
        return self.varies_in_cells and None not in self._ranges

    def data_ranges(self, corners: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bound the data in pieces of cells.

        Args:
            corners: Vertices of the pieces [length], shape (n, d+1, d).
            cells: The cells in which they lie, shape (n,).

        Returns:
            The least and the greatest data, shape (n, m) each.
        """
        bounds = []
        for of_parameter in self._ranges:
            assert of_parameter is not None
            bounds.append(np.stack(of_parameter(corners, cells))[..., None])
        if self.state is not None:
            bounds.append(np.stack(self.state.ranges(corners, cells)))
        low, high = np.concatenate(bounds, axis=2)
        return low, high

    def with_data(self, data: np.ndarray) -> PointLaw:
        """Return the law with other data at the points, shape (n, q, m)."""
        result = copy(self)
        result._given_data = data
        return result

    # -- values

    def energy(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return psi of strains (n, q, s) that the body has [force/area], (n, q)."""
        return self._at(self._code.energy, eps, x, cells)[..., 0]

    def stress(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the components of psi' that the body has [force/area], (n, q, s)."""
        return self.whole_stress(eps, x, cells)[..., : len(self.rows)]

    def whole_stress(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return psi', in plane strain with the stress out of plane as the last."""
        return self._at(self._code.stress, eps, x, cells)

    def tangent(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return psi'' at strains of the body [force/area], shape (n, q, s, s)."""
        size = len(self.rows)
        return self.whole_tangent(eps, x, cells)[..., :size, :size]

    def whole_tangent(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return psi'' as :meth:`whole_stress` has components."""
        values = self._at(self._code.tangent, eps, x, cells)
        size = len(self._code.known)
        return values.reshape(*values.shape[:2], size, size)

    def in_space(self, tensor: np.ndarray) -> np.ndarray:
        """Return six components of tensors of the body, or of :meth:`whole_stress`."""
        result = np.zeros((*tensor.shape[:-1], 6))
        result[..., self._code.known[: tensor.shape[-1]]] = tensor
        return result

    def strain_at_rest(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the strain without stress, ``psi*'(0)``, shape (n, q, s).

        It is zero without a state. In plane strain only the stress in the plane is
        zero.
        """
        size = len(self.rows)
        nothing = np.zeros((*x.shape[:2], size))
        if self.state is None:
            return nothing
        return self.dual(nothing, Search(nothing[..., 0]), x, cells)[1]

    def dual(
        self, stress: np.ndarray, search: Search, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return psi* of stresses and the strain ``psi*'``.

        See :meth:`complementary` for the arguments.

        Returns:
            psi* [force/area], shape (n, q), and the strain, shape (n, q, s).
        """
        if not self._code.has_conjugate:
            return self._supremum(stress, search, x, cells)
        energy, numbers = self._minimum(stress, search, x, cells)
        values = self._evaluate(self._code.dual, numbers)
        strain = values.reshape(*stress.shape[:2], len(self._code.known))
        return energy, strain[..., : stress.shape[-1]]

    def new_state(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the state after a load step that ends at strains, (n, q, size)."""
        return self._at(self._code.new_state, eps, x, cells)

    def complementary(
        self, stress: np.ndarray, search: Search, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return psi* of stresses, in plane strain its minimum over sigma_zz.

        Newton's method finds the minimum at each point. The least value that it has
        seen is taken, and each one is a bound of the minimum from above.

        Args:
            stress: Stresses that the body has [force/area], shape (n, q, s).
            search: Where the search starts and ends.
            x: Points of each cell [length].
            cells: The cells.

        Returns:
            psi* [force/area] and sigma_zz [force/area], each (n, q).
        """
        shape = stress.shape[:2]
        if not self._code.has_conjugate:
            energy, eps = self._supremum(stress, search, x, cells)
            out = self.whole_stress(eps, x, cells)[..., -1] if self.is_plane else np.zeros(shape)
            return energy, out
        energy, numbers = self._minimum(stress, search, x, cells)
        out = numbers[:, HOOP_ROWS[-1]].reshape(shape) if self.is_plane else np.zeros(shape)
        return energy, out

    def _minimum(
        self, stress: np.ndarray, search: Search, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return psi* of a conjugate that is given, shape (n, q), and all numbers.

        In plane strain the stress out of plane is among the numbers.
        """
        shape = stress.shape[:2]
        numbers = self._numbers_at(stress, x, cells)
        if not self.is_plane:
            return self._evaluate(self._code.conjugate, numbers)[:, 0].reshape(shape), numbers
        zz = HOOP_ROWS[-1]
        numbers[:, zz] = search.near.ravel()
        beside = np.broadcast_to(search.beside, shape).ravel()
        values = self._evaluate(self._code.conjugate, numbers)
        best, best_out = values[:, 0].copy(), numbers[:, zz].copy()
        left = np.arange(len(numbers))
        low, high = np.full(len(numbers), -np.inf), np.full(len(numbers), np.inf)
        for _ in range(STEPS_OUT_OF_PLANE):
            energy, slope, curvature = values.T
            step = np.divide(slope, curvature, out=np.zeros_like(slope), where=curvature > 0)
            gain = 0.5 * abs(slope * step)
            goes_on = gain > _allowance(energy, beside[left])
            if not goes_on.any():
                break
            left, slope, step = left[goes_on], slope[goes_on], step[goes_on]
            # psi* is convex: the sign of its slope tells on which side its minimum is.
            # Across kinks of the hardening, steps of Newton's method may go to and fro.
            at = numbers[left, zz]
            low[left] = np.where(slope < 0, at, low[left])
            high[left] = np.where(slope > 0, at, high[left])
            tried = at - step
            is_beyond = (tried <= low[left]) | (tried >= high[left])
            tried[is_beyond] = (low[left] + high[left])[is_beyond] / 2
            numbers[left, zz] = tried
            values = self._evaluate(self._code.conjugate, numbers[left])
            less = values[:, 0] < best[left]
            best[left[less]] = values[less, 0]
            best_out[left[less]] = numbers[left[less], zz]
        numbers[:, zz] = best_out
        return best.reshape(shape), numbers

    def convexity(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the share of ``psi''(0)`` that psi is convex by, shape (n, q)."""
        assert self._convexity is not None
        return self._convexity(x, cells)

    def _supremum(
        self, stress: np.ndarray, search: Search, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a bound of ``sup sigma : eps - psi(eps)``, and its strain.

        Newton's steps are halved where the value would fall. With the stress rho that
        a strain misses, convexity says for any other strain at the distance delta

            sigma : delta - psi(eps + delta) + psi(eps)
                <=  rho : delta - a/2 delta : C delta  <=  rho : (a C)^-1 rho / 2,

        which is added. C is psi'' without strain, and a the share of it that is known.
        The steps of a point end where this is small, see :class:`Search`.

        Returns:
            The bound [force/area], shape (n, q), and the strain, shape (n, q, s).
        """
        numbers = self._numbers_at(np.zeros_like(stress), x, cells)
        sigma = stress.reshape(len(numbers), len(self.rows))
        metric = definite_inverses(self._tangents(numbers))
        twice_share = 2 * np.broadcast_to(self.convexity(x, cells), stress.shape[:2]).ravel()
        beside = np.broadcast_to(search.beside, stress.shape[:2]).ravel()
        numbers[:, self.rows] = np.broadcast_to(search.strain, stress.shape).reshape(sigma.shape)
        value = self._value(sigma, numbers)
        lack = np.zeros(len(numbers))
        left = np.arange(len(numbers))
        for _ in range(STEPS_TO_SUPREMUM):
            missed = sigma[left] - self._stresses(numbers[left])
            of_missed = np.matmul(metric[left], missed[..., None])[..., 0]
            lack[left] = (missed * of_missed).sum(axis=1) / twice_share[left]
            goes_on = lack[left] > _allowance(value[left], beside[left])
            left, missed = left[goes_on], missed[goes_on]
            if not len(left):
                break
            step = np.linalg.solve(self._tangents(numbers[left]), missed[..., None])[..., 0]
            # Where no share of a step is a gain, round-off is all that is left.
            gains = np.zeros(len(left), dtype=bool)
            falls = np.arange(len(left))
            for halvings in range(HALVINGS):
                tried = numbers[left[falls]]
                tried[:, self.rows] += 0.5**halvings * step[falls]
                new = self._value(sigma[left[falls]], tried)
                old = value[left[falls]]
                # What is no number falls, too.
                is_gain = new >= old - AT_MINIMUM * abs(old)
                taken = left[falls[is_gain]]
                numbers[taken] = tried[is_gain]
                value[taken] = new[is_gain]
                gains[falls[is_gain]] = True
                falls = falls[~is_gain]
                if not len(falls):
                    break
            left = left[gains]
        return (value + lack).reshape(stress.shape[:2]), numbers[:, self.rows].reshape(stress.shape)

    def _value(self, sigma: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return ``sigma : eps - psi(eps)`` for strains among numbers, shape (n,)."""
        energy = self._evaluate(self._code.energy, numbers)[:, 0]
        return np.asarray((sigma * numbers[:, self.rows]).sum(axis=1) - energy)

    def _stresses(self, numbers: np.ndarray) -> np.ndarray:
        """Return psi' that the body has for strains among numbers, shape (n, s)."""
        return self._evaluate(self._code.stress, numbers)[:, : len(self.rows)]

    def _tangents(self, numbers: np.ndarray) -> np.ndarray:
        """Return psi'' for strains among numbers, shape (n, s, s)."""
        values = self._evaluate(self._code.tangent, numbers)
        known, size = len(self._code.known), len(self.rows)
        return np.asarray(values.reshape(len(values), known, known)[:, :size, :size])

    def _evaluate(self, part: OfNumbers, numbers: np.ndarray) -> np.ndarray:
        """Return a compiled part of the law for the numbers of points, (n, size)."""
        return np.asarray(part({self._code.row: numbers}, len(numbers)))

    def _at(
        self, part: OfNumbers, tensor: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Evaluate a compiled part of the law, shape (n, q, size)."""
        numbers = self._numbers_at(tensor, x, cells)
        values = self._evaluate(part, numbers)
        return values.reshape(*tensor.shape[:2], values.shape[-1])

    def _numbers_at(self, tensor: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return all numbers of points, shape (n q, size), as the law is compiled."""
        n, q = tensor.shape[:2]
        numbers = np.zeros((n, q, self._code.row.ufl_shape[0]))
        numbers[..., self.rows] = tensor
        numbers[..., 6:] = self.data_at(x, cells)
        return numbers.reshape(n * q, numbers.shape[-1])


def _allowance(energy: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return what a conjugate may be off [force/area].

    See :class:`Search` for ``beside``.
    """
    allowed = AT_MINIMUM * abs(energy)
    if np.isfinite(beside).all():
        allowed = np.maximum(allowed, SHARE_OF_GAP * (beside + energy))
    return allowed
