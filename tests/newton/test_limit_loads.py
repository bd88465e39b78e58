"""Loads that no tractions of contacts balance, with how much of them could be carried.

- what slides, tips, slips out or falls is told with the greatest share of its loads and
  the least friction, which are known in closed form;
- no scene is refused that has a solution: random tractions in the cones of friction
  make loads that they balance;
- so it is on several ranks.
"""

import re

import numpy as np
import pytest
from mpi4py import MPI

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton.limit_loads import what_can_be_carried
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.statics import mechanism

SOFT = ec.Elastic(1.0, 0.3)
WEIGHT = 1e-3


def told(scene: ec.Scene, domain: ec.Domain) -> tuple[float | None, float | None, float | None]:
    """Return share [-], factor of friction [-] and coefficient [-] that an error tells."""
    with pytest.raises(ec.NotConverged, match="There is no solution") as failure:
        ec.solve(scene, domain)
    text = str(failure.value)
    numbers = []
    for pattern in (r"at most (\S+)%", r"at least (\S+) times", r"coefficient of (\S+)\."):
        found = re.search(pattern, text)
        numbers.append(None if found is None else float(found[1]))
    assert (numbers[1] is None) == ("No friction is enough" in text)
    share, factor, coefficient = numbers
    return None if share is None else share / 100, factor, coefficient


