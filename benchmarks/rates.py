"""Measure error against run time and against degrees of freedom on the block.

Adaptive refinement is compared with uniform refinement.

The pressed and sheared block (0, 2) x (0, 7) with a clamped top. The clamped-free
corners are singular with exponent 0.7112 (nu = 0.3): uniform meshes converge like
h^0.71, adaptive ones like cells^-1/2.

    OMP_NUM_THREADS=1 python benchmarks/rates.py [accuracy]
"""

import sys
from pathlib import Path

import erc_contact as ec
from erc_contact.output import plot_history

CORNER = 0.7112


def main() -> None:
    accuracy = float(sys.argv[1]) if len(sys.argv) > 1 else 0.01
    ec.log_to_console()
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    start = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
    ec.solve(
        scene, start
    )  # compiles the forms, so that the first row is not a measure of the compiler
    histories = {
        "adaptive": ec.adapt(scene, start, accuracy),
        "uniform": ec.adapt(scene, start, accuracy, strategy=ec.Uniform(), max_cells=500_000),
    }
    folder = Path("results/rates")
    folder.mkdir(parents=True, exist_ok=True)
    for name, history in histories.items():
        history.to_csv(folder / f"{name}.csv")
        slope = history.slope("cells", last=4)
        print(
            f"{name}: slope of eps against cells {slope:.3f}, last eps {history.best.relative:.3%}"
        )
    print(f"expected: adaptive -0.5, uniform {-CORNER / 2:.3f}")
    plot_history(histories, folder / "rates.png")


if __name__ == "__main__":
    main()
