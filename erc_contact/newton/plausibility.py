"""Doubts about a solution though its numbers are right, each told once in words.

The theory holds for small strains and rotations, with the gap measured on the body as
it was. Numbers in other units than those meant, a friction in percent or degrees, a
load in the wrong unit, show here, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.logs import log_of
from erc_contact.model.contact.contact_values import distance_at_nodes
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import Trace
from erc_contact.model.model import Model
from erc_contact.model.motions.body_words import boundary_parts, lying_words
from erc_contact.newton.curve_ends import beyond_curves
from erc_contact.newton.displaced import MISSING, missing_moments
from erc_contact.newton.distortion import ROTATION, STRAIN, Distortion
from erc_contact.newton.solution import Solution
from namedmesh.base.percent import percent
from namedmesh.base.ranks import greatest
from namedmesh.simplex import rule

MANY = 0.01
"""Share of the volume of a body that may rotate or strain more [-].

At an edge where the stress is singular rotations and strains are so, too.
"""
INVERTED = 1e-6
"""Share of the volume of a body that may be turned inside out [-].

Next to an edge where the stress is singular like the inverse root of the distance, a
mean strain of 1% strains by 1 at a distance of 1e-4.
"""
TRUSTED = 0.5
"""Relative error below which a displacement tells what the body does [-]."""
FRICTION = 3.0
"""Coulomb coefficient above which no dry pair of materials is known [-]."""
APART = 1e-3
"""Distance above which a contact is surely open, over the greatest displacement [-].

Newton and Nitsche leave less where body and foundation are flat; where they are
curved, see :func:`_presses`.
"""
NO_TRACTION = 1e-8
"""Traction that counts as none, over ``E/h`` times displacement and distance [-].

A solver with multigrid leaves up to 1e-10 on an open contact, one with a factor
round-off.
"""
UNTOUCHED = "untouched"
"""First word of the key of a contact that nothing touches.

