"""Evaluate stiffness and compliance of a material in Mandel components at points."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.base.runtime.communicators import lasting
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.expressions import Everywhere, OfNumbers
from erc_contact.model.stand_ins import stand_in
from erc_contact.model.symbolic import constant_value, varies_in_cells
from erc_contact.scene.material import Elastic, Material, mandel_matrix


class ElasticMatrix:
    """Evaluate C or C^-1 of a material in Mandel components at points of cells.

    Construction is collective. The matrix knows the place by the parameters of the
    material only. So it is compiled as a function of their numbers, once for all data
    and meshes.

    Args:
        material: The material.
        parameters: Its parameters, scalar UFL.
        mesh: Where they live.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Attributes:
        size: Number s of Mandel components.
        plain: The matrix (s, s) where the material does not vary, else None.
        varies_in_cells: Whether it varies inside cells.
    """

    def __init__(
        self,
        material: Material,
        parameters: Mapping[str, Ufl],
        mesh: dmesh.Mesh,
        *,
        inverse: bool = False,
    ) -> None:
        d = mesh.geometry.dim
        self.size = d * (d + 1) // 2
        self.varies_in_cells = any(varies_in_cells(value) for value in parameters.values())
        self.plain: np.ndarray | None = None
        self._parameters = {name: Everywhere(value, mesh) for name, value in parameters.items()}
        constants = {}
        for name, parameter in self._parameters.items():
            if parameter.plain is not None:
                constants[name] = float(parameter.plain)
        # A material that does not vary needs no compiled code.
        if len(constants) == len(parameters):
            if type(material) is Elastic:
                self.plain = _constant(material.hypothesis, d, inverse, **constants)
            else:
                self.plain = constant_value(_matrix(material, d, inverse, parameters))
            return
        self._numbers = {name: stand_in((), i) for i, name in enumerate(parameters)}
        # numpy is four times as slow as compiled code in its hundreds of operations.
        matrix = _matrix(material, d, inverse, self._numbers)
        self._matrix = OfNumbers(matrix, lasting(mesh.comm), is_matrix=True)

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the matrix at points.

        Args:
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            Shape (n, q, s, s).
        """
        n, q, _ = x.shape
        shape = (n, q, self.size, self.size)
        if self.plain is not None:
            return np.broadcast_to(self.plain, shape)
        values = {}
        for name, parameter in self._parameters.items():
            values[self._numbers[name]] = parameter(x, cells).reshape(-1, 1)
        return self._matrix(values, n * q).reshape(shape)


def _matrix(material: Material, d: int, inverse: bool, parameters: Mapping[str, Ufl]) -> Ufl:
    """Return C or C^-1 of a material in Mandel components, UFL."""
    act = material.compliance if inverse else material.stress
    return mandel_matrix(act, d, **parameters)


@lru_cache(maxsize=64)
def _constant(hypothesis: str, d: int, inverse: bool, E: float, nu: float) -> np.ndarray:
    """Return the matrix of :class:`Elastic` where it does not vary."""
    material = Elastic(E, nu, hypothesis)
    matrix = constant_value(_matrix(material, d, inverse, {"E": E, "nu": nu}))
    # The array is shared by all callers.
    matrix.flags.writeable = False
    return matrix
