"""Measure what e^2 holds beside the two true errors, on flat and on parabolic gaps.

Without friction ``e^2 = a^2 + b^2 + 2 A + 2 B`` with the errors a of u^ and b of
sigma^, ``A = int |r_n| (g - [u^]_n)`` and ``B = int |r^_n| (g - [u]_n)``. Printed are
the shares of the four in e^2, the index ``e / sqrt(a^2 + b^2)`` of both errors, and the
index e/a of u^. The scenes: a brick on a rigid foundation, and two bricks, pressed on a
contact of 2 to 16 facets.

The reference is of degree 2 on a mesh that is cut and refined three times. B is
integrated on its facets, and A is what remains.

    OMP_NUM_THREADS=1 python benchmarks/gap_shares.py
"""

from __future__ import annotations

from itertools import product

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from bricks import NAMES, bricks, lower_brick  # isort: skip
from true_errors import FACET_DEGREE, Reference  # isort: skip
from true_errors import normal_traction_at, reference, true_errors  # isort: skip

from erc_contact.admissible.pair import Admissible
from namedmesh.simplex import rule

LEVELS = 3
"""Refinements of the reference beyond the cut."""
FACETS = (2, 4, 8, 16)
"""Numbers of facets of the contact."""
DEPTH = 0.02
"""Depth by which the body is pressed [length]."""
CURVATURE = {"flat": 0.0, "parabola": 0.02}
"""Factor c of the gap ``c x^2`` on ``|x| < 1`` [1/length]."""


def scene(kind: str, gap: str, facets: int) -> tuple[ec.Scene, ec.Domain]:
    """Make a scene and its mesh.

    Args:
        kind: "foundation" or "two bodies".
        gap: One of :data:`CURVATURE`.
        facets: Number of facets of the contact.
    """
    curvature = CURVATURE[gap]
    distance = (lambda x: curvature * x[0] ** 2) if curvature else 0.0
    cells = (facets, max(1, facets // 2))
    if kind == "foundation":
        body = lower_brick(2, cells)
        contact = ec.Contact("lower contact", gap=distance)
        support = ec.Displacement("lower outer", (0.0, DEPTH))
        return ec.Scene(ec.Elastic(1.0, 0.3), [support], [], [contact]), body
    contact = ec.Contact(NAMES[0], against=NAMES[1], gap=distance)
    supports = [
        ec.Displacement("upper outer", (0.0, -DEPTH)),
        ec.Displacement("lower outer", (0.0, 0.0)),
    ]
    material = ec.Elastic({"upper": 1.0, "lower": 3.0}, 0.3)
    return ec.Scene(material, supports, [], [contact]), bricks(2, cells)


def pressed_gap(pair: Admissible, exact: Reference) -> float:
    """Compute B, the integral of ``|r^_n| (g - [u]_n)`` [force length]."""
    model = exact.model
    space = model.space
    (contact,) = model.contacts
    points, weights = rule(space.d - 1, FACET_DEGREE)
    facets = contact.facets
    x = space.evaluate(space.x, points, facets)
    w = space.evaluate(contact.jump(exact.u), points, facets)
    w_n = (w * contact.direction[:, None]).sum(axis=-1)
    gap = np.zeros_like(w_n)
    if contact.gap is not None:
        gap = space.evaluate(contact.gap, points, facets).reshape(w_n.shape)
    r_n = normal_traction_at(pair, 0, exact.parent[facets[:, 0]], x)
    return float(space.facet_areas(facets) @ ((-r_n * (gap - w_n)) @ weights))


def main() -> None:
    """Print the table."""
    print("scene, gap           degree facets     eps   a^2   b^2    2A    2B  index    e/a")
    for kind, gap, degree in product(("foundation", "two bodies"), CURVATURE, (1, 2)):
        for facets in FACETS:
            solution = ec.solve(*scene(kind, gap, facets), degree=degree)
            pair = ec.equilibrate(solution)
            error = ec.constitutive_error(pair)
            exact = reference(solution, LEVELS, degree=2)
            true = true_errors(pair, exact)
            whole = error.absolute**2
            a_2 = true.of_u**2 / whole
            b_2 = true.of_both**2 / whole - a_2
            twice_b = 2 * pressed_gap(pair, exact) / whole
            shares = (a_2, b_2, 1 - a_2 - b_2 - twice_b, twice_b)
            told = "".join(f"{share:6.1%}" for share in shares)
            index = error.absolute / true.of_both
            print(
                f"{kind:10} {gap:10} {degree:5} {facets:6} {error.relative:7.2%} {told}"
                f" {index:6.3f} {error.absolute / true.of_u:6.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
