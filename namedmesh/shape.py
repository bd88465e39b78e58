"""Keep the true shape of a body, for gmsh to mesh it again with other sizes.

A mesh does not know the circles that it was made from. So domains from gmsh keep a
:class:`Drawing`, and rectangles and boxes a :class:`Brick`, on rank 0. Refined and
remeshed domains hand it on. Physical groups keep their tags, so the names of parts and
regions stay. If a boundary or an interface is curved, each of its facets has a mark:
the number of its curve or surface in the drawing.

Symbols: d dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.assembled import Assembled, of_model
from namedmesh.domain import Domain
from namedmesh.drawings.kept import MARK_PREFIX, build_kept
from namedmesh.gmsh_session import session
from namedmesh.remeshing import mesh_geometry
from namedmesh.rows import in_space
from namedmesh.size_field import Labels, SizeField

SIDES = {
    2: (("left", "right"), ("bottom", "top")),
    3: (("left", "right"), ("front", "back"), ("bottom", "top")),
}
"""Names of the sides of a rectangle or box, by dimension.

Each pair names the low and the high end of x, y or z. The last axis is up.
"""
SIDE_ROUND_OFF = 1e-12
"""Distance from a side of a brick that is round-off, as a share of its length [-]."""

FAR = 0.02
"""Distance of a closest point at which the ends or the rim are asked, too.

It is a share of the diagonal of the box around the curve or surface [-].
"""
SAME_POINT = 1e-7
"""Distance of two closest points on an arc that are one, over its radius [-]."""
Below = Callable[[int, int], frozenset[tuple[int, int]]]
"""Function that tells what bounds an entity of gmsh's, given as dimension and tag."""


class _OneModel:
    """Represent the shape of bodies of one model of gmsh."""

    def with_joint(self, glued: Domain, joint: tuple[str, str, int, bool, float]) -> Assembled:
        """Return the shape of its bodies with a joint between two of them."""
        return replace(of_model(glued), joints=(joint,))


@dataclass(frozen=True)
class Brick(_OneModel):
    """Represent a rectangle or a box.

    Args:
        low: Corner of least coordinates [length].
        high: Opposite corner [length].
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    def build(self, gmsh: Any) -> None:
        """Make geometry and physical groups in gmsh's model, by OpenCASCADE."""
        dim = len(self.low)
        occ = gmsh.model.occ
        extent = np.subtract(self.high, self.low)
        if dim == 2:
            body = occ.addRectangle(*self.low, 0.0, *extent)
        else:
            body = occ.addBox(*self.low, *extent)
        occ.synchronize()
        gmsh.model.addPhysicalGroup(dim, [body], name="body")
        boundary = gmsh.model.getBoundary([(dim, body)], oriented=False)
        centres = {tag: np.array(occ.getCenterOfMass(dim - 1, tag)[:dim]) for _, tag in boundary}
        for number, (name, axis, coordinate) in enumerate(self.sides(), start=1):
            distance = {tag: abs(x[axis] - coordinate) for tag, x in centres.items()}
            side = min(distance, key=distance.__getitem__)
            gmsh.model.addPhysicalGroup(dim - 1, [side], tag=number, name=name)

    def sides(self) -> Iterator[tuple[str, int, float]]:
        """Iterate over the sides: name, axis and coordinate [length].

        The tags of the sides are 1, 2, ... in this order.
        """
        for axis, (low_name, high_name) in enumerate(SIDES[len(self.low)]):
            yield low_name, axis, self.low[axis]
            yield high_name, axis, self.high[axis]

    def exact(self, domain: Domain) -> Domain:
        """Put the nodes of a domain exactly on the sides of the brick.

        A side at y = 0 must not be at 1e-17.

        Args:
            domain: A new mesh of this brick, which is changed in place.

        Returns:
            The same domain.
        """
        x = domain.mesh.geometry.x
        for _, axis, coordinate in self.sides():
            distance = SIDE_ROUND_OFF * (self.high[axis] - self.low[axis])
            x[abs(x[:, axis] - coordinate) < distance, axis] = coordinate
        return domain

    def meshed_by(self, like: Domain, sizes: SizeField, labels: Labels) -> Domain:
        """Mesh the shape with sizes in the cells of a mesh; collective."""
        new = mesh_geometry(self.build, like.comm, sizes, labels)
        return self.exact(Domain(**new, geometry=self))

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the points themselves: the facets are the true surface."""
        return points

    def are_curved(self, marks: np.ndarray) -> np.ndarray:
        """Tell that no side is curved."""
        return np.zeros(marks.shape, dtype=bool)

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return nan: the facets have the normals."""
        return np.full(points.shape, np.nan)


