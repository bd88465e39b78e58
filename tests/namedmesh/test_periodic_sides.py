"""Sides of copies: facets that face each other by a motion, on any ranks and when refined.

Properties: each facet has a partner at its image, to round-off, after any refinement and
on a mesh that is made anew, on plane and curved sides; the mesh does not depend on the ranks, and patches are complete; what does not match is
told on all ranks.
"""

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.partition import patches_complete
from namedmesh.simplex import measures, of_facets

import gmsh  # isort: skip - after namedmesh, as all that is compiled

COMM = MPI.COMM_WORLD
SECTORS = 7


def sector(cells, comm=COMM):
    """A sector of a ring about the last axis: radius 1 to 2, sides front and back, or bottom and top."""
    d = len(cells)
    make = nm.rectangle if d == 2 else nm.box
    brick = make((0.0,) * d, (1.0,) * d, cells=cells, comm=comm)
    x = brick.mesh.geometry.x
    radius, angle = 1.0 + x[:, 0], 0.2 + 2 * np.pi / SECTORS * x[:, 1]
    x[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return nm.Domain(brick.mesh, brick.facet_tags, brick.names)


def periodic_brick(cells, comm=COMM):
    """A brick that is repeated along all axes."""
    d = len(cells)
    make = nm.rectangle if d == 2 else nm.box
    brick = make((0.0,) * d, (2.0, *(1.0,) * (d - 1)), cells=cells, comm=comm)
    sides = [("left", "right"), ("bottom", "top"), ("front", "back")][:d]
    return brick.with_periodic([nm.translated(brick, *names) for names in sides])


def cyclic_sector(cells, comm=COMM):
    """A sector with its turn."""
    body = sector(cells, comm)
    axis = [(0.0, 0.0)] if len(cells) == 2 else [(0.0, 0.0, 3.0), (0.0, 0.0, 2.0)]
    sides = ("bottom", "top") if len(cells) == 2 else ("front", "back")
    return body.with_periodic([nm.turned(body, *sides, axis, SECTORS)])


def misfit(domain, pair):
    """Greatest distance of a corner of a facet from the nearest one of its partner's."""
    nodes = cell_nodes(domain.mesh.geometry)
    x = domain.mesh.geometry.x[:, : domain.dim]
    here, there = (
        x[of_facets(nodes[sides[:, 0]], sides[:, 1])] for sides in domain.facing(*pair.names)
    )
    away = np.linalg.norm(pair.image(here)[:, :, None] - there[:, None], axis=-1)
    return COMM.allreduce(float(away.min(axis=2).max(initial=0.0)), MPI.MAX)


def refined_near_points(domain, steps):
    """The domain refined in balls about random points."""
    rng = np.random.default_rng(3)
    for _ in range(steps):
        nodes = cell_nodes(domain.mesh.geometry)[: domain.owned_cells]
        middles = domain.mesh.geometry.x[nodes].mean(axis=1)[:, : domain.dim]
        low, high = domain.corners
        centre = low + rng.random(domain.dim) * (high - low)
        near = np.linalg.norm(middles - centre, axis=1) < 0.25 * domain.extent
        domain = domain.refined(np.flatnonzero(near).astype(np.int32))
    return domain


@pytest.mark.parametrize("make", [periodic_brick, cyclic_sector])
@pytest.mark.parametrize(("cells", "steps"), [((4, 3), 4), ((2, 2, 1), 2)], ids=["2D", "3D"])
def test_sides_are_refined_alike(make, cells, steps):
    coarse = make(cells)
    domain = refined_near_points(coarse, steps)
    assert domain.periodic == coarse.periodic
    assert patches_complete(domain.mesh)
    for pair in domain.periodic:
        assert misfit(domain, pair) < 1e-14 * domain.extent
        for name in pair.names:
            assert len(domain.facing(*pair.names)[0]) > 0 or COMM.size > 1
            owned = COMM.allreduce(len(domain.owned_facets(name)))
            before = COMM.allreduce(len(coarse.owned_facets(name)))
            assert owned > before


@pytest.mark.ranks
@pytest.mark.parametrize("make", [periodic_brick, cyclic_sector])
def test_the_mesh_does_not_depend_on_the_ranks(make):
    both = [refined_near_points(make((2, 2, 1), comm), 2) for comm in (MPI.COMM_SELF, COMM)]
    alone, together = (
        sorted(
            map(tuple, np.round(np.concatenate(domain.comm.allgather(domain.mesh.geometry.x)), 9))
        )
        for domain in both
    )
    assert set(alone) == set(together)
    assert both[0].cells == both[1].cells


def test_what_does_not_match_is_told():
    rectangle = nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    one_side = rectangle.named({"half": nm.where(x=0.0, y=(0.0, 0.5))})
    pair = nm.translated(one_side, "half", "right")
    refused(
        lambda: one_side.with_periodic([pair]).facing("half", "right"),
        "do not match",
        "setPeriodic",
    )
    # Parts that are named anew are no sides of copies until they are asked for again.
    by_rules = periodic_brick((4, 2)).named({"low": nm.where(x=0.0), "high": nm.where(x=2.0)})
    assert by_rules.periodic == ()
    by_rules = by_rules.with_periodic([nm.translated(by_rules, "low", "high")])
    refused(lambda: by_rules.remeshed(0.1), "low and high", "Mark()")


@pytest.mark.parametrize("d", [2, 3])
def test_sides_that_do_not_match_become_alike(d):
    """Bricks of cells of two sizes, one behind the other, whose ends differ."""
    make = nm.rectangle if d == 2 else nm.box
    corners = [((0.0,) * d, (1.0,) * d), ((1.0, *(0.0,) * (d - 1)), (2.0, *(1.0,) * (d - 1)))]
    coarse, fine = (
        make(*ends, cells=(2, *(count,) * (d - 1)))
        for ends, count in zip(corners, (2, 3), strict=True)
    )
    brick = nm.assembly({"coarse": coarse, "fine": fine})
    brick = brick.joined("coarse right", "fine left", tied=True)
    pair = nm.translated(brick, "coarse left", "fine right")
    refused(lambda: brick.with_periodic([pair]).facing(*pair.names), "do not match", "matched")
    domain = brick.matched([pair])
    assert misfit(domain, pair) < 1e-14 * domain.extent
    here, _ = domain.facing(*pair.names)
    areas = domain.flat_areas(here[here[:, 0] < domain.owned_cells])
    assert np.isclose(COMM.allreduce(areas.sum()), 1.0, rtol=1e-12)
    assert domain.regions == brick.regions
    areas = [each.parts().area.sum() for each in (brick, domain)]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)
    assert misfit(domain.refined(), pair) < 1e-14 * domain.extent
    shifted = nm.PeriodicPair(pair.names, pair.rotation, (5.0, *pair.shift[1:]))
    refused(lambda: brick.matched([shifted]), "do not become alike")


