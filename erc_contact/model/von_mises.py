"""Compute von Mises stresses."""

from __future__ import annotations

import numpy as np


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Compute von Mises stresses ``sqrt(3/2) |dev sigma|`` [force/area], shape (n,).

    A stress out of plane that is not known (nan) counts as 0. The result is then the
    von Mises stress of the part in plane.

    Args:
        stress: Tensors [force/area], shape (n, 3, 3).
    """
    finite = np.nan_to_num(stress)
    trace = np.einsum("nii->n", finite)
    deviator = finite - trace[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
