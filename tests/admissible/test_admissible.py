"""Admissible pairs.

Each property as a number against a scale, on random scenes in 2D and 3D, of degree 1
and 2.

- every element is in equilibrium of forces and moments under its facet tractions and
  the body force;
- tractions of two elements on a common facet are opposite (one value per facet, seen
  with two signs);
- sigma^ has these tractions on its facets, is continuous across inner facets of the
  sub-simplices, and div sigma^ + f = 0 in every sub-simplex;
- facet tractions are the loads on Gamma_N and r^ on Gamma_C;
- that also where the body slides ten times its size, or only the contact holds it: r^
  is found where there is one;
- r^ lies in the Coulomb cone and u^_n <= g at 20 points of every facet.
"""

from dataclasses import replace

import basix
import numpy as np
import pytest
import ufl
from dolfinx import la
from mpi4py import MPI
from scenes import greco, mostly_serial, random_scene, resultant, sliding_block

import erc_contact as ec
from erc_contact.admissible.cells import facet_order, force_coefficients, moments_of_cells
from erc_contact.admissible.macro import macro_points, macro_stress
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.reference import bubbles, mandel, reference_map, tensors
from erc_contact.admissible.sampled import lowering
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.trace import split
from erc_contact.scene.material import mandel_basis
from namedmesh.simplex import (
    at_nodes,
    barycentric,
    bernstein,
    coefficients,
    gradients,
    lagrange,
    local_facet_nodes,
    mass,
    nodes,
)

PAIRS = [(0, 1), (2, 1), (3, 1), (6, 1), (7, 1), (2, 2), (3, 2)]
"""Seeds of random scenes, degrees: scenes of other files, so that forms are shared."""
BROADER = [(2, 1), (6, 1), (3, 2)]
AUGMENTED = [(0, 1), (3, 1), (7, 1)]
"""Cases that the augmented Lagrangian solves, too, in the plane and in 3D."""
BALANCE = 1e-10
CONE = 1e-12


@pytest.fixture(scope="module", params=mostly_serial(PAIRS, [(3, 1), (2, 2)], BROADER))
def pair(request: pytest.FixtureRequest) -> Admissible:
    seed, degree = request.param
    method = ec.AugmentedLagrangian() if request.param in AUGMENTED else None
    return ec.equilibrate(ec.solve(*random_scene(seed), method, degree=degree))


def worst(pair: Admissible, values: np.ndarray) -> float:
    return pair.solution.model.space.comm.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)


def owned_moments(pair: Admissible) -> np.ndarray:
    return moments_of_cells(pair.cell_geometry, pair.facet_moments)[
        : pair.solution.domain.owned_cells
    ]


def test_elements_balance_forces(pair):
    moment = owned_moments(pair)
    force = moment.sum(axis=(1, 2)) + pair.cell_forces[: len(moment)].mean(axis=1)
    assert worst(pair, force) < BALANCE * worst(pair, moment)


def test_elements_balance_moments(pair):
    moment, cells, d = owned_moments(pair), pair.cell_geometry, pair.cell_geometry.d
    x = pair.solution.model.space.V.tabulate_dof_coordinates()[:, :d][cells.nodes[: len(moment)]]
    arm = x - x.mean(
        axis=1, keepdims=True
    )  # nodal values of a linear function are its coefficients, too
    on_facets = local_facet_nodes(d, cells.degree)
    dyad = sum(np.einsum("nmi,nmj->nij", arm[:, v], moment[:, i]) for i, v in enumerate(on_facets))
    body = mass(d, 1, cells.degree - 1)
    dyad += np.einsum("nvi,vb,nbj->nij", arm[:, : d + 1], body, pair.cell_forces[: len(moment)])
    assert worst(pair, dyad - dyad.transpose(0, 2, 1)) < BALANCE * worst(pair, moment) * worst(
        pair, arm
    )


def test_opposite_tractions_between_ranks(pair):
    """Both ranks that see a facet compute its traction themselves.

    The values must agree.
    """
    model = pair.solution.model
    facets = model.space.mesh.topology.index_map(model.space.d - 1)
    size = np.linalg.norm(pair.facet_moments.sum(axis=1), axis=1)
    complete = np.zeros(len(size), dtype=bool)
    complete[pair.cell_geometry.facets[: model.domain.owned_cells]] = True
    vector = la.vector(facets, dtype=np.float64)
    vector.array[:] = np.where(complete, size, 0.0)
    vector.scatter_forward()
    ghosts = np.arange(len(size)) >= facets.size_local
    seen = complete & ghosts & (vector.array > 0)
    assert worst(pair, (vector.array - size)[seen]) < BALANCE * worst(pair, size)


