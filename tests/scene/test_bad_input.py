"""Bad input ends in an error that says what was got, what is allowed and what to do, on every rank.

Properties: every rank raises, none waits for another; the type is one of the package's;
the message names the thing.
"""

import dataclasses
import json
import math
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from domains import refused
from mpi4py import MPI
from processes import output, started
from scenes import certified, two_squares

import erc_contact as ec
import namedmesh as nm
from erc_contact.model.promises import bind
from erc_contact.newton.contact_solve import ContactSolve
from erc_contact.newton.direct import Direct
from namedmesh import gmsh_session as our_session
from namedmesh.shape import Drawing

COMM = MPI.COMM_WORLD
STEEL = ec.Elastic(E=1.0, nu=0.3)
PUSH = ec.Traction("top", (0.0, -0.01))
SINK = ec.Displacement("top", (0.0, -0.01))


def refused_scene(domain, *words, error=ec.InputError, **entries):
    """The scene is refused, when it is declared or when it is put on the domain."""
    entries = {"material": STEEL, "supports": [ec.Displacement("left", (0.0, 0.0))], **entries}
    refused(lambda: ec.solve(ec.Scene(**entries), domain), *words, error=error)


@pytest.fixture(scope="module")
def cube():
    return ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2))


# -- names
# ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "entries",
    [
        {"supports": [ec.Displacement("rihgt", (0.0, 0.0))]},
        {"loads": [ec.Traction("rihgt", (0.0, 0.0))]},
        {"contacts": [ec.Contact("rihgt")]},
    ],
    ids=["Displacement", "Traction", "Contact"],
)
def test_unknown_boundary_part(entries, block):
    refused_scene(block, "'rihgt'", "bottom, left, right, top", **entries)


def test_unknown_region(gmsh_session):
    if gmsh_session:
        gmsh_session.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh_session.model.occ.synchronize()
        gmsh_session.model.addPhysicalGroup(2, [1], name="steel")
        gmsh_session.model.addPhysicalGroup(1, [4], name="left")
        gmsh_session.option.setNumber("Mesh.MeshSizeMin", 0.5)
    domain = ec.from_gmsh(gmsh_session.model if gmsh_session else None)
    refused_scene(domain, "'steal'", "steel", material=ec.Elastic(E={"steal": 1.0}, nu=0.3))
    refused(lambda: domain.region("steal"), "'steal'", "steel")


def test_region_of_a_mesh_without_regions(block):
    refused_scene(block, "'steel'", "none", material=ec.Elastic(E={"steel": 1.0}, nu=0.3))


def test_material_that_misses_cells():
    mesh = dmesh.create_unit_square(COMM, 4, 4)
    left = dmesh.locate_entities_boundary(mesh, 1, lambda x: x[0] < 1e-9)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    upper = dmesh.compute_midpoints(mesh, 2, cells)[:, 1] > 0.5
    tags = dmesh.meshtags(mesh, 2, cells, np.where(upper, 2, 1).astype(np.int32))
    facet_tags = dmesh.meshtags(mesh, 1, left, np.ones(len(left), dtype=np.int32))
    domain = ec.Domain(mesh, facet_tags, {"left": 1}, tags, {"lower": 1, "upper": 2})
    refused_scene(
        domain, "E", "16 cells", "lower", "upper", material=ec.Elastic(E={"lower": 1.0}, nu=0.3)
    )


# -- material
# ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nu", [-1.0, 0.5, 0.7, -2.0, float("nan")])
def test_poisson_ratio_outside_its_range(nu):
    refused(lambda: ec.Elastic(E=1.0, nu=nu), "nu", f"{nu:g}", "(-1, 1/2)")


@pytest.mark.parametrize("E", [0.0, -1.0, float("inf"), float("nan")])
def test_youngs_modulus_not_positive(E):
    refused(lambda: ec.Elastic(E=E, nu=0.3), "E is", f"{E:g}", "> 0")


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (ec.Elastic(E=lambda x: x[0] - 0.5, nu=0.3), ("E is -0.5", "> 0")),
        (ec.Elastic(E=lambda x: x[0], nu=0.3), ("E is 0", "> 0")),
        (ec.Elastic(E=1.0, nu=lambda x: 0.6 * x[1]), ("nu is 0.6", "(-1, 1/2)")),
    ],
    ids=["E < 0", "E = 0", "nu > 1/2"],
)
def test_modulus_out_of_range_somewhere(material, words, block):
    refused_scene(block, *words, material=material)


def test_hypothesis_that_does_not_exist():
    refused(
        lambda: ec.Elastic(E=1.0, nu=0.3, hypothesis="plain strain"),
        "'plain strain'",
        "plane strain",
    )


# -- friction, gap, normal
# -----------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [-0.1, float("nan"), float("inf"), "0.3", None])
def test_friction_negative_or_no_number(friction):
    refused(
        lambda: ec.Contact("bottom", friction=friction),
        "'bottom'",
        "friction",
        repr(friction),
        ">= 0",
    )


def test_friction_negative_somewhere(block):
    contact = ec.Contact("bottom", friction=lambda x: 0.3 - x[0])
    refused_scene(block, "'bottom'", "friction is -0.", ">= 0", contacts=[contact])


@pytest.mark.parametrize("gap", [float("nan"), float("inf"), "0"])
def test_gap_no_number(gap):
    refused(lambda: ec.Contact("bottom", gap=gap), "'bottom'", "gap", repr(gap), "finite")


@pytest.mark.parametrize(
    "normal", [(0.0, 0.0), (0.0,), "down", (0.0, None), "up", "gap", (0.0, lambda x: x[0])]
)
def test_normal_that_is_none(normal):
    refused(lambda: ec.Contact("bottom", normal=normal), "'bottom'", "normal")


def test_curved_part_needs_a_normal():
    mesh = dmesh.create_unit_square(COMM, 4, 4)
    foot = dmesh.locate_entities_boundary(mesh, 1, lambda x: np.minimum(x[0], x[1]) < 1e-9)
    domain = ec.Domain(
        mesh, dmesh.meshtags(mesh, 1, foot, np.ones(len(foot), dtype=np.int32)), {"foot": 1}
    )
    refused_scene(
        domain,
        "'foot'",
        "not flat",
        "normal=",
        supports=[],
        contacts=[ec.Contact("foot", friction=1.0)],
    )


# -- what a scene promises
# -----------------------------------------------------------------------------------


class Scaled(ec.Elastic):
    """Elasticity whose parts are scaled by factors of their own."""

    factors: ClassVar[tuple[float, float, float, float]] = (1.0, 1.0, 1.0, 0.0)

    def stress(self, eps, E, nu):
        coupling = ufl.as_tensor([[self.factors[3] * E * eps[1, 1], 0], [0, 0]])
        return self.factors[0] * super().stress(eps, E, nu) + coupling

    def compliance(self, sigma, E, nu):
        return self.factors[1] * super().compliance(sigma, E, nu)

    def modulus(self, E, nu):
        return self.factors[2] * E


def scaled(*factors):
    return type("Scaled", (Scaled,), {"factors": factors})


@pytest.mark.parametrize("E", [2e11, 1e-6])
@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ((1.0, 0.1, 1.0, 0.0), ("compliance does not invert the stress", "9.0e-01")),
        ((1.0, 1.0 + 1e-6, 1.0, 0.0), ("compliance does not invert the stress", "1.0e-06")),
        ((-1.0, -1.0, 1.0, 0.0), ("not positive", "stress")),
        ((1.0, 1.0, 1.0, 0.1), ("not symmetric", "stress")),
        ((1.0, 1.0, -1.0, 0.0), ("modulus is -", "> 0")),
        ((1.0, 1.0, 0.0, 0.0), ("modulus is 0", "> 0")),
    ],
)
def test_material_that_breaks_its_promise(factors, words, E, block):
    refused(lambda: bind(ec.Scene(scaled(*factors)(E, 0.3), [SINK]), block), "Scaled", *words)


