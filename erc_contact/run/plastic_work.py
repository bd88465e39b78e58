"""Compute the elastic energy and the plastic work of a step of a history.

A body with a plastic strain p stores ``int sigma : (eps - p)/2``, and a plastic strain
that grows takes

    int (sigma_n + sigma_(n-1))/2 : (p_n - p_(n-1))

from it, of second order in the length of the step. Part of this is heat, and part is
stored by hardening. Stress and plastic strain are the fields of the solution, at the
points where the body remembers its state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.mesh.simplex import barycentric, rule
from erc_contact.model.law_state import LawState
from erc_contact.model.model import Model
from erc_contact.model.space import circumferences
from erc_contact.newton.solution import Solution

PLASTIC_STRAIN = "plastic_strain"
"""Name of the entry of a state whose growth takes work."""


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
    if PLASTIC_STRAIN not in getattr(solution.scene.material, "state", {}):
        return None
    stress, elastic, plastic = _fields(solution)
    stored = 0.5 * _product(model, stress, elastic)
    work = 0.5 * _product(model, stress, plastic)
    if last is not None:
        old_stress, _, old_plastic = (field.on(model) for field in _fields(last))
        work -= 0.5 * _product(model, stress, old_plastic)
        work += 0.5 * _product(model, old_stress, plastic)
        work -= 0.5 * _product(model, old_stress, old_plastic)
    return PlasticEnergies(stored, work)


def _fields(solution: Solution) -> tuple[LawState, LawState, LawState]:
    """Return stress, elastic and plastic strain in Mandel components of space."""
    model = solution.model
    assert model.linearised is not None
    return model.linearised.stress_and_strains(solution.u, PLASTIC_STRAIN)


def _product(model: Model, first: LawState, second: LawState) -> float:
    """Integrate the product of two fields over the bodies; collective."""
    points, weights = rule(model.d, 2 * model.degree - 1)
    cells = model.owned_cells
    corners = model.cell_corners()[cells]
    x = np.matmul(barycentric(points), corners)
    density = (first.at(x, cells) * second.at(x, cells)).sum(axis=-1)
    if model.axisymmetric:
        density = density * circumferences(x)
    volume = abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    # The weights sum up to the volume of the reference cell, or to one.
    volume = volume / (2, 6)[model.d - 2]
    local = float(volume @ (density @ weights)) / weights.sum()
    return float(model.comm.allreduce(local, MPI.SUM))
