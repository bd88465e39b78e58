"""The error e against true errors, with references three and four uniform levels finer.

- frictionless and linear scenes: e is above the error of u^, above the error of sigma^,
  and above both together;
- Coulomb friction: the same with the third term, a product of two errors, evaluated;
- a manufactured linear problem whose solution is known: e^2 = |u - u^|^2 + |sigma -
  sigma^|^2 (Prager, Synge).
"""

from functools import cache

import numpy as np
import pytest
import ufl
from reference import true_errors
from scenes import block, common_block, prototype_block

import erc_contact as ec

pytestmark = pytest.mark.serial
FINE = 48
"""Squares across the block of the references."""


def with_friction(friction: float) -> ec.Scene:
    base = common_block()
    return ec.Scene(
        base.material, base.supports, base.loads, [ec.Contact("bottom", friction=friction)]
    )


def linear() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05)), ec.Displacement("bottom", (None, 0.0))],
        loads=[ec.Traction("right", (-0.002, 0.0)), ec.BodyForce((0.0, -0.001))],
    )


SCENES = {
    "linear": linear(),
    "frictionless": with_friction(0.0),
    "Coulomb 0.3": with_friction(0.3),
    "Coulomb 1.0": with_friction(1.0),
    "pressed": prototype_block(),
}


@cache
def fine_solution(name: str) -> ec.Solution:
    """The solution on a fine mesh, for both coarse ones."""
    return ec.solve(SCENES[name], block(FINE))


@pytest.mark.parametrize("n", [4, pytest.param(8, marks=pytest.mark.broad)])
@pytest.mark.parametrize("name", SCENES)
def test_bound_of_true_errors(name, n):
    scene = SCENES[name]
    pair = ec.equilibrate(ec.solve(scene, block(n)))
    e = ec.constitutive_error(pair).absolute
    true = true_errors(pair, fine_solution(name))
    both = true.displacement**2 + true.stress**2
    print(
        f"\n{name}, n = {n}: e/|u-u^| = {e / true.displacement:.3f}, e/|sigma-sigma^| = {e / true.stress:.3f}, "
        f"e/both = {e / np.sqrt(both):.3f}, third term/e^2 = {true.friction / e**2:.1e}"
    )
    third = (
        max(-true.friction, 0.0) if scene.contacts else 0.0
    )  # may lower what e^2 bounds, by a higher order
    assert true.displacement**2 <= e**2 + third
    assert true.stress**2 <= e**2 + third
    # a reference is not the solution: both errors against it may exceed e by the
    # reference's own error
    assert both + true.friction <= e**2 * 1.02
    assert abs(true.friction) < 0.05 * e**2


@pytest.mark.broad
def test_prager_synge_identity():
    """Smooth manufactured solution, all sides prescribed.

    e^2 is the sum of the squared errors, to quadrature.

    The prescribed values are not linear on the facets; against the loose pair's e, what
    that adds is small.
    """
    E, nu = 1.0, 0.3
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    def exact(x):
        return ufl.as_vector([ufl.sin(2 * x[0]) * x[1], ufl.cos(x[0]) * x[1] ** 2])

    def force(x):
        eps = ufl.sym(ufl.grad(exact(x)))
        return -ufl.div(2 * G * eps + lam * ufl.tr(eps) * ufl.Identity(2))

    sides = [
        ec.Displacement(s, (lambda x: exact(x)[0], lambda x: exact(x)[1]))
        for s in ("left", "right", "bottom", "top")
    ]
    scene = ec.Scene(material=ec.Elastic(E, nu), supports=sides, loads=[ec.BodyForce(force)])
    index = []
    for n in (4, 8):
        pair = ec.equilibrate(
            ec.solve(scene, ec.rectangle((0, 0), (1, 1), cells=(n, n))), tighten=0
        )
        error = ec.constitutive_error(pair)
        true = true_errors(pair, ec.solve(scene, ec.rectangle((0, 0), (1, 1), cells=(64, 64))))
        index.append(error.absolute**2 / (true.displacement**2 + true.stress**2))
        assert error.oscillation < 0.5 * error.absolute
    print("\ne^2/(|u-u^|^2 + |sigma-sigma^|^2):", index)
    assert np.allclose(index, 1.0, atol=0.03)
    assert abs(index[1] - 1) < abs(index[0] - 1) + 1e-3
