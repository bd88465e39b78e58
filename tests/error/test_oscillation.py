"""Data that the mesh does not represent exactly.

What is guaranteed is true, and what the mesh represents exactly stays guaranteed.

- resultants that equilibrium dictates equal the load's, jumps and peaks inside facets
  included;
- energies hold exact ones where moduli jump or vary fast inside cells;
- u^ does not enter an asperity; gaps, normals and supports that no polynomial meets end
  the guarantee;
- constants, constants by region and polynomials of the degree of the mesh have no
  oscillation at all;
- random scenes against quadratic solutions on fine meshes with quadrature of high
  degree.
"""

from collections.abc import Callable

import numpy as np
import pytest
import ufl
from dolfinx import fem
from domains import two_materials
from mpi4py import MPI
from scenes import measured, mostly_serial, pressed
from ufl.domain import extract_unique_domain

import erc_contact as ec
from erc_contact.model.model import Model
from erc_contact.scene.material import strain
from erc_contact.scene.scene import count_varying
from namedmesh.simplex import lagrange

DEGREES = pytest.mark.parametrize("degree", [1, 2])


def given(axis: int = 0, **coefficients: float) -> Callable:
    """A function of one coordinate t, a sum of these terms.

    All are compiled, once, for all tests.
    """
    names = (
        "one",
        "t",
        "t2",
        "t3",
        "sin",
        "often",
        "cos",
        "exp",
        "peak",
        "width",
        "step",
        "stripe",
    )
    numbers = {"often": 25.0, "width": 0.01, **coefficients}

    def function(x):
        mesh = extract_unique_domain(x)
        c = {name: fem.Constant(mesh, float(numbers.get(name, 0.0))) for name in names}
        t = x[axis]
        between = ufl.And(ufl.gt(t, 0.4), ufl.lt(t, 0.45))
        return (
            c["one"] * (1 + c["exp"] * ufl.exp(25 * t))
            + c["t"] * t
            + c["t2"] * t**2
            + c["t3"] * t**3
            + c["sin"] * ufl.sin(c["often"] * t)
            + c["cos"] * ufl.cos(8 * ufl.pi * t)
            + c["peak"] * ufl.exp(-(((t - 0.53) / c["width"]) ** 2))
            + c["step"] * ufl.conditional(ufl.lt(t, 0.337), 1.0, 0.0)
            + c["stripe"] * ufl.conditional(between, 1.0, 0.0)
        )

    return function


def square(n: int, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(n, n), comm=comm)


def holds(b: ec.Bounds, true: float) -> bool:
    """Whether the truth is in the interval, to the round-off of both."""
    return b.low - 1e-9 * abs(true) <= true <= b.high + 1e-9 * abs(true)


# -- loads
# ---------------------------------------------------------------------------------------------------

LOADS = {
    "step": (given(step=1.0), 0.337),
    "waves": (given(one=1.0, sin=1.0), 1 + (1 - np.cos(25)) / 25),
    "peak": (given(one=1.0, peak=50.0), 1 + 0.5 * np.sqrt(np.pi)),
    "linear": (given(one=1.0, t=1.0), 1.5),
}


