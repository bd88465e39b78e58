"""Measure what is missing in the equilibrium of a stress in its cells.

See :mod:`erc_contact.admissible.imbalance`.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.reference import named_nodes
from namedmesh.simplex import local_facet_nodes, node_between


@cache
def _tables(d: int, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the nodes of a sub-simplex whose coefficients meet in a condition.

    Returns:
        The nodes whose coefficients make up coefficient c of the derivative by
        barycentric coordinate j, shape (N_(k-1), d+1); those on facet i, which
        sub-simplex i has in common with the cell, shape (d+1, m); nodes of sub-simplex
        i on its facet with sub-simplex j, in an order that both have, shape (d+1, d+1,
        m).
    """
    slopes = np.arange(d + 1)[None] if k == 1 else node_between(d, k)
    on_facet = local_facet_nodes(d, k)
    common = np.zeros((d + 1, d + 1, on_facet.shape[1]), dtype=np.int32)
    for i in range(d + 1):
        for j in range(d + 1):
            if i != j:
                named = named_nodes(d, k, i, j)
                common[i, j] = [named[name] for name in sorted(named, key=sorted)]
    return (
        np.ascontiguousarray(slopes, dtype=np.int32),
        np.ascontiguousarray(on_facet, dtype=np.int32),
        common,
    )


def unbalanced_cells(
    cells: CellGeometry, stress: np.ndarray, forces: np.ndarray, force: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the greatest missing force in each cell, and the greatest force [force].

    The missing forces are those in sub-simplices, between them, and on the facets of
    the cell.

    Args:
        cells: Geometry.
        stress: sigma^ of the owned cells [force/area], shape (owned, d+1, N_k, s).
        forces: ``|F| t`` on their facets [force], shape (owned, d+1, m, d).
        force: Body force times volume of each cell [force], or None.
    """
    d, k = cells.d, cells.degree
    slopes, on_facet, common = _tables(d, k)
    sizes = (stress.shape[2], on_facet.shape[1], len(slopes), len(stress))
    fields = (cells.area, np.ascontiguousarray(stress), np.ascontiguousarray(forces), force)
    missing, size = np.empty((2, len(stress)))
    kernels(d)("unbalanced_stresses", *sizes, *fields, slopes, on_facet, common, missing, size)
    return missing, size