def test_stress_has_the_facet_tractions(pair):
    moment, cells, d = owned_moments(pair), pair.cell_geometry, pair.cell_geometry.d
    stress, force = tensors(pair.stress, d), force_coefficients(moment, cells.degree)
    for i, on_facet in enumerate(local_facet_nodes(d, cells.degree)):
        found = np.einsum("nmij,nj->nmi", stress[:, i, on_facet], cells.area[: len(moment), i])
        assert worst(pair, found - force[:, i]) < BALANCE * worst(pair, force)


def test_stress_is_in_equilibrium_inside(pair):
    cells, d, k, count = (
        pair.cell_geometry,
        pair.cell_geometry.d,
        pair.cell_geometry.degree,
        len(pair.stress),
    )
    stress = tensors(pair.stress, d)
    corners = np.vstack([np.zeros(d), np.eye(d)])
    gradient = -cells.area[:count] / (
        d * cells.volume[:count, None, None]
    )  # of the cell's barycentrics
    scale = worst(pair, stress) * worst(pair, gradient)
    subs = np.repeat(corners[None], d + 1, axis=0)
    subs[range(d + 1), range(d + 1)] = corners.mean(axis=0)
    for i in range(d + 1):
        # barycentrics of sub-simplex i: the centre's is (d+1) lambda_i, the others' are
        # lambda_j - lambda_i
        sub = gradient - gradient[:, i : i + 1]
        sub[:, i] = (d + 1) * gradient[:, i]
        divergence = np.einsum(
            "ckm,nmij,nkj->nci", gradients(d, k), stress[:, i], sub, optimize=True
        )
        f = np.matmul(
            bernstein(d, k - 1, barycentric(nodes(d, k - 1)) @ subs[i]), pair.cell_forces[:count]
        )
        assert worst(pair, divergence + f / cells.volume[:count, None, None]) < BALANCE * scale
        for other in range(i + 1, d + 1):
            normal = gradient[:, i] - gradient[:, other]
            normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            sides = []
            for mine, theirs in ((i, other), (other, i)):
                on_facet = local_facet_nodes(d, k)[theirs]
                place = barycentric(nodes(d, k)[on_facet]) @ subs[mine]
                order = np.lexsort(np.round(place, 9).T)
                sides.append(stress[:, mine, on_facet[order]])
            jump = np.einsum("nmij,nj->nmi", sides[0] - sides[1], normal)
            assert worst(pair, jump) < BALANCE * worst(pair, stress)


def test_facets_carry_loads_and_contact_tractions(pair):
    model, d = pair.solution.model, pair.cell_geometry.d
    of_cell = model.space.mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    k = model.space.degree
    found = force_coefficients(pair.facet_moments, k)
    for load in model.surface_loads:
        facets = model.domain.facets(load.facets)
        facets = facets[facets[:, 0] < model.domain.owned_cells]
        order = facet_order(model.space.facet_nodes(facets)[:, :d], k)
        exact = np.matmul(
            coefficients(d - 1, k),
            model.space.evaluate(load.density, model.space.facet_points, facets),
        )
        exact = np.take_along_axis(exact, order[..., None], axis=1)
        here = (
            found[of_cell[facets[:, 0], facets[:, 1]]]
            / model.space.facet_areas(facets)[:, None, None]
        )
        assert worst(pair, here - exact) < BALANCE * worst(
            pair, exact
        )  # the loads are linear on each facet
    for t in pair.tractions:
        own = t.contact.facets[:, 0] < model.domain.owned_cells
        facets, values = t.contact.facets[own], t.values[own]
        values = np.take_along_axis(values, facet_order(t.nodes[own, :d], k)[..., None], axis=1)
        here = found[of_cell[facets[:, 0], facets[:, 1]]] / t.area[own, None, None]
        assert worst(pair, here - values) < BALANCE * worst(pair, pair.fe_stress)


