"""Describe meshes of bodies: names, true shape, and the pairs of facets that face."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.html import table
from erc_contact.mesh import parts
from erc_contact.mesh.named import NamedMesh
from erc_contact.mesh.seams import Seams
from erc_contact.mesh.surface import offset


class Surface(Protocol):
    """Represent the true surface of a body."""

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective.

        See :data:`erc_contact.mesh.surface.Nearest`.
        """


@runtime_checkable
class Joinable(Protocol):
    """Represent a true shape of bodies that can be joined again on each mesh."""

    def with_joint(self, glued: Any, joint: tuple[str, str, int, bool, float]) -> Any:
        """Return the shape with one joint more.

        Args:
            glued: The mesh before it is joined.
            joint: Names of both sides, tag of the facets where they meet, whether the
                bodies stay glued there, and greatest distance of the sides [length].
        """


@dataclass(frozen=True, eq=False)
class Bodies(NamedMesh):
    """Hold a mesh with names, and what is known of its shape and its pairs.

    See :class:`Domain`, which makes it and checks it.

    Attributes:
        geometry: The true shape, or None.
        curved_facets: Tags of the facets of curved bodies, or None.
        glued: The mesh from which this one was split, or None.
        seams: What relates the nodes and cells of both, or None.
    """

    geometry: Surface | None = field(default=None, repr=False)
    curved_facets: dmesh.MeshTags | None = field(default=None, repr=False)
    glued: Bodies | None = field(default=None, repr=False)
    seams: Seams | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        """Describe the domain in a line; one rank alone may do so."""
        names = ", ".join(self.names)
        if self.regions:
            names += f", regions {', '.join(self.regions)}"
        if self.pairs:
            names += f", pairs {self.seams}"
        return f"<Domain in {self.dim}D: {self.cells} cells, boundary parts {names}>"

    def _repr_html_(self) -> str:
        """Describe the domain in a notebook; one rank alone may do so."""
        rows: list[tuple[str, object]] = [("cells", self.cells), ("vertices", self.vertices)]
        rows.append(("boundary parts", ", ".join(self.names)))
        if self.regions:
            rows.append(("regions", ", ".join(self.regions)))
        if self.pairs:
            rows.append(("pairs", self.seams))
        curved = self.curved_facets is not None
        rows.append(("shape", parts.shape_in_words(self.geometry, self.dim, curved=curved)))
        return table(rows, caption=f"Domain in {self.dim}D")

    @cached_property
    def offset(self) -> fem.Function | None:
        """Return the vector from a facet to the true surface [length]; collective.

        It is None if the surface is flat or not known.
        """
        if self.curved_facets is None or self.geometry is None:
            return None
        return offset(self.mesh, self.curved_facets, self.geometry.nearest)

    @property
    def knows_shape(self) -> bool:
        """Tell whether the true shape is known, with the facets on curved sides."""
        curved = bool(getattr(self.geometry, "curved", False))
        return self.geometry is not None and (not curved or self.curved_facets is not None)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return the names of the boundary parts that face each other, see split."""
        if self.seams is None:
            return ()
        return tuple(interface.names for interface in self.seams.interfaces)

    @property
    def tied_sides(self) -> list[np.ndarray]:
        """Return the sides (cell, local facet) of tied joints, shape (n, 2) each."""
        result: list[np.ndarray] = []
        if self.seams is not None:
            for interface in self.seams.interfaces:
                if interface.tied:
                    result += self.facing(*interface.names)
        return result

    def facing(self, here: str, there: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the facets of two parts that face each other on this rank.

        Ghosts are included if their partner is on this rank, too. The partner of a
        facet in an owned cell always is.

        Args:
            here: Name of a part.
            there: Name of the part that it faces.

        Returns:
            Pairs (cell, local facet) of ``here`` and of ``there``, shape (n, 2) each.
            Row i of the first faces row i of the second.

        Raises:
            InputError: If the parts are no pair.
        """
        if self.seams is None or not self.pairs:
            raise InputError(
                f"facing: {here!r} and {there!r} do not face each other; this domain has no pairs, "
                "make them by split."
            )
        return self.seams.between(here, there)
