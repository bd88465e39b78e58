"""Represent bodies by a mesh whose boundary parts and cell regions have names.

A :class:`Domain` is a value. Refinement returns a new one, which has the same names and
is balanced over the ranks. On every rank it has all cells around the vertices of the
cells that the rank owns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from namedmesh import partition, parts
from namedmesh.base import checks
from namedmesh.base.exceptions import InputError, together
from namedmesh.base.releases import cell_nodes
from namedmesh.bodies import Bodies, Geometry
from namedmesh.copies import is_pinched, number_nodes, same_ranks, stay_closed
from namedmesh.files.of_dolfinx import has_other_cells, simplicial
from namedmesh.interface_map import Interface
from namedmesh.joining import alike, joint
from namedmesh.naming import NamedShape, Rules, name_parts, name_regions, part_measures
from namedmesh.parts_table import Parts, parts_of
from namedmesh.periodic import PeriodicPair, across, linked_edges
from namedmesh.refinement import refine
from namedmesh.sides import connect_facets
from namedmesh.size_field import labels_of, size_field, sizes_at_nodes
from namedmesh.splitting import (
    NO_INTERFACE,
    CarriedTables,
    check_opened,
    claim_facets,
    side_tags,
    touching_regions,
)
from namedmesh.surface import snap
from namedmesh.tags import share_tags, tag_table, tags_of
from namedmesh.touching import Pairs, touching
from namedmesh.transfer import spread
from namedmesh.where import Rule


@dataclass(frozen=True, eq=False, repr=False)
class Domain(Bodies):
    """Hold a mesh whose parts have names.

    Args:
        mesh: Straight-sided triangles in 2D or tetrahedra in 3D. Quadrilaterals,
            hexahedra and cells of higher order are split into such simplices, at their
            corners. Where cells meet at a vertex or an edge without a common facet,
            they get nodes of their own, as such a hinge transmits no force. Under MPI a
            mesh without complete vertex patches is distributed anew. Use
            ``domain.mesh`` afterwards, not the mesh that you gave.
        facet_tags: Tags of boundary facets. A mesh without tags can be named by rules,
            see :meth:`named`.
        names: Name of each boundary part -> its tag.
        cell_tags: Tags of cells, or None.
        regions: Name of each cell region -> its tag.
        geometry: The true shape of the body. It is None if only the mesh is known. The
            body is then the mesh with its flat facets.
        curved_facets: Tags of the facets on the boundary and on interfaces of a curved
            body: the number of the curve or surface of the geometry on which a facet
            lies. None if the body is not curved, or not known.
        glued: The domain from which this one was split, see :meth:`split`, or None.
        interface_map: What relates the nodes and cells of both, or None.
        places: Places of the corners of the cells [length], shape (cells, d+1, d), of a
            glued domain whose bodies keep their shapes, or None.
        periodic: Pairs of sides at which copies follow each other, see
            :meth:`with_periodic`.

    Raises:
        InputError: If the mesh does not fill its space, a cell cannot be split, names
            and tags do not fit, or no facet has the tag of a name. A part may have
            facets inside the body, as an interface has, but a scene cannot use it.

    Example:
        >>> block
        <Domain in 2D: 16 cells, boundary parts left, right, bottom, top>
        >>> block.refined(np.array([0], dtype=np.int32)).cells
        20
    """

    glued: Domain | None = field(default=None, repr=False)
    _is_torn: InitVar[bool] = field(default=False, kw_only=True)
    """Whether no cells meet at a vertex or an edge alone; ``replace`` forgets it."""

    def __post_init__(self, _is_torn: bool) -> None:
        if not isinstance(self.mesh, dmesh.Mesh):
            raise InputError(
                f"Domain: mesh is {checks.description(self.mesh)}; give a mesh of DOLFINx, or use "
                "read_mesh, rectangle, box."
            )
        parts.check_names(self.names, self.regions)
        if has_other_cells(self.mesh):
            mesh, facet_tags, cell_tags = simplicial(self.mesh, self.facet_tags, self.cell_tags)
            self._set(mesh=mesh, facet_tags=facet_tags, cell_tags=cell_tags)
        partition.check_mesh(self.mesh)
        connect_facets(self.mesh)
        if self.facet_tags is None and not self.names:
            none = np.empty(0, dtype=np.int32)
            self._set(facet_tags=tags_of(self.mesh, self.dim - 1, none, none))
        parts.check_tags(self.mesh, self.facet_tags, self.names, self.cell_tags, self.regions)
        if self.comm.size > 1:
            self._complete()
        if not _is_torn and self.interface_map is None and is_pinched(self.mesh):
            self._tear()
        self._inside.update(parts.parts_inside(self.mesh, self.facet_tags, self.names))

    def _complete(self) -> None:
        """Give every rank complete vertex patches with all their tags; collective."""
        mesh = self.mesh
        tag_sets = (self.facet_tags, self.cell_tags, self.curved_facets)
        new = [share_tags(self.comm, mesh, tags) for tags in tag_sets]
        if self.interface_map is None and not partition.patches_complete(mesh):
            mesh, new = partition.redistribute(mesh, *new)
        facet_tags, cell_tags, curved_facets = new
        self._set(
            mesh=mesh, facet_tags=facet_tags, cell_tags=cell_tags, curved_facets=curved_facets
        )

    def _tear(self) -> None:
        """Tear the mesh where cells meet at a vertex or an edge alone; collective."""
        mesh = self.mesh
        numbers, x = number_nodes(mesh)
        new = partition.distribute(mesh.comm, numbers, x, same_ranks(mesh))
        connect_facets(new)
        carried = CarriedTables(mesh, new, numbers)
        self._set(
            mesh=new,
            facet_tags=carried.marks(self.facet_tags),
            curved_facets=carried.marks(self.curved_facets),
            cell_tags=carried.cell_tags(self.cell_tags),
            places=None if self.places is None else carried.of_corners(self.places),
            marks=None if self.marks is None else carried.of_sides(self.marks),
        )

    def _set(self, **members: Any) -> None:
        """Set members of the domain while it is made, which is frozen afterwards."""
        for name, value in members.items():
            object.__setattr__(self, name, value)

    def parts(self) -> Parts:
        """List the parts: facets, area, centre, mean normal, regions; collective.

        See :class:`Parts`, which prints as a table and has columns.

        Example:
            >>> print(block.parts())
            part    facets  area  centre    mean normal
            left         2     1  (0, 0.5)  (-1, 0)
            ...
        """
        return parts_of(self)

    def named(
        self,
        parts: Mapping[str, Rule] | None = None,
        *,
        regions: Mapping[str, Rule] | None = None,
    ) -> Domain:
        """Name parts of the boundary, and regions, by rules; collective.

        A rule is a function of points x, shape (3, n), that returns n truth values, as
        DOLFINx's ``locate_entities_boundary`` takes it; or a :class:`where`; or a list
        of these, of which one must hold. A part has the facets of the boundary at all
        whose vertices its rule holds, a region the cells at whose vertices and midpoint
        it does.

        Each facet has one name: what has another name takes the new one, and the older
        part keeps what remains. A name that the domain has is given anew. Sides of
        pairs stay as they are. Refinement keeps the names. On meshes that ``remeshed``
        makes, the rules are asked again.

        Args:
            parts: Name of each part -> its rule.
            regions: Name of each region -> its rule, a function or ``where`` of places.
                Regions are named before the domain is split.

        Returns:
            The same mesh with these names.

        Raises:
            InputError: If a rule holds nowhere, two hold at the same place, or one
                cannot be worked with.

        Example:
            >>> block.named({"foot": lambda x: np.isclose(x[1], 0.0)})
            <Domain in 2D: 16 cells, boundary parts left, right, top, foot>
            >>> block.named({"pad": ec.where(y=1.0, x=(0.5, 1.5))})
            <Domain in 2D: 16 cells, boundary parts left, right, bottom, top, pad>
        """
        rules = together(self.comm, Rules.of, parts, regions)
        together(self.comm, rules.check_before, self.interfaces)
        result = self.whole.renamed(rules, joint.last_tag(self), self.interfaces)
        return result if self.glued is None else result.cut(self.interfaces)

    def renamed(
        self, rules: Rules, last_tag: int, interfaces: tuple[Interface, ...] = ()
    ) -> Domain:
        """Name parts and regions of a mesh that is not split; collective.

        Args:
            rules: The rules, see :meth:`named`.
            last_tag: The greatest tag of a facet that is used.
            interfaces: Interfaces along which the mesh will be split; they keep their
                facets.
        """
        cell_tags, regions = name_regions(self, rules.regions)
        # Parts with other facets are other sides of copies.
        result = replace(self, cell_tags=cell_tags, regions=regions, periodic=())
        if rules.parts:
            taken = np.zeros(len(tag_table(self.facet_tags)), dtype=bool)
            if interfaces:
                taken = claim_facets(self.mesh, self.facet_tags, self.cell_tags, interfaces)
                taken = taken != NO_INTERFACE
            facet_tags, names = name_parts(result, rules.parts, taken, last_tag)
            result = replace(result, facet_tags=facet_tags, names=names)
        if self.geometry is None:
            return result
        known = labels_of(self, self.curved_facets)
        sizes = part_measures(result, rules)
        shape = NamedShape(self.geometry, known, rules, last_tag, sizes)
        return replace(result, geometry=shape)

    def snapped(self) -> Domain:
        """Put the vertices of a new mesh on the true shape, in place; collective.

        Returns:
            The same domain, whose mesh no other object uses yet.
        """
        if self.curved_facets is not None and self.geometry is not None:
            snap(self.mesh, self.curved_facets, self.geometry)
        return self

    def split(self, sides: Mapping[str, str] | None = None, *, on: str | None = None) -> Domain:
        """Split the nodes along the facets between regions; collective.

        The facets become two boundary parts that face each other facet by facet, also
        after ``refined`` and ``remeshed``. The rim of the interface, where it ends
        inside a body, keeps its nodes, and a facet all of whose vertices are on the rim
        stays closed. Parts inside the body whose facets are all split
        are no longer there.

        Args:
            sides: Name of each new boundary part -> the region on its side. None
                splits between all regions that share facets: of "nut" and "bolt" the
                parts are "nut on bolt" and "bolt on nut". Regions that touch along a
                line or at a point only are kept apart then, too.
            on: Name of a part inside the body: only its facets are split. None splits
                all facets between the regions.

        Returns:
            The split domain. It can be split again, between other regions.

        Raises:
            InputError: If there are not two sides of two regions that share facets, a
                name is not new, or no part is called ``on``.

        Example:
            >>> bodies.split({"punch": "upper", "base": "lower"})
            <Domain in 2D: 16 cells, ..., pairs punch/base of 4 facets>
        """
        if sides is None and on is None:
            return self._split_everywhere()
        taken = self.whole.names
        together(self.comm, parts.check_sides, sides, on, self.names, taken, self.regions)
        tag = joint.last_tag(self) + 1
        assert sides is not None
        here, there = sides
        regions = (self.regions[sides[here]], self.regions[sides[there]])
        on_tag = None if on is None else self.names[on]
        interface = Interface((here, there), (tag, tag + 1), regions, on_tag)
        return self.whole.cut((*self.interfaces, interface))

    def _split_everywhere(self) -> Domain:
        """Split between all regions that share facets; collective."""
        glued = self.whole
        interfaces = self.interfaces
        if glued.cell_tags is not None:
            assert isinstance(glued.facet_tags, dmesh.MeshTags)
            before = claim_facets(glued.mesh, glued.facet_tags, glued.cell_tags, interfaces)
            name_of = {tag: name for name, tag in self.regions.items()}
            tag = joint.last_tag(self) + 1
            for regions in touching_regions(glued.mesh, glued.cell_tags, before):
                first, second = (name_of[region] for region in regions)
                names = (f"{first} on {second}", f"{second} on {first}")
                sides = dict(zip(names, (first, second), strict=True))
                taken = {**self.names, **glued.names}
                together(self.comm, parts.check_sides, sides, None, taken, taken, self.regions)
                interfaces += (Interface(names, (tag, tag + 1), regions, None),)
                tag += 2
        if len(interfaces) == len(self.pairs):
            return self
        return glued.cut(interfaces)

    def touching(self, *regions: str, within: float = 0.0) -> Pairs:
        """List which parts lie against which, with areas and distances; collective.

        Each row is a pair of parts, which a contact or a tied joint takes as it is::

            contacts = [ec.Contact(*pair, friction=0.15) for pair in bodies.touching()]

        Args:
            regions: Name of a region, or a pattern such as ``"nut *"``: only pairs of
                which one part belongs to it. Two names: only pairs between them.
            within: Greatest distance [length]: parts that are no pair and as near as
                that are listed, too. :meth:`joined` makes pairs of them (``apart=``).

        Raises:
            InputError: If no region has such a name, or the distance is negative.

        Example:
            >>> print(bodies.split().touching())
            part            against         area  distance
            lower on upper  upper on lower     2         0
        """
        return touching(self, regions, within)

    def joined(self, here: str, there: str, *, tied: bool = False, apart: float = 0.0) -> Domain:
        """Glue two bodies that were meshed apart, and split them there; collective.

        The parts lie against each other, at least in places. There their facets become
        a pair, as :meth:`split` makes it, which keeps the names of both parts. What
        remains of a part is called "... outside". If vertices do not match, vertices of
        ``there`` move to close ones of ``here``, and cells are cut (in 2D), or the
        regions behind the parts are meshed again (in 3D). There the body of ``there``
        takes the facets of ``here``, or, if that reaches beyond, the other way round.

        If the true shape of the bodies is known, ``remeshed`` meshes each of them and
        joins them again. Refinement keeps the flat facets of curved sides that lie in
        one place; sides that are apart get their new vertices on their own true curves.

        Args:
            here: Name of a part of the boundary of one body.
            there: Name of the part of another body that lies against it.
            tied: Leave the bodies glued there. The joint is a part inside, then.
            apart: Greatest distance of the parts [length]: they are modelled with a
                clearance or an interference. Each keeps its place, and their distance
                along the normal is the gap, to which ``gap=`` of the contact adds. Two
                parts move onto each other all the same if they are tied, or in 3D if
                their facets do not match, which a warning says: then ``gap=`` gives the
                distance.

        Returns:
            The domain with the pair. Its other parts can be joined or split, too.

        Raises:
            InputError: If the parts are not two parts of the boundary in different
                regions, or do not lie against each other.

        Example:
            >>> base = ec.rectangle((0.0, -1.0), (3.0, 0.0), cells=(5, 2))
            >>> both = ec.assembly({"block": block, "base": base})
            >>> both.joined("block bottom", "base top").pairs
            (('block bottom', 'base top'),)
        """
        glued = self.whole
        comm = self.comm
        together(comm, joint.check_parts, here, there, glued, self.pairs, apart)
        on = joint.last_tag(self) + 1
        found = joint.joint(glued, here, there, on, tied=tied, apart=apart)
        interfaces = together(comm, joint.interfaces, self.interfaces, found.interface, tied)
        shape = None
        if isinstance(glued.geometry, Geometry):
            shape = glued.geometry.with_joint(glued, (here, there, on, tied, apart))
        tables = spread(comm, found.plain)
        whole = Domain(names=found.names, regions=self.regions, geometry=shape, **tables)
        return whole.cut(interfaces) if interfaces else whole

    def tied(self, ties: Sequence[tuple[str, str]]) -> Domain:
        """Glue exactly these pairs of parts, as a scene asks; collective.

        Args:
            ties: Names of the parts of each :class:`Tied`.

        Raises:
            InputError: If two parts are no pair of this domain.
        """
        interfaces = joint.tie_alone(self.interfaces, ties)
        return self if interfaces == self.interfaces else self.whole.cut(interfaces)

    def cut(self, interfaces: tuple[Interface, ...]) -> Domain:
        """Split the nodes of a glued mesh along all its interfaces; collective.

        Raises:
            InputError: If an interface has no facet.
        """
        mesh = self.mesh
        assert self.cell_tags is not None
        interface_of_facet = claim_facets(mesh, self.facet_tags, self.cell_tags, interfaces)
        tied = [number for number, interface in enumerate(interfaces) if interface.tied]
        # Facets of tied joints keep their nodes and the tags that they have.
        cut = np.where(np.isin(interface_of_facet, tied), NO_INTERFACE, interface_of_facet)
        closed = stay_closed(mesh, cut != NO_INTERFACE)
        cut[closed] = NO_INTERFACE
        interface_of_facet[closed] = NO_INTERFACE
        check_opened(mesh, interfaces, interface_of_facet)
        numbers, x = number_nodes(mesh, cut != NO_INTERFACE, self.places)
        new = partition.distribute(mesh.comm, numbers, x, same_ranks(mesh))
        connect_facets(new)
        carried = CarriedTables(mesh, new, numbers)
        whole = self
        curved = carried.marks(self.curved_facets)
        if self.places is not None:
            carried.check_places(self.places)
        if self.marks is not None and self.geometry is not None:
            # Each body has its own true shape.
            curved = carried.facet_tags(self.marks)
            snap(new, curved, self.geometry)
            whole = replace(self, places=carried.places())
        tags = side_tags(mesh, self.facet_tags, self.cell_tags, interfaces, cut)
        facet_tags = carried.facet_tags(tags)
        of_sides = side_tags(mesh, self.facet_tags, self.cell_tags, interfaces, interface_of_facet)
        names = dict(self.names)
        for interface in interfaces:
            names.update(zip(interface.names, interface.tags, strict=True))
        return Domain(
            new,
            facet_tags,
            parts.with_facets(new, facet_tags, names),
            carried.cell_tags(self.cell_tags),
            self.regions,
            self.geometry,
            curved,
            whole,
            carried.interface_map(interfaces, of_sides, keep=self.places is not None),
            periodic=self.periodic,
        )

    def with_periodic(self, pairs: Sequence[PeriodicPair]) -> Domain:
        """Return the domain with exactly these pairs of sides of copies; collective.

        Refinement keeps the pairs: it splits both sides alike. On several ranks the
        mesh is distributed anew, so that a side and its image are on one rank.

        Args:
            pairs: The pairs, whose facets match.

        Raises:
            InputError: If facets do not match, or bodies were joined that are apart,
                and there are several ranks.

        Example:
            >>> pair = nm.translated(block, "left", "right")
            >>> here, there = block.with_periodic([pair]).facing("left", "right")
            >>> len(here)
            2
        """
        kept = zip(pairs, self.periodic, strict=False)
        if len(pairs) == len(self.periodic) and all(a.is_near(b, self.extent) for a, b in kept):
            return self
        whole = self.whole
        if self.comm.size > 1 and pairs:
            if whole.places is not None:
                raise InputError(
                    "Bodies that were joined with apart= keep their places on one rank only beside"
                    " periodic sides; run it on one rank, or join the bodies where they touch."
                )
            tag_sets = (whole.facet_tags, whole.cell_tags, whole.curved_facets)
            ranks = across(whole, pairs)
            mesh, tags = partition.redistribute(whole.mesh, *tag_sets, ranks=ranks)
            facet_tags, cell_tags, curved = tags
            whole = replace(
                whole, mesh=mesh, facet_tags=facet_tags, cell_tags=cell_tags, curved_facets=curved
            )
        whole = replace(whole, periodic=tuple(pairs))
        return whole.cut(self.interfaces) if self.interfaces else whole

    def matched(self, pairs: Sequence[PeriodicPair]) -> Domain:
        """Give the sides of pairs facets that match, on rank 0; collective.

        Two copies of the body are joined as :meth:`joined` joins two bodies: in the
        plane both sides are cut at the vertices of both, and in 3D they get common
        facets where they are plane, with the regions behind them meshed anew.

        Args:
            pairs: The pairs of sides.

        Returns:
            The domain with these pairs.

        Raises:
            InputError: If sides of a pair do not lie on each other as copies, or bodies
                were joined that are apart.

        Example:
            >>> alike = block.matched([nm.translated(block, "left", "right")])
            >>> alike.pairs
            ()
        """
        whole = self.whole
        plain = alike.with_matching_sides(whole, tuple(pairs), joint.glue_sides)
        tables = spread(self.comm, plain)
        if not whole.regions:
            tables["cell_tags"] = None
        result = replace(whole, **tables, periodic=())
        result = result.with_periodic(pairs)
        return result.cut(self.interfaces) if self.interfaces else result

    def refined(self, marked: np.ndarray | None = None) -> Domain:
        """Refine by bisection of longest edges (DOLFINx), conforming; collective.

        The names stay, the new mesh is balanced over the ranks, and every rank has
        complete vertex patches. If the true shape is known and curved, new vertices on
        its boundary and on interfaces are moved onto it.

        Args:
            marked: Numbers of cells of this rank, shape (n,); None refines all cells.

        Returns:
            The refined domain.

        Raises:
            InputError: If ``marked`` are not numbers of cells of this rank.
        """
        cells = together(self.comm, checks.cells_to_refine, marked, self.owned_cells)
        if self.glued is not None and self.interface_map is not None:
            return self.glued.refined(self.interface_map.cells[cells]).cut(self.interfaces)
        links = [linked_edges(self, pair, self.facing(*pair.names)) for pair in self.periodic]
        axis = next((pair.axis for pair in self.periodic if pair.axis is not None), None)
        refinement = refine(self.mesh, cells, partition.partitioner(self.comm), links, axis)
        fine = refinement.mesh
        facet_tags = refinement.inherit_tags(self.facet_tags)
        cell_tags = refinement.inherit_tags(self.cell_tags)
        curved = refinement.inherit_tags(self.curved_facets)
        if curved is not None and self.geometry is not None:
            snap(fine, curved, self.geometry)
        places = None
        if self.places is not None:
            corners = self.mesh.geometry.x[cell_nodes(self.mesh.geometry)]
            places = refinement.places(corners, self.places)
        marks = None if self.marks is None else refinement.of_sides(self.marks)
        finer = Domain(
            fine,
            facet_tags,
            self.names,
            cell_tags,
            self.regions,
            self.geometry,
            curved,
            places=places,
            marks=marks,
            # Cells that were split still meet at facets where their parents did.
            _is_torn=True,
        )
        return finer.with_periodic(self.periodic)

    def remeshed(self, sizes: npt.ArrayLike) -> Domain:
        """Mesh the true geometry again with other sizes, by gmsh on rank 0; collective.

        The names stay, and curved boundaries get new vertices. Where the sizes are
        larger, the new mesh is coarser. Periodic sides are meshed alike.

        Args:
            sizes: Edge h of the simplices that are wanted [length]: one number, or a
                value at each node ``mesh.geometry.x`` of this rank, shape (n,), with h
                linear between the nodes. The number of cells is ``int c / h^d`` with c
                = 4/sqrt(3) in 2D and 5 in 3D. gmsh meets it to within 2% in 2D and 5%
                in 3D if cells are small beside the body. Around a circle or a curved
                surface there are 6 edges at least, whatever the sizes, unless it is
                small beside them.

        Returns:
            The domain on the new mesh.

        Raises:
            InputError: If the geometry is not known, a size is not > 0 and finite, gmsh
                fails, or its curves or surfaces at periodic sides do not match.
        """
        nodes = len(self.mesh.geometry.x)
        h = together(self.comm, sizes_at_nodes, sizes, nodes)
        if self.geometry is None:
            raise InputError(
                "The true geometry of this domain is not known, only its mesh; refine it by "
                "marking (strategy=Mark()), or make it by rectangle, box, from_gmsh, or "
                "read_mesh of a .geo file."
            )
        if self.glued is not None and self.interface_map is not None:
            return self.glued.remeshed(self.interface_map.least(h)).cut(self.interfaces)
        labels = replace(labels_of(self, self.curved_facets), periodic=self.periodic)
        new = self.geometry.meshed_by(self, size_field(self, h), labels)
        return new.with_periodic(self.periodic)
