"""Find the shifts of preloads in the displacement of a file.

A result of a bolt that is drawn together by a force has some shift q at its cut, the
mean of the jump ``(u_1 - u_2) . d`` along the axis d out of the first side. With this
shift the cut is no unknown: the error is the error of the body with this bolt.
The force that q causes has an interval then, in which the given force may be or not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.base.exceptions import together
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload, Tied
from namedmesh import Domain
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import FieldOnMesh, FileField
from namedmesh.simplex import measures, of_facets, outward_normals


def with_shifts_of(scene: Scene, domain: Domain, file: FileField) -> Scene:
    """Return a scene whose preloads have the shifts of a file; collective.

    Preloads by a force have none, nor those that are locked.

    Args:
        scene: The scene.
        domain: The mesh, whose nodes are two at the cuts.
        file: The displacement of the file.

    Raises:
        InputError: If the mesh is outside of the bodies of the file.
    """
    unknown = [tie for tie in scene.ties if isinstance(tie, Preload) and tie.shortening is None]
    if not unknown:
        return scene
    geometry = domain.mesh.geometry
    nodes = cell_nodes(geometry)
    x = geometry.x[:, : domain.dim]
    field = FieldOnMesh(domain, file)
    u = together(domain.comm, field.at_nodes, nodes, x)
    shifts = {tie.facets: _shift(domain, tie, u) for tie in unknown}
    ties: list[Tied] = []
    for tie in scene.ties:
        if tie.facets in shifts:
            ties.append(Preload(tie.facets, tie.against, shortening=shifts[tie.facets]))
        else:
            ties.append(tie)
    return replace(scene, ties=tuple(ties))


def _shift(domain: Domain, tie: Preload, u: np.ndarray) -> float:
    """Return the mean jump of a displacement along the axis of a cut; collective.

    Args:
        domain: The mesh.
        tie: The preload at the cut.
        u: The displacement at the nodes of the mesh [length], shape (n, d).
    """
    nodes = cell_nodes(domain.mesh.geometry)
    x = domain.mesh.geometry.x[:, : domain.dim]
    here, there = domain.facing(tie.facets, tie.against)
    owned = here[:, 0] < domain.owned_cells
    corners = of_facets(nodes[here[:, 0]], here[:, 1])
    area = measures(x[corners]) * owned
    normal = area @ outward_normals(x[nodes[here[:, 0]]], here[:, 1])
    opposite = of_facets(nodes[there[:, 0]], there[:, 1])
    jump = area @ (u[corners].mean(axis=1) - u[opposite].mean(axis=1))
    normal, jump = domain.comm.allreduce(np.array([normal, jump]))
    whole = domain.comm.allreduce(float(area.sum()))
    return float(jump @ normal / np.linalg.norm(normal) / whole)