def test_material_that_breaks_its_promise_where_it_varies(block):
    material = scaled(1.0, 0.1, 1.0, 0.0)(lambda x: 1 + x[0], 0.3)
    refused(
        lambda: bind(ec.Scene(material, [SINK]), block),
        "Scaled",
        "compliance does not invert the stress",
    )


@pytest.mark.parametrize(
    ("E", "nu"), [(2e11, 0.3), (1e-6, 0.4999999999), (1.0, -0.99), (lambda x: 1 + x[0], 0.3)]
)
def test_material_that_keeps_its_promise(E, nu, block):
    bind(ec.Scene(scaled(3.0, 1 / 3, 1e-3, 0.0)(E, nu), [SINK]), block)


def test_modulus_that_is_negative_between_the_vertices(block):
    material = ec.Elastic(E=lambda x: 1 + 1.5 * ufl.cos(16 * ufl.pi * x[1]), nu=0.3)
    refused_scene(block, "E is -0.5", "> 0", material=material)


class Law:
    """A law with one parameter and any bound."""

    parameters = ("a",)

    def __init__(self, bound, a=1.0):
        self.function, self.a = bound, a

    def friction_bound(self, pressure, a):
        return self.function(pressure, a)


@pytest.mark.parametrize("E", [2e11, 1e-6])
@pytest.mark.parametrize(
    ("bound", "a", "bilateral", "words"),
    [
        (lambda p, a: 0.3 * p + a * p**2, 1.0, False, ("not concave", "chords")),
        (lambda p, a: p * (1 + ufl.conditional(ufl.gt(p, a), 1, 0)), 1e-3, False, ("not concave",)),
        (lambda p, a: a / (1 + p), 1.0, False, ("decreases",)),
        (lambda p, a: 0.3 * p - a, 1e-6, False, ("negative", "b(0) = -")),
        (lambda p, a: a * ufl.ln(p), 1.0, False, ("not finite",)),
        (lambda p, a: a + 0.1 * p, 1.0, True, ("bilateral", "pressure", "Tresca")),
        (lambda p, a: a * a, -1.0, False, ("a is -", ">= 0")),
        (
            lambda p, a: p,
            lambda x: 0.5 - 0.6 * ufl.cos(8 * ufl.pi * (x[0] - 0.125)),
            False,
            ("a is -0.1", ">= 0"),
        ),
    ],
    ids=[
        "convex",
        "jump",
        "decreases",
        "negative",
        "infinite",
        "pulls",
        "parameter",
        "parameter between nodes",
    ],
)
def test_law_that_breaks_its_promise(bound, a, bilateral, words, E, block):
    """The numbers of a law are given for E = 1.

    Pressures and a bound scale with E, slopes do not.
    """
    law = Law(lambda p, a: E * bound(p / E, a), a)
    scene = ec.Scene(
        ec.Elastic(E, 0.3), [SINK], [], [ec.Contact("bottom", friction=law, bilateral=bilateral)]
    )
    refused(lambda: bind(scene, block), "'bottom'", *words)


@pytest.mark.parametrize(
    ("bound", "a", "bilateral"),
    [
        (lambda p, a: a * ufl.tanh(0.3 * p / a), 1e-3, False),
        (lambda p, a: ufl.min_value(0.3 * p, a), lambda x: 1e-3 * (1 + x[0]), False),
        (lambda p, a: a + 0.3 * p, 1e-3, False),
        (lambda p, a: ufl.sqrt(a * p), 1e-6, False),
        (lambda p, a: 0.01, 1.0, False),
        (lambda p, a: a, lambda x: 1e-3 * x[0], True),
    ],
    ids=["saturates", "limited", "cohesion", "root", "number", "given"],
)
def test_law_that_keeps_its_promise(bound, a, bilateral, block):
    bind(
        ec.Scene(
            STEEL, [SINK], [], [ec.Contact("bottom", friction=Law(bound, a), bilateral=bilateral)]
        ),
        block,
    )


def test_friction_negative_between_the_nodes(block):
    contact = ec.Contact(
        "bottom", friction=lambda x: 0.5 - 0.6 * ufl.cos(8 * ufl.pi * (x[0] - 0.125))
    )
    refused_scene(
        block, "'bottom'", "friction is -0.1", ">= 0", supports=[SINK], contacts=[contact]
    )


def test_gap_not_finite_between_the_nodes(block):
    contact = ec.Contact("bottom", gap=lambda x: ufl.sqrt(abs(x[0] - 0.125) - 0.01))
    refused_scene(block, "'bottom'", "gap", "not finite", supports=[SINK], contacts=[contact])


@pytest.mark.parametrize(
    "options",
    [
        {"normal": (0.0, 1.0)},
        {"normal": (1.0, 0.0)},
        {"normal": lambda x: (0.0 * x[0], 1.0)},
        {"normal": "gap", "gap": lambda x: 0.1 - x[1]},
        {"normal": "gap", "gap": lambda x: ufl.sqrt((x[0] - 0.5) ** 2 + (x[1] - 1.1) ** 2)},
    ],
    ids=["up", "sideways", "callable", "gap", "a foundation above"],
)
def test_normal_that_points_into_the_body(options, block):
    refused_scene(
        block,
        "'bottom'",
        "normal",
        "sign",
        supports=[SINK],
        contacts=[ec.Contact("bottom", **options)],
    )


def test_normals_of_a_curved_body(gmsh_session):
    """Facets that look sideways are in contact with a half disc.

    A whole disc has facets that look away.
    """

    def disc(angle):
        if gmsh_session:
            gmsh_session.clear()
            occ = gmsh_session.model.occ
            arc = occ.addCircle(0, 1, 0, 1, angle1=np.pi * 1.5 - angle, angle2=np.pi * 1.5 + angle)
            ends = [tag for _, tag in occ.getEntities(0)]
            chord = occ.addLine(ends[1], ends[0])
            occ.addPlaneSurface([occ.addCurveLoop([arc, chord])])
            occ.synchronize()
            gmsh_session.model.addPhysicalGroup(1, [arc], name="arc")
            gmsh_session.model.addPhysicalGroup(1, [chord], name="chord")
            gmsh_session.option.setNumber("Mesh.MeshSizeMax", 0.3)
        return ec.from_gmsh(gmsh_session.model if gmsh_session else None)

    def scene(normal):
        return ec.Scene(
            STEEL,
            [ec.Displacement("chord", (0.0, -0.01))],
            [],
            [ec.Contact("arc", gap=lambda x: x[1], normal=normal)],
        )

    bind(scene((0.0, -1.0)), disc(np.pi / 2))
    bind(scene("gap"), disc(np.pi / 2))
    refused(lambda: bind(scene((0.0, -1.0)), disc(0.9 * np.pi)), "'arc'", "look away")


# -- what holds the body
# -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("supports", "contacts", "words"),
    [
        ([], [], ("translation in x", "translation in y", "rotation in the plane xy")),
        ([], [ec.Contact("bottom")], ("translation in x",)),
        ([ec.Displacement("left", (0.0, None))], [], ("translation in y",)),
        ([ec.Displacement("top", (None, 0.0))], [ec.Contact("bottom")], ("translation in x",)),
    ],
    ids=["nothing", "frictionless contact", "roller", "roller and frictionless contact"],
)
def test_body_that_nothing_holds(supports, contacts, words, block):
    words = (*words, "not in balance", "Add a Displacement")
    loads = ec.BodyForce((0.01, 0.02))
    refused_scene(
        block, *words, error=ec.NotHeldError, supports=supports, contacts=contacts, loads=loads
    )


def test_one_of_two_bodies_that_nothing_holds():
    domain, held = two_squares(), [ec.Displacement("left1", (0.0, 0.0))]
    everything = (
        "translation in x",
        "translation in y",
        "rotation",
        "'bottom2', 'left2', 'right2', 'top2'",
    )
    loads = ec.BodyForce((0.01, 0.02))
    refused_scene(domain, *everything, error=ec.NotHeldError, supports=held, loads=loads)
    on_floor = [ec.Contact("bottom2")]
    refused_scene(
        domain,
        "translation in x of",
        "'top2'",
        error=ec.NotHeldError,
        supports=held,
        contacts=on_floor,
        loads=loads,
    )
    wrong = [*held, ec.Displacement("left2", (0.0, None))]
    words = "translation in y of", "'top2'"
    refused_scene(domain, *words, error=ec.NotHeldError, supports=wrong, loads=loads)


