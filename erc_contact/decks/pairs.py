"""Find which faces of two surfaces face each other, and how far they are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.decks.reading import DeckReading, Facing
from namedmesh.for_solvers import DeckMesh, closest

OPPOSITE = 0.3
"""Cosine between the normals of faces that face each other, at least [-]."""
ONE_PLACE = 1e-7
"""Distance of surfaces that is none, as a share of the extent of the mesh [-]."""
BEYOND = 1.01
"""Factor on the greatest distance of a pair, so that round-off leaves no face out."""


@dataclass(frozen=True)
class Distance:
    """Hold how far faces are from other faces.

    Attributes:
        faces: The faces that face them.
        greatest: Greatest distance of these [length].
    """

    faces: np.ndarray
    greatest: float


def surfaces_of(reading: DeckReading, facing: Facing) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the faces of both surfaces of a pair; None if one is refused."""
    found = []
    for name in (facing.slave, facing.master):
        faces = reading.mesh.surface(name)
        if faces is None:
            reading.told.refuse(facing.card, f"no surface is called {name!r}; mend the name.")
            return None
        faces = faces[reading.mesh.outer[faces]]
        if not len(faces):
            reading.told.refuse(
                facing.card, f"the surface {name!r} has no face of a solid; give it faces."
            )
            return None
        found.append(faces)
    return found[0], found[1]


def distance_between(mesh: DeckMesh, here: np.ndarray, there: np.ndarray) -> Distance:
    """Find the faces that face other faces, and the greatest distance there.

    Args:
        mesh: The mesh.
        here: Faces of the first surface.
        there: Faces of the second surface.
    """
    corners = mesh.x[mesh.simplices(there)]
    to = corners - corners[:, :1]
    if mesh.d == 2:
        normals = np.column_stack([to[:, 1, 1], -to[:, 1, 0]])
    else:
        normals = np.cross(to[:, 1], to[:, 2])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals_here = mesh.normals(here)
    points = mesh.x[mesh.corners(here)]
    tested = np.concatenate([points, mesh.centres(here)[:, None]], axis=1)
    count = tested.shape[1]
    found = closest(tested.reshape(-1, mesh.d), corners)
    near = np.einsum("nk,nki->ni", found.local, corners[found.facet])
    step = (near - tested.reshape(-1, mesh.d)).reshape(len(here), count, mesh.d)
    distance = found.distance.reshape(len(here), count)
    # The closest point lies along the normal, unless it is on a rim.
    along = abs(np.einsum("nki,ni->nk", step, normals_here))
    extent = np.ptp(mesh.x, axis=0).max()
    straight = along >= 0.7 * distance - ONE_PLACE * extent
    opposite = abs(
        np.einsum("ni,ni->n", normals[found.facet.reshape(-1, count)[:, -1]], normals_here)
    )
    faces = straight[:, -1] & (opposite > OPPOSITE)
    if not faces.any():
        return Distance(here[:0], np.inf)
    greatest = float(distance[faces][straight[faces]].max())
    return Distance(here[faces], 0.0 if greatest <= ONE_PLACE * extent else BEYOND * greatest)


def adjusted(reading: DeckReading) -> DeckMesh:
    """Return the mesh with slave nodes on their master surfaces, where ADJUST says so.

    Nodes of ties are moved there always.
    """
    mesh = reading.mesh
    for facing in reading.facings:
        found = surfaces_of(reading, facing)
        if found is None or facing.adjust is None:
            continue
        slave, master = found
        here = distance_between(mesh, slave, master)
        nodes = np.unique(mesh.corners(here.faces))
        if facing.moved is not None:
            nodes = np.intersect1d(nodes, facing.moved)
        if not here.greatest or not len(nodes):
            continue
        corners = mesh.x[mesh.simplices(master)]
        near = closest(mesh.x[nodes], corners)
        moves = near.distance <= facing.adjust
        places = np.einsum("nk,nki->ni", near.local, corners[near.facet])
        if moves.any():
            mesh = mesh.moved(nodes[moves], places[moves])
            reading.told.assume(
                facing.card,
                f"{int(moves.sum())} nodes of {facing.slave!r} are moved onto {facing.master!r}, "
                f"by {near.distance[moves].max():.3g} at most",
            )
    return mesh
