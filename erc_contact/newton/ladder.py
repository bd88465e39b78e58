"""The ladder of attempts of a contact solve, cheapest first: where Newton's method starts, and for which method.

A start is a displacement of the contact nodes. "glued" is the solution with the contact
glued, "warm" a solution on another mesh, "nodal" a solution of the augmented
Lagrangian, and "stiffer" one of the same method with a larger gamma.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace

from erc_contact.newton.methods import AugmentedLagrangian, Method, Nitsche

FRICTION_STEPS = ((0.5, 1.0), (0.9, 1.0), tuple(0.05 * k for k in range(21)))
"""Shares of the friction bound when friction is raised in steps."""
LINE_SEARCHES = ("l2", "cp", "bt", "nleqerr")
"""Line searches that are tried where bisection fails, each of which may avoid a cycle of the others."""
NODAL = AugmentedLagrangian(gamma=1.0)
"""The method whose solution is the start of the others."""
OTHERS = tuple(AugmentedLagrangian(gamma) for gamma in (0.1, 10.0, 1000.0))
"""The same method with other parameters, which do not change its solution; tried where Newton's method fails."""
STIFFER = (100.0, 30.0, 10.0, 5.0, 3.0, 2.0, 1.4)
"""Factors of Nitsche's gamma for a sequence of problems that starts from the augmented
Lagrangian, the limit of a large gamma. The solutions of two near gammas are near each
other.
"""


@dataclass(frozen=True)
class Attempt:
    """One attempt of a contact solve.

    Attributes:
        method: The contact method.
        start: Name of the start.
        line_search: Name of PETSc's line search.
        friction_shares: Shares of the friction bound that are solved for one after the
            other [-].
        final: Whether its solution is that of the scene; otherwise it is the start of
            another attempt.
    """

    method: Method
    start: str
    line_search: str = "bisection"
    friction_shares: tuple[float, ...] = (1.0,)
    final: bool = True

    @property
    def gives(self) -> str:
        """Name of the start that its solution is for other attempts."""
        return "nodal" if self.method.multiplier else "stiffer"

    def __str__(self) -> str:
        steps = (
            f", friction in {len(self.friction_shares)} steps"
            if len(self.friction_shares) > 1
            else ""
        )
        return f"{self.start} start, {self.method}, {self.line_search}{steps}"


def attempts(
    method: Method, known: Container[str], *, friction: bool, fallback: bool, nodal_first: bool
) -> Iterator[Attempt]:
    """The attempts, cheapest first. The caller skips those whose start is not known.

    Without a gap the problem is positively homogeneous, so steps of the load would all
    be the same problem. Friction is raised in steps instead.

    Args:
        method: The method whose solution is wanted.
        known: Names of the starts that are known; the caller adds to them between two
            attempts.
        friction: Whether the scene has friction.
        fallback: Whether a solution of the augmented Lagrangian is accepted instead.
        nodal_first: Whether another method starts from the solution of the augmented
            Lagrangian where no solution on another mesh is known. This takes less steps
                at the end, and more in all: it pays where steps cost little.
    """
    nodal = method if method.multiplier else NODAL
    itself = nodal == method
    first = "warm" if "warm" in known else "glued"
    if not itself and (first == "warm" or not nodal_first):
        yield Attempt(method, first)
    yield Attempt(nodal, first, final=itself)
    if not itself:
        yield Attempt(method, "nodal")
    if not itself or first == "warm":
        yield Attempt(method, "glued")
    for other in (NODAL, *OTHERS):
        if "nodal" not in known and other != method:
            yield Attempt(other, "glued", final=False)
            yield Attempt(method, "nodal")
    if isinstance(method, Nitsche):
        start = "nodal"
        for factor in STIFFER:
            yield Attempt(replace(method, gamma=factor * method.gamma), start, final=False)
            start = "stiffer"
        yield Attempt(method, "stiffer")
    if fallback and not itself:
        yield Attempt(nodal, "nodal")
    for own in (method, nodal) if fallback and not itself else (method,):
        for shares in FRICTION_STEPS if friction else ():
            yield Attempt(own, "glued", friction_shares=shares)
        for line_search in LINE_SEARCHES:
            yield Attempt(own, "glued", line_search)
