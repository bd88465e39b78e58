"""What makes a solution doubtful though all numbers are right: each is told once, in words.

The theory is that of small strains and rotations, with the gap measured on the body as
it was. Numbers in other units than those meant, a friction in percent or degrees, a
load in the wrong unit, show here, too.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from mpi4py import MPI

from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.newton.solution import Solution
from erc_contact.scene.law import Coulomb

ROTATION = 0.1
"""Rotation up to which a strain is small beside what the theory leaves out [rad]; its half square is 0.5%."""
ROTATED = 0.01
"""Share of the volume that may rotate more: at an edge where the stress is singular a rotation is so, too [-]."""
FRICTION = 3.0
"""Coulomb coefficient above which no dry pair of materials is known [-]."""
APART = 1e-3
"""Distance over the greatest displacement above which a contact is surely open: Newton and Nitsche leave less [-]."""
UNTOUCHED = "untouched"
"""First word of the key of a contact that nothing touches: a later mesh or step may touch it."""

Doubts = dict[tuple[str, str], str]
"""What is doubtful: kind and part of the boundary -> words."""


def doubts(solution: Solution) -> Doubts:
    """Find what is doubtful in a solution; collective."""
    model = solution.model
    if solution.at_rest:
        return {}
    moved = model.comm.allreduce(float(abs(solution.u.x.array).max(initial=0.0)), MPI.MAX)
    found: Doubts = {}
    least_side = float(model.domain.sides.min())
    if moved > least_side:
        found["displacement", ""] = (
            f"The body moves by {moved:.3g}, {moved / least_side:.2g} times its least side ({least_side:.3g}): the gap "
            "is that of the body as it was, so a displacement must be small beside it. Look at the units of loads, "
            "moduli and displacements."
        )
    share, most = _rotated(solution)
    if share > ROTATED:
        found["rotation", ""] = (
            f"{percent(share, 2)} of the body rotates by more than {ROTATION:g} rad, up to {most:.2g} rad (skew part "
            "of grad u): strains are those of small rotations, and the error does not contain what this costs. Look "
            "at the units, or take a code for large displacements."
        )
    for contact in model.contacts:
        found |= _of_contact(model, contact, solution, moved)
    return found


def tell(comm: MPI.Comm, found: Doubts) -> None:
    """Log doubts as warnings, on rank 0."""
    for words in found.values():
        log_of(comm).warning(words)


class DoubtsOfRun:
    """The doubts of a run, each of which is told once, whatever the number of meshes or steps; methods are collective.

    A contact is told at the end, if no mesh or step has touched it.

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
        found = doubts(solution)
        untouched = {key: words for key, words in found.items() if key[0] == UNTOUCHED}
        new = {
            key: words for key, words in found.items() if key not in self._told | untouched.keys()
        }
        self._told.update(new)
        tell(self.comm, new)
        before = untouched if self._untouched is None else self._untouched
        self._untouched = {key: words for key, words in untouched.items() if key in before}

    def end(self) -> None:
        """Tell which contacts nothing has touched."""
        tell(self.comm, self._untouched or {})


def _rotated(solution: Solution) -> tuple[float, float]:
    """Share of the volume that rotates by more than ROTATION, and the greatest rotation [rad]; collective.

    The rotation of a cell is that of its vertices.
    """
    model, d = solution.model, solution.model.d
    cells = model.owned_cells
    corners = model.cell_corners()[cells]
    moved = solution.u.x.array.reshape(-1, d)[model.vertices[cells]]
    edges = corners[:, 1:] - corners[:, :1]
    gradient = np.linalg.solve(
        edges, moved[:, 1:] - moved[:, :1]
    )  # its transpose, whose skew part is as large
    skew = 0.5 * (gradient - gradient.transpose(0, 2, 1))
    rotation = np.linalg.norm(skew, axis=(1, 2)) / np.sqrt(2.0)
    volume = abs(np.linalg.det(edges)) / factorial(d)
    local = np.array([volume[rotation > ROTATION].sum(), volume.sum()])
    beyond, whole = model.comm.allreduce(local, MPI.SUM)
    most = model.comm.allreduce(float(rotation.max(initial=0.0)), MPI.MAX)
    return float(beyond / whole), most


def _of_contact(model: Model, contact: BoundContact, solution: Solution, moved: float) -> Doubts:
    """Find a friction that is no number of a dry contact, and a contact that nothing touches; collective."""
    found: Doubts = {}
    if contact.friction is not None and isinstance(contact.friction.law, Coulomb):
        parameters = model.friction_parameters(contact, model.facet_points)
        _, most = model.extremes(parameters["friction"])
        if most > FRICTION:
            found["friction", contact.name] = (
                f"Contact({contact.name!r}): friction is {most:g}; Coulomb's coefficient is mostly below 1, and above "
                f"{FRICTION:g} it is rather meant in percent (30% is 0.3) or in degrees (30 are 0.577)."
            )
    along = (contact.trace.of(solution.u.x.array) * contact.direction[:, None, :]).sum(axis=-1)
    distance, _ = model.extremes(model.gap_at_nodes(contact) - along)
    if not contact.bilateral and distance > APART * moved:
        found[UNTOUCHED, contact.name] = (
            f"Nothing touches the contact {contact.name!r}: its gap is {distance:.3g} or more everywhere. Look at the "
            "sign and the size of the gap, and at the loads."
        )
    return found
