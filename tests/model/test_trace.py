"""The displacement of a contact and what is made of it.

One linear map and its transpose.

- on a foundation it is the displacement of the facets; in a history its tangential part
  counts from the last step;
- between two bodies that touch with equal facets it is their jump, whatever the order
  of the vertices, and forces come back opposite on both sides; map and transpose agree
  to round-off on any number of ranks;
- no other module of the method takes the trace on a contact, its coefficients or its
  stiffness.
"""

import re
from dataclasses import replace
from pathlib import Path

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import graph
from dolfinx import mesh as dmesh
from mpi4py import MPI

import erc_contact as ec
from erc_contact.model.contact.trace import Trace
from erc_contact.model.data.over_ranks import sums_of_cells
from erc_contact.model.promises import bind
from namedmesh.base.releases import cell_nodes
from namedmesh.simplex import bernstein, nodes

COMM = MPI.COMM_WORLD
PACKAGE = Path(ec.__file__).parent


N = 3
"""Squares along an edge of a box."""


def touching_boxes(d: int) -> ec.Domain:
    """Two boxes of one mesh that touch at x = 1 with equal facets and share no vertex.

    The right box is the mirror image of the left one, with its vertices in another
    order. Cells that are mirror images of each other are on one rank, so that each
    facet of the contact has its partner there.
    """
    make = dmesh.create_rectangle if d == 2 else dmesh.create_box
    left = make(MPI.COMM_SELF, [(0.0,) * d, (1.0,) * d], [N] * d)
    x = left.geometry.x[:, :d]
    cells = cell_nodes(left.geometry).astype(np.int64)
    mirrored = np.column_stack([2.0 - x[:, 0], x[:, 1:]])
    both = np.vstack([cells, cells[:, ::-1] + len(x)])
    owner = np.tile(np.arange(len(cells)) * COMM.size // len(cells), 2)

    def partition(comm, parts, cell_types, of_rank):
        """Send a cell to its owner, and to the owners of cells at its vertices."""
        count = len(of_rank[0]) // (d + 1)
        ranks = []
        for cell in range(count):
            neighbours = np.isin(both, both[cell]).any(axis=1)
            others = np.setdiff1d(owner[neighbours], owner[cell])
            ranks.append([owner[cell], *others])
        offsets = np.cumsum([0, *(len(r) for r in ranks)]).astype(np.int32)
        return graph.adjacencylist(
            np.concatenate([[], *ranks]).astype(np.int32), offsets
        )._cpp_object

    mine = slice(None) if COMM.rank == 0 else slice(0)
    element = basix.ufl.element("Lagrange", ("triangle", "tetrahedron")[d - 2], 1, shape=(d,))
    mesh = dmesh.create_mesh(
        COMM, both[mine], ufl.Mesh(element), np.vstack([x, mirrored])[mine], partition
    )
    mesh.topology.create_connectivity(d - 1, d)
    bottom = dmesh.locate_entities_boundary(mesh, d - 1, lambda x: np.isclose(x[d - 1], 0.0))
    tags = dmesh.meshtags(mesh, d - 1, np.sort(bottom), np.ones(len(bottom), dtype=np.int32))
    domain = ec.Domain(mesh, tags, {"bottom": 1})
    assert domain.mesh is mesh  # not distributed anew
    return domain


def facing_facets(domain: ec.Domain) -> tuple[np.ndarray, np.ndarray]:
    """The facets at x = 1 of the left and of the right box as (cell, local facet), in the same order."""
    mesh, d = domain.mesh, domain.dim
    facets = dmesh.locate_entities(mesh, d - 1, lambda x: np.isclose(x[0], 1.0))
    to_cell = mesh.topology.connectivity(d - 1, d)
    to_facet = mesh.topology.connectivity(d, d - 1)
    cells = np.array([to_cell.links(f)[0] for f in facets], dtype=np.int32)
    local = [
        int(np.flatnonzero(to_facet.links(c) == f)[0]) for c, f in zip(cells, facets, strict=True)
    ]
    pairs = np.column_stack([cells, local]).astype(np.int32).reshape(-1, 2)
    middle = dmesh.compute_midpoints(mesh, d - 1, facets)
    order = np.lexsort(middle.round(9).T)
    is_left = dmesh.compute_midpoints(mesh, d, cells)[:, 0] < 1.0
    return pairs[order][is_left[order]], pairs[order][~is_left[order]]


def two_sided(d: int, degree: int):
    """The space of displacements, and a trace between the two boxes."""
    domain = touching_boxes(d)
    scene = ec.Scene(ec.Elastic(2.0, 0.3), ec.Displacement("bottom", (0.0,) * d))
    model = bind(scene, domain, degree)
    here, there = facing_facets(domain)
    normal = np.tile(np.eye(d)[0], (len(here), 1))
    sides = [model.space.side(facets, model.modulus) for facets in (here, there)]
    return model, Trace(sides[0], sides[1], normal)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
class TestTwoSides:
    """Two boxes that touch."""

    def test_of_is_the_jump(self, d, degree):
        model, trace = two_sided(d, degree)
        count = COMM.allreduce(int(trace.here.owned.sum()))
        assert count == (N if d == 2 else 2 * N**2)
        x = model.space.V.tabulate_dof_coordinates()[:, :d]
        continuous = np.sin(x @ np.arange(1.0, d + 1))[:, None] * np.ones(d)
        assert abs(trace.of(continuous)).max(initial=0.0) <= 1e-14
        # The left box moves away by a known field.
        is_left = np.zeros(len(x), dtype=bool)
        left_cells = x[model.space.nodes].mean(axis=1)[:, 0] < 1.0
        is_left[model.space.nodes[left_cells]] = True
        opened = continuous + np.where(is_left[:, None], x**2 + 0.5, 0.0)
        known = (x**2 + 0.5)[trace.here.nodes]
        assert abs(trace.of(opened) - known).max(initial=0.0) <= 1e-14

    def test_back_is_its_transpose(self, d, degree):
        model, trace = two_sided(d, degree)
        rng = np.random.default_rng(COMM.rank)
        u = rng.standard_normal((model.space.node_count, d))
        forces = rng.standard_normal(trace.of(u).shape)
        nodal = trace.back(forces)
        work = (forces * trace.of(u)).sum()
        assert (nodal * u).sum() == pytest.approx(
            work, abs=1e-14 * abs(forces).sum() * abs(u).max()
        )
        # Action and reaction.
        assert abs(nodal.sum(axis=0)).max() <= 1e-13 * max(abs(forces).sum(), 1.0)

    def test_stiffness_is_that_of_springs_in_a_row(self, d, degree):
        model, trace = two_sided(d, degree)
        alone = replace(trace, there=trace.here.only(slice(0))).stiffness
        assert trace.stiffness == pytest.approx(alone / 2)
        values = np.where(trace.here.owned, np.arange(1.0, len(alone) + 1), 0.0)
        cells = trace.share(values)
        assert cells.sum() == pytest.approx(values.sum())
        # The cells of both sides get their halves from whichever rank has the facet.
        of_owners = sums_of_cells(model.space, cells)
        assert COMM.allreduce(of_owners.sum()) == pytest.approx(COMM.allreduce(values.sum()))
        for side in (trace.here, trace.there):
            owned = side.facets[side.owned, 0]
            assert np.setdiff1d(owned, np.flatnonzero(of_owners)).size == 0


@pytest.mark.parametrize("degree", [1, 2])
def test_foundation(degree):
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    top = ec.Displacement("top", (0.01, -0.02))
    scene = ec.Scene(ec.Elastic(2.0, 0.3), top, contacts=ec.Contact("bottom", friction=0.3))
    method = ec.AugmentedLagrangian()
    first = ec.solve(scene, block, method, degree=degree)
    model = ec.solve(scene, block, method, degree=degree, after=first).model
    trace = model.contact("bottom").trace
    nodal = first.u.x.array.reshape(-1, 2)
    w = trace.of(first.u.x.array)
    assert np.array_equal(w, nodal[model.space.facet_nodes(trace.here.facets)])
    # The normal is vertical: the history takes the tangential component away.
    assert abs(trace.since(first.u.x.array)[..., 0]).max(initial=0.0) <= 1e-15
    assert np.array_equal(trace.since(first.u.x.array)[..., 1], w[..., 1])
    shape = bernstein(1, degree, nodes(1, degree))
    assert np.allclose(shape @ trace.coefficients(w), w, atol=1e-16)
    assert np.allclose(shape @ trace.coefficients(w)[..., 0][..., None], w[..., :1], atol=1e-16)
    assert trace.stiffness == pytest.approx(2.0 / 0.25)
    assert trace.here.owned_areas.sum() == pytest.approx(0.25 * trace.here.owned.sum())
    # The other side has no facets: it gets no forces, and holds no component.
    forces = np.ones(w.shape)
    assert trace.partners.shape == (0, degree + 1)
    assert not trace.back_there(forces).any()
    assert np.array_equal(trace.back(forces), trace.back_here(forces))
    assert trace.fixed(np.ones(nodal.shape, dtype=bool)).all()
    assert trace.share(np.ones(len(w))).sum() == pytest.approx(len(w))


@pytest.mark.parametrize("degree", [1, 2])
def test_jump_of_a_test_function_is_its_variation(degree):
    """The derivative of the jump in a direction v is the jump of v, with a history and without."""
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    top = ec.Displacement("top", (0.01, -0.02))
    scene = ec.Scene(ec.Elastic(2.0, 0.3), top, contacts=ec.Contact("bottom", friction=0.3))
    first = ec.solve(scene, block, degree=degree)
    second = ec.solve(scene, block, degree=degree, after=first)
    for solution in (first, second):
        contact, u = solution.model.contact("bottom"), solution.u
        v, du = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        assert contact.jump(v) is v
        assert contact.jump(du) is du
        twice = 2.0 * v
        assert contact.jump(twice) is twice
        variation = ufl.derivative(contact.jump(u), u, du)
        assert ufl.algorithms.expand_derivatives(variation) == du
    assert contact.jump(u) != u  # the second step has a history


@pytest.mark.serial
def test_only_door_to_the_contact():
    """Modules of the method ask the trace, and take no values at the nodes of a contact by themselves."""
    forbidden = re.compile(
        r"facet_nodes\(\s*(c|contact|t\.contact|traction\.contact)\.facets"
        r"|\]\[\s*(t|traction|contact\.trace\.here)\.nodes"
        r"|\)\[\s*(t|traction|contact\.trace\.here|trace\.here)\.nodes"
        r"|facet_areas\(\s*(c|contact|t\.contact|traction\.contact)\.facets"
        r"|slip_before\(model, c"
        r"|facet_corners\(\s*(c|contact|t\.contact|traction\.contact)\.facets"
        r"|at_middles\([^)]*modulus[^)]*(contact|traction)"
    )
    found = [
        f"{path.relative_to(PACKAGE)}: {match.group(0)}"
        for package in ("model", "newton", "admissible", "error", "run")
        for path in sorted((PACKAGE / package).rglob("*.py"))
        if path.name != "trace.py"
        for match in forbidden.finditer(path.read_text())
    ]
    assert found == []
