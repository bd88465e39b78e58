"""Compute the resultants of loads on bodies, and the reactions of points to them."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.decks.affine import Affine
from erc_contact.decks.histories import Entry
from erc_contact.decks.loads import LoadedFaces
from erc_contact.decks.reading import DeckReading
from erc_contact.scene.remote import moments_of
from namedmesh.simplex import measures, rule

DEGREE = 3
"""Degree of the products of linear loads and arms, and the circumference."""
UNBALANCED = 1e-6
"""Resultant over the sum of all forces and moments that is not zero [-]."""


def works_of(
    reading: DeckReading,
    loads: list[LoadedFaces],
    volumes: list[tuple[Entry, np.ndarray, tuple[Affine, ...]]],
    inside: list[Entry],
    body: int,
    *,
    ring: bool,
) -> list[tuple[Entry, np.ndarray]]:
    """Compute the work of each load on the rigid motions of a body.

    Args:
        reading: The deck.
        loads: Loads on faces.
        volumes: Forces per volume: entry, cells and values.
        inside: Forces on nodes inside bodies.
        body: Number of the body.
        ring: Whether the body is axisymmetric.

    Returns:
        An entry of each load, with its work and what it may be, as of :func:`_work`.
    """
    mesh = reading.mesh
    works = []
    for load in loads:
        faces = load.faces[mesh.bodies[mesh.cell_of_face[load.faces]] == body]
        works.append((load.entry, work_on_faces(reading, load, faces, ring=ring)))
    for entry, cells, value in volumes:
        corners = mesh.corners_of_cells(cells[mesh.bodies[cells] == body])
        works.append((entry, _work(corners, value, ring=ring)))
    for entry in inside:
        here = mesh.body_of_node[entry.what.nodes] == body
        terms = on_motions(mesh.x[entry.what.nodes[here]], entry.what.forces[here])
        works.append((entry, np.stack([terms.sum(axis=0), abs(terms).sum(axis=0)])))
    return works


def reactions_of(
    works: list[tuple[Entry, np.ndarray]], free: np.ndarray, acting: np.ndarray
) -> list[tuple[Entry, np.ndarray]] | None:
    """Return the reactions of points that are in balance with loads.

    A load does the work w on the rigid motions of a body that its faces leave free.
    Where R are the displacements of the held points along their components in these
    motions, the reactions r have ``R^T r = -w``; of several the least are taken.

    Args:
        works: The works of loads on all rigid motions, see :func:`works_of`.
        free: The motions of the body that faces leave free, as columns, shape (3 or 6,
            k).
        acting: R, shape (n, k).

    Returns:
        An entry of loads that act together, and the reactions to them [force], shape
        (n,), of each history; None if no reactions are in balance with them.
    """
    # Loads that act together may be in balance with each other.
    together: dict[Any, tuple[Entry, np.ndarray]] = {}
    for entry, work in works:
        history = (tuple(entry.times), tuple(entry.factors), entry.begin, entry.end)
        first, before = together.get(history, (entry, 0.0))
        together[history] = (first, before + work)
    result = []
    for entry, (work, size) in together.values():
        along = free.T @ work
        least = UNBALANCED * size.max()
        if (abs(along) <= least).all():
            continue
        found = np.linalg.lstsq(acting.T, -along, rcond=UNBALANCED)[0]
        if (abs(acting.T @ found + along) > least).any():
            return None
        result.append((entry, found))
    return result


def work_on_faces(
    reading: DeckReading, load: LoadedFaces, faces: np.ndarray, *, ring: bool
) -> np.ndarray:
    """Compute the work of a load on faces, as :func:`_work` returns it."""
    mesh = reading.mesh
    points = mesh.x[mesh.simplices(faces)]
    if load.pressure is None:
        return _work(points, load.traction, ring=ring)
    inward = -mesh.normals(faces)[mesh.owners_of_simplices(faces)]
    pressure = load.pressure
    return _work(points, (pressure,) * mesh.d, directions=inward, ring=ring)


def _work(
    points: np.ndarray,
    value: tuple[Affine, ...],
    *,
    directions: np.ndarray | None = None,
    ring: bool,
) -> np.ndarray:
    """Compute the work of a linear load on unit rigid motions, and what it may be.

    Args:
        points: Corners of simplices [length], shape (m, k, d).
        value: The load, d components.
        directions: Factors of the components on each simplex, shape (m, d).
        ring: Whether the body is axisymmetric.

    Returns:
        The work, and the integral of the absolute values, shape (2, 3 or 6).
    """
    places, weights = rule(points.shape[1] - 1, DEGREE)
    local = np.column_stack([1.0 - places.sum(axis=1), places])
    x = np.einsum("qk,mki->mqi", local, points)
    scale = weights / weights.sum() * measures(points)[:, None]
    if ring:
        scale = scale * 2 * np.pi * x[:, :, 0]
    at = np.moveaxis(x, 2, 0)
    components = [np.broadcast_to(component(at), at.shape[1:]) for component in value]
    force = np.stack(components, axis=2)
    if directions is not None:
        force = force * directions[:, None]
    density = on_motions(x, force)
    work = np.einsum("mq,mqi->i", scale, density)
    return np.stack([work, np.einsum("mq,mqi->i", scale, abs(density))])


def on_motions(x: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the work of forces on unit rigid motions, shape (..., 3 or 6)."""
    return np.concatenate([force, moments_of(x, force)], axis=-1)
