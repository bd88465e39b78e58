"""Admissible pairs: each property as a number against a scale, on random scenes in 2D and 3D.

- every element is in equilibrium of forces and moments under its facet tractions and the body force;
- tractions of two elements on a common facet are opposite (one value per facet, seen with two signs);
- sigma^ has these tractions on its facets, is continuous across inner facets of the sub-simplices, and
  div sigma^ + f = 0 in every sub-simplex;
- facet tractions are the loads on Gamma_N and r^ on Gamma_C;
- r^ lies in the Coulomb cone and u^_n <= g at 20 points of every facet.
"""

import basix
import numpy as np
import pytest
import ufl
from dolfinx import la
from mpi4py import MPI
from scenes import greco, random_scene, resultant

import erc_contact as ec
from erc_contact.admissible import Admissible, facet_order, nodal_forces, signed, tensors
from erc_contact.admissible.contact import split
from erc_contact.admissible.macro import macro_stress, reference_map
from erc_contact.model import evaluate, facet_vertices

SEEDS = range(8)
BALANCE = 1e-10
CONE = 1e-12


@pytest.fixture(scope="module", params=SEEDS)
def pair(request: pytest.FixtureRequest) -> Admissible:
    scene, domain = random_scene(request.param)
    return ec.equilibrate(ec.solve(scene, domain))


def worst(pair: Admissible, values: np.ndarray) -> float:
    return pair.solution.model.comm.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)


def owned_moments(pair: Admissible) -> np.ndarray:
    return signed(pair.cells, pair.moment)[: pair.solution.domain.owned_cells]


def test_elements_balance_forces(pair):
    moment = owned_moments(pair)
    force = moment.sum(axis=(1, 2)) + pair.force[: len(moment)]
    assert worst(pair, force) < BALANCE * worst(pair, moment)


def test_elements_balance_moments(pair):
    moment, cells, d = owned_moments(pair), pair.cells, pair.cells.d
    x = pair.solution.model.V.tabulate_dof_coordinates()[:, :d][cells.nodes[: len(moment)]]
    arm = x - x.mean(axis=1, keepdims=True)  # the constant body force has no moment about the barycentre
    dyad = sum(np.einsum("nmi,nmj->nij", arm[:, v], moment[:, i]) for i, v in enumerate(facet_vertices(d)))
    assert worst(pair, dyad - dyad.transpose(0, 2, 1)) < BALANCE * worst(pair, moment) * worst(pair, arm)


def test_opposite_tractions_between_ranks(pair):
    """Both ranks that see a facet compute its traction themselves; the values must agree."""
    model = pair.solution.model
    facets = model.mesh.topology.index_map(model.d - 1)
    size = np.linalg.norm(pair.moment.sum(axis=1), axis=1)
    complete = np.zeros(len(size), dtype=bool)
    complete[pair.cells.facets[: model.domain.owned_cells]] = True
    vector = la.vector(facets, dtype=np.float64)
    vector.array[:] = np.where(complete, size, 0.0)
    vector.scatter_forward()
    ghosts = np.arange(len(size)) >= facets.size_local
    seen = complete & ghosts & (vector.array > 0)
    assert worst(pair, (vector.array - size)[seen]) < BALANCE * worst(pair, size)


def test_stress_has_the_facet_tractions(pair):
    moment, cells, d = owned_moments(pair), pair.cells, pair.cells.d
    stress, force = tensors(pair.stress, d), nodal_forces(moment)
    for i, vertices in enumerate(facet_vertices(d)):
        on_facet = np.einsum("nmij,nj->nmi", stress[:, i, vertices], cells.area[: len(moment), i])
        assert worst(pair, on_facet - force[:, i]) < BALANCE * worst(pair, force)


