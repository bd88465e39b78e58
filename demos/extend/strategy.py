r"""
A strategy of your own
======================

A strategy decides which mesh is next. Doerfler's, the default, marks elements that
together carry a share of the squared error. The oldest one is the maximum strategy of
Babuska and Rheinboldt: refine the elements whose error is at least a share of the
largest one,

.. math:: \text{refine } E \quad \text{if} \quad \eta_E \ge \theta \max_{E'} \eta_{E'}.

It looks at the peak of the error. Where one corner is far worse than the rest, it
refines there only, in many meshes; where errors are alike, it refines nearly all. For
:math:`\theta = 0` it is uniform refinement.

A strategy is a class with one method, ``next``, which gets the error and returns the
next domain. Under MPI each rank has the errors of its own elements. So the largest is
asked of all ranks, and all ranks call ``refined`` together.
"""

from dataclasses import dataclass

import erc_contact as ec
from erc_contact.output import plot_history

TIE = 1e-6  # errors that differ by less are equal: round-off must not choose


@dataclass(frozen=True)
class Maximum:
    """Refine the elements whose error is at least `share` of the largest one."""

    share: float = 0.5

    def next(self, error, accuracy, max_cells):
        """The next domain."""
        largest = max(
            error.domain.comm.allgather(error.total_indicators.max(initial=0.0))
        )
        marked = error.total_indicators >= self.share * largest * (1 - TIE)
        return error.domain.refined(marked.nonzero()[0])


# %%
# A block whose error sits at the corners of its clamped top and at the ends of its
# contact.

scene = ec.Scene(
    ec.Elastic(1.0, 0.3),
    ec.Displacement("top", (0.1, -0.05)),
    contacts=ec.Contact("bottom", friction=0.3),
)
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
strategies = {
    "uniform": ec.Uniform(),
    "all": Maximum(0.0),
    "maximum": Maximum(0.5),
    "Doerfler": ec.Mark(),
}
histories = {
    name: ec.adapt(scene, block, accuracy=0.05, strategy=way)
    for name, way in strategies.items()
}
plot_history(histories, "results/strategy/error.png")

# %%
# What must hold: a share of 0 is uniform refinement, and a share of one half needs less
# than half of the elements.

cells = {
    name: [step.cells for step in history.steps] for name, history in histories.items()
}
assert all(history.reached for history in histories.values())
assert cells["all"] == cells["uniform"]
assert cells["maximum"][-1] < cells["uniform"][-1] / 2
