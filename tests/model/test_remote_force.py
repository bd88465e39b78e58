"""Forces and moments that a part shares.

- the resultant and the moment are what is given, on any part, on finer meshes, on
  ranks, on curved parts;
- a bar under an eccentric force has the closed form sigma = N/A + M y/I, and its energy
  lies in the interval;
- a ring has its axial force; histories follow the scene; a saved run goes on;
- what is wrong is refused in words.
"""

from dataclasses import replace

import numpy as np
import pytest
from domains import refused
from scenes import measured

import erc_contact as ec
from namedmesh.base.exceptions import InputError

PLANE = ((0.0, 0.0), (2.0, 1.0))
SPACE = ((0.0, 0.0, 0.0), (2.0, 1.5, 1.0))
STEEL = ec.Elastic(1000.0, 0.3)


def moment_of(arm, force):
    """Moment of a force at an arm, one number in the plane."""
    if len(arm) == 3:
        return np.cross(arm, force)
    return np.array([arm[0] * force[1] - arm[1] * force[0]])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_resultant_and_moment_are_what_is_given(d, seed):
    random = np.random.default_rng([d, seed])
    body = ec.rectangle(*PLANE, cells=(4, 2)) if d == 2 else ec.box(*SPACE, cells=(2, 2, 1))
    names = list(body.names)
    part, held = random.choice(len(names), 2, replace=False)
    force = random.normal(size=d)
    at = 3.0 * random.normal(size=d)
    moment = random.normal(size=1 if d == 2 else 3)
    load = ec.RemoteForce(names[part], force, moment=moment, at=at)
    scene = ec.Scene(STEEL, ec.Displacement(names[held], (0.0,) * d), load)
    wanted = moment + moment_of(at, force)
    for domain in (body, body.refined(np.arange(0, body.owned_cells, 2))):
        found = ec.solve(scene, domain).force(names[part])
        scale = abs(wanted).max() + abs(force).max()
        assert found.force == pytest.approx(force, abs=1e-12 * scale)
        assert found.moment == pytest.approx(wanted, abs=1e-12 * scale)


def test_a_bar_under_an_eccentric_force():
    """Two ends pull at y = 0.3 below the axis: sigma = N/A + M y/I, degree 2 is exact."""
    pull, e = 6.0, -0.2
    moment = -pull * e  # counterclockwise, about the axis of the bar
    material = ec.Elastic(1000.0, 0.3, hypothesis="plane stress")
    ends = [
        ec.RemoteForce("right", (pull, 0.0), at=(2.0, 0.5 + e)),
        ec.RemoteForce("left", (-pull, 0.0), at=(0.0, 0.5 + e)),
    ]
    scene = ec.Scene(material, loads=ends)
    body = ec.rectangle(*PLANE, cells=(4, 2))
    exact = measured(scene, body, degree=2)
    assert exact.relative < 1e-10
    for y in (0.0, 0.5, 1.0):
        stress = exact.solution.at((1.0, y)).elastic_stress.reshape(2, 2)
        assert stress[0, 0] == pytest.approx(pull - moment * 12 * (y - 0.5), abs=1e-9)
    energy = pull**2 * 2 / (2 * 1000) + moment**2 * 2 * 12 / (2 * 1000)
    bounds = ec.potential_energy(measured(scene, body))
    assert bounds.low <= -energy <= bounds.high
    assert bounds.guaranteed
    assert ec.potential_energy(exact).value == pytest.approx(-energy, rel=1e-10)


def test_the_displacement_at_the_point_is_a_goal():
    """The work of a unit force at a point: the motion of the end, as a lever has it."""
    pull, moment, y = 6.0, 0.5, 0.3
    load = ec.RemoteForce("right", (pull, 0.0), moment=moment)
    scene = ec.Scene(ec.Elastic(1000.0, 0.0), ec.Symmetry("left"), load)
    error = measured(scene, ec.rectangle(*PLANE, cells=(4, 2)))
    unit = ec.RemoteForce("right", (1.0, 0.0), at=(2.0, y))
    moved = 2.0 / 1000.0 * (pull - 12 * moment * (y - 0.5))
    bounds = ec.interval(error, ec.Functional(unit))
    assert bounds.low <= moved <= bounds.high
    assert bounds.high - bounds.low < 0.3 * moved