@dataclass(frozen=True)
class Drawing(_OneModel):
    """Represent the geometry of a gmsh model by a text.

    Args:
        suffix: Form of the text: ".xao" (shapes of OpenCASCADE) or ".json" (shapes of
            gmsh's own kernel). Both have the physical groups.
        text: The text on rank 0, empty elsewhere.
        curved: Marks of the curves (in 2D) or surfaces (in 3D) that are curved, the
            same on all ranks.
    """

    suffix: str
    text: str = field(repr=False)
    curved: frozenset[int] = frozenset()

    def build(self, gmsh: Any) -> dict[int, int]:
        """Make geometry and physical groups in gmsh's model.

        OpenCASCADE gives a shape new tags each time it is read. So marks are kept as
        physical groups.

        Returns:
            gmsh's tag of each mark.
        """
        build_kept(gmsh, self.suffix, self.text)
        model = gmsh.model
        tags = {}
        for dim, group in model.getPhysicalGroups():
            name = model.getPhysicalName(dim, group)
            if name.startswith(MARK_PREFIX):
                mark = int(name.removeprefix(MARK_PREFIX))
                tags[mark] = int(model.getEntitiesForPhysicalGroup(dim, group)[0])
                model.removePhysicalGroups([(dim, group)])
        if tags:
            return tags
        # gmsh's own kernel keeps the tags, which are the marks then.
        return {int(tag): int(tag) for _, tag in model.getEntities(model.getDimension() - 1)}

    def meshed_by(self, like: Domain, sizes: SizeField, labels: Labels) -> Domain:
        """Mesh the shape with sizes in the cells of a mesh; collective."""
        new = mesh_geometry(self.build, like.comm, sizes, labels)
        return Domain(**new, geometry=self).snapped()

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective.

        See :data:`namedmesh.surface.Nearest`.
        """
        curved = self.are_curved(marks).any(axis=1)
        result = points.copy()
        result[curved] = self._ask(comm, _nearest, points[curved], marks[curved])
        return result

    def are_curved(self, marks: np.ndarray) -> np.ndarray:
        """Tell which marks are marks of curved curves or surfaces, of their shape."""
        return np.isin(marks, list(self.curved))

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return unit normals of the true surface [-]; collective.

        Args:
            comm: The ranks.
            points: Points on the surface or near it [length], shape (n, d).
            marks: The mark of the curve or surface of each point, shape (n,).

        Returns:
            The normal at the nearest point, its sign open; nan on flat facets and where
            the surface has none, as at the tip of a cone. Shape (n, d).
        """
        curved = self.are_curved(marks)
        result = np.full(points.shape, np.nan)
        result[curved] = self._ask(comm, _normals, points[curved], marks[curved])
        return result

    def _ask(
        self,
        comm: MPI.Comm,
        question: Callable[[Any, Mapping[int, int], np.ndarray, np.ndarray], np.ndarray],
        points: np.ndarray,
        marks: np.ndarray,
    ) -> np.ndarray:
        """Ask gmsh's model of the geometry about points of all ranks; collective.

        gmsh runs on rank 0 only, which works for all ranks, and not at all for none.
        """
        if comm.allreduce(len(points), MPI.SUM) == 0:
            return points
        parts = comm.gather((points, marks))
        answers: list[np.ndarray] = []

        def build(gmsh: Any) -> None:
            tags = self.build(gmsh)
            for rank_points, rank_marks in parts or ():
                answers.append(question(gmsh.model, tags, rank_points, rank_marks))

        with session(comm, build, "The geometry"):
            return comm.scatter(answers if comm.rank == 0 else None)