def test_body_in_space_that_nothing_holds(cube):
    words = ("translation in x", "translation in y", "rotation in the plane xy")
    loads = ec.BodyForce((0.1, 0.0, -1.0))
    entries = {"supports": [], "contacts": [ec.Contact("bottom")], "loads": loads}
    refused_scene(cube, *words, error=ec.NotHeldError, **entries)


@pytest.mark.on_ranks("pulled off with friction", "pushed sideways more than friction holds")
@pytest.mark.parametrize(
    ("supports", "friction", "force"),
    [
        ([ec.Displacement("left", (0.0, None))], 0.0, (0.0, 0.01)),
        ([ec.Displacement("left", (0.0, None))], 0.5, (0.0, 0.01)),
        ([], 0.5, (0.0, 0.01)),
        ([], 0.1, (0.01, -0.01)),
    ],
    ids=[
        "pulled off",
        "pulled off with friction",
        "pulled off, no support",
        "pushed sideways more than friction holds",
    ],
)
def test_body_that_the_loads_take_from_its_foundation(supports, friction, force, block):
    entries = {
        "supports": supports,
        "contacts": [ec.Contact("bottom", friction=friction)],
        "loads": [ec.Traction("top", force)],
    }
    refused_scene(block, "loads", "hold the body", "Displacement", error=ec.NotConverged, **entries)


def attempts_fail(scene, block):
    """Make all attempts of a scene that statics would refuse; return their error."""
    with pytest.raises(ec.NotConverged) as caught:
        ContactSolve(Direct(bind(scene, block)), None).solve(None)
    return caught.value


def test_body_that_lifts_off_says_so_in_short(block):
    held, force = ec.Displacement("left", (0.0, None)), ec.Traction("top", (0.0, 0.01))
    scene = ec.Scene(STEEL, held, force, ec.Contact("bottom", friction=0.3))
    failure = attempts_fail(scene, block)
    assert "all open" in str(failure)
    assert len(str(failure)) < 500
    assert len(failure.rungs) > 5
    assert "gamma (" not in str(failure)
    with pytest.raises(ec.NotConverged, match=r"along \(0, 1\) with 0.01 too much") as caught:
        ec.solve(scene, block)
    assert len(str(caught.value)) < 300


def test_body_that_slides_off_says_first_what_holds_it(block):
    scene = ec.Scene(
        STEEL, [], ec.Traction("top", (0.02, -0.01)), ec.Contact("bottom", friction=0.3)
    )
    words = str(attempts_fail(scene, block))
    assert len(words) < 800
    assert "less friction" not in words
    assert words.index("hold the body") < words.index("finer mesh") < words.index("another gamma")


# -- conditions that conflict
# --------------------------------------------------------------------------------

CONTACT, PRESSURE = ec.Contact("bottom"), ec.Traction("bottom", pressure=1.0)
FORCE, FIXED = ec.Traction("bottom", (0.0, 1.0)), ec.Displacement("bottom", (0.0, 0.0))
SLIDES, SINKS = ec.Displacement("bottom", (None, 0.0)), ec.Displacement("bottom", (0.0, None))


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"supports": [FIXED], "contacts": [CONTACT]}, ("Contact", "Displacement")),
        ({"supports": [SLIDES], "contacts": [CONTACT]}, ("Contact", "Displacement")),
        ({"loads": [FORCE], "contacts": [CONTACT]}, ("Contact", "Traction")),
        ({"loads": [PRESSURE], "contacts": [CONTACT]}, ("Contact", "Traction")),
        ({"contacts": [CONTACT, ec.Contact("bottom", friction=0.2)]}, ("2 contacts", "keep one")),
        ({"supports": [FIXED, FIXED]}, ("Component 0", "2 supports", "keep one")),
        ({"supports": [FIXED, SLIDES]}, ("Component 1", "2 supports", "keep one")),
        ({"supports": [FIXED], "loads": [FORCE]}, ("Traction", "Displacement", "remove")),
        ({"supports": [FIXED], "loads": [PRESSURE]}, ("Traction", "Displacement", "remove")),
        (
            {"supports": [SLIDES, SINKS], "loads": [PRESSURE]},
            ("Traction", "Displacement", "remove"),
        ),
        (
            {"supports": [SLIDES], "loads": [FORCE]},
            ("Traction", "Displacement", "component 1", "None"),
        ),
    ],
)
def test_conditions_that_conflict(entries, words, block):
    refused_scene(block, "'bottom'", *words, **{"supports": [], **entries})


def test_conditions_that_do_not_conflict(block):
    sideways = ec.Traction("bottom", (0.01, 0.0))
    held = ec.Scene(STEEL, [SLIDES, ec.Displacement("left", (0.0, None))], [sideways, sideways])
    assert ec.solve(held, block).newton_steps == 0
    # A vector that was turned has round-off where it should have a zero.
    turned = dataclasses.replace(held, loads=[ec.Traction("bottom", (0.02, 1e-18))])
    force = ec.solve(held, block).force("left").force
    assert ec.solve(turned, block).force("left").force == pytest.approx(force, rel=1e-12)
    assert ec.Scene(STEEL, [SLIDES, SINKS]).supports == (SLIDES, SINKS)


def test_entry_of_another_type(block):
    refused_scene(block, "loads", "Traction", "BodyForce", loads=[CONTACT])
    refused_scene(block, "supports", "Displacement", supports=[FORCE])
    refused_scene(block, "contacts", "Contact", contacts=["bottom"])


# -- supports
# ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.1, lambda x: 0.1 + x[0]], ids=["number", "callable"])
def test_supports_that_contradict_at_a_common_node(value, block):
    supports = [ec.Displacement("left", (0.0, 0.0)), ec.Displacement("bottom", (value, None))]
    refused_scene(block, "'bottom'", "common node", "component 0", "None", supports=supports)


def test_support_that_jumps_between_facets(block):
    """A step from cell to cell has no value at their common node."""
    step = fem.Function(fem.functionspace(block.mesh, ("DG", 0)))
    step.interpolate(lambda x: np.where(x[0] < 0.5, -0.01, -0.02))
    scene = ec.Scene(STEEL, ec.Displacement("top", (0.0, lambda x: step)))
    refused(lambda: ec.solve(scene, block), "'top'", "jumps between facets", "component 1")
    ramp = fem.Function(fem.functionspace(block.mesh, ("DG", 1)))
    ramp.interpolate(lambda x: -0.01 - 0.01 * x[0])
    ec.solve(ec.Scene(STEEL, ec.Displacement("top", (0.0, lambda x: ramp))), block)


def test_supports_that_agree_at_a_common_node(block):
    supports = [
        ec.Displacement("left", (0.0, lambda x: 0.1 * x[1])),
        ec.Displacement("top", (lambda x: x[0], 0.1)),
    ]
    solution = ec.solve(ec.Scene(STEEL, supports), block)
    assert COMM.allreduce(abs(solution.u.x.array).max(initial=0), MPI.MAX) == pytest.approx(
        1.0, rel=1e-12
    )


@pytest.mark.parametrize("gap", [0.02, lambda x: 0.02 + x[0]], ids=["number", "callable"])
def test_support_that_violates_the_gap(gap, block):
    supports = [ec.Displacement("left", (0.0, -0.1))]
    refused_scene(
        block,
        "'bottom'",
        "0.08",
        "gap",
        supports=supports,
        contacts=[ec.Contact("bottom", gap=gap)],
    )


def test_support_that_fixes_nothing_or_is_no_number(block):
    refused(lambda: ec.Displacement("left", (None, None)), "'left'", "fixes no component")
    refused(lambda: ec.Displacement("left", lambda x: x), "'left'", "each component")
    refused(lambda: ec.Displacement("left", (float("nan"), 0.0)), "'left'", "nan", "finite")
    supports = [ec.Displacement("left", (lambda x: ufl.ln(x[1] - 0.5), 0.0))]
    refused_scene(block, "not finite", "callables", supports=supports)


