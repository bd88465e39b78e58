"""The ladder of attempts of a contact solve, cheapest first.

An attempt is a start of Newton's method, a contact method and a line search.

A start is a displacement of the contact nodes. "glued" is the solution with the contact
glued, "interior" the state to which interior point steps lead, "warm" a solution on
another mesh, "nodal" a solution of the augmented Lagrangian, and "stiffer" one of the
same method with a larger gamma.

Contact without friction, or with Tresca friction, is a quadratic programme. Where many
points change their status step by step, Newton's method is ended early, and interior
point steps (``erc_contact.newton.interior_point``) find the states; from there it
ends in one or two steps. With Coulomb friction they are a start where it failed.
"""

from __future__ import annotations

from collections.abc import Container, Generator, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from erc_contact.newton.methods import OURS, AugmentedLagrangian, Method, Nitsche

FRICTION_STEPS = ((0.5, 1.0), (0.9, 1.0), tuple(0.05 * k for k in range(21)))
"""Shares of the friction bound when friction is raised in steps."""
MUCH_FRICTION = 8.0
"""Share of the friction bound at which friction that holds a body is first lowered [-].

More friction makes more of the contact stick. So loose bodies that stick at last are
followed to the friction of the scene, or to the friction at which they begin to slide.
"""
NEAR = 1.02
"""Ratio of two frictions from which the greater one is a near start [-]."""
NEWTON_STEPS = 100
"""Limit of Newton steps of an attempt."""
STEPS_OF_NEIGHBOURS = 20
"""Limit of Newton steps of a problem that is near the problem before.

So are problems with softer springs or less friction. Those that are solved mostly take
1 to 5 steps, and seldom more than 17.
"""
GAP_SHARES = (0.0, 1.0)
"""Shares of the gaps when they are closed first.

A body that only a contact with a large gap holds is in tension all over where the gap
is closed all over, as in the glued start. In the solution without gap part of the
contact is open already.
"""
LINE_SEARCHES = ("cp", "bt")
"""Line searches where bisection fails; each may avoid a cycle of the others."""
NODAL = AugmentedLagrangian(gamma=1.0)
"""The method whose solution is the start of the others."""
OTHERS = tuple(AugmentedLagrangian(gamma) for gamma in (0.1, 1000.0))
"""The same method with other parameters, which do not change its solution."""
STIFFER = (100.0, 30.0, 10.0, 5.0, 3.0, 2.0, 1.4)
"""Factors of Nitsche's gamma for a sequence of problems.

It starts from the augmented Lagrangian, the limit of a large gamma. The solutions of
two near gammas are near each other.
"""
STIFFEST, SOFTEST = 1.0, 1e-9
"""First and last weight of springs on the rigid motions that no support holds [-].

They hold each motion where the last problem left it, which is the proximal point method
(Rockafellar, SIAM J. Control Optim. 14 (1976)). Where all of the contact slips nothing
else holds a body along it, and the tangent is singular, even if the solution sticks
somewhere. With springs it is not, and softer springs let the body go where it must.
"""
SOFTER = 0.1
"""Factor of the weight after a problem that was solved [-]."""
STIFFER_AGAIN = 10.0
"""Factor of the weight after one that was not [-]."""
PROXIMAL_FAILURES = 5
"""Number of problems without solution that ends an attempt by proximal steps."""
PULLING = 2
"""Number of problems in turn over which springs must pull less.

Where no state balances the loads, what is left of them pulls at the springs for ever.
If the problem is convex, the pull never grows from one problem to the next, and falls
to zero if there is a solution.
"""
UNDIMINISHED = 0.9
"""Share of a pull that counts as no less [-]."""


class Shares(NamedTuple):
    """Hold what one problem of a sequence has of friction, gaps and springs.

    Attributes:
        friction: Share of the friction bound [-].
        gap: Share of the gaps [-].
        springs: Weight of the springs on motions that no support holds [-].
    """

    friction: float = 1.0
    gap: float = 1.0
    springs: float = 0.0