def _nearest(model: Any, tags: Mapping[int, int], x: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Find the nearest points on the curves or surfaces of marks [length].

    A point with several marks goes to the common edge or corner of all of them.

    Args:
        model: gmsh's current model.
        tags: gmsh's tag of each mark.
        x: Points [length], shape (n, d).
        marks: The marks of each point, then -1, shape (n, m).

    Returns:
        Shape (n, d).
    """
    d = x.shape[1]
    result = x.copy()
    below = cache(partial(_below, model))
    rows, number = np.unique(marks, axis=0, return_inverse=True)
    for place, row in enumerate(rows):
        selected = number.ravel() == place
        faces = [(d - 1, tags[mark]) for mark in row if mark >= 0]
        flat = in_space(x[selected])
        candidates = []
        for dim, tag in _common(below, faces):
            candidates.append(_closest(model, below, dim, tag, flat)[:, :d])
        # There may be several common places, or none: then points stay.
        if candidates:
            points = np.array(candidates)
            best = np.linalg.norm(points - x[selected], axis=2).argmin(axis=0)
            result[selected] = points[best, np.arange(len(best))]
    return result


def _below(model: Any, dim: int, tag: int) -> frozenset[tuple[int, int]]:
    """Return the corners at the ends of a curve, or the curves around a surface."""
    return frozenset((dim - 1, int(end)) for end in model.getAdjacencies(dim, tag)[1])


def _closest(model: Any, below: Below, dim: int, tag: int, x: np.ndarray) -> np.ndarray:
    """Return the closest points on a corner, curve or surface [length], shape (n, 3).

    gmsh knows points to which the way is at a right angle. A point beyond the end of a
    curve, or beyond the rim of a surface, may have none but on the far side of the
    body: its closest point is on the end, or on the rim.

    Args:
        model: gmsh's current model.
        below: What bounds each curve or surface.
        dim: Dimension of the entity.
        tag: Its tag.
        x: Points [length], shape (n, 3).
    """
    if dim == 0:
        return np.tile(model.getValue(0, tag, []), (len(x), 1))
    closest = np.reshape(model.getClosestPoint(dim, tag, x.ravel())[0], (-1, 3))
    if model.getType(dim, tag) == "Circle":
        closest = _Arc(model, tag).nearer(x, closest)
    low, high = np.reshape(model.getBoundingBox(dim, tag), (2, 3))
    distance = np.linalg.norm(closest - x, axis=1)
    far = np.flatnonzero(distance > FAR * np.linalg.norm(high - low))
    if not len(far):
        return closest
    for place in _ends(model, below, dim, tag):
        of_end = _closest(model, below, *place, x[far])
        its_distance = np.linalg.norm(of_end - x[far], axis=1)
        closer = its_distance < distance[far]
        closest[far[closer]] = of_end[closer]
        distance[far[closer]] = its_distance[closer]
    return closest


def _ends(model: Any, below: Below, dim: int, tag: int) -> set[tuple[int, int]]:
    """Return the ends of a curve, or the curves of the rim of a surface.

    A curve without length, as at the pole of a sphere, is its corner: gmsh knows no
    point of it.
    """
    ends = set(below(dim, tag))
    for end in below(dim, tag):
        if dim == 2 and len(below(*end)) == 1 and model.getType(*end) == "Unknown":
            ends.remove(end)
            ends |= below(*end)
    return ends


def _common(below: Below, faces: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return what curves or surfaces have in common, of the greatest dimension.

    A surface alone is its own. Two or more have common edges, or else common corners.
    """
    if len(faces) == 1:
        return faces
    bounds = [frozenset({face}) for face in faces]
    for _ in range(faces[0][0]):
        for number, entities in enumerate(bounds):
            bounds[number] = frozenset(end for entity in entities for end in below(*entity))
        common = frozenset.intersection(*bounds)
        if common:
            return sorted(common)
    return []


def _normals(model: Any, tags: Mapping[int, int], x: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Find unit normals of the curves or surfaces of marks at points near them [-].

    Args:
        model: gmsh's current model.
        tags: gmsh's tag of each mark.
        x: Points [length], shape (n, d).
        marks: The mark of each point, shape (n,).

    Returns:
        Shape (n, d), nan where there is none.
    """
    d = x.shape[1]
    result = np.full(x.shape, np.nan)
    for mark in np.unique(marks):
        selected = marks == mark
        place = d - 1, tags[mark]
        if model.getType(*place) == "Circle":
            result[selected] = _Arc(model, tags[mark]).outward(in_space(x[selected]))[:, :d]
            continue
        closest, parameters = model.getClosestPoint(*place, in_space(x[selected]).ravel())
        if d == 2:
            # Of a curve these may be other parameters than the derivative has.
            parameters = model.getParametrization(1, tags[mark], closest)
            tangents = np.reshape(model.getDerivative(1, tags[mark], parameters), (-1, 3))
            normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
        else:
            normals = np.reshape(model.getNormal(tags[mark], parameters), (-1, 3))
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unknown = np.full_like(normals, np.nan)
        result[selected] = np.divide(normals, length, out=unknown, where=length > 0)
    return result


class _Arc:
    """Find points and normals of an arc to the last digits.

    gmsh's own kernel finds closest points on arcs to 3e-10 of the radius, and slopes by
    differences, to 1e-8: along such normals round bodies that slide on each other
    catch. Points of a given parameter are exact, and three of them tell the circle.

    Args:
        model: gmsh's current model.
        tag: Tag of the arc.
    """

    def __init__(self, model: Any, tag: int) -> None:
        (low,), (high,) = model.getParametrizationBounds(1, tag)
        # The ends of a whole circle are one point.
        places = low + (high - low) * np.array([0.0, 1 / 3, 2 / 3])
        points = np.reshape(model.getValue(1, tag, places), (-1, 3))
        chords = points[1:] - points[0]
        self._plane = np.linalg.qr(chords.T)[0]
        # The centre is as far along each chord as its middle.
        middles = 0.5 * (chords**2).sum(axis=1)
        to_centre = np.linalg.solve(chords @ self._plane, middles)
        self._centre = points[0] + self._plane @ to_centre
        self._radius = np.linalg.norm(to_centre)

    def outward(self, x: np.ndarray) -> np.ndarray:
        """Return the unit normals in the plane of the arc at points (n, 3) [-]."""
        away = (x - self._centre) @ self._plane @ self._plane.T
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))

    def nearer(self, x: np.ndarray, closest: np.ndarray) -> np.ndarray:
        """Return closest points of gmsh to the last digits; ends stay [length].

        Args:
            x: Points [length], shape (n, 3).
            closest: What gmsh finds on the arc [length], shape (n, 3).
        """
        exact = self._centre + self._radius * self.outward(x)
        is_same = np.linalg.norm(exact - closest, axis=1) < SAME_POINT * self._radius
        return np.where(is_same[:, None], exact, closest)