# -- vectors
# -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [(0.0,), 0.0, "up", (0.0, 0.0, 0.0, 0.0), (0.0, "1")])
def test_vector_that_is_none(value):
    for make in (
        lambda v: ec.Displacement("left", v),
        lambda v: ec.Traction("left", v),
        ec.BodyForce,
    ):
        refused(lambda make=make: make(value), "give")


@pytest.mark.parametrize(
    "entries",
    [
        {"supports": [ec.Displacement("left", (0.0, 0.0, 0.0))]},
        {"loads": [ec.Traction("top", (0.0, 0.0, 1.0))]},
        {"loads": [ec.BodyForce((0.0, 0.0, 1.0))]},
        {"contacts": [ec.Contact("bottom", normal=(0.0, 0.0, -1.0))], "supports": []},
    ],
    ids=["Displacement", "Traction", "BodyForce", "normal"],
)
def test_vector_of_another_dimension(entries, block):
    part = {"supports": "'left'", "loads": "", "contacts": "'bottom'"}[next(iter(entries))]
    refused_scene(block, "0.0, 0.0", "3 components", "2D", "give 2", part, **entries)


@pytest.mark.parametrize(
    "load", [ec.Traction("top", lambda x: x[0]), ec.BodyForce(lambda x: (x[0], x[1], 0.0))]
)
def test_callable_of_another_shape(load, block):
    refused_scene(block, "shape", "(2,)", loads=[load])


def test_vectors_of_two_dimensions_in_one_scene(block):
    supports = [ec.Displacement("left", (0.0, 0.0)), ec.Displacement("right", (0.0, 0.0, 0.0))]
    refused_scene(
        block, "2 components, Displacement('left')", "3, Displacement('right')", supports=supports
    )


def test_hypothesis_of_the_plane_in_space(cube):
    refused_scene(
        cube,
        "'plane stress'",
        "3D",
        supports=[],
        material=ec.Elastic(1.0, 0.3, hypothesis="plane stress"),
    )
    assert "plane" not in repr(ec.Elastic(1.0, 0.3))
    assert "plane stress" in repr(ec.Elastic(1.0, 0.3, hypothesis="plane stress"))


def test_height_formula_for_a_normal_by_the_gap(block):
    contact = ec.Contact("bottom", gap=lambda x: 0.01 * (1 + x[0]), normal="gap")
    words = ("'bottom'", "distance", "height", "normal=(0.0, -1.0)", "x[1]")
    refused_scene(block, *words, supports=[SINK], contacts=[contact])


def test_scene_in_the_plane_on_a_mesh_in_space(cube):
    refused_scene(cube, "(0.0, 0.0)", "3D")


def test_traction_and_pressure():
    refused(lambda: ec.Traction("top"), "'top'", "pressure")
    refused(lambda: ec.Traction("top", (0.0, 1.0), pressure=1.0), "'top'", "not both")
    refused(lambda: ec.Traction("top", pressure=float("nan")), "'top'", "nan", "finite")


# -- rectangle and box
# ---------------------------------------------------------------------------------------

MAKERS = pytest.mark.parametrize(
    ("make", "dim"), [(ec.rectangle, 2), (ec.box, 3)], ids=["rectangle", "box"]
)


@MAKERS
@pytest.mark.parametrize("size", [0.0, -0.1, float("nan"), float("inf")])
def test_size_not_positive(make, dim, size):
    refused(lambda: make((0.0,) * dim, (1.0,) * dim, size=size), "size", f"{size:g}", "> 0")


@MAKERS
@pytest.mark.parametrize("number", [0, -1, 2.5])
def test_cells_not_positive(make, dim, number):
    cells = (4,) * (dim - 1) + (number,)
    refused(
        lambda: make((0.0,) * dim, (1.0,) * dim, cells=cells),
        f"{number}",
        f"{dim} whole numbers >= 1",
    )


@MAKERS
def test_cells_of_another_length(make, dim):
    for cells in (4, (4,), (4,) * (dim + 1)):
        refused(
            lambda c=cells: make((0.0,) * dim, (1.0,) * dim, cells=c), f"{dim} whole numbers >= 1"
        )


@MAKERS
def test_both_size_and_cells_or_none(make, dim):
    refused(lambda: make((0.0,) * dim, (1.0,) * dim), "size=", "cells=")
    refused(lambda: make((0.0,) * dim, (1.0,) * dim, size=0.5, cells=(2,) * dim), "size=", "cells=")


@MAKERS
def test_corners_that_span_nothing(make, dim):
    for p1 in (
        (1.0,) * (dim + 1),
        (1.0,) * (dim - 1) + (0.0,),
        (-1.0,) * dim,
        (float("inf"),) * dim,
    ):
        refused(lambda p=p1: make((0.0,) * dim, p, size=0.5), "corners", f"{dim} numbers")


# -- meshes
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["missing.msh", "missing.geo", "missing.vtu"])
def test_mesh_file_missing(name, shared_tmp_path):
    refused(lambda: ec.read_mesh(shared_tmp_path / name), name, "does not exist", "path")


@pytest.mark.parametrize("suffix", [".msh", ".geo", ".vtu", ".vtk", ".inp", ".xyz", ""])
def test_mesh_file_broken(suffix, shared_tmp_path):
    path = shared_tmp_path / f"broken{suffix}"
    if COMM.rank == 0:
        path.write_text("no mesh\n")
    COMM.barrier()
    refused(lambda: ec.read_mesh(path), "broken")


def tags_of_all(mesh):
    """All boundary facets tagged 1."""
    tdim = mesh.topology.dim
    facets = dmesh.locate_entities_boundary(mesh, tdim - 1, lambda x: np.full(x.shape[1], True))
    return dmesh.meshtags(mesh, tdim - 1, facets, np.ones(len(facets), dtype=np.int32))


def test_mesh_of_the_user_with_wrong_tags():
    mesh = dmesh.create_unit_square(COMM, 3, 3)
    tags = tags_of_all(mesh)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    of_cells = dmesh.meshtags(mesh, 2, cells, np.ones(len(cells), dtype=np.int32))
    refused(lambda: ec.Domain(mesh, tags, {}), "named boundary part", "names=")
    refused(lambda: ec.Domain(mesh, tags, {"left": 1, "right": 2}), "'right'", "no facet")
    refused(lambda: ec.Domain(mesh, of_cells, {"left": 1}), "dimension 2", "facets have 1")
    refused(lambda: ec.Domain(mesh, None, {"left": 1}), "no tagged facet", "left")
    refused(lambda: ec.Domain(mesh, tags, {"all": 1}, None, {"steel": 1}), "steel", "cell tags")


def empty(gmsh):
    pass


def upright(gmsh):
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.rotate([(2, 1)], 0, 0, 0, 1, 0, 0, 0.5)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(1, [4], name="left")


MODELS = pytest.mark.parametrize(
    ("build", "words"),
    [
        (empty, ("dimension 0", "volume")),
        (upright, ("surface in 3D", "plane")),
    ],
)


@MODELS
def test_gmsh_model(build, words, gmsh_session):
    if gmsh_session:
        build(gmsh_session)
    refused(lambda: ec.from_gmsh(gmsh_session.model if gmsh_session else None), *words)


def test_values_that_are_not_finite(block):
    import ufl

    hold = [ec.Displacement("top", (0.0, 0.0))]

    def nowhere(x):
        return ufl.ln(x[0] - 0.5)

    refused(
        lambda: ec.solve(ec.Scene(STEEL, hold, [ec.BodyForce((0.0, nowhere))]), block),
        "BodyForce",
        "finite",
    )
    refused(
        lambda: ec.solve(
            ec.Scene(STEEL, hold, [ec.Traction("left", pressure=lambda x: ufl.ln(x[1] - 0.5))]),
            block,
        ),
        "finite",
    )
    refused(
        lambda: ec.solve(ec.Scene(STEEL, hold, [], [ec.Contact("bottom", gap=nowhere)]), block),
        "gap",
        "finite",
    )
    negative_at_a_corner = ec.Contact("bottom", friction=lambda x: 0.1 * (x[0] - 0.05))
    refused(
        lambda: ec.solve(ec.Scene(STEEL, hold, [], [negative_at_a_corner]), block),
        "friction",
        ">= 0",
    )
    refused(lambda: ec.Elastic(E="abc", nu=0.3), "'abc'", "number")