@pytest.mark.serial
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize(("degree", "friction"), [(1, 0.0), (2, 0.5)])
def test_a_dictated_resultant_is_that_of_the_load(load, degree, friction):
    """Only the contact holds the body vertically."""
    pressure, true = LOADS[load]
    scene = ec.Scene(
        material=ec.Elastic(1e3, 0.3),
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[ec.Traction("top", pressure=pressure)],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    error = measured(scene, square(4), degree=degree)
    b = ec.resultant(error, "bottom", (0.0, 1.0))
    assert b.value == pytest.approx(true, rel=1e-7)
    assert b.guaranteed
    assert holds(b, true)
    assert b.high - b.low < 1e-6
    assert (error.oscillations.loads == 0.0) == (load == "linear")
    assert ec.potential_energy(error).guaranteed == (load == "linear" and not friction)


def test_a_dictated_resultant_in_space():
    """A jump inside triangles is not resolved.

    The value is near the truth, and is no guarantee.
    """

    def pull(x):
        return ufl.conditional(ufl.lt(x[0] + 0.2 * x[1], 0.437), -1.0, 0.0)

    scene = ec.Scene(
        material=ec.Elastic(1e3, 0.3),
        supports=[
            ec.Displacement("left", (0.0, None, None)),
            ec.Displacement("front", (None, 0.0, None)),
        ],
        loads=[ec.Traction("top", (0.0, 0.0, pull))],
        contacts=[ec.Contact("bottom")],
    )
    b = ec.resultant(
        measured(scene, ec.box((0.0,) * 3, (1.0,) * 3, cells=(2, 2, 2))), "bottom", (0.0, 0.0, 1.0)
    )
    assert b.value == pytest.approx(0.337, rel=5e-3)
    assert not b.guaranteed


# -- moduli
# --------------------------------------------------------------------------------------------------


def pressed_along(E) -> ec.Scene:
    """Poisson's ratio 0, moduli that vary along the pressure.

    The energy is ``-1/2 int 1/E``.
    """
    return ec.Scene(
        material=ec.Elastic(E, 0.0),
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[ec.Traction("top", pressure=1.0)],
        contacts=[ec.Contact("bottom")],
    )


def pressed_across(E) -> ec.Scene:
    """Poisson's ratio 0, moduli that vary across the pressure.

    Uniform strain 0.1, the energy is ``0.005 int E``.
    """
    return ec.Scene(
        material=ec.Elastic(E, 0.0),
        supports=[ec.Displacement("left", (0.0, None)), ec.Displacement("top", (None, -0.1))],
        contacts=[ec.Contact("bottom")],
    )


MODULI = {
    "soft stripe along": ({"one": 100.0, "stripe": -99.0}, -0.5 * (0.05 + 0.95 / 100), False),
    "hard stripe across": ({"one": 1.0, "stripe": 99.0}, 0.005 * 5.95, False),
    "steep along": ({"one": 1e-3, "exp": 1.0}, None, True),
    "steep across": ({"one": 1.0, "exp": 1.0}, 0.005 * (1 + (np.exp(25) - 1) / 25), True),
    "waves across": ({"one": 1.0, "cos": 0.95}, 0.005, True),
    "linear along": ({"one": 1.0, "t": 1.0}, -0.5 * np.log(2), True),
}


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("case", "degree"), [*((c, 1) for c in MODULI), ("soft stripe along", 2), ("steep across", 2)]
)
def test_energy_of_moduli_that_vary_in_cells(case, degree):
    coefficients, true, resolved = MODULI[case]
    if true is None:
        t = (np.arange(200000) + 0.5) / 200000
        true = -0.5 * np.mean(1 / (1e-3 * (1 + np.exp(25 * t))))
    along = case.endswith("along")
    scene = (pressed_along if along else pressed_across)(given(axis=int(along), **coefficients))
    error = measured(scene, square(4), degree=degree)
    b = ec.potential_energy(error)
    print(f"\n{case}: {true:.6g} in [{b.low:.6g}, {b.high:.6g}], {error.oscillations}")
    assert holds(b, true)
    assert b.guaranteed == resolved
    assert (error.oscillations.moduli == 0.0) == resolved
    if not along:
        force = ec.resultant(error, "bottom", (0.0, 1.0))
        assert holds(force, 20 * true)
        assert force.guaranteed == resolved


