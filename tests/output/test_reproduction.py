"""The code under "How to reproduce it" runs as it is, beside its report, and gives the same run.

Scenes: a block with data of lambdas; one in 3D with a named part, meshed anew; two
bodies with a pair; a loading history of a function with a material of the user's; bodies
with their own true shapes, apart.
"""

import html
import os
import re

import numpy as np
import pytest
import ufl
from domains import two_halves

import erc_contact as ec

SLOPE = 0.1
TIMES = (0.5, 1.0)
WAY = np.array([0.0, 0.02, 0.05])


def gap_below(x):
    """A gap with a number, and a function, from around it."""
    return SLOPE * square(x[0] - 1.0)


def square(value):
    return value**2


class Stiffening:
    """A material with a potential of its own."""

    parameters = ("E",)

    def __init__(self, E):
        self.E = E

    def check(self, name, low, high):
        if low <= 0:
            raise ec.InputError(f"{name} must be > 0.")

    def potential(self, strain, E):
        return E / 2 * ufl.inner(strain, strain)

    def conjugate(self, stress, E):
        return ufl.inner(stress, stress) / (2 * E)

    def modulus(self, E):
        return E


def from_lambdas():
    def stiffness(x):
        return 1.0 + SLOPE * x[0]

    support = ec.Displacement("top", (lambda x: 0.02 + 0.0 * x[0], -0.05))
    contact = ec.Contact("bottom", friction=0.3, gap=gap_below)
    scene = ec.Scene(ec.Elastic(stiffness, 0.3), support, contacts=contact)
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    return ec.adapt(scene, domain, accuracy=0.12)


def in_space():
    domain = ec.box((0.0,) * 3, (2.0, 2.0, 1.0), size=0.8)
    # A whole side, which the shape has on each of its meshes.
    domain = domain.named({"lid": lambda x: np.isclose(x[2], 1.0)})
    contact = ec.Contact("bottom", friction=0.3)
    support = ec.Displacement("lid", (0.01, 0.0, -0.03))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), support, contacts=contact)
    return ec.adapt(scene, domain, accuracy=0.25, strategy=ec.SizeMap())


def two_bodies():
    domain = two_halves(ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 8)))
    domain = domain.split({"above": "upper", "below": "lower"})
    material = ec.Elastic({"upper": 1.0, "lower": 3.0}, 0.3)
    supports = [ec.Displacement("top", (0.03, -0.05)), ec.Displacement("bottom", (0.0, 0.0))]
    contact = ec.Contact("above", against="below", friction=0.4)
    return ec.adapt(ec.Scene(material, supports, contacts=contact), domain, accuracy=0.15)


def scene_at(t):
    push = np.interp(t, [0.0, *TIMES], WAY)
    support = ec.Displacement("top", (push, -0.05))
    return ec.Scene(Stiffening(2.0), support, contacts=ec.Contact("bottom", friction=0.3))


def loading():
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    return ec.evolve(scene_at, domain, list(TIMES), accuracy=0.3)


def apart():
    punch = ec.rectangle((0.5, 1.01), (1.5, 2.0), cells=(4, 4))
    base = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    both = ec.assembly({"punch": punch, "base": base})
    both = both.joined("punch bottom", "base top", apart=0.02)
    supports = [
        ec.Displacement("punch top", (0.01, -0.05)),
        ec.Displacement("base bottom", (0.0, 0.0)),
    ]
    contact = ec.Contact(*both.pairs[0], friction=0.3)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=contact)
    return ec.adapt(scene, both, accuracy=0.25)


@pytest.mark.serial
@pytest.mark.parametrize(
    "make",
    [
        from_lambdas,
        loading,
        pytest.param(apart, marks=pytest.mark.broad),
        pytest.param(in_space, marks=pytest.mark.broad),
        pytest.param(two_bodies, marks=pytest.mark.broad),
    ],
)
def test_code_of_a_report_gives_the_same_run(make, tmp_path, monkeypatch):
    run = make()
    run.save(tmp_path)
    page = (tmp_path / "report.html").read_text()
    code = re.search(r"<h2>How to reproduce it</h2><pre>(.*?)</pre>", page, re.DOTALL)[1]
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(html.unescape(code), names)
    again = names["evolution" if make is loading else "history"]
    assert again.outcome == run.outcome
    assert [step.cells for step in again.steps] == [step.cells for step in run.steps]
    assert again.error.relative == pytest.approx(run.error.relative, rel=1e-9)
    assert os.fspath(tmp_path) not in page
