"""Turn a mesh level of a run into the tables of a file, and a file into the level.

The file opens in ParaView as it is: body, displacement, eps_E, stresses (in single
precision, nothing else needs them), as in ``body.vtkhdf``. Beside that it holds the
tables of :mod:`namedmesh.tables` by the same numbers of nodes, and plain data. A
level is restored without a contact solve: its admissible pair and its error follow from
the displacement and the multipliers.

Symbols: d dimension, n number of nodes, c number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.equilibrate import equilibrate
from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.model.promises import bind
from erc_contact.model.space import Space
from erc_contact.newton.after import last_step
from erc_contact.newton.given_forces import shifts_in, with_locked_shifts, with_shifts
from erc_contact.newton.linear.loose_multigrid import multigrid_of
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.output.gathered import body_nodes, nodal_displacement
from erc_contact.results.stresses import cell_stresses
from erc_contact.run.contents import ERROR_NUMBERS
from erc_contact.run.step import Step
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base.ranks import gather_rows
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import Geometry
from namedmesh.keeping import CellRows, Contents, about_mesh, drawn_tables, mesh_of, tag_tables

STATE = {
    "newton_steps": "newton_steps",
    "reason": "reason",
    "remaining": "distance",
    "regularity": "least_singular_value",
    "seconds": "seconds",
}
"""Name in the file -> attribute of a solution, for what is kept beside its fields."""
MESH = ("degree", "names", "regions", "geometry", "tags", "interfaces", "periodic")
"""What a level tells of its mesh beside the tables."""
TABLES = ("VTKHDF/Points", "cells", "facets", "regions", "curved", "glued", "closed")
"""The tables of a mesh."""
ABOUT = "linearised about"
"""Name of the displacement about which a potential was linearised."""
SAME_ERROR = 2e-3
"""Difference of eps that round-off explains, over eps [-].

The mesh is read in another order. In hundreds of iterations that tighten a stress, near
incompressibility, conjugate gradients let round-off grow to a thousandth of e.
"""
SAME_SQUARE = 1e-14
"""Difference of eps^2 that round-off explains [-].

