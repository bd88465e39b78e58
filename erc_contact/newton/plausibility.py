"""Doubts about a solution though its numbers are right, each told once in words.

The theory holds for small strains and rotations, with the gap measured on the body as
it was. Numbers in other units than those meant, a friction in percent or degrees, a
load in the wrong unit, show here, too.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.base.ranks import greatest
from erc_contact.mesh.simplex import measures, rule
from erc_contact.model.body_words import lying_words
from erc_contact.model.contact_values import gap_at_nodes
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.model.trace import Trace
from erc_contact.newton.solution import Solution

ROTATION = 0.1
"""Rotation up to which the theory is good [rad]; half its square, 0.5%, is lost."""
ROTATED = 0.01
"""Share of the volume that may rotate more [-].

At an edge where the stress is singular a rotation is so, too.
"""
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

Doubts = dict[tuple[str, str], str]
"""Doubts: kind and part of the boundary -> words."""


def doubts(solution: Solution) -> Doubts:
    """Find what is doubtful in a solution; collective."""
    model = solution.model
    if solution.at_rest:
        return {}
    moved = greatest(model.comm, solution.u.x.array)
    found: Doubts = {}
    least_side = float(model.domain.sides.min())
    if moved > least_side:
        found["displacement", ""] = (
            f"The body moves by {moved:.3g}, {moved / least_side:.2g} times its least side "
            f"({least_side:.3g}): the gap belongs to the body as it was, so a displacement must "
            "be small beside it. Look at the units of loads, moduli and displacements."
        )
    share, most = _measure_rotation(solution)
    if share > ROTATED:
        found["rotation", ""] = (
            f"{percent(share, 2)} of the body rotates by more than {ROTATION:g} rad, up to "
            f"{most:.2g} rad (skew part of grad u): strains are right for small rotations, and "
            "the error does not contain what this costs. Look at the units, or take a code for "
            "large displacements."
        )
    if model.unheld.functions:
        found["unheld", ""] = _of_unheld(model)
    lying = lying_words(model, *model.bodies)
    if lying:
        found["lying", ""] = lying
    for contact in model.contacts:
        found |= _of_contact(model, contact, solution, moved)
    return found | _of_pairs(model, solution, moved)


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
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.comm = comm
        self._told: set[tuple[str, str]] = set()
        self._untouched: Doubts | None = None

    def see(self, solution: Solution) -> None:
        """Tell what is new in a solution."""
        if solution.at_rest:
            return
        untouched: Doubts = {}
        new: Doubts = {}
        for key, words in doubts(solution).items():
            kind, _ = key
            if kind == UNTOUCHED:
                untouched[key] = words
            elif key not in self._told:
                new[key] = words
        self._told.update(new)
        tell(self.comm, new)
        # Only what nothing has touched so far is still untouched.
        if self._untouched is not None:
            for key in untouched.keys() - self._untouched.keys():
                del untouched[key]
        self._untouched = untouched

    def end(self) -> None:
        """Tell which contacts nothing has touched."""
        tell(self.comm, self._untouched or {})


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


def _measure_rotation(solution: Solution) -> tuple[float, float]:
    """Return the share of the volume that rotates much, and the greatest rotation.

    The share [-] is the volume with more than ROTATION over the volume of the body. The
    rotation of a cell [rad] follows from its vertices. Collective.
    """
    model, d = solution.model, solution.model.d
    cells = model.owned_cells
    corners = model.cell_corners()[cells]
    moved = solution.u.x.array.reshape(-1, d)[model.vertices[cells]]
    edges = corners[:, 1:] - corners[:, :1]
    # This is the transpose of the gradient, whose skew part is as large.
    gradient = np.linalg.solve(edges, moved[:, 1:] - moved[:, :1])
    skew = 0.5 * (gradient - gradient.transpose(0, 2, 1))
    rotation = np.linalg.norm(skew, axis=(1, 2)) / np.sqrt(2.0)
    volume = measures(corners)
    local = np.array([volume[rotation > ROTATION].sum(), volume.sum()])
    beyond, whole = model.comm.allreduce(local, MPI.SUM)
    return float(beyond / whole), greatest(model.comm, rotation)


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
    w = contact.trace.of(solution.u.x.array)
    approach = (w * contact.trace.normals).sum(axis=-1)
    distances = gap_at_nodes(model, contact) - approach
    distance, _ = model.extremes(distances)
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
        sides = [model.side(facets, model.modulus) for facets in model.domain.facing(here, there)]
        n = model.outward_normals(sides[0].facets)
        trace = Trace(sides[0], n, None, sides[1])
        drawn = np.matmul(sides[0].shares_of_nodes, trace.to_partners)
        jump = trace.of(solution.u.x.array) - drawn
        _, entry = model.extremes((jump * n[:, None, :]).sum(axis=-1))
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
    model = solution.model
    points, _ = rule(model.d - 1, model.contact_degree)
    r = evaluate(solution.traction(contact), model.mesh, points, contact.facets)
    none = NO_TRACTION * contact.trace.here.stiffness * lengths
    _, beyond = model.extremes(np.linalg.norm(r, axis=-1) - none[:, None])
    return beyond > 0
