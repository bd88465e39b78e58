"""Make the random scenes on which the claims of the pages are measured.

The code was not written for these scenes. A family is a function of a generator of
numpy: the same seed gives the same scenes. Lengths are about 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip


@dataclass(frozen=True)
class Sample:
    """Hold a scene of a family with its mesh.

    Attributes:
        name: What is random in the scene, in a few words.
        scene: The scene.
        domain: The mesh.
        degree: Degree of the displacement.
    """

    name: str
    scene: ec.Scene
    domain: ec.Domain
    degree: int


def scene_generator(seed: int, number: int) -> np.random.Generator:
    """Make the random generator of one scene of a family.

    A scene does not depend on those before it.
    """
    return np.random.default_rng([seed, number])


# -- blocks in the plane, of any material
# ----------------------------------------------------------------------------


def random_block(rng: np.random.Generator) -> Sample:
    """Make a block in the plane of 4 to 128 triangles.

    Modulus, Poisson's ratio, friction, gap and support are random.

    Half of the bodies have Poisson's ratios between -0.7 and 0.49, half between 0.49
    and 0.4999, as many in each decade of ``1/2 - nu``.
    """
    columns, rows = (int(count) for count in rng.integers(1, 9, 2))
    columns = max(columns, 2) if rows == 1 else columns
    height = 1.0
    width = float(columns / rows * np.exp(rng.uniform(-0.7, 0.7)))
    domain = ec.rectangle((0.0, 0.0), (width, height), cells=(columns, rows))
    nu = float(rng.uniform(-0.7, 0.49))
    if rng.random() < 0.5:
        nu = 0.5 - float(10 ** rng.uniform(-4.0, -2.0))
    law = str(rng.choice(["constant", "linear", "exponential", "jump"]))
    material = ec.Elastic(random_modulus(rng, law, width), nu)
    degree = int(rng.integers(1, 3))
    support = str(rng.choice(["top held", "left held", "left roller"]))
    supports, loads = _supports_and_loads(rng, support, width)
    friction = friction_along(rng, width, 0.8)
    gap = _gap(rng, width)
    scene = ec.Scene(material, supports, loads, [ec.Contact("bottom", friction=friction, gap=gap)])
    name = (
        f"{columns} x {rows}, width {width:.2f}, nu {nu:.4f}, E {law}, {support}, degree {degree}"
    )
    return Sample(name, scene, domain, degree)


def random_modulus(rng: np.random.Generator, law: str, width: float) -> Any:
    """Make Young's modulus [force/area].

    It is constant, linear, exponential, or has a jump along a line that is not one of
    facets.
    """
    contrast = float(10 ** rng.uniform(-2.0, 2.0))
    slope_x, slope_y = (float(slope) for slope in rng.uniform(-1.0, 1.0, 2))
    offset = float(rng.uniform(0.3, 0.7))

    def along(x: Any) -> Any:
        # Between -1 and 1 in the body.
        return (slope_x * x[0] / width + slope_y * x[1]) / (abs(slope_x) + abs(slope_y))

    laws: dict[str, Callable[[Any], Any] | float] = {
        "constant": 1.0,
        "linear": lambda x: 1.2 + along(x),
        "exponential": lambda x: ufl.exp(2.0 * along(x)),
        "jump": lambda x: ufl.conditional(
            ufl.gt(x[1] + 0.37 * x[0] / width, offset), contrast, 1.0
        ),
    }
    return laws[law]


def _supports_and_loads(
    rng: np.random.Generator, support: str, width: float
) -> tuple[list[ec.Displacement], list[Any]]:
    """Make supports and loads that press the block on its foundation."""
    push, press, tilt = (
        float(rng.uniform(low, high)) for low, high in ((-0.05, 0.05), (0.01, 0.05), (-0.02, 0.02))
    )
    if support == "top held":
        top = ec.Displacement("top", (push, lambda x: tilt / width * x[0] - press))
        return [top], [ec.Traction("right", (push, 0.0))]
    load = ec.Traction("top", (push if support == "left held" else 0.0, -press))
    held = (0.0, 0.0) if support == "left held" else (0.0, None)
    return [ec.Displacement("left", held)], [load]


def friction_along(rng: np.random.Generator, width: float, largest: float) -> Any:
    """Make a friction coefficient [-], constant or growing along the contact."""
    mu = float(rng.uniform(0.05, largest))
    growth = float(rng.uniform(0.0, 0.5))
    if rng.random() < 0.5:
        return mu
    return lambda x: mu * (1 + growth * x[0] / width)


def _gap(rng: np.random.Generator, width: float) -> Any:
    """Make no gap, or a parabola that is zero inside the contact [length]."""
    curvature = float(rng.uniform(0.0, 0.04))
    middle = float(rng.uniform(0.3, 0.7)) * width
    if rng.random() < 0.5:
        return 0.0
    return lambda x: curvature * (x[0] - middle) ** 2


def random_strains(rng: np.random.Generator) -> list[ec.GivenStrain]:
    """Make one or two given strains, constant or varying, of the size of the pushes."""
    size, slope, phase = (float(value) for value in rng.uniform(-0.05, 0.05, 3))
    rate = float(rng.uniform(1.0, 6.0))
    fields: list[Any] = [
        size,
        lambda x: size + slope * x[0] + phase * x[1],
        lambda x: size * ufl.sin(rate * x[0] + 40 * phase) * ufl.exp(-x[1]),
    ]
    heat = ec.ThermalStrain(1.0, fields[int(rng.integers(3))])
    misfit = ec.Eigenstrain(((size, slope), (slope, lambda x: phase * x[0] * x[1])))
    choices: list[list[ec.GivenStrain]] = [[heat], [misfit], [heat, misfit]]
    return choices[int(rng.integers(3))]


def random_springs(rng: np.random.Generator) -> list[ec.Spring]:
    """Make springs on one or both sides, 0.01 to 100 times as stiff as the block."""
    springs = []
    for part in ("left", "right")[: int(rng.integers(1, 3))]:
        normal, tangential = (float(10**power) for power in rng.uniform(-2.0, 2.0, 2))
        springs.append(ec.Spring(part, normal=normal, tangential=tangential))
    return springs


def random_foundation(rng: np.random.Generator) -> dict[str, Any]:
    """Make a foundation 0.01 to 1000 times as stiff as the block, and a gap above it.

    Returns the arguments of a contact; both are constant or vary.
    """
    k = float(10 ** rng.uniform(-2.0, 3.0))
    more = float(rng.uniform(0.2, 5.0))
    height, middle = (float(value) for value in rng.uniform(0.0, 1.0, 2))
    stiffness: list[Any] = [
        k,
        lambda x: k * (1.0 + more * x[0]),
        ec.table([0.0, middle, 1.0], [k, more * k, k]),
    ]
    gaps: list[Any] = [0.0, lambda x: 0.04 * height * (x[0] - middle) ** 2]
    foundation = ec.Foundation(stiffness[int(rng.integers(3))])
    return {"foundation": foundation, "gap": gaps[int(rng.integers(2))]}


# -- blocks with Coulomb friction, in the plane and in 3D
# ---------------------------------------------------------


def random_sliding_block(rng: np.random.Generator) -> Sample:
    """Make a block in the plane with Coulomb friction, which sticks, slips or opens."""
    rows = int(rng.integers(2, 9))
    width = float(np.exp(rng.uniform(-0.5, 1.2)))
    columns = max(2, round(rows * width))
    domain = ec.rectangle((0.0, 0.0), (width, 1.0), cells=(columns, rows))
    nu = float(rng.uniform(0.0, 0.45))
    law = str(rng.choice(["constant", "constant", "linear", "exponential", "jump"]))
    material = ec.Elastic(random_modulus(rng, law, width), nu)
    degree = int(rng.integers(1, 3))
    support = str(rng.choice(["top held", "top held", "left held", "left roller"]))
    supports, loads = _supports_and_loads(rng, support, width)
    contact = ec.Contact("bottom", friction=friction_along(rng, width, 0.8), gap=_gap(rng, width))
    name = (
        f"{columns} x {rows}, width {width:.2f}, nu {nu:.2f}, E {law}, {support}, degree {degree}"
    )
    return Sample(name, ec.Scene(material, supports, loads, [contact]), domain, degree)


def random_sliding_box(rng: np.random.Generator) -> Sample:
    """Make a block in 3D with Coulomb friction whose top is moved."""
    sizes = [float(size) for size in rng.uniform(0.7, 1.6, 2)] + [1.0]
    count = int(rng.integers(2, 5))
    cells = [max(2, round(count * size)) for size in sizes]
    domain = ec.box((0.0, 0.0, 0.0), sizes, cells=cells)
    nu = float(rng.uniform(0.0, 0.45))
    push = [float(value) for value in rng.uniform(-0.05, 0.05, 2)]
    press, tilt = float(rng.uniform(0.01, 0.05)), float(rng.uniform(-0.02, 0.02))
    top = ec.Displacement("top", (*push, lambda x: tilt / sizes[0] * x[0] - press))
    contact = ec.Contact(
        "bottom", friction=friction_along(rng, sizes[0], 0.8), gap=_gap(rng, sizes[0])
    )
    name = f"{' x '.join(str(n) for n in cells)}, nu {nu:.2f}, degree 1"
    return Sample(name, ec.Scene(ec.Elastic(1.0, nu), [top], [], [contact]), domain, 1)
