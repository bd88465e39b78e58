"""Compare the linearised gap of two bodies with the distance of the deformed bodies.

The law of a contact takes the gap g - w_n, in which each point keeps its partner and
its normal. Deformed bodies have a distance: the normal part of the vector from a point
to the nearest point of the other side. Both differ by terms of second order, slip
squared over radii and turns times distances.

Symbols: u^ admissible displacement, w its jump, n normal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.status import is_open
from erc_contact.model.data.quadrature import facet_pieces
from namedmesh.for_solvers import closest
from namedmesh.simplex import lagrange


def gap_deviation(result: Any, name: str) -> float:
    """Tell how far the linearised gap is from the true gap [length]; collective.

    It is the greatest difference of the gap of the law from the distance of the bodies
    deformed by u^, at the nodes of closed facets. A gap that the scene gives is left
    out of both.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of a contact between bodies.

    Raises:
        InputError: If it is no contact between bodies.
    """
    pair = pair_of(result)
    model = pair.model
    space = model.space
    contact = model.contact(name)
    trace = contact.trace
    if contact.against is None or contact in model.ties:
        raise InputError(f"gap_deviation: {name!r} is no contact between bodies; give one of them.")
    u = pair.displacement.x.array
    places = space.V.tabulate_dof_coordinates()[:, : space.d] + u.reshape(-1, space.d)
    owned = trace.here.owned

    # Facets of the deformed side are curved where u^ is, and are taken in pieces.
    pieces = facet_pieces(space.d - 1) if space.degree > 1 else np.eye(space.d)[None]
    shape = lagrange(space.d - 1, space.degree, pieces[..., 1:].reshape(-1, space.d - 1))
    of_pieces = np.matmul(shape, places[trace.there.nodes[owned]])
    of_ranks = space.comm.allgather(of_pieces.reshape(-1, space.d, space.d))
    corners = np.concatenate(of_ranks)

    pressure, _, _ = pair.tractions[model.contacts.index(contact)].in_law()
    is_closed = owned & ~is_open(space, contact, pressure)
    n = np.broadcast_to(trace.normals, (*trace.here.nodes.shape, space.d))[is_closed]
    left = ((contact.to_partners - trace.of(u))[is_closed] * n).sum(axis=-1)
    x = places[trace.here.nodes[is_closed]].reshape(-1, space.d)
    facet, local, _ = closest(x, corners)
    nearest = np.einsum("nv,nvi->ni", local, corners[facet])
    # Along the normal: a point that slid off the end of the other side has no distance.
    distance = ((nearest - x) * n.reshape(-1, space.d)).sum(axis=1)
    greatest = abs(distance - left.ravel()).max(initial=0.0)
    return float(space.comm.allreduce(float(greatest), MPI.MAX))
