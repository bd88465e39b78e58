"""Interior point steps for contact without friction, or with Tresca friction.

Such a contact problem is a quadratic programme. Newton's method for ``r = P(z)``, with
z the trial traction and P the projection of the law, moves the edge of a contact by
about a node a step where bodies are slender. An interior point method takes 10 to 20
steps on any mesh.

At a point, the law allows tractions r with ``D^T r <= h``: a pressure >= 0, and in the
plane two bounds of friction, in 3D the sides of a polygon. The projection is

    z = r + D v,    y = h - D^T r,    v >= 0,    y >= 0,    v_j y_j = t_j

with t = 0. On the central path all t_j are one mu > 0. A step solves this, linearised,
with equilibrium. Elimination of v and y leaves an affine map ``r = W z + o``,

    W = (I + D diag(v/y) D^T)^-1,    o = r - W (r + D (t/y)),

in place of P (:mod:`erc_contact.newton.interior_forms`). Each step solves twice with
one tangent (Mehrotra, SIAM J. Optim. 2 (1992)): the first solution tells how far mu can
fall, the second one goes there. Where a solve costs little beside a tangent, a third
solution brings the products v_j y_j that would be far from mu nearer to it (Gondzio,
Comput. Optim. Appl. 6 (1996)). The step is between the first and the second or third
one, where it is longest (Colombo and Gondzio, Comput. Optim. Appl. 41 (2008)). With
Coulomb friction, h follows the pressure.

Symbols: n points of this rank, d dimension, j bounds of a traction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.linear.mumps import LIBRARY, ZERO_PIVOT
from erc_contact.newton.snes import PathEnd

STEPS = 40
"""Limit of interior point steps of one attempt."""
SIDES = 8
"""Sides of the polygon of friction in 3D."""
SOFT = 1e-4
"""Stiffness of the springs at the contact in the first solution, over gamma [-].

Bodies that bend open and press by orders more than bodies that are glued.
"""
FIRST_MU = 3.0
"""First mu, over mean square of traction and opening of the first solution [-].

Steps are short where it is too small; where it is too large there are more steps.
"""
SHARES = np.linspace(1.0, 0.1, 10)
"""Shares of the way from a first to a second solution that are tried [-]."""
LONGER = 1.01
"""Growth of the length of a step for which a smaller share is taken [-]."""
INSIDE = 0.9
"""Share of the friction bound below which a path begins [-]."""
SHORT = 0.01
"""Length of a step that leads nowhere [-].

Where there is no solution, tractions grow for ever and steps end at their bounds.
"""
BACK = 0.995
"""Share of the way to the next bound that a step goes [-]."""
CORRECTED = 0.3
"""How much longer than the second step the third step is to be [-]."""
FAR = 10.0
"""Ratio of v_j y_j to the mu of a step that is corrected, or its inverse [-]."""
KNOWN = 1e-5
"""Sum of all v y over the sum of |r|^2 from which states are known [-]."""
APART = 1e-12
"""Pressure over opening, times gamma, at all points where nothing touches [-]."""
LEFT = 1e-3
"""What may be left of equilibrium at the end, over the first solution [-]."""

Directions = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Changes of r, y and v in a step."""


class LinearStep(Protocol):
    """Solve the linear equations for the weights and offsets that are set."""

    def __call__(self, u: np.ndarray, *, renew: bool) -> np.ndarray:
        """Return the solution, to which the forms are moved.

        Args:
            u: The unknowns of this rank from which it is found; any will do.
            renew: Whether the tangent has changed.
        """


