"""Check the properties of a scene that the bound of the error needs, on its mesh.

The bound needs that

- the compliance of the material inverts its stiffness, which is symmetric and positive
  definite,
- a friction bound is concave in the pressure and never decreases; in a bilateral
  contact it is independent of it,
- the normals of contacts point out of the body.

Data without these properties would give numbers that look right and are wrong. All
checks are numerical, at samples. They have the same result on all ranks.
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.contact_values import friction_parameters, gap_at_nodes
from erc_contact.model.contact.contacts import bind_contact
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.last_step import LastStep
from erc_contact.model.model import Model
from erc_contact.model.potential_check import check_potential
from erc_contact.model.space import Space
from erc_contact.scene.material import Elastic
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base.percent import place_words
from namedmesh.base.ranks import greatest
from namedmesh.simplex import rule

EXACT_PROMISE = 1e-8
"""Relative difference that counts as none [-]."""
LEAST_COSINE = -0.1
"""Least cosine of the angle between the normals of a contact and of a facet [-]."""
EXACT_BOUND = 1e-8
"""Relative difference of friction bounds that counts as none [-]."""
DECADES = 12
"""Number of powers of ten below the modulus of the pressures that try a law.

It is also tried with the pressure 0.
"""
LAW_SAMPLES = 50
"""Greatest number of places at which a law is tried on each rank.

