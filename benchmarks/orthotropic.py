"""Measure orthotropic friction on random boxes in 3D (serial).

``given``: the bound of the ellipse does not depend on the pressure. Then e bounds the
errors of displacement and stress: "both" is e over ``sqrt(|u - u^|^2 + |sigma -
sigma^|^2)`` against a nested reference, and must not be below 1. "outside" is the
greatest excess of r^ over its ellipse, over the greatest bound, at random points, and
"part" the contact part of e^2 over the part by random points less 1; both with formulas
of this file.

``coulomb``: the ellipse is a multiple of the pressure; "both" and "index", e over ``|u
- u^|``.

``goals``: the relative width of the interval of the force along x with an ellipse, over
its width with Coulomb friction of the geometric mean; each over its eps^2.

    OMP_NUM_THREADS=1 python benchmarks/orthotropic.py [name|all] [seed] [count]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_tables import quantile_table  # isort: skip
from tasks import run, tell  # isort: skip
from true_errors import reference, true_errors  # isort: skip

LEVELS = 1
"""Uniform refinements of the reference beyond the cut mesh."""
QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)
"""Quantiles of the tables."""
POINTS = 4000
"""Random points on each facet."""


@dataclass(frozen=True)
class Given:
    """Hold an ellipse that does not depend on the pressure.

    Attributes:
        limit: Bound along the axis [force/area].
        axes: The axis.
        ratio: Bound across the axis, over the limit [-].
    """

    limit: float
    axes: tuple[float, float, float]
    ratio: float
    parameters: ClassVar[tuple[str, ...]] = ("limit",)

    def friction_bound(self, pressure: Any, limit: Any) -> Any:
        """Return the bound along the axis."""
        return limit


@dataclass(frozen=True)
class Box:
    """Hold a random box, without its friction.

    Attributes:
        scene: The scene, whose contact has no friction.
        domain: Its mesh.
        degree: Degree of the displacement.
        axis: Direction in the base.
        strength: Friction coefficients along it and across it [-].
        limit: A shear of the size of its pressures [force/area].
    """

    scene: ec.Scene
    domain: ec.Domain
    degree: int
    axis: tuple[float, float, float]
    strength: tuple[float, float]
    limit: float

    def with_friction(self, law: Any) -> ec.Scene:
        """Return the scene with a friction law."""
        contact = replace(self.scene.contacts[0], friction=law)
        return replace(self.scene, contacts=[contact])


def random_box(seed: int, number: int) -> Box:
    """Make a box that is pushed and pressed on a foundation."""
    rng = np.random.default_rng([seed, number])
    sizes = [float(size) for size in rng.uniform(0.7, 1.6, 2)] + [1.0]
    cells = [int(count) for count in rng.integers(1, 4, 3)]
    cells[0] = max(cells[0], 2)
    domain = ec.box((0.0, 0.0, 0.0), sizes, cells=cells)
    push = [float(value) for value in rng.uniform(-0.05, 0.05, 2)]
    press = float(rng.uniform(0.01, 0.05))
    tilt = float(rng.uniform(-0.01, 0.01))
    top = ec.Displacement("top", (*push, lambda x: tilt * x[0] - press))
    scene = ec.Scene(
        ec.Elastic(1.0, float(rng.uniform(0.0, 0.45))), [top], [], [ec.Contact("bottom")]
    )
    angle = float(rng.uniform(0.0, np.pi))
    axis = float(np.cos(angle)), float(np.sin(angle)), float(rng.uniform(-0.5, 0.5))
    along = float(np.exp(rng.uniform(np.log(0.05), np.log(0.8))))
    ratio = float(np.exp(rng.uniform(-2.0, 2.0)))
    return Box(scene, domain, int(rng.integers(1, 3)), axis, (along, along * ratio), along * press)


def certified(box: Box, law: Any) -> ec.ConstitutiveError:
    """Solve a box with a friction law, and compute the error."""
    solution = ec.solve(box.with_friction(law), box.domain, degree=box.degree)
    return ec.constitutive_error(ec.equilibrate(solution))


def own_contact_part(error: ec.ConstitutiveError, law: Given) -> tuple[float, float]:
    """Return the contact part of e^2 [force length], and the excess over the ellipse.

    The contact is a plane z = 0 below the body, without gap.
    """
    (traction,) = error.admissible.tractions
    degree = error.model.space.degree
    rng = np.random.default_rng(0)
    places = rng.dirichlet((1.0, 1.0, 1.0), POINTS)
    shape = places if degree == 1 else quadratic(places)
    first = np.array(law.axes[:2]) / np.linalg.norm(law.axes[:2])
    axes = np.stack([first, (-first[1], first[0])])
    stretch = np.array([1.0, law.ratio])
    nodal = error.admissible.displacement.x.array.reshape(-1, 3)[traction.nodes]
    if degree == 2:
        # Bernstein coefficients of the middles of edges, opposite to the vertices.
        for middle, ends in zip((3, 4, 5), ((1, 2), (0, 2), (0, 1)), strict=True):
            nodal[:, middle] = 2 * nodal[:, middle] - nodal[:, ends].mean(axis=1)
    part = 0.0
    excess = 0.0
    for area, r, w in zip(traction.area, traction.values, nodal, strict=True):
        of_r = shape @ r
        of_w = shape @ w
        r_t, w_t = of_r[:, :2] @ axes.T, of_w[:, :2] @ axes.T
        density = law.limit * np.linalg.norm(w_t * stretch, axis=1) + (r_t * w_t).sum(axis=1)
        density += of_r[:, 2] * of_w[:, 2]
        part += 2 * area * float(density.mean())
        gauge = np.linalg.norm(r_t / stretch, axis=1)
        excess = max(excess, float((gauge - law.limit).max()))
    return part, excess / law.limit


def quadratic(places: np.ndarray) -> np.ndarray:
    """Evaluate the Bernstein polynomials of degree 2 on triangles, shape (q, 6)."""
    a, b, c = places.T
    return np.column_stack([a * a, b * b, c * c, 2 * b * c, 2 * a * c, 2 * a * b])


def given(seed: int = 0, count: int = 40) -> None:
    """Print the quantiles of boxes whose ellipses do not depend on the pressure."""
    columns: dict[str, list[float]] = {"both": [], "outside": [], "part": []}
    for number in range(count):
        box = random_box(seed, number)
        law = Given(box.limit, box.axis, box.strength[1] / box.strength[0])
        error = certified(box, law)
        exact = reference(error.solution, LEVELS, degree=2)
        columns["both"].append(error.absolute / true_errors(error.admissible, exact).of_both)
        part, outside = own_contact_part(error, law)
        columns["outside"].append(outside)
        columns["part"].append(contact_part(error) / part - 1)
    tell(quantile_table(columns, QUANTILES, "{:.4g}"))


def contact_part(error: ec.ConstitutiveError) -> float:
    """Return the contact part of e^2 as the package has it [force length]."""
    from erc_contact.error.contact import contact_squares  # noqa: PLC0415 - its name here is another

    pair = error.admissible
    return float(
        contact_squares(error.model.space, pair.displacement, pair.tractions[0], 0.0).parts.sum()
    )


def coulomb(seed: int = 0, count: int = 40) -> None:
    """Print the quantiles of boxes with two coefficients of Coulomb friction."""
    columns: dict[str, list[float]] = {"both": [], "index": []}
    for number in range(count):
        box = random_box(seed, number)
        error = certified(box, ec.Orthotropic(box.strength, axes=box.axis))
        true = true_errors(error.admissible, reference(error.solution, LEVELS, degree=2))
        columns["both"].append(error.absolute / true.of_both)
        columns["index"].append(error.absolute / true.of_u)
    tell(quantile_table(columns, QUANTILES, "{:.4g}"))


def goals(seed: int = 0, count: int = 20) -> None:
    """Print the width of intervals of a force beside Coulomb's, and where they end."""
    columns: dict[str, list[float]] = {"ratio of widths": []}
    for number in range(count):
        box = random_box(seed, number)
        goal = ec.Resultant("top", (1.0, 0.0, 0.0))
        widths = []
        mean = float(np.sqrt(np.prod(box.strength)))
        for law in (ec.Orthotropic(box.strength, axes=box.axis), ec.Coulomb(mean)):
            error = certified(box, law)
            bounds = ec.interval(error, goal)
            widths.append((bounds.high - bounds.low) / abs(bounds.value) / error.relative**2)
        columns["ratio of widths"].append(widths[0] / widths[1])
    tell(quantile_table(columns, QUANTILES, "{:.4g}"))


if __name__ == "__main__":
    run({"given": given, "coulomb": coulomb, "goals": goals})
