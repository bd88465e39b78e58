"""Compute the works of body forces and given strains in a step of a history.

Each product of a step is on the mesh of its displacement or stress: the scene of the
other end of the step is put on that mesh, too.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import given_strains
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.error.load_work import assemble_number
from erc_contact.model.model import Model


def work_in_body(pair: Admissible, before: Admissible | None) -> float:
    """Compute the work of the loads in the body [force length]; collective."""
    model = pair.model
    total = 0.5 * _work_of_body_force(model, model, pair)
    if before is not None:
        # (f + f_old)/2 . (u - u_old), each product on the mesh of its displacement
        old = before.model
        total -= 0.5 * _work_of_body_force(old, old, before)
        crossed = _work_of_body_force(old, model, pair) - _work_of_body_force(model, old, before)
        total += 0.5 * crossed
    return total


def work_of_strains(pair: Admissible, before: Admissible | None) -> float:
    """Compute what given strains take from the body [force length]; collective.

    Only ``eps - eps_0`` stores energy, so a given strain that grows under a stress
    takes its work: ``-int (sigma^ + sigma^_old)/2 : (eps_0 - eps_0old)``.
    """
    total = -0.5 * _stress_on_strains(pair.model, pair)
    if before is not None:
        # Each product is on the mesh of its stress, as for body forces.
        total -= 0.5 * _stress_on_strains(pair.model, before)
        total += 0.5 * _stress_on_strains(before.model, pair)
        total += 0.5 * _stress_on_strains(before.model, before)
    return total


def _stress_on_strains(given: Model, pair: Admissible) -> float:
    """Compute ``int sigma^ : eps_0`` on the mesh of sigma^ [force length]; collective.

    Args:
        given: Model of the scene that has eps_0.
        pair: The pair of sigma^.
    """
    model = pair.model
    if given.strains is None:
        return 0.0
    cells = pair.cell_geometry
    owned = model.domain.owned_cells
    there = given
    if given is not model:
        there = Model(given.scene, model.domain, model.degree)
    shape, points, weights = macro_points(model.d, model.degree)
    strain = given_strains(there, cells, points, owned)
    sigma = np.matmul(shape, pair.stress).reshape(owned, len(points), strain.shape[2])
    means = np.einsum("nqs,nqs,q->n", sigma, np.broadcast_to(strain, sigma.shape), weights)
    local = float(cells.volume[:owned] @ means)
    return float(model.comm.allreduce(local, MPI.SUM))


def _work_of_body_force(loads: Model, model: Model, pair: Admissible) -> float:
    """Compute the work of a body force on u^ of a pair [force length]; collective.

    Args:
        loads: Model of the scene that has the body force.
        model: Model of the pair, on whose mesh the work is.
        pair: The admissible pair.
    """
    if loads.body_force is None:
        return 0.0
    there = model if loads is model else Model(loads.scene, model.domain, model.degree)
    return assemble_number(there, there.loads(pair.displacement, on=[None]))
