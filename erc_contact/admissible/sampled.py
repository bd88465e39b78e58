"""The friction bound between the nodes of a facet, where it varies or is nonlinear in the pressure.

A traction that is allowed at the nodes may then exceed the bound between them. The
bound is sampled on each facet, and where a traction exceeds it, the friction of the
facet is lowered.

Symbols: r^ contact traction on the body, f facets, m number of coefficients of a facet,
q samples of a facet, d dimension.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.traction import ContactTraction
from erc_contact.mesh.simplex import bernstein
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model

MARGIN = 0.2
"""Share of the sampled deviation that is added for deviations between two samples [-]."""


def friction_at_samples(model: Model, traction: ContactTraction) -> tuple[np.ndarray, np.ndarray]:
    """The friction bound and the length of r^_t at samples of facets [force/area], shape (f, q) each; collective."""
    at = model.facet_samples
    shape = bernstein(model.d - 1, model.degree, at)
    parameters = model.friction_parameters(traction.contact, at)
    most = traction.contact.friction_bound(
        np.maximum(-traction.normal_component @ shape.T, 0.0), parameters
    )
    return most, np.linalg.norm(np.einsum("qm,fmi->fqi", shape, traction.tangential_part), axis=-1)


def lowering(model: Model, traction: ContactTraction) -> np.ndarray:
    """The factor of the friction of each facet that makes r^ allowed between the nodes [-], shape (f,); collective.

    It is 1 where r^ is allowed at all samples.
    """
    if not traction.contact.sampled:
        return np.ones(len(traction.nodes))
    most, used = friction_at_samples(model, traction)
    peak = model.comm.allreduce(float(used.max(initial=0.0)), MPI.MAX)
    excess = used > most + 1e-14 * peak  # the ratio of two numbers that are round-off means nothing
    ratio = np.divide(most, used, out=np.ones_like(used), where=excess).min(axis=1)
    return np.where(ratio < 1.0, np.maximum(ratio - MARGIN * (1 - ratio), 0.0), 1.0)


def with_friction(contact: BoundContact, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Tractions (f, m, d) with their tangential part times a factor of each facet."""
    n = contact.direction[:, None, :]
    normal = (values * n).sum(axis=-1, keepdims=True) * n
    return normal + factor[:, None, None] * (values - normal)
