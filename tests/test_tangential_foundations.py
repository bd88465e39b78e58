"""Foundations, and layers between bodies, that give way tangentially.

- a block that is pressed and sheared on one has the closed form of springs in a row
  while it sticks, and slips at its friction bound, by all methods and both solvers, in
  the plane and in space;
- with a bound that nothing reaches it is a bed of springs, in the plane, on rings and
  between bodies;
- the error in its law is zero for the law and for nothing else, and tends to the term
  of a rigid foundation;
- e bounds true errors, and the energy of a fine mesh lies in the interval of a coarse
  one;
- histories give back what springs store and dissipate on the slip alone, and go on from
  a checkpoint; ranks agree; what is wrong is refused in words.
"""


import numpy as np
import pytest
from mpi4py import MPI
from scenes import mostly_serial

import erc_contact as ec

E, G = 1000.0, 500.0
MU, K_N, K_T = 0.4, 800.0, 300.0
PRESS = 0.02
PRESSURE = PRESS / (1 / K_N + 1 / E)
STICKS = MU * PRESSURE * (1 / K_T + 1 / G)
"""Greatest push at which the block sticks."""
METHODS = [None, ec.Nitsche(theta=1), ec.Nitsche(theta=-1), ec.AugmentedLagrangian()]
BED = ec.Foundation(K_N, K_T)


def measured(scene, domain, **options) -> ec.ConstitutiveError:
    """Of the augmented Lagrangian unless said otherwise: its forms are few."""
    solution = ec.solve(scene, domain, **{"method": ec.AugmentedLagrangian(), **options})
    return ec.constitutive_error(ec.equilibrate(solution))


def block(d: int = 2, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    if d == 2:
        return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2), comm=comm)
    return ec.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=(3, 2, 2), comm=comm)


def sheared(push, shear, bed=BED, friction=MU) -> ec.Scene:
    """A block pressed and pushed at its top, of a uniform stress.

    Args:
        push: Tangential displacement of the top, d - 1 numbers.
        shear: Shear on the foundation, d - 1 numbers, which its sides have, too.
    """
    d = len(push) + 1
    loads = []
    for sides, component in zip((("left", "right"), ("front", "back")), shear, strict=False):
        for side, sign in zip(sides, (-1.0, 1.0), strict=True):
            loads.append(ec.Traction(side, (*(0.0,) * (d - 1), sign * component)))
    material = ec.Elastic(E, 0.0, "plane stress") if d == 2 else ec.Elastic(E, 0.0)
    top = ec.Displacement("top", (*push, -PRESS))
    contact = ec.Contact("bottom", friction=friction, foundation=bed)
    return ec.Scene(material, top, loads, contact)


def uniform(amount: float, d: int = 2, slipped: float = 0.0) -> tuple[ec.Scene, float, float]:
    """The scene of a push, its shear, and its slip, from a slip before."""
    shear = (amount - slipped) / (1 / K_T + 1 / G)
    shear = float(np.clip(shear, -MU * PRESSURE, MU * PRESSURE))
    slip = amount - shear * (1 / K_T + 1 / G)
    along = np.array([1.0] if d == 2 else [0.8, 0.6])
    return sheared(tuple(amount * along), shear * along), shear, slip


def bodies(d: int) -> ec.Domain:
    return block(d)


@pytest.mark.pairs
@pytest.mark.parametrize("amount", [0.6, 2.5])
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2]))
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("d", mostly_serial([2, 3], [2]))
def test_a_block_sticks_and_slips_on_springs(d, solver, method, degree, amount):
    scene, shear, slip = uniform(amount * STICKS, d)
    assert (slip > 1e-3 * STICKS) == (amount > 1)
    error = measured(scene, block(d), degree=degree, method=method, solver=solver)
    assert error.relative < 1e-9
    table = error.profile("bottom")
    assert table["pressure"] == pytest.approx(PRESSURE, rel=1e-8)
    assert abs(table["shear"]) == pytest.approx(shear, rel=1e-8)
    assert abs(table["slip"]) == pytest.approx(slip, abs=1e-8 * STICKS)
    assert np.all(table["status"] == (2 if amount < 1 else 1))
    moved = error.at(np.full(d, 0.5) * (1.0, *(0.0,) * (d - 1))).displacement[0]
    assert np.linalg.norm(moved[:-1]) == pytest.approx(slip + shear / K_T, rel=1e-8)
    # Two springs in a row, and the body between them; friction takes b on the slip.
    stored = PRESSURE**2 * (1 / K_N + 1 / E) / 2 + shear**2 * (1 / K_T + 1 / G) / 2
    # The shear of the sides does work on what the block sinks by: none together.
    energy = ec.potential_energy(error)
    assert energy.value == pytest.approx(2.0 * (stored + MU * PRESSURE * slip), rel=1e-8)
