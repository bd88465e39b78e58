r"""
Many solutions of one problem
=============================

With strong Coulomb friction a static problem can have many solutions, and a body can
stand still in many places. The triangle (0, 0), (1, 0), (0.4, 0.3) of :math:`E = 1.2`
and :math:`\nu = 0.2` stands on its lower side. Its left side is moved by :math:`(0.1 +
\tfrac{8}{15} y, -0.1 y)`, its right side is pulled by :math:`\sqrt 5/10` along x. With
:math:`\mu = 2` every displacement

.. math::

    u = \left(0.1 + \tfrac{8}{15} y + \alpha (x - \tfrac43 y),\; -0.1 y\right),
    \qquad -0.1 \le \alpha \le 0.4,

is a solution. The strain is uniform, so the tractions on the foot are, too: the
pressure is :math:`p = (0.4 - \alpha)/3` and the shear :math:`\tfrac23 (0.4 - \alpha)`.
This is twice the pressure for every :math:`\alpha`, and friction asks for no more where
all of the foot slips the same way. It does so while :math:`\alpha > -0.1`, where the
free corner stops, and it is pressed while :math:`\alpha < 0.4`.

The error in the constitutive relation vanishes for each of them. Which one a solver
returns depends on where it starts. ``Solution.singular`` says so: the tangent of the
contact problem has no inverse there. ``other_solutions`` looks for others. With
:math:`\mu = 1.9` there is one solution, :math:`\alpha = 0.4`; ``coulomb_certificate``
proves only below about 1.2 that there is no other one with this direction of slip.

Source: P. Hild, "Non-unique slipping in the Coulomb friction model in two-dimensional
linear elasticity", Q. J. Mech. Appl. Math. 57 (2004), has the construction.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/many_solutions")
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.3]])

# %%
# The triangle, from a file for gmsh. Three frictions: below, a little below, and at the
# critical one.

ec.log_to_console()
triangle = ec.read_mesh(
    Path(__file__).resolve().parents[1] / "meshes" / "triangle.geo", scripts=True
)
found = {}
for friction in (0.9, 1.9, 2.0):
    scene = ec.Scene(
        material=ec.Elastic(E=1.2, nu=0.2),
        supports=[
            ec.Displacement(
                "held", (lambda x: 0.1 + 8 / 15 * x[1], lambda x: -0.1 * x[1])
            )
        ],
        loads=[ec.Traction("pulled", (5**0.5 / 10, 0.0))],
        contacts=[ec.Contact("foot", friction=friction)],
    )
    solution = ec.solve(scene, triangle)
    error = ec.constitutive_error(ec.equilibrate(solution))
    certificate, others = ec.coulomb_certificate(error), ec.other_solutions(solution)
    found[friction] = np.array(
        [one.at(CORNERS).displacement for one in (error, *others)]
    )
    if triangle.comm.rank == 0:
        verdict = "one of many" if solution.singular else "the only one near"
        errors = ", ".join(f"{other.relative:.1e}" for other in others) or "none"
        print(f"friction {friction}: eps = {error.relative:.1e}, {verdict}")
        print(f"  {certificate}\n  eps of others found: {errors}")
    assert solution.singular == (friction == 2.0)
    assert certificate.unique == (friction == 0.9)
    assert (len(others) >= 2) == (friction == 2.0)
    assert all(one.relative < 1e-5 for one in [error, *others])

# %%
# The slip of the free corner is :math:`0.1 + \alpha`: it tells which member of the
# family was found.

alpha = {friction: np.sort(moved[:, 1, 0] - 0.1) for friction, moved in found.items()}
if triangle.comm.rank == 0:
    print({friction: values.round(4).tolist() for friction, values in alpha.items()})
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(
        1, 3, figsize=(10.5, 2.9), sharex=True, sharey=True, layout="constrained"
    )
    for axis, (friction, moved) in zip(axes, found.items(), strict=True):
        axis.fill(*CORNERS.T, color="0.9")
        for u in moved:
            axis.plot(*np.vstack([CORNERS + u, (CORNERS + u)[:1]]).T, lw=1.2)
        axis.axhline(0.0, color="k", lw=1)
        axis.set(title=rf"$\mu = {friction}$", xlabel="$x$", aspect="equal")
    axes[0].set_ylabel("$y$")
    figure.savefig(FOLDER / "solutions.png", dpi=150)

# %%
# What must hold: below the critical friction one solution, and with 1.9 the one known;
# at 2.0 several, all of them members of the family.

assert len(alpha[1.9]) == 1
assert abs(alpha[1.9][0] - 0.4) < 1e-4
assert np.all((alpha[2.0] > -0.1 - 1e-4) & (alpha[2.0] < 0.4 + 1e-4))
assert np.ptp(alpha[2.0]) > 0.1
x, y = CORNERS.T
family = [
    np.column_stack([0.1 + 8 / 15 * y + a * (x - 4 / 3 * y), -0.1 * y])
    for a in found[2.0][:, 1, 0] - 0.1
]
assert np.allclose(found[2.0], family, atol=1e-6)
