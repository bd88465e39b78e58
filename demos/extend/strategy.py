"""A new strategy: the maximum strategy of Babuska and Rheinboldt.

It refines the elements whose error is at least a share of the largest. Each rank has the errors of its own elements.
So the largest is asked of all ranks, and all ranks call `refined` together.
"""

from dataclasses import dataclass

import erc_contact as ec

TIE = 1e-6  # errors that differ by less are equal: round-off must not choose


@dataclass(frozen=True)
class Maximum:
    """Refine the elements whose error is at least `share` of the largest one; all of them for 0."""

    share: float = 0.5

    def next(self, error, accuracy, max_cells):
        """The next domain."""
        largest = max(error.domain.mesh.comm.allgather(error.total_indicators.max(initial=0.0)))
        marked = error.total_indicators >= self.share * largest * (1 - TIE)
        return error.domain.refined(marked.nonzero()[0])


scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.1, -0.05)), contacts=ec.Contact("bottom", 0.3))
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))


def cells(strategy):
    """The numbers of elements of the meshes of a run."""
    history = ec.adapt(scene, block, accuracy=0.05, strategy=strategy)
    assert history.reached
    return [step.cells for step in history.steps]


all_cells, largest = cells(Maximum(0.0)), cells(Maximum(0.5))
assert all_cells == cells(ec.Uniform())
assert largest[-1] < all_cells[-1] / 2
