"""Make the scenes of which the effectivity is measured, each with its meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import ufl  # isort: skip - after erc_contact, which loads MPI first
from true_errors import Reference, known, reference  # isort: skip

MAX_FINE = 1_600_000
"""Cells of a reference at most: about 3 GB in 2D."""


@dataclass(frozen=True)
class Case:
    """Hold a scene with its meshes.

    Attributes:
        scene: The scene, or a function of the degree that gives it.
        meshes: The uniform sequence, coarse to fine; the adaptive one starts from its
            first.
        levels: Uniform refinements of the reference beyond the cut at the barycentres.
        exact: Known displacement, a function of the degree that gives a callable of x;
            or None.
        max_cells: Cells at most in a figure of error against run time.
        max_fine: Cells of a reference at most.
    """

    scene: Any
    meshes: tuple[Callable[[], ec.Domain], ...]
    levels: int = 4
    exact: Any = None
    max_cells: int = 120_000
    max_fine: int = MAX_FINE

    def of_degree(self, degree: int) -> ec.Scene:
        """Make the scene whose data elements of the degree represent exactly."""
        return self.scene if isinstance(self.scene, ec.Scene) else self.scene(degree)

    def truth(self, solution: ec.Solution, degree: int) -> Reference:
        """Return what counts as exact on the mesh of a solution."""
        return (
            known(solution, self.exact(degree)) if self.exact else reference(solution, self.levels)
        )

    def affordable(self, cells: int, d: int, degree: int) -> bool:
        """Tell whether the reference of a mesh fits into memory."""
        return (
            bool(self.exact)
            or cells * (d + 1) * 2 ** (d * self.levels) * degree**d <= self.max_fine
        )


def block(friction: Any, nu: float = 0.3) -> ec.Scene:
    """Make the scene of the pressed and sheared block, (0, 2) x (0, 7)."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=nu),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def opening(friction: Any) -> ec.Scene:
    """Make the scene of the block that is tilted and pushed.

    Its contact opens on the left, and with friction slips where it is closed.
    """
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, lambda x: 0.02 - 0.04 * x[0]))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def greco() -> ec.Scene:
    """Make the scene of the compressed and pushed block (GRECO): N, mm."""
    return ec.Scene(
        material=ec.Elastic(E=130e3, nu=0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
        contacts=[ec.Contact("bottom", friction=1.0)],
    )


def cube(friction: float) -> ec.Scene:
    """Make the scene of a pressed cube with its top held."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, 0.01, -0.05))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def smooth(degree: int) -> Callable[[Any], Any]:
    """Make a displacement of degree k + 1 on the unit square.

    It keeps frictionless contact at y = 0, closed all over.

    u_y = 0 and sigma_xy = 0 at y = 0, u_x = 0 at x = 0; elements of degree k carry all
    its data.
    """
    return lambda x: ufl.as_vector(
        [
            0.02 * x[0] + 0.03 * x[0] ** (degree + 1),
            -0.1 * x[1] - 0.02 * x[0] ** degree * x[1] + 0.03 * x[1] ** (degree + 1),
        ]
    )


def manufactured(degree: int) -> ec.Scene:
    """Make the scene that :func:`smooth` solves.

    It has contact below, a roller on the left, tractions on the other sides.
    """
    material, exact, k = ec.Elastic(E=1.0, nu=0.3), smooth(degree), degree
    shear = 1 / 2.6
    lame = 2 * shear * 0.3 / 0.4

    def stress(x: Any) -> Any:
        eps = ufl.sym(ufl.grad(exact(x)))
        return material.stress(eps, E=material.E, nu=material.nu)

    return ec.Scene(
        material=material,
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[
            ec.Traction("left", (0.0, lambda x: -stress(x)[0, 1])),
            ec.Traction("right", lambda x: stress(x)[:, 0]),
            ec.Traction("top", lambda x: stress(x)[:, 1]),
            ec.BodyForce(
                (
                    lambda x: (
                        -k
                        * (0.03 * (k + 1) * (lame + 2 * shear) - 0.02 * (lame + shear))
                        * x[0] ** (k - 1)
                    ),
                    lambda x: (
                        -k
                        * (
                            0.03 * (k + 1) * (lame + 2 * shear) * x[1] ** (k - 1)
                            - 0.02 * (k - 1) * shear * x[0] ** max(k - 2, 0) * x[1]
                        )
                    ),
                )
            ),
        ],
        contacts=[ec.Contact("bottom")],
    )


def blocks(*n: int) -> tuple[Callable[[], ec.Domain], ...]:
    """Give meshes of the block with n squares across."""
    return tuple(lambda n=n: ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2)) for n in n)


def squares(side: float, *n: int) -> tuple[Callable[[], ec.Domain], ...]:
    """Give meshes of a square with n squares on a side."""
    return tuple(lambda n=n: ec.rectangle((0.0, 0.0), (side, side), cells=(n, n)) for n in n)


def cubes(*n: int) -> tuple[Callable[[], ec.Domain], ...]:
    """Give meshes of the unit cube with n cubes on a side."""
    return tuple(lambda n=n: ec.box((0.0,) * 3, (1.0,) * 3, cells=(n,) * 3) for n in n)


CASES = {
    "block, friction 0.3": Case(block(0.3), blocks(4, 8, 16)),
    "block, frictionless": Case(block(0.0), blocks(4, 8, 16)),
    "block, Tresca friction": Case(block(ec.Tresca(0.0015)), blocks(4, 8, 16)),
    "opening block, frictionless": Case(opening(0.0), blocks(4, 8, 16)),
    "opening block, Tresca friction": Case(opening(ec.Tresca(0.0015)), blocks(4, 8, 16)),
    "block, nu 0.49": Case(block(0.3, 0.49), blocks(8, 16)),
    "block, frictionless, nu 0.49": Case(block(0.0, 0.49), blocks(8, 16)),
    "GRECO": Case(greco(), squares(40.0, 8, 16, 32)),
    "manufactured": Case(manufactured, squares(1.0, 4, 8, 16, 32), exact=smooth),
    "cube, friction 0.3": Case(cube(0.3), cubes(2, 4), levels=3, max_cells=50_000),
    "cube, frictionless": Case(cube(0.0), cubes(2, 4), levels=3, max_cells=50_000),
}
