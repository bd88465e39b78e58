"""Keep the true shapes of bodies that were meshed apart, to mesh and join them again.

A mesh that was put together of several is no geometry. But each body has its own: it is
meshed with its part of the sizes, then the bodies are put beside each other and glued
as before. The facets where they meet are made anew, and names and tags stay.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError
from namedmesh.bodies import Bodies, Geometry
from namedmesh.joining.joint import joint
from namedmesh.plain import PlainMesh
from namedmesh.size_field import Labels, SizeField
from namedmesh.tags import NO_TAG
from namedmesh.transfer import gather_mesh, spread

B = TypeVar("B", bound=Bodies)
"""Type of a domain."""


@dataclass(frozen=True)
class Member:
    """Hold the true shape of a body, and how its mesh becomes a part of the whole.

    Attributes:
        shape: Its true shape.
        names: Name of each part of the body alone -> its tag.
        regions: Name of each region of the body alone -> its tag.
        first_tag: What is added to the tags of its parts.
        region_tags: Pairs of the tag of a region and its tag in the whole. The tag of
            :data:`NO_TAG` stands for all regions that are not among them.
        first_mark: What is added to the marks of its curves or surfaces.
    """

    shape: Geometry | None
    names: Mapping[str, int]
    regions: Mapping[str, int]
    first_tag: int
    region_tags: tuple[tuple[int, int], ...]
    first_mark: int = 0

    def with_tags_of_whole(self, plain: PlainMesh) -> PlainMesh:
        """Return the mesh of the body alone with the tags of the whole."""
        new_tags = dict(self.region_tags)
        regions = np.full_like(plain.regions, new_tags.get(NO_TAG, NO_TAG))
        for old, new in self.region_tags:
            if old != NO_TAG:
                regions[plain.regions == old] = new
        tags = np.where(plain.tags == NO_TAG, NO_TAG, plain.tags + self.first_tag)
        marks = plain.marks
        if marks is not None:
            marks = np.where(marks == NO_TAG, NO_TAG, marks + self.first_mark)
        return replace(plain, regions=regions, tags=tags, marks=marks)

    def mesh(self, like: Bodies, sizes: SizeField) -> PlainMesh:
        """Mesh the body with its part of the sizes of the whole; collective."""
        assert self.shape is not None
        back = {new: old for old, new in self.region_tags}
        if len(self.regions) == 1:
            # A single region of the body is all of it.
            back = dict.fromkeys(back, next(iter(self.regions.values())))
        curved = bool(getattr(self.shape, "curved", False))
        labels = Labels(self.names, self.regions, curved)
        body = self.shape.meshed_by(like, sizes.in_regions(back), labels)
        return self.with_tags_of_whole(gather_mesh(body))


@dataclass(frozen=True)
class Assembled:
    """Represent bodies that were meshed apart by the true shape of each of them.

    Args:
        members: The bodies.
        names: Name of each part of the bodies beside each other -> its tag.
        regions: Name of each region -> its tag.
        joints: Names of the two parts of each joint, the tag of its facets, whether it
            was made to stay glued, and greatest distance of the parts [length], in the
            order in which they were made.
    """

    members: tuple[Member, ...]
    names: Mapping[str, int] = field(repr=False)
    regions: Mapping[str, int] = field(repr=False)
    joints: tuple[tuple[str, str, int, bool, float], ...] = ()

    @property
    def curved(self) -> bool:
        """Tell whether a body is curved."""
        return any(bool(getattr(member.shape, "curved", False)) for member in self.members)

    def with_joint(self, glued: Bodies, joint: tuple[str, str, int, bool, float]) -> Assembled:
        """Return the shape with one joint more."""
        if glued.geometry is not self:
            # Rules have named parts of it since.
            return replace(of_model(glued), joints=(joint,))
        return replace(self, joints=(*self.joints, joint))

    def meshed_by(self, like: B, sizes: SizeField, labels: Labels) -> B:
        """Mesh the bodies, put them together and glue them again; collective.

        Args:
            like: A domain on the same communicator.
            sizes: The sizes.
            labels: Not used: the names are those that the bodies had.
        """
        comm = like.comm
        plains = [member.mesh(like, sizes) for member in self.members]
        tables = spread(comm, PlainMesh.beside_each_other(plains))
        blank: dict[str, Any] = {"glued": None, "interface_map": None}
        blank |= {"regions": self.regions, "geometry": self}
        result = replace(like, names=self.names, **tables, **blank)
        for here, there, on, tied, apart in self.joints:
            try:
                glued = joint(result, here, there, on, tied=tied, apart=apart)
            except InputError as reason:
                # The user asked for sizes, and must know why bodies are joined again.
                raise InputError(
                    f"remeshed: each body has another mesh now, and {here!r} and {there!r} cannot "
                    f"be joined again ({reason}) Keep these meshes and refine them: "
                    "domain.refined(cells), or strategy=ec.Mark()."
                ) from reason
            result = replace(like, names=glued.names, **spread(comm, glued.plain), **blank)
        return result

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surfaces [length]; collective."""
        result = points.copy()
        for shape, its_marks in self._marks_of_members(marks):
            chosen = (its_marks != NO_TAG).any(axis=1)
            result[chosen] = shape.nearest(comm, points[chosen], its_marks[chosen])
        return result

    def are_curved(self, marks: np.ndarray) -> np.ndarray:
        """Tell which marks are marks of curved curves or surfaces, of their shape."""
        result = np.zeros(marks.shape, dtype=bool)
        for shape, its_marks in self._marks_of_members(marks):
            result |= shape.are_curved(its_marks)
        return result

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return unit normals of the true surfaces, nan where not known; collective."""
        result = np.full(points.shape, np.nan)
        for shape, its_marks in self._marks_of_members(marks):
            chosen = its_marks != NO_TAG
            result[chosen] = shape.normals(comm, points[chosen], its_marks[chosen])
        return result

    def _marks_of_members(self, marks: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
        """Iterate over the shapes, and what the marks of points are to each of them."""
        firsts = [member.first_mark for member in self.members]
        ends = [*firsts[1:], np.iinfo(marks.dtype).max]
        for member, first, end in zip(self.members, firsts, ends, strict=True):
            is_its_own = (marks > first) & (marks <= end)
            yield member.shape, np.where(is_its_own, marks - first, NO_TAG)


def of_model(glued: Bodies) -> Assembled:
    """Return the shape of bodies of one model, which are not connected."""
    same = tuple((tag, tag) for tag in (*glued.regions.values(), NO_TAG))
    member = Member(glued.geometry, glued.names, glued.regions, 0, same)
    return Assembled((member,), glued.names, glued.regions)
