"""A new contact method: the penalty method, whose foundation is a bed of springs.

Nitsche's contact traction is the projection P of sigma(u) n - gamma (u - g n) on what the law allows. Penalty leaves
out the stress,

    r(u) = P(-gamma (u - g n)),

so pressure needs penetration, at the solution, too. The error in the constitutive relation measures what this costs:
its admissible displacement does not penetrate.

A method is hashable, as a frozen dataclass is: the solver looks its forms up by it.
"""

from dataclasses import dataclass

import numpy as np
import ufl

import erc_contact as ec

from dolfinx import fem  # isort: skip - the wheel of DOLFINx must be loaded by erc_contact


@dataclass(frozen=True)
class Penalty:
    """The penalty method with the stiffness gamma E/h [force/volume] of its springs, gamma > 0 [-]."""

    gamma: float
    multiplier = False  # no unknowns beside the displacement
    in_layer = False  # the equations test displacements, not stresses

    def equations(self, model, contact, u, v, multiplier=None):
        """What the contact adds to the residual: minus the work of its traction."""
        ds = contact.ds(metadata={"quadrature_degree": model.contact_degree})
        return -ufl.inner(self.traction(model, contact, u), v) * ds

    def traction(self, model, contact, u, multiplier=None):
        """The contact traction on the body [force/area]."""
        gamma = model.stiffness_per_area(fem.Constant(model.mesh, self.gamma))  # a Constant: one form for all gammas
        w = contact.since(u)  # in a history friction acts on what has changed since the last step
        beyond = w if contact.gap is None else w - contact.gap * contact.normal
        return contact.project(-gamma * beyond)

    projected = traction


scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.1, -0.05)), contacts=ec.Contact("bottom", 0.3))
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
methods = ec.Nitsche(), Penalty(1.0), Penalty(1000.0)
solutions = [ec.solve(scene, block, method) for method in methods]
nitsche, soft, stiff = [ec.constitutive_error(ec.equilibrate(solution)).relative for solution in solutions]
assert soft > 1.5 * stiff
assert abs(stiff / nitsche - 1) < 0.05

history = ec.adapt(scene, block, accuracy=0.05, method=Penalty(1000.0))
assert history.reached
assert {step.method for step in history.steps} == {"Penalty"}
assert np.allclose(history.error.reactions()["balance"].force, 0.0, atol=1e-12)
