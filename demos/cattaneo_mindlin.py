r"""
Cattaneo and Mindlin: friction remembers
========================================

A body is pressed on a rigid cylinder of radius :math:`R` by the force :math:`P`, then
sheared forward, back, and forward again. The body is an incompressible half-plane; so
pressing and shearing do not disturb each other. Hertz: the contact has the half-width
:math:`a = \sqrt{4 P R/\pi E^*}` and the pressure :math:`p_0 \sqrt{1 - x^2/a^2}`,
:math:`p_0
= 2 P/\pi a`, :math:`E^* = E/(1 - \nu^2)`.

A shear force :math:`Q < \mu P` comes. If all points stuck, the shear would be infinite
at the edges. So slip begins there and goes inwards; in the middle :math:`|x| < c` the
contact sticks:

.. math::

    c = a \sqrt{1 - \frac{Q}{\mu P}}, \qquad
    q = \mu p_0 \left( \sqrt{1 - x^2/a^2} - \frac{c}{a} \sqrt{1 - x^2/c^2} \right).

When :math:`Q` goes back from :math:`Q_1`, everything sticks at first. Then slip in the
other direction begins at the edges again, with :math:`c' = a \sqrt{1 - (Q_1 - Q)/2 \mu
P}`: the shear is the shear of :math:`Q_1` less twice the same formula with :math:`c'`.
So the shear at a force depends on the way to it. At :math:`Q = 0` on the way back there
is shear in the contact and no shear force. At :math:`-Q_1` all is reversed, at
:math:`Q_1` again the loop is closed. In a cycle friction takes

.. math::

    \frac{8 \mu^2}{R} \int_c^a p(x) I(x)\, dx, \qquad
    I = \tfrac12 \left( x \sqrt{x^2 - c^2} - c^2 \operatorname{arccosh}(x/c) \right).

Sources: C. Cattaneo (1938); R. D. Mindlin (1949); K. L. Johnson, "Contact Mechanics",
section 7.2.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

from dolfinx.mesh import compute_midpoints  # isort: skip - MPI first

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/cattaneo_mindlin")
E, NU, MU, R = 1.0, 0.4999, 0.3, 10.0

# %%
# Pressing comes without friction, as in the closed form; contacts may change their law
# between two steps. The body is a square of 40 half-widths, refined towards the
# contact. Degree 2 is needed near incompressibility.


def scene_at(t):
    """Pressed at t = 0; sheared until 1, back until 3, forward until 5."""
    push = 0.032 * np.interp(t, [0.0, 1.0, 3.0, 5.0], [0.0, 1.0, -1.0, 1.0])
    contact = ec.Contact(
        "bottom", friction=MU if t > 0 else 0.0, gap=lambda x: x[0] ** 2 / (2 * R)
    )
    return ec.Scene(
        ec.Elastic(E, NU), ec.Displacement("top", (push, -0.05)), contacts=contact
    )


def finer_at_the_contact(domain, size):
    """The mesh refined towards the contact, until its cells there have this size."""
    now = 2.0
    while now > size:
        cells = np.arange(domain.owned_cells, dtype=np.int32)
        x = compute_midpoints(domain.mesh, domain.dim, cells)
        near = (abs(x[:, 0]) < max(0.55, 3 * now)) & (x[:, 1] < 3 * now)
        domain, now = domain.refined(np.flatnonzero(near).astype(np.int32)), now / 2
    return domain


# %%
# The closed form, for each part of the way.


def ellipse(x, half):
    return np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0)) if half > 0 else 0.0 * x


def closed_form(x, P, Q, Q1, a, t):
    """Shear over mu p0, and half-width of the stick zone."""

    def loaded(force):
        c = a * np.sqrt(max(1 - force / (MU * P), 0.0))
        return ellipse(x, a) - c / a * ellipse(x, c), c

    if t <= 1:
        return loaded(Q)
    back, c = loaded((Q1 - Q) / 2 if t <= 3 else (Q1 + Q) / 2)
    return (loaded(Q1)[0] - 2 * back, c) if t <= 3 else (2 * back - loaded(Q1)[0], c)


# %%
# Where does the stick zone end in a solution by finite elements? The status of facets
# tells it up to their length only. Beside the zone the slip grows like the power 3/2 of
# the distance, so its power 2/3 is a straight line there, and the zone ends where this
# line is zero.


def stick_half_width(x, profile, a):
    """Half the length of the stick zone, from the slip on both sides of it."""
    ends = []
    for y in (x, -x):
        outermost = y[profile["status"] == 2].max()
        near = (y > outermost + 0.03 * a) & (y < outermost + 0.1 * a)
        slope, at_zero = np.polyfit(y[near], abs(profile["slip"][near]) ** (2 / 3), 1)
        ends.append(-at_zero / slope)
    return sum(ends) / 2


# %%
# One row a step: mesh, error, energies.

ec.log_to_console()
body = finer_at_the_contact(
    ec.rectangle((-10.0, 0.0), (10.0, 20.0), cells=(10, 10)), 0.02
)
evolution = ec.evolve(
    scene_at, body, [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0], accuracy=0.02, degree=2
)
root = evolution.error.domain.comm.rank == 0
ec.output.draw_deformed(evolution.error, FOLDER / "deformed.png")

# %%
# Each step against the closed form for its forces. The bending of the square moves the
# contact a little, so x counts from the centre of pressure.

assert evolution.reached
Q1 = -evolution.force("bottom")[2, 0]
if root:
    figure, axes = plt.subplots(
        2, 4, figsize=(12.0, 5.2), sharex=True, sharey=True, layout="constrained"
    )
for number, (step, profile) in enumerate(
    zip(evolution.steps[1:], evolution.profile("bottom")[1:], strict=True)
):
    (Q, P), centre = (
        (-step.force["bottom"][0], step.force["bottom"][1]),
        step.moment["bottom"][0],
    )
    a = np.sqrt(4 * P * R * (1 - NU**2) / (np.pi * E))
    p0 = 2 * P / (np.pi * a)
    x = profile["x"] - centre / P
    shear, c = closed_form(x, P, Q, Q1, a, step.time)
    pressed, width = profile["pressure"] > 1e-6 * p0, stick_half_width(x, profile, a)
    apart = abs(-profile["shear"] / (MU * p0) - shear)[pressed].mean()
    if root:
        found = f"stick {width:.4f} for {c:.4f}, shear within {apart:.4f}"
        axis, near = axes.flat[number], abs(x) < 1.3 * a
        axis.plot(
            x[near] / a,
            (-profile["shear"] / (MU * p0))[near],
            "C0",
            lw=1.5,
            label="here",
        )
        axis.plot(x[near] / a, shear[near], "k--", lw=1, label="closed form")
        axis.set(title=rf"$t = {step.time:g}$, $Q/\mu P = {Q / (MU * P):.2f}$")
        print(f"t = {step.time:g}: Q/(mu P) = {Q / (MU * P):7.4f}, {found}")
    assert abs(width / c - 1) < 0.01
    assert apart < 0.02
    assert abs(profile["pressure"].max() / p0 - 1) < 0.01

if root:
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.supxlabel("$x/a$")
    figure.supylabel(r"shear $q/\mu p_0$")
    axes.flat[-1].axis("off")
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / "shear.png", dpi=150)

# %%
# The loop closes, it is symmetric, and it has the energy of the closed form.

taken = np.diff(evolution.column("dissipated"))
assert np.all(taken >= 0)
forces = -evolution.force("bottom")[:, 0] / (MU * P)
assert abs(forces[-1] - forces[2]) < 0.01 * forces[2]  # the loop closes
assert abs(forces[-1] + forces[5]) < 0.01 * forces[2]

c = a * np.sqrt(1 - Q1 / (MU * P))
x = np.linspace(c, a, 2001)
slip = (x * np.sqrt(x**2 - c**2) - c**2 * np.arccosh(x / c)) / 2
of_cycle = (
    8
    * MU**2
    / R
    * np.sum((p0 * ellipse(x, a) * slip)[:-1] + (p0 * ellipse(x, a) * slip)[1:])
    / 2
    * (x[1] - x[0])
)
if root:
    print(f"dissipated in the cycle: {taken[2:].sum():.4e} for {of_cycle:.4e}")
assert abs(taken[2:].sum() / of_cycle - 1) < 0.03
