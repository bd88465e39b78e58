r"""
A contact method of your own: penalty in 12 lines
=================================================

A contact method says how the unknown contact traction enters the equations. Nitsche's
traction is the projection :math:`P` of :math:`\sigma(u) n - \gamma (u - g n)` on what
the law allows: no pull, and friction below its bound. The penalty method leaves out the
stress,

.. math:: r(u) = P\left(-\gamma (u - g n)\right).

So its foundation is a bed of springs of stiffness :math:`\gamma`: pressure needs
penetration, at the solution, too. Soft springs are wrong, stiff ones make the equations
hard to solve, and how stiff is stiff enough depends on the mesh.

Which number does the error see? It measures a pair that does not penetrate, so what the
springs give is part of it: with soft springs :math:`e` is large, with stiff springs it
is :math:`e` of Nitsche's method on the same mesh. The error needs nothing else of a
method than the traction that it ends with.
"""

from dataclasses import dataclass

from mpi4py import MPI  # noqa: F401 - before DOLFINx

# isort: split
import numpy as np
import ufl
from dolfinx import fem

import erc_contact as ec

# %%
# A method is hashable, as a frozen dataclass is: the solver looks its forms up by it.
# gamma E/h is the stiffness of the springs [force/volume]; as a Constant it is compiled
# once for all values. ``jump(u)`` is u, but in a loading history friction acts on what
# has changed since the last step; ``jump(v)`` is its variation, on which r does work.


@dataclass(frozen=True)
class Penalty:
    """The penalty method with springs of gamma E/h, gamma > 0 [-]."""

    gamma: float
    # No unknowns beside the displacement; the equations test displacements.
    multiplier = in_layer = False

    def equations(self, model, contact, u, v, multiplier=None):
        """What the contact adds to the residual: minus the work of its traction."""
        ds = contact.ds(metadata={"quadrature_degree": model.space.contact_degree})
        return -ufl.inner(self.traction(model, contact, u), contact.jump(v)) * ds

    def traction(self, model, contact, u, multiplier=None):
        """The contact traction on the body [force/area]."""
        gap = 0.0 if contact.gap is None else contact.gap
        gamma = model.stiffness_per_area(fem.Constant(model.space.mesh, self.gamma))
        return contact.project(-gamma * (contact.jump(u) - gap * contact.normal))

    projected = traction


# %%
# The method in place of the default one, soft and stiff, on one mesh; then adaptively.

scene = ec.Scene(
    ec.Elastic(1.0, 0.3),
    ec.Displacement("top", (0.1, -0.05)),
    contacts=ec.Contact("bottom", friction=0.3),
)
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
solutions = [
    ec.solve(scene, block, method)
    for method in (ec.Nitsche(), Penalty(1.0), Penalty(1000.0))
]
nitsche, soft, stiff = (
    ec.constitutive_error(ec.equilibrate(solution)).relative for solution in solutions
)
history = ec.adapt(scene, block, accuracy=0.05, method=Penalty(1000.0))
history.save("results/method", pictures=True)

# %%
# What must hold: the soft method penetrates and its error says so; the stiff one is as
# good as Nitsche's; the run is all of this method, and its forces balance.

depths = [-solution.profile("bottom")["gap"].min() for solution in solutions]
assert depths[1] > 100 * depths[2] > 0
assert soft > 1.5 * stiff
assert abs(stiff / nitsche - 1) < 0.05
assert history.reached
assert {step.method for step in history.steps} == {"Penalty"}
assert np.allclose(history.reactions()["balance"].force, 0.0, atol=1e-12)