@dataclass(frozen=True)
class Attempt:
    """Describe one attempt of a contact solve.

    Attributes:
        method: The contact method.
        start: Name of the start.
        line_search: Name of PETSc's line search.
        friction_shares: Shares of the friction bound that are solved for one after the
            other [-]; interior point steps know only the first one.
        gap_shares: The same of gaps; only one of both has several.
        lowers: Whether friction is lowered to the scene's from more of it.
        proximal: Whether springs hold the motions that no support holds meanwhile.
        final: Whether its solution solves the scene; otherwise it is the start of
            another attempt.
        interior: Whether it makes interior point steps, which lead near a solution.
        hurried: Whether it ends where many points change their status step by step.
    """

    method: Method
    start: str
    line_search: str = "bisection"
    friction_shares: tuple[float, ...] = (1.0,)
    gap_shares: tuple[float, ...] = (1.0,)
    lowers: bool = False
    proximal: bool = False
    final: bool = True
    interior: bool = False
    hurried: bool = False

    def problems(self) -> Generator[Shares, float | None, None]:
        """Generate the problems of the sequence; the last problem is the scene's.

        It is sent the pull of the springs, their weight times what the state moved, in
        any unit of length; None after a problem without solution.
        """
        if self.proximal:
            yield from _proximal_problems()
            return
        if self.lowers:
            yield from _lowered_problems()
            return
        for share in self.friction_shares[:-1]:
            if (yield Shares(friction=share)) is None:
                return
        for share in self.gap_shares[:-1]:
            if (yield Shares(gap=share)) is None:
                return
        yield Shares()

    @property
    def most_steps(self) -> int:
        """Return the limit of Newton steps of a problem."""
        return STEPS_OF_NEIGHBOURS if self.lowers or self.proximal else NEWTON_STEPS

    @property
    def gives(self) -> str:
        """Return the name of the start that its solution is for other attempts."""
        if self.interior:
            return "interior"
        return "nodal" if self.method.multiplier else "stiffer"

    def __str__(self) -> str:
        if self.interior:
            return f"{self.start} start, {self.method}, interior point steps"
        steps = ""
        if len(self.friction_shares) > 1:
            steps = f", friction in {len(self.friction_shares)} steps"
        if len(self.gap_shares) > 1:
            steps = f", gaps in {len(self.gap_shares)} steps"
        if self.lowers:
            steps = ", friction lowered"
        if self.proximal:
            steps = ", proximal steps"
        return f"{self.start} start, {self.method}, {self.line_search}{steps}"


def attempts(
    method: Method,
    known: Container[str],
    *,
    friction: bool,
    gap: bool,
    loose: bool,
    slides: bool,
    fallback: bool,
    nodal_first: bool,
    convex: bool,
) -> Iterator[Attempt]:
    """Generate the attempts, cheapest first.

    The caller skips those whose start is not known.

    Without a gap the problem is positively homogeneous, so steps of the load would all
    be the same problem. Friction is raised in steps instead.

    Args:
        method: The method whose solution is wanted.
        known: Names of the starts that are known; the caller adds to them between two
            attempts.
        friction: Whether the scene has friction.
        gap: Whether it has a gap.
        loose: Whether supports leave a body rigid motions.
        slides: Whether such a body may slide however it is pressed, as pressure grows
            friction but friction no pressure.
        fallback: Whether a solution of the augmented Lagrangian is accepted instead.
        nodal_first: Whether another method starts from the solution of the augmented
            Lagrangian.
        convex: Whether no friction bound grows with the pressure, so that interior
            point steps lead to the solution.
    """
    nodal = method if method.multiplier else NODAL
    first = "warm" if "warm" in known else "glued"
    yield from _first(method, nodal, first, known, convex=convex, nodal_first=nodal_first)
    if loose:
        # Springs take many steps, and a solution that is accepted may be there.
        if not (fallback and "nodal" in known):
            yield Attempt(method, first, proximal=True)
        # The friction at which this ends early tells what friction is needed.
        yield from _lower_friction(method, nodal, known) if slides else ()

    # Another parameter of the augmented Lagrangian goes another way to its solution.
    tried = {method, nodal} if first == "glued" else {method}
    for other_method in (NODAL, *OTHERS):
        if "nodal" not in known and other_method not in tried:
            yield Attempt(other_method, "glued", final=False)
            yield Attempt(method, "nodal")
    if isinstance(method, Nitsche):
        yield from _stiffer(method)
    if fallback and nodal != method:
        yield Attempt(nodal, "nodal")

    if gap:
        yield Attempt(method, "glued", gap_shares=GAP_SHARES)
    friction_steps = FRICTION_STEPS if friction else ()
    for shares in friction_steps:
        yield Attempt(method, "glued", friction_shares=shares)
    for line_search in LINE_SEARCHES:
        yield Attempt(method, "glued", line_search)


