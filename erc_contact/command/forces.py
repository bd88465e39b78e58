"""Bound forces of supports, contacts and bolts, and find them in files of results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.fields import sides_of
from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.interval import interval
from erc_contact.error.numbers import Bounds
from erc_contact.output.bounded_forces import (
    ROUND_OFF,
    BoundedForce,
    axes_of,
    bounded_forces,
    contact_names,
)
from erc_contact.scene.goal import BoltForce, Resultant
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh.base.ranks import of_all
from namedmesh.for_solvers import SAME_PLACE, FieldInCells, FileField, closest
from namedmesh.simplex import measures, of_facets, rule

DEGREE = 6
"""Degree of the products of shape functions of second order and a linear body force."""


def narrowly_bounded(error: ConstitutiveError) -> list[BoundedForce]:
    """Bound the forces of supports and contacts, all that matter; collective.

    :func:`erc_contact.interval` solves the scene some more times for each component.
    """
    contacts = contact_names(error)
    supports = [support.facets for support in error.solution.scene.supports]

    def bounds_of(error: ConstitutiveError, name: str, direction: tuple[float, ...]) -> Bounds:
        try:
            return interval(error, Resultant(name, direction))
        except (InputError, NotConverged):
            # A contact has an interval of lower order, which needs no further solution.
            if name in contacts:
                return resultant(error, name, direction)
            raise

    return bounded_forces(error, [*supports, *contacts], bounds_of)


def bolt_forces(error: ConstitutiveError, scene: Scene) -> list[BoundedForce]:
    """Bound the forces of bolts with the shifts of a result; collective.

    Args:
        error: The error of the result, whose scene has the shifts.
        scene: The scene that prescribes the forces of some bolts.
    """
    rows = []
    for tie in scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            try:
                bounds, why = interval(error, BoltForce(tie.facets)), ""
            except (InputError, NotConverged) as reason:
                bounds, why = None, str(reason)
            rows.append(BoundedForce(tie.facets, "bolt", tie.force, bounds, why))
    return rows


def with_forces_of(
    rows: Sequence[BoundedForce],
    error: ConstitutiveError,
    field: FileField,
    thickness: float,
) -> list[BoundedForce]:
    """Return forces with the components that a file has; collective.

    A file lists reactions and loads of nodes together. What body forces are at the
    nodes is taken from them. Where a node of a support has another load, too, or any
    other node has a force, the force of a part is not known. Of a body of revolution
    they are forces on the whole circle, of which the axial ones are reactions; radial
    ones have the hoop stress of its section, too.

    Args:
        rows: The forces.
        error: The error of the result.
        field: The result.
        thickness: Thickness of the plane body of the file [length], else 1.
    """
    known = _forces_in_file(error, field, thickness)
    letters = axes_of(error)
    result = []
    for row in rows:
        force = None if row.axis == "r" else known.get(row.part)
        computed = None if force is None else float(force[letters.index(row.axis)]) / thickness
        result.append(replace(row, computed=computed))
    return result


def _forces_in_file(
    error: ConstitutiveError, field: FileField, thickness: float
) -> dict[str, np.ndarray]:
    """Sum the forces on the nodes of supports that a file has; collective."""
    scene = error.solution.scene
    # CalculiX may write a plane body as a layer in 3D, whose forces are of other cells.
    is_layer = field.x.shape[1] != error.domain.dim
    if field.forces is None or is_layer:
        return {}
    of_body = thickness * _body_loads(error, field)
    on_nodes = field.forces - of_body
    supports = {support.facets for support in scene.supports}
    loads = {load.facets for load in scene.loads if load.facets is not None}
    x = field.x[: len(field.forces)]
    on = {name: _is_on_part(error, name, x) for name in sorted(supports | loads)}
    count = np.zeros(len(x), dtype=np.int64)
    for is_on in on.values():
        count += is_on
    of_reactions = slice(1, None) if error.model.space.axisymmetric else slice(None)
    size = abs(on_nodes[:, of_reactions]).max(axis=1)
    largest = max(size.max(initial=0.0), abs(of_body).max(initial=0.0))
    has_force = size > ROUND_OFF * largest
    if (has_force & (count == 0)).any():
        return {}
    forces = {}
    for name in supports:
        if (count[on[name]] == 1).all():
            forces[name] = on_nodes[on[name]].sum(axis=0)
    return forces


def _body_loads(error: ConstitutiveError, field: FileField) -> np.ndarray:
    """Return the forces that body forces are at the nodes of a file; collective.

    They are integrated in the cells of the error, whose points lie in the cells of the
    file.
    """
    model = error.model
    space = model.space
    if model.body_force is None:
        return np.zeros(field.values.shape)
    points, weights = rule(space.d, DEGREE)
    cells = space.owned_cells
    x = space.cell_points(points, cells)
    volumes = measures(space.cell_corners()[cells])[:, None] * weights
    # Of rings the density has the circumference.
    density = space.everywhere(model.body_force)(x, cells)
    inside = FieldInCells(field, None, SAME_PLACE * error.domain.extent)
    places = inside.places(x.reshape(-1, space.d))
    local = inside.nodal_forces(places, (volumes[..., None] * density).reshape(-1, space.d))
    return np.asarray(space.comm.allreduce(local, MPI.SUM))


def _is_on_part(error: ConstitutiveError, name: str, x: np.ndarray) -> np.ndarray:
    """Tell which points (n, 3) lie on a part, the same on all ranks; collective."""
    space = error.model.space
    sides = sides_of(error.model, name)
    corners = of_facets(space.cell_corners()[sides[:, 0]], sides[:, 1])
    (every,) = of_all(space.comm, corners)
    return np.asarray(closest(x, every).distance <= SAME_PLACE * error.domain.extent)
