"""Normals that turn along curved sides: what slides along them does not catch.

Properties: estimated normals are exact on circles of any facets and on quadrics, and
keep sharp edges; a shaft that is turned in its hub or pushed along it, and a ball that
is turned in its shell, need no force without friction, on any mesh, refined and
remeshed; tractions lie in the cone and displacements do not penetrate at random points,
by an evaluation of their own; e bounds both errors; both methods press alike; the
friction of a press fit is the textbook's.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from reference import nested, true_errors
from scenes import certified

import erc_contact as ec
from erc_contact.model.contact.normals import normal_field, normals_of_side
from erc_contact.model.contact.trace import interpolate_normals
from erc_contact.model.contact.turning import Turning
from erc_contact.model.data.expressions import evaluate
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.base.releases import cell_nodes
from namedmesh.normals import vertex_normals
from namedmesh.simplex import barycentric, bernstein, lagrange, outward_normals, rule

COMM = MPI.COMM_WORLD
E, NU = 210.0, 0.3
CORE, INNER, OUTER, HEIGHT = 5.0, 10.0, 20.0, 6.0
DELTA = 0.05
"""Interference."""
ROUND_OFF = 1e-11


def rings(occ, d: int):
    """A ring in a ring: tubes of some height in 3D."""
    circles = [occ.addDisk(0, 0, 0, r, r) for r in (CORE, INNER, OUTER)]
    shaft, _ = occ.cut([(2, circles[1])], [(2, circles[0])], removeTool=True)
    hub, _ = occ.cut([(2, circles[2])], shaft, removeTool=False)
    hub, _ = occ.cut(hub, [(2, occ.addDisk(0, 0, 0, CORE, CORE))])
    if d == 3:
        shaft, hub = (
            [entity for entity in occ.extrude(body, 0, 0, HEIGHT) if entity[0] == 3]
            for body in (shaft, hub)
        )
    return shaft, hub


def shells(occ, d: int):
    """A thick shell in a thick shell."""
    balls = [occ.addSphere(0, 0, 0, r) for r in (CORE, INNER, OUTER)]
    shaft, _ = occ.cut([(3, balls[1])], [(3, balls[0])], removeTool=True)
    hub, _ = occ.cut([(3, balls[2])], shaft, removeTool=False)
    hub, _ = occ.cut(hub, [(3, occ.addSphere(0, 0, 0, CORE))])
    return shaft, hub


def fit(shape, d: int, size: float, *, known: bool = True) -> ec.Domain:
    """Return a body in a body, split into the parts "rim" and "bore"."""
    gmsh = pytest.importorskip("gmsh")

    def parts():
        occ = gmsh.model.occ
        shaft, hub = shape(occ, d)
        occ.fragment(shaft, hub)
        occ.synchronize()
        by_size = sorted(gmsh.model.getEntities(d), key=lambda body: occ.getMass(*body))
        for name, (_, body) in zip(("shaft", "hub"), by_size, strict=True):
            gmsh.model.addPhysicalGroup(d, [body], name=name)
        groups = {}
        for _, side in gmsh.model.getEntities(d - 1):
            low, high = np.reshape(gmsh.model.getBoundingBox(d - 1, side), (2, 3))
            radius = round(max(high[:2]))
            name = {5: "core", 10: "joint", 20: "outside"}[radius]
            if d == 3 and shape is rings and high[2] - low[2] < 1e-3:
                name = "ends"
            groups.setdefault(name, []).append(side)
        for name, sides in groups.items():
            gmsh.model.addPhysicalGroup(d - 1, sides, name=name)

    if COMM.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        parts()
    domain = ec.from_gmsh(gmsh.model)
    if COMM.rank == 0:
        gmsh.finalize()
    if not known:
        # A mesh of nobody's drawing has its vertices on the surfaces.
        domain.mesh.geometry.x[:] = domain.drawn_points[0]
        domain = ec.Domain(
            domain.mesh, domain.facet_tags, domain.names, domain.cell_tags, domain.regions
        )
    return domain.split({"rim": "shaft", "bore": "hub"})


def moved(d: int, spin: np.ndarray, push: float):
    """Return the components of a rigid motion as callables."""
    lever = np.zeros((d, d))
    if d == 2:
        lever[:] = spin[2] * np.array([[0.0, -1.0], [1.0, 0.0]])
    else:
        lever[:] = np.array(
            [[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]]
        )
    values = []
    for i in range(d):
        extra = push if i == 2 else 0.0

        def component(x, i=i, extra=extra):
            return sum(float(lever[i, j]) * x[j] for j in range(d)) + extra

        values.append(component)
    return tuple(values)


def sliding(d: int, spin=(0.0, 0.0, 0.0), push: float = 0.0, friction=0.0) -> ec.Scene:
    """The core moves rigidly, the outside is at rest; the fit presses."""
    return ec.Scene(
        ec.Elastic(E, NU),
        supports=[
            ec.Displacement("core", moved(d, np.array(spin), push)),
            ec.Displacement("outside", (0.0,) * d),
        ],
        contacts=ec.Contact("rim", against="bore", friction=friction, gap=-DELTA),
    )


CASES = {
    "turned in the plane": (rings, 2, (0.0, 0.0, 0.01), 0.0),
    "turned about the axis": (rings, 3, (0.0, 0.0, 0.01), 0.0),
    "pushed along the axis": (rings, 3, (0.0, 0.0, 0.0), 0.1),
    "ball in a shell": (shells, 3, (0.006, -0.004, 0.008), 0.0),
}


def forces(result) -> tuple[float, np.ndarray]:
    """Return axial force over pressure times area, and moments over that times INNER."""
    force = result.force("rim")
    profile = result.profile("rim")
    size = float(profile["weight"] @ profile["pressure"])
    moments = abs(np.atleast_1d(force.moment)) / (INNER * size)
    return float(abs(force.force[-1])) / size, moments


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.parametrize("known", [True, False], ids=["drawn", "mesh only"])
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()], ids=["N", "AL"])
@pytest.mark.parametrize("name", CASES)
@pytest.mark.on_ranks("turned in the plane-N-drawn", "ball in a shell-AL-drawn")
def test_what_slides_without_friction_does_not_catch(name, method, known):
    shape, d, spin, push = CASES[name]
    domain = fit(shape, d, 4.0 if d == 2 else 6.0, known=known)
    solution = ec.solve(sliding(d, spin, push), domain, method)
    error = ec.constitutive_error(ec.equilibrate(solution))
    for result in (solution, error):
        along, about = forces(result)
        if shape is shells:
            assert about.max() < ROUND_OFF
        else:
            assert about[-1] < ROUND_OFF
        if shape is rings and d == 3:
            assert along < ROUND_OFF


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_refined_and_remeshed_bodies_do_not_catch_either(degree):
    shape, d, spin, push = CASES["turned in the plane"]
    coarse = fit(shape, d, 4.0)
    for domain in (coarse.refined(), coarse.remeshed(2.5)):
        solution = ec.solve(sliding(d, spin, push), domain, degree=degree)
        _, about = forces(solution)
        assert about[-1] < ROUND_OFF


def test_a_fit_that_slides_is_certified_like_one_at_rest():
    domain = fit(rings, 2, 3.0)
    relative = []
    for spin in (0.0, 0.01):
        solution = ec.solve(sliding(2, (0.0, 0.0, spin)), domain, degree=2)
        error = ec.constitutive_error(ec.equilibrate(solution))
        relative.append(error.absolute)
    assert relative[1] == pytest.approx(relative[0], rel=1e-3)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.parametrize("friction", [0.0, 0.1])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("shape", [rings, shells], ids=["rings", "shells"])
@pytest.mark.on_ranks("rings-2-0.1", "shells-1-0.1")
def test_pairs_are_admissible_at_random_points(shape, degree, friction):
    d = 2 if shape is rings else 3
    domain = fit(shape, d, 3.0 if d == 2 else 6.0)
    scene = sliding(d, (0.0, 0.0, 0.004), 0.0, friction)
    solution = ec.solve(scene, domain, degree=degree)
    pair = ec.equilibrate(solution)
    (traction,) = pair.tractions
    trace = traction.contact.trace
    points = np.random.default_rng(3).dirichlet(np.ones(d), 40)[:, 1:]
    # The normals once more, by hand.
    places = np.column_stack([1 - points.sum(axis=1), points])
    field = np.einsum("qv,fvi->fqi", places, trace.corner_normals)
    normals = field / np.linalg.norm(field, axis=-1)[..., None]
    r = np.einsum("qm,fmi->fqi", bernstein(d - 1, degree, points), traction.values)
    w = np.einsum(
        "qm,fmi->fqi", lagrange(d - 1, degree, points), trace.of(pair.displacement.x.array)
    )
    r_n = (r * normals).sum(axis=-1)
    shear = np.linalg.norm(r - r_n[..., None] * normals, axis=-1)
    size = abs(r).max(initial=0.0)
    assert r_n.max(initial=0.0) <= 1e-13 * size
    assert (shear + friction * r_n).max(initial=-1.0) <= 1e-12 * size
    length = np.linalg.norm(field, axis=-1)
    assert ((w * normals).sum(axis=-1) + DELTA * length).max(initial=-1.0) <= 1e-12
    # Round trip: the traction is in equilibrium on the other body, too.
    error = ec.constitutive_error(pair)
    assert np.allclose(error.force("rim").force, -error.force("bore").force, atol=1e-9 * size)


def radial(x):
    """Return the unit vector from the axis, UFL."""
    radius = ufl.sqrt(x[0] ** 2 + x[1] ** 2)
    return (x[0] / radius, x[1] / radius)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("law", [0.0, ec.Tresca(0.4)], ids=["none", "given"])
def test_e_bounds_both_errors(law, degree):
    """On a foundation with a given normal: finer meshes of the polygon have the same one."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.cut([(2, occ.addDisk(0, 0, 0, INNER, INNER))], [(2, occ.addDisk(1, 0, 0, CORE, CORE))])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], name="disc")
    for _, curve in gmsh.model.getEntities(1):
        is_outer = gmsh.model.getBoundingBox(1, curve)[3] > INNER - 1
        gmsh.model.addPhysicalGroup(1, [curve], name="rim" if is_outer else "core")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 4.0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 4.0)
    drawn = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    coarse = ec.Domain(drawn.mesh, drawn.facet_tags, drawn.names)
    scene = ec.Scene(
        ec.Elastic(E, NU),
        supports=[ec.Displacement("core", moved(2, np.array((0.0, 0.0, 0.01)), 0.0))],
        contacts=ec.Contact(
            "rim", friction=law, normal=radial, gap=lambda x: -0.03 * (1 + x[1] / 20)
        ),
    )
    error = certified(scene, coarse, degree=degree)
    assert error.model.contacts[0].trace.corner_normals is not None
    fine = ec.solve(scene, nested(coarse, 3), degree=2)
    true = true_errors(error.admissible, fine)
    assert true.both <= error.absolute + error.oscillation
    assert error.absolute < 2.0 * true.both


