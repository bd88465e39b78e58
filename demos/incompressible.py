r"""
Rubber: elements that lock, and how that shows
==============================================

Rubber keeps its volume: Poisson's ratio is almost 1/2. A thin pad of it between two
rough plates cannot bulge but at its free sides. So it is far stiffer than its modulus
says. For a long pad of width :math:`w` and thickness :math:`t`, Gent and Lindley found

.. math::

    \frac{P}{w} \frac{t}{\delta} = E_a = \frac{4}{3} E \left(1 + S^2\right),
    \qquad S = \frac{w}{2t},

with the shape factor :math:`S`, the loaded over the free area. It assumes that plane
sections stay plane.

Linear triangles have a hard time here. Each of them must keep its area, and a mesh then
has hardly a motion left that is not zero: it *locks*, is far too stiff, and yet looks
smooth. A user who knows no other value has no way to see it. Here the error in the
constitutive relation tells: it stays large on any mesh of a usual size. Elements of
degree 2 do not lock.

Source: A. N. Gent, P. B. Lindley, "The compression of bonded rubber blocks", Proc.
Inst. Mech. Eng. 173 (1959).
"""

from pathlib import Path

import matplotlib.pyplot as plt

import erc_contact as ec
from erc_contact.output import draw_deformed

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/incompressible")
E, WIDTH, THICKNESS, DOWN = 1.0, 4.0, 1.0, 0.01
APPARENT = 4 / 3 * E * (1 + (WIDTH / (2 * THICKNESS)) ** 2)

# %%
# The pad is glued to a plate above and rests on a rough foundation below. Degree 2 gets
# meshes of half the fineness, so that both have the same number of unknowns.


def pad(nu, n, degree):
    """Unknowns, error, and stiffness over Gent and Lindley's, on 4n x n squares."""
    contact = ec.Contact("bottom", friction=1.0)
    scene = ec.Scene(
        ec.Elastic(E, nu), ec.Displacement("top", (0.0, -DOWN)), contacts=contact
    )
    domain = ec.rectangle((0.0, 0.0), (WIDTH, THICKNESS), cells=(4 * n, n))
    solution = ec.solve(scene, domain, degree=degree)
    error = ec.constitutive_error(ec.equilibrate(solution))
    stiffness = solution.force("bottom").force[1] / WIDTH * THICKNESS / DOWN
    return 2 * (4 * n * degree + 1) * (n * degree + 1), error, stiffness / APPARENT


RATIOS, SIZES = (0.3, 0.49, 0.4999), {1: (4, 8, 16, 32), 2: (2, 4, 8, 16)}
found = {(nu, k): [pad(nu, n, k) for n in SIZES[k]] for nu in RATIOS for k in (1, 2)}

# %%
# Error and stiffness against unknowns.

errors = {
    case: [error.relative for _, error, _ in rows] for case, rows in found.items()
}
stiffness = {case: [ratio for _, _, ratio in rows] for case, rows in found.items()}
last = found[0.4999, 2][-1][1]
draw_deformed(last, FOLDER / "deformed.png")
if last.domain.comm.rank == 0:
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.6), layout="constrained")
    for (nu, k), rows in found.items():
        look = {
            "color": f"C{RATIOS.index(nu)}",
            "marker": "os"[k - 1],
            "ls": ("--", "-")[k - 1],
            "ms": 4,
        }
        unknowns = [count for count, *_ in rows]
        left.loglog(unknowns, errors[nu, k], **look, label=rf"$\nu = {nu}$, degree {k}")
        if nu == 0.4999:
            right.loglog(unknowns, stiffness[nu, k], **look)
        numbers = ", ".join(
            f"{e:.1%} {s:.3f}"
            for e, s in zip(errors[nu, k], stiffness[nu, k], strict=True)
        )
        print(f"nu = {nu}, degree {k}: error and stiffness {numbers}")
    right.axhline(1.0, color="0.5", lw=1, ls=":")
    left.set(xlabel="unknowns", ylabel="relative error")
    right.set(xlabel="unknowns", ylabel="stiffness over Gent and Lindley's")
    figure.legend(
        *left.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=3,
        frameon=False,
    )
    figure.savefig(FOLDER / "locking.png", dpi=150)

# %%
# What must hold at nu = 0.4999: linear elements are many times too stiff, and their
# error says so, on all meshes; degree 2 is within 5% of the formula on its last mesh.
# At nu = 0.3 both degrees have the same stiffness, which is far below the formula: this
# pad loses volume.

assert min(errors[0.4999, 1]) > 0.95
assert stiffness[0.4999, 1][0] > 100 * stiffness[0.4999, 2][0]
assert stiffness[0.4999, 1][-1] > 2
assert abs(stiffness[0.4999, 2][-1] - 1) < 0.05
assert errors[0.4999, 2][-1] < errors[0.4999, 1][-1] / 4
assert abs(stiffness[0.3, 1][-1] / stiffness[0.3, 2][-1] - 1) < 0.01
assert stiffness[0.3, 2][-1] < 0.25
