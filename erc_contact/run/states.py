"""What a file of a run holds of a mesh level: mesh, displacement, multipliers, fields; and the level from it.

The file opens in ParaView as it is: body, displacement, eps_E, stresses (in single
precision, nothing else needs them), as in ``body.vtkhdf``. Beside that it holds the
tables of :mod:`erc_contact.mesh.tables` by the same numbers of nodes, and plain data. A
level is restored without a contact solve: its admissible pair and its error follow from
the displacement and the multipliers.

Symbols: d dimension, n number of nodes, m number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.pair import equilibrate
from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.tables import CellRows, described, geometry_of, tag_tables
from erc_contact.model.promises import bind
from erc_contact.newton.after import last_step
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.output.files import gathered, vtk_cells
from erc_contact.output.gathered import body_nodes, nodal_displacement
from erc_contact.results.stresses import cell_stresses
from erc_contact.run.levels import Level
from erc_contact.run.step import Step
from erc_contact.scene.scene import Scene

NUMBERS = (
    "absolute",
    "scale",
    "bulk_error",
    "contact_error",
    "geometry_error",
    "relative",
    "total",
    "degree",
)
"""Numbers of an error that are kept."""
STATE = {
    "newton_steps": "newton_steps",
    "reason": "reason",
    "remaining": "distance",
    "regularity": "least_singular_value",
    "seconds": "seconds",
}
"""Name in the file -> attribute of a solution, for what is kept beside its fields."""
MESH = ("degree", "names", "regions", "geometry", "tags")
"""What a level tells of its mesh beside the tables."""
TABLES = ("VTKHDF/Points", "cells", "facets", "regions", "curved")
"""The tables of a mesh."""
SAME = 1e-8
"""Difference of eps that round-off explains, of eps and [-]."""


def level_of(error: ConstitutiveError, steps: Sequence[Any]) -> Level:
    """What a file holds of an error, with the rows of the run so far; the tables are on rank 0; collective.

    Raises:
        InputError: If the true shape of the domain cannot be kept.
    """
    solution, domain, model = error.solution, error.domain, error.model
    geometry = model.comm.bcast(described(domain.geometry))  # its text is on rank 0
    x = model.V.tabulate_dof_coordinates()
    x[model.vertices] = domain.mesh.geometry.x[domain.mesh.geometry.dofmaps[0]]  # to the last digit
    u = _owned(error, solution.u)
    fields = {f"multipliers/{i}": _owned(error, one) for i, one in enumerate(solution.multipliers)}
    tags = tag_tables(domain)
    numbers = model.global_numbers(model.nodes[: domain.owned_cells])
    hat = nodal_displacement(error.admissible)
    points = gathered(model.comm, points=x[: len(u)], u=u, displacement=hat, **fields)
    rows = gathered(model.comm, cells=numbers, drawn=body_nodes(model)["cells"], **tags)
    stresses = {
        name: values.astype(np.float32) for name, values in cell_stresses(error.admissible).items()
    }
    values = gathered(model.comm, **stresses, eps_E=error.indicators)
    about = {
        "rows": [asdict(step) for step in steps],
        "dim": domain.dim,
        "degree": model.degree,
        "names": dict(domain.names),
        "regions": dict(domain.regions),
        "geometry": geometry,
        "tags": sorted(tags),
        "multipliers": len(solution.multipliers),
        "method": repr(solution.method),
        "iterative": solution.stiffness.iterative,
        "solution": {name: getattr(solution, attribute) for name, attribute in STATE.items()},
        "error": {name: getattr(error, name) for name in NUMBERS},
    }
    if not rows:
        return Level(about, {})
    drawn = _drawn(points.pop("points"), rows.pop("drawn"), domain.dim)
    drawn |= {"VTKHDF/PointData/displacement": points.pop("displacement")}
    drawn |= {f"VTKHDF/CellData/{name}": value for name, value in values.items()}
    return Level(about, drawn | points | rows)


def _owned(error: ConstitutiveError, function: fem.Function) -> np.ndarray:
    """Values at the nodes of this rank, shape (n, d)."""
    return function.x.array.reshape(-1, error.domain.dim)[
        : function.function_space.dofmap.index_map.size_local
    ]


def _drawn(points: np.ndarray, cells: np.ndarray, d: int) -> dict[str, np.ndarray]:
    """Points and cells as VTKHDF has them."""
    kind, cells = vtk_cells(cells, d)
    whole = {
        "Points": points,
        "Connectivity": cells.ravel(),
        "Offsets": np.arange(0, cells.size + 1, cells.shape[1]),
        "Types": np.full(len(cells), kind, dtype=np.uint8),
        "NumberOfPoints": np.array([len(points)]),
        "NumberOfCells": np.array([len(cells)]),
        "NumberOfConnectivityIds": np.array([cells.size]),
    }
    return {f"VTKHDF/{name}": array for name, array in whole.items()}


class Restored:
    """A level that is read; all members are collective.

    Args:
        comm: Communicator that shares the mesh.
        level: What the file holds; tables are needed on rank 0 only.
        before: Another level of the run, whose domain this one shares if their meshes
            are the same.

    Attributes:
        domain: The mesh with names.
        indicators: eps_E of the owned cells [-].
    """

    def __init__(self, comm: MPI.Comm, level: Level, before: Restored | None = None) -> None:
        self.about, self._tables = level.about, level.tables
        get, about = level.tables.get, level.about
        if before is not None and comm.bcast(_same_mesh(level, before)):
            self._rows: CellRows = before._rows
            self.domain: Domain = before.domain
        else:
            self._rows = CellRows(comm, get("VTKHDF/Points"), get("cells"), about["dim"])
            self.domain = self._domain()
        self.indicators = self._rows.of_cells(get("VTKHDF/CellData/eps_E"))[
            : self.domain.owned_cells
        ]

    @property
    def steps(self) -> tuple[Step, ...]:
        """The rows of the run up to this level.

        Raises:
            InputError: If they are those of a loading history.
        """
        if "time" in self.about["rows"][-1]:
            raise InputError(
                "The folder holds a loading history: call evolve(..., checkpoint=folder) as for the run."
            )
        return tuple(Step(**row) for row in self.about["rows"])

    @property
    def accuracy(self) -> float:
        """The prescribed relative error of the run."""
        return float(self.about["accuracy"])

    @property
    def numbers(self) -> dict[str, Any]:
        """The numbers of the error, by their names."""
        return dict(self.about["error"])

    def error(
        self, scene: Scene, methods: Sequence[Method], tighten: int, after: Solution | None = None
    ) -> ConstitutiveError:
        """The error of this level, measured anew without a contact solve.

        Args:
            scene: The problem.
            methods: The methods that it can be the solution of.
            tighten: As in :func:`equilibrate`.
            after: The solution of the last step of a history, or None.

        Raises:
            InputError: If it is not the error that was written.
        """
        about = self.about
        model = bind(
            scene, self.domain, about["degree"], None if after is None else last_step(after)
        )
        fields = [self._function(model, "u")]
        fields += [self._function(model, f"multipliers/{i}") for i in range(about["multipliers"])]
        method = next((one for one in methods if repr(one) == about["method"]), methods[0])
        stiffness = (Multigrid if about["iterative"] else Stiffness)(model)
        numbers = {attribute: about["solution"][name] for name, attribute in STATE.items()}
        solution = Solution(
            model, method, fields[0], tuple(fields[1:]), stiffness=stiffness, **numbers
        )
        error = constitutive_error(equilibrate(solution, tighten=tighten))
        if abs(error.relative - about["error"]["relative"]) > SAME * (
            about["error"]["relative"] + SAME
        ):
            raise InputError(
                f"The error of the mesh of {self.domain.cells} cells is {error.relative:.10g}, in the folder "
                f"{about['error']['relative']:.10g}: the software is not the one that wrote it. Take that, or another "
                "folder."
            )
        return replace(
            error,
            admissible=replace(error.admissible, seconds=about["rows"][-1]["equilibrate_seconds"]),
        )

    def _domain(self) -> Domain:
        about, get = self.about, self._tables.get
        facets = self._rows.facet_tags(get("facets"))
        curved = self._rows.facet_tags(get("curved")) if "curved" in about["tags"] else None
        cells = self._rows.cell_tags(get("regions")) if "regions" in about["tags"] else None
        geometry = geometry_of(about["geometry"])
        return Domain(
            self._rows.mesh, facets, about["names"], cells, about["regions"], geometry, curved
        )

    def _function(self, model: Any, name: str) -> fem.Function:
        function = model.function()
        values = self._rows.of_nodes(
            self._tables.get(name), self._tables.get("cells"), model.degree
        )
        function.x.array.reshape(-1, model.d)[model.nodes] = values
        return function


def _same_mesh(level: Level, before: Restored) -> bool:
    """Whether two levels have the same mesh with the same names; only rank 0 can tell."""
    if any(level.about[name] != before.about[name] for name in MESH):
        return False
    tables, theirs = level.tables, before._tables
    return all(
        bool(np.array_equal(tables[name], theirs[name])) for name in TABLES if name in tables
    )
