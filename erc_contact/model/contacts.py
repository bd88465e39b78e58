"""The contacts of a scene on a mesh: gap, normal of the foundation and friction bound as UFL."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact, Friction, bind_friction
from erc_contact.model.last_step import LastStep
from erc_contact.model.space import Space
from erc_contact.model.trace import Trace
from erc_contact.model.values import components, number, parameter
from erc_contact.scene.contact import Contact

FLAT = 1e-8
"""Largest deviation of the facet normals of a contact that counts as flat [-]."""


def bind_contact(
    space: Space, contact: Contact, modulus: Any, last: LastStep | None = None
) -> BoundContact:
    """A contact on a mesh; collective.

    Args:
        space: The mesh.
        contact: What the scene declares.
        modulus: The modulus of the material [force/area], UFL.
        last: The last step of a history, or None without history.

    Raises:
        InputError: If gap, normal or friction are no numbers, or cannot be worked with,
            or the last step was one of another body.
    """
    facets, what = space.domain.facets(contact.facets), f"Contact({contact.facets!r})"
    surface = _true_surface(space, contact)
    gap = None if contact.gap == 0 else number(space, contact.gap, f"{what}: gap", surface)
    if callable(contact.gap):
        values = evaluate(gap, space.mesh, space.facet_points, facets)
        if not np.isfinite(space.extremes(values)).all():
            raise InputError(f"{what}: the gap is not finite everywhere; look at it.")
    normal, direction, given_normal = _normal(space, contact, facets, surface)
    friction = _friction(space, contact, facets)
    before, lost = (
        (None, None)
        if last is None or friction is None
        else last.on(space, contact.facets, direction)
    )
    return BoundContact(
        name=contact.facets,
        trace=Trace(space.side(facets, modulus), direction, before),
        ds=space.ds(space.domain.tag(contact.facets)),
        normal=normal,
        given_normal=given_normal,
        friction=friction,
        gap=gap,
        gap_varies=callable(contact.gap),
        bilateral=contact.bilateral,
        lost=lost,
    )


def _friction(space: Space, contact: Contact, facets: np.ndarray) -> Friction | None:
    law, what = contact.law, f"Contact({contact.facets!r})"
    if law is None:
        return None
    parameters = {}
    for name in law.parameters:
        value = parameter(law, name)
        parameters[name] = number(space, value, f"{what}: {name}")
        if callable(value):
            low, high = space.extremes(
                evaluate(parameters[name], space.mesh, space.facet_points, facets)
            )
            if not 0 <= low <= high < np.inf:
                raise InputError(
                    f"{what}: {name} is {low:g} somewhere; it must be >= 0 and finite."
                )
    return bind_friction(space.mesh, f"{what}: the friction bound", law, parameters)


def _true_surface(space: Space, contact: Contact) -> Any:
    """The position at which gap and normal are taken, UFL.

    It is the nearest point of the true surface where that is known: at the flat facets
    they would be wrong by O(h^2).
    """
    varies = callable(contact.gap) or callable(contact.normal)
    return space.x if not varies or space.domain.offset is None else space.x + space.domain.offset


def _normal(
    space: Space, contact: Contact, facets: np.ndarray, surface: Any
) -> tuple[Any, np.ndarray, Any]:
    """The normal of the foundation in three ways: as UFL, on each facet (f, d), and as the scene gives it.

    The last one has any length; it is None where the normal does not vary.
    """
    centre = np.full((1, space.d - 1), 1.0 / space.d)
    if contact.normal is None:
        normals = evaluate(space.n, space.mesh, centre, facets)[:, 0]
        first = next(
            n for n in space.comm.allgather(normals[0] if len(normals) else None) if n is not None
        )
        error = None
        if len(normals) and abs(normals - first).max() > FLAT:
            error = InputError(
                f"Contact({contact.facets!r}): the boundary part is not flat; give the normal of the foundation, "
                f"e.g. normal={(0.0, -1.0) if space.d == 2 else (0.0, 0.0, -1.0)}, and the gap along it."
            )
        raise_together(space.comm, error)
        direction = first + 0.0
    elif isinstance(contact.normal, tuple):
        direction = np.array(contact.normal)
    else:
        return _varying_normal(space, contact, facets, centre, surface)
    return (
        compiled.constant(space.mesh, direction),
        np.broadcast_to(direction, (len(facets), space.d)),
        None,
    )


def _varying_normal(
    space: Space, contact: Contact, facets: np.ndarray, centre: np.ndarray, surface: Any
) -> tuple[Any, np.ndarray, Any]:
    """A normal that varies, in the three ways of :func:`_normal`.

    Each cell at the contact has one normal, the mean of the normals at the middles of
    its contact facets.
    """
    what = f"Contact({contact.facets!r})"
    if contact.normal == "gap":
        gap = number(space, contact.gap, f"{what}: gap")
        with method_caches_off():
            slope = ufl.algorithms.expand_derivatives(-ufl.grad(gap))
        expression = ufl.replace(slope, {space.x: surface})
    else:
        expression = components(space, contact.normal, f"{what}: normal", surface)
    given = evaluate(expression, space.mesh, centre, facets)[:, 0]
    length = np.linalg.norm(given, axis=1)
    error = None
    if not (np.isfinite(length).all() and np.all(length > 0)):
        error = InputError(
            f"{what}: the normal is zero or not finite at the middle of a facet; look at "
            f"{'the gap' if contact.normal == 'gap' else 'its callable'}."
        )
    raise_together(space.comm, error)
    function = space.domain.function("DG", 0, (space.d,))
    of_cell = function.x.array.reshape(-1, space.d)
    np.add.at(of_cell, facets[:, 0], given / length[:, None])
    direction = of_cell[facets[:, 0]]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    of_cell[facets[:, 0]] = direction
    return function, direction, expression
