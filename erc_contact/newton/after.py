"""The displacement that the next step of a loading history counts from.

Friction acts on the tangential displacement since the last step. Points in slip go on
from where they are. Points in stick go on from where they stuck: Nitsche's method and
penalties keep them there up to the discretisation error only, and in many steps they
would creep. A multiplier keeps them there to round-off. On a tangentially compliant
foundation the slip alone is kept: the deflection is found anew in the next step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.contact_values import spring_displacement
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import STICK
from erc_contact.model.data.over_ranks import sum_over_ranks
from erc_contact.model.last_step import Greatest, LastStep
from erc_contact.newton.rest import load_size
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.ranks import greatest


def check_after(scene: Scene, domain: Domain, after: object) -> None:
    """Check that a scene can follow after a solution.

    Raises:
        InputError: If it is no solution, one in another dimension or of other ranks, or
            one with other contacts, or with their sides in another order.
    """
    if not isinstance(after, Solution):
        raise InputError(
            f"after is {checks.description(after)}; give the Solution of the last step, or None."
        )
    _check_law(scene.material, after.scene.material)
    if after.domain.dim != domain.dim:
        raise InputError(
            f"after is a solution in {after.domain.dim}D, and the domain is in {domain.dim}D."
        )
    comms = MPI.Comm.Compare(after.domain.comm, domain.comm)
    if comms not in (MPI.IDENT, MPI.CONGRUENT):
        raise InputError(
            "after is a solution of other ranks than the domain; give a solution of the same "
            "communicator."
        )
    names = {name for contact in scene.contacts for name in contact.sides}
    names_before = {name for contact in after.scene.contacts for name in contact.sides}
    ties, ties_before = ({tie.sides for tie in entry.ties} for entry in (scene, after.scene))
    if ties != ties_before:
        raise InputError(
            "The scene has other tied joints than the scene of after. All scenes of a history have "
            "the same tied joints."
        )
    if names != names_before:
        raise InputError(
            f"The scene has {_listed(names)} in contact, and the scene of after "
            f"{_listed(names_before)}. All scenes of a history have the same contacts; a contact "
            "that must not touch yet can have a gap."
        )
    pairs = {tuple(contact.sides) for contact in scene.contacts}
    if pairs != {tuple(contact.sides) for contact in after.scene.contacts}:
        raise InputError(
            "The scene names the two sides of a contact in another order than the scene of after, "
            "or pairs other sides. All scenes of a history name them alike."
        )


def _listed(names: set[str]) -> str:
    """Return names of contacts in words."""
    return ", ".join(map(repr, sorted(names))) or "no contact"


def last_step(solution: Solution) -> LastStep:
    """Return the displacement that the next step counts from; collective.

    A node keeps the tangential displacement from which it was counted where the
    traction sticks on all its facets.
    """
    model = solution.model
    contacts = {}
    for contact in model.contacts:
        trace = contact.trace
        w = trace.of(solution.u.x.array)
        if contact.tangential_stiffness is not None:
            w = w - _give_way(solution, contact)
        if contact.friction is not None and not solution.method.multiplier:
            nodes = trace.here.nodes
            stuck = _stuck(solution, contact)[nodes]
            n = contact.trace.normals
            normal = (w * n).sum(axis=-1, keepdims=True) * n
            w = np.where(stuck, normal + trace.slip_before, w)
        if contact.moved is not None:
            # The next step adds the motion of its own foundation.
            w = w - trace.of(contact.moved.x.array)
        contacts[contact.name] = contact.facets, contact.sign * w
    before = model.greatest_before
    sizes = Greatest(
        max(greatest(model.space.comm, solution.u.x.array), before.displacement),
        max(load_size(model.space, solution.stiffness.load_vector()), before.load),
    )
    state = None
    if model.linearised is not None:
        state = model.linearised.state_at_end(solution.u)
    return LastStep(model.space, contacts, sizes, state)


def _give_way(solution: Solution, contact: ContactOnMesh) -> np.ndarray:
    """Compute the tangential deflection of the foundation [length]; collective.

    A node has one value on all its facets, shape (f, m, d).
    """
    space = solution.model.space
    points = space.facet_points
    r = space.evaluate(solution.traction(contact), points, contact.facets)
    of_facets = spring_displacement(space, contact, r, points)
    here = contact.trace.here
    of_nodes = [here.values_of_nodes(of_facets[..., axis]) for axis in range(space.d)]
    return np.stack(of_nodes, axis=-1)[here.nodes]


def _stuck(solution: Solution, contact: ContactOnMesh) -> np.ndarray:
    """Find the components of nodes that stick on all facets, (nodes, d); collective."""
    model = solution.model
    space = model.space
    trial = solution.method.projected(model, contact, solution.u)
    status = space.evaluate(contact.status(trial), space.facet_points, contact.facets)
    side = contact.trace.here
    moves = np.where(status[side.owned] < STICK, 1.0, 0.0)
    # A node sticks if no facet of any rank lets it slip.
    sum_of_moves = space.function()
    of_node = sum_of_moves.x.array.reshape(-1, space.d)
    np.add.at(of_node, side.nodes[side.owned], moves[..., None])
    sum_over_ranks(sum_of_moves)
    return of_node == 0.0


def _check_law(material: Any, before: Any) -> None:
    """Check that a potential remembers in the next step what it did in the last step.

    Raises:
        InputError: If its state has other entries.
    """
    state, state_before = (dict(getattr(law, "state", {})) for law in (material, before))
    if state != state_before:
        raise InputError(
            f"The material of the scene has the state {state or 'none'}, and the material of the "
            f"scene of after {state_before or 'none'}. All scenes of a history have the same law."
        )
