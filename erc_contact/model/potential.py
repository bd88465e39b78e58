"""Evaluate a law with a convex potential, and linearise it about a strain.

The contact solver, the reconstruction of stresses and the tightening know linear laws
``sigma = C (eps - eps_0)``. A potential gives them its linearisation about the strain
E of a displacement,

    C = psi''(E),    eps_0 = E - C^-1 psi'(E),

so that Newton's method for the body is a sequence of contact problems of linear bodies
(:mod:`erc_contact.newton.law`), and the last one has the pair. Only the gap of the law
knows psi and psi* themselves.

Tensors are in Mandel components of space, of which a body in plane strain uses some.
Symbols: s number of components that the body uses, n cells, q points of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.communicators import lasting
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.constitution import Constitution, ElasticMatrix
from erc_contact.model.expressions import Everywhere, OfNumbers
from erc_contact.model.meridian import in_space
from erc_contact.model.space import Space
from erc_contact.model.stand_ins import stand_in
from erc_contact.model.symbolic import varies_in_cells, without_derivatives
from erc_contact.scene.material import mandel_basis, strain
from erc_contact.scene.potential import Potential

PLANE_ROWS = (0, 1, 3)
"""Components of ``mandel_basis(3)`` that a tensor in the plane has: xx, yy and xy."""
STEPS_OUT_OF_PLANE = 8
"""Limit of Newton steps for the stress out of plane; any value of it gives a bound."""
AT_MINIMUM = 1e-15
"""Share of psi* that a last such step may gain [-]."""


class Derivatives:
    """Differentiate a potential at a strain of space, in UFL.

    Args:
        potential: The potential.
        eps: The strain, UFL (3, 3).
        rows: Components of ``mandel_basis(3)`` by which it is differentiated.
        parameters: Parameters of the potential, UFL.
    """

    def __init__(
        self, potential: Potential, eps: Ufl, rows: Sequence[int], parameters: Mapping[str, Ufl]
    ) -> None:
        self._amounts = []
        for tensor in mandel_basis(3)[list(rows)]:
            amount = ufl.variable(ufl.as_ufl(0.0))
            eps += amount * ufl.as_tensor(tensor.tolist())
            self._amounts.append(amount)
        self.energy = potential.potential(eps, **parameters)

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


class PointLaw:
    """Evaluate a potential, its derivatives and its conjugate at points of cells.

    Args:
        space: The mesh.
        potential: The potential.
        parameters: Its parameters, scalar UFL. Construction is collective.

    Attributes:
        rows: The components of ``mandel_basis(3)`` that the body uses.
    """

    def __init__(self, space: Space, potential: Potential, parameters: Mapping[str, Ufl]) -> None:
        self._comm = lasting(space.comm)
        self._potential = potential
        self._values = {}
        self._numbers = {}
        for number, (name, value) in enumerate(parameters.items()):
            self._values[name] = Everywhere(value, space.mesh)
            self._numbers[name] = stand_in((), number)
        self.rows = list(PLANE_ROWS) if space.d == 2 else list(range(6))
        self._tensor = stand_in((6,), 0)
        self._out_of_plane = stand_in((), len(parameters))
        self.varies_in_cells = any(varies_in_cells(value) for value in parameters.values())

    @cached_property
    def _energy_and_stress(self) -> OfNumbers:
        """Compile psi and psi' as functions of a strain."""
        law = self._derivatives(range(6))
        return self._compiled(ufl.as_vector([law.energy, *law.stress()]))

    @cached_property
    def _tangent(self) -> OfNumbers:
        """Compile psi'' as a function of a strain, for the rows that the body uses."""
        return self._compiled(self._derivatives(self.rows).tangent())

    @cached_property
    def _conjugate(self) -> OfNumbers:
        """Compile psi* and its two derivatives by the stress out of plane."""
        out = ufl.variable(self._out_of_plane)
        normal = ufl.as_tensor(np.diag([0.0, 0.0, 1.0]).tolist())
        stress = _in_tensor(self._tensor) + out * normal
        energy = self._potential.conjugate(stress, **self._numbers)
        slope = ufl.diff(energy, out)
        return self._compiled(ufl.as_vector([energy, slope, ufl.diff(slope, out)]))

    def _derivatives(self, rows: Sequence[int]) -> Derivatives:
        """Return the derivatives of psi as functions of numbers."""
        return Derivatives(self._potential, _in_tensor(self._tensor), rows, self._numbers)

    def _compiled(self, expression: Ufl) -> OfNumbers:
        """Compile an expression of numbers at points; collective."""
        return OfNumbers(without_derivatives(expression), self._comm, is_matrix=True)

    def energy_and_stress(
        self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return psi (n, q) and all six components of psi' [force/area].

        Args:
            eps: Strains that the body has, shape (n, q, s).
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).
        """
        values = self._at(self._energy_and_stress, self._in_space(eps), x, cells)
        return values[..., 0], values[..., 1:]

    def stress(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the components of psi' that the body uses [force/area], (n, q, s)."""
        return self.energy_and_stress(eps, x, cells)[1][..., self.rows]

    def tangent(self, eps: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return psi'' at strains of the body [force/area], shape (n, q, s, s)."""
        values = self._at(self._tangent, self._in_space(eps), x, cells)
        size = len(self.rows)
        return values.reshape(*values.shape[:2], size, size)

    def complementary(
        self, stress: np.ndarray, near: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return psi* of stresses, in the plane its minimum over sigma_zz.

        Newton's method finds the minimum at each point. The least value that it has
        seen is taken, and each one is a bound of the minimum from above.

        Args:
            stress: Stresses that the body has [force/area], shape (n, q, s).
            near: Stress out of plane from which it starts [force/area], shape (n, q).
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            psi* [force/area] and sigma_zz [force/area], each (n, q).
        """
        tensors = self._in_space(stress)
        in_plane = len(self.rows) < 6
        out = near.copy() if in_plane else np.zeros(near.shape)
        energy, slope, curvature = np.moveaxis(
            self._at(self._conjugate, tensors, x, cells, out), -1, 0
        )
        best = energy, out
        for _ in range(STEPS_OUT_OF_PLANE if in_plane else 0):
            step = np.divide(slope, curvature, out=np.zeros_like(slope), where=curvature > 0)
            if not (0.5 * abs(slope * step) > AT_MINIMUM * abs(best[0])).any():
                break
            out = out - step
            energy, slope, curvature = np.moveaxis(
                self._at(self._conjugate, tensors, x, cells, out), -1, 0
            )
            is_less = energy < best[0]
            best = np.where(is_less, energy, best[0]), np.where(is_less, out, best[1])
        return best

    def _in_space(self, tensor: np.ndarray) -> np.ndarray:
        """Return all six components of tensors (n, q, s)."""
        result = np.zeros((*tensor.shape[:-1], 6))
        result[..., self.rows] = tensor
        return result

    def _at(
        self,
        law: OfNumbers,
        tensor: np.ndarray,
        x: np.ndarray,
        cells: np.ndarray,
        out_of_plane: np.ndarray | None = None,
    ) -> np.ndarray:
        """Evaluate a compiled part of the law, shape (n, q, size)."""
        n, q = tensor.shape[:2]
        numbers: dict[Any, np.ndarray] = {self._tensor: tensor.reshape(n * q, 6)}
        for name, value in self._values.items():
            of_points = np.broadcast_to(value(x, cells), (n, q))
            numbers[self._numbers[name]] = of_points.reshape(n * q, 1)
        if out_of_plane is not None:
            numbers[self._out_of_plane] = out_of_plane.reshape(n * q, 1)
        values = law(numbers, n * q)
        return values.reshape(n, q, values.shape[-1])


class Linearised:
    """Linearise a potential about the strain of a displacement; it acts as a material.

    Construction is collective.

    Args:
        space: The mesh.
        potential: The potential.
        law: Its values at points.
        u: The displacement [length]; None for a body at rest.

    Attributes:
        law: As given.
        u: As given.
        strain: The strain E of u in Mandel components, a Function.
    """

    def __init__(
        self, space: Space, potential: Potential, law: PointLaw, u: fem.Function | None
    ) -> None:
        self._potential = potential
        self._tensors = [ufl.as_matrix(tensor.tolist()) for tensor in mandel_basis(space.d)]
        self.law = law
        self.u = u
        W = fem.functionspace(space.mesh, ("DG", space.degree - 1, (len(self._tensors),)))
        self.strain = fem.Function(W)
        if u is not None:
            components = [ufl.inner(tensor, strain(u)) for tensor in self._tensors]
            at_nodes = compiled.expression(
                ufl.as_vector(components), W.element.interpolation_points, space.comm
            )
            self.strain.interpolate(at_nodes)
        self._of_points = Everywhere(self.strain, space.mesh)
        self.varies_in_cells = law.varies_in_cells or (space.degree > 1 and not self.at_rest)

    @property
    def at_rest(self) -> bool:
        """Tell whether there is no strain."""
        return self.u is None

    def at(self, space: Space, u: fem.Function) -> Linearised:
        """Return the linearisation about another displacement; collective."""
        return Linearised(space, self._potential, self.law, u)

    # -- UFL, as a material has it

    def stress(self, eps: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``C eps`` [force/area], UFL, of the shape of eps."""
        components = [ufl.inner(tensor, eps) for tensor in self._tensors]
        return self._tensor(self._law(parameters).tangent() * ufl.as_vector(components))

    def given_stress(self, **parameters: Ufl) -> Ufl:
        """Return ``C eps_0 = C E - psi'(E)`` [force/area], UFL, shape (d, d)."""
        law = self._law(parameters)
        return self._tensor(law.tangent() * self.strain - law.stress())

    def _law(self, parameters: Mapping[str, Ufl]) -> Derivatives:
        """Return the derivatives of the potential at E."""
        eps = self._tensor(self.strain)
        if len(self._tensors) == 3:
            eps = in_space(eps, 0)
        return Derivatives(self._potential, eps, self.law.rows, parameters)

    def _tensor(self, components: Ufl) -> Ufl:
        """Return the tensor of Mandel components of the body, UFL (d, d)."""
        return sum(components[i] * tensor for i, tensor in enumerate(self._tensors))

    def modulus(self, **parameters: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area], UFL."""
        return self._potential.modulus(**parameters)

    # -- at points

    def strain_at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate E at points of cells, shape (n, q, s)."""
        return self._of_points(x, cells)

    def tangent_at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate C at points of cells [force/area], shape (n, q, s, s)."""
        return self.law.tangent(self.strain_at(x, cells), x, cells)

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate eps_0 at points of cells, as given strains are, shape (n, q, s)."""
        eps = self.strain_at(x, cells)
        stress = self.law.stress(eps, x, cells)
        tangent = self.law.tangent(eps, x, cells)
        return eps - np.linalg.solve(tangent, stress[..., None])[..., 0]


class TangentMatrix(ElasticMatrix):
    """Evaluate the tangent C of a linearised potential, or its inverse, at points."""

    def __init__(self, linearised: Linearised, *, inverse: bool = False) -> None:
        self.size = len(linearised.law.rows)
        self.on_rings = False
        self.varies_in_cells = linearised.varies_in_cells
        self._constant = None
        self._linearised = linearised
        self._inverse = inverse

    def of_material(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the matrix, see :meth:`.constitution.ElasticMatrix.of_material`."""
        if not self.varies_in_cells:
            x = x[:, :1]
        tangent = self._linearised.tangent_at(x, cells)
        return np.linalg.inv(tangent) if self._inverse else tangent


class ConvexConstitution(Constitution):
    """Hold a linearised potential as the law of a body, with Fenchel's gap.

    Args:
        linearised: The linearisation.
    """

    def __init__(self, linearised: Linearised) -> None:
        self._linearised = linearised
        self._given = None if linearised.at_rest else linearised

    @cached_property
    def stiffness(self) -> TangentMatrix:
        """Return C [force/area]."""
        return TangentMatrix(self._linearised)

    @cached_property
    def metric(self) -> TangentMatrix:
        """Return C^-1 [area/force], the metric of stresses."""
        return TangentMatrix(self._linearised, inverse=True)

    def squares(
        self, strain: np.ndarray, stress: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Return twice Fenchel's gap, and the same with plus.

        Returns:
            ``2 (psi + psi* -+ sigma : eps)`` [force/area], shape (n, q, 2).
        """
        law = self._linearised.law
        psi, of_law = law.energy_and_stress(strain, x, cells)
        psi_star, _ = law.complementary(stress, of_law[..., 2], x, cells)
        work = (stress * strain).sum(axis=-1)
        terms = np.stack([psi + psi_star - work, psi + psi_star + work], axis=-1)
        # Below zero there is only round-off.
        return 2 * np.maximum(terms, 0.0)


def _in_tensor(components: Ufl) -> Ufl:
    """Return the tensor (3, 3) of six Mandel components, UFL."""
    basis = [ufl.as_tensor(one.tolist()) for one in mandel_basis(3)]
    return sum(components[i] * one for i, one in enumerate(basis))
