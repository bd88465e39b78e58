r"""
A wall that carries little tension
==================================

A wall of masonry with an opening stands on rock, with Coulomb friction of 0.6 below it.
It carries its weight and a floor on its top. Joints of mortar bear pressure and hardly
any tension. Lengths are in m, stresses in MPa, forces in MN/m; half of the wall is
computed.

The law is one of the user's own, an energy density and its conjugate. With the
principal strains :math:`\varepsilon_i`, and a share s of the stiffness in tension,

.. math::

    \psi &= \tfrac E2 \sum_i
    \varepsilon_i^2 - (1 - s) \langle \varepsilon_i \rangle_+^2 ,

    \psi^* &= \tfrac1{2E} \sum_i
    \sigma_i^2 + (\tfrac1s - 1) \langle \sigma_i \rangle_+^2 .

Poisson's ratio is zero, so the directions do not couple, and each is the conjugate of
the other. The share must be > 0: with none the wall would be stiff in no direction
where it cracks.

In elasticity the part above the opening is a beam: it is pulled at its underside. With
2% in tension it cannot be one. The pressure flows around the opening in an arch, and
an arch pushes its feet apart. Friction holds them.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import ufl

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/masonry")
WIDTH, HEIGHT = 3.0, 4.0
SPAN, DOOR = 1.2, 2.2
E, SHARE, MU = 3000.0, 0.02, 0.6
FLOOR, WEIGHT = 0.2, 0.02
CORNERS = [(SPAN, 0), (WIDTH, 0), (WIDTH, HEIGHT), (0, HEIGHT), (0, DOOR), (SPAN, DOOR)]
OUTLINE = np.array([*CORNERS, CORNERS[0]])
STROKES = {"headlength": 0, "headaxislength": 0, "headwidth": 0, "width": 0.006}

# %%
# The sum of squares of what is positive of the principal values is a function of the
# tensor itself. In the plane two of them are :math:`m \pm d`. The square root is taken
# only where they have different signs, and d is not zero then.


def tension(tensor):
    """Sum of the squares of the positive principal values of a tensor of the plane."""
    m = (tensor[0, 0] + tensor[1, 1]) / 2
    d2 = (tensor[0, 0] - tensor[1, 1]) ** 2 / 4 + tensor[0, 1] ** 2
    mixed = d2 > m**2
    d = ufl.sqrt(ufl.conditional(mixed, d2, 1))
    alike = ufl.conditional(m > 0, 2 * (m**2 + d2), 0)
    in_plane = ufl.conditional(mixed, (m + d) ** 2, alike)
    return in_plane + ufl.conditional(tensor[2, 2] > 0, tensor[2, 2] ** 2, 0)


class Masonry:
    """A material with a share of its stiffness in tension."""

    parameters = ("E", "share")

    def __init__(self, E, share):
        self.E, self.share = E, share

    def check(self, name, low, high):
        """Refuse what is no stiffness."""
        if low <= 0:
            raise ec.InputError(f"{name} must be > 0.")

    def potential(self, strain, E, share):
        """Energy density [force/area]."""
        return E / 2 * (ufl.inner(strain, strain) - (1 - share) * tension(strain))

    def conjugate(self, stress, E, share):
        """Its conjugate [force/area]."""
        of_tension = (1 / share - 1) * tension(stress)
        return (ufl.inner(stress, stress) + of_tension) / (2 * E)

    def modulus(self, E, share):
        """Young's modulus in compression."""
        return E


# %%
# The wall, and its scene. Its feet are held by nothing but contact and friction.


