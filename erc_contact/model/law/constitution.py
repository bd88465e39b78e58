"""Evaluate the law between strain and stress of a body in Mandel components at points.

It is ``sigma = C (eps - eps_0)`` with given strains eps_0. What else the package asks
of a body's law is its metric, the energy norm ``C^-1 sigma : sigma`` of stresses.

Of an axisymmetric body stresses and C are times the circumference
(:mod:`erc_contact.model.meridian`), and tensors have a hoop part as their last
component.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import Everywhere, OfNumbers, stand_in
from erc_contact.model.data.symbolic import constant_value, varies_in_cells
from erc_contact.model.space import Space
from erc_contact.scene.material import Elastic, Material, mandel_matrix, tensor_basis
from namedmesh.base.communicators import lasting


class StrainField(Protocol):
    """Evaluate given strains in Mandel components at points of cells [-]."""

    @property
    def varies_in_cells(self) -> bool: ...  # noqa: D102

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the strains, see :class:`erc_contact.model.law.strains.Strains`."""


class Constitution:
    """Hold the law of a body on a mesh; matrices are made when they are first asked.

    Points x are given for cells, shape (n, q, d) and (n,), and tensors in Mandel
    components at them, shape (n, q or 1, s). All methods are collective at first.

    Args:
        space: The mesh.
        material: The material.
        parameters: Its parameters, scalar UFL.
        given: The given strains, None without any.

    Example:
        >>> law = solution.model.constitution
        >>> strain = np.array([[[0.001, 0.0, 0.0]]])
        >>> law.stress(strain, x=np.zeros((1, 1, 2)), cells=np.array([0])).round(3)
        array([[[1.346, 0.577, 0.   ]]])
    """

    def __init__(
        self,
        space: Space,
        material: Material,
        parameters: Mapping[str, Ufl],
        given: StrainField | None,
    ) -> None:
        self._of_material = space, material, parameters
        self._given = given

    @cached_property
    def stiffness(self) -> ElasticMatrix:
        """Return C [force/area]."""
        return ElasticMatrix(*self._of_material)

    @cached_property
    def metric(self) -> ElasticMatrix:
        """Return C^-1 [area/force], the metric of stresses."""
        return ElasticMatrix(*self._of_material, inverse=True)

    @property
    def varies_in_cells(self) -> bool:
        """Tell whether moduli or given strains vary inside cells."""
        given = self._given is not None and self._given.varies_in_cells
        return given or self.stiffness.varies_in_cells

    @property
    def form_varies(self) -> bool:
        """Tell whether they may vary inside cells while a form of them stays."""
        return self.varies_in_cells or self.stiffness.form_varies

    def stress(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the stress ``C (eps - eps_0)`` of a strain [force/area]."""
        return self.stress_change(self._elastic(strain, x, cells), x, cells)

    def _elastic(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the elastic strain ``eps - eps_0``."""
        return strain if self._given is None else strain - self._given(x, cells)

    def stress_change(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the stress ``C eps`` of a change of the strain [force/area]."""
        return self.stiffness.times(strain, x, cells)

    def energy(
        self, strain: np.ndarray, stress: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Return the energy density of a strain and its stress [force/area], (n, q)."""
        elastic = self._elastic(strain, x, cells)
        return np.asarray(0.5 * np.einsum("...i,...i->...", stress, elastic))

    def squares(
        self, strain: np.ndarray, stress: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Return the squares of how far a strain and a stress are from the law.

        Returns:
            ``|sigma - C (eps - eps_0)|^2`` and ``|sigma + C (eps - eps_0)|^2`` in the
            metric [force/area], shape (n, q, 2).
        """
        strain = self._elastic(strain, x, cells)
        misfit = stress - self.stress_change(strain, x, cells)
        square = np.einsum("...i,...i->...", self.metric.times(misfit, x, cells), misfit)
        # The square of the sum is more by four times the work.
        work = np.einsum("...i,...i->...", stress, strain)
        return np.stack([square, square + 4.0 * work], axis=-1)


class ElasticMatrix:
    """Evaluate C or C^-1 of a material in Mandel components at points of cells.

    Construction is collective. The matrix knows the place by the parameters of the
    material only. So it is compiled as a function of their numbers, once for all data
    and meshes.

    Args:
        space: The mesh.
        material: The material.
        parameters: Its parameters, scalar UFL.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Attributes:
        size: Number s of Mandel components.
        section: What the body is; its weights are factors of C, and divide C^-1.
        varies_in_cells: Whether it varies inside cells.
    """

    def __init__(
        self,
        space: Space,
        material: Material,
        parameters: Mapping[str, Ufl],
        *,
        inverse: bool = False,
    ) -> None:
        d, mesh = space.d, space.mesh
        self.section = space.section
        self.size = len(self.section.basis)
        self._weighted = self.section.over if inverse else self.section.times
        self._parameters_vary = any(varies_in_cells(value) for value in parameters.values())
        self.varies_in_cells = self.section.varies or self._parameters_vary
        self._constant: np.ndarray | None = None
        self._parameters = {name: Everywhere(value, mesh) for name, value in parameters.items()}
        constants = {}
        for name, parameter in self._parameters.items():
            if parameter.plain is not None:
                constants[name] = float(parameter.plain)
        # A material that does not vary needs no compiled code.
        if len(constants) == len(parameters):
            if type(material) is Elastic:
                self._constant = _constant(material.hypothesis, d, inverse, **constants)
            else:
                self._constant = constant_value(_matrix(material, d, inverse, parameters))
            return
        self._numbers = {name: stand_in((), i) for i, name in enumerate(parameters)}
        # numpy is four times as slow as compiled code in its hundreds of operations.
        matrix = _matrix(material, d, inverse, self._numbers)
        self._matrix = OfNumbers(matrix, lasting(mesh.comm), is_matrix=True)

    @property
    def form_varies(self) -> bool:
        """Tell whether it may vary inside cells while a form of it stays."""
        return self.varies_in_cells

    @property
    def plain(self) -> np.ndarray | None:
        """Return the matrix (s, s) where it does not vary, else None."""
        return None if self.varies_in_cells else self._constant

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the matrix at points.

        Args:
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            Shape (n, q, s, s).
        """
        matrix = self._weighted(self.of_material(x, cells), x)
        return np.broadcast_to(matrix, (*x.shape[:2], self.size, self.size))

    def times(self, tensor: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Multiply the matrix and tensors (n, q, s) at points, see :meth:`__call__`."""
        return self._weighted(self._of_material_times(tensor, x, cells), x)

    def _of_material_times(
        self, tensor: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Multiply :meth:`of_material` and tensors (n, q, s) at points."""
        if not self._parameters_vary:
            return act(self.of_material(x, cells), tensor)
        shape = (*x.shape[:2], self.size)
        vectors = np.broadcast_to(tensor, shape).reshape(-1, self.size)
        return self._matrix.times(self._numbers_at(x, cells), vectors).reshape(shape)

    def of_material(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the matrix of the material, without weights, at points.

        Args:
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            Shape (n, q, s, s), with 1 in place of n or q where it does not vary.
        """
        if self._constant is not None:
            return self._constant[None, None]
        if not self._parameters_vary:
            x = x[:, :1]
        n, q, _ = x.shape
        matrices = self._matrix(self._numbers_at(x, cells), n * q)
        return matrices.reshape(n, q, self.size, self.size)

    def _numbers_at(self, x: np.ndarray, cells: np.ndarray) -> dict[Ufl, np.ndarray]:
        """Return the parameters at points, as the compiled matrix takes them."""
        return {
            self._numbers[name]: parameter(x, cells).reshape(-1, 1)
            for name, parameter in self._parameters.items()
        }


def _matrix(material: Material, d: int, inverse: bool, parameters: Mapping[str, Ufl]) -> Ufl:
    """Return C or C^-1 of a material in Mandel components, UFL."""
    act = material.compliance if inverse else material.stress
    return mandel_matrix(act, tensor_basis(material, d), **parameters)


def act(moduli: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    """Multiply moduli and tensors in Mandel components.

    Args:
        moduli: Shape (n or 1, q or 1, s, s).
        tensor: Shape (n, q or 1, s).
    """
    if moduli.shape[:2] == (1, 1):
        return tensor @ moduli[0, 0].T
    if moduli.shape[1] == 1:
        return np.matmul(tensor, moduli[:, 0].transpose(0, 2, 1))
    return np.einsum("...ij,...j->...i", moduli, tensor)


@lru_cache(maxsize=64)
def _constant(hypothesis: str, d: int, inverse: bool, E: float, nu: float) -> np.ndarray:
    """Return the matrix of :class:`Elastic` where it does not vary."""
    material = Elastic(E, nu, hypothesis)
    matrix = constant_value(_matrix(material, d, inverse, {"E": E, "nu": nu}))
    # The array is shared by all callers.
    matrix.flags.writeable = False
    return matrix
