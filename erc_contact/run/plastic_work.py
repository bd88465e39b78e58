"""Compute the elastic energy and the plastic work of a step of a history.

A linear elastic body with a plastic strain p stores ``int sigma : (eps - p)/2``, and a
plastic strain that grows takes

    int (sigma_n + sigma_(n-1))/2 : (p_n - p_(n-1))

from it, by the trapezoidal rule. Part of this is heat, and part is stored by hardening.
Stress and plastic strain are the fields of the solution, interpolated at the points
where the body remembers its state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.mesh.simplex import barycentric, rule
from erc_contact.model.law_entries import place_of
from erc_contact.model.law_state import ValuesAt
from erc_contact.model.model import Model
from erc_contact.model.potential import StrainOf
from erc_contact.model.space import circumferences
from erc_contact.newton.solution import Solution

PLASTIC_STRAIN = "plastic_strain"
"""Name of the entry of a state, a tensor, whose growth takes work."""


@dataclass(frozen=True)
class PlasticEnergies:
    """Hold the energies of a step [force length].

    Attributes:
        stored: Elastic energy at its end.
        work: Plastic work of the step.
    """

    stored: float
    work: float


def plastic_energies(solution: Solution, last: Solution | None) -> PlasticEnergies | None:
    """Compute the energies of a step; None without plastic strain; collective.

    Args:
        solution: The solution at its end.
        last: The solution at its begin; None from rest.
    """
    model = solution.model
    shapes = getattr(solution.scene.material, "state", {})
    if shapes.get(PLASTIC_STRAIN) != (3, 3) or model.linearised is None:
        return None
    before = model.linearised.law.state
    assert before is not None
    after = model.linearised.state_at_end(solution.u)
    assert after is not None
    stress = model.linearised.stress_at_end(solution.u)
    old_stress = None
    if last is not None and last.model.linearised is not None:
        old_stress = last.model.linearised.stress_at_end(last.u).on(model)
    strain_at = StrainOf(model, solution.u)
    in_space = model.linearised.law.in_space
    place = place_of(shapes, PLASTIC_STRAIN)

    def mean_stress(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        of_begin = 0.0 if old_stress is None else old_stress.at(x, cells)
        return 0.5 * (stress.at(x, cells) + of_begin)

    def elastic(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        return in_space(strain_at(x, cells)) - after.at(x, cells)[..., place]

    def growth(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        return (after.at(x, cells) - before.at(x, cells))[..., place]

    stored = 0.5 * _work(model, stress.at, elastic)
    return PlasticEnergies(stored, _work(model, mean_stress, growth))


def _work(model: Model, stress_at: ValuesAt, strain_at: ValuesAt) -> float:
    """Integrate the product of two fields over the bodies; collective."""
    points, weights = rule(model.d, 2 * model.degree - 1)
    cells = model.owned_cells
    corners = model.cell_corners()[cells]
    x = np.matmul(barycentric(points), corners)
    density = (stress_at(x, cells) * strain_at(x, cells)).sum(axis=-1)
    if model.axisymmetric:
        density = density * circumferences(x)
    # The weights of the rule have the sum 1.
    volume = abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (2, 6)[model.d - 2]
    local = float(volume @ (density @ weights))
    return float(model.comm.allreduce(local, MPI.SUM))
