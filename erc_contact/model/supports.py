"""Put the supports of a scene on a mesh: prescribed values at the nodes.

Supports and contacts may have nodes in common with a loose rigid face where no free
motion of it moves what they hold. So no force that they exchange at a node changes a
resultant of the face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.data.over_ranks import marks_of_owners
from erc_contact.model.data.values import number
from erc_contact.model.motions.rigid_faces import RigidFace, bind_rigid
from erc_contact.model.space import Space
from erc_contact.scene.support import Displacement, Rigid
from namedmesh.base.ranks import greatest

EQUAL_VALUES = 1e-9
"""Relative difference of two supports at a common node that counts as none [-]."""
UNMOVED = 1e-9
"""Motion over the motion of the face that counts as none [-]."""


@dataclass(frozen=True, eq=False)
class Supports:
    """Hold the prescribed components of the displacement.

    Attributes:
        fixed: Which components are prescribed at each node, shape (nodes, d); on a
            loose rigid face, up to its motion.
        held: Which of them have a value that is given, shape (nodes, d).
        prescribed: Prescribed displacement, a Function of V, zero elsewhere [length].
        facets: Facets (cell, local facet) and prescribed components of each support.
        loose_faces: The rigid faces whose motions are not all given.
    """

    fixed: np.ndarray
    held: np.ndarray
    prescribed: fem.Function
    facets: list[tuple[np.ndarray, np.ndarray]]
    loose_faces: list[RigidFace]


def bind_supports(space: Space, supports: Sequence[Displacement | Rigid]) -> Supports:
    """Compute the nodal values of supports; collective.

    Raises:
        InputError: If two supports contradict each other at a node, or a value is not
            finite.
    """
    prescribed = space.function()
    values = prescribed.x.array.reshape(-1, space.d)
    fixed = np.zeros(values.shape, dtype=bool)
    # An axisymmetric body stays on its axis.
    fixed[:, 0] = space.section.on_axis(space.V.tabulate_dof_coordinates())
    held = fixed.copy()
    error = None
    on_facets = []
    loose_faces = []
    for support in supports:
        facets = space.domain.facets(support.facets)
        what = f"{type(support).__name__}({support.facets!r})"
        nodes = space.facet_nodes(facets)
        is_prescribed = np.array([value is not None for value in support.value])
        on_facets.append((facets, is_prescribed))
        face = bind_rigid(space, support) if isinstance(support, Rigid) else None
        is_loose = face is not None and bool(face.free.any())
        if face is not None and is_loose:
            loose_faces.append(face)
        for i, value in enumerate(support.value):
            if value is None:
                continue
            if face is not None:
                at_nodes = _rigid_values(space, support, face, nodes)[..., i]
            elif callable(value):
                expression = number(space, value, what)
                at_nodes = space.evaluate(expression, space.facet_points, facets)
                if _jumps(space, nodes, at_nodes):
                    error = InputError(
                        f"{what} jumps between facets in component {i}, which no displacement of"
                        " a body does; give one that is continuous, e.g. a Lagrange Function."
                    )
            else:
                at_nodes = np.full(nodes.shape, float(value))
            tolerance = EQUAL_VALUES * float(abs(at_nodes).max(initial=1e-300))
            differs = abs(values[nodes, i] - at_nodes) > tolerance
            if (fixed[nodes, i] & differs).any():
                error = InputError(
                    f"{what} contradicts another support{space.section.holds} at a common node in"
                    f" component {i}; make the values agree there, or free a component (None)."
                )
            values[nodes, i] = at_nodes
            fixed[nodes, i] = True
            held[nodes, i] |= not is_loose
    raise_together(space.comm, error)
    if not np.isfinite(values).all():
        error = InputError(
            "A prescribed displacement is not finite; look at the callables of the supports."
        )
    raise_together(space.comm, error)
    # A rank may see a node without the facet that fixes it: its owner sees all.
    prescribed.x.scatter_forward()
    fixed = marks_of_owners(space, fixed)
    held = marks_of_owners(space, held)
    return Supports(fixed, held, prescribed, on_facets, loose_faces)


def dirichlet_conditions(space: Space, prescribed: fem.Function, fixed: np.ndarray) -> list[Any]:
    """Return prescribed displacements of fixed components as conditions of DOLFINx.

    Args:
        space: The mesh.
        prescribed: The displacement, a Function of V [length].
        fixed: Which components are prescribed at each node, shape (nodes, d).
    """
    dofs = np.flatnonzero(fixed).astype(np.int32)
    return [fem.dirichletbc(prescribed, [dofs, dofs], space.V)]


def _rigid_values(space: Space, rigid: Any, face: RigidFace, nodes: np.ndarray) -> np.ndarray:
    """Return the given part of the motion of a rigid face at nodes, (*nodes, d)."""
    given = np.array([motion or 0.0 for motion in rigid.motions])
    at_nodes = np.zeros((space.node_count, space.d))
    at_nodes[face.nodes] = face.shapes @ given
    return at_nodes[nodes]


def _jumps(space: Space, nodes: np.ndarray, at_nodes: np.ndarray) -> bool:
    """Tell whether facets of this rank have other values at a common node; collective.

    Args:
        space: The mesh.
        nodes: Nodes of the facets, shape (f, m).
        at_nodes: The values of each facet there, shape (f, m).
    """
    largest = greatest(space.comm, at_nodes)
    if not np.isfinite(at_nodes).all():
        return False  # refused for that
    of_node = np.zeros(space.node_count)
    of_node[nodes] = at_nodes
    return bool((abs(of_node[nodes] - at_nodes) > EQUAL_VALUES * largest).any())


def check_neighbours(
    space: Space, faces: Sequence[RigidFace], held: np.ndarray, contacts: Sequence[ContactOnMesh]
) -> None:
    """Check that what is beside loose faces holds no motion of the faces; collective.

    Args:
        space: The mesh.
        faces: The loose faces.
        held: Which components supports prescribe at each node, shape (nodes, d).
        contacts: The contacts.

    Raises:
        InputError: If a support, a contact or another face holds a free motion.
    """
    for face in faces:
        _check_beside(space, face, held, f"{face.what} and a support")
        for second in faces:
            if second is not face:
                moved = np.zeros(held.shape, dtype=bool)
                moved[second.nodes] = (second.reach > UNMOVED).any(axis=2)
                moved = marks_of_owners(space, moved)
                _check_beside(space, face, moved, f"{face.what} and {second.what}")
        for contact in contacts:
            _check_contact(space, face, contact, f"{face.what} and Contact({contact.name!r})")


def _check_contact(space: Space, face: RigidFace, contact: ContactOnMesh, words: str) -> None:
    """Check a contact beside a loose face; collective."""
    common = np.isin(contact.trace.here.nodes, face.nodes)
    facing = np.isin(contact.trace.partners, face.nodes)
    error = None
    if common[contact.trace.facing].any() or facing.any():
        error = InputError(
            f"{words} have nodes in common: beside a contact between bodies all motions of the"
            " face must be given, or leave a facet between them."
        )
    elif common.any() and contact.friction is not None:
        error = InputError(
            f"{words} have nodes in common: beside a contact with friction all motions of the"
            " face must be given, or leave a facet between them, free or without friction."
        )
    raise_together(space.comm, error)
    # Without friction only the normal component is held.
    along = np.zeros((space.node_count, space.d))
    held = np.zeros((space.node_count, space.d), dtype=bool)
    normals = np.broadcast_to(contact.trace.normals, (*common.shape, space.d))
    np.maximum.at(along, contact.trace.here.nodes[common], abs(normals[common]))
    held[:] = along > UNMOVED
    _check_beside(space, face, held, words)


def _check_beside(space: Space, face: RigidFace, held: np.ndarray, words: str) -> None:
    """Check that a loose face does not move components that are held; collective.

    All nodes of its facets at a common node count: their tractions are exchanged.
    """
    of_facets = space.facet_nodes(face.facets)
    moved = np.zeros((space.node_count, space.d))
    moved[face.nodes] = face.reach[:, :, face.free].max(axis=2, initial=0.0)
    beside = held[of_facets].any(axis=1)
    most = moved[of_facets].max(axis=1, initial=0.0)
    error = None
    if (beside & (most > UNMOVED)).any():
        error = InputError(
            f"{words} have nodes in common, and hold a component there in which the face moves:"
            " give this motion of the face, or leave a facet between them."
        )
    raise_together(space.comm, error)
