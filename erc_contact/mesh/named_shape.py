"""Keep the true shape of a body whose parts are named by rules, to mesh it again.

The shape itself does not know the names. Each mesh of it gets them from the rules. A
part is the same part of the surface only if the shape has an edge where it ends: so its
area is compared, and the volume of a region.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.naming import Rules
from erc_contact.mesh.simplex import measures
from erc_contact.mesh.size_field import Labels, SizeField, size_field

SAME = 1e-6
"""Relative difference of areas or volumes on two meshes that is round-off [-]."""
SAME_CURVED = 0.1
"""The same on curved bodies, where other chords have other lengths [-]."""


@dataclass(frozen=True)
class NamedShape:
    """Represent a true shape, and the rules that name parts of each of its meshes.

    Args:
        shape: The shape.
        labels: The names that its meshes have without the rules.
        rules: The rules.
        last_tag: The tag above which the parts have theirs, on all meshes.
        measures: Area of each part that has a rule [length^(d-1)], and volume of each
            such region [length^d], by "part" or "region" and its name.
    """

    shape: Any
    labels: Labels = field(repr=False)
    rules: Rules
    last_tag: int
    measures: Mapping[tuple[str, str], float] = field(repr=False)

    @property
    def curved(self) -> Any:
        """Tell whether the shape is curved, as it does itself."""
        return getattr(self.shape, "curved", False)

    @property
    def low(self) -> Any:
        """Return the corner of least coordinates of a rectangle or box, else None."""
        return getattr(self.shape, "low", None)

    @property
    def high(self) -> Any:
        """Return the opposite corner, or None."""
        return getattr(self.shape, "high", None)

    def meshed(self, domain: Any, sizes: np.ndarray) -> Any:
        """Mesh the shape with other sizes, see :meth:`Domain.remeshed`; collective."""
        return self.meshed_by(domain, size_field(domain, sizes), self.labels)

    def meshed_by(self, like: Any, sizes: SizeField, labels: Labels) -> Any:
        """Mesh the shape with sizes in the cells of a mesh, and name it; collective.

        Args:
            like: A domain on the same communicator.
            sizes: The sizes.
            labels: Not used: the shape has its own names, and the rules give others.

        Raises:
            InputError: If a part or a region has another size now.
        """
        plain = self.shape.meshed_by(like, sizes, self.labels)
        result = plain.renamed(self.rules, self.last_tag)
        allowed = SAME_CURVED if self.curved else SAME
        for (kind, name), value in measured(result, self.rules).items():
            before = self.measures[kind, name]
            if abs(value - before) > allowed * before:
                raise InputError(
                    f"remeshed: the {kind} {name!r}, which is named by a rule, had the size "
                    f"{before:.6g} and has {value:.6g} on the new mesh, as the shape has no edge "
                    "where it ends. Refine by marking (strategy=ec.Mark()), which keeps it, or "
                    "draw this edge in gmsh (occ.fragment)."
                )
        return result

    def with_joint(self, glued: Any, joint: tuple[str, str, int, bool, float]) -> Any:
        """Return the shape of its bodies with a joint between two of them."""
        return self.shape.with_joint(glued, joint)

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective."""
        nearest: np.ndarray = self.shape.nearest(comm, points, marks)
        return nearest

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return unit normals of the true surface, nan where not known; collective."""
        normals: np.ndarray = self.shape.normals(comm, points, marks)
        return normals


def measured(domain: Any, rules: Rules) -> dict[tuple[str, str], float]:
    """Return areas of parts and volumes of regions of a domain; collective.

    See :class:`NamedShape`. The facets against which another region lies may reach
    beyond it, so their area depends on the mesh, and is left out.
    """
    result = {}
    table = domain.parts()
    for name, entries in rules.parts.items():
        if all(entry.against is None for entry in entries):
            result["part", name] = float(table["area"][table["name"].index(name)])
    for name in rules.regions:
        cells = domain.region(name)
        cells = cells[cells < domain.owned_cells]
        x, corners = domain.points
        volume = float(measures(x[corners[cells], : domain.dim]).sum())
        result["region", name] = domain.comm.allreduce(volume, MPI.SUM)
    return result