The places with the extreme values of its parameters are added.
"""


def bind(scene: Scene, domain: Domain, degree: int = 1, last: LastStep | None = None) -> Model:
    """Put a scene on a mesh and check it; collective.

    Args:
        scene: What the user declared.
        domain: The mesh with names.
        degree: Degree of the displacement, 1 or 2.
        last: The last step of a history, or None without history.

    Raises:
        InputError: If scene and mesh do not fit, a check fails, or the last step was
            one of another body.
        NotHeldError: If loads are not in balance on a rigid motion that nothing holds.
    """
    model = Model(scene, domain, degree, last)
    if model.linearised is not None:
        check_potential(model)
    elif type(model.scene.material) is not Elastic:
        _check_material(model)
    for contact in model.contacts:
        _check_data(model.space, contact)
        _check_normal(model, contact)
        if contact.friction is not None:
            check_law(model, contact)
    _check_supports_in_gap(model)
    return model


def bind_nearby(scene: Scene, near: Model) -> Model:
    """Put a moved scene on a mesh, and check what is new; collective.

    The model shares with the other one what is the same.

    Args:
        scene: A scene with other loads, values of supports, shifts of preloads, given
            strains, or contacts. A contact is the object of ``near``, unless something
            has moved in it.
        near: The model of the scene that it is moved from.

    Raises:
        InputError: If supports contradict each other, a load cannot be worked with, or
            a check fails.
        NotHeldError: If loads are not in balance on a motion that nothing holds.
    """
    model = copy(near)
    model.scene = scene
    model.bind_supports_and_loads(scene)
    if scene.ties != near.scene.ties or scene.strains != near.scene.strains:
        model.bind_strains(scene)
    model.contacts = []
    entries = zip(scene.contacts, near.scene.contacts, near.contacts, strict=True)
    for entry, near_entry, contact in entries:
        # Forms with the contact of the other model serve this one, too.
        is_same = entry is near_entry
        model.contacts.append(
            contact if is_same else bind_contact(model.space, entry, model.modulus)
        )
    model.anchor()
    model.bind_connections()
    for contact, contact_before in zip(model.contacts, near.contacts, strict=True):
        if contact is not contact_before:
            _check_data(model.space, contact)
            if contact.friction is not None:
                check_law(model, contact)
    _check_supports_in_gap(model)
    return model


def _check_material(model: Model) -> None:
    """Check a material of the user's at samples; collective.

    The stiffness must be symmetric and positive definite, the compliance its inverse,
    and the modulus > 0.
    """
    space = model.space
    name = type(model.scene.material).__name__
    points, _ = rule(space.d, 4)
    cells = space.owned_cells
    x = space.cell_points(points, cells)
    law = model.constitution
    size = law.stiffness.size
    C = law.stiffness(x, cells).reshape(-1, size, size)
    S = law.metric(x, cells).reshape(-1, size, size)
    modulus = space.evaluate(model.modulus, points, cells)
    finite = np.isfinite(C).all() and np.isfinite(S).all() and np.isfinite(modulus).all()
    least, skew, misfit = np.inf, 0.0, 0.0
    if finite and len(C):
        least, skew, misfit = _defects(C, S)
    lowest = float(modulus.min(initial=np.inf)) if finite else 0.0
    comm = space.comm
    finite = comm.allreduce(bool(finite), MPI.LAND)
    least = comm.allreduce(least, MPI.MIN)
    lowest = comm.allreduce(lowest, MPI.MIN)
    skew = comm.allreduce(skew, MPI.MAX)
    misfit = comm.allreduce(misfit, MPI.MAX)
    if not finite:
        raise InputError(
            f"{name}: stress, compliance or modulus is not finite somewhere;"
            " look at its parameters."
        )
    if skew > EXACT_PROMISE:
        raise InputError(
            f"{name}: the stiffness is not symmetric, in orthonormal (Mandel) components by"
            f" {skew:.1e} of its largest entry: a : C b must be b : C a for all strains a and b,"
            " else there is no energy. Look at its stress."
        )
    if least <= 0.0:
        raise InputError(
            f"{name}: the stiffness is not positive definite: some strain has an energy of"
            f" {least:.1e} times the energy of another. Look at its stress and at its parameters."
        )
    if misfit > EXACT_PROMISE:
        raise InputError(
            f"{name}: the compliance does not invert the stress: compliance(stress(eps)) differs"
            f" from eps by up to {misfit:.1e} times it. The error would be the error of another"
            " material; mend one of the two."
        )
    if not lowest > 0.0:
        raise InputError(f"{name}: modulus is {lowest:g} somewhere; it must be > 0 [force/area].")


def _defects(C: np.ndarray, S: np.ndarray) -> tuple[float, float, float]:
    """Measure what is wrong with matrices of stiffness and compliance.

    Args:
        C: Stiffness in Mandel components, shape (n, s, s).
        S: Compliance.

    Returns:
        The least eigenvalue over the greatest absolute one, the greatest difference
        from the transpose over the largest entry, and the greatest entry of
        ``C S - 1`` beyond round-off, all for the worst matrix.
    """
    transposed = C.swapaxes(1, 2)
    eigenvalues = np.linalg.eigvalsh(0.5 * (C + transposed))
    least = float((eigenvalues[:, 0] / abs(eigenvalues).max(axis=1)).min())
    skew = float((abs(C - transposed).max(axis=(1, 2)) / abs(C).max(axis=(1, 2))).max())
    # An ill-conditioned matrix cannot be inverted to more digits than its condition
    # leaves: that much is round-off.
    condition = 1 / max(least, np.finfo(float).tiny)
    unit = np.matmul(C, S) - np.eye(C.shape[1])
    misfit = float(abs(unit).max()) if condition < 1e300 else 0.0
    misfit -= 16 * np.finfo(float).eps * min(condition, 1e300)
    return least, skew, misfit


def _check_data(space: Space, contact: ContactOnMesh) -> None:
    """Check gap and parameters of the law between the nodes; collective.

    They must be finite, and the parameters >= 0.
    """
    what = f"Contact({contact.name!r})"
    x = contact.trace.here.points_at(space.facet_samples)
    parameters = contact.friction.parameters if contact.friction else {}
    for name, value in parameters.items():
        values = space.everywhere(value)(x, contact.facets)
        # An infinite or undefined value counts as negative: both are refused.
        local = float(np.where(values < np.inf, values, -np.inf).min(initial=np.inf))
        low = space.comm.allreduce(local, MPI.MIN)
        if low < 0.0:
            raise InputError(f"{what}: {name} is {low:g} somewhere; it must be >= 0 and finite.")
    stiffnesses = {"normal": contact.stiffness, "tangential": contact.tangential_stiffness}
    for name, of_foundation in stiffnesses.items():
        if of_foundation is None:
            continue
        stiffness = space.everywhere(of_foundation)(x, contact.facets)
        # Per length of a meridian it is zero on the axis.
        stiffness = stiffness[~space.section.on_axis(x)]
        local = float(np.where(stiffness < np.inf, stiffness, -np.inf).min(initial=np.inf))
        low = space.comm.allreduce(local, MPI.MIN)
        if not low > 0.0:
            raise InputError(
                f"{what}: the {name} stiffness of the foundation is {low:g} somewhere; it must be"
                " > 0 and finite [force/length^3]."
            )
    if contact.gap is not None:
        gap = space.everywhere(contact.gap)(x, contact.facets)
        finite = bool(np.isfinite(gap).all())
        if not space.comm.allreduce(finite, MPI.LAND):
            raise InputError(f"{what}: the gap is not finite everywhere; look at it.")


def _check_normal(model: Model, contact: ContactOnMesh) -> None:
    """Check that the normal of a contact points out of the body; collective."""
    space = model.space
    foundation = "the foundation" if contact.against is None else repr(contact.against)
    facets = contact.facets
    comm = space.comm
    outward = space.outward_normals(facets)
    cosine = (outward * contact.direction).sum(axis=1)
    area = contact.trace.here.owned_areas
    total, whole = comm.allreduce(np.array([area @ cosine, area.sum()]), MPI.SUM)
    # The worst facet of all ranks, with its place and its normal for the message.
    worst_of_rank: Any = (np.inf, (), ())
    if len(facets):
        worst = int(cosine.argmin())
        place = space.facet_corners(facets)[worst].mean(axis=0)
        direction = contact.sign * contact.direction[worst]
        worst_of_rank = float(cosine[worst]), tuple(place.tolist()), tuple(direction.tolist())
    least, place, direction = min(comm.allgather(worst_of_rank))
    steepest = greatest(comm, cosine)
    declared = [entry for entry in model.scene.contacts if entry.facets == contact.name]
    if declared[0].normal == "gap" and steepest < EXACT_PROMISE:
        flat = "(0.0, -1.0)" if space.d == 2 else "(0.0, 0.0, -1.0)"
        raise InputError(
            f'Contact({contact.name!r}): normal="gap" needs a gap that is the distance to'
            f" {foundation}, also off the part, and this one does not change across the part: it"
            f" is a height over it. Give the normal in numbers, e.g. normal={flat}, or none on a"
            f" flat part; or the distance, e.g. gap=lambda x: x[{space.d - 1}] + (the height"
            " that you gave)."
        )
    if least < LEAST_COSINE or total <= 0.0:
        raise InputError(
            f"Contact({contact.name!r}): the normal must point from the body into"
            f" {foundation}. At {place_words(place, 3)} it is"
            f" {place_words(direction, 3)}, and the cosine of its angle with the outward normal"
            f" of the body is {least:.2g}, its mean over the part {total / whole:.2g}. Change the"
            " sign of the normal (or of the gap that gives it), or leave facets that look away"
            f" from {foundation} out of the part."
        )


def _check_supports_in_gap(model: Model) -> None:
    """Check that supports do not push a contact into what it touches; collective.

    Nor may a gap be below zero where a contact ends inside a body, without a jump.
    """
    space = model.space
    values = model.prescribed.x.array
    for contact in model.contacts:
        if contact.stiffness is not None:
            continue  # the foundation is compliant
        trace = contact.trace
        gap = gap_at_nodes(space, contact)
        n = contact.trace.normals
        # The normal displacement is prescribed where supports fix all its components.
        prescribed = (trace.fixed(model.fixed) | (abs(n) < 1e-12)).all(axis=-1)
        _check_ends(space, contact, gap)
        beyond = (trace.of(values) * n).sum(axis=-1) - gap
        if contact.bilateral:
            beyond = abs(beyond)
        excess = np.where(prescribed, beyond, -np.inf).max(initial=-np.inf)
        worst = space.comm.allreduce(float(excess), MPI.MAX)
        largest = greatest(space.comm, values)
        if worst > max(1e-12 * model.domain.extent, 1e-9 * largest):
            pushed = f"A support pushes {contact.name!r} into the foundation"
            if contact.against is not None:
                pushed = f"Supports push {contact.name!r} into {contact.against!r}"
            raise InputError(
                f"{pushed} by {worst:g} [length] beyond the gap; no displacement is admissible."
                " Change the support or the gap."
            )


def _check_ends(space: Space, contact: ContactOnMesh, gap: np.ndarray) -> None:
    """Check the gap where a contact ends inside a body, as a crack does; collective.

    Both sides have one point there, so the jump is zero.

    Args:
        space: The mesh.
        contact: The contact.
        gap: Its gap at the nodes [length], shape (f, m).
    """
    trace = contact.trace
    at_end = gap[trace.here.nodes == trace.nodes_there]
    overlap = abs(at_end) if contact.bilateral else -at_end
    worst = space.comm.allreduce(float(overlap.max(initial=-np.inf)), MPI.MAX)
    if worst > 1e-12 * space.domain.extent:
        raise InputError(
            f"{contact.title} ends inside a body, where both sides are one point, and has a gap of "
            f"{-worst:g} [length] there; no displacement is admissible. Let an interference go to "
            "zero there."
        )


def check_law(model: Model, contact: ContactOnMesh) -> None:
    """Check a law at samples: its bound is finite, >= 0, concave and never decreases.

    In a bilateral contact it does not depend on the pressure. Collective.
    """
    law = contact.friction.law if contact.friction else None
    what = f"Contact({contact.name!r}): the friction bound of {type(law).__name__}"
    pressure = model.stiffest() * np.logspace(-DECADES, 0, 4 * DECADES + 1)
    pressure = np.concatenate([[0.0], pressure])
    bound = _sample_bound(model.space, contact, pressure)

    def refuse(wrong: np.ndarray, message: str) -> None:
        """Raise on all ranks if an entry of one rank is wrong.

        The last axis of ``wrong`` counts the pressures.
        """
        example = None
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            pairs = zip(pressure[j : j + 3], bound[i, j : j + 3], strict=True)
            example = ", ".join(f"b({p:.3g}) = {b:.3g}" for p, b in pairs)
        examples = [text for text in model.space.comm.allgather(example) if text]
        if examples:
            raise InputError(f"{what} {message} {examples[0]}.")

    refuse(
        ~np.isfinite(bound),
        "is not finite everywhere; it must be a number for every pressure p >= 0:",
    )
    refuse(bound < 0.0, "is negative somewhere; it must be >= 0:")
    change = np.diff(bound, axis=1)
    round_off = EXACT_BOUND * np.maximum(bound[:, 1:], bound[:, :-1])
    if contact.bilateral:
        refuse(
            abs(change) > round_off,
            "depends on the pressure, and the contact is bilateral: it can pull, the tractions"
            " that it allows are no convex set, and no error can be certified. Give a bound"
            " without pressure, e.g. Tresca(limit):",
        )
    refuse(change < -round_off, "decreases with the pressure; it must not:")
    # A concave bound lies above the chord between any two of its neighbours.
    share = (pressure[1:-1] - pressure[:-2]) / (pressure[2:] - pressure[:-2])
    chord = bound[:, :-2] + share * (bound[:, 2:] - bound[:, :-2])
    refuse(
        bound[:, 1:-1] < chord - round_off[:, 1:],
        "is not concave in the pressure: the tractions that it allows are no convex set, and no"
        " error can be certified. It must lie above its chords:",
    )


def _sample_bound(space: Space, contact: ContactOnMesh, pressure: np.ndarray) -> np.ndarray:
    """Evaluate the friction bound of a contact at sampled places, for all pressures.

    The places are spread evenly over the samples of the facets of this rank, and those
    with an extreme value of a parameter are added.

    Args:
        space: The mesh.
        contact: The contact, with friction.
        pressure: Pressures [force/area], shape (p,).

    Returns:
        The bound [force/area], shape (places, p).
    """
    points = space.facet_samples
    parameters = {}
    for name, values in friction_parameters(space, contact, points).items():
        parameters[name] = values.ravel()
    count = len(contact.facets) * len(points)
    places = list(np.linspace(0, max(count - 1, 0), min(count, LAW_SAMPLES)).astype(int))
    if count:
        for values in parameters.values():
            places += [values.argmin(), values.argmax()]
    chosen = np.unique(np.array(places, dtype=int))
    # Each place gets all pressures.
    shape = (len(chosen), len(pressure))
    sampled = {}
    for name, values in parameters.items():
        sampled[name] = values[chosen][:, None] + 0.0 * pressure
    return contact.friction_bound(np.broadcast_to(pressure, shape), sampled)
