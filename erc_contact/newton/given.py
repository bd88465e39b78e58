"""Make a solution of a displacement that another solver has computed.

Its contact tractions follow from its reactions: what the elastic equations of the
package leave at the nodes of the contacts, as for the augmented Lagrangian
(:mod:`erc_contact.newton.reactions`). Where the displacement solves a contact problem
on the mesh by elements of the same degree, these are the tractions of that problem,
whatever contact method it had.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, together
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.files import values_of_file
from erc_contact.model.given_forces import stressed_sides
from erc_contact.model.model import Model
from erc_contact.model.promises import bind, bind_nearby
from erc_contact.model.space import Space
from erc_contact.newton.arguments import check_arguments
from erc_contact.newton.given_forces import with_jumps_of, with_shifts
from erc_contact.newton.linear.choice import multigrid_is_faster
from erc_contact.newton.linear.loose_multigrid import multigrid_of
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.methods import AugmentedLagrangian, Nitsche
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import SAME_PLACE, FieldOnMesh

LARGEST = 1e100
"""Greatest displacement over the size of the body whose energy is a number [-]."""
REASON = "given displacement"
type AnyField = fem.Function | Callable[[np.ndarray], Any] | tuple[Any, Any] | FieldOnMesh
"""A Function, a callable of points, points with values, or what a file has."""


def solution_of(
    scene: Scene,
    domain: Domain,
    u: AnyField,
    degree: int | None = None,
    traction: Mapping[str, AnyField] | None = None,
) -> tuple[Solution, fem.Function]:
    """Make a solution of a displacement; collective.

    Args:
        scene: The problem.
        domain: The mesh.
        u: The displacement, see :func:`erc_contact.certify`.
        degree: Its degree, 1 or 2; None takes the degree of u.
        traction: Tractions by the names of contacts, which take the place of tractions
            from the reactions.

    Returns:
        The solution, which keeps the supports, and u as it is given.

    Raises:
        InputError: If u does not fit the mesh, or is not finite.
    """
    began = perf_counter()
    comm = domain.comm
    degree = together(comm, _degree, scene, domain, u, degree)
    model = bind(with_shifts(scene, {}), domain, degree)
    displacement = model.space.function()
    given_u = model.space.function()
    given_u.x.array[:] = together(comm, _values, model, u).ravel()
    given_u.x.scatter_forward()
    values = given_u.x.array
    finite = comm.allreduce(bool(np.isfinite(values).all()), MPI.LAND)
    if not finite:
        raise InputError("certify: the displacement is not finite everywhere.")
    largest = greatest(comm, values)
    if largest > LARGEST * domain.extent:
        raise InputError(
            f"certify: the displacement is up to {largest:.3g}, in a body of the size "
            f"{domain.extent:.3g}. It must be below {LARGEST:g} times that; look at its units, or "
            "whether its solver has failed."
        )
    if stressed_sides(scene.contacts):
        # Any jump of periodic sides is admissible, too.
        model = bind_nearby(with_jumps_of(scene, model, given_u), model)
    for face in model.loose_faces:
        # Any motion of the face is admissible: here it is the motion that u has.
        face.follow(model.prescribed, values.reshape(-1, model.space.d))
    displacement.x.array[:] = np.where(model.supported.ravel(), model.prescribed.x.array, values)
    displacement.x.scatter_forward()

    given = together(comm, given_multipliers, model, traction or {})
    elastic = multigrid_of(model) if multigrid_is_faster(model) else stiffness_of(model)
    multipliers = list(_multipliers(model, elastic, displacement))
    for number, contact in enumerate(model.contacts):
        if contact.name in given:
            multipliers[number] = given[contact.name]
    solution = Solution(
        model=model,
        method=AugmentedLagrangian(),
        u=displacement,
        multipliers=tuple(multipliers),
        reason=REASON,
        stiffness=elastic,
        seconds=comm.allreduce(perf_counter() - began, MPI.MAX),
    )
    return solution, given_u


def with_nitsche_tractions(solution: Solution) -> Solution | None:
    """Return a given solution with the tractions of Nitsche's method.

    They are the tractions of its stress, with a penalty on what violates the contact.
    None where it has these already, or has no contact.
    """
    if not solution.model.contacts or not solution.method.multiplier:
        return None
    return replace(solution, method=Nitsche(), multipliers=())


def _degree(scene: Scene, domain: Domain, u: AnyField, degree: int | None) -> int:
    """Return the degree of a displacement, and check the other arguments."""
    if degree is None:
        degree = 1
        if isinstance(u, fem.Function):
            degree = u.function_space.element.basix_element.degree
        elif isinstance(u, FieldOnMesh):
            degree = u.field.degree
        elif isinstance(u, tuple) and len(u) == 2 and len(u[0]) > domain.vertices:
            degree = 2
    check_arguments(scene, domain, None, degree, "auto")
    return degree


def _values(model: Model, u: AnyField) -> np.ndarray:
    """Return the displacement at the nodes of this rank [length], shape (nodes, d)."""
    space = model.space
    if isinstance(u, FieldOnMesh):
        return values_of_file(model, u)
    if isinstance(u, tuple) and space.domain.pairs:
        raise InputError(
            "certify: at a contact between bodies two nodes lie at one place, so that points do"
            " not tell them apart; give the file of the results, or a Function of domain.mesh."
        )
    nodes = np.arange(len(space.V.tabulate_dof_coordinates()))
    return nodal_values(space, u, nodes, "certify: u")


def _multipliers(model: Model, elastic: Any, u: fem.Function) -> tuple[fem.Function, ...]:
    """Return the multipliers of the reactions of a displacement [force/area]."""
    if not model.contacts:
        return ()
    matrix = elastic.stiffness()
    loads = elastic.right_side(elastic.load_vector(), supports=True)
    residual = loads.duplicate()
    x = elastic.vector(u)
    matrix.mult(x, residual)
    residual.axpy(-1.0, loads)
    reactions = Reactions(model)
    work = loads.duplicate()
    multipliers = []
    for contact, of_contact in zip(model.contacts, reactions.matrices, strict=True):
        of_contact.mult(residual, work)
        multiplier = elastic.function(work)
        nodal = multiplier.x.array.reshape(-1, model.space.d)
        model.space.to_coefficients(nodal, [contact], back=True)
        multipliers.append(multiplier)
    reactions.destroy()
    for done in (matrix, loads, residual, x, work):
        done.destroy()
    return tuple(multipliers)


def given_multipliers(model: Model, traction: Mapping[str, AnyField]) -> dict[str, fem.Function]:
    """Return given tractions as Functions [force/area], by the names of contacts.

    Args:
        model: The scene on a mesh.
        traction: Tractions on the parts that contacts are named after.

    Raises:
        InputError: If no contact has a name, or values do not fit the nodes.
    """
    if not isinstance(traction, Mapping):
        raise InputError(
            f"certify: traction is {checks.description(traction)}; give a mapping from the names of"
            " contacts, e.g. {'bottom': (points, values)}."
        )
    multipliers = {}
    names = {contact.name for contact in model.contacts}
    for name, values in traction.items():
        if name not in names:
            known = ", ".join(sorted(names)) or "none"
            raise InputError(f"certify: traction is for {name!r}; the contacts are {known}.")
        contact = model.contact(name)
        multiplier = model.space.function()
        nodal = multiplier.x.array.reshape(-1, model.space.d)
        nodes = np.unique(contact.trace.here.nodes)
        nodal[nodes] = contact.sign * _at_nodes(model.space, contact, nodes, values)
        if not np.isfinite(nodal).all():
            raise InputError(f"certify: the traction on {name!r} is not finite everywhere.")
        multipliers[name] = multiplier
    return multipliers


def _at_nodes(
    space: Space, contact: ContactOnMesh, nodes: np.ndarray, traction: AnyField
) -> np.ndarray:
    """Return a traction at nodes of this side of a contact, (nodes, d)."""
    what = f"certify: the traction on {contact.name!r}"
    # A Function is read at the nodes of this side, which is the softer body's.
    if isinstance(traction, fem.Function) and contact.is_exchanged:
        raise InputError(
            f"{what} is a Function, and must be the traction on the softer body; give a "
            "callable of points, or (points, values)."
        )
    return nodal_values(space, traction, nodes, what)


def nodal_values(space: Space, field: AnyField, nodes: np.ndarray, what: str) -> np.ndarray:
    """Return a vector field at nodes of this rank, shape (n, d).

    Args:
        space: The mesh.
        field: A Function of the mesh; or a callable, which gets points of shape (d, n)
            and returns the same shape; or points (m, d) and values (m, d).
        nodes: Numbers of the nodes, shape (n,).
        what: The field in words, for messages.

    Raises:
        InputError: If the field does not fit the mesh or its dimension.
    """
    if isinstance(field, fem.Function):
        return _of_function(space, field, what)[nodes]
    x = space.V.tabulate_dof_coordinates()[nodes, : space.d]
    if callable(field):
        return _of_callable(field, x, what)
    if not isinstance(field, tuple) or len(field) != 2:
        raise InputError(
            f"{what} is {checks.description(field)}; give a Function of the mesh, a callable of"
            " points, or (points, values)."
        )
    points, values = (np.asarray(array, dtype=float) for array in field)
    return _of_points(points, values, x, SAME_PLACE * space.domain.extent, what)


def _of_function(space: Space, field: fem.Function, what: str) -> np.ndarray:
    """Return the values of a Function at all nodes of this rank, shape (nodes, d)."""
    if field.function_space.mesh is not space.mesh:
        raise InputError(
            f"{what} lives on another mesh than domain.mesh; compute it on domain.mesh, or give"
            " (points, values)."
        )
    if field.function_space.element.value_shape != (space.d,):
        raise InputError(f"{what} must have {space.d} components.")
    same = space.function()
    same.interpolate(field)
    return same.x.array.reshape(-1, space.d)


def _of_callable(field: Callable[[np.ndarray], Any], x: np.ndarray, what: str) -> np.ndarray:
    """Return the values of a callable at points x of shape (n, d), shape (n, d)."""
    n, d = x.shape
    try:
        values = np.asarray(field(x.T.copy()), dtype=float).T
    except Exception as reason:
        raise InputError(
            f"{what} failed with {type(reason).__name__}: {reason}. It gets points of shape"
            f" ({d}, n), arrays of NumPy, and returns the same shape."
        ) from reason
    if values.shape != (n, d):
        raise InputError(
            f"{what} has the shape {values.T.shape} for points of shape {(d, n)}; return {d}"
            " rows, a component each."
        )
    return values


def _of_points(
    points: np.ndarray, values: np.ndarray, x: np.ndarray, tolerance: float, what: str
) -> np.ndarray:
    """Return the values of the points at which x of shape (n, d) lie, shape (n, d)."""
    n, d = x.shape
    is_table = points.ndim == values.ndim == 2 and 0 < len(points) == len(values)
    if not is_table or min(points.shape[1], values.shape[1]) < d:
        raise InputError(
            f"{what}: points and values have the shapes {points.shape} and {values.shape}; give"
            f" (n, {d}) of both."
        )
    if not np.isfinite(points).all():
        raise InputError(f"{what}: points have coordinates that are not finite; leave them out.")
    if n == 0:
        return np.empty((0, d))
    return _values_at(points, values, _nearest(x, points[:, :d]), x, tolerance, what)


def _nearest(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the number of the nearest point of each node."""
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for points only

    return np.asarray(cKDTree(points).query(nodes)[1])


def _values_at(
    points: np.ndarray,
    values: np.ndarray,
    place: np.ndarray,
    x: np.ndarray,
    tolerance: float,
    what: str,
) -> np.ndarray:
    """Return the values of the points that were found for nodes x, shape (n, d).

    Raises:
        InputError: If a point is farther from its node than the tolerance [length].
    """
    n, d = x.shape
    distance = np.linalg.norm(points[place, :d] - x, axis=1)
    apart = distance > tolerance
    if apart.any():
        first = tuple(x[apart][0].tolist())
        raise InputError(
            f"{what}: {int(apart.sum())} of {n} nodes have no point, the first is {first},"
            f" {distance[apart][0]:.1e} from the nearest; give the values at all nodes, for degree"
            " 2 also at the middles of edges."
        )
    return values[place, :d]
