"""Compare blocks on springs, turned by a random angle, with themselves unturned.

Springs that are stiff in one direction have a traction that is chosen in this direction
alone if the side is across an axis of coordinates, and else none that is chosen. What
this costs is eps of the turned block over eps of the same block unturned: blocks on 2 x
1 to 12 x 6 squares, degrees 1 and 2, nu to 0.49, on a support, a contact or springs
alone; springs of 1 to 1e7 times the modulus over the height, in both directions, or a
tenth, a thousandth or none of it in one.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import Any

import erc_contact as ec

from attack_families import scene_generator  # isort: skip - after erc_contact, which loads MPI first
from extreme_domains import rotated  # isort: skip

SHARES = ((1.0, 0.0), (1.0, 1e-3), (1.0, 0.1), (1.0, 1.0), (0.0, 1.0), (1e-3, 1.0))
"""Normal and tangential stiffness over the greater one [-]."""


def turned_springs(seed: int, number: int) -> tuple[float, str]:
    """Solve a random block turned and unturned; return the ratio of eps, and a name."""
    rng = scene_generator(seed, number)
    n = int(rng.integers(1, 7))
    degree = int(rng.integers(1, 3))
    nu = float(rng.choice([0.0, 0.3, 0.45, 0.49]))
    held_by = str(rng.choice(["support", "contact", "springs"]))
    side, other = (str(name) for name in rng.permutation(["left", "right"]))
    stiffness = float(10 ** rng.uniform(0.0, 7.0))
    normal, tangential = SHARES[int(rng.integers(len(SHARES)))]
    # Something must hold the block along its base.
    along = stiffness if normal == 0.0 or rng.random() < 0.5 else 0.0
    press = float(rng.uniform(0.005, 0.03))
    pushes = rng.uniform(-0.3, 0.3, 3) * press
    angle = float(rng.uniform(5.0, 85.0))

    eps = []
    for degrees in (0.0, angle):
        domain = rotated(ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * n, n)), degrees)
        loads = [
            ec.Traction("top", _turned(pushes[0], -press, degrees)),
            ec.Traction(other, _turned(pushes[1], pushes[2], degrees)),
        ]
        springs = [ec.Spring(side, normal * stiffness, tangential * stiffness)]
        held: dict[str, Any] = {}
        if held_by == "support":
            held["supports"] = ec.Displacement("bottom", (0.0, 0.0))
        elif held_by == "contact":
            held["contacts"] = ec.Contact("bottom", friction=ec.Tresca(press))
        else:
            springs.append(ec.Spring("bottom", stiffness, along))
        scene = ec.Scene(ec.Elastic(1.0, nu), loads=loads, springs=springs, **held)
        solution = ec.solve(scene, domain, degree=degree)
        eps.append(ec.constitutive_error(ec.equilibrate(solution)).relative)
    name = f"{n} squares, degree {degree}, nu {nu}, on {held_by}, springs {stiffness:.0e} times "
    name += f"{normal:g}, {tangential:g}, eps {eps[0]:.3%} unturned"
    return eps[1] / eps[0], name


def _turned(along: float, up: float, degrees: float) -> tuple[float, float]:
    """Turn a vector."""
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return (c * along - s * up, s * along + c * up)


def summary(seed: int, count: int) -> tuple[dict[str, list[float]], str]:
    """Return the ratios of random blocks by what holds the block, and the worst one."""
    ratios: dict[str, list[float]] = {}
    worst = (0.0, "")
    for number in range(count):
        ratio, name = turned_springs(seed, number)
        ratios.setdefault(name.split(", on ")[1].split(",")[0], []).append(ratio)
        worst = max(worst, (ratio, name))
    return ratios, f"worst: {worst[0]:.2f} ({worst[1]})"
