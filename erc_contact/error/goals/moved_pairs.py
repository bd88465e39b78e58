"""Make admissible pairs of scenes that are moved a little, on the mesh of a pair."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from erc_contact.admissible.equilibrate import equilibrated
from erc_contact.admissible.pair import Admissible
from erc_contact.base.logs import muted
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.trials import PairOf
from erc_contact.newton.solve import Nearby
from erc_contact.scene.scene import Scene


@contextmanager
def moved_pairs(error: ConstitutiveError, solver: str, tighten: int) -> Iterator[PairOf]:
    """Return what makes the pairs of moved scenes inside the `with`; collective.

    All share one factor or hierarchy, and start from the pair. What their solves log is
    for debugging alone: the moved scenes are not the user's.

    Args:
        error: The error of the pair.
        solver: As in :func:`erc_contact.newton.solve.solve`.
        tighten: Greatest number of iterations that tighten a stress.
    """
    nearby = Nearby(error.solution, solver)

    def pair_of(scene: Scene) -> Admissible:
        return equilibrated(nearby.solve(scene), tighten, error.admissible)

    with error.solution.stiffness.in_memory(), muted("interval, moved scene"):
        yield pair_of