# -- what a newcomer types
# -----------------------------------------------------------------------------------

TOP, FLOOR = ec.Displacement("top", (0.0, -0.01)), ec.Contact("bottom", friction=0.3)
SCENE = ec.Scene(STEEL, [TOP], contacts=[FLOOR])


def with_gap(gap):
    return ec.Scene(STEEL, [TOP], contacts=[ec.Contact("bottom", gap=gap)])


@pytest.mark.parametrize(
    ("gap", "word"),
    [
        (lambda x: np.interp(x[0], [0.0, 1.0], [0.0, 0.1]), "ec.table(points, values)"),
        (lambda x: np.floor(x[0]), "np.where"),
        (lambda x: np.cbrt(x[0]), "cbrt"),
        (lambda x: math.sqrt(x[0]), "math.sin"),
        (lambda x: 0.1 if x[0] > 0.5 else 0.0, "instead of if"),
        (lambda x: max(x[0], 0.0), "instead of max"),
        (lambda x: None, "returned None"),
        (lambda x: "0.1", "returned '0.1'"),
        (lambda x: x, "no scalar"),
        (lambda x: x[2], "Index"),
        (lambda x, y: x[0], "argument"),
    ],
)
def test_callable_that_is_not_ufl(gap, word, block):
    refused(lambda: ec.solve(with_gap(gap), block), "Contact('bottom'): gap", word, "ufl.sin(x[0])")


def nested(x):
    gap = 0.01
    for piece in range(200):
        gap = ufl.conditional(ufl.lt(x[0], piece / 200), 0.001 * piece, gap)
    return gap


def test_callable_that_nests_too_deep(block):
    refused(
        lambda: ec.solve(with_gap(nested), block),
        "Contact('bottom'): gap",
        "203 levels",
        "120",
        "sum",
    )


def test_function_as_a_value(block):
    """On its own mesh a Function in a callable is taken.

    A run, which makes further meshes, refuses it at once.
    """
    height = fem.Function(fem.functionspace(block.mesh, ("Lagrange", 1)))
    height.x.array[:] = 0.001
    solution = ec.solve(with_gap(lambda x: height), block, ec.AugmentedLagrangian())
    assert solution.profile("bottom")["gap"].min(initial=1.0) > -1e-12
    words = ("Contact('bottom'): gap", "Function", "one mesh", "max_steps=1")
    refused(lambda: ec.adapt(with_gap(lambda x: height), block, accuracy=0.5), *words)
    refused(
        lambda: ec.evolve(lambda t: with_gap(lambda x: height), block, [1.0], accuracy=0.5), *words
    )
    load = ec.Traction("right", (0.0, lambda x: 0.001 * height))
    refused(
        lambda: ec.adapt(ec.Scene(STEEL, [TOP], load), block, 0.5),
        "Traction('right'): value",
        "Function",
    )
    refused(lambda: ec.Contact("bottom", gap=height), "'bottom'", "gap", "lambda x")
    refused(lambda: ec.Traction("right", height), "'right'", "lambda x")


@pytest.mark.parametrize("suffix", [".step", ".STP", ".igs"])
def test_drawings_that_cannot_be_meshed(suffix, shared_tmp_path):
    path = shared_tmp_path / f"part{suffix}"
    if COMM.rank == 0:
        path.write_text("ISO-10303-21;\n")
    COMM.barrier()
    refused(lambda: ec.read_mesh(path), path.name)
    refused(lambda: ec.read_mesh(path, size=0.5), path.name)


def test_values_tell_in_a_line_what_they_are(block):
    history = ec.adapt(SCENE, block, accuracy=0.5)
    error = history.best
    evolution = ec.evolve(lambda t: SCENE, block, [1.0], accuracy=0.5)
    told = {
        "Domain in 2D: 32 cells, boundary parts left, right, bottom, top": block,
        "Solution of degree 1 on 32 cells by Nitsche": error.solution,
        "Admissible pair of degree 1 on 32 cells": error.admissible,
        "ConstitutiveError: eps = ": error,
        "Sizes of a mesh of about": ec.size_map(error, 0.1),
        "History of 1 meshes. Reached: ": history,
        "Evolution of 1 steps. All 1 steps": evolution,
    }
    for words, value in told.items():
        assert words in repr(value)
        assert len(repr(value)) < 160
        assert " at 0x" not in repr(value)
    # Printed it is a table.
    assert str(block).splitlines()[0].split() == ["domain", "in", "2D"]


@pytest.mark.parametrize(
    "load", [lambda x: 0.1, lambda x: [[0.1, 0.0]], lambda x: None, lambda x: (np.cbrt(x[0]), 0.0)]
)
def test_load_that_is_not_ufl(load, block):
    for entry in (ec.Traction("right", load), ec.BodyForce(load)):
        refused(lambda e=entry: ec.solve(ec.Scene(STEEL, [TOP], [e]), block), "ufl.sin(x[0])")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda b: ec.Scene("steel", [TOP]), ("material is 'steel'", "Elastic(E, nu)")),
        (lambda b: ec.Scene(ec.Elastic, [TOP]), ("material is <class", "Elastic(E, nu)")),
        (lambda b: ec.Scene((1.0, 0.3), [TOP]), ("material is (1.0, 0.3)", "Elastic(E, nu)")),
        (
            lambda b: ec.Scene(STEEL, ec.Displacement("balance", (0, 0))),
            ("'balance'", "reactions()", "rename"),
        ),
        (
            lambda b: ec.Scene(STEEL, [TOP], [], ec.Contact("tractions")),
            ("'tractions'", "reactions()", "rename"),
        ),
        (lambda b: ec.Scene(STEEL, None), ("supports is None", "list of Displacement")),
        (
            lambda b: ec.Scene(STEEL, [TOP], contacts={"bottom": 0.3}),
            ("contacts is {", "list of Contact"),
        ),
        (lambda b: ec.Contact(["bottom"], friction=0.3), ("['bottom']", "one boundary part")),
        (lambda b: ec.Displacement(1, (0.0, 0.0)), ("for 1", "one boundary part")),
        (lambda b: ec.Contact("bottom", friction=ec.Tresca), ("friction is <class", "Tresca(0.1)")),
        (
            lambda b: ec.Contact("bottom", friction=type("L", (), {"friction_bound": abs})()),
            ("parameters", "friction_bound"),
        ),
        (lambda b: ec.solve(SCENE, b, degree=1.0), ("degree is 1.0", "1 and 2")),
        (lambda b: ec.solve(SCENE, b, degree=True), ("degree is True", "1 and 2")),
        (lambda b: ec.solve(SCENE, b, degree="2"), ("degree is '2'", "1 and 2")),
        (lambda b: ec.solve(SCENE, b, "nitsche"), ("method is 'nitsche'", "Nitsche()")),
        (lambda b: ec.solve(SCENE, b, ec.Nitsche), ("method is <class", "Nitsche()")),
        (lambda b: ec.solve(SCENE, b.mesh), ("domain is", "give a Domain")),
        (lambda b: ec.solve(b, SCENE), ("scene is <Domain in 2D", "give a Scene")),
        (lambda b: ec.solve(SCENE, b, start="last"), ("start is 'last'", "give a Solution")),
        (lambda b: ec.solve(SCENE, b, tolerance="fine"), ("tolerance is 'fine'", "> 0")),
        (lambda b: ec.adapt(SCENE, b, 0.1, method="nitsche"), ("method is 'nitsche'", "Nitsche()")),
        (
            lambda b: ec.adapt(SCENE, b, 0.1, strategy=ec.SizeMap),
            ("strategy is <class", "SizeMap()"),
        ),
        (
            lambda b: ec.adapt(SCENE, b, 0.1, strategy="sizemap"),
            ("strategy is 'sizemap'", "SizeMap()"),
        ),
        (lambda b: ec.adapt(SCENE, b, 0.1, degree=1.0), ("degree is 1.0", "1 and 2")),
        (lambda b: ec.adapt(SCENE, b, True), ("accuracy is True", "> 0")),
        (
            lambda b: ec.adapt(SCENE, b, 0.1, max_cells="many"),
            ("max_cells is 'many'", "whole number"),
        ),
        (lambda b: ec.adapt(SCENE, b, 0.1, max_steps=2.5), ("max_steps is 2.5", "whole number")),
        (lambda b: ec.adapt(SCENE, b, 0.1, tighten=-1), ("tighten is -1", ">= 0")),
        (lambda b: ec.adapt(SCENE, b, 0.1, stop=True), ("stop is True", "certified")),
        (lambda b: ec.adapt(SCENE, b, 0.1, callback="print"), ("callback is 'print'", "function")),
        (lambda b: ec.Nitsche(gamma="10"), ("gamma is '10'", "> 0")),
        (lambda b: ec.AugmentedLagrangian(gamma=None), ("gamma is None", "> 0")),
        (lambda b: ec.Mark("0.5"), ("fraction is '0.5'", "(0, 1]")),
        (lambda b: ec.SizeMap(leap="4"), ("leap is '4'", "> 1")),
        (lambda b: ec.rectangle("a", "b", size=0.1), ("corners", "2 numbers")),
        (lambda b: ec.rectangle((0, 0), (1, 1), size="0.1"), ("size", "'0.1'", "> 0")),
        (lambda b: ec.read_mesh(5), ("path is 5", "name of a file")),
        (lambda b: ec.Domain("body.msh", None, {}), ("mesh is 'body.msh'", "read_mesh")),
        (lambda b: ec.Domain(b.mesh, b.facet_tags, ["bottom"]), ("['bottom']", "mapping")),
        (
            lambda b: ec.Domain(b.mesh, b.facet_tags, {"bottom": "1"}),
            ("{'bottom': '1'}", "whole numbers"),
        ),
        (lambda b: b.remeshed("fine"), ("'fine'", "number")),
        (lambda b: b.refined("all"), ("'all'", "numbers of cells")),
    ],
)
def test_arguments_of_another_type(call, words, block):
    refused(lambda: call(block), *words)


