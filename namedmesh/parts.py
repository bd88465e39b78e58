"""Check and describe what a domain is made of: names, tags, sizes, shape."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.exceptions import InputError, raise_together
from namedmesh.base.names import known_names, listed


def check_names(names: Mapping[str, int], regions: Mapping[str, int]) -> None:
    """Check that names of boundary parts and of regions are mapped to tags.

    Raises:
        InputError: If they are not.
    """
    for argument, tags in (("names", names), ("regions", regions)):
        is_mapping = isinstance(tags, Mapping)
        if not is_mapping or not all(isinstance(tag, Integral) for tag in tags.values()):
            raise InputError(
                f"Domain: {argument} is {tags!r}; give a mapping from names to whole numbers, "
                "the tags."
            )
        for name in tags:
            if not isinstance(name, str) or not _is_unicode(name):
                raise InputError(
                    f"Domain: {argument} has the name {name!r}; give a text that can be written to "
                    "a file."
                )


def _is_unicode(name: str) -> bool:
    """Tell whether a text has no half characters, which no file can have."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def check_tags(
    mesh: dmesh.Mesh,
    facet_tags: dmesh.MeshTags | None,
    names: Mapping[str, int],
    cell_tags: dmesh.MeshTags | None,
    regions: Mapping[str, int],
) -> None:
    """Check that there are tags of facets and cells for the names; collective.

    Raises:
        InputError: If there are none, or they have the wrong dimension.
    """
    tdim = mesh.topology.dim
    error: Exception | None = None
    if facet_tags is None:
        error = InputError(
            f"The mesh has no tagged facet, but the names {listed(names)}; tag their facets."
        )
    elif facet_tags.dim != tdim - 1:
        error = InputError(
            f"The facet tags have dimension {facet_tags.dim}; facets have {tdim - 1}."
        )
    elif not names and len(facet_tags.values):
        error = InputError(
            "The mesh has tagged facets, but no named boundary part; give names of the tags, e.g. "
            "names={'bottom': 1}, or leave both out and name parts by rules: Domain(mesh)"
            ".named({'bottom': ec.where(y=0.0)})."
        )
    elif regions and (cell_tags is None or cell_tags.dim != tdim):
        error = InputError(f"The regions {listed(regions)} need cell tags of dimension {tdim}.")
    raise_together(lasting(mesh.comm), error)


def parts_inside(
    mesh: dmesh.Mesh, facet_tags: dmesh.MeshTags, names: Mapping[str, int]
) -> set[str]:
    """Return the names of the parts that have facets inside the body; collective.

    Raises:
        InputError: If a part has no facet.
    """
    # A ghost facet is counted by the rank that owns it.
    owned = mesh.topology.index_map(mesh.topology.dim - 1).size_local
    of_rank = facet_tags.indices < owned
    facets = facet_tags.indices[of_rank]
    at_boundary = np.isin(facets, dmesh.exterior_facet_indices(mesh.topology))
    tags = np.array(list(names.values()))
    known, place = np.unique(tags, return_inverse=True)
    row = np.searchsorted(known, facet_tags.values[of_rank])
    row[row == len(known)] = 0
    named = known[row] == facet_tags.values[of_rank]
    counts = [
        np.bincount(row[which], minlength=len(known)) for which in (named, named & at_boundary)
    ]
    totals = lasting(mesh.comm).allreduce(np.array(counts), MPI.SUM)[:, place]
    inside = set()
    for (name, tag), count, exterior_count in zip(names.items(), *totals, strict=True):
        if not count:
            raise InputError(
                f"Boundary part {name!r} (tag {tag}) has no facet; remove it or tag its facets."
            )
        if exterior_count < count:
            inside.add(name)
    return inside


def check_sides(
    sides: Any,
    on: Any,
    names: Mapping[str, int],
    taken: Mapping[str, int],
    regions: Mapping[str, int],
) -> None:
    """Check the arguments of :meth:`Domain.split`.

    Args:
        sides: Name of each new part -> region on its side.
        on: Name of a part, or None.
        names: The parts of the domain.
        taken: The parts of its glued mesh.
        regions: The regions of the domain.

    Raises:
        InputError: If two sides are not given, or they are not between regions of the
            domain, or a name is not new, or there is no part ``on``.
    """
    example = 'split({"punch": "upper", "block": "lower"})'
    if not regions:
        raise InputError(
            "split: the domain has no regions; name those on both sides, by physical groups of "
            "cells in gmsh or by cell_tags= and regions= of Domain."
        )
    pairs = list(sides.items()) if isinstance(sides, Mapping) else []
    if len(pairs) != 2 or not all(isinstance(name, str) and name for name, _ in pairs):
        raise InputError(
            f"split: the sides are {sides!r}; give two, each a new name of a boundary part and the "
            f"region on its side, e.g. {example}."
        )
    for name, region in pairs:
        if name in names or name in taken:
            raise InputError(
                f"split: the domain has a part {name!r} already; give the side another name."
            )
        if not isinstance(region, str) or region not in regions:
            raise InputError(
                f"split: no cell region is called {region!r}; this domain has "
                f"{known_names(region, regions)}"
            )
    if regions[pairs[0][1]] == regions[pairs[1][1]]:
        raise InputError(
            f"split: both sides are in the region {pairs[0][1]!r}; only the interface of two "
            "regions can be split."
        )
    if on is not None and (not isinstance(on, str) or on not in names):
        raise InputError(
            f"split: no part is called {on!r}; this domain has {known_names(on, names)}"
        )


def with_facets(
    mesh: dmesh.Mesh, facet_tags: dmesh.MeshTags, names: Mapping[str, int]
) -> dict[str, int]:
    """Return the names of the parts that have facets, with their tags; collective."""
    here = np.array([len(facet_tags.find(tag)) for tag in names.values()])
    counts = lasting(mesh.comm).allreduce(here, MPI.SUM)
    return {name: tag for (name, tag), count in zip(names.items(), counts, strict=True) if count}


def shape_in_words(geometry: object | None, dim: int, *, curved: bool) -> str:
    """Describe in words what is known of the true shape of a body.

    Args:
        geometry: The true shape, or None.
        dim: Dimension of space.
        curved: Whether the body has curved facets.
    """
    if geometry is None:
        return "the mesh, with flat facets"
    # Rectangles and boxes alone have two corners.
    low = getattr(geometry, "low", None)
    high = getattr(geometry, "high", None)
    if low is not None and high is not None:
        kind = "rectangle" if dim == 2 else "box"
        return f"{kind} from {low} to {high}"
    if curved:
        return "curved, its geometry is known"
    if getattr(geometry, "curved", False):
        return "curved bodies that were meshed apart, with flat facets"
    return "flat sides, its geometry is known"