def test_moduli_of_a_function():
    """A modulus given as a P1 function of the mesh varies in the cells as the same callable of x does."""
    domain = square(4)
    field = fem.Function(fem.functionspace(domain.mesh, ("Lagrange", 1)))
    field.interpolate(lambda x: 1 + x[1])
    b = ec.potential_energy(measured(pressed_along(lambda x: field), domain))
    assert b.guaranteed
    assert holds(b, -0.5 * np.log(2))
    same = ec.potential_energy(measured(pressed_along(given(axis=1, one=1.0, t=1.0)), domain))
    assert b.value == pytest.approx(same.value, rel=1e-9)
    assert b.low == pytest.approx(same.low, rel=1e-6)


# -- gaps, normals, supports
# ---------------------------------------------------------------------------------


def sunk(gap=0.0, sink=-0.02, **options) -> ec.Scene:
    return pressed(ec.Elastic(1.0, 0.3), (0.01, sink), gap=gap, **options)


@pytest.mark.serial
@DEGREES
@pytest.mark.parametrize(
    ("power", "carried"), [("t", (True, True)), ("t2", (False, True)), ("t3", (False, False))]
)
def test_bilateral_gap_that_varies(power, carried, degree):
    """u^ meets the gap where it is a polynomial of its degree on each facet, else nowhere but at the nodes."""
    error = measured(sunk(given(**{power: 0.01}), bilateral=True), square(4), degree=degree)
    assert ec.potential_energy(error).guaranteed == carried[degree - 1]
    assert ec.resultant(error, "bottom", (0.0, 1.0)).guaranteed == carried[degree - 1]
    assert (error.oscillations.gaps == 0.0) == carried[degree - 1]


@pytest.mark.serial
@DEGREES
@pytest.mark.parametrize("width", [0.02, 0.005])
def test_asperity_between_the_nodes(width, degree):
    """The lowest point of the gap is on no node and between few samples.

    u^ does not enter it anywhere.
    """
    error = measured(sunk(given(one=0.01, peak=-0.009, width=width)), square(4), degree=degree)
    pair = error.admissible
    model, (traction,) = pair.solution.model, pair.tractions
    t = np.linspace(0, 1, 1001)[:, None]
    x = model.space.evaluate(model.space.x, t, traction.contact.facets)
    down = -np.matmul(
        lagrange(1, degree, t), pair.displacement.x.array.reshape(-1, 2)[traction.nodes]
    )[..., 1]
    gap = 0.01 - 0.009 * np.exp(-(((x[..., 0] - 0.53) / width) ** 2))
    assert (down - gap).max(initial=-np.inf) <= 1e-15
    assert ec.potential_energy(error).guaranteed


@pytest.mark.serial
@DEGREES
@pytest.mark.parametrize(("power", "carried"), [("t", (True, True)), ("t2", (False, True))])
def test_supports_that_vary(power, carried, degree):
    error = measured(sunk(sink=given(one=-0.02, **{power: 0.01})), square(4), degree=degree)
    assert ec.potential_energy(error).guaranteed == carried[degree - 1]
    assert (error.oscillations.supports == 0.0) == carried[degree - 1]


@pytest.mark.serial
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_normal_that_varies(tilt):
    """A normal that is constant though given as a callable is represented exactly.

    One that turns along a facet is not.
    """
    error = measured(sunk(normal=lambda x: (given(t=tilt)(x), -1.0)), square(4))
    assert ec.potential_energy(error).guaranteed == (tilt == 0.0)
    assert (error.oscillations.gaps == 0.0) == (tilt == 0.0)