def points_on_facets(d: int) -> np.ndarray:
    """At least 20 points of the reference facet, its edges included."""
    cell = basix.CellType.interval if d == 2 else basix.CellType.triangle
    return basix.create_lattice(cell, 19 if d == 2 else 6, basix.LatticeType.equispaced, True)


def test_traction_in_the_cone(pair):
    model, d = pair.solution.model, pair.cell_geometry.d
    points = points_on_facets(d)
    shape = bernstein(d - 1, model.space.degree, points)
    for t in pair.tractions:
        r = np.einsum("qm,fmi->fqi", shape, t.values)
        r_n, _, r_t = split(r, t.contact.direction[:, None, :])
        bound = t.contact.friction_bound(
            np.maximum(-r_n, 0.0), friction_parameters(model.space, t.contact, points)
        )
        scale = worst(pair, r)
        assert worst(pair, np.maximum(r_n, 0.0)) <= CONE * scale
        assert worst(pair, np.maximum(r_t - bound, 0.0)) <= CONE * scale
        assert scale > 0


def test_displacement_outside_the_foundation(pair):
    model, d = pair.solution.model, pair.cell_geometry.d
    points = points_on_facets(d)
    shape = lagrange(d - 1, model.space.degree, points)
    values = pair.displacement.x.array.reshape(-1, d)
    for t in pair.tractions:
        own = t.contact.facets[:, 0] < model.domain.owned_cells
        w_n = np.einsum("qm,fmi,fi->fq", shape, values[t.nodes[own]], t.contact.direction[own])
        gap = 0.0
        if t.contact.gap is not None:
            gap = model.space.evaluate(t.contact.gap, points, t.contact.facets[own])
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


@pytest.mark.parametrize("contact", [True, pytest.param(False, marks=pytest.mark.broad)])
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
    assert worst(
        pair, moment.sum(axis=(1, 2)) + pair.cell_forces[: len(moment), 0]
    ) < BALANCE * worst(pair, moment)


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    "method", [ec.Nitsche(), ec.AugmentedLagrangian()], ids=["Nitsche", "augmented"]
)
def test_any_pressure_holds(method, degree):
    """Its weight is all that the contact must balance.

    With the first method no traction was found.
    """
    scene = ec.Scene(
        material=ec.Elastic(70e9, 0.25),
        supports=[ec.Displacement("top", (1e-5, None))],
        loads=[ec.BodyForce((0.0, -26000.0))],
        contacts=[ec.Contact("bottom", friction=0.45)],
    )
    pair = ec.equilibrate(
        ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)), method, degree=degree)
    )
    assert resultant(pair.tractions[0])[1] == pytest.approx(26000.0, rel=1e-10)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("E", [1.0, 1e-6])
def test_contact_holds_on_all_meshes(E):
    """Half of a block on a parabola, degree 2.

    The imbalance that was left ended runs at some 700 cells.
    """
    scene = ec.Scene(
        material=ec.Elastic(E, 0.3),
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[ec.Traction("top", (0.0, -0.01 * E))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 2)],
    )
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    history = ec.adapt(scene, domain, accuracy=1e-3, degree=2, max_cells=800)
    assert history.steps[-1].cells > 600


@pytest.mark.on_ranks("2-2")
@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_elements_balance_where_the_body_slides_far(d, degree):
    """The displacement is 1e8 times the elastic one.

    Its round-off was 1e-8 of the forces.
    """
    scene, domain = sliding_block(10.0, d, n=2 if d == 2 else 1)
    pair = ec.equilibrate(ec.solve(scene, domain, degree=degree))
    moment = owned_moments(pair)
    force = moment.sum(axis=(1, 2)) + pair.cell_forces[: len(moment)].mean(axis=1)
    assert worst(pair, force) < BALANCE * worst(pair, moment)


