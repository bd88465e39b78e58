"""The true shape of a body, in the form that gmsh needs to mesh the body again with other sizes.

A mesh does not know the circles that it was made from. So domains from gmsh keep a
:class:`Drawing`, and rectangles and boxes a :class:`Brick`, on rank 0. Refined and
remeshed domains hand it on. Physical groups keep their tags, so the names of parts and
regions stay. If a boundary or an interface is curved, each of its facets has a mark:
the number of its curve or surface in the drawing.

Symbols: d dimension.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.mesh.domain import Domain
from erc_contact.mesh.gmsh_model import session
from erc_contact.mesh.remeshing import meshed
from erc_contact.mesh.simplex import in_space

SIDES = {
    2: (("left", "right"), ("bottom", "top")),
    3: (("left", "right"), ("front", "back"), ("bottom", "top")),
}
"""Names of the sides of a rectangle or box, by dimension: low and high end of x, y and z. The last axis is up."""
MARK = "erc_contact mark "
"""Beginning of the names of physical groups that keep marks."""
FLAT = ("Line", "Plane")
"""gmsh's types of curves and surfaces that facets represent exactly."""


@dataclass(frozen=True)
class Brick:
    """A rectangle or a box.

    Args:
        low: Corner of least coordinates [length].
        high: Opposite corner [length].
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    def build(self, gmsh: Any) -> None:
        """Make geometry and physical groups in gmsh's current model, by the OpenCASCADE kernel."""
        dim = len(self.low)
        occ, extent = gmsh.model.occ, np.subtract(self.high, self.low)
        body = (
            occ.addRectangle(*self.low, 0.0, *extent)
            if dim == 2
            else occ.addBox(*self.low, *extent)
        )
        occ.synchronize()
        gmsh.model.addPhysicalGroup(dim, [body], name="body")
        sides = gmsh.model.getBoundary([(dim, body)], oriented=False)
        centre = {tag: np.array(occ.getCenterOfMass(dim - 1, tag)[:dim]) for _, tag in sides}
        for number, (name, axis, at) in enumerate(self.sides(), start=1):
            distance = {tag: abs(x[axis] - at) for tag, x in centre.items()}
            gmsh.model.addPhysicalGroup(
                dim - 1, [min(distance, key=distance.__getitem__)], tag=number, name=name
            )

    def sides(self) -> Iterator[tuple[str, int, float]]:
        """Name, axis and coordinate [length] of each side. The tags of the sides are 1, 2, ... in this order."""
        for axis, pair in enumerate(SIDES[len(self.low)]):
            for name, at in zip(pair, (self.low[axis], self.high[axis]), strict=True):
                yield name, axis, at

    def exact(self, domain: Domain) -> Domain:
        """The same domain with its nodes exactly on the sides of the brick: a side at y = 0 must not be at 1e-17.

        Args:
            domain: A new mesh of this brick, which is changed in place.
        """
        x = domain.mesh.geometry.x
        for _, axis, at in self.sides():
            x[abs(x[:, axis] - at) < 1e-12 * (self.high[axis] - self.low[axis]), axis] = at
        return domain

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""
        return self.exact(meshed(self, self.build, domain, sizes))

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """The points themselves, because the facets are the true surface."""
        return points


@dataclass(frozen=True)
class Drawing:
    """The geometry of a gmsh model, as the text of a file of gmsh's.

    Args:
        suffix: Suffix of the file: ".xao" (shapes of OpenCASCADE) or ".geo_unrolled"
            (shapes of gmsh's own kernel). Both formats have the physical groups.
        text: Contents of the file on rank 0, empty elsewhere.
        curved: Marks of the curves (in 2D) or surfaces (in 3D) that are curved, the
            same on all ranks.
    """

    suffix: str
    text: str = field(repr=False)
    curved: frozenset[int] = frozenset()

    def build(self, gmsh: Any) -> dict[int, int]:
        """Make geometry and physical groups in gmsh's current model; return the tag of each mark there.

        OpenCASCADE gives a shape new tags each time it is read. So marks are kept as
        physical groups.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"body{self.suffix}"
            path.write_text(self.text)
            gmsh.merge(str(path))
        model, tags = gmsh.model, {}
        for dim, group in model.getPhysicalGroups():
            name = model.getPhysicalName(dim, group)
            if name.startswith(MARK):
                tags[int(name.removeprefix(MARK))] = int(
                    model.getEntitiesForPhysicalGroup(dim, group)[0]
                )
                model.removePhysicalGroups([(dim, group)])
        return tags or {
            int(tag): int(tag) for _, tag in model.getEntities(model.getDimension() - 1)
        }

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""
        return meshed(self, self.build, domain, sizes)

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Nearest points of the true surface, see :data:`erc_contact.mesh.surface.Nearest`; collective."""
        bent = np.isin(marks, list(self.curved)).any(axis=1)
        parts = comm.gather((points[bent], marks[bent]))
        found: list[np.ndarray] = []

        def build(gmsh: Any) -> None:
            tags = self.build(gmsh)
            found.extend(_nearest(gmsh.model, tags, x, of) for x, of in parts or ())

        with session(comm, build, "The geometry"):
            result = points.copy()
            result[bent] = comm.scatter(found if comm.rank == 0 else None)
        return result


def drawing_of(model: Any) -> tuple[str, str, frozenset[int]] | None:
    """Suffix, text and curved marks of the :class:`Drawing` of gmsh's current model; None if it has none.

    A model from a mesh file has no geometry. One that mixes gmsh's two kernels cannot
    be kept by either format.
    """
    import gmsh  # noqa: PLC0415 - whoever has a model has gmsh

    entities, drawn = set(model.getEntities()), set(model.occ.getEntities())
    discrete = any(model.getType(*entity).startswith("Discrete") for entity in entities)
    if discrete or (drawn and drawn != entities):
        return None
    suffix = ".xao" if drawn else ".geo_unrolled"
    facets = model.getEntities(model.getDimension() - 1)
    curved = frozenset(int(tag) for dim, tag in facets if model.getType(dim, tag) not in FLAT)
    marks = facets if curved and drawn else ()
    groups = [(dim, model.addPhysicalGroup(dim, [tag], name=f"{MARK}{tag}")) for dim, tag in marks]
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"body{suffix}"
            gmsh.write(str(path))
            return suffix, path.read_text(), curved
    finally:
        if groups:  # no groups would mean all
            model.removePhysicalGroups(groups)


def _nearest(model: Any, tags: Mapping[int, int], x: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Nearest points (n, d) on the curves or surfaces of the marks (n, 2).

    A point with two marks goes to the common edge of both.
    """
    d, result = x.shape[1], x.copy()
    for pair in np.unique(marks, axis=0):
        here = np.all(marks == pair, axis=1)
        places = [(d - 1, tags[pair[0]])]
        if pair[1] >= 0:
            below = [set(map(int, model.getAdjacencies(d - 1, tags[m])[1])) for m in pair]
            places = [(d - 2, tag) for tag in below[0] & below[1]]
        flat = in_space(x[here]).ravel()
        found = np.array(
            [np.reshape(model.getClosestPoint(*place, flat)[0], (-1, 3))[:, :d] for place in places]
        )
        if len(found):
            best = np.linalg.norm(found - x[here], axis=2).argmin(axis=0)
            result[here] = found[best, np.arange(len(best))]
    return result