class Flat:
    """Tresca's law: the bound is a number, whatever the pressure."""

    parameters = ()

    def friction_bound(self, pressure):
        return 0.002


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_law_whose_bound_is_a_number(degree, block):
    push = [ec.Displacement("top", (0.01, -0.01))]
    eps = []
    for friction in (Flat(), ec.Tresca(0.002)):
        scene = ec.Scene(STEEL, push, contacts=[ec.Contact("bottom", friction=friction)])
        solution = ec.solve(scene, block, ec.AugmentedLagrangian(), degree=degree)
        eps.append(ec.constitutive_error(ec.equilibrate(solution)).relative)
    assert eps[0] == pytest.approx(eps[1], rel=1e-9)


def test_what_is_meant_is_taken(block):
    """Numbers of numpy's, a single entry without a list, 1e6 cells, vectors and normals that are arrays."""
    history = ec.adapt(
        ec.Scene(
            ec.Elastic(np.float32(1.0), np.float64(0.25)),
            supports=TOP,
            loads=ec.Traction("right", np.array([0.0, -0.001])),
            contacts=ec.Contact(
                "bottom", friction=np.float32(0.25), normal=np.array([0.0, -1.0]), gap=np.float32(0)
            ),
        ),
        block,
        np.float32(0.25),
        degree=np.int64(1),
        max_cells=1e6,
        max_steps=np.int32(3),
    )
    same = ec.adapt(
        ec.Scene(
            ec.Elastic(1.0, 0.25),
            [TOP],
            [ec.Traction("right", (0.0, -0.001))],
            [ec.Contact("bottom", friction=0.25, normal=(0, -1), gap=lambda x: np.float32(0))],
        ),
        block,
        0.25,
    )
    assert history.reached
    assert history.best.relative == pytest.approx(same.best.relative, rel=1e-12)


def own_stiffness(entries):
    """A material of the user's with a stiffness matrix in Mandel components."""

    def act(matrix, tensor):
        vector = [tensor[0, 0], tensor[1, 1], 2**0.5 * tensor[0, 1]]
        xx, yy, xy = (sum(matrix[i][j] * vector[j] for j in range(3)) for i in range(3))
        return ufl.as_matrix([[xx, xy / 2**0.5], [xy / 2**0.5, yy]])

    members = {
        "parameters": ("factor",),
        "factor": 1.0,
        "check": staticmethod(lambda name, low, high: None),
        "stress": staticmethod(lambda eps, factor: factor * act(entries, eps)),
        "compliance": staticmethod(
            lambda sigma, factor: act(np.linalg.inv(entries).tolist(), sigma) / factor
        ),
        "modulus": staticmethod(lambda factor: factor),
    }
    return type("Own", (), members)()


@pytest.mark.parametrize(
    "factor", [1.0, pytest.param(2e11, marks=pytest.mark.broad), lambda x: 1e-6 * (1.0 + x[0])]
)
def test_stiffness_that_is_not_symmetric_or_not_positive(factor, block):
    good = [[1.3, 0.4, 0.1], [0.4, 1.1, 0.0], [0.1, 0.0, 0.9]]
    skew = [[1.3, 0.4, 0.1], [0.3, 1.1, 0.0], [0.1, 0.0, 0.9]]
    soft = [[1.3, 1.4, 0.1], [1.4, 1.1, 0.0], [0.1, 0.0, 0.9]]
    for matrix, words in (
        (skew, ("not symmetric", "Mandel")),
        (soft, ("not positive definite", "energy")),
    ):
        material = own_stiffness(matrix)
        material.factor = factor
        refused_scene(block, "Own", *words, material=material)
    refused(lambda: own_stiffness_of(good, -1.0, block), "not positive definite")
    own_stiffness_of(good, factor, block)


def own_stiffness_of(matrix, factor, block):
    material = own_stiffness(matrix)
    material.factor = factor
    return ec.solve(ec.Scene(material, [TOP]), block)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 1e200])
def test_coordinates_that_are_not_finite(wrong):
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    if COMM.rank == 0:
        domain.mesh.geometry.x[0, 0] = wrong
    refused_scene(domain, "coordinates", "not finite")


@pytest.mark.parametrize("make", [ec.rectangle, ec.box])
def test_cells_that_lie_over_each_other(make):
    """One node in the middle is moved beyond its neighbours."""
    dim = 2 if make is ec.rectangle else 3
    domain = make((0.0,) * dim, (1.0,) * dim, cells=(4,) * dim)
    x = domain.mesh.geometry.x
    x[np.linalg.norm(x[:, :dim] - 0.5, axis=1) < 1e-9, :dim] = 0.9
    held = [ec.Displacement("left", (0.0,) * dim)]
    refused_scene(domain, "over each other", "coordinates", supports=held)


# -- code of the user's that fails, on one rank only
# ---------------------------------------------------------


def fails(*_, **__):
    """Fails on the last rank, gives a number on the others."""
    if COMM.rank == COMM.size - 1:
        raise FileNotFoundError("friction.csv")
    return 0.3


def pair(x):
    return (fails(), 0.0)


class OwnLaw:
    """A law with a bound of the user's."""

    parameters = ("limit",)

    def __init__(self, bound):
        self.limit, self._bound = 0.1, bound

    def friction_bound(self, pressure, limit):
        return self._bound(pressure, limit)


def fails_for_numbers(pressure, limit):
    """The solver's call succeeds, the error's fails: the pressure is then numbers."""
    return fails() * pressure if isinstance(pressure, fem.Function | np.ndarray) else 0.3 * pressure


