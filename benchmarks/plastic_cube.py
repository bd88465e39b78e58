"""Press a ball on a plastic cube: the scene of step 42 of the deal.II tutorial.

A cube of side 1 has E = 200 000, nu = 0.3 and linear isotropic hardening, stands on its
bottom, which is clamped, and slides up and down its walls. A rigid ball of radius 0.6
is pressed 0.01 into its top, without friction. The tutorial (Frohne, Heister, Bangerth,
Int. J. Numer. Methods Eng. 105 (2016) 416) yields where the norm of the deviator of the
stress is 400, and beyond it keeps the share 0.01 of the elastic slope: yield stress and
hardening here follow from both. The tutorial prints the force of the ball on the first
and the fourth of its meshes of hexahedra, refined by Kelly's estimator. Here a quarter
of the cube is computed.

    OMP_NUM_THREADS=1 python benchmarks/plastic_cube.py [degree] [accuracy]
"""

from __future__ import annotations

import logging
import sys

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

E, NU = 200_000.0, 0.3
NORM, SHARE = 400.0, 0.01
"""Norm of the deviator at yielding [force/area], and share of the slope beyond it."""
SHEAR = E / (2 * (1 + NU))
LAW = ec.Plastic(
    E=E,
    nu=NU,
    yield_stress=np.sqrt(1.5) * NORM,
    hardening=3 * SHEAR * SHARE / (1 - SHARE),
)
RADIUS, DEPTH = 0.6, 0.01
TUTORIAL = {2187: 37.3058, 52497: 56.794}
"""Forces of the tutorial by the number of unknowns."""


def gap(x: np.ndarray) -> np.ndarray:
    """Return the height of the ball over the top of the cube."""
    square = (x[0] - 0.5) ** 2 + (x[1] - 0.5) ** 2
    return RADIUS - DEPTH - np.sqrt(np.maximum(RADIUS**2 - square, 0.0))


def main(degree: str = "2", accuracy: str = "0.04") -> None:
    """Print forces and errors of the meshes."""
    quarter = ec.box((0.5, 0.5, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 4))
    supports = [
        ec.Displacement("bottom", (0.0, 0.0, 0.0)),
        ec.Displacement("right", (0.0, 0.0, None)),
        ec.Displacement("back", (0.0, 0.0, None)),
        # Planes of symmetry.
        ec.Displacement("left", (0.0, None, None)),
        ec.Displacement("front", (None, 0.0, None)),
    ]
    scene = ec.Scene(LAW, supports, contacts=[ec.Contact("top", gap=gap)])
    print("tutorial:", ", ".join(f"{f:.1f} at {n} unknowns" for n, f in TUTORIAL.items()))
    print("  cells  unknowns     eps  force  seconds")

    def told(error: ec.ConstitutiveError, step: ec.Step) -> None:
        force = -4 * error.solution.force("top").force[2]
        print(
            f"{step.cells:7d} {step.dofs:9d} {step.eps:7.2%} {force:6.2f} {step.seconds:8.1f}",
            flush=True,
        )

    ec.adapt(scene, quarter, float(accuracy), degree=int(degree), callback=told)


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    main(*sys.argv[1:])
