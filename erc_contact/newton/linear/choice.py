"""Choose the solver of a contact problem by what each of them will cost.

The direct solver factorises the body, makes its Schur complement on the layer of cells
at the contacts, and works with dense matrices of this layer. Multigrid costs so much
for each unknown, whatever the contact. So long contacts and sheets want multigrid, and
compact bodies in the plane the direct solver. With N unknowns, L of them in the layer,
and d dimensions,

    direct     a_d N^p_d + 1.4e-7 L^2 + 5e-11 L^3 [s],    multigrid     m_d N [s].

Where both cost about the same, either is good: of 55 bodies (layers, compact
bodies, sheets, bars, rings, two bodies along a whole side; both degrees; 500 to 260 000
unknowns) the choice takes at most 1.2 times as long as the better one, with the pair.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.model.data.over_ranks import marked_by_any
from erc_contact.model.model import Model
from erc_contact.newton.linear.factor_cost import MOST_FACTORISED

FACTOR = {2: (1.2e-5, 1.0), 3: (6.6e-6, 1.28)}
"""Seconds of the factor for one unknown, and the power of their number.

By dimension, on one core. Here and below only ratios matter.
"""
DENSE = (1.4e-7, 5e-11)
"""Seconds of the dense layer, for the square and the cube of its size."""
MULTIGRID = {2: 4.3e-5, 3: 9e-5}
"""Seconds of multigrid for one unknown, by dimension."""


STANDS_BY = 100.0
"""Time of the direct solver over the time of multigrid up to which it stands by [-]."""


def multigrid_is_faster(model: Model) -> bool:
    """Tell whether multigrid is the faster solver for a model; collective."""
    return direct_over_multigrid(model) > 1.0


def direct_over_multigrid(model: Model) -> float:
    """Predict the time of the direct solver over the time of multigrid [-]; collective.

    It does not depend on the number of ranks.
    """
    of_square, of_cube = DENSE
    layer = layer_size(model)
    direct = _seconds_of_factor(model) + of_square * layer**2 + of_cube * layer**3
    return direct / (MULTIGRID[model.space.d] * _unknowns(model))


def _seconds_of_factor(model: Model) -> float:
    """Predict the seconds of a factor, which are infinite where memory ends."""
    unknowns = _unknowns(model)
    for_one, power = FACTOR[model.space.d]
    return for_one * unknowns**power if unknowns <= MOST_FACTORISED else np.inf


def _unknowns(model: Model) -> int:
    """Return the number of components of displacement of all ranks."""
    return int(model.space.V.dofmap.index_map.size_global) * model.space.d


def layer_size(model: Model) -> int:
    """Count the components of displacement in the cells at the contacts; collective.

    Of two bodies they are in the cells of the side that a contact names first, and at
    the nodes of both sides. Components that supports fix are counted, too.
    """
    space = model.space
    in_layer = np.zeros(space.node_count, dtype=bool)
    for contact in model.contacts:
        in_layer[space.nodes[contact.facets[:, 0]]] = True
    if model.connections.any:
        in_layer |= model.connections.is_paired
    (of_any_rank,) = marked_by_any(space, in_layer)
    owned = space.V.dofmap.index_map.size_local
    count = int(np.count_nonzero(of_any_rank[:owned]))
    return int(space.comm.allreduce(count, MPI.SUM)) * space.d
