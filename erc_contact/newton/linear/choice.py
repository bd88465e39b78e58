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
from petsc4py import PETSc

from erc_contact.model.data.over_ranks import marked_by_any
from erc_contact.model.model import Model
from erc_contact.newton.linear.mumps import operations

FACTOR = {2: (1.2e-5, 1.0), 3: (6.6e-6, 1.28)}
"""Seconds of the factor for one unknown, and the power of their number.

By dimension, on one core. Here and below only ratios matter.
"""
DENSE = (1.4e-7, 5e-11)
"""Seconds of the dense layer, for the square and the cube of its size."""
OPERATIONS = 8e9
"""Operations of a factor in a second, in 3D."""
MULTIGRID = {2: 4.3e-5, 3: 9e-5}
"""Seconds of multigrid for one unknown, by dimension."""
CYCLES = 6e-5
"""Seconds of the elastic solves of a pair for one unknown, by cycles of multigrid."""
OPERATIONS_BELOW = 100
"""Operations of a coarse factor for one entry of the fine matrix [-].

A cycle multiplies each entry about five times, and is bound by memory. A factor is not:
100 operations take the time of two cycles.
"""
MOST_FACTORISED = 2_000_000
"""Number of unknowns beyond which a factor takes too much memory."""


def factor_below(coarse: PETSc.Mat, fine: PETSc.Mat) -> bool:
    """Tell whether a factor takes the place of multigrid on a level; collective.

    It is made for each tangent. Cycles with it are fewer where bodies are many or thin:
    39 instead of 60 in an assembly of 18 solids, 10 instead of 10 in a cube.

    Args:
        coarse: The coarse matrix.
        fine: The matrix above it, with all its entries.
    """
    entries = fine.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return operations(coarse) < OPERATIONS_BELOW * entries


def multigrid_is_faster(model: Model) -> bool:
    """Tell whether multigrid is the faster solver for a model; collective.

    The answer does not depend on the number of ranks.
    """
    unknowns = _unknowns(model)
    of_square, of_cube = DENSE
    layer = layer_size(model)
    direct = _seconds_of_factor(model) + of_square * layer**2 + of_cube * layer**3
    return MULTIGRID[model.space.d] * unknowns < direct


def factor_is_cheaper(model: Model, stiffness: PETSc.Mat) -> bool:
    """Tell whether elastic solves without the contact are faster by a factor.

    Of all bodies with as many unknowns a compact one has the largest factor. Where its
    factor would be too slow, MUMPS' analysis tells how large this one is: that of an
    assembly of small solids has a seventh of the operations of a cube's. Collective.

    Args:
        model: The scene on a mesh.
        stiffness: K.
    """
    by_cycles = CYCLES * _unknowns(model)
    seconds = _seconds_of_factor(model)
    if by_cycles < seconds < np.inf:
        seconds = operations(stiffness) / OPERATIONS
    return seconds < by_cycles


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
