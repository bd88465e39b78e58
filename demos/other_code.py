r"""
How wrong is what another code has computed?
============================================

``ec.certify`` takes a displacement from anywhere and says how wrong it is, by the same
bound as for a solution of the package. Nothing is asked of the other code but its
displacement: u is corrected where it violates supports or gaps, its reactions give a
contact traction that the friction law allows, and a stress in equilibrium with it
completes the pair.

Here CalculiX has pressed and sheared a block on a foundation with friction 0.3. It has
contact by a *penalty*: pressure is stiffness times penetration. How stiff is stiff
enough? Too soft, the block sinks in; too stiff, Newton's method has a hard time. The
results of three stiffnesses, 10, 100 and 1000 times :math:`E` over the unit of length,
were written by ``benchmarks/calculix.py``. A quadratic triangle is the element in both
codes, so its own solution on the same mesh says what the best stiffness would give.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/other_code")
FOLDER.mkdir(parents=True, exist_ok=True)
FILES = Path(__file__).resolve().parents[1] / "meshes" / "calculix"
STIFFNESSES = [10, 100, 1000]

# %%
# The mesh, and the problem that the other code was to solve.

block = ec.read_mesh(FILES / "block.msh")
scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("top", (0.02, -0.05))],
    contacts=[ec.Contact("bottom", friction=0.3)],
)

# %%
# Points and values are enough; their order does not matter.

certificates = []
for stiffness in STIFFNESSES:
    result = meshio.read(FILES / f"block_{stiffness}.vtu")
    u = result.points[:, :2], result.point_data["displacement"]
    certificates.append(ec.certify(scene, block, u))

own = ec.solve(scene, block, degree=2)
best = ec.constitutive_error(ec.equilibrate(own))
force = best.force("bottom").force[1]
forces = [c.error.force("bottom").force[1] for c in certificates]

# %%
# The error of the soft penalty comes mostly from the displacement: where it is lifted
# out of the foundation it is not in equilibrium with its contact forces. The error of
# the stiff penalty is mostly what the mesh costs, for any code.

ec.output.draw_deformed(certificates[-1].error, FOLDER / "deformed.png")
if block.comm.rank == 0:
    for stiffness, certificate, value in zip(
        STIFFNESSES, certificates, forces, strict=True
    ):
        print(f"stiffness {stiffness}, force {value:.5f}\n{certificate}\n")
    print(f"own solution, force {force:.5f}: eps = {best.relative:.2%}")
    parts = {
        "mesh": [c.mesh for c in certificates],
        "displacement": [c.displacement for c in certificates],
        "contact": [c.contact for c in certificates],
    }
    scales = np.array([c.error.scale for c in certificates])
    figure, axes = plt.subplots(figsize=(4.8, 3.6), layout="constrained")
    eps = [100 * c.error.relative for c in certificates]
    axes.loglog(STIFFNESSES, eps, "ko-", label="all")
    for number, (name, values) in enumerate(parts.items()):
        shares = 100 * np.array(values) / scales
        axes.loglog(STIFFNESSES, shares, f"C{number}o--", lw=1, ms=4, label=name)
    axes.axhline(100 * best.relative, color="0.6", lw=1, label="own solution", zorder=0)
    axes.set(xlabel="stiffness of the penalty over $E$", ylabel="error [%]")
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "error.png", dpi=150)

# %%
# What must hold: stiffer is better; the softest is told to be wrong by its
# displacement, the stiffest is within 5% of the error of the own solution; the force of
# each differs from the force of the own solution by less than the sum of both errors
# says.

relative = [c.error.relative for c in certificates]
assert relative[0] > relative[1] > relative[2] > best.relative
assert certificates[0].cause == "the displacement"
assert certificates[2].cause == "the mesh"
assert relative[2] < 1.05 * best.relative
differences = abs(np.array(forces) / force - 1)
assert np.all(differences < 2 * (np.array(relative) + best.relative))
