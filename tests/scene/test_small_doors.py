"""What people write, and expect to work.

- A function of numpy is the same data as one of UFL, with its derivatives.
- Materials by region are one material whose moduli differ by region.
- Intervals print as people write them; parts that are no pair tell how they become one.
"""

import pickle

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices, meshtags
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.base.traced import field_of
from namedmesh.base.names import first_names

COMM = MPI.COMM_WORLD
TWINS = {
    "sine": (lambda x: np.sin(3 * x[0]) * x[1], lambda x: ufl.sin(3 * x[0]) * x[1]),
    "radius": (
        lambda x: np.hypot(x[0] - 0.2, x[1]) + np.linalg.norm(x),
        lambda x: ufl.sqrt((x[0] - 0.2) ** 2 + x[1] ** 2) + ufl.sqrt(ufl.dot(x, x)),
    ),
    "pieces": (
        lambda x: np.where((x[0] > 0.3) & (x[1] < 0.6), np.exp(-x[0]), 2.0),
        lambda x: ufl.conditional(
            ufl.And(ufl.gt(x[0], 0.3), ufl.lt(x[1], 0.6)), ufl.exp(-x[0]), 2.0
        ),
    ),
    "limits": (
        lambda x: np.clip(x[0], 0.2, 0.7) + np.maximum(x[1], 0.5) - np.minimum(x[1], x[0]),
        lambda x: (
            ufl.min_value(ufl.max_value(x[0], 0.2), 0.7)
            + ufl.max_value(x[1], 0.5)
            - ufl.min_value(x[1], x[0])
        ),
    ),
    "bump": (
        lambda x: np.exp(-np.sum(np.square(x))) * (x[0] > 0.5),
        lambda x: ufl.exp(-ufl.dot(x, x)) * ufl.conditional(ufl.gt(x[0], 0.5), 1.0, 0.0),
    ),
    # It needs no numpy, and works with the coordinates of UFL as they are.
    "conditions": (
        lambda x: x[1] * (2.0 - (x[0] > 0.5)) + ((x[1] < 0.2) | (x[0] < 0.1)),
        lambda x: (
            x[1] * (2.0 - ufl.conditional(ufl.gt(x[0], 0.5), 1.0, 0.0))
            + ufl.conditional(ufl.Or(ufl.lt(x[1], 0.2), ufl.lt(x[0], 0.1)), 1.0, 0.0)
        ),
    ),
}


@pytest.mark.serial
@pytest.mark.parametrize("name", TWINS)
def test_functions_of_numpy_are_those_of_ufl(name, block):
    x = ufl.SpatialCoordinate(block.mesh)
    numeric, symbolic = (field_of(function, x) for function in TWINS[name])
    difference = (numeric - symbolic) ** 2 + (numeric.dx(0) - symbolic.dx(0)) ** 2
    dx = ufl.dx(metadata={"quadrature_degree": 4})
    size = fem.assemble_scalar(fem.form(symbolic**2 * dx))
    assert size > 1e-3
    assert fem.assemble_scalar(fem.form(difference * dx)) < 1e-24 * size


def scene(gap, density, E, top):
    return ec.Scene(
        ec.Elastic(E, 0.3),
        [ec.Displacement("top", top)],
        [ec.BodyForce(density)],
        ec.Contact("bottom", friction=0.2, gap=gap),
    )


def test_scenes_take_functions_of_numpy(block):
    numeric = scene(
        lambda x: 0.001 * np.sin(x[0]) ** 2,
        lambda x: np.array([0.0, -0.01 * np.exp(x[1])]),
        lambda x: np.where(x[1] > 0.5, 2.0, 1.0),
        (lambda x: 0.001 * np.cos(x[0]), -0.01),
    )
    symbolic = scene(
        lambda x: 0.001 * ufl.sin(x[0]) ** 2,
        lambda x: ufl.as_vector([0.0, -0.01 * ufl.exp(x[1])]),
        lambda x: ufl.conditional(ufl.gt(x[1], 0.5), 2.0, 1.0),
        (lambda x: 0.001 * ufl.cos(x[0]), -0.01),
    )
    errors = [certified(s, block) for s in (numeric, symbolic)]
    assert errors[0].absolute == pytest.approx(errors[1].absolute, rel=1e-12)


@pytest.mark.serial
def test_what_numpy_cannot_hand_on_is_refused(block):
    x = ufl.SpatialCoordinate(block.mesh)
    for function in (
        lambda x: np.sin(x[0]) if x[0] > 0.5 else 0.0,
        lambda x: max(np.sin(x[0]), 0.0),
        lambda x: np.interp(np.sin(x[0]), [0, 1], [0, 1]),
        lambda x: float(np.sin(x[0])),
    ):
        with pytest.raises((TypeError, ValueError)):
            field_of(function, x)


