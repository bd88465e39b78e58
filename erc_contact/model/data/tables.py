"""Put tables of a scene on a mesh.

A table is evaluated by numpy wherever numbers are needed: by the reconstruction, by the
error and by pictures. In the forms of the solver it is a Function of degree 2 in each
cell. The error bounds any state of the solver, so it does not matter that this Function
rounds off kinks. Only of moduli the solver and the reconstruction must know the same:
there the Function has the values of the table at the points of quadrature. A table of
the pressure, in the formula of a friction law, is written out piece by piece.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from ufl.corealg.traversal import traverse_unique_terminals, unique_post_traversal

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_tables import TableData, TableFunction, TableValue, has_tables
from erc_contact.base.ufl_types import Ufl
from namedmesh.simplex import rule

FUNCTION_DEGREE = (0, 2, 2, 3)
"""Degree of the Functions that stand for tables, for each d.

Polynomials of this degree can have any values at the points of :data:`SHARED_RULE`.
"""
SHARED_RULE = 4
"""Degree of the quadrature that solver and reconstruction share for moduli."""

MOST_HINGES = 50
"""Greatest number of points of a table that is written out.

FFCx takes 0.15 s for each, once.
"""

Evaluate = Callable[[Ufl, dmesh.Mesh, np.ndarray, np.ndarray], np.ndarray]
"""A function that evaluates UFL at reference points of cells, as shape (n, q, *s)."""


def on_mesh(
    expression: Ufl, mesh: dmesh.Mesh, evaluate: Evaluate, *, of_material: bool = False
) -> Ufl:
    """Replace the tables in a UFL expression by Functions; collective.

    Args:
        expression: UFL without derivatives of tables.
        mesh: The mesh.
        evaluate: The function that evaluates coordinates of tables.
        of_material: Whether the values at the points of quadrature matter, else those
            on the boundary of the cells do.
    """

    def on_cells(coordinates: list[Ufl], data: TableData) -> Ufl:
        function = _function(ufl.as_vector(coordinates), data, mesh)
        _fill(function, mesh, evaluate, of_material=of_material)
        return function

    return _without_tables(expression, on_cells)


def write_out(expression: Ufl) -> Ufl:
    """Replace the tables in a UFL expression by sums of their pieces.

    It is for tables of what varies with the solution, as the pressure in a friction
    law, which no Function on the mesh can stand for.

    Raises:
        InputError: If a table has two coordinates, or too many points.
    """
    return _without_tables(expression, _sum_of_hinges)


def _without_tables(expression: Ufl, instead: Callable[[list[Ufl], TableData], Ufl]) -> Ufl:
    """Replace each table by what is made of its coordinates and its data, UFL."""
    if not has_tables(expression):
        return expression
    replaced: dict[Ufl, Ufl] = {}
    # An inner table, as in a table of a table, comes before the outer one.
    for node in unique_post_traversal(expression):
        if isinstance(node, TableValue):
            coordinates = [ufl.replace(entry, replaced) for entry in node.coordinates]
            replaced[node] = instead(coordinates, node.data)
    return ufl.replace(expression, replaced)


def _sum_of_hinges(coordinates: list[Ufl], data: TableData) -> Ufl:
    """Write a table as its first value and a hinge at each point, UFL."""
    points = data.source.kinks[0]
    if len(coordinates) > 1 or len(points) > MOST_HINGES or data.slope is not None:
        raise InputError(
            f"A table in the formula of a law has one coordinate and at most {MOST_HINGES} points;"
            " take fewer points, or make a table of the position a parameter of the law."
        )
    place = coordinates[0]
    values = data.source.interpolated(points[:, None])
    # Beyond its ends a table keeps the value at the end.
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(points), [0.0]])
    terms: list[Ufl] = [ufl.as_ufl(float(values[0]))]
    for point, turn in zip(points.tolist(), np.diff(slopes).tolist(), strict=True):
        if turn != 0.0:
            terms.append(turn * ufl.max_value(place - point, 0.0))
    # Sums of neighbours: a sum term by term would nest too deeply for UFL.
    while len(terms) > 1:
        halves = [sum(terms[i : i + 2]) for i in range(0, len(terms), 2)]
        terms = halves
    return terms[0]


def _function(coordinates: Ufl, data: TableData, mesh: dmesh.Mesh) -> TableFunction:
    """Make the Function of a table."""
    for terminal in traverse_unique_terminals(coordinates):
        if isinstance(terminal, ufl.classes.FacetNormal):
            raise InputError("A table takes coordinates that do not depend on the normal.")
    degree = FUNCTION_DEGREE[mesh.geometry.dim]
    function: Any = TableFunction(fem.functionspace(mesh, ("DG", degree)))
    function.coordinates = coordinates
    function.data = data
    return function


def _fill(
    function: TableFunction, mesh: dmesh.Mesh, evaluate: Evaluate, *, of_material: bool
) -> None:
    """Compute the nodal values of the Function of a table."""
    element = function.function_space.element
    cells = function.function_space.dofmap.list
    of_cells = np.arange(len(cells), dtype=np.int32)

    def values_at(points: np.ndarray) -> np.ndarray:
        return function.at(evaluate(function.coordinates, mesh, points, of_cells))

    nodal = values_at(element.interpolation_points)
    if of_material:
        # The least change of nodal values that gives those at the points of quadrature.
        points, _ = rule(mesh.geometry.dim, SHARED_RULE)
        shapes = element.basix_element.tabulate(0, points)[0, :, :, 0]
        missing = values_at(points) - nodal @ shapes.T
        nodal = nodal + missing @ np.linalg.pinv(shapes).T
    function.x.array[cells] = nodal