def curved_sector(d):
    """A sector of a ring whose sides are curved, of other sizes on both sides."""
    turn, radii = 2 * np.pi / SECTORS, np.linspace(1.0, 2.0, 5)
    if COMM.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        centre = occ.addPoint(0, 0, 0)
        sides = []
        for angle in (0.0, turn):
            angles = angle + 0.25 * np.sin(np.pi * (radii - 1.0))
            x, y = radii * np.cos(angles), radii * np.sin(angles)
            sides.append(
                [occ.addPoint(*at, 0, 0.18 - 0.05 * angle) for at in zip(x, y, strict=True)]
            )
        (low_in, *_, low_out), (cut_in, *_, cut_out) = sides
        low, cut = (occ.addSpline(points) for points in sides)
        inner = occ.addCircleArc(low_in, centre, cut_in)
        outer = occ.addCircleArc(low_out, centre, cut_out)
        plane = occ.addPlaneSurface([occ.addCurveLoop([low, outer, -cut, -inner])])
        parts = {"low": low, "outer": outer, "cut": cut, "inner": inner}
        if d == 3:
            made = occ.extrude([(2, plane)], 0, 0, 0.5)
            parts = dict(zip(parts, [tag for _, tag in made[2:]], strict=True))
        occ.synchronize()
        for name, tag in parts.items():
            gmsh.model.addPhysicalGroup(d - 1, [tag], name=name)
        gmsh.model.addPhysicalGroup(d, [made[1][1] if d == 3 else plane], name="body")
    domain = nm.from_gmsh(gmsh.model)
    if COMM.rank == 0:
        gmsh.finalize()
    return domain


@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_curved_sides_become_alike(d):
    """The body keeps its true shape: refined, it comes nearer to the volume."""
    body = curved_sector(d)
    axis = [(0.0, 0.0)] if d == 2 else [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    pair = nm.turned(body, "low", "cut", axis, SECTORS)
    refused(lambda: body.with_periodic([pair]).facing("low", "cut"), "do not match")
    domain = body.matched([pair])
    volume = 3 * np.pi / SECTORS * 0.5 ** (d - 2)
    missing = []
    for each in (domain, domain.refined()):
        assert misfit(each, pair) < 1e-12 * each.extent
        nodes = cell_nodes(each.mesh.geometry)[: each.owned_cells]
        whole = COMM.allreduce(float(measures(each.mesh.geometry.x[nodes, :d]).sum()))
        missing.append(abs(whole - volume))
    assert missing[1] < 0.5 * missing[0]
    assert misfit(refined_near_points(domain, 1), pair) < 1e-12 * domain.extent
    assert misfit(domain.remeshed(0.3), pair) < 1e-12 * domain.extent


@pytest.mark.parametrize("cells", [(4, 3), (2, 2, 1)], ids=["2D", "3D"])
def test_sides_are_meshed_alike(cells):
    coarse = periodic_brick(cells)
    sizes = 0.2 + 0.1 * np.linalg.norm(coarse.mesh.geometry.x - 0.3, axis=1)
    domain = coarse.remeshed(sizes)
    assert domain.cells > 2 * coarse.cells
    assert patches_complete(domain.mesh)
    for pair in domain.periodic:
        assert misfit(domain, pair) < 1e-14 * domain.extent
    assert len(domain.periodic) == len(cells)
    assert misfit(domain.refined(), domain.periodic[0]) < 1e-14 * domain.extent
