"""The matrices of stress and compliance of a material, in Mandel components, at points."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.model.expressions import Everywhere, OfNumbers, stand_in
from erc_contact.model.symbolic import constant_value, varies_in_cells
from erc_contact.scene.material import Elastic, Material, mandel_matrix


class ElasticMatrix:
    """C or C^-1 of a material in Mandel components at points of cells; construction is collective.

    The matrix knows the place by the parameters of the material only. So it is compiled
    as a function of their numbers, once for all data and meshes.

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
        parameters: Mapping[str, Any],
        mesh: dmesh.Mesh,
        *,
        inverse: bool = False,
    ) -> None:
        d = mesh.geometry.dim
        self.size = d * (d + 1) // 2
        self.varies_in_cells = any(varies_in_cells(value) for value in parameters.values())
        self.plain: np.ndarray | None = None
        self._parameters = {name: Everywhere(value, mesh) for name, value in parameters.items()}
        plain = {
            name: float(value.plain)
            for name, value in self._parameters.items()
            if value.plain is not None
        }
        if len(plain) == len(parameters):
            if type(material) is Elastic:
                self.plain = _constant(material.hypothesis, d, inverse, **plain)
            else:
                self.plain = constant_value(_matrix(material, d, inverse, parameters))
            return
        self._numbers = {name: stand_in((), i) for i, name in enumerate(parameters)}
        self._matrix = OfNumbers(_matrix(material, d, inverse, self._numbers), mesh.comm)

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Matrices at points.

        Args:
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            Shape (n, q, s, s).
        """
        shape = *x.shape[:2], self.size, self.size
        if self.plain is not None:
            return np.broadcast_to(self.plain, shape)
        values = {
            self._numbers[name]: value(x, cells).reshape(-1, 1)
            for name, value in self._parameters.items()
        }
        return self._matrix(values, x.shape[0] * x.shape[1]).reshape(shape)


def _matrix(material: Material, d: int, inverse: bool, parameters: Mapping[str, Any]) -> Any:
    return mandel_matrix(material.compliance if inverse else material.stress, d, **parameters)


@lru_cache(maxsize=64)
def _constant(hypothesis: str, d: int, inverse: bool, E: float, nu: float) -> np.ndarray:
    """The matrix of :class:`Elastic` where it does not vary."""
    matrix = constant_value(_matrix(Elastic(E, nu, hypothesis), d, inverse, {"E": E, "nu": nu}))
    matrix.flags.writeable = False
    return matrix
