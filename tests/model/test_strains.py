"""Given strains: heat, swelling, misfits.

- free expansion has no stress, to round-off, and the displacement of a closed form;
- a bar that is held has the stress of a closed form, in plane strain also out of plane;
- a body heated between walls presses them, a cooled one leaves them;
- a strain that fills a gap is an interference of that gap, to round-off;
- e bounds both true errors with a strain that varies, and shrinks at the rate of the
  degree; the energy of a fine mesh is in the interval of a coarse one;
- in a history the work of forces and strains is what is stored, up to the error;
- regions, both solvers, both methods, ranks; what is wrong is refused in words.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import ufl
from domains import refused
from mpi4py import MPI
from plates import plate
from reference import true_errors
from scenes import measured, mostly_serial

import erc_contact as ec
from erc_contact.scene.words import in_words
from namedmesh.base.releases import cell_nodes

from dolfinx import mesh as dmesh  # isort: skip - after erc_contact, which loads MPI first

E, NU, HEAT = 1000.0, 0.3, 1e-3
ROLLERS = [ec.Displacement("left", (0.0, None)), ec.Displacement("bottom", (None, 0.0))]


def two_metals(whole: ec.Domain) -> ec.Domain:
    """Steel below brass in a plate."""
    cells = np.arange(whole.mesh.topology.index_map(2).size_local, dtype=np.int32)
    corners = whole.mesh.geometry.x[cell_nodes(whole.mesh.geometry)[cells]]
    tags = np.where(corners.mean(axis=1)[:, 1] > 0.5, 2, 1).astype(np.int32)
    regions = dmesh.meshtags(whole.mesh, 2, cells, tags)
    names = {"steel": 1, "brass": 2}
    return ec.Domain(whole.mesh, whole.facet_tags, whole.names, regions, names)


def walled(strain, friction=0.3, gap=0.0) -> ec.Scene:
    """Between a support above and a foundation below."""
    return ec.Scene(
        ec.Elastic(E, NU),
        [ec.Displacement("top", (None, 0.0)), ec.Displacement("left", (0.0, None))],
        contacts=ec.Contact("bottom", friction=friction, gap=gap),
        strains=strain,
    )


@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
def test_free_expansion_has_no_stress(hypothesis, degree):
    scene = ec.Scene(ec.Elastic(E, NU, hypothesis), ROLLERS, strains=ec.ThermalStrain(HEAT, 40.0))
    error = measured(scene, plate(), degree=degree)
    assert error.relative == 0.0
    # e is the round-off of the stresses that cancel, each E alpha T.
    assert error.absolute <= 1e-13 * np.sqrt(E * 2.0) * HEAT * 40.0
    # In plane strain the strain out of plane goes into the plane, too, and leaves the
    # stress -E alpha T.
    is_strain = hypothesis == "plane strain"
    stretch = 40.0 * HEAT * (1 + NU if is_strain else 1)
    assert error.at((2.0, 1.0)).displacement == pytest.approx(
        np.array([[2.0, 1.0]]) * stretch, rel=1e-9
    )
    out_of_plane = E * 40.0 * HEAT if is_strain else 0.0
    assert error.maximum("von Mises").value == pytest.approx(out_of_plane, abs=1e-9)


def test_free_expansion_in_space_by_a_region_and_a_tensor():
    body = ec.box((0.0,) * 3, (1.0,) * 3, cells=(2, 2, 2))
    supports = [
        ec.Displacement("left", (0.0, None, None)),
        ec.Displacement("front", (None, 0.0, None)),
        ec.Displacement("bottom", (None, None, 0.0)),
    ]
    strain = ec.Eigenstrain(((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, -0.03)))
    error = measured(ec.Scene(ec.Elastic(E, NU), supports, strains=strain), body)
    moved = error.at((1.0, 1.0, 1.0)).displacement
    assert moved == pytest.approx(np.array([[0.01, 0.02, -0.03]]), rel=1e-9)
    assert error.relative == 0.0


@pytest.mark.parametrize("degree", [1, 2])
def test_held_bar(degree):
    held = [*ROLLERS, ec.Displacement("right", (0.0, None))]
    for hypothesis in ("plane strain", "plane stress"):
        scene = ec.Scene(
            ec.Elastic(E, NU, hypothesis), held, strains=ec.ThermalStrain(lambda x: HEAT, 40.0)
        )
        error = measured(scene, plate(), degree=degree)
        pressed = E * HEAT * 40.0 / (1 - NU if hypothesis == "plane strain" else 1)
        assert error.relative < 1e-12
        assert error.force("right").force == pytest.approx([-pressed, 0.0], rel=1e-9, abs=1e-9)
        stress = error.at((1.0, 0.5)).stress[0]
        assert stress == pytest.approx(np.array([[-pressed, 0.0], [0.0, 0.0]]), abs=1e-9 * pressed)
        # Plane strain: the stress out of plane is the same, -E alpha T/(1 - nu).
        assert error.maximum("von Mises").value == pytest.approx(pressed, rel=1e-9)
        assert error.solution.maximum("von Mises").value == pytest.approx(pressed, rel=1e-9)


@pytest.mark.on_ranks("method0", "method2")
@pytest.mark.parametrize(
    "method",
    [
        ec.AugmentedLagrangian(),
        ec.Nitsche(),
        pytest.param(ec.Nitsche(theta=1), marks=pytest.mark.broad),
    ],
)
def test_heat_presses_and_cold_opens(method):
    hot = measured(walled(ec.ThermalStrain(HEAT, 40.0)), plate(), method=method)
    pressure = hot.profile("bottom")["pressure"]
    assert pressure.min() > 0
    assert hot.force("bottom").force[1] > 0
    cold = measured(walled(ec.ThermalStrain(HEAT, -40.0), 0.0), plate(), method=method)
    assert abs(cold.profile("bottom")["pressure"]).max() < 1e-9 * pressure.max()
    assert cold.profile("bottom")["gap"].min() > 0


@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2]))
def test_a_strain_that_fills_a_gap_is_an_interference(degree, solver):
    grown = 0.02
    misfit = ec.Eigenstrain(((0.0, 0.0), (0.0, grown)))
    options = {"degree": degree, "solver": solver, "method": ec.AugmentedLagrangian()}
    strained = measured(walled(misfit), plate(), **options)
    pushed = measured(replace(walled((), gap=-grown), strains=()), plate(), **options)
    assert strained.relative == pytest.approx(pushed.relative, rel=1e-6)
    for part in ("bottom", "top", "left"):
        force = pushed.force(part).force
        assert strained.force(part).force == pytest.approx(force, abs=1e-8 * E * grown)


def varying(x):
    return 0.02 * ufl.sin(2 * x[0]) * ufl.exp(-x[1])


@cache
def strained():
    """Return a scene with strains, and on fine meshes its solution and its error."""
    scene = ec.Scene(
        ec.Elastic(E, NU),
        [ec.Displacement("top", (0.0, -0.005))],
        contacts=ec.Contact("bottom", friction=ec.Tresca(1.0)),
        strains=[
            ec.ThermalStrain(1.0, varying),
            ec.Eigenstrain(lambda x: ((0.01 * x[1], 0.002), (0.002, 0.0))),
        ],
    )
    return scene, ec.solve(scene, plate(24), degree=2), measured(scene, plate(16), degree=2)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_e_bounds_true_errors_and_shrinks(degree):
    scene, reference, finest = strained()
    errors = []
    for n in (3, 6):
        error = measured(scene, plate(n), degree=degree)
        true = true_errors(error.admissible, reference)
        both = np.hypot(true.displacement, true.stress)
        assert both <= 1.02 * error.absolute  # a reference is not the solution
        assert error.absolute <= 1.3 * both
        errors.append(error)
    coarse, fine = errors
    assert fine.absolute < 0.75 * coarse.absolute
    energy = ec.potential_energy(finest).value
    force = finest.force("bottom").force[1]
    for error in errors:
        bounds = ec.potential_energy(error)
        assert bounds.low <= energy <= bounds.high
        pressure = ec.resultant(error, "bottom", (0.0, 1.0))
        assert pressure.low <= force <= pressure.high


def test_energy_of_a_history():
    def scene_at(t):
        share = np.sin(t)  # heated, and cooled again
        heat = ec.ThermalStrain(HEAT, lambda x: 20.0 * share * (1 + x[1]))
        return replace(walled(heat), loads=ec.Traction("right", (5.0 * t, 0.0)))

    evolution = ec.evolve(scene_at, plate(6), [0.5, 1.5, 2.8], accuracy=0.5, degree=2)
    stored = [step.stored for step in evolution.steps]
    left = [abs(step.imbalance) for step in evolution.steps]
    e_2 = [error.absolute**2 for error in evolution.errors]
    assert min(stored) > 0
    # Each step adds what its pair leaves of the balance, which is of the order of e^2.
    assert np.all(np.array(left) < 5 * np.cumsum(e_2) + 1e-12)
    assert max(left) < 0.1 * max(stored)


def test_regions_and_ranks_have_the_same_numbers():
    """Steel and brass in one body; on one rank and on all."""
    errors = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = two_metals(plate(4, comm))
        heat = ec.ThermalStrain({"steel": 1.2e-5, "brass": 1.9e-5}, 100.0)
        swelling = ec.Eigenstrain(1e-4, region="brass")
        scene = walled([heat, swelling], friction=0.2)
        errors.append(measured(scene, domain))
    alone, together = errors
    assert together.relative == pytest.approx(alone.relative, rel=1e-9)
    force = alone.force("bottom").force
    assert together.force("bottom").force == pytest.approx(force, rel=1e-9)
    assert force[1] > 0


def test_a_mapping_of_regions_is_a_strain_of_each():
    """Numbers, tensors and callables; regions that it leaves out have none."""
    tensor = ((-1e-4, 2e-5), (2e-5, 1e-4))
    values = {"brass": 3e-4, "steel": lambda x: ((2e-4 * x[0], 0.0), (0.0, 1e-4))}
    cases = [
        (ec.Eigenstrain(values), [ec.Eigenstrain(values[name], name) for name in values]),
        (ec.Eigenstrain({"brass": tensor}), [ec.Eigenstrain(tensor, "brass")]),
        (ec.Eigenstrain({"steel": 1e-4, "brass": 1e-4}), [ec.Eigenstrain(1e-4)]),
    ]
    domain = two_metals(plate(4))
    for mapping, alone in cases:
        errors = [measured(walled(strains, 0.2), domain) for strains in (mapping, alone)]
        forces = [error.force("top").force for error in errors]
        assert forces[0] == pytest.approx(forces[1], rel=1e-12)
        assert errors[0].absolute == pytest.approx(errors[1].absolute, rel=1e-9)
        assert abs(forces[0]).max() > 1e-3
    (row,) = [row for row in in_words(walled(cases[0][0])) if "Eigenstrain" in row[1]]
    assert row[0] == "brass, steel"


def test_a_mapping_that_does_not_fit_the_regions():
    whole = two_metals(plate(4))
    names = {**whole.regions, "iron": whole.regions["steel"]}
    domain = ec.Domain(whole.mesh, whole.facet_tags, whole.names, whole.cell_tags, names)
    wrong = {
        "No cell region is called 'core'; this domain has": {"steel": 0.1, "core": 0.1},
        "two of .*'iron', 'steel'": {"steel": 0.1, "iron": 0.1},
        "Eigenstrain in 'steel' has shape": {"steel": ((0.0,) * 3,) * 3},
        "Eigenstrain in 'brass' failed": {"brass": lambda x: np.floor(x[0])},
    }
    for words, value in wrong.items():
        with pytest.raises(ec.InputError, match=words):
            ec.solve(walled(ec.Eigenstrain(value)), domain)
    u = domain.function("DG", 0)
    for value in ({"steel": lambda x: u}, ((lambda x: u, 0.0), (0.0, 0.0))):
        with pytest.raises(ec.InputError, match="returns a Function"):
            ec.adapt(walled(ec.Eigenstrain(value)), domain, accuracy=0.1)


BAD = {
    "not finite": (lambda: ec.ThermalStrain(1e-5, np.inf), "finite number"),
    "no value": (lambda: ec.ThermalStrain("hot", 3.0), "finite number"),
    "no rows": (lambda: ec.Eigenstrain((1.0, 2.0, 3.0, 4.0)), "d rows of d values"),
    "not symmetric": (lambda: ec.Eigenstrain(((0.0, 1.0), (2.0, 0.0))), "half the shear angle"),
    "region": (lambda: ec.Eigenstrain(0.1, region=3), "name of one cell region"),
    "key": (lambda: ec.Eigenstrain({3: 0.1}), "name of one cell region"),
    "mapping and region": (lambda: ec.Eigenstrain({"a": 0.1}, region="b"), "or one strain with"),
    "no regions": (lambda: ec.Eigenstrain({}), "or one strain with"),
    "entry": (lambda: ec.Eigenstrain({"a": "hot"}), "Eigenstrain in 'a' is 'hot'"),
    "skew entry": (lambda: ec.Eigenstrain({"a": ((0, 1.0), (0, 0))}), "in 'a' has the components"),
    "no strain": (lambda: walled(3.0), "strains is 3.0"),
    "unknown region": (
        lambda: ec.solve(walled(ec.Eigenstrain(0.1, region="core")), plate()),
        "'core'",
    ),
    "shape": (
        lambda: ec.solve(walled(ec.Eigenstrain(((0.0,) * 3,) * 3)), plate()),
        "needs a scalar or the shape",
        "2 rows of 2 components, which acts in plane",
    ),
    "math": (
        lambda: ec.solve(walled(ec.ThermalStrain(1.0, lambda x: np.floor(x[0]))), plate()),
        "ufl.sin",
    ),
    "infinite": (
        lambda: ec.solve(walled(ec.ThermalStrain(1.0, lambda x: 1 / (x[0] - x[0]))), plate()),
        "not finite",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_strains_are_refused_in_words(case):
    refused(*BAD[case])


def turned(tensor, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[-c, -s], [-s, c]])
    return turn @ tensor @ turn.T


def test_a_turned_strain_is_symmetric():
    """Up to the round-off of its components; the symmetric part counts."""
    strain = turned(np.array([[0.004, 0.001], [0.001, -0.003]]), 0.5236)
    assert strain[0, 1] != strain[1, 0]
    symmetric = 0.5 * (strain + strain.T)
    force = []
    for tensor in (strain, symmetric):
        error = measured(walled(ec.Eigenstrain(tensor)), plate())
        force.append(error.force("top").force)
    assert force[0] == pytest.approx(force[1], rel=1e-12)
    with pytest.raises(ec.InputError, match="half the shear angle"):
        ec.Eigenstrain(strain + np.array([[0.0, 1e-9], [0.0, 0.0]]))


class Rubber:
    """A material of a user's that does not tell its stress out of plane."""

    parameters = ("G",)
    G = 1.0

    def stress(self, eps, G):
        return 2 * G * eps

    def compliance(self, sigma, G):
        return sigma / (2 * G)

    def modulus(self, G):
        return G

    def check(self, name, low, high):
        pass


def test_a_material_without_stress_out_of_plane():
    scene = replace(walled(ec.ThermalStrain(HEAT, 40.0)), material=Rubber())
    with pytest.raises(ec.InputError, match="out_of_plane"):
        ec.solve(scene, plate())
    in_plane = replace(scene, strains=ec.Eigenstrain(((0.0, 0.0), (0.0, 0.04))))
    assert measured(in_plane, plate()).force("bottom").force[1] > 0
    with pytest.raises(ec.InputError, match="given strains"):
        ec.work_of_loads(measured(replace(in_plane, contacts=ec.Contact("bottom")), plate()))