def own_material(member):
    """A material of a class of its own, of which one member fails."""
    members = {
        name: getattr(STEEL, name)
        for name in ("parameters", "check", "stress", "compliance", "modulus")
    }
    works = members[member]
    members |= {
        "E": 1.0,
        "nu": lambda x: 0.3 + 0.0 * x[0],
        member: lambda *a, **k: fails() and works(*a, **k),
    }
    return type("Own", (), {k: staticmethod(v) if callable(v) else v for k, v in members.items()})()


PRESSED = [ec.Displacement("top", (0.0, -0.01))]
FAILING = {
    "friction": {"contacts": [ec.Contact("bottom", friction=fails)]},
    "gap": {"contacts": [ec.Contact("bottom", gap=fails)]},
    "normal": {"contacts": [ec.Contact("bottom", normal=pair)]},
    "Tresca": {"contacts": [ec.Contact("bottom", friction=ec.Tresca(fails))]},
    "law": {"contacts": [ec.Contact("bottom", friction=OwnLaw(fails))]},
    "law of numbers": {"contacts": [ec.Contact("bottom", friction=OwnLaw(fails_for_numbers))]},
    "Displacement": {"supports": [ec.Displacement("top", (fails, -0.01))]},
    "Traction": {"loads": [ec.Traction("right", pair)]},
    "component": {"loads": [ec.Traction("right", (0.0, fails))]},
    "pressure": {"loads": [ec.Traction("right", pressure=fails)]},
    "BodyForce": {"loads": [ec.BodyForce((0.0, fails))]},
    "E": {"material": ec.Elastic(E=fails, nu=0.3)},
    "stress": {"material": own_material("stress")},
    "compliance": {"material": own_material("compliance")},
    "modulus": {"material": own_material("modulus")},
    "check": {"material": own_material("check")},
}


@pytest.mark.parametrize("where", FAILING)
def test_code_of_the_user_that_fails_on_one_rank(where, block):
    entries = {
        "material": STEEL,
        "supports": PRESSED,
        "contacts": [ec.Contact("bottom")],
        **FAILING[where],
    }
    refused(
        lambda: ec.solve(ec.Scene(**entries), block), "friction.csv", "FileNotFoundError", "ufl.sin"
    )


def test_method_of_the_user_that_fails_on_one_rank(block):
    class Own(ec.Nitsche):
        def equations(self, *arguments):
            fails()
            return super().equations(*arguments)

    scene = ec.Scene(STEEL, PRESSED, contacts=[ec.Contact("bottom")])
    refused(lambda: ec.solve(scene, block, Own()), "friction.csv", error=FileNotFoundError)


def early(domain):
    fails()
    return domain.refined()


def late(domain):
    domain = domain.refined()
    fails()
    return domain


def between(domain):
    marked = np.arange(3 + bool(fails()), dtype=np.int32)
    return domain.refined(marked).refined()


@pytest.mark.parametrize("make", [early, late, between])
def test_strategy_that_fails_on_one_rank(make, block):
    class Own:
        def next(self, error, accuracy, max_cells):
            return make(error.domain)

    scene = ec.Scene(STEEL, PRESSED, contacts=[ec.Contact("bottom", friction=0.3)])
    refused(
        lambda: ec.adapt(scene, block, accuracy=1e-9, strategy=Own()),
        "friction.csv",
        error=FileNotFoundError,
    )
    refused(
        lambda: ec.adapt(scene, block, accuracy=1e-9, callback=fails),
        "friction.csv",
        error=FileNotFoundError,
    )


def test_arguments_of_refined_and_remeshed_that_are_wrong_on_one_rank(block):
    last = COMM.rank == COMM.size - 1
    refused(lambda: block.refined(np.array([10**6 if last else 0])), "1000000", "this rank has")
    refused(lambda: block.refined("all" if last else None), "'all'", "numbers of cells")
    refused(lambda: block.refined([0.5] if last else [0]), "[0.5]", "numbers of cells")
    refused(lambda: block.remeshed("fine" if last else 0.1), "'fine'", "number")


@pytest.mark.parametrize("way", ["folder", "table"])
def test_save_where_something_stands_in_the_way(way, block, shared_tmp_path):
    scene = ec.Scene(STEEL, PRESSED, contacts=[ec.Contact("bottom", friction=0.3)])
    history = ec.adapt(scene, block, accuracy=0.5)
    folder = shared_tmp_path / "results"
    if COMM.rank == 0:
        folder.write_text("a file") if way == "folder" else (folder / "history.csv").mkdir(
            parents=True
        )
    COMM.barrier()
    error = ec.InputError if way == "folder" else OSError
    refused(lambda: history.save(folder), "results", error=error)


@pytest.mark.broad
@pytest.mark.serial
def test_no_rank_waits_for_one_that_failed(tmp_path):
    """Some of the tests above on two ranks, with a time in which they must have ended."""
    names = "fails_on_one_rank and (gap or Traction or early) or wrong_on_one_rank or in_the_way and folder"
    arguments = [
        __file__,
        "-q",
        "-p",
        "no:cacheprovider",
        "-k",
        names,
        "--rootdir",
        str(Path(__file__).parents[2]),
    ]
    script = f"import sys, pytest; sys.exit(pytest.main({arguments!r}))"
    with started(script, 2, tmp_path) as process:
        assert "[100%]" in output(process, 120)


# -- the loop and the method
# ---------------------------------------------------------------------------------


@pytest.mark.parametrize("accuracy", [0.0, -0.1, float("nan"), float("inf"), "2%"])
def test_accuracy_not_positive(accuracy, block):
    scene = ec.Scene(STEEL, [ec.Displacement("bottom", (0.0, 0.0))], [PUSH])
    refused(lambda: ec.adapt(scene, block, accuracy=accuracy), "accuracy", repr(accuracy), "> 0")


def test_limits_of_the_loop(block):
    scene = ec.Scene(STEEL, [ec.Displacement("bottom", (0.0, 0.0))], [PUSH])
    refused(lambda: ec.adapt(scene, block, accuracy=0.1, max_steps=0), "max_steps", ">= 1")
    refused(lambda: ec.adapt(scene, block, accuracy=0.1, max_cells=0), "max_cells", ">= 1")


@pytest.mark.parametrize("wrong", [0.0, -0.1, float("nan"), float("inf")])
def test_sizes_not_positive(wrong, block):
    sizes = np.full(len(block.mesh.geometry.x), 0.2)
    if COMM.rank == COMM.size - 1:  # one rank finds it, all must raise
        sizes[0] = wrong
    refused(lambda: block.remeshed(sizes), "1 sizes", "> 0 and finite")
    refused(lambda: block.remeshed(wrong), "> 0 and finite", f"{wrong:g}")


def test_sizes_of_another_shape(block):
    refused(lambda: block.remeshed(np.ones(3)), "shape (3,)", "geometry.x")
    refused(lambda: block.remeshed(np.ones((3, 2))), "shape (3, 2)")


@pytest.mark.parametrize("accuracy", [0.0, -0.1, float("nan"), float("inf"), "2%"])
def test_size_map_to_an_accuracy_not_positive(accuracy, block):
    scene = ec.Scene(STEEL, [ec.Displacement("bottom", (0.0, 0.0))], [PUSH])
    error = certified(scene, block)
    refused(lambda: ec.size_map(error, accuracy), "accuracy", repr(accuracy), "> 0")


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
OPEN_LOOP = json.dumps(
    {
        "entities": [
            *(["Point", tag, place] for tag, place in enumerate(SQUARE, start=1)),
            *(["Line", tag, [tag, tag + 1]] for tag in (1, 2, 3)),
            ["Curve Loop", 1, [1, 2, 3]],
            ["Plane Surface", 1, [1]],
        ],
        "inside": [],
        "groups": [[1, 1, [3]], [2, 1, [1]]],
    }
)