def test_stress_is_in_equilibrium_inside(pair):
    cells, d, count = pair.cells, pair.cells.d, len(pair.stress)
    stress = tensors(pair.stress, d)
    gradient = -cells.area[:count] / (d * cells.volume[:count, None, None])  # of the cell's barycentrics
    scale = worst(pair, stress) * worst(pair, gradient)
    for k in range(d + 1):
        # barycentrics of sub-simplex k: the centre's is (d+1) lambda_k, the others' are lambda_j - lambda_k
        sub = gradient - gradient[:, k : k + 1]
        sub[:, k] = (d + 1) * gradient[:, k]
        divergence = np.einsum("nmij,nmj->ni", stress[:, k], sub)
        assert worst(pair, divergence + pair.force[:count] / cells.volume[:count, None]) < BALANCE * scale
        for other in range(k + 1, d + 1):
            normal = gradient[:, k] - gradient[:, other]
            normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            common = [v for v in range(d + 1) if v not in (k, other)]
            for mine, theirs in [(k, other), *((v, v) for v in common)]:
                jump = np.einsum("nij,nj->ni", stress[:, k, mine] - stress[:, other, theirs], normal)
                assert worst(pair, jump) < BALANCE * worst(pair, stress)


def test_facets_carry_loads_and_contact_tractions(pair):
    model, d = pair.solution.model, pair.cells.d
    of_cell = model.mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    corners = np.vstack([np.zeros(d - 1), np.eye(d - 1)])
    found = nodal_forces(pair.moment)
    for name, _, load in model.tractions:
        facets = model.domain.facets(name)
        facets = facets[facets[:, 0] < model.domain.owned_cells]
        order = facet_order(model.facet_nodes(facets))
        exact = np.take_along_axis(evaluate(load, model.domain, corners, facets), order[..., None], axis=1)
        here = found[of_cell[facets[:, 0], facets[:, 1]]] / model.facet_areas(facets)[:, None, None]
        assert worst(pair, here - exact) < BALANCE * worst(pair, exact)  # the loads are linear on each facet
    for t in pair.tractions:
        own = t.contact.facets[:, 0] < model.domain.owned_cells
        facets, values = t.contact.facets[own], t.values[own]
        values = np.take_along_axis(values, facet_order(t.nodes[own])[..., None], axis=1)
        here = found[of_cell[facets[:, 0], facets[:, 1]]] / t.area[own, None, None]
        assert worst(pair, here - values) < BALANCE * worst(pair, pair.fe_stress)


def points_on_facets(d: int) -> np.ndarray:
    """At least 20 points of the reference facet, its edges included."""
    cell = basix.CellType.interval if d == 2 else basix.CellType.triangle
    return basix.create_lattice(cell, 19 if d == 2 else 6, basix.LatticeType.equispaced, True)


def test_traction_in_the_cone(pair):
    model, d = pair.solution.model, pair.cells.d
    points = points_on_facets(d)
    shape = np.column_stack([1 - points.sum(axis=1), points])
    for t in pair.tractions:
        r = np.einsum("qm,fmi->fqi", shape, t.values)
        r_n, _, r_t = split(r, t.contact.direction[:, None, :])
        bound = model.friction_bound(t.contact, np.maximum(-r_n, 0.0), points)
        scale = worst(pair, r)
        assert worst(pair, np.maximum(r_n, 0.0)) <= CONE * scale
        assert worst(pair, np.maximum(r_t - bound, 0.0)) <= CONE * scale
        assert scale > 0


def test_displacement_outside_the_foundation(pair):
    model, d = pair.solution.model, pair.cells.d
    points = points_on_facets(d)
    shape = np.column_stack([1 - points.sum(axis=1), points])
    values = pair.displacement.x.array.reshape(-1, d)
    for t in pair.tractions:
        own = t.contact.facets[:, 0] < model.domain.owned_cells
        w_n = np.einsum("qm,fmi,fi->fq", shape, values[t.nodes[own]], t.contact.direction[own])
        gap = 0.0
        if t.contact.gap is not None:
            gap = evaluate(t.contact.gap, model.domain, points, t.contact.facets[own])
        assert worst(pair, np.maximum(w_n - gap, 0.0)) <= CONE * worst(pair, values)


