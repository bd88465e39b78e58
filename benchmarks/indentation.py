"""Press a ball on an elastic-plastic body, and compare with published fits of the load.

A deformable ball and a rigid flat, or a rigid ball and a deformable half space, are the
same as long as the contact is small beside the ball. Without friction and without
hardening, load over depth is one curve if both are over their values at first yield:

- Kogut, Etsion, J. Appl. Mech. 69 (2002) 657: ``P/P_c = 1.03 (w/w_c)^1.425`` to depth
  6, ``1.40 (w/w_c)^1.263`` beyond it, up to 110.
- Jackson, Green, J. Tribol. 127 (2005) 343: exponentials with a hardness that falls as
  the contact grows, and Hertz's load up to depth 1.9.

Their critical depths differ by less than 2%; each fit is taken with its own. Here the
body is a cylinder whose radius and height are 50 times the contact radius at the end,
with hardening 0.2% of E, loaded in a history on meshes that refine each other.

    OMP_NUM_THREADS=1 python benchmarks/indentation.py [accuracy]
"""

from __future__ import annotations

import logging
import sys
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

E, NU, YIELD = 1.0, 0.3, 0.002
HARDENING = 0.002
RADIUS = 1.0
MODULUS = E / (1 - NU**2)
"""Young's modulus of the contact, with a rigid partner [force/area]."""
EXTENT = 1.2
"""Radius and height of the body [length]."""
DEPTHS = (1.0, 2.0, 4.0, 6.0, 10.0, 15.0, 20.0)
"""Depths over the critical depth of Jackson and Green [-]."""


def hertz(depth: float) -> float:
    """Return the elastic load [force] at a depth [length]."""
    return float(4 / 3 * MODULUS * np.sqrt(RADIUS) * depth**1.5)


def critical_depth(pressure: float) -> float:
    """Return the depth [length] at which ``pressure`` is the greatest of Hertz's."""
    return float((np.pi * pressure / (2 * MODULUS)) ** 2 * RADIUS)


KOGUT_ETSION = critical_depth((0.454 + 0.41 * NU) * 2.8 * YIELD)
FACTOR = 1.295 * np.exp(0.736 * NU)
"""Greatest pressure over the yield stress at first yield, by Jackson and Green [-]."""
JACKSON_GREEN = critical_depth(FACTOR * YIELD)


def kogut_etsion(depth: float) -> float:
    """Return the load by Kogut and Etsion [force]."""
    ratio = depth / KOGUT_ETSION
    if ratio <= 1.0:
        return hertz(depth)
    factor, exponent = (1.03, 1.425) if ratio <= 6.0 else (1.40, 1.263)
    return hertz(KOGUT_ETSION) * factor * ratio**exponent


def jackson_green(depth: float) -> float:
    """Return the load by Jackson and Green [force]."""
    ratio = depth / JACKSON_GREEN
    if ratio <= 1.9:
        return hertz(depth)
    strain = YIELD / MODULUS
    exponent = 0.14 * np.exp(23 * strain)
    size = np.pi * FACTOR * strain / 2 * np.sqrt(ratio) * (ratio / 1.9) ** (exponent / 2)
    hardness = 2.84 * (1 - np.exp(-0.82 * size**-0.7))
    elastic = np.exp(-0.25 * ratio ** (5 / 12)) * ratio**1.5
    plastic = 4 * hardness / FACTOR * (1 - np.exp(-(ratio ** (5 / 9)) / 25)) * ratio
    return float(hertz(JACKSON_GREEN) * (elastic + plastic))


def loads(material: Any, accuracy: float) -> ec.Evolution:
    """Press the body; the times of the steps are the depths."""

    def scene_at(depth: float) -> ec.Scene:
        return ec.Scene(
            material,
            [ec.Displacement("top", (None, -depth * JACKSON_GREEN))],
            contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * RADIUS))],
        )

    body = ec.rectangle((0.0, 0.0), (EXTENT, EXTENT), cells=(6, 6))
    return ec.evolve(
        scene_at, body, DEPTHS, accuracy, degree=2, strategy=ec.Mark(), max_cells=20_000
    )


def main(accuracy: str = "0.02") -> None:
    """Print loads over both fits."""
    law = ec.Plastic(E, NU, YIELD, HARDENING, hypothesis="axisymmetric")
    history = loads(law, float(accuracy))
    elastic = loads(ec.Elastic(E, NU, hypothesis="axisymmetric"), float(accuracy))
    print("depth  cells    eps   P/P_c  over J&G  over K&E  elastic over Hertz  plastic radius")
    for row, error, of_elastic in zip(history.steps, history.errors, elastic.steps, strict=True):
        depth = row.time * JACKSON_GREEN
        load = row.force["bottom"][1]
        body = of_elastic.force["bottom"][1] / hertz(depth)
        print(
            f"{row.time:5.1f} {row.cells:6d} {row.eps:6.2%} {load / hertz(JACKSON_GREEN):7.2f} "
            f"{load / jackson_green(depth) - 1:+9.2%} {load / kogut_etsion(depth) - 1:+9.2%} "
            f"{body - 1:+18.2%} {_plastic_radius(error):15.4f}",
            flush=True,
        )


def _plastic_radius(error: ec.ConstitutiveError) -> float:
    """Return how far the plastic zone reaches from the axis [length]."""
    yielded = ec.results.state(error, "accumulated") > 0
    corners = error.admissible.cell_geometry.corners[: len(yielded)]
    return float(corners[yielded].mean(axis=1)[:, 0].max(initial=0.0))


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    main(*sys.argv[1:])