A later mesh or step may touch it.
"""
STATICS = "statics"
"""Kind of the doubt whether a body stands."""

Doubts = dict[tuple[str, str], str]
"""Doubts: kind and part of the boundary -> words."""


@dataclass(frozen=True)
class LimitOfTheory:
    """Hold what is not small in a solution.

    Attributes:
        fact: What it is, with its number.
        advice: What it means, and what to do.
    """

    fact: str
    advice: str

    def __str__(self) -> str:
        """Write the fact and the advice."""
        return f"{self.fact[:1].upper()}{self.fact[1:]}: {self.advice}"


def doubts(solution: Solution) -> Doubts:
    """Find what is doubtful in a solution; collective."""
    if _stays(solution):
        return {}
    return _told(beyond_theory(solution)) | _other_doubts(solution)


def _stays(solution: Solution) -> bool:
    """Tell whether the body is at rest where it was; collective."""
    return solution.at_rest and greatest(solution.domain.comm, solution.u.x.array) == 0.0


def _told(limits: dict[str, LimitOfTheory]) -> Doubts:
    """Return limits of the theory as doubts."""
    return {(kind, ""): str(limit) for kind, limit in limits.items()}


def _other_doubts(solution: Solution) -> Doubts:
    """Find what is doubtful though displacements are small; collective."""
    model = solution.model
    moved = greatest(model.space.comm, solution.u.x.array)
    found: Doubts = {}
    if model.unheld.functions:
        found["unheld", ""] = _of_unheld(model)
    lying = lying_words(model.space, *model.bodies)
    if lying:
        found["lying", ""] = lying
    found |= beyond_curves(solution)
    for contact in model.contacts:
        found |= _of_contact(model, contact, solution, moved)
    return found | _of_pairs(model, solution, moved)


def beyond_theory(solution: Solution) -> dict[str, LimitOfTheory]:
    """Find where displacements are not small, by the kind of the doubt; collective."""
    if _stays(solution):
        return {}
    return _of_size(solution) | _of_distortion(solution) | _of_statics(solution)


def _of_size(solution: Solution) -> dict[str, LimitOfTheory]:
    """Find a displacement that is larger than the body; collective."""
    domain = solution.domain
    moved = greatest(domain.comm, solution.u.x.array)
    least_side = float(domain.sides.min())
    if moved <= least_side:
        return {}
    limit = LimitOfTheory(
        f"the body moves by {moved:.3g}, {moved / least_side:.2g} times its least side "
        f"({least_side:.3g})",
        "the gap belongs to the body as it was, so a displacement must be small beside it. Look "
        "at the units of loads, moduli and displacements.",
    )
    return {"displacement": limit}


def tell(comm: MPI.Comm, found: Doubts) -> None:
    """Log doubts as warnings, on rank 0."""
    for words in found.values():
        log_of(comm).warning(words)


class DoubtsOfRun:
    """Tell each doubt of a run once; methods are collective.

    It is told once whatever the number of meshes or steps. A contact that no mesh or
    step has touched is told at the end.

    Args:
        comm: Communicator of the run.
        refines: Whether each solution is of the same scene as the last one, on a finer
            mesh, as in :func:`erc_contact.adapt`: the last one counts.
    """

    def __init__(self, comm: MPI.Comm, *, refines: bool) -> None:
        self.comm = comm
        self._refines = refines
        self._last: Solution | None = None
        self._limits: dict[str, LimitOfTheory] = {}
        self._told: set[tuple[str, str]] = set()
        self._untouched: Doubts | None = None

    def see(self, solution: Solution) -> None:
        """Tell what is new in a solution, but for what is told at the end."""
        if _stays(solution):
            return
        self._last = solution
        limits = _of_size(solution) | _of_distortion(solution)
        untouched: Doubts = {}
        new: Doubts = {}
        for key, words in (_told(limits) | _other_doubts(solution)).items():
            kind, _ = key
            if kind == UNTOUCHED:
                untouched[key] = words
            elif key not in self._told:
                new[key] = words
        self._told.update(new)
        tell(self.comm, new)
        if self._refines:
            self._limits = limits
        else:
            self._limits |= limits | _of_statics(solution)
        # Only what nothing has touched so far is still untouched.
        if self._untouched is not None:
            for key in untouched.keys() - self._untouched.keys():
                del untouched[key]
        self._untouched = untouched

    def end(self) -> str:
        """Tell which contacts nothing has touched, and which bodies may not stand.

        A mesh that is too coarse for its contacts does not know the latter.

        Returns:
            Where displacements are not small, as the end of an outcome, or nothing.
        """
        tell(self.comm, self._untouched or {})
        if self._refines and self._last is not None:
            self._limits |= _of_statics(self._last)
        if STATICS in self._limits:
            tell(self.comm, {(STATICS, ""): str(self._limits[STATICS])})
        facts = [limit.fact for limit in self._limits.values()]
        return f" Displacements are not small: {'; '.join(facts)}." if facts else ""


def _of_unheld(model: Model) -> str:
    """Say which motions nothing holds, and what takes up what loads leave there."""
    words = (
        f"Nothing holds the body against: {model.unheld.words}. The loads are in balance there, so "
        "stresses, forces and errors are known, and u is known up to these motions: it is given "
        "with a mean of zero in them."
    )
    if model.relief is not None:
        words += (
            f" They leave {model.relief.words}, as rounded numbers or flat facets do: forces per "
            "volume take it up."
        )
    return words


def _of_distortion(solution: Solution) -> dict[str, LimitOfTheory]:
    """Find bodies that turn or strain much; collective."""
    found: dict[str, LimitOfTheory] = {}
    distortion = solution.distortion
    body, share = _worst_body(solution.model, distortion.rotated)
    if share > MANY:
        found["rotation"] = LimitOfTheory(
            f"{percent(share, 2)} of {body} rotates by more than {ROTATION:g} rad, up to "
            f"{distortion.rotation.max():.2g} rad (skew part of grad u)",
            "strains are right for small rotations, and the error does not contain what this "
            "costs. Look at the units, or take a code for large displacements.",
        )
    body, share = _worst_body(solution.model, distortion.strained)
    if share > MANY:
        found["strain"] = LimitOfTheory(
            f"{percent(share, 2)} of {body} strains by more than {percent(STRAIN)}, up to "
            f"{percent(distortion.strain.max(), 2)}{_inside_out(distortion)}",
            "strains count as small, and the error does not contain what this costs. Look at the "
            "units of loads, moduli, gaps and displacements, or take a code for large strains.",
        )
    return found


def _of_statics(solution: Solution) -> dict[str, LimitOfTheory]:
    """Find bodies that may not stand in the displaced place; collective."""
    model = solution.model
    bodies, count = model.bodies
    facts = []
    for missing in missing_moments(model, solution.u, solution.traction):
        if missing.doubt <= MISSING:
            continue
        body = "the body"
        if count > 1:
            body = f"the body with {boundary_parts(model.space, bodies == missing.body)}"
        facts.append(
            f"{percent(missing.share, 2)} of the moment is missing on {body}, "
            f"{missing.of_contacts:.2g} times what its contacts can take up"
        )
    if not facts:
        return {}
    return {
        STATICS: LimitOfTheory(
            f"statics of the displaced bodies: {'; '.join(facts)}; this model cannot say whether "
            "it stands",
            "loads and contact forces balance where the bodies were drawn. At x + u they do not, "
            "and eps does not see it. Hold the body, give it more friction or a wider base, or "
            "take a code for large displacements.",
        )
    }


def check_upright(solution: Solution, eps: float) -> None:
    """Check that a displacement turns no part of a body inside out; collective.

    On a mesh that is far too coarse, as where elements lock, a displacement may do so
    that the body does not have: with a large error nothing is refused. At an edge where
    the stress is singular the smallest cells are inverted by any load, so a tiny share
    is allowed. Without contact a scene is linear: its numbers hold for loads that are a
    thousand times smaller, so large loads are told and not refused.

    Args:
        solution: The solution.
        eps: Its relative error [-].

    Raises:
        InputError: If it does, and the scene has contacts.
    """
    model = solution.model
    distortion = solution.distortion
    is_known = bool(model.contacts) and eps < TRUSTED
    if not is_known or distortion.inverted.max() <= INVERTED:
        return
    body, share = _worst_body(model, distortion.inverted)
    raise InputError(
        f"u turns {percent(share, 2)} of {body} inside out or flat (det(I + grad u) <= 0): strains "
        f"are up to {percent(distortion.strain.max(), 2)}, and small ones are allowed, up to about "
        f"{percent(STRAIN)}. Nothing is certified of such a state. Look at the units of loads, "
        "moduli, gaps, displacements and motions of foundations; of loads that are right, apply a "
        "tenth, or take a code for large strains."
    )


def _worst_body(model: Model, shares: np.ndarray) -> tuple[str, float]:
    """Return the body with the greatest share, in words, and its share; collective."""
    body, count = model.bodies
    worst = int(shares.argmax())
    share = float(shares[worst])
    if count == 1 or share == 0.0:
        return "the body", share
    return f"the body with {boundary_parts(model.space, body == worst)}", share


def _inside_out(distortion: Distortion) -> str:
    """Say which share of a body is inverted; empty if none is."""
    share = float(distortion.inverted.max())
    return f" ({percent(share, 2)} is turned inside out)" if share > INVERTED else ""


def _of_contact(model: Model, contact: ContactOnMesh, solution: Solution, moved: float) -> Doubts:
    """Find an unlikely friction, and a contact without touch; collective."""
    found: Doubts = {}
    most = model.greatest_coefficient(contact)
    if most > FRICTION:
        found["friction", contact.name] = (
            f"Contact({contact.name!r}): friction is {most:g}; Coulomb's coefficient is "
            f"mostly below 1, and above {FRICTION:g} it is rather meant in percent (30% is "
            "0.3) or in degrees (30 are 0.577)."
        )
    distances = distance_at_nodes(model.space, contact, solution.u.x.array)
    distance, _ = model.space.extremes(distances)
    apart = not contact.bilateral and distance > APART * moved
    if apart and not _presses(contact, solution, moved + distances.max(axis=1, initial=0.0)):
        found[UNTOUCHED, contact.name] = (
            f"Nothing touches the contact {contact.name!r}: its gap is {distance:.3g} or more "
            "everywhere. Look at the sign and the size of the gap, and at the loads."
        )
    return found


def _of_pairs(model: Model, solution: Solution, moved: float) -> Doubts:
    """Find parts that face each other and have no contact between them; collective.

    They are free, as the faces of a crack are, so it is doubtful only if the bodies go
    into each other, or if a rigid foundation is in the place of one of them.
    """
    space = model.space
    found: Doubts = {}
    contacts = model.scene.contacts
    between = {frozenset(contact.sides) for contact in contacts}
    rigid = [contact for contact in contacts if contact.against is None and not contact.bilateral]
    on_foundation = {contact.facets for contact in rigid}
    for interface in model.domain.interfaces:
        here, there = interface.names
        if interface.tied or frozenset(interface.names) in between:
            continue
        remedy = f"Give Contact({here!r}, against={there!r})"
        alone = on_foundation.intersection(interface.names)
        if alone:
            names = " and ".join(f"Contact({name!r})" for name in sorted(alone))
            found["foundation", here] = (
                f"{names} has no against=, so a rigid foundation is there, though {here!r} and "
                f"{there!r} lie against each other. {remedy} for a contact of both bodies."
            )
            continue
        first, second = space.domain.facing(here, there)
        side = space.side(first, model.modulus)
        n = space.outward_normals(first)
        trace = Trace(side, space.side(second, model.modulus), n)
        drawn = np.matmul(side.shares_of_nodes, trace.to_partners)
        jump = trace.of(solution.u.x.array) - drawn
        _, entry = space.extremes((jump * n[:, None, :]).sum(axis=-1))
        if entry > APART * moved:
            found["pair", here] = (
                f"{here!r} and {there!r} go into each other by {entry:.3g}: no Contact is between "
                f"them. {remedy}, or Tied({here!r}, {there!r}) to glue them."
            )
    return found


def _presses(contact: ContactOnMesh, solution: Solution, lengths: np.ndarray) -> bool:
    """Tell whether the method has a traction on a contact; collective.

    A curved body, or one on a curved foundation, may touch though all its nodes are
    apart: between nodes, where the least gap is; with Nitsche's method at a node whose
    stress balances the distance; with degree 2 by Bernstein coefficients. These
    distances vanish with the cell size only.

    Args:
        contact: The contact.
        solution: The solution.
        lengths: Greatest displacement plus distance of each facet [length], shape (f,).
    """
    space = solution.model.space
    points, _ = rule(space.d - 1, space.contact_degree)
    r = space.evaluate(solution.traction(contact), points, contact.facets)
    none = NO_TRACTION * contact.trace.here.stiffness * lengths
    _, beyond = space.extremes(np.linalg.norm(r, axis=-1) - none[:, None])
    return beyond > 0
