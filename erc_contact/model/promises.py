"""Checks of the properties of a scene that the bound of the error needs, made when the scene meets its mesh.

The bound needs that

- the compliance of the material inverts its stiffness, which is symmetric and positive
  definite,
- a friction bound is concave in the pressure and never decreases; in a bilateral
  contact it is independent of it,
- the normals of foundations point out of the body.

Data without these properties would give numbers that look right and are wrong. All
checks are numerical, at samples. They have the same result on all ranks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.simplex import barycentric, rule
from erc_contact.model.expressions import Everywhere, evaluate
from erc_contact.model.foundation import BoundContact
from erc_contact.model.last_step import LastStep
from erc_contact.model.model import Model
from erc_contact.scene.material import Elastic
from erc_contact.scene.scene import Scene

EXACT = 1e-8
"""Relative difference that counts as none [-]."""
AWAY = -0.1
"""Least cosine of the angle between the normal of the foundation and that of a facet in contact [-]."""
DECADES = 12
"""A law is tried with pressures from the modulus down to this many powers of ten below it, and with 0."""
LAW_SAMPLES = 50
"""Greatest number of values of the parameters with which a law is tried on each rank, beside their extremes."""


def bind(scene: Scene, domain: Domain, degree: int = 1, last: LastStep | None = None) -> Model:
    """A scene on a mesh, after all checks; collective.

    Args:
        scene: What the user declared.
        domain: The mesh with names.
        degree: Degree of the displacement, 1 or 2.
        last: The last step of a history, or None without history.

    Raises:
        InputError: If scene and mesh do not fit, a check fails, or the last step was
            one of another body.
        NotHeldError: If neither supports nor contacts hold a rigid motion.
    """
    model = Model(scene, domain, degree, last)
    if type(model.scene.material) is not Elastic:
        _check_material(model)
    for contact in model.contacts:
        _check_data(model, contact)
        _check_normal(model, contact)
        if contact.friction is not None:
            _check_law(model, contact)
    _check_supports_in_gap(model)
    return model


def _check_material(model: Model) -> None:
    """Check a material of the user's: the stiffness is symmetric and positive definite, and its modulus is > 0.

    The compliance must invert the stiffness.
    """
    name = type(model.scene.material).__name__
    points, owned = rule(model.d, 4)[0], model.owned_cells

    x = np.matmul(barycentric(points), model.cell_corners()[owned])
    C, S = (
        matrix(x, owned).reshape(-1, matrix.size, matrix.size)
        for matrix in (model.elasticity, model.compliance)
    )
    modulus = evaluate(model.modulus, model.mesh, points, owned)
    finite = np.isfinite(C).all() and np.isfinite(S).all() and np.isfinite(modulus).all()
    least, skew, other = np.inf, 0.0, 0.0
    if finite and len(C):
        eigenvalues = np.linalg.eigvalsh(0.5 * (C + C.swapaxes(1, 2)))
        least = float((eigenvalues[:, 0] / abs(eigenvalues).max(axis=1)).min())
        skew = float((abs(C - C.swapaxes(1, 2)).max(axis=(1, 2)) / abs(C).max(axis=(1, 2))).max())
        condition = 1 / max(least, np.finfo(float).tiny)
        unit = np.matmul(C, S) - np.eye(C.shape[1])
        other = float(abs(unit).max()) if condition < 1e300 else 0.0
        other -= 16 * np.finfo(float).eps * min(condition, 1e300)  # what round-off explains
    low = float(modulus.min(initial=np.inf)) if finite else 0.0
    finite = model.comm.allreduce(bool(finite), MPI.LAND)
    least, low = (model.comm.allreduce(v, MPI.MIN) for v in (least, low))
    skew, other = (model.comm.allreduce(v, MPI.MAX) for v in (skew, other))
    if not finite:
        raise InputError(
            f"{name}: stress, compliance or modulus is not finite somewhere; look at its parameters."
        )
    if skew > EXACT:
        raise InputError(
            f"{name}: the stiffness is not symmetric, in orthonormal (Mandel) components by {skew:.1e} of its largest "
            "entry: a : C b must be b : C a for all strains a and b, else there is no energy. Look at its stress."
        )
    if least <= 0.0:
        raise InputError(
            f"{name}: the stiffness is not positive definite: some strain has an energy of {least:.1e} times that of "
            "another. Look at its stress and at its parameters."
        )
    if other > EXACT:
        raise InputError(
            f"{name}: the compliance does not invert the stress: compliance(stress(eps)) differs from eps by up to "
            f"{other:.1e} times it. The error would be that of another material; mend one of the two."
        )
    if not low > 0.0:
        raise InputError(f"{name}: modulus is {low:g} somewhere; it must be > 0 [force/area].")


def _check_data(model: Model, contact: BoundContact) -> None:
    """Check gap and parameters of the law between the nodes: they are finite, and the parameters are >= 0."""
    what = f"Contact({contact.name!r})"
    x = np.matmul(barycentric(model.facet_samples), contact.trace.here.corners)
    for name, value in (contact.friction.parameters if contact.friction else {}).items():
        values = Everywhere(value, model.mesh)(x, contact.facets)
        local = float(np.where(values < np.inf, values, -np.inf).min(initial=np.inf))
        low = model.comm.allreduce(local, MPI.MIN)
        if low < 0.0:
            raise InputError(f"{what}: {name} is {low:g} somewhere; it must be >= 0 and finite.")
    if contact.gap is not None:
        finite = bool(np.isfinite(Everywhere(contact.gap, model.mesh)(x, contact.facets)).all())
        if not model.comm.allreduce(finite, MPI.LAND):
            raise InputError(f"{what}: the gap is not finite everywhere; look at it.")


def _check_normal(model: Model, contact: BoundContact) -> None:
    """Check that the normal of the foundation points out of the body."""
    facets, comm = contact.facets, model.comm
    middle = np.full((1, model.d - 1), 1 / model.d)
    outward = evaluate(model.n, model.mesh, middle, facets)[:, 0]
    cosine = (outward * contact.direction).sum(axis=1)
    area = contact.trace.here.owned_areas
    total, whole = comm.allreduce(np.array([area @ cosine, area.sum()]), MPI.SUM)
    mine: Any = (np.inf, (), ())
    if len(facets):
        worst = int(cosine.argmin())
        place = model.facet_corners(facets)[worst].mean(axis=0)
        mine = (
            float(cosine[worst]),
            tuple(place.tolist()),
            tuple(contact.direction[worst].tolist()),
        )
    least, place, direction = min(comm.allgather(mine))
    steepest = comm.allreduce(float(abs(cosine).max(initial=0.0)), MPI.MAX)
    given = next(one for one in model.scene.contacts if one.facets == contact.name)
    if given.normal == "gap" and steepest < EXACT:
        flat = "(0.0, -1.0)" if model.d == 2 else "(0.0, 0.0, -1.0)"
        raise InputError(
            f'Contact({contact.name!r}): normal="gap" needs a gap that is the distance to the foundation, also off the '
            "part, and this one does not change across the part: it is a height over it. Give the normal in numbers, "
            f"e.g. normal={flat}, or none on a flat part; or the distance, e.g. gap=lambda x: x[{model.d - 1}] + "
            "(the height that you gave)."
        )
    if least < AWAY or total <= 0.0:
        at, normal = (", ".join(f"{v:.3g}" for v in vector) for vector in (place, direction))
        raise InputError(
            f"Contact({contact.name!r}): the normal of the foundation must point from the body into the foundation. At "
            f"({at}) it is ({normal}), and the cosine of its angle with the outward normal of the body is {least:.2g}, "
            f"its mean over the part {total / whole:.2g}. Change the sign of the normal (or of the gap that gives it), "
            "or leave facets that look away from the foundation out of the part."
        )


def _check_law(model: Model, contact: BoundContact) -> None:
    """Check a law: its bound is finite, >= 0 and concave in the pressure, and never decreases.

    In a bilateral contact it does not depend on the pressure.
    """
    law = contact.friction.law if contact.friction else None
    what = f"Contact({contact.name!r}): the friction bound of {type(law).__name__}"
    modulus = model.stiffest()
    pressure = np.concatenate([[0.0], modulus * np.logspace(-DECADES, 0, 4 * DECADES + 1)])
    at = model.facet_samples
    parameters = {
        name: values.ravel() for name, values in model.friction_parameters(contact, at).items()
    }
    count = len(contact.facets) * len(at)
    some = np.linspace(0, max(count - 1, 0), min(count, LAW_SAMPLES)).astype(int)
    extremes = [
        pick() for values in parameters.values() if count for pick in (values.argmin, values.argmax)
    ]
    some = np.unique(np.concatenate([some, np.array(extremes, dtype=int)]))
    tried = {name: values[some][:, None] + 0.0 * pressure for name, values in parameters.items()}
    bound = contact.friction_bound(np.broadcast_to(pressure, (len(some), len(pressure))), tried)

    def refuse(wrong: np.ndarray, message: str) -> None:
        """Raise on all ranks if an entry of one rank is wrong; the last axis is that of the pressures."""
        example = None
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            example = ", ".join(
                f"b({p:.3g}) = {b:.3g}"
                for p, b in zip(pressure[j : j + 3], bound[i, j : j + 3], strict=True)
            )
        found = [one for one in model.comm.allgather(example) if one]
        if found:
            raise InputError(f"{what} {message} {found[0]}.")

    refuse(
        ~np.isfinite(bound),
        "is not finite everywhere; it must be a number for every pressure p >= 0:",
    )
    refuse(bound < 0.0, "is negative somewhere; it must be >= 0:")
    size = EXACT * np.maximum(bound[:, 1:], bound[:, :-1])
    if contact.bilateral:
        refuse(
            abs(np.diff(bound, axis=1)) > size,
            "depends on the pressure, and the contact is bilateral: it can pull, the tractions that it allows are no "
            "convex set, and no error can be certified. Give a bound without pressure, e.g. Tresca(limit):",
        )
    refuse(np.diff(bound, axis=1) < -size, "decreases with the pressure; it must not:")
    share = (pressure[1:-1] - pressure[:-2]) / (pressure[2:] - pressure[:-2])
    chord = bound[:, :-2] + share * (bound[:, 2:] - bound[:, :-2])
    refuse(
        bound[:, 1:-1] < chord - size[:, 1:],
        "is not concave in the pressure: the tractions that it allows are no convex set, and no error can be "
        "certified. It must lie above its chords:",
    )


def _check_supports_in_gap(model: Model) -> None:
    """Check that supports do not push a contact into its foundation."""
    values = model.prescribed.x.array.reshape(-1, model.d)
    for contact in model.contacts:
        nodes = contact.trace.here.nodes
        gap = model.gap_at_nodes(contact)
        n = contact.direction[:, None, :]
        known = (model.fixed[nodes] | (abs(n) < 1e-12)).all(axis=-1)
        beyond = (values[nodes] * n).sum(axis=-1) - gap
        excess = np.where(known, abs(beyond) if contact.bilateral else beyond, -np.inf).max(
            initial=-np.inf
        )
        worst = model.comm.allreduce(float(excess), MPI.MAX)
        largest = model.comm.allreduce(float(abs(values).max(initial=0)), MPI.MAX)
        if worst > max(1e-12 * model.domain.extent, 1e-9 * largest):
            raise InputError(
                f"A support pushes {contact.name!r} into the foundation by {worst:g} [length] beyond the gap; "
                "no displacement is admissible. Change the support or the gap."
            )