def wall():
    """Half of the wall: the middle of the opening is at x = 0."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    occ = gmsh.model.occ
    body = [(2, occ.addRectangle(0, 0, 0, WIDTH, HEIGHT))]
    occ.cut(body, [(2, occ.addRectangle(0, 0, 0, SPAN, DOOR))])
    occ.synchronize()
    parts = {
        "middle": ec.where(x=0.0),
        "foot": ec.where(y=0.0),
        "top": ec.where(y=HEIGHT),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


def loaded(material):
    """The wall under its floor, to a certified 4%."""
    scene = ec.Scene(
        material,
        ec.Symmetry("middle"),
        loads=[ec.Traction("top", (0.0, -FLOOR)), ec.BodyForce((0.0, -WEIGHT))],
        contacts=ec.Contact("foot", friction=MU),
        units="m, MN/m, MPa",
    )
    return ec.adapt(scene, domain, accuracy=0.04, degree=2, strategy=ec.Mark())


ec.log_to_console()
domain = wall()
runs = {
    "elastic": loaded(ec.Elastic(E, 0.0)),
    "alike": loaded(Masonry(E, 1.0)),
    "masonry": loaded(Masonry(E, SHARE)),
}
history = runs["masonry"]
history.save(FOLDER, pictures=True)

# %%
# The stress along the section above the opening, and the thrust of the feet. Strokes
# along the greatest compression show how the load flows around the opening.

y = np.linspace(DOOR, HEIGHT, 181)
section = np.column_stack([np.zeros_like(y), y])
grid = np.stack(np.meshgrid(np.arange(0.1, 3, 0.2), np.arange(0.1, 4, 0.2)), axis=-1)
grid = grid[(grid > (SPAN, DOOR)).any(axis=-1)]
stress = {name: run.at(grid).stress for name, run in runs.items()}
along = {name: run.at(section).stress[:, 0, 0] for name, run in runs.items()}
feet = {name: run.force("foot").force for name, run in runs.items()}
energy = {name: ec.potential_energy(run) for name, run in runs.items()}
if domain.comm.rank == 0:
    for name, force in feet.items():
        print(f"{name}: thrust {-force[0]:.4f}, load {force[1]:.4f} MN/m,", end=" ")
        print(f"tension up to {along[name].max():.3f} MPa; energy {energy[name]}")
    figure, axes = plt.subplots(1, 3, figsize=(10.4, 4.2), layout="constrained")
    for axis, name in zip(axes, ("elastic", "masonry"), strict=False):
        values, vectors = np.linalg.eigh(stress[name])
        strokes = -values[:, 0, None] * vectors[:, :, 0]  # of the greatest compression
        axis.quiver(*grid.T, *strokes.T, pivot="mid", scale=8.0, **STROKES)
        axis.plot(*OUTLINE.T, "k", lw=0.8)
        axis.set(xlabel="$x$ [m]", ylabel="$y$ [m]", title=name, aspect="equal")
        axes[2].plot(along[name], y, label=name)
    axes[2].axvline(0.0, color="k", lw=0.8)
    axes[2].set(xlabel=r"$\sigma_{xx}$ above the opening [MPa]", ylabel="$y$ [m]")
    axes[2].legend(frameon=False)
    figure.savefig(FOLDER / "arch.png", dpi=150)

# %%
# What must hold: with a share of one the law is linear elasticity through another door;
# the wall carries its loads; its tension above the opening is a tenth at most of the
# tension in elasticity, its thrust is greater by a third, and within what friction
# holds; and it is softer, so its potential energy is lower.

load = FLOOR * WIDTH + WEIGHT * (WIDTH * HEIGHT - SPAN * DOOR)
thrust = {name: -force[0] for name, force in feet.items()}
assert all(run.reached for run in runs.values())
assert abs(runs["alike"].error.relative / runs["elastic"].error.relative - 1) < 1e-6
assert np.allclose(feet["alike"], feet["elastic"], rtol=1e-8)
assert all(abs(force[1] / load - 1) < 1e-8 for force in feet.values())
assert along["masonry"].max() < 0.1 * along["elastic"].max()
assert 1.33 * thrust["elastic"] < thrust["masonry"] < MU * load
assert energy["masonry"].high < energy["elastic"].low