def _first(
    method: Method,
    nodal: Method,
    first: str,
    known: Container[str],
    *,
    convex: bool,
    nodal_first: bool,
) -> Iterator[Attempt]:
    """Generate the first attempts, of which one mostly leads to a solution.

    Args:
        method: The method whose solution is wanted.
        nodal: The augmented Lagrangian.
        first: Name of the first start.
        known: Names of the starts that are known.
        convex: As in :func:`attempts`.
        nodal_first: As in :func:`attempts`.
    """
    is_nodal = nodal == method
    if nodal_first and not is_nodal:
        yield Attempt(nodal, first, final=False)
        yield Attempt(method, "nodal")
        yield from _interior(method, nodal, known)
        yield Attempt(method, "glued")
    else:
        # Nothing is left of a hurried attempt but the states that interior points find.
        yield Attempt(method, first, hurried=convex and type(method) in OURS)
        # They lead to the solution of a quadratic programme, else near one at best.
        if convex:
            yield from _interior(method, nodal, known)
        if not is_nodal and "nodal" not in known:
            yield Attempt(nodal, first, final=False)
            yield Attempt(method, "nodal")
        if not convex:
            yield from _interior(method, nodal, known)
        if first == "warm":
            yield Attempt(method, "glued")


def _interior(method: Method, nodal: Method, known: Container[str]) -> Iterator[Attempt]:
    """Generate the attempts by interior point steps.

    Args:
        method: The method whose solution is wanted.
        nodal: The augmented Lagrangian.
        known: Names of the starts that are known.
    """
    if type(method) in OURS:
        yield Attempt(method, "glued", interior=True, final=False)
        yield Attempt(method, "interior")
    if nodal != method and "interior" in known and "nodal" not in known:
        yield Attempt(nodal, "glued", interior=True, final=False)
        yield Attempt(nodal, "interior", final=False)
        yield Attempt(method, "nodal")


def _lower_friction(method: Method, nodal: Method, known: Container[str]) -> Iterator[Attempt]:
    """Generate the attempts by friction that is lowered, for a body that may slide.

    Args:
        method: The method whose solution is wanted.
        nodal: The augmented Lagrangian.
        known: Names of the starts that are known.
    """
    if "nodal" in known:
        return
    is_nodal = nodal == method
    yield Attempt(nodal, "glued", lowers=True, final=is_nodal)
    if "nodal" not in known:
        much = (MUCH_FRICTION,)
        yield Attempt(nodal, "glued", friction_shares=much, interior=True, final=False)
        yield Attempt(nodal, "interior", lowers=True, final=is_nodal)
    if not is_nodal:
        yield Attempt(method, "nodal")


def _lowered_problems() -> Generator[Shares, float | None, None]:
    """Generate problems with less and less friction, down to the scene's friction.

    Each has the geometric mean of the least friction that was solved and the greatest
    that was not, which is the scene's before. Where these are near each other, it has
    the latter, which a near start may solve. The generator is sent None after a problem
    without solution. It ends after such a near one, or with the scene's friction.
    """
    solved, unsolved = MUCH_FRICTION, 1.0
    if (yield Shares(friction=solved)) is None:
        return
    while solved > 1.0:
        is_near = solved <= NEAR * unsolved
        share = unsolved if is_near else (solved * unsolved) ** 0.5
        if (yield Shares(friction=share)) is not None:
            solved = share
            unsolved = 1.0 if is_near else unsolved
        elif solved <= NEAR * share:
            return
        else:
            unsolved = share


def _proximal_problems() -> Generator[Shares, float | None, None]:
    """Generate problems with softer and softer springs, at last without.

    After a problem without solution the springs are stiffer again, and the last state
    comes nearer to the solution. It ends where the softest springs pull no less than
    springs before: without them nothing would hold what they hold. It is sent the pull
    of the springs, None after a problem without solution.
    """
    weight = STIFFEST
    failures = 0
    pulls: list[float] = []
    while failures <= PROXIMAL_FAILURES:
        pull = yield Shares(springs=weight)
        # Round-off in powers of the factor does not matter.
        is_softest = weight <= 2 * SOFTEST
        if pull is None:
            failures += 1
            weight = STIFFER_AGAIN * max(weight, SOFTEST)
            pulls.clear()
            continue
        pulls.append(pull)
        if weight == 0.0 or (is_softest and _pulls_for_ever(pulls)):
            return
        weight = 0.0 if is_softest else SOFTER * weight


def _pulls_for_ever(pulls: list[float]) -> bool:
    """Tell whether springs pull no less, from their pulls in problems in turn."""
    if len(pulls) <= PULLING:
        return False
    before = pulls[-1 - PULLING]
    return pulls[-1] > UNDIMINISHED * before


def _stiffer(method: Nitsche) -> Iterator[Attempt]:
    """Generate the attempts with larger gamma, from the augmented Lagrangian's."""
    start = "nodal"
    for factor in STIFFER:
        stiffer = replace(method, gamma=factor * method.gamma)
        yield Attempt(stiffer, start, final=False)
        start = "stiffer"
    yield Attempt(method, "stiffer")