Of a potential eps^2 is a difference of energies.
"""


def level_of(error: ConstitutiveError, steps: Sequence[Any]) -> Contents:
    """Pack an error and the rows of the run so far for a file; collective.

    The tables are on rank 0.

    Raises:
        InputError: If the true shape of the domain cannot be kept.
    """
    solution = error.solution
    domain = error.domain
    model = solution.model
    space = model.space
    comm = space.comm
    x = space.V.tabulate_dof_coordinates()
    # nodes at vertices have the coordinates of these to the last digit
    x[space.vertices] = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)]
    u = _pick_owned(error, solution.u)
    at_nodes = {}
    for number, multiplier in enumerate(solution.multipliers):
        at_nodes[f"multipliers/{number}"] = _pick_owned(error, multiplier)
    if model.linearised is not None and not model.linearised.at_rest:
        at_nodes[ABOUT] = _pick_owned(error, model.linearised.u)
    tags = tag_tables(domain)
    mesh = about_mesh(domain, tags)
    cells = space.global_numbers(space.nodes[: domain.owned_cells])
    u_hat = nodal_displacement(error.admissible)
    points = gather_rows(comm, points=x[: len(u)], u=u, displacement=u_hat, **at_nodes)
    rows = gather_rows(comm, cells=cells, drawn=body_nodes(space)["cells"], **tags)
    stresses = cell_stresses(error.admissible)
    single = {name: values.astype(np.float32) for name, values in stresses.items()}
    in_cells = gather_rows(comm, **single, eps_E=error.indicators)
    about = {
        "rows": [asdict(step) for step in steps],
        "degree": space.degree,
        **mesh,
        "multipliers": len(solution.multipliers),
        ABOUT: ABOUT in at_nodes,
        "method": repr(solution.method),
        "iterative": solution.stiffness.iterative,
        "solution": {name: getattr(solution, attribute) for name, attribute in STATE.items()},
        "shifts": shifts_in(solution.scene),
        "error": {name: getattr(error, name) for name in ERROR_NUMBERS},
    }
    if not rows:  # not on rank 0
        return Contents(about, {})
    tables = drawn_tables(points.pop("points"), rows.pop("drawn"), domain.dim)
    tables["VTKHDF/PointData/displacement"] = points.pop("displacement")
    for name, values in in_cells.items():
        tables[f"VTKHDF/CellData/{name}"] = values
    return Contents(about, tables | points | rows)


def _pick_owned(error: ConstitutiveError, function: fem.Function) -> np.ndarray:
    """Return the values of a function at the nodes of this rank, shape (n, d)."""
    owned = function.function_space.dofmap.index_map.size_local
    return function.x.array.reshape(-1, error.domain.dim)[:owned]


class Restored:
    """Restore a level that is read; all members are collective.

    Args:
        comm: Communicator that shares the mesh.
        level: What the file holds; tables are needed on rank 0 only.
        before: Another level of the run, whose domain this one shares if their meshes
            are the same.
        shape: The true shape; None takes what the level keeps of it.

    Attributes:
        domain: The mesh with names.
        indicators: eps_E of the owned cells [-].
    """

    def __init__(
        self,
        comm: MPI.Comm,
        level: Contents,
        before: Restored | None = None,
        shape: Geometry | None = None,
    ) -> None:
        self.about = level.about
        self._tables = level.tables
        if before is not None and comm.bcast(_same_mesh(level, before)):
            self._rows: CellRows = before._rows
            self.domain: Domain = before.domain
        else:
            self._rows, self.domain = mesh_of(comm, level, shape)
        indicators = self._rows.of_cells(self._table("VTKHDF/CellData/eps_E"))
        self.indicators = indicators[: self.domain.owned_cells]

    @property
    def steps(self) -> tuple[Step, ...]:
        """Return the rows of the run up to this level.

        Raises:
            InputError: If they are rows of a loading history.
        """
        if "time" in self.about["rows"][-1]:
            raise InputError(
                "The folder holds a loading history: call evolve(..., checkpoint=folder) "
                "as for the run."
            )
        return tuple(Step(**row) for row in self.about["rows"])

    @property
    def accuracy(self) -> float:
        """Return the prescribed relative error of the run [-]."""
        return float(self.about["accuracy"])

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the error, by their names."""
        return dict(self.about["error"])

    def error(
        self, scene: Scene, methods: Sequence[Method], tighten: int, after: Solution | None = None
    ) -> ConstitutiveError:
        """Measure the error of this level anew, without a contact solve.

        Args:
            scene: The problem.
            methods: The methods that it can be the solution of.
            tighten: As in :func:`equilibrate`.
            after: The solution of the last step of a history, or None.

        Raises:
            InputError: If it is not the error that was written.
        """
        solution = self._solution(scene, methods, after)
        error = constitutive_error(equilibrate(solution, tighten=tighten))
        written = self.about["error"]["relative"]
        differs = abs(error.relative**2 - written**2)
        if differs > 2 * SAME_ERROR * written**2 + SAME_SQUARE:
            raise InputError(
                f"The error of the mesh of {self.domain.cells} cells is {error.relative:.10g}, "
                f"in the folder {written:.10g}: the software is not the one that wrote it. "
                "Take that, or another folder."
            )
        # the seconds are taken from the run that was kept
        seconds = self.about["rows"][-1]["equilibrate_seconds"]
        return replace(error, admissible=replace(error.admissible, seconds=seconds))

    def _solution(
        self, scene: Scene, methods: Sequence[Method], after: Solution | None
    ) -> Solution:
        """Return the solution from its displacement and multipliers; collective."""
        about = self.about
        last = None if after is None else last_step(after)
        # Forces of preloads have become shifts; older files have none.
        scene = with_locked_shifts(with_shifts(scene, about.get("shifts", {})), after)
        model = bind(scene, self.domain, about["degree"], last)
        u = self._function(model.space, "u")
        if about.get(ABOUT, False):
            assert model.linearised is not None
            model.linearised.move(self._function(model.space, ABOUT))
        multipliers = []
        for number in range(about["multipliers"]):
            multipliers.append(self._function(model.space, f"multipliers/{number}"))
        method = methods[0]
        for candidate in methods:
            if repr(candidate) == about["method"]:
                method = candidate
                break
        stiffness = multigrid_of(model) if about["iterative"] else stiffness_of(model)
        numbers = {attribute: about["solution"][name] for name, attribute in STATE.items()}
        return Solution(model, method, u, tuple(multipliers), stiffness=stiffness, **numbers)

    def _table(self, name: str) -> np.ndarray | None:
        """Return a table of the level on rank 0; None on the other ranks."""
        return self._tables.get(name)

    def _function(self, space: Space, name: str) -> fem.Function:
        """Return a vector field from the table of its values; collective."""
        function = space.function()
        values = self._rows.of_nodes(self._table(name), self._table("cells"), space.degree)
        function.x.array.reshape(-1, space.d)[space.nodes] = values
        return function


def _same_mesh(level: Contents, before: Restored) -> bool:
    """Compare the meshes of two levels with their names; only rank 0 can tell."""
    if any(level.about.get(name) != before.about.get(name) for name in MESH):
        return False
    for name in TABLES:
        if name not in level.tables:
            continue
        if not np.array_equal(level.tables[name], before._tables[name]):
            return False
    return True
