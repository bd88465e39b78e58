"""Put bodies that were meshed apart beside each other in one mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.assembled import Assembled, Member
from namedmesh.base.checks import description
from namedmesh.base.exceptions import InputError, together
from namedmesh.bodies import Geometry
from namedmesh.domain import Domain
from namedmesh.interface_map import Interface, Regions
from namedmesh.joining.joint import last_tag
from namedmesh.plain import PlainMesh
from namedmesh.tags import NO_TAG
from namedmesh.transfer import gather_mesh, spread

REST = ""
"""Stands for the cells of a body that are in no region."""


def assembly(bodies: Mapping[str, Domain]) -> Domain:
    """Put several domains beside each other in one mesh, unconnected; collective.

    Each becomes a region with its name. If it has several regions, they are called
    "upper steel" and so on. The boundary parts are called "upper left" and so on, and
    pairs keep to their bodies. :meth:`Domain.joined` then brings them into contact.

    If the true shape of each of them is known, they can be meshed again, and refinement
    follows their curves, see :meth:`Domain.joined`.

    Args:
        bodies: Name of each body -> its domain. They have the same dimension and the
            same communicator.

    Raises:
        InputError: If these are not names of domains that fit.

    Example:
        >>> base = ec.rectangle((0.0, -1.0), (3.0, 0.0), cells=(5, 2))
        >>> ec.assembly({"block": block, "base": base})
        <Domain in 2D: 36 cells, boundary parts block left, ..., regions block, base>
    """
    comm = _communicator(bodies)
    together(comm, _check, bodies)
    plains = []
    members = []
    names: dict[str, int] = {}
    regions: dict[str, int] = {}
    interfaces: list[Interface] = []
    facet_tag = 0
    mark = 0
    for name, domain in bodies.items():
        glued = domain.whole
        plain = gather_mesh(glued)
        new_tags = _region_tags(glued, plain, len(regions) + 1)
        of_body = {f"{name} {region}".rstrip(): tag for region, (_, tag) in new_tags.items()}
        regions = _disjoint(regions, of_body)
        of_body = {f"{name} {part}": tag + facet_tag for part, tag in glued.names.items()}
        names = _disjoint(names, of_body)
        for interface in domain.interfaces:
            interfaces.append(
                _rename_interface(interface, name, facet_tag, dict(new_tags.values()))
            )
        shape = glued.geometry if isinstance(glued.geometry, Geometry) else None
        region_tags = tuple(new_tags.values())
        member = Member(shape, glued.names, glued.regions, facet_tag, region_tags, mark)
        plains.append(member.with_tags_of_whole(plain))
        members.append(member)
        facet_tag += last_tag(domain) + 1
        mark += comm.bcast(int(plain.marks_of_sides.max(initial=0)))
    whole = None
    if all(member.shape is not None for member in members):
        whole = Assembled(tuple(members), names, regions)
    tables = spread(comm, PlainMesh.beside_each_other(plains))
    result = Domain(names=names, regions=regions, geometry=whole, **tables)
    return result.cut(tuple(interfaces)) if interfaces else result


def _communicator(bodies: Any) -> MPI.Comm:
    """Return the communicator of the first domain, or the communicator of all ranks."""
    first = next(iter(bodies.values()), None) if isinstance(bodies, Mapping) else None
    return first.comm if isinstance(first, Domain) else MPI.COMM_WORLD


def _check(bodies: Any) -> None:
    """Check the argument of :func:`assembly`.

    Raises:
        InputError: If it is no mapping from names to domains of one kind.
    """
    example = 'assembly({"upper": punch, "lower": block})'
    if not isinstance(bodies, Mapping) or not bodies:
        raise InputError(
            f"assembly: the bodies are {description(bodies)}; give names and domains, e.g. "
            f"{example}."
        )
    first = next(iter(bodies.values()))
    for name, domain in bodies.items():
        if not isinstance(name, str) or not name.strip():
            raise InputError(f"assembly: {name!r} is no name of a body; give text.")
        if not isinstance(domain, Domain):
            raise InputError(
                f"assembly: {name!r} is {description(domain)}; give a Domain, e.g. of read_mesh."
            )
        if domain.dim != first.dim:
            raise InputError(
                f"assembly: {name!r} is in {domain.dim}D, the first body in {first.dim}D; all "
                "must have the same dimension."
            )
        if MPI.Comm.Compare(domain.comm, first.comm) > MPI.CONGRUENT:
            raise InputError(
                f"assembly: {name!r} has another communicator than the first body; make all with "
                "the same comm=."
            )


def _disjoint(names: dict[str, int], others: dict[str, int]) -> dict[str, int]:
    """Return names of both mappings.

    Raises:
        InputError: If both have a name.
    """
    for name in others:
        if name in names:
            raise InputError(
                f"assembly: two bodies would have a part or region {name!r}; give a body another "
                "name."
            )
    return names | others


def _region_tags(glued: Domain, plain: PlainMesh, first: int) -> dict[str, tuple[int, int]]:
    """Return the old and the new tag of each region of a body; collective.

    Args:
        glued: The mesh of the body.
        plain: The same on rank 0.
        first: The first new tag.
    """
    if len(glued.regions) < 2:
        return {REST: (NO_TAG, first)}
    result = {name: (tag, first + i) for i, (name, tag) in enumerate(glued.regions.items())}
    named = np.isin(plain.regions, list(glued.regions.values()))
    if glued.comm.bcast(bool(named.all())):
        return result
    return {REST: (NO_TAG, first + len(result)), **result}


def _rename_interface(
    interface: Interface, body: str, facet_tag: int, regions: dict[int, int]
) -> Interface:
    """Return an interface with the names and tags that it has in the assembly."""
    here, there = (f"{body} {name}" for name in interface.names)
    tags = (interface.tags[0] + facet_tag, interface.tags[1] + facet_tag)
    sides: list[Regions] = []
    for side in interface.regions:
        new = tuple(regions[tag] for tag in np.atleast_1d(side).tolist())
        sides.append(new[0] if isinstance(side, int) else new)
    on = None if interface.on is None else interface.on + facet_tag
    return Interface((here, there), tags, (sides[0], sides[1]), on)