def follow(
    call: Callable[[str], Any], solve: LinearStep, u: np.ndarray, *, corrects: bool
) -> PathEnd:
    """Follow the central path until the states of all points are known; collective.

    Args:
        call: Calls a method of :class:`CentralPath` by its name on all ranks.
        solve: Makes the linear solves.
        u: Unknowns of this rank.
        corrects: Whether each step has a third solution.
    """
    count = 0
    is_known = False
    share = 1.0
    try:
        call("soften")
        u = solve(u, renew=True)
        call("begin")
        while not is_known and share > SHORT and count < STEPS:
            # All solutions of a step have one tangent: a factor serves two or three.
            call("linearise")
            first = solve(u, renew=True)
            call("predict")
            ends = [solve(u, renew=False)]
            if corrects:
                call("correct")
                ends.append(solve(u, renew=False))
            number, between, share, is_known = call("advance")
            solution = first + between * (ends[number] - first)
            u = u + share * (solution - u)
            count += 1
    except PETSc.Error as failure:
        # Nothing holds a motion: the tangent is singular.
        if failure.ierr not in (ZERO_PIVOT, LIBRARY):
            raise
    return PathEnd(u, count, is_known)


class CentralPath:
    """Hold tractions and slacks at the points of all contacts; members are collective.

    Args:
        forms: The equations with weights and offsets.
        friction: Share of the friction bounds [-].
    """

    def __init__(self, forms: InteriorForms, friction: float) -> None:
        model = forms.model
        space = model.space
        self._forms = forms
        self._friction = friction
        self._comm = space.comm
        self._shapes: list[tuple[int, int]] = []
        self._laws = []
        axes = []
        semi_axes = []
        opens = []
        for contact in model.contacts:
            owned = contact.trace.here.owned
            normals = space.evaluate(contact.normal, forms.points, contact.facets)[owned]
            self._shapes.append((len(normals), len(forms.points)))
            allowed = contact.friction_set
            facets = np.flatnonzero(owned)
            # Dual axes take tractions to where the set of friction is a disc, and
            # semi-axes take them back.
            of_disc = np.stack([normals, *allowed.dual_axes(normals, facets)], axis=2)
            of_set = np.stack([normals, *allowed.semi_axes(normals, facets)], axis=2)
            axes.append(of_disc.reshape(-1, space.d, space.d))
            semi_axes.append(of_set.reshape(-1, space.d, space.d))
            opens.append(np.full(len(axes[-1]), not contact.bilateral))
            parameters = friction_parameters(space, contact, forms.points)
            of_owned = {name: values[owned] for name, values in parameters.items()}
            self._laws.append((contact, of_owned))
        self._axes = np.concatenate(axes)
        self._semi_axes = np.concatenate(semi_axes)
        self._opens = np.concatenate(opens)
        self._solved: list[Directions] = []
        """Directions of the solutions of this step."""
        self._sides = _sides(space.d)

    def soften(self) -> None:
        """Set weights and offsets to soft springs at all points."""
        n, d, _ = self._axes.shape
        self._set_affine(np.broadcast_to(SOFT * np.eye(d), (n, d, d)), np.zeros((n, d)))

    def begin(self) -> None:
        """Begin on the path with the trial tractions that the forms read."""
        springs = SOFT * self._trials()
        opens = self._opens
        normal = springs[:, 0]
        # Springs carry r where they are pressed, and v is SOFT times less.
        square = self._sum(normal**2) / max(self._sum(np.ones(len(normal))), 1.0)
        first = FIRST_MU * max(square, np.finfo(float).tiny)
        self._mu = first / SOFT
        self._left = 1.0

        self._r = springs
        of_opens = normal[opens]
        # r^2 - SOFT z r = first: a spring's pressure where it is pressed, a small one
        # where it is pulled.
        self._r[opens, 0] = 0.5 * (of_opens - np.sqrt(of_opens**2 + 4 * first))
        bound = self._friction_bound()
        slides = bound > 0
        self._used = np.column_stack([opens, *[slides] * (self._sides.shape[1] - 1)])
        self._free = np.column_stack(
            [np.ones(len(bound), bool), *[slides] * (len(self._sides) - 1)]
        )
        size = np.linalg.norm(self._r[:, 1:], axis=1)
        # The shear begins well inside its bound: near it the first steps are short.
        share = np.where(slides, INSIDE * bound / np.where(slides, bound + size, 1.0), 0.0)
        self._r[:, 1:] *= share[:, None]
        self._h = np.where(self._used, bound[:, None], 0.0)
        self._h[:, 0] = 0.0
        self._y = np.where(self._used, self._h - self._r @ self._sides, 1.0)
        self._v = np.where(self._used, self._mu / self._y, 0.0)

    def linearise(self) -> None:
        """Set weights and offsets for a step to mu = 0."""
        sides = self._sides
        compliance = np.einsum("nj,aj,bj->nab", self._v / self._y, sides, sides)
        weights = np.linalg.inv(compliance + np.eye(len(sides)))
        # Without a friction bound the shear is zero, whatever the trial traction is.
        both_free = self._free[:, :, None] & self._free[:, None, :]
        self._weights = np.where(both_free, weights, 0.0)
        self._aim(np.zeros_like(self._y))
        self._solved = []

    def predict(self) -> None:
        """Set the offsets for a step to a smaller mu, after the step to mu = 0."""
        _, dy, dv = self._add_directions()
        share = min(1.0, self._longest(dy, dv))
        mu = self._mean((self._y + share * dy) * (self._v + share * dv))
        # Mehrotra's rule: the further mu can fall the less the step is centred, and dy
        # dv is what the linearisation of y v leaves out. Round-off may say mu < 0.
        centring = (max(mu, 0.0) / self._mu) ** 3
        self._next_mu = centring * self._mu
        self._aim(np.where(self._used, self._next_mu - dy * dv, 0.0))

    def correct(self) -> None:
        """Set the offsets for a longer step to the smaller mu, after a step to it."""
        _, dy, dv = self._add_directions()
        share = min(1.0, self._longest(dy, dv) + CORRECTED)
        products = (self._y + share * dy) * (self._v + share * dv)
        # A product far below mu ends the next step at its bound, a product far above it
        # is the last to fall.
        most = FAR * self._next_mu
        change = np.clip(products, self._next_mu / FAR, most) - products
        self._aim(np.where(self._used, self._t + np.maximum(change, -most), 0.0))

    def advance(self) -> tuple[int, float, float, bool]:
        """Take a step.

        Returns:
            Number of the solution after the first one to which it goes, share of the
            way there from the first one [-], its length [-], and whether all states are
            known.
        """
        self._add_directions()
        number, between, (dr, dy, dv) = self._longest_between()
        share = min(1.0, BACK * self._longest(dy, dv))
        if not np.isfinite(self._sum(dr)):
            return number, between, 0.0, False
        self._r = self._r + share * dr
        self._y = self._y + share * dy
        self._v = self._v + share * dv
        # Equilibrium is linear: a step of length s leaves 1 - s of its residual.
        self._left *= 1.0 - share
        self._follow_pressure()
        self._mu = self._mean(self._y * self._v)
        products = self._sum(np.where(self._used, self._y * self._v, 0.0))
        # Where nothing touches, tractions fall to zero with mu.
        presses = ~self._used[:, 0] | (self._y[:, 0] > APART * self._v[:, 0])
        touches = self._sum(presses) > 0
        is_known = not touches or products <= KNOWN * self._sum(self._r**2)
        return number, between, share, is_known and self._left <= LEFT

    def _longest_between(self) -> tuple[int, float, Directions]:
        """Return number, share of the way and directions of the longest step."""
        start, *ends = self._solved
        best = 0.0
        chosen = len(ends) - 1, 1.0, ends[-1]
        for number in reversed(range(len(ends))):
            for between in SHARES:
                dr, dy, dv = (
                    of_first + between * (of_end - of_first)
                    for of_first, of_end in zip(start, ends[number], strict=True)
                )
                length = min(1.0, self._longest(dy, dv))
                if length > LONGER * best:
                    best = length
                    chosen = number, float(between), (dr, dy, dv)
        return chosen

    def _aim(self, products: np.ndarray) -> None:
        """Set t, and with it weights and offsets."""
        self._t = products
        moved = self._r + (products / self._y) @ self._sides.T
        offsets = self._r - np.einsum("nab,nb->na", self._weights, moved)
        self._offsets = np.where(self._free, offsets, 0.0)
        self._set_affine(self._weights, self._offsets)

    def _add_directions(self) -> Directions:
        """Keep and return the directions of r, y and v at the solution in the forms."""
        r = np.einsum("nab,nb->na", self._weights, self._trials()) + self._offsets
        dr = r - self._r
        dy = np.where(self._used, -dr @ self._sides, 0.0)
        dv = np.where(self._used, (self._t - self._v * dy) / self._y - self._v, 0.0)
        self._solved.append((dr, dy, dv))
        return dr, dy, dv

    def _follow_pressure(self) -> None:
        """Scale tangential tractions by the change of the friction bound."""
        bound = self._h[:, 1]
        scale = np.divide(self._friction_bound(), bound, out=np.ones(len(bound)), where=bound > 0)
        # In proportion: y = h - D^T r holds on, and no slack becomes negative.
        for of_friction in (self._r, self._y, self._h):
            of_friction[:, 1:] *= scale[:, None]

    def _friction_bound(self) -> np.ndarray:
        """Return the friction bounds under the pressures of r [force/area], (n,)."""
        bounds = []
        pressures = self._of_contacts(np.maximum(-self._r[:, 0], 0.0))
        for (contact, parameters), pressure in zip(self._laws, pressures, strict=True):
            bounds.append(contact.friction_bound(pressure, parameters).ravel())
        return self._friction * np.concatenate(bounds)

    def _trials(self) -> np.ndarray:
        """Return the trial tractions that the forms read along the axes, (n, d)."""
        trials = [values.reshape(-1, values.shape[-1]) for values in self._forms.trials()]
        return np.einsum("nab,nb->na", self._axes, np.concatenate(trials))

    def _set_affine(self, weights: np.ndarray, offsets: np.ndarray) -> None:
        """Set weights (n, d, d) and offsets (n, d) along the axes."""
        back = self._semi_axes
        of_space = np.matmul(back.swapaxes(1, 2), np.matmul(weights, self._axes))
        vectors = np.einsum("nab,na->nb", back, offsets)
        self._forms.set_affine(self._of_contacts(of_space), self._of_contacts(vectors))

    def _of_contacts(self, values: np.ndarray) -> list[np.ndarray]:
        """Split values at all points (n, ...) by contacts, each (f, q, ...)."""
        ends = np.cumsum([facets * points for facets, points in self._shapes])[:-1]
        parts = np.split(values, ends)
        return [
            part.reshape(*shape, *part.shape[1:])
            for part, shape in zip(parts, self._shapes, strict=True)
        ]

    def _longest(self, dy: np.ndarray, dv: np.ndarray) -> float:
        """Return the length of a step at which the first y or v is zero [-]."""
        longest = np.inf
        for x, dx in ((self._y, dy), (self._v, dv)):
            falls = self._used & (dx < 0)
            longest = min(longest, float((x[falls] / -dx[falls]).min(initial=np.inf)))
        return float(self._comm.allreduce(longest, MPI.MIN))

    def _mean(self, products: np.ndarray) -> float:
        """Return the mean over all bounds."""
        return self._sum(np.where(self._used, products, 0.0)) / max(self._sum(self._used), 1.0)

    def _sum(self, values: np.ndarray) -> float:
        """Return the sum over all ranks."""
        return float(self._comm.allreduce(float(values.sum()), MPI.SUM))


def _sides(d: int) -> np.ndarray:
    """Return D, first the bound of the normal traction, shape (d, j)."""
    tangential = np.array([[1.0, -1.0]])
    if d == 3:
        angles = 2 * np.pi * np.arange(SIDES) / SIDES
        tangential = np.array([np.cos(angles), np.sin(angles)])
    sides = np.zeros((d, 1 + tangential.shape[1]))
    sides[0, 0] = 1.0
    sides[1:, 1:] = tangential
    return sides
