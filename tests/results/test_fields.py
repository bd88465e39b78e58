"""Fields of a pair in forms of a user, and the stress whose error is known best."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import meshtags
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.model.data.expressions import evaluate

COMM = MPI.COMM_WORLD


def assembled(form):
    return COMM.allreduce(fem.assemble_scalar(fem.form(form)), MPI.SUM)


def pushed(d, degree, cells=4):
    down = (0.01, -0.05) if d == 2 else (0.01, 0.0, -0.05)
    scene = ec.Scene(
        ec.Elastic(E=1.0, nu=0.3),
        ec.Displacement("top", down),
        contacts=ec.Contact("bottom", friction=ec.Tresca(0.004)),
    )
    if d == 2:
        body = ec.rectangle((0.0, 0.0), (1.0, 0.5), cells=(cells, cells // 2))
    else:
        body = ec.box((0.0, 0.0, 0.0), (1.0, 0.5, 0.5), cells=(cells, 2, 2))
    return certified(scene, body, degree=degree)


def difference(error, u):
    """sigma^ - C eps(u) and its compliance, UFL."""
    d = error.domain.dim
    eps = ufl.sym(ufl.grad(u))
    one = ufl.Identity(d)
    tau = error.admissible.stress_function() - (eps + 0.3 / 0.4 * ufl.tr(eps) * one) / 1.3
    return tau, 1.3 * (tau - 0.3 * ufl.tr(tau) * one) if d == 2 else 1.3 * tau - 0.3 * ufl.tr(
        tau
    ) * one


@pytest.mark.on_ranks("2-2", "3-1")
@pytest.mark.parametrize(("d", "degree"), [(2, 2), (3, 1)])
def test_the_error_is_one_form_of_the_user(d, degree):
    error = pushed(d, degree, cells=2 if d == 3 else 4)
    pair = error.admissible
    tau, compliant = difference(error, pair.displacement)
    bulk = assembled(ufl.inner(tau, compliant) * pair.dx())
    assert bulk == pytest.approx(error.bulk_error**2, rel=1e-11)
    # The traction does the work of sigma^ in equilibrium, which knows no loads here.
    u = pair.displacement
    sigma = pair.stress_function()
    inside = error.integrate(lambda u, sigma: ufl.inner(sigma, ufl.grad(u)))
    assert inside == pytest.approx(assembled(ufl.inner(sigma, ufl.grad(u)) * pair.dx()), rel=1e-12)
    outside = 0.0
    for part in ("top", "bottom"):
        ds = pair.model.space.ds(pair.domain.tag(part))
        outside += assembled(ufl.inner(pair.traction_function(part), u) * ds)
    assert outside == pytest.approx(inside, rel=1e-11)


def test_a_density_must_be_a_scalar():
    with pytest.raises(ec.InputError, match="scalar"):
        pushed(2, 1).integrate(lambda u, sigma: sigma)


def test_two_facets_of_a_cell_have_no_function():
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    tags = block.facet_tags
    corner = tags.values.copy()
    corner[corner == block.names["right"]] = block.names["bottom"]
    joined = meshtags(block.mesh, 1, tags.indices, corner)
    body = ec.Domain(block.mesh, joined, {name: block.names[name] for name in ("bottom", "top")})
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0, -0.01)))
    pair = ec.equilibrate(ec.solve(scene, body))
    with pytest.raises(ec.InputError, match="belong to one cell"):
        pair.traction_function("bottom")


@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_the_best_stress_is_as_near_as_it_says(degree):
    error = pushed(2, degree)
    fine = pushed(2, 2, cells=32)
    x = np.random.default_rng(3).uniform((0.0, 0.0), (1.0, 0.5), (4000, 2))
    exact = fine.at(x).best_stress
    values = error.at(x)
    norms = []
    for stress in (values.stress, values.elastic_stress, values.best_stress):
        tau = stress - exact
        trace = np.trace(tau, axis1=1, axis2=2)
        energy = 1.3 * ((tau**2).sum(axis=(1, 2)) - 0.3 * trace**2)
        norms.append(np.sqrt(0.5 * energy.mean()))
    assert norms[2] < min(norms[:2])
    assert 0.5 * norms[2] < error.best_stress_error
    assert norms[2] < 1.1 * error.best_stress_error
    assert error.best_stress_error**2 == pytest.approx(
        0.5 * error.absolute**2 - 0.25 * error.bulk_error**2
    )


@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_means_by_cells(d, degree):
    error = pushed(d, degree, cells=2)
    means = {
        name: ec.results.mean_stress(error, name) for name in ("admissible", "elastic", "best")
    }
    assert np.allclose(means["best"], 0.5 * (means["admissible"] + means["elastic"]), atol=1e-14)
    eps = ufl.sym(ufl.grad(error.admissible.displacement))
    own = error.domain.owned_cells
    volume = error.admissible.cell_geometry.volume[:own]
    total = COMM.allreduce(float(volume @ means["elastic"][:, 0, 1]), MPI.SUM)
    assert total == pytest.approx(assembled(eps[0, 1] / 1.3 * ufl.dx), rel=1e-10)
    peaks = [error.maximum("von Mises", stress=name).value for name in means]
    assert len(set(peaks)) == 3
    with pytest.raises(ec.InputError, match="allowed are"):
        error.maximum("von Mises", stress="worst")


@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_data_at_nodes(d, degree):
    """Where data jump, the rule at nodes keeps their integral; else each value stays."""
    if d == 2:
        # Facets of two lengths meet at a node.
        body = ec.rectangle((0.0, 0.0), (1.0, 0.5), cells=(4, 2))
        body = body.refined(np.arange(body.owned_cells // 2))
    else:
        body = ec.box((0.0, 0.0, 0.0), (1.0, 0.5, 0.5), cells=(4, 2, 2))
    of_cells = fem.Function(fem.functionspace(body.mesh, ("DG", 0)))
    of_cells.interpolate(lambda x: 1.5 + np.sin(1e4 * x[0] + 3e3 * x[1]))
    jumping = fem.Function(fem.functionspace(body.mesh, ("DG", 1)))
    jumping.interpolate(of_cells)

    def data(value):
        contact = ec.Contact("bottom", friction=ec.Tresca(value))
        scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0,) * d), (), contact)
        model = ec.solve(scene, body, degree=degree).model
        (given,) = model.contacts
        (nodal,) = model.at_nodes(given).friction.parameters.values()
        return model, given, nodal

    model, contact, nodal = data(lambda x: jumping)
    ds = contact.ds(metadata=model.space.nodal_rule)
    assert assembled(nodal * ds) == pytest.approx(assembled(jumping * ds), rel=1e-13)
    assert assembled(abs(nodal - jumping) * ds) > 0.01 * assembled(nodal * ds)

    model, contact, nodal = data(lambda x: 0.1 + x[0] ** 2)
    parts = (model.space.mesh, model.space.facet_points, contact.facets)
    (value,) = contact.friction.parameters.values()
    at_nodes = evaluate(value, *parts)
    last = np.zeros(model.space.node_count)
    last[contact.trace.here.nodes] = at_nodes
    assert np.array_equal(evaluate(nodal, *parts), last[contact.trace.here.nodes])
