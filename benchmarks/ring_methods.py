"""Compare the forces of both contact methods on balls that press bonded layers.

Each scene of docs/axisymmetric.md's kind is run to 0.5% by Nitsche's method and by the
augmented Lagrangian; the reference is a run to 0.05%.

    OMP_NUM_THREADS=1 python benchmarks/ring_methods.py
"""

from __future__ import annotations

import erc_contact as ec

SCENES = (
    (500, 10, 0.3, 0.0),
    (500, 10, 0.3, 0.1),
    (500, 10, 0.3, 0.2),
    (500, 10, 0.3, 0.3),
    (200, 10, 0.3, 0.0),
    (1000, 15, 0.2, 0.0),
    (300, 8, 0.4, 0.2),
    (500, 20, 0.45, 0.0),
    (100, 10, 0.3, 0.3),
    (800, 6, 0.1, 0.15),
)
"""Radius of the ball, thickness of the layer, Poisson's ratio, friction."""
METHODS = {"default": None, "augmented Lagrangian": ec.AugmentedLagrangian()}


def pressed(radius: float, thickness: float, nu: float, friction: float) -> ec.Scene:
    """Make a layer whose top is moved towards a ball."""
    return ec.Scene(
        ec.Elastic(1000.0, nu, hypothesis="axisymmetric"),
        [ec.Displacement("top", (0.0, -0.1))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * radius), friction=friction)],
    )


def force(
    scene: ec.Scene,
    domain: ec.Domain,
    accuracy: float,
    method: ec.Method | None,
    strategy: ec.Strategy,
) -> float:
    """Return the axial force of a run to an accuracy [force]."""
    history = ec.adapt(scene, domain, accuracy, method=method, strategy=strategy, degree=2)
    return float(history.force("bottom").force[1])


def main() -> None:
    """Print by how much the force is off."""
    worst = dict.fromkeys(METHODS, 0.0)
    for data in SCENES:
        scene = pressed(*data)
        domain = ec.rectangle((0.0, 0.0), (100.0, data[1]), size=3.0)

        reference = force(scene, domain, 0.0005, None, ec.SizeMap())
        print(data, f"force {reference:.6g}", end="")
        for name, method in METHODS.items():
            for strategy in (ec.Mark(), ec.SizeMap()):
                off = force(scene, domain, 0.005, method, strategy) / reference - 1
                worst[name] = max(worst[name], abs(off))
                print(f"  {name}, {strategy}: {off:+.3%}", end="")
        print()
    print({name: f"{off:.3%}" for name, off in worst.items()})


if __name__ == "__main__":
    main()