def test_displacement_keeps_the_supports(pair):
    model = pair.solution.model
    difference = (pair.displacement.x.array - model.prescribed.x.array)[model.fixed.ravel()]
    assert worst(pair, difference) <= 1e-15 * worst(pair, model.prescribed.x.array)


def test_free_motion_is_balanced_in_the_cone():
    """GRECO: only the contact holds the block vertically, so r^ must balance 50 MPa on 40 mm exactly."""
    domain = ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(8, 8))
    pair = ec.equilibrate(ec.solve(greco(), domain))
    assert abs(resultant(pair.tractions[0])[1] - 2000.0) < 2000.0 * 1e-12
    moment = owned_moments(pair)
    assert worst(pair, moment.sum(axis=(1, 2))) < BALANCE * worst(pair, moment)


@pytest.mark.parametrize("contact", [True, False])
def test_balance_with_data_that_no_rule_integrates(contact):
    """Moduli and loads that are no polynomials, no support against rigid motions or no contact: still in balance."""
    loads = [
        ec.Traction("top", lambda x: (0.002 * ufl.sin(5 * x[0]), -0.01 * ufl.exp(x[0]))),
        ec.BodyForce((0.0, lambda x: -0.02 * ufl.exp(2 * x[0]))),
    ]
    material = ec.Elastic(E=lambda x: ufl.exp(2 * x[0]), nu=lambda x: 0.3 + 0.1 * ufl.sin(4 * x[1]))
    held = {"contacts": [ec.Contact("bottom", friction=0.5)]} if contact else {}
    held = held or {"supports": [ec.Displacement("bottom", (0.0, 0.0))]}
    scene = ec.Scene(material=material, loads=loads, **held)
    pair = ec.equilibrate(ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(6, 6))))
    moment = owned_moments(pair)
    assert worst(pair, moment.sum(axis=(1, 2)) + pair.force[: len(moment)]) < BALANCE * worst(pair, moment)


@pytest.mark.parametrize("d", [2, 3])
def test_reference_map_reproduces_linear_stress(d):
    """A linear symmetric stress with constant divergence comes back from its own facet tractions."""
    domain = ec.rectangle((0, 0), (1, 1), cells=(1, 1)) if d == 2 else ec.box((0, 0, 0), (1, 1, 1), cells=(1, 1, 1))
    from erc_contact.admissible.geometry import simplices
    from erc_contact.model import Model

    scene = ec.Scene(material=ec.Elastic(1.0, 0.3), supports=[ec.Displacement("left", (0.0,) * d)])
    model = Model(scene, domain)
    cells, count = simplices(model), domain.owned_cells
    rng = np.random.default_rng(1)
    basis = rng.standard_normal((d + 1, d, d))
    basis = basis + basis.transpose(0, 2, 1)
    x = model.V.tabulate_dof_coordinates()[:, :d][cells.nodes]
    nodal = basis[0] + np.einsum("nmk,kij->nmij", x, basis[1:])
    divergence = np.einsum("kik->i", basis[1:].transpose(0, 1, 2))
    force = -divergence * cells.volume[:, None]
    forces = np.stack(
        [np.einsum("nmij,nj->nmi", nodal[:, v], cells.area[:, i]) for i, v in enumerate(facet_vertices(d))], axis=1
    )[:count]
    stress = macro_stress(cells, count, np.zeros_like(cells.J), forces, force)
    for k in range(d + 1):
        at = nodal[:count].copy()
        at[:, k] = nodal[:count].mean(axis=1)
        assert np.abs(tensors(stress[:, k], d) - at).max(initial=0.0) < 1e-12 * np.abs(nodal).max(initial=1.0)
    assert reference_map(d).shape == (d + 1, d + 1, d * (d + 1) // 2, (d + 1) * d + 1, d)