def column(d: int, height: float = 1.0, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    """Make a block of unit width."""
    make = ec.rectangle if d == 2 else ec.box
    return make((0.0,) * d, (*(1.0,) * (d - 1), height), cells=(2,) * d, comm=comm)


def loads(d: int, push: float, on: str) -> list:
    """Return weight, and a push along the first axis on a part."""
    along = (1.0, *(0.0,) * (d - 1))
    weight = ec.BodyForce(tuple(-WEIGHT * (i == d - 1) for i in range(d)))
    return [weight, ec.Traction(on, tuple(push * WEIGHT * x for x in along))]


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_slides(d):
    """It takes a push of 0.4 of its weight; a polygon of 8 sides is 8% wider in 3D."""
    scene = ec.Scene(SOFT, loads=loads(d, 0.5, "left"), contacts=ec.Contact("bottom", friction=0.4))
    share, factor, coefficient = told(scene, column(d))
    wider = 1.0 if d == 2 else 1 / np.cos(np.pi / 8)
    assert share == pytest.approx(0.8 * wider, rel=1e-2)
    assert factor == pytest.approx(1.25 / wider, rel=1e-3)
    assert coefficient == pytest.approx(0.5 / wider, rel=1e-2)


@pytest.mark.serial
def test_a_block_on_a_slope():
    """Its weight alone makes it slide, at any size: only friction helps."""
    slope = ec.BodyForce((0.5 * WEIGHT, -WEIGHT))
    scene = ec.Scene(SOFT, loads=slope, contacts=ec.Contact("bottom", friction=0.4))
    assert told(scene, column(2)) == (None, pytest.approx(1.25, rel=1e-3), 0.5)


@pytest.mark.serial
def test_a_block_slides_on_given_friction():
    """The bound does not grow with the load, so a share of all loads can be carried."""
    contact = ec.Contact("bottom", friction=ec.Tresca(0.7 * WEIGHT))
    scene = ec.Scene(SOFT, loads=ec.BodyForce((WEIGHT, -WEIGHT)), contacts=contact)
    share, factor, coefficient = told(scene, column(2))
    assert share == pytest.approx(0.7, rel=1e-3)
    assert factor == pytest.approx(1 / 0.7, rel=1e-3)
    assert coefficient is None


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_tips(d):
    """The weight of 4 has an arm of 0.5, the push of 2 one of 4: no friction helps."""
    scene = ec.Scene(SOFT, loads=loads(d, 2.0, "top"), contacts=ec.Contact("bottom", friction=1.0))
    assert told(scene, column(d, 4.0)) == (pytest.approx(0.25, rel=1e-3), None, None)


@pytest.mark.serial
def test_a_wedge_slips_out():
    """Between a floor and a pressed block it stays if twice the friction angle is more."""
    angle = 0.5
    bodies = {}
    for number, name in enumerate(("wedge", "upper")):
        brick = ec.rectangle((0.0, float(number)), (1.0, number + 1.0), cells=(3, 2))
        x = brick.mesh.geometry.x
        share = x[:, 1] if number == 0 else 2.0 - x[:, 1]
        x[:, 1] += share * np.tan(angle) * x[:, 0]
        bodies[name] = ec.Domain(brick.mesh, brick.facet_tags, brick.names)
    domain = ec.assembly(bodies).joined("upper bottom", "wedge top")
    scene = ec.Scene(
        SOFT,
        ec.Displacement("upper left", (0.0, None)),
        ec.Traction("upper top", (0.0, -WEIGHT)),
        [
            ec.Contact("upper bottom", against="wedge top", friction=0.2),
            ec.Contact("wedge bottom", friction=0.2),
        ],
    )
    share, factor, coefficient = told(scene, domain)
    assert share is None
    assert factor == pytest.approx(np.tan(angle / 2) / 0.2, rel=1e-3)
    assert coefficient == pytest.approx(np.tan(angle / 2), rel=1e-2)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", range(40))
def test_what_has_a_solution_is_not_refused(seed):
    """Without deformation the tractions balance the loads, whatever the bodies are."""
    rng = np.random.default_rng(seed)
    d = int(rng.integers(2, 4))
    make = ec.rectangle if d == 2 else ec.box
    bodies = {}
    for number in range(3):
        low = (*(0.0,) * (d - 1), float(number))
        high = (*rng.uniform(0.5, 1.5, d - 1), number + 1.0)
        bodies[f"b{number}"] = make(low, high, cells=tuple(rng.integers(1, 4, d)))
    domain = ec.assembly(bodies).joined("b1 bottom", "b0 top").joined("b2 bottom", "b1 top")
    laws = [float(rng.uniform(0.0, 1.0)), ec.Tresca(float(rng.uniform(0.0, 1.0)))]
    contacts = []
    for here, there in (("b0 bottom", None), ("b1 bottom", "b0 top"), ("b2 bottom", "b1 top")):
        friction = laws[rng.integers(2)]
        gap = float(rng.choice([0.0, 0.1]))
        contacts.append(ec.Contact(here, against=there, friction=friction, gap=gap))
    scene = ec.Scene(SOFT, loads=ec.BodyForce((0.0,) * d), contacts=contacts)
    model = bind(scene, domain, 1, None)
    nodal = model.space.function()
    for contact, told_contact in zip(model.contacts, contacts, strict=True):
        trace = contact.trace
        shape = trace.here.nodes.shape
        pressure = rng.exponential(1.0, shape) * rng.integers(0, 2, shape)
        law = told_contact.friction
        bound = law.limit if isinstance(law, ec.Tresca) else law * pressure
        n = np.broadcast_to(contact.direction[:, None], (*shape, d))
        along = rng.normal(size=n.shape)
        along -= np.einsum("fmd,fmd->fm", along, n)[..., None] * n
        along /= np.linalg.norm(along, axis=2, keepdims=True)
        traction = (bound * rng.choice([0.0, 1.0], shape))[..., None] * along
        traction -= pressure[..., None] * n
        forces = trace.here.areas[:, None, None] / d * traction
        nodal.x.array[:] -= trace.back(forces).ravel()
    assert mechanism(model, nodal) is None


@pytest.mark.ranks
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_ranks_tell_the_same(d):
    """One rank gathers the facets, so all say what one rank alone says."""
    scene = ec.Scene(SOFT, loads=loads(d, 0.5, "left"), contacts=ec.Contact("bottom", friction=0.3))
    texts = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        model = bind(scene, column(d, comm=comm), 1, None)
        texts.append(what_can_be_carried(model, Stiffness(model).load_vector()))
    assert texts[0] == texts[1] != ""