@pytest.mark.serial
def test_round_off_does_not_shrink_the_friction_of_a_facet():
    """Two tractions at a corner that are zero but for round-off have no ratio that says anything."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.0, -0.01))],
        contacts=[ec.Contact("bottom", friction=lambda x: 0.5 * x[0])],
    )
    solution = ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)))
    (traction,) = ec.equilibrate(solution, tighten=0).tractions
    values = np.zeros_like(traction.values)
    values[..., 1] = 0.01  # n points down: a pressure
    x = solution.model.space.V.tabulate_dof_coordinates()[traction.nodes, 0]
    values[..., 0] = 0.25 * 0.01 * x
    assert np.all(lowering(solution.model.space, replace(traction, values=values)) == 1.0)
    values[..., 0] += np.where(x < 1e-12, 1e-18, 0.0)  # friction is zero there
    assert np.all(lowering(solution.model.space, replace(traction, values=values)) == 1.0)
    values[..., 0] *= 3.0
    assert np.all(lowering(solution.model.space, replace(traction, values=values)) < 1.0)


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_macro_stress_reproduces_polynomials(d, degree):
    """A symmetric stress of degree k comes back from its own facet tractions and divergence, up to bubbles."""
    domain = (
        ec.rectangle((0, 0), (1, 1), cells=(1, 1))
        if d == 2
        else ec.box((0, 0, 0), (1, 1, 1), cells=(1, 1, 1))
    )
    from erc_contact.admissible.cells import cell_geometry
    from erc_contact.admissible.elastic import moduli
    from erc_contact.admissible.tighten.complementary import relax
    from erc_contact.model.model import Model

    scene = ec.Scene(material=ec.Elastic(1.0, 0.3), supports=[ec.Displacement("left", (0.0,) * d)])
    model = Model(scene, domain, degree)
    cells, count = cell_geometry(model.space), domain.owned_cells
    x = model.space.V.tabulate_dof_coordinates()[:, :d][cells.nodes]
    rng = np.random.default_rng(1)
    powers = np.array([p for p in np.ndindex((degree + 1,) * d) if sum(p) <= degree])
    basis = rng.standard_normal((len(powers), d, d))
    basis = basis + basis.transpose(0, 2, 1)

    def stress_at(x):
        return np.einsum("...p,pij->...ij", np.prod(x[..., None, :] ** powers, axis=-1), basis)

    exact = np.einsum("cm,nmij->ncij", coefficients(d, degree), stress_at(x))
    gradient = -cells.area / (d * cells.volume[:, None, None])
    divergence = np.einsum("ckm,nmij,nkj->nci", gradients(d, degree), exact, gradient)
    force = -divergence * cells.volume[:, None, None]
    on_facets = enumerate(local_facet_nodes(d, degree))
    forces = np.stack(
        [np.einsum("nmij,nj->nmi", exact[:, v], cells.area[:, i]) for i, v in on_facets], axis=1
    )[:count]
    b = len(nodes(d, degree - 1))
    stress = macro_stress(cells, count, np.zeros((len(force), b, d, d)), forces, force)
    corners = np.vstack([np.zeros(d), np.eye(d)])
    subs = np.repeat(corners[None], d + 1, axis=0)
    subs[range(d + 1), range(d + 1)] = corners.mean(axis=0)
    # The bubbles, from degree 2 on, are chosen by the nearest stress.
    for is_relaxed in range(degree):
        if is_relaxed:
            points = macro_points(d, degree).points
            at = x[:count, :1] + np.einsum("qj,nij->nqi", points, cells.J[:count])
            compliance = moduli(model, cells, points[:1], 1, inverse=True)
            stress = relax(cells, stress, mandel(stress_at(at)), compliance)
        for k in range(d + 1) if is_relaxed or degree == 1 else ():
            place = barycentric(nodes(d, degree)) @ subs[k]
            at = x[:count, :1] + np.einsum("qj,nij->nqi", place, cells.J[:count])
            found = np.einsum("mc,ncij->nmij", at_nodes(d, degree), tensors(stress[:, k], d))
            assert np.abs(found - stress_at(at)).max(initial=0.0) < 1e-12 * np.abs(exact).max(
                initial=1.0
            )


@pytest.mark.serial
@pytest.mark.parametrize(("d", "k", "number"), [(2, 1, 0), (3, 1, 0), (2, 2, 3), (3, 2, 18)])
def test_bubbles_have_no_traction(d, k, number):
    assert bubbles(d, k).shape[-1] == number
    assert reference_map(d, k).shape[:3] == bubbles(d, k).shape[:3]
    for i, on_facet in enumerate(local_facet_nodes(d, k)):
        normal = np.ones(d) if i == 0 else -np.eye(d)[i - 1]
        traction = np.einsum("msz,sij,j->miz", bubbles(d, k)[i, on_facet], mandel_basis(d), normal)
        assert abs(traction).max(initial=0.0) < 1e-12
