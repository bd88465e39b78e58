"""The ladder of attempts of a contact solve, cheapest first: where Newton starts, and with which method.

A start is the displacement of the contact nodes: "glued" glues the contact, "warm" is a solution on another mesh,
"nodal" one of the augmented Lagrangian, "stiffer" one of the same method with a larger gamma.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace

from erc_contact.newton.methods import AugmentedLagrangian, Method, Nitsche

FRICTION_STEPS = ((0.5, 1.0), (0.9, 1.0), tuple(0.05 * k for k in range(21)))
"""Shares of the friction bound when friction is raised in steps."""
LINE_SEARCHES = ("l2", "cp", "bt", "nleqerr")
"""What is tried where bisection fails: each leaves other cycles."""
NODAL = AugmentedLagrangian(gamma=1.0)
"""The method that starts the others."""
OTHERS = tuple(AugmentedLagrangian(gamma) for gamma in (0.1, 10.0, 1000.0))
"""Its parameters do not change its solution: others are tried where Newton fails."""
STIFFER = (100.0, 30.0, 10.0, 5.0, 3.0, 2.0, 1.4)
"""Factors of Nitsche's gamma on the way from the solution of the augmented Lagrangian, the limit of a large gamma: the
solutions of two gammas that are near are near each other."""


@dataclass(frozen=True)
class Attempt:
    """One attempt: a method, where it starts, its line search, the steps of friction.

    Attributes:
        final: Whether its solution is that of the scene; else it is where another attempt starts.
    """

    method: Method
    start: str
    line_search: str = "bisection"
    friction_shares: tuple[float, ...] = (1.0,)
    final: bool = True

    @property
    def gives(self) -> str:
        """The start that its solution is for others."""
        return "nodal" if self.method.multiplier else "stiffer"

    def __str__(self) -> str:
        steps = f", friction in {len(self.friction_shares)} steps" if len(self.friction_shares) > 1 else ""
        return f"{self.start} start, {self.method}, {self.line_search}{steps}"


def attempts(method: Method, states: Container[str], *, friction: bool, fallback: bool) -> Iterator[Attempt]:
    """The attempts, cheapest first; those whose start is not among the states are to be skipped.

    Without a gap the problem is positively homogeneous, so steps of the load are all the same problem; friction
    is raised in steps instead.

    Args:
        method: The method whose solution is wanted.
        states: Names of the starts that are known, looked at as the attempts go on.
        friction: Whether the scene has friction.
        fallback: Whether the solution of the augmented Lagrangian will do.
    """
    nodal = method if method.multiplier else NODAL
    itself = nodal == method
    first = "warm" if "warm" in states else "glued"
    yield Attempt(nodal, first, final=itself)
    if not itself:
        yield Attempt(method, "nodal")
        if first == "warm":
            yield Attempt(method, "warm")
    if not itself or first == "warm":
        yield Attempt(method, "glued")
    for other in (NODAL, *OTHERS):
        if "nodal" not in states and other != method:
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
