"""Spread forces on nodes inside a body over the cells around them.

A force at a point has no finite energy in a continuum. The force F at the node j
becomes the force per volume

    f = phi_j (F/m + w x (x - c)),

with the hat phi_j that is 1 at the node and 0 at all others, its integral m and its
centre c, and such w that the moment is F's. Forces on a middle of an edge act in halves
on its ends.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from erc_contact.decks.conditions import NodalForces
from erc_contact.decks.histories import Entry
from erc_contact.decks.loads import in_coordinates
from erc_contact.decks.nodal import NodalTable
from erc_contact.decks.plan import Inside
from erc_contact.decks.reading import DeckReading
from erc_contact.scene.remote import moments_of, slopes_of
from namedmesh.for_solvers import DeckMesh
from namedmesh.simplex import measures, rule

DEGREE = 3
"""Degree of a hat times the products of two arms."""


def forces_inside(reading: DeckReading) -> list[Entry]:
    """Take forces on nodes inside the bodies from the loads, as forces on corners."""
    mesh = reading.mesh
    if reading.is_ring:
        return []
    on_surface = mesh.nodes_of_faces(np.flatnonzero(mesh.outer))
    result = []
    for entry in reading.steps.entries.get("forces", []):
        load: NodalForces = entry.what
        is_inside = mesh.node_is_used[load.nodes] & ~np.isin(load.nodes, on_surface)
        is_inside &= (mesh.ends[load.nodes] >= 0).all(axis=1)
        if not is_inside.any():
            continue
        nodes = load.nodes[is_inside]
        x = mesh.mesh.points[nodes, : mesh.d]
        forces = in_coordinates(reading.transforms, nodes, x, load.forces[is_inside])
        corners, row = np.unique(mesh.ends[nodes], return_inverse=True)
        halves = np.zeros((len(corners), mesh.d))
        np.add.at(halves, row.reshape(-1, 2), 0.5 * forces[:, None])
        result.append(replace(entry, what=replace(load, nodes=corners, forces=halves)))
        stays = {"nodes": load.nodes[~is_inside], "forces": load.forces[~is_inside]}
        entry.what = replace(load, **stays)
    return result


def spread(reading: DeckReading, entry: Entry, thickness: float) -> Entry:
    """Return forces on corners as a force per volume.

    Args:
        reading: The deck.
        entry: The forces [force], d components.
        thickness: Thickness of a plane body [length].
    """
    mesh = reading.mesh
    load: NodalForces = entry.what
    forces = load.forces / thickness
    simplices = mesh.simplicial
    number = np.full(len(simplices.x), -1)
    number[load.nodes] = np.arange(len(load.nodes))
    # The simplices at each of the corners, and the corner among their own.
    cells, corner = np.nonzero(number[simplices.cells] >= 0)
    of_corner = number[simplices.cells[cells, corner]]
    points, weights = rule(mesh.d, DEGREE)
    hats = np.column_stack([1.0 - points.sum(axis=1), points])
    x = np.einsum("qk,mki->mqi", hats, simplices.x[simplices.cells[cells]])
    volumes = measures(simplices.x[simplices.cells[cells]])
    scale = volumes[:, None] * weights * hats[:, corner].T

    def sums(values: np.ndarray) -> np.ndarray:
        result = np.zeros((len(load.nodes), *values.shape[1:]))
        np.add.at(result, of_corner, values)
        return result

    mass = sums(scale.sum(axis=1))
    centre = sums(np.einsum("mq,mqi->mi", scale, x)) / mass[:, None]
    arms = x - centre[of_corner][:, None]
    second = sums(np.einsum("mq,mqi,mqj->mij", scale, arms, arms))
    mean = forces / mass[:, None]
    slopes = slopes_of(second, moments_of(simplices.x[load.nodes] - centre, forces))

    def density_at(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the hats' factors at places, zero of corners without a force."""
        which = number[corners]
        arm = places - centre[which]
        values = mean[which] + np.einsum("...ij,...j->...i", slopes[which], arm)
        return np.asarray(np.where((which >= 0)[..., None], values, 0.0))

    every = np.arange(len(simplices.x))
    at_nodes = density_at(every, simplices.x)
    ends = simplices.cells[:, list(combinations(range(mesh.d + 1), 2))]
    middles = simplices.x[ends].mean(axis=2)
    between = 0.5 * (density_at(ends[..., 0], middles) + density_at(ends[..., 1], middles))
    tables = []
    for i in range(mesh.d):
        tables.append(NodalTable(simplices.x, simplices.cells, at_nodes[:, i], between[..., i]))
    reading.told.assume(
        load.card,
        f"{_words(mesh, load.nodes)} inside the body: their forces act on the cells around them, "
        f"of volume {volumes[_firsts(cells)].sum():.4g}",
    )
    return replace(entry, what=Inside(tuple(tables)))


def _firsts(cells: np.ndarray) -> np.ndarray:
    """Return the places at which each cell is first in a list."""
    return np.asarray(np.unique(cells, return_index=True)[1])


def _words(mesh: DeckMesh, nodes: np.ndarray) -> str:
    """Return the numbers of the first nodes, in words."""
    numbers = ", ".join(map(str, mesh.numbers[nodes][:8]))
    return f"nodes {numbers}{', ...' if len(nodes) > 8 else ''}"
