"""Glue two bodies that were meshed apart where parts of their boundaries meet.

The work is done on rank 0, on plain arrays. If the sides match, their points become
one. If not, they get common facets: see :mod:`namedmesh.joining.aligning` for
the plane, and for space :mod:`namedmesh.joining.imprint_plane` if they are plane
and :mod:`namedmesh.joining.imprint_mutual` if they are curved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from namedmesh.base import checks
from namedmesh.base.exceptions import InputError, raise_together
from namedmesh.base.logs import log_of
from namedmesh.base.names import known_names
from namedmesh.base.percent import place_words
from namedmesh.bodies import Bodies
from namedmesh.interface_map import Interface, Regions
from namedmesh.joining.aligning import align
from namedmesh.joining.corners import moved_corner
from namedmesh.joining.imprint_curved import imprint_curved
from namedmesh.joining.imprint_mutual import imprint_mutually
from namedmesh.joining.imprint_plane import imprint_plane, plane_sides
from namedmesh.joining.matching import match_facets
from namedmesh.plain import PlainMesh
from namedmesh.rows import row_numbers
from namedmesh.tags import NO_TAG
from namedmesh.transfer import gather_mesh

ROUND_OFF = 1e-9
"""Share of a distance that is its round-off [-]."""
SAMPLE = 1000
"""Number of vertices of a side whose distances are looked at for a message."""


@dataclass(frozen=True, eq=False)
class Joint:
    """Hold a glued mesh and where its two bodies meet.

    Attributes:
        plain: The mesh on rank 0, without cells elsewhere.
        names: Name of each part -> its tag. The facets of the joint are a part, too.
        interface: The joint.
    """

    plain: PlainMesh
    names: dict[str, int]
    interface: Interface


def check_parts(
    here: object,
    there: object,
    glued: Bodies,
    pairs: tuple[tuple[str, str], ...],
    apart: object,
) -> None:
    """Check the arguments of :meth:`Domain.joined`.

    Args:
        here: Name of side 1.
        there: Name of side 2.
        glued: The glued mesh.
        pairs: Names of the sides that are joined or split already.
        apart: Greatest distance of the parts.

    Raises:
        InputError: If they are not two parts of the boundary, or the distance is none.
    """
    if apart != 0:
        checks.positive("joined: apart", apart, "a length >= 0")
    for name in (here, there):
        if any(name in pair for pair in pairs):
            raise InputError(f"joined: {name!r} is a side of a pair already; give another part.")
        if not isinstance(name, str) or name not in glued.names:
            raise InputError(
                f"joined: no part is called {name!r}; this domain has "
                f"{known_names(name, glued.outer)}"
            )
        glued.tag(name)
        outside = f"{name} outside"
        if outside in glued.names:
            raise InputError(
                f"joined: the domain has a part {outside!r}, which would be the name of what "
                f"remains of {name!r}; give it another name."
            )
    if here == there:
        raise InputError(
            f"joined: {here!r} cannot lie against itself; give the part of the other body, too."
        )


def last_tag(bodies: Bodies) -> int:
    """Return the greatest tag of the parts and facets of a domain; collective."""
    glued = bodies.whole
    used = [*bodies.names.values(), *glued.names.values(), *glued.facet_tags.values]
    for interface in bodies.interfaces:
        # Tags of tied joints are on no facet.
        used += interface.tags
    return bodies.comm.allreduce(int(max(used, default=0)), MPI.MAX)


def joint(
    glued: Bodies, here: str, there: str, on: int, *, tied: bool, apart: float = 0.0
) -> Joint:
    """Glue two parts of the boundary where they meet; collective.

    Args:
        glued: The mesh.
        here: Name of side 1.
        there: Name of side 2.
        on: Tag of the facets where they meet; greater than all others.
        tied: Whether the bodies stay glued there.
        apart: Greatest distance of both parts [length].

    Raises:
        InputError: If the parts do not lie against each other, or are in one region and
            not tied.
    """
    comm = glued.comm
    keep = apart > 0 and not tied
    plain = gather_mesh(glued)
    # Distances are those of the drawing; vertices that keep their volume move later.
    as_drawn = gather_mesh(glued, drawn=True) if keep else plain
    tags = (glued.names[here], glued.names[there])
    error: Exception | None = None
    about = None
    if comm.rank == 0:
        try:
            drawn = as_drawn
            of_volume = plain
            plain, regions = glue_sides(drawn, tags, on, apart, keep=keep)
            if keep and plain.glued is None:
                # The true shape is lost then, and with it the way back.
                drawn = of_volume
                plain, regions = glue_sides(drawn, tags, on, apart, keep=keep)
            if keep and plain.glued is None:
                log_of(comm).warning(_moved_side_words(here, there, apart))
            if not keep or plain.glued is None:
                # Vertices of one side are on the facets of the other one.
                plain = replace(plain, marks=None)
            plain = plain.without_unused_points()
            moved = moved_corner(drawn, plain, tags)
            if moved is not None and moved[1] > (1 + ROUND_OFF) * apart:
                log_of(comm).warning(_moved_words(here, there, *moved))
            if not tied:
                _check_regions(regions, glued.regions)
            about = (_plain_tags(regions[0]), _plain_tags(regions[1]), np.isin(tags, plain.tags))
        except InputError as reason:
            # One of gmsh's session is known to all ranks of another communicator.
            names_told = f"joined: {here!r} and {there!r}:"
            error = InputError(str(reason).replace("joined:", names_told, 1))
        except Exception as reason:  # every rank must learn of it
            error = reason
    raise_together(comm, error)
    *sides, has_more = comm.bcast(about)
    names = {name: tag for name, tag in glued.names.items() if name not in (here, there)}
    for name, tag, more in zip((here, there), tags, has_more, strict=True):
        if more:
            names[f"{name} outside"] = tag
    names[f"{here}/{there}"] = on
    return Joint(plain, names, Interface((here, there), (on + 1, on + 2), (sides[0], sides[1]), on))


def _moved_side_words(here: str, there: str, apart: float) -> str:
    """Say that a side has moved onto the other side."""
    return (
        f"joined: the facets of {here!r} and {there!r} do not match, and in 3D one body takes "
        f"facets of the other one: its side moved there, by {apart:g} at most. Give the distance "
        "by gap= of the contact, and with friction on round sides the common normal by normal=."
    )


def _moved_words(here: str, there: str, corner: np.ndarray, distance: float) -> str:
    """Say that a corner has moved from its place by a distance [length]."""
    return (
        f"joined: the corner {place_words(corner, 6)} moved by {distance:.3g}, as {here!r} and "
        f"{there!r} are that near there: the bodies of the mesh are solved and certified. Draw both"
        " corners in one place, or farther apart than a thousandth of an edge; give a clearance by"
        " gap=."
    )


def glue_sides(
    plain: PlainMesh, tags: tuple[int, int], on: int, apart: float = 0.0, *, keep: bool = False
) -> tuple[PlainMesh, tuple[np.ndarray, np.ndarray]]:
    """Glue the two sides, and give the facets where they meet a new tag.

    Args:
        plain: The mesh.
        tags: Tags of both sides.
        on: Tag of the facets where they meet.
        apart: Greatest distance of both sides [length].
        keep: Whether each side keeps its place across that distance.

    Returns:
        The mesh, and the tags of the regions on each side.

    Raises:
        InputError: If they do not meet.
    """
    if plain.dim == 2:
        whole = align(plain, *tags, apart, keep=keep)
    else:
        # Sides that match keep their cells, plane or curved.
        whole = match_facets(plain, *tags, apart, keep=keep) or _imprint(plain, tags, apart)
    first = whole.sides(tags[0])
    second = whole.sides(tags[1])
    glued = whole.glued_points
    numbers1, numbers2 = row_numbers(glued[whole.points_of(first)], glued[whole.points_of(second)])
    common = np.intersect1d(numbers1, numbers2)
    if not len(common):
        raise _apart(plain, tags)
    first = first[np.isin(numbers1, common)]
    second = second[np.isin(numbers2, common)]
    new_tags = whole.tags.copy()
    new_tags[tuple(first.T)] = on
    new_tags[tuple(second.T)] = on
    regions = (np.unique(whole.regions[first[:, 0]]), np.unique(whole.regions[second[:, 0]]))
    return replace(whole, tags=new_tags), regions


def _imprint(plain: PlainMesh, tags: tuple[int, int], apart: float) -> PlainMesh:
    """Return a mesh in 3D of which one side has the facets of the other side.

    Raises:
        InputError: If they do not lie on each other, or sides keep their places.
    """
    if plain.glued is not None:
        raise InputError(
            "joined: the facets of the parts do not match, and other sides keep their own places "
            "across a distance. Join the parts that do not match first."
        )
    if plane_sides(plain, *tags):
        return imprint_plane(plain, *tags, apart)
    return imprint_mutually(imprint_curved, plain, *tags, apart)


def _apart(plain: PlainMesh, tags: tuple[int, int]) -> InputError:
    """Say how far two sides that have nothing in common are from each other."""
    points = [plain.x[np.unique(plain.points_of(plain.sides(tag)))] for tag in tags]
    x1, x2 = (x[:: max(1, len(x) // SAMPLE)] for x in points)
    distance = np.linalg.norm(x1[:, None] - x2, axis=2).min()
    return InputError(
        "joined: the parts have nothing in common, no facets lie against each other; the least "
        f"distance of their vertices is {distance:.3g}. Both bodies must be where they touch, "
        "with their outward normals opposite; give a distance by gap= of the contact."
    )


def _check_regions(regions: tuple[np.ndarray, np.ndarray], names: Mapping[str, int]) -> None:
    """Check that the regions on both sides are different.

    Raises:
        InputError: If a region is on both sides, or a cell is in none.
    """
    in_both = np.intersect1d(*regions)
    if NO_TAG in np.concatenate(regions) or len(in_both):
        called = [repr(name) for name, tag in names.items() if tag in in_both]
        shared = f"the region {', '.join(called)}" if called else "no region of their own"
        raise InputError(
            f"joined: both parts are in {shared}, so nothing tells one side from the other. Give "
            "each body a region: by a physical group of cells in gmsh, by cell_tags= and regions= "
            "of Domain, or mesh them apart and put them together by assembly."
        )


def _plain_tags(regions: np.ndarray) -> Regions:
    """Return one tag, or the tags of several regions, as whole numbers of Python."""
    tags = tuple(map(int, regions))
    return tags[0] if len(tags) == 1 else tags


def interfaces(
    before: tuple[Interface, ...], joint: Interface, tied: bool
) -> tuple[Interface, ...]:
    """Return the interfaces at which the new mesh is split.

    Args:
        before: Those at which the domain is split already.
        joint: The new one.
        tied: Whether the bodies stay glued there.

    Raises:
        InputError: If the joint is tied, and all facets between its regions are split.
    """
    whole = any(
        interface.on is None and set(interface.regions) == set(joint.regions)
        for interface in before
    )
    if tied and whole:
        raise InputError(
            "joined: all facets between the regions of these parts are split, so they cannot be "
            "tied. Tie them first, and give split its facets by on=."
        )
    if tied:
        return before
    # A facet belongs to the first interface that claims it.
    return (joint, *before) if whole else (*before, joint)


def tie_alone(
    interfaces: tuple[Interface, ...], ties: Sequence[tuple[str, str]]
) -> tuple[Interface, ...]:
    """Return interfaces of which exactly the given pairs are tied.

    Args:
        interfaces: Those at which the domain is split.
        ties: Names of the parts of each pair that is tied.

    Raises:
        InputError: If two parts are no pair.
    """
    asked = [frozenset(names) for names in ties]
    pairs = [frozenset(interface.names) for interface in interfaces]
    for here, there in ties:
        if frozenset((here, there)) not in pairs:
            names = [interface.names for interface in interfaces]
            known = ", ".join(f"{first!r} and {second!r}" for first, second in names)
            raise InputError(
                f"Tied({here!r}, {there!r}): the parts are no pair; this domain has "
                f"{known or 'no pairs'}. Make one by joined, or by split."
            )
    result = []
    for interface, pair in zip(interfaces, pairs, strict=True):
        result.append(replace(interface, tied=pair in asked))
    return tuple(result)