@pytest.mark.parametrize(
    ("suffix", "text"),
    [(".json", OPEN_LOOP), (".json", "{}"), (".xao", "no"), (".geo", "Point(1) = {0, 0, 0};")],
)
def test_geometry_that_gmsh_fails_on(suffix, text, block):
    """Remeshing raises on all ranks; a run keeps the result it has. No script is run."""
    broken = dataclasses.replace(block, geometry=Drawing(suffix, text))
    refused(lambda: broken.remeshed(0.1), "geometry", "cannot be used")
    scene = ec.Scene(STEEL, [ec.Displacement("bottom", (0.0, 0.0))], [PUSH])
    history = ec.adapt(scene, broken, accuracy=0.01, strategy=ec.SizeMap())
    assert (len(history.steps), history.reached) == (1, False)
    assert "cannot be used" in history.outcome
    assert history.best.relative == history.steps[0].eps


def test_gmsh_that_cannot_be_started(monkeypatch):
    """Only rank 0 starts gmsh, and the others learn that it failed.

    A gmsh of before 4.10 does not know ``interruptible``.
    """
    if COMM.rank == 0:
        import gmsh

        monkeypatch.setattr(gmsh, "initialize", lambda argv=(), readConfigFiles=True: None)
    call = partial(ec.rectangle, (0.0, 0.0), (1.0, 1.0), size=0.5)
    refused(call, "gmsh cannot be started", "interruptible", "cells=")


def test_gmsh_without_an_option(gmsh_session, monkeypatch):
    """The user's session is as it was; a session of ours is closed."""
    monkeypatch.setitem(our_session.SESSION, "Mesh.NoSuchOption", 1)
    call = partial(ec.rectangle, (0.0, 0.0), (1.0, 1.0), size=0.5)
    refused(call, "gmsh cannot be started", "NoSuchOption")
    if gmsh_session:
        assert gmsh_session.model.getCurrent() == "user"
        assert gmsh_session.model.list() == ["", "user"]
        gmsh_session.finalize()
    refused(call, "gmsh cannot be started", "NoSuchOption")
    assert gmsh_session is None or not gmsh_session.isInitialized()


def test_size_map_of_a_bare_mesh(block):
    bare = ec.Domain(block.mesh, block.facet_tags, block.names)
    refused(lambda: bare.remeshed(0.1), "not known", "Mark()", ".geo")
    scene = ec.Scene(STEEL, [ec.Displacement("bottom", (0.0, 0.0))], [PUSH])
    assert "Mark()" in ec.adapt(scene, bare, accuracy=0.01, strategy=ec.SizeMap()).outcome


def test_parameters_of_size_map():
    for aim in (0.0, 1.1, float("nan")):
        refused(lambda a=aim: ec.SizeMap(aim=a), "aim", repr(aim), "(0, 1]")
    for leap in (1.0, 0.0, float("nan")):
        refused(lambda v=leap: ec.SizeMap(leap=v), "leap", repr(leap), "> 1")


def test_parameters_of_method_and_marking():
    for gamma in (0.0, -1.0, float("nan")):
        refused(lambda g=gamma: ec.Nitsche(gamma=g), "gamma", repr(gamma), "> 0")
    refused(lambda: ec.Nitsche(theta=2), "theta", "2", "0, 1 and -1")
    for fraction in (0.0, 1.5, float("nan")):
        refused(lambda f=fraction: ec.Mark(f), "fraction", repr(fraction), "(0, 1]")


# -- classes of the user's
# -------------------------------------------------------------------------------------


class Stiffening(ec.Elastic):
    """A material whose stress is not linear."""

    def stress(self, eps, E, nu):
        return (1 + ufl.tr(eps)) * super().stress(eps, E, nu)


class NoForm(ec.Nitsche):
    """A method whose equations are a number."""

    def equations(self, model, contact, u, v, multiplier=None):
        return 3.0


class Quadratic(ec.Nitsche):
    """A method whose equations are not linear in the test function."""

    def equations(self, model, contact, u, v, multiplier=None):
        return ufl.inner(v, v) * contact.ds


class Unhashable(ec.Nitsche):
    """A method without a hash, as of a dataclass that is not frozen."""

    __hash__ = None


class NamesTooMuch:
    """A law that names a parameter it does not have."""

    parameters = ("limit",)

    def friction_bound(self, pressure, limit):
        return limit


class InWords(NamesTooMuch):
    """A law whose parameter is no number."""

    limit = "much"


CLASSES_THAT_FAIL = {
    "stress": ({"material": Stiffening(1.0, 0.3)}, None, ("Stiffening: stress must be linear",)),
    "no form": ({}, NoForm(), ("NoForm are 3.0", "return a UFL form")),
    "not linear": ({}, Quadratic(), ("equations of Quadratic must be linear",)),
    "unhashable": ({}, Unhashable(), ("not hashable", "frozen dataclass")),
    "no attribute": (
        {"contacts": [ec.Contact("bottom", friction=NamesTooMuch())]},
        None,
        ("NamesTooMuch", "no such attribute"),
    ),
    "no number": (
        {"contacts": [ec.Contact("bottom", friction=InWords())]},
        None,
        ("is 'much'; give a number",),
    ),
}


@pytest.mark.parametrize("which", CLASSES_THAT_FAIL)
def test_class_of_the_user_that_cannot_be_worked_with(which, block):
    """UFL and PETSc would end in errors of their own, one of which no ``except Exception`` catches."""
    entries, method, words = CLASSES_THAT_FAIL[which]
    entries = {
        "material": STEEL,
        "supports": PRESSED,
        "contacts": [ec.Contact("bottom")],
        **entries,
    }
    refused(lambda: ec.solve(ec.Scene(**entries), block, method), *words)


DROPPED = """
import erc_contact as ec

block = ec.Elastic(1.0, 0.3)
load = ec.Traction("top", (0.0, -0.1))
scene = ec.Scene(block, [ec.Displacement("bottom", (0.0, 0.0))], load)


def domain():
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))


calls = [
    lambda: ec.solve(scene, domain(), degre=2),
    lambda: ec.equilibrate(ec.solve(scene, domain(), solver="iterative"), tigthen=1),
    lambda: ec.adapt(scene, domain(), acuracy=0.1),
    lambda: domain().split({"a": "b"}, off="c"),
]
for call in 2 * calls:
    try:
        call()
    except TypeError as error:
        print("refused", error, flush=True)
"""


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_misspelled_argument_beside_a_new_mesh(ranks, tmp_path):
    """Python drops the mesh while it raises the error; MPI frees its communicator then."""
    with started(DROPPED, ranks, tmp_path) as process:
        text = output(process, 60)
    assert text.count("refused") == 8 * ranks
    for word in ("degre", "tigthen", "acuracy", "off"):
        assert text.count(f"unexpected keyword argument '{word}'") == 2 * ranks


def test_an_entry_in_the_wrong_list_is_told_its_list():
    refused(lambda: ec.Scene(STEEL, loads=ec.ThermalStrain(1e-5, 10.0)), "loads", "give strains=")
    refused(lambda: ec.Scene(STEEL, [ec.Contact("bottom")]), "supports", "give contacts=")
    refused(lambda: ec.Contact("bottom", friction=math.inf), "infinite", "Tied")


@pytest.mark.parametrize("d", [2, 3])
def test_the_distance_that_joined_tells_is_enough(d):
    low, high, top = (0.0,) * d, (1.0,) * d, (1.0,) * (d - 1) + (2.0,)
    apart = (0.0,) * (d - 1) + (1.03,)
    make = ec.rectangle if d == 2 else ec.box
    bodies = ec.assembly({"upper": make(apart, top, size=0.5), "lower": make(low, high, size=0.4)})
    with pytest.raises(ec.InputError, match="is enough") as caught:
        bodies.joined("upper bottom", "lower top")
    told = float(str(caught.value).split("apart= (")[1].split()[0])
    assert 0.03 <= told <= 0.04
    assert bodies.joined("upper bottom", "lower top", apart=told).cells > 0


@pytest.mark.serial
def test_errors_of_meshes_have_the_same_root():
    assert issubclass(nm.InputError, ec.ErcContactError)
    with pytest.raises(ec.ErcContactError, match="nowhere"):
        nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1)).tag("nowhere")
