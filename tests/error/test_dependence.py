"""How a friction bound depends on the pressure decides what is guaranteed.

No disguise makes it look constant.

- the kinds of bounds, plain and disguised (conditionals, sign, abs, min, powers), as
  the package sees them;
- a law that is switched on by pressure is not called guaranteed.
"""

from dataclasses import dataclass
from typing import ClassVar

import pytest
import ufl
from scenes import certified

import erc_contact as ec
from erc_contact.model.contact.friction import CONCAVE, CONSTANT, PROPORTIONAL, bind_friction

pytestmark = pytest.mark.serial


@dataclass(frozen=True)
class LawOf:
    """A law whose bound is a function of the pressure p and of a number s."""

    function: object
    limit: float = 0.004
    parameters: ClassVar[tuple[str, ...]] = ("limit",)

    def friction_bound(self, pressure, limit):
        return self.function(pressure, limit)


def doubled(pressure, times):
    """A multiple of the pressure in which each term is used twice by the next one."""
    for _ in range(times):
        pressure = pressure + 0.5 * pressure
    return pressure


KINDS = {
    "given": (lambda p, s: s, CONSTANT),
    "a number": (lambda p, s: 0.1, CONSTANT),
    "times zero": (lambda p, s: s + 0 * p, CONSTANT),
    "power 0": (lambda p, s: s * p**0, CONSTANT),
    "Coulomb": (lambda p, s: s * p, PROPORTIONAL),
    "quotient": (lambda p, s: p * s / 2, PROPORTIONAL),
    "sum": (lambda p, s: s * p + 0.1 * p, PROPORTIONAL),
    "in a loop": (lambda p, s: s * doubled(p, 60), PROPORTIONAL),
    "component": (lambda p, s: ufl.as_vector([p, s])[0] * s, PROPORTIONAL),
    "cohesion": (lambda p, s: s + 0.1 * p, CONCAVE),
    "root": (lambda p, s: s * ufl.sqrt(p), CONCAVE),
    "switched on": (lambda p, s: ufl.conditional(ufl.gt(p, 0), s, 0), CONCAVE),
    "sign": (lambda p, s: s * ufl.sign(p), CONCAVE),
    "Coulomb and sign": (lambda p, s: s * p + s * ufl.sign(p), CONCAVE),
    "Coulomb and switch": (lambda p, s: s * p + ufl.conditional(ufl.gt(p, 0), s, 0), CONCAVE),
    "abs that cancels": (lambda p, s: s + abs(p) - p, CONCAVE),
    "saturates at once": (lambda p, s: ufl.min_value(1e9 * p, s), CONCAVE),
    "max": (lambda p, s: ufl.max_value(s, s - p), CONCAVE),
}


@pytest.fixture(scope="module")
def square():
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))


@pytest.mark.parametrize("kind", KINDS)
def test_kind(kind, square):
    function, expected = KINDS[kind]
    law = LawOf(function)
    friction = bind_friction(square.mesh, "the bound", law, {"limit": ufl.as_ufl(0.3)})
    assert friction.dependence == expected


@pytest.mark.parametrize(
    ("kind", "guaranteed"),
    [("switched on", False), pytest.param("sign", False, marks=pytest.mark.broad), ("given", True)],
)
def test_switch_is_not_guaranteed(kind, guaranteed, square):
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=LawOf(KINDS[kind][0]))],
    )
    error = certified(scene, square)
    assert error.guaranteed == guaranteed
    assert (error.pressure_dependent == ()) == guaranteed
    assert ec.potential_energy(error).guaranteed == guaranteed
