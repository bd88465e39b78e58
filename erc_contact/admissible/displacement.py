"""Displacements that do not enter the foundation, with the status of the traction.

The status is open, slip or stick. The displacement is outside the foundation at every
point, not only at nodes: if the Bernstein coefficients of a normal displacement are
below the coefficients of a bound, the displacement is below the bound
(:mod:`erc_contact.admissible.limits`). Between two bodies this is said of the jump.

A compliant foundation may be entered, and its surface moves tangentially. There the
displacement is set to where it lowers the error most.

Symbols: n normal of the foundation, r^ admissible contact traction, g gap, u^
displacement, s tangential displacement at the end of the last step of a history (zero
without), m number of coefficients of a facet, which belong to its nodes.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.below import excess_over_gap, gap_limits
from erc_contact.admissible.limits import Limits, limits_of
from erc_contact.admissible.periodic import PeriodicFit
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.model import Model
from erc_contact.model.space import OnFacets, Space

CORNER_PASSES = 100
"""Limit of the passes over nodes with several normals."""
TURNING_PASSES = 20
"""Limit of the passes over facets along which normals turn; one is usual.

Beside a support that holds a node it takes several.
"""
SETTLED_EXCESS = 1e-15
"""Excess over a limit that ends the passes, over the largest displacement [-]."""


def admissible_displacement(
    model: Model, u: fem.Function, tractions: list[ContactTraction]
) -> fem.Function:
    """Limit the displacement u by the gap, and set it to the status of r^; collective.

    The status is set where this lowers the error. The contact part of e^2 is of first
    order in ``g - u_n`` where r^_n < 0, and in ``u_t - s`` where r^_t is inside the
    cone or does not oppose it. The bulk part is of second order in a change of u^. So a
    node is set to ``u_n = g``, or to ``u_t = s``, if this lowers the contact part by
    more than it may raise the bulk part. The contact part changes by ``2 sum |F|/m
    (...)`` over the facets of the node, the bulk part by about ``E h^(d-2)`` times the
    square of the change. (If r^ had to be strictly inside the cone on all facets of a
    node instead, nodes at the stick-slip transition would slip along the traction.)

    Args:
        model: The scene on a mesh.
        u: Displacement of the solution [length].
        tractions: r^ on each contact.

    Returns:
        u^ [length].
    """
    space = model.space
    u_hat = space.function()
    u_hat.name = "displacement"
    u_hat.x.array[:] = u.x.array
    values = u_hat.x.array.reshape(-1, space.d)
    # Contacts with common nodes are set one after the other: by their names, so that
    # their order in the scene changes nothing.
    tractions = sorted(tractions, key=lambda traction: traction.contact.side_names[0])
    contacts = [traction.contact for traction in tractions]
    # Limits of Bernstein coefficients hold between the nodes, too.
    sides: list[OnFacets] = list(contacts)
    sides += [contact.trace.there for contact in contacts]
    space.to_coefficients(values, sides)
    free = ~model.fixed
    periodic = [contact for contact in contacts if contact.is_periodic]
    fits = [PeriodicFit(space, periodic, ~model.supported)] if periodic else []
    # Nothing is chosen at the sides of copies, whose jump is given.
    tractions = [traction for traction in tractions if not traction.contact.is_periodic]
    gaps = [gap_limits(model, traction.contact, values) for traction in tractions]
    limits = [limits_of(model, *pair) for pair in zip(tractions, gaps, strict=True)]
    for traction, limit in zip(tractions, limits, strict=True):
        _set_status(model, values, free, traction, limit)
    excess = _limit_normal(values, free, tractions, limits, fits)
    for traction, limit in zip(tractions, limits, strict=True):
        if traction.contact.trace.corner_normals is not None:
            _limit_between_nodes(space, u_hat, free, traction.contact, limit, fits)
    space.to_coefficients(values, sides, back=True)
    for fit in fits:
        fit(values)
    u_hat.x.scatter_forward()
    for fit in fits:
        fit.check(values, excess)
    return u_hat


def _set_status(
    model: Model,
    values: np.ndarray,
    free: np.ndarray,
    traction: ContactTraction,
    limit: Limits,
) -> None:
    """Close and stick the nodes of a contact where this lowers the error, in place.

    Args:
        model: The scene on a mesh.
        values: Coefficients of u^ [length], shape (nodes, d).
        free: Components that no support fixes, shape (nodes, d).
        traction: r^ on the contact.
        limit: Its limits.
    """
    space = model.space
    # The contact part of e^2 is a sum of these forces times displacements.
    weight = 2 * traction.area[:, None] / traction.nodes.shape[1]
    closing = limit.sum_up(-weight * traction.normal_component)
    contact = traction.contact
    springs = _foundation_stiffness(space, traction, limit, contact.stiffness)
    tangential_springs = _foundation_stiffness(space, traction, limit, contact.tangential_stiffness)
    friction = limit.sum_up(weight * traction.friction_bound)
    tangential = weight[..., None] * traction.tangential_part
    by_component = [limit.sum_up(tangential[..., i]) for i in range(space.d)]
    shear = np.column_stack(by_component)
    stiffness = _nodal_stiffness(model, traction)[limit.nodes]
    before = _slip_before(traction, limit)
    for group in limit.groups:
        n = limit.normal[group]
        open_by = limit.bound[group] - limit.normal_displacement(values, group)
        if springs is None:
            closes = closing[group] * open_by > stiffness[group] * open_by**2
            closed = group[closes | contact.bilateral]
            _move_normal(values, free, limit, closed, limit.bound[closed])
        else:
            entry = _best_entry(-open_by, closing[group], stiffness[group], springs[group])
            _move_normal(values, free, limit, group, limit.bound[group] + entry)
        _, slip, _ = split(limit.jump(values, group) - before[group], n)
        of_group = shear[group], friction[group], stiffness[group]
        if tangential_springs is None:
            work = contact.friction_set.support(slip[:, None], n[:, None], limit.facet[group])[:, 0]
            gain = friction[group] * work + (shear[group] * slip).sum(axis=1)
            sticks = gain > stiffness[group] * (slip**2).sum(axis=1)
            change = np.where(sticks[:, None], -slip, 0.0)
        else:
            change = _best_slide(slip, *of_group, tangential_springs[group]) - slip
        limit.move(values, free, group, np.where(limit.mobile(free, group), change, 0.0))


def _limit_normal(
    values: np.ndarray,
    free: np.ndarray,
    tractions: list[ContactTraction],
    limits: list[Limits],
    fits: list[PeriodicFit],
) -> float:
    """Lower normal displacements to their limits, in place; return what is left of it.

    A node with several normals needs several passes, because a move along one of them
    changes the displacement along the others, and so does a node of periodic sides.
    """
    has_corners = len(tractions) > 1 or any(len(limit.groups) > 1 for limit in limits)
    has_corners = has_corners or bool(fits)
    for _ in range(CORNER_PASSES):
        worst = max([fit(values) for fit in fits], default=0.0)
        for traction, limit in zip(tractions, limits, strict=True):
            if traction.contact.stiffness is not None:
                continue  # a compliant foundation limits nothing
            for group in limit.groups:
                excess = limit.normal_displacement(values, group) - limit.bound[group]
                violated = abs(excess) > 0 if traction.contact.bilateral else excess > 0
                worst = max(worst, float(abs(excess[violated]).max(initial=0.0)))
                beyond = group[violated]
                _move_normal(values, free, limit, beyond, limit.bound[beyond])
        if not has_corners or worst <= SETTLED_EXCESS * abs(values).max(initial=0.0):
            break
    return worst


def _limit_between_nodes(
    space: Space,
    u_hat: fem.Function,
    free: np.ndarray,
    contact: ContactOnMesh,
    limit: Limits,
    fits: list[PeriodicFit],
) -> None:
    """Lower u_n where it exceeds the gap between nodes, in place; collective.

    Normals that turn along a facet make ``u_n`` there no polynomial. All nodes of a
    facet are lowered by the greatest excess on it: of second order in the turning and
    in the change of the slip along the facet, and none for a rigid motion.

    Args:
        space: The mesh.
        u_hat: u^ by coefficients on the contacts [length].
        free: Components that no support fixes, shape (nodes, d).
        contact: A contact whose normals turn.
        limit: Its limits.
        fits: What makes u^ fit across periodic sides.
    """
    if contact.bilateral or contact.stiffness is not None:
        return
    trace = contact.trace
    values = u_hat.x.array.reshape(-1, space.d)
    corners = trace.normals_at_vertices
    least_cosine = np.einsum("fid,fjd->fij", corners, corners).min(axis=(1, 2), initial=1.0)
    for _ in range(TURNING_PASSES):
        # A rank does not see all facets at the nodes of others.
        u_hat.x.scatter_forward()
        excess = excess_over_gap(space, contact, trace.of(values))
        if not space.comm.allreduce(bool(excess.any()), MPI.LOR):
            break
        lower = np.zeros(len(limit.nodes))
        of_facets = np.broadcast_to((excess / least_cosine)[:, None], limit.of_facet.shape)
        np.maximum.at(lower, limit.of_facet, of_facets)
        for group in limit.groups:
            above = group[lower[group] > 0]
            w_n = limit.normal_displacement(values, above) - lower[above]
            _move_normal(values, free, limit, above, w_n)
        for fit in fits:
            fit(values)


def _best_entry(
    entry: np.ndarray, closing: np.ndarray, stiffness: np.ndarray, springs: np.ndarray
) -> np.ndarray:
    """Return by how far nodes should enter a compliant foundation [length].

    A change of the entry d at a node raises the bulk part of e^2 by about k_b times its
    square, and the contact part of e^2 is ``k_f <d>_+^2 - c d`` and a constant. The
    least sum is at ``d + c/(2 k_b)`` if that is open, else ``k_b/(k_b + k_f)`` times
    that. So a rigid foundation is not entered, and a soft one where u enters it.

    Args:
        entry: d of u [length], below zero where it is open.
        closing: c, twice the force of the pressure at the node [force].
        stiffness: k_b, stiffness of the body at the node [force/length].
        springs: k_f, share of the node in the foundation [force/length].
    """
    pressed = entry + closing / (2 * stiffness)
    share = np.where(pressed > 0, stiffness / (stiffness + springs), 1.0)
    return share * pressed


def _best_slide(
    slide: np.ndarray,
    shear: np.ndarray,
    friction: np.ndarray,
    stiffness: np.ndarray,
    springs: np.ndarray,
) -> np.ndarray:
    """Return the best tangential displacements on a compliant foundation [length].

    They are ``z = u_t - s`` at nodes. A change of z raises the bulk part of e^2 by
    about k_b times its square. The contact part is ``c.z + k_f |z|^2`` and a constant
    up to ``k_f |z| = c_b/2``, and ``c.z + c_b |z|`` and a constant beyond. The least
    sum has the direction of ``y = z - c/(2 k_b)``, and the length
    ``k_b/(k_b + k_f) |y|`` where it sticks and ``|y| - c_b/(2 k_b)`` where it slips,
    which is the longer one.

    Args:
        slide: z of u [length], shape (c, d).
        shear: c, twice the force of the shear at the node [force], shape (c, d).
        friction: c_b, twice the force of the friction bound [force], shape (c,).
        stiffness: k_b [force/length], shape (c,).
        springs: k_f [force/length], shape (c,).
    """
    best = slide - shear / (2 * stiffness[:, None])
    length = np.linalg.norm(best, axis=1)
    slips = length - friction / (2 * stiffness)
    sticks = stiffness / (stiffness + springs) * length
    longer = np.maximum(slips, sticks)
    share = np.divide(longer, length, out=np.zeros_like(length), where=length > 0)
    return share[:, None] * best


def _move_normal(
    values: np.ndarray, free: np.ndarray, limit: Limits, group: np.ndarray, w_n: np.ndarray
) -> None:
    """Set the normal displacement to w_n at the limits of a group, in place.

    Only components change that no support fixes.
    """
    n = limit.normal[group]
    direction = limit.mobile(free, group) * n
    reach = (direction * n).sum(axis=1)
    missing = w_n - limit.normal_displacement(values, group)
    # Where supports fix all of the normal component, nothing can move.
    length = np.divide(missing, reach, out=np.zeros_like(reach), where=reach > 1e-12)
    limit.move(values, free, group, length[:, None] * direction)


def _slip_before(traction: ContactTraction, limit: Limits) -> np.ndarray:
    """Return the tangential displacement of the last step at each limit [length].

    It is given by coefficients, shape (c, d).
    """
    of_facets = traction.contact.trace.coefficients(traction.contact.trace.slip_before)
    before = np.zeros(limit.normal.shape)
    before[limit.of_facet] = of_facets
    return before


def _foundation_stiffness(
    space: Space, traction: ContactTraction, limit: Limits, stiffness: Ufl | None
) -> np.ndarray | None:
    """Return the share of each limit in a stiffness of the foundation [force/length].

    None where it is rigid, else shape (c,); collective.
    """
    if stiffness is None:
        return None
    facets = traction.contact.facets
    at_nodes = space.evaluate(stiffness, space.facet_points, facets)
    share = traction.area[:, None] / traction.nodes.shape[1]
    return limit.sum_up(share * at_nodes)


def _nodal_stiffness(model: Model, traction: ContactTraction) -> np.ndarray:
    """Estimate the stiffness of a node, ``E h^(d-2)`` on the contact [force/length].

    It is 0 elsewhere; shape (nodes,).
    """
    of_facet = traction.contact.trace.stiffness * traction.area  # E/h h^(d-1)
    stiffness = np.zeros(len(model.fixed))
    np.maximum.at(stiffness, traction.nodes, of_facet[:, None])
    return stiffness
