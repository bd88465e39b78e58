"""A friction law of one's own: friction that saturates.

Coulomb's friction mu p grows with the pressure p without end; real surfaces shear off at a limit. The law here has the
bound

    b(p) = tau tanh(mu p / tau):

Coulomb's for small pressures, tau for large ones. A law is a small class: the names of its parameters (numbers or
callables of x, so that none of them is compiled into a form) and its bound, in UFL. The bound is concave, so the
tractions that it allows are a convex set, and the error is certified as for Coulomb's law.
"""

import ufl  # isort: skip

import erc_contact as ec


class Saturating:
    """Friction bound tau tanh(mu p / tau)."""

    parameters = ("mu", "tau")

    def __init__(self, mu, tau):
        self.mu, self.tau = mu, tau

    def friction_bound(self, pressure, mu, tau):
        """The most that the shear may be [force/area]."""
        return tau * ufl.tanh(mu * pressure / tau)


def solve(friction):
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.05))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return ec.adapt(scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14)), accuracy=0.05)


ec.log_to_console()
for name, friction in {"Coulomb": 0.3, "saturating": Saturating(0.3, 0.001), "Tresca": ec.Tresca(0.001)}.items():
    history = solve(friction)
    if name == "saturating":
        history.save("results/friction_law")
    contact, force = history.error.profile("bottom"), history.error.force("bottom").force
    most, slips = abs(contact["shear"]).max(), int((contact["status"] == 1).sum()) // 2  # two points on each facet
    if history.error.domain.mesh.comm.rank == 0:
        print(f"{name}: friction force {force[0]:.3e}, largest shear {most:.2e}, {slips} facets slip")

    assert history.reached
    assert history.best.relative <= 0.05
    if name != "Coulomb":
        assert most <= 0.001 * (1 + 1e-12)
        assert slips > 0