@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1], [2]))
def test_what_the_mesh_represents_stays_guaranteed(degree):
    """Moduli by region, tractions, pressure, supports, gap and friction bound linear, a constant body force."""
    domain = two_materials(np.array([1.0, 1.0]), 0.3, MPI.COMM_WORLD)
    scene = ec.Scene(
        material=ec.Elastic(E={"lower": 1.0, "upper": 50.0}, nu={"lower": 0.4, "upper": 0.1}),
        supports=[ec.Displacement("top", (0.01, given(one=-0.03, t=0.01)))],
        loads=[
            ec.Traction("left", pressure=given(axis=1, one=1e-3, t=1e-3)),
            ec.Traction("right", (given(axis=1, t=-1e-3), 1e-4)),
            ec.BodyForce((0.0, -1e-3)),
        ],
        contacts=[ec.Contact("bottom", gap=given(t=1e-3), friction=ec.Tresca(given(t=2e-3)))],
    )
    error = measured(scene, domain, degree=degree)
    assert error.oscillations == ec.Oscillations()
    assert error.oscillation == 0.0
    assert ec.potential_energy(error).guaranteed
    assert ec.resultant(error, "bottom", (0.0, 1.0)).guaranteed
    assert ec.resultant(error, "bottom", (1.0, 0.0)).guaranteed


@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2]))
def test_heat_in_space_stays_guaranteed(degree):
    """A strain of heat that is linear, or smooth, is resolved in tetrahedra, too."""
    body = ec.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=(2, 1, 1))
    heat = ec.ThermalStrain(1e-3, lambda x: 5.0 * ufl.exp(-x[0]) + x[1])
    held = ec.Displacement("left", (0.0, 0.0, 0.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), held, contacts=ec.Contact("bottom"), strains=heat)
    error = measured(scene, body, degree=degree)
    assert error.oscillations == ec.Oscillations()
    assert ec.potential_energy(error).guaranteed


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [2])
def test_rank_independence(degree):
    """All ranks see the same projections of a load that jumps, the same integrals and the same oscillations."""
    scene = ec.Scene(
        material=ec.Elastic(given(axis=1, one=1.0, sin=0.5, often=10.0), 0.3),
        supports=[ec.Displacement("top", (0.01, given(one=-0.02, t3=0.01)))],
        loads=[
            ec.Traction("right", pressure=given(axis=1, step=1e-3)),
            ec.BodyForce((0.0, given(axis=1, one=1e-3, sin=1e-3))),
        ],
        contacts=[
            ec.Contact("bottom", gap=given(t2=0.02), friction=ec.Tresca(given(one=2e-3, sin=2e-3)))
        ],
    )
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = measured(scene, square(3, comm), degree=degree)
        b, force = ec.potential_energy(error), ec.resultant(error, "bottom", (0.0, 1.0))
        parts = vars(error.oscillations).values()
        results.append([error.relative, *parts, b.low, b.high, force.low, force.high])
    assert results[0] == pytest.approx(results[1], rel=1e-5, abs=1e-9)
    assert min(results[0][1:3]) > 0.0


