r"""
A published benchmark: the block of GRECO
=========================================

The French research group GRECO compared contact codes on one problem. It is now the
test case SSNV128 of code_aster, and its table of displacements is the first thing that
a contact code can be compared with.

A square of 40 mm (the right half is cut off by symmetry) lies on a rigid foundation
with friction :math:`\mu = 1`. A pressure of 50 MPa acts on its top, and 150 MPa pushes
its left side to the right. Nothing but the contact holds the square vertically. So the
vertical force of the foundation is known: :math:`50 \cdot 40 = 2000` N per mm of
thickness. The friction force is not: the support at the symmetry plane takes the rest
of :math:`150 \cdot 40 = 6000` N.

The push compresses the square along the foundation, so its points slide to the right;
friction holds them back, more and more towards the symmetry plane, where they stick. At
the left, where the push lifts the corner, the contact opens:

.. math::

    \text{open: } 0 \le x < 3.34, \quad \text{slip: } 3.34 < x < 29.85,
    \quad \text{stick: } x > 29.85.

These lengths, and a friction force of -1405.4 N, are of an independent solver,
extrapolated from meshes of up to 256 x 256 squares.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/greco")
X = np.array([0.0, 1.25, 5.0, 7.5, 11.25])  # mm from the left corner, on the contact
PUBLISHED = np.array(
    [2.86, 2.72, 2.28, 1.98, 1.50]
)  # displacement, mean of several codes, which differ by 5% [0.01 mm]
ASTER = np.array(
    [2.859850, 2.720764, 2.282686, 1.979165, 1.540640]
)  # code_aster, 32 x 10 quadratic squares
CONVERGED = np.array([2.8603, 2.7226, 2.2868, 1.9807, 1.5414])

# %%
# The geometry is a file for gmsh. ``SizeMap`` computes from the error of one mesh the
# sizes of the next: few meshes are made, each of them nearly optimal. Elements of
# degree 2 need the fewest.

ec.log_to_console()
square = ec.read_mesh(
    Path(__file__).resolve().parents[1] / "meshes" / "greco.geo", scripts=True
)
scene = ec.Scene(
    material=ec.Elastic(E=130e3, nu=0.2),
    supports=ec.Displacement("right", (0.0, None)),
    loads=[ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
    contacts=ec.Contact("bottom", friction=1.0),
    units="mm, N/mm, MPa",
)
history = ec.adapt(scene, square, accuracy=0.001, degree=2, strategy=ec.SizeMap())
history.save(FOLDER, pictures=True)

# %%
# The displacement along the foundation, at the points of the table. All ranks get the
# same numbers.

moved = 100 * history.at(np.column_stack([X, 0 * X])).displacement[:, 0]
along = np.linspace(0.0, 40.0, 201)
curve = 100 * history.at(np.column_stack([along, 0 * along])).displacement[:, 0]
(friction, pressure), contact = history.force("bottom").force, history.profile("bottom")
opened, slips, sticks = (
    contact["x"][contact["status"] == status] for status in (0, 1, 2)
)

# %%
# Table and picture.

if square.comm.rank == 0:
    print("    x [mm]  published  code_aster   converged        here   [0.01 mm]")
    for row in zip(X, PUBLISHED, ASTER, CONVERGED, moved, strict=True):
        print("{:10.2f}{:11.2f}{:12.4f}{:12.4f}{:12.4f}".format(*row))
    print(f"friction {friction:.1f} N, pressure {pressure:.4f} N")
    print(f"opens to {opened.max():.2f}, slips to {slips.max():.2f}")
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    axes.plot(
        along, curve, "k-", lw=1, label=f"here, certified {history.error.relative:.1%}"
    )
    axes.errorbar(
        X,
        PUBLISHED,
        0.05 * PUBLISHED,
        fmt="o",
        ms=4,
        capsize=3,
        label="published mean, spread 5%",
    )
    axes.plot(X, ASTER, "x", ms=7, label="code_aster")
    axes.set(xlabel="$x$ on the contact [mm]", ylabel="$u_x$ [0.01 mm]", ylim=(0, None))
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "displacement.png", dpi=150)

# %%
# What must hold: the published displacements within their spread, the converged ones
# much better, the forces, and the ends of the zones up to a facet.

assert history.reached
assert np.all(abs(moved / PUBLISHED - 1) < 0.05)
assert np.all(abs(moved / CONVERGED - 1) < 1e-3)
assert abs(pressure - 2000.0) < 1e-6
assert abs(friction / -1405.4 - 1) < 1e-3
assert abs(opened.max() - 3.34) < 1.0
assert abs(slips.max() - 29.85) < 0.5
assert sticks.min() > slips.max() - 1e-9