@pytest.mark.serial
def test_a_damaged_turn_is_refused(monkeypatch):
    """Whoever bends a traction out of its cone is told by the pair."""
    solution = ec.solve(sliding(2, (0.0, 0.0, 0.01), 0.0, 0.1), fit(rings, 2, 4.0), degree=2)
    ec.equilibrate(solution)
    whole = Turning.tractions

    def bent(self, z):
        return whole(self, z) @ np.array([[1.0, 1e-4], [-1e-4, 1.0]])

    monkeypatch.setattr(Turning, "tractions", bent)
    with pytest.raises(ec.NotBalanced, match="in the law of Contact"):
        ec.equilibrate(solution)


@pytest.mark.serial
def test_flat_sides_ask_nothing_of_the_drawing(monkeypatch):
    """A curved hole elsewhere changes nothing for them."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.addRectangle(0, 0, 0, 4, 1)
    occ.addRectangle(0, 1, 0, 4, 1)
    occ.fragment(occ.cut([(2, 1)], [(2, occ.addDisk(2, 0.4, 0, 0.2, 0.2))])[0], [(2, 2)])
    occ.synchronize()
    rules = {"foot": ec.where(y=0.0), "roof": ec.where(y=2.0)}
    regions = {"low": ec.where(y=(0.0, 1.0)), "high": ec.where(y=(1.0, 2.0))}
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    domain = ec.from_gmsh(gmsh.model, parts=rules, regions=regions)
    gmsh.finalize()
    assert domain.curved_facets is not None
    domain = domain.split({"top": "low", "bottom": "high"})
    supports = [ec.Displacement("foot", (0.0, 0.0)), ec.Displacement("roof", (0.0, -0.01))]
    scene = ec.Scene(ec.Elastic(E, NU), supports, contacts=ec.Contact("top", against="bottom"))
    monkeypatch.setattr("namedmesh.shape.session", None)
    contact = Model(scene, domain, 1, None).contacts[0]
    assert contact.trace.corner_normals is None


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_the_error_of_a_sliding_fit_falls_at_the_rate(degree):
    scene = sliding(2, (0.0, 0.0, 0.01), 0.0, 0.1)
    domain = fit(rings, 2, 6.0)
    relative = []
    for _ in range(3):
        error = certified(scene, domain, degree=degree)
        relative.append(error.relative)
        domain = domain.refined()
    rates = np.log2(np.array(relative[:-1]) / relative[1:])
    assert rates[-1] > (0.9 if degree == 1 else 1.4)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_methods_press_alike_from_facet_to_facet(degree):
    domain = fit(rings, 2, 2.0)
    for friction in (0.0, 0.2):
        profiles = []
        for method in (ec.Nitsche(), ec.AugmentedLagrangian()):
            solution = ec.solve(
                sliding(2, (0.0, 0.0, 0.01), 0.0, friction), domain, method, degree=degree
            )
            error = ec.constitutive_error(ec.equilibrate(solution))
            for profile in (solution.profile("rim"), error.profile("rim")):
                profiles.append(profile["pressure"])
                weight = profile["weight"] / profile["weight"].sum()
                mean = weight @ profile["pressure"]
                # The exact pressure is the same all around.
                spread = np.sqrt(weight @ (profile["pressure"] - mean) ** 2)
                assert spread < error.relative * mean
        distance = np.sqrt(weight @ (profiles[0] - profiles[2]) ** 2)
        assert distance < error.relative * mean


@pytest.mark.broad
@pytest.mark.serial
def test_the_torque_of_a_press_fit_is_the_textbook_s():
    modulus, ratio = E / (1 - NU**2), NU / (1 - NU)
    # Fixed rims: u_r = 0 at the core and outside, u_r = A r + B/r between them.
    stiffness = 0.0
    for fixed in (CORE, OUTER):
        # sigma_r and u_r at INNER for u = r - fixed^2/r.
        u = INNER - fixed**2 / INNER
        stress = (
            modulus
            / (1 - ratio**2)
            * ((1 + fixed**2 / INNER**2) + ratio * (1 - fixed**2 / INNER**2))
        )
        stiffness += abs(u / stress)
    pressure = DELTA / stiffness
    scene = sliding(2, (0.0, 0.0, 0.2), 0.0, 0.15)
    history = ec.adapt(scene, fit(rings, 2, 3.0), accuracy=0.01, degree=2, max_cells=20_000)
    torque = abs(np.atleast_1d(history.force("rim").moment)[-1])
    assert torque == pytest.approx(2 * np.pi * INNER**2 * 0.15 * pressure, rel=1e-3)


# ---------------------------------------------------------------- normals of facets


def closed_curve(angles: np.ndarray, radii=(1.0, 1.0)):
    """Return corners, vertices and outward normals of the facets of an ellipse."""
    x = np.column_stack([radii[0] * np.cos(angles), radii[1] * np.sin(angles)])
    vertices = np.column_stack([np.arange(len(x)), np.roll(np.arange(len(x)), -1)])
    corners = x[vertices]
    edge = corners[:, 1] - corners[:, 0]
    normals = np.column_stack([edge[:, 1], -edge[:, 0]])
    return corners, vertices, normals / np.linalg.norm(normals, axis=1)[:, None]


@pytest.mark.serial
@pytest.mark.parametrize("count", [10, 40], ids=["means", "quadric"])
def test_normals_are_exact_on_circles_of_any_facets(count):
    angles = np.sort(np.random.default_rng(1).uniform(0, 2 * np.pi, count))
    angles = np.concatenate([angles, np.linspace(0, 2 * np.pi, 10, endpoint=False)])
    corners, vertices, normals = closed_curve(np.unique(angles))
    found = vertex_normals(MPI.COMM_SELF, corners, vertices, normals)
    assert abs(found - corners).max() < 1e-12


@pytest.mark.serial
def test_ends_of_an_arc_turn_on():
    angles = np.array([0.0, 0.3, 0.5, 0.9])
    corners, vertices, normals = closed_curve(angles)
    found = vertex_normals(MPI.COMM_SELF, corners[:-1], vertices[:-1], normals[:-1])
    assert abs(found - corners[:-1]).max() < 1e-12


@pytest.mark.serial
def test_sharp_edges_keep_a_normal_on_each_side():
    corners, vertices, normals = closed_curve(np.array([0.0, 0.5, 1.0, 1.5]) * np.pi)
    found = vertex_normals(MPI.COMM_SELF, corners, vertices, normals)
    assert abs(found - normals[:, None]).max() < 1e-15


@pytest.mark.serial
def test_cells_at_a_sharp_edge_have_both_normals():
    """A cell at the edge of a cube has facets on two or three of its sides."""
    domain = ec.box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.0, 0.0, 0.0))])
    model = Model(scene, domain, 1, None)
    facets = np.concatenate([domain.facets(name) for name in domain.names])
    sides_of_cell = np.bincount(facets[:, 0])
    assert sides_of_cell.max() >= 2
    # Each side bulges a little.
    own = model.space.outward_normals(facets)
    tilted = own[:, None] + 0.05 * model.space.facet_corners(facets) * (1 - abs(own[:, None]))
    tilted /= np.linalg.norm(tilted, axis=-1)[..., None]
    normal, of_corners = normal_field(model.space, facets, tilted)
    assert abs(of_corners - tilted).max() < 1e-15
    points, _ = rule(2, 4)
    expected = interpolate_normals(tilted, barycentric(points))
    field = evaluate(normal, domain.mesh, points, facets)
    assert abs(field / np.linalg.norm(field, axis=-1)[..., None] - expected).max() < 1e-13


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_turned_tractions_lie_in_the_cone_and_do_the_same_work(d, degree):
    rng = np.random.default_rng(d)
    f, mu = 30, 0.4
    middle = rng.standard_normal((f, d))
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    corners = middle[:, None] + 0.3 * rng.standard_normal((f, d, d))
    corners /= np.linalg.norm(corners, axis=2)[..., None]
    here = SimpleNamespace(d=d, degree=degree)
    trace = SimpleNamespace(here=here, direction=middle, normals_at_vertices=corners)
    turning = Turning(trace)
    count = 1 if degree == 1 else d
    pressure = rng.uniform(0, 1, (f, count))
    slip = rng.standard_normal((f, count, d))
    slip -= (slip * middle[:, None]).sum(axis=-1)[..., None] * middle[:, None]
    slip *= (mu * pressure / np.linalg.norm(slip, axis=2))[..., None]
    z = slip - pressure[..., None] * middle[:, None]
    values = turning.tractions(z)
    points, weights = rule(d - 1, 6)
    shape = bernstein(d - 1, degree, points)
    r = np.matmul(shape, values)
    normals = interpolate_normals(corners, barycentric(points))
    r_n = (r * normals).sum(axis=-1)
    shear = np.linalg.norm(r - r_n[..., None] * normals, axis=-1)
    assert (shear + mu * r_n).max() <= 1e-14
    # Work on a motion, by quadrature and by the means of z.
    motion = rng.standard_normal((f, shape.shape[1], d))
    work = ((r * np.matmul(shape, motion)).sum(axis=-1) @ weights).sum()
    assert (z * turning.means(motion)).sum() / count == pytest.approx(work, rel=1e-12)
    # What is turned and turned back is as before, in the plane.
    if d == 2:
        back = turning.back(r, points)
        assert abs(back - np.matmul(bernstein(1, degree - 1, points), z)).max() < 1e-14


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["cylinder", "sphere", "cone"])
def test_normals_are_exact_on_quadrics(kind):
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    if kind == "sphere":
        occ.addSphere(0, 0, 0, 1.0)
    elif kind == "cylinder":
        occ.addCylinder(0, 0, 0, 0, 0, 2.0, 1.0)
    else:
        occ.addCone(0, 0, 0, 0, 0, 2.0, 1.0, 0.4)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    curved = [f for _, f in gmsh.model.getEntities(2) if gmsh.model.getType(2, f) != "Plane"]
    gmsh.model.addPhysicalGroup(2, curved, name="curved")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    domain.mesh.geometry.x[:] = domain.drawn_points[0]
    facets = domain.facets("curved")
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("curved", (0.0, 0.0, 0.0))])
    model = Model(scene, domain, 1, None)
    space = model.space
    corners = space.facet_corners(facets)
    own = outward_normals(space.cell_corners()[facets[:, 0]], facets[:, 1])
    found = vertex_normals(COMM, corners, space.facet_nodes(facets), own)
    radial = corners.copy()
    if kind != "sphere":
        radius = np.linalg.norm(corners[..., :2], axis=2)
        slope = 0.3 if kind == "cone" else 0.0
        radial[..., 2] = slope * radius
    radial /= np.linalg.norm(radial, axis=2)[..., None]
    assert abs(found - radial).max() < 1e-9


def test_a_shaft_without_friction_carries_its_weight():
    """It may turn, and the centre of its polygon is not the centre of its circles.

    The moment of the weight is as small as what facets lose: on a mesh that is refined
    on a side, too.
    """
    domain = fit(rings, 2, 4.0)
    weight = ec.BodyForce((0.3, -1.0), region="shaft")
    for _ in range(2):
        held = ec.Displacement("outside", (0.0, 0.0))
        contact = ec.Contact("rim", against="bore")
        scene = ec.Scene(ec.Elastic(E, NU), held, weight, contacts=contact)
        force = certified(scene, domain).force("rim").force
        area = np.pi * (INNER**2 - CORE**2)
        assert force == pytest.approx(-area * np.array(weight.value), rel=1e-3)
        x = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)][: domain.owned_cells, :, 0]
        domain = domain.refined(np.flatnonzero(x.min(axis=1) > 4.0))


CONE = (
    'SetFactory("OpenCASCADE"); Cone(1) = {0, 0, 0, 0, 0, 1, 0.5, 0.8};\n'
    'Physical Surface("mantle") = {1}; Physical Surface("ends") = {2, 3};\n'
    'Physical Volume("cone") = {1}; Mesh.MeshSizeMax = 0.6; Mesh.MeshSizeMin = 0.6;\n'
)


def test_normals_at_the_rims_of_a_cone(shared_tmp_path):
    """Vertices of a rim lie beside the cone, in the planes of its ends.

    From there gmsh finds a point on the far side of the cone, or none.
    """
    pytest.importorskip("gmsh")
    path = shared_tmp_path / "cone.geo"
    if COMM.rank == 0:
        path.write_text(CONE)
    COMM.barrier()
    domain = ec.read_mesh(path, scripts=True)
    space = Space(domain, 1)
    facets = domain.facets("mantle")
    corners = space.facet_corners(facets)
    found = normals_of_side(space, facets, corners)
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    slope = 0.3
    true = corners.copy()
    true[..., 2] = -slope * np.linalg.norm(corners[..., :2], axis=-1)
    true /= np.linalg.norm(true, axis=-1, keepdims=True)
    owned = space.owned(facets)
    assert COMM.allreduce(float(abs(found - true)[owned].max(initial=0.0)), MPI.MAX) < 1e-9
    assert (
        abs(np.linalg.norm(corners[..., :2], axis=-1) - 0.5 - slope * corners[..., 2]).max() > 0.01
    )


def corner_of_ring(cells):
    """A quarter of a ring between radii 1 and 2, made of a rectangle."""
    whole = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=cells)
    x = whole.mesh.geometry.x
    radius, angle = 1.0 + x[:, 0], np.pi / 2 * x[:, 1]
    x[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return ec.Domain(whole.mesh, whole.facet_tags, whole.names)


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_vertices_beside_the_circle_do_not_let_a_ring_turn(degree):
    """New vertices lie on chords: there given normals hold the turn, as the pair knows."""
    ring = corner_of_ring((2, 4)).refined()
    around = ec.Contact("right", normal=lambda x: (x[0], x[1]), gap=-2e-3)
    scene = ec.Scene(ec.Elastic(1.0, NU), loads=ec.Traction("left", pressure=3e-3), contacts=around)
    assert certified(scene, ring, degree=degree).relative < 0.9


def test_a_circle_of_four_facets_is_refused():
    square = ec.rectangle((-1.0, -1.0), (1.0, 1.0), cells=(1, 1))
    around = ec.Contact("bottom", normal=lambda x: (x[0], x[1]))
    scene = ec.Scene(ec.Elastic(1.0, NU), ec.Displacement("top", (0.0, -0.01)), contacts=around)
    with pytest.raises(ec.InputError, match="turns by 90 degrees along a facet"):
        ec.solve(scene, square)
