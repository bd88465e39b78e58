"""Put tied joints on a mesh, and compute the nodal forces through them.

The nodes of a joint are one, so its force is no reaction of its own: it is what the
cells on one side leave of the equations at these nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import Trace
from erc_contact.model.space import Space
from erc_contact.scene.tied import Tied

Claim = tuple[np.ndarray, np.ndarray]
"""Cells and nodes (n,), (n, m) that a support or a contact acts on."""


def bind_tie(space: Space, tie: Tied, modulus: Ufl) -> ContactOnMesh:
    """Put a tied joint on a mesh, as a contact that cannot open; collective.

    It is none of the contacts of the model: it has a trace, a normal and names only.

    Args:
        space: The mesh, on which the joint is glued.
        tie: What the scene declares.
        modulus: The modulus of the material [force/area], UFL.
    """
    facets, facing = space.domain.facing(*tie.sides)
    direction = space.outward_normals(facets)
    here = space.side(facets, modulus)
    there = space.side(facing, modulus)
    return ContactOnMesh(
        name=tie.facets,
        against=tie.against,
        trace=Trace(here, there, direction),
        ds=space.ds,
        normal=space.n,
        bilateral=True,
    )


def tie_forces(
    space: Space, tie: ContactOnMesh, residual: Callable[[Ufl], np.ndarray], claims: Sequence[Claim]
) -> np.ndarray:
    """Compute the nodal forces on the first side of a joint [force]; collective.

    At a node that a support or a contact of one side shares, they are the forces of the
    other side with the opposite sign. If both sides have one there, they are the mean.

    Args:
        space: The mesh.
        tie: The joint.
        residual: Function that assembles the residual for a test function, UFL.
        claims: Where supports and contacts act.

    Returns:
        Shape (nodes, d). At ghost nodes they are not complete.
    """
    sides = []
    shared = []
    for indicator in space.sides_of_joint(tie.side_names):
        sides.append(residual(indicator * ufl.TestFunction(space.V)))
        with_others = np.zeros((space.node_count, 1), dtype=bool)
        for cells, nodes in claims:
            on_side = indicator.x.array[cells] > 0.5
            with_others[nodes[on_side]] = True
        shared.append(with_others)
    here, there = sides
    mean = 0.5 * (here - there)
    of_tie = np.where(shared[0], np.where(shared[1], mean, -there), here)
    result = np.zeros_like(here)
    nodes = np.unique(tie.trace.here.nodes)
    result[nodes] = of_tie[nodes]
    return result