def test_materials_by_region(block):
    domain = block.named(
        regions={"upper": ec.where(y=(0.5, None)), "lower": ec.where(y=(None, 0.5))}
    )
    supports = [ec.Displacement("bottom", (0.0, 0.0)), ec.Displacement("top", (0.0, -0.01))]
    by_region = ec.Scene({"upper": ec.Elastic(2.0, 0.2), "lower": ec.Elastic(1.0, 0.3)}, supports)
    by_moduli = ec.Scene(
        ec.Elastic({"upper": 2.0, "lower": 1.0}, {"upper": 0.2, "lower": 0.3}), supports
    )
    assert by_region == by_moduli
    u, v = (ec.solve(s, domain).u.x.array for s in (by_region, by_moduli))
    assert np.array_equal(u, v)


BAD_MATERIALS = {
    "nothing": ({}, "a material for each region"),
    "numbers": ({"upper": 210e3}, "a material for each region"),
    "two hypotheses": (
        {"a": ec.Elastic(1.0, 0.3), "b": ec.Elastic(1.0, 0.3, "plane stress")},
        "hypothesis of the material of 'b' is 'plane stress'.* must be the same",
    ),
    "mappings inside": (
        {"a": ec.Elastic({"a": 1.0}, 0.3)},
        "E of the material of 'a' is a mapping",
    ),
}


@pytest.mark.serial
@pytest.mark.parametrize("case", BAD_MATERIALS)
def test_materials_that_are_no_material(case):
    material, words = BAD_MATERIALS[case]
    with pytest.raises(ec.InputError, match=words):
        ec.Scene(material)


@pytest.mark.serial
def test_intervals_print_as_people_write_them():
    bounds = ec.Bounds(np.float64(0.12345), np.float64(0.12344), np.float64(0.12346), np.True_)
    assert "np." not in repr(bounds)
    assert str(bounds) == "0.12345, between 0.12344 and 0.12346 (proved)"
    assert str(ec.Bounds(1.0, 1.0, 1.0, guaranteed=False)) == "1, between 1 and 1 (estimated)"
    assert (
        str(ec.Bounds(0.0, -np.inf, np.inf, guaranteed=True)) == "0, between -inf and inf (proved)"
    )


def test_parts_that_lie_against_each_other_tell_the_line():
    a = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3))
    b = ec.rectangle((0.0, -1.0), (1.0, 0.0), cells=(2, 2))
    both = ec.assembly({"a": a, "b": b})
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("a top", (0.0, -0.01)), ec.Displacement("b bottom", (0.0, 0.0))],
        contacts=ec.Contact("a bottom", against="b top"),
    )
    with pytest.raises(ec.InputError) as refused:
        ec.solve(scene, both)
    line = "domain = domain.joined('a bottom', 'b top')"
    assert line in str(refused.value)
    names = {"domain": both}
    exec(line, names)
    ec.solve(scene, names["domain"])
    with pytest.raises(ec.InputError, match=r"the pairs 'a bottom' and 'b top'.*joined"):
        names["domain"].facing("a left", "b left")
    with pytest.raises(ec.InputError, match="No boundary part is called 'c'"):
        both.facing("a bottom", "c")


@pytest.mark.parametrize(
    ("call", "nearest"),
    [
        (lambda: ec.Contact("bottom", frction=0.3), "friction"),
        (lambda: ec.Scene(materal=ec.Elastic(1.0, 0.3)), "material"),
        (lambda: ec.adapt(None, None, acuracy=0.1), "accuracy"),
        (lambda: ec.rectangle((0.0, 0.0), (1.0, 1.0), siz=0.1), "size"),
    ],
)
def test_misspelt_keywords_name_the_nearest(call, nearest):
    with pytest.raises(TypeError, match=f"Did you mean '{nearest}'"):
        call()
    assert pickle.loads(pickle.dumps(ec.solve)) is ec.solve


def test_misspelt_parts_name_the_nearest():
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2, 1))
    with pytest.raises(ec.InputError, match=r"Did you mean 'bottom'\?"):
        block.tag("botom")
    with pytest.raises(ec.InputError, match=r"bottom, left, right, top\.$"):
        block.tag("42")  # near to none of them


def test_a_scene_prints_a_line_for_each_part():
    support = ec.Displacement("top", (0.0, None))
    contact = ec.Contact("bottom", friction=0.3)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), support, contacts=contact)
    assert [line.split()[0] for line in str(scene).splitlines()] == ["material", "top", "bottom"]
    assert "(0.0, free)" in str(scene)


@pytest.mark.serial
def test_a_domain_of_many_parts_prints_few_lines():
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(26, 26))
    facets = exterior_facet_indices(block.mesh.topology)
    numbers = np.arange(1, 105, dtype=np.int32)
    tags = meshtags(block.mesh, 1, facets, numbers)
    many = ec.Domain(block.mesh, tags, {f"face {number}": number for number in numbers})
    lines = str(many).splitlines()
    assert len(lines) <= 10
    assert max(map(len, lines)) < 110
    assert "face 9 and 95 more" in str(many)
    long = [f"nut {number} on l-bracket {number}" for number in range(20)]
    assert first_names(long).endswith(f"{long[2]} and 17 more")
    assert first_names([]) == ""