# -- points of searches
# -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["moduli", pytest.param("gap", marks=pytest.mark.broad)])
def test_what_searches_leave_unknown_is_in_the_error(what):
    """A mesh searches rough data at so many points; more of them change e downwards alone."""
    scene = pressed_along(given(one=1.0, sin=0.5, often=60.0))
    if what == "gap":
        scene = sunk(given(one=0.001, sin=0.001, often=300.0))
    error = measured(scene, square(3))
    space = error.model.space
    name = "points_in_cells" if what == "moduli" else "points_on_facets"
    pair, few = error.admissible, getattr(space, name)
    setattr(space, name, 50 * few)
    resolved = ec.constitutive_error(pair)
    setattr(space, name, few // 50)
    rough = ec.constitutive_error(pair)
    assert resolved.absolute <= error.absolute * (1 + 1e-12)
    assert error.absolute <= rough.absolute * (1 + 1e-12)
    assert rough.absolute > 1.01 * resolved.absolute


def test_data_share_the_points_of_a_mesh():
    """A scene with three data that vary searches each of them at a third of the points."""
    rough = given(one=1.0, sin=0.5)
    scene = ec.Scene(
        ec.Elastic(rough, 0.3),
        [ec.Displacement("top", (0.0, -0.01))],
        [ec.BodyForce((0.0, rough)), ec.Traction("right", (1e-3, 0.0))],
        [ec.Contact("bottom", gap=rough, friction=rough)],
    )
    assert count_varying(scene) == 3
    plain = ec.Scene(ec.Elastic(1.0, 0.3), scene.supports, contacts=ec.Contact("bottom"))
    assert count_varying(plain) == 0
    whole, shared = (Model(one, square(2)).space for one in (plain, scene))
    assert shared.points_in_cells == whole.points_in_cells // 3
    assert shared.points_on_facets == whole.points_on_facets // 3


# -- random scenes
# -------------------------------------------------------------------------------------------


def a_scene(seed: int, degree: int) -> tuple[ec.Scene, bool]:
    """A scene with moduli, gap and Tresca friction of any kind, and whether the mesh represents loads and supports."""
    rng = np.random.default_rng(seed)
    carried = bool(seed % 4)
    often, slope, wave, load, tilt, bend, curve, bumps, limit = rng.uniform(
        [5, -0.6, 0, -2e-3, -2e-3, 2e-3, 0, 0, 1e-3],
        [20, 0.6, 0.3, 2e-3, 2e-3, 5e-3, 0.03, 1e-3, 3e-3],
    )
    bend, waves = (bend * (degree == 2), 0.0) if carried else (bend, load)
    return ec.Scene(
        material=ec.Elastic(given(axis=seed % 2, one=1.0, t=slope, sin=wave, often=often), 0.3),
        supports=[ec.Displacement("top", (0.01, given(one=-0.02, t=tilt, t2=bend)))],
        loads=[
            ec.Traction("right", pressure=given(axis=1, one=load, t=load, sin=waves, often=often))
        ],
        contacts=[
            ec.Contact(
                "bottom",
                gap=given(one=bumps, t2=curve, sin=bumps, often=often),
                friction=ec.Tresca(given(one=limit, sin=limit, often=often)),
            )
        ],
    ), carried


def by_brute_force(scene: ec.Scene, n: int) -> np.ndarray:
    """Energy and vertical force on the foundation of a fine quadratic solution, with quadrature of high degree."""
    solution = ec.solve(scene, square(n), degree=2)
    model, u = solution.model, solution.u
    (contact,), phi = model.contacts, fem.Function(model.space.V)
    (load,) = model.surface_loads
    on_right, traction = load.ds, load.density
    dx, on_right, on_contact = (
        m(metadata={"quadrature_degree": 12}) for m in (model.space.dx, on_right, contact.ds)
    )
    slip = u - ufl.dot(u, contact.normal) * contact.normal
    friction = contact.friction.bound(0.0) * ufl.sqrt(ufl.dot(slip, slip)) * on_contact
    phi.x.array.reshape(-1, 2)[np.unique(model.space.facet_nodes(contact.facets)), 1] = 1.0

    def elastic(v, w):
        return ufl.inner(model.stress(v), strain(w)) * dx

    energy = 0.5 * elastic(u, u) - ufl.inner(traction, u) * on_right + friction
    force = elastic(u, phi) - ufl.inner(traction, phi) * on_right
    return np.array([fem.assemble_scalar(fem.form(form)) for form in (energy, force)])


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", [1, 4, 7])
def test_what_is_guaranteed_is_true(seed):
    degree = 1 + seed // 4
    scene, carried = a_scene(seed, degree)
    error = measured(scene, square(4), degree=degree)
    rough, true = (by_brute_force(scene, n) for n in (8, 16))
    bounds = ec.potential_energy(error), ec.resultant(error, "bottom", (0.0, 1.0))
    for b, t, unsure in zip(bounds, true, abs(true - rough), strict=True):
        print(f"{seed}: {t:.5g} in [{b.low:.5g}, {b.high:.5g}] {b.guaranteed} {error.oscillations}")
        assert b.low - unsure <= t <= b.high + unsure
        assert unsure < 0.2 * (b.high - b.low)
        assert b.guaranteed == carried