def test_a_ring_has_its_axial_force():
    ring = ec.rectangle((1.0, 0.0), (2.0, 1.0), cells=(2, 2))
    material = ec.Elastic(1000.0, 0.3, hypothesis="axisymmetric")
    held = ec.Displacement("bottom", (None, 0.0))
    scene = ec.Scene(material, held, ec.RemoteForce("top", (0.0, -5.0)))
    assert ec.solve(scene, ring).force("bottom").force[1] == pytest.approx(5.0, rel=1e-12)
    for wrong in (
        ec.RemoteForce("top", (1.0, -5.0)),
        ec.RemoteForce("top", (0.0, -5.0), moment=1.0),
        ec.RemoteForce("top", (0.0, -5.0), at=(0.5, 0.0)),
    ):
        refused(lambda load=wrong: ec.solve(replace(scene, loads=load), ring), "would bend it")


HALF_DISC = (
    'SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 1}; Rectangle(2) = {-1, -1, 0, 2, 1};\n'
    "BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; }; e = 1e-3;\n"
    "base() = Curve In BoundingBox {-1 - e, -e, -e, 1 + e, e, e};\n"
    "all() = Boundary{ Surface{3}; }; all() -= base();\n"
    'Physical Curve("base") = base(); Physical Curve("rim") = all();\n'
    "Mesh.MeshSizeMax = 0.5;\n"
)


@pytest.mark.serial
def test_a_curved_part_gets_the_whole_force(shared_tmp_path):
    path = shared_tmp_path / "disc.geo"
    path.write_text(HALF_DISC)
    body = ec.read_mesh(path, scripts=True)
    assert body.curved_facets is not None
    load = ec.RemoteForce("rim", (1.0, -2.0), moment=0.5, at=(2.0, 3.0))
    scene = ec.Scene(STEEL, ec.Displacement("base", (0.0, 0.0)), load)
    found = ec.solve(scene, body).force("base")
    assert found.force == pytest.approx((-1.0, 2.0), rel=1e-12)
    assert found.moment == pytest.approx(-(0.5 - 4.0 - 3.0), rel=1e-12)


def test_a_history_goes_on_where_it_was_saved(shared_tmp_path):
    body = ec.rectangle(*PLANE, cells=(4, 2))

    def scene_at(t):
        load = ec.RemoteForce("top", (2.0 * t, -8.0), at=(1.0, 1.2))
        return ec.Scene(STEEL, loads=load, contacts=ec.Contact("bottom", friction=0.5))

    arguments = {"accuracy": 0.9, "checkpoint": shared_tmp_path / "run"}
    ec.evolve(scene_at, body, [0.5, 1.0], **arguments)
    made = []
    history = ec.evolve(scene_at, body, [0.5, 1.0], callback=made.append, **arguments)
    assert not made
    for t, error in zip((0.5, 1.0), history.errors, strict=True):
        found = error.force("top")
        assert found.force == pytest.approx((2.0 * t, -8.0), abs=1e-10)
        assert found.moment == pytest.approx(-8.0 - 2.4 * t, abs=1e-10)
        assert error.force("bottom").force == pytest.approx((-2.0 * t, 8.0), abs=1e-8)


def test_what_is_wrong_is_refused_in_words():
    body = ec.rectangle(*PLANE, cells=(4, 2))
    held = ec.Displacement("left", (0.0, 0.0))
    for wrong in ({"force": (1.0, "a")}, {"force": 3.0}, {"at": (1.0,)}, {"moment": (1.0, 2.0)}):
        arguments = {"force": (1.0, 0.0)} | wrong
        refused(lambda given=arguments: ec.RemoteForce("right", **given), "finite numbers")
    in_space = ec.Scene(STEEL, held, ec.RemoteForce("right", (1.0, 0.0, 0.0)))
    refused(lambda: ec.solve(in_space, body), "the mesh is 2D")
    load = ec.RemoteForce("left", (1.0, 0.0))
    roller = ec.Displacement("left", (0.0, None))
    refused(lambda: ec.Scene(STEEL, roller, load), "acts in all components", error=InputError)
