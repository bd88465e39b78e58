"""Write files with several meshes for ParaView.

They hold all steps of a loading history, or all meshes of an adaptive run.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from erc_contact.error.runs import LoadingHistory
from erc_contact.output.files import new_vtkhdf
from erc_contact.output.gathered import body_nodes, nodal_displacement
from erc_contact.results.stresses import cell_stresses
from namedmesh import Domain
from namedmesh.base.ranks import gather_rows
from namedmesh.pictures import body_mesh, on_root, vtk_cells


def write_series(history: LoadingHistory, path: str | Path) -> None:
    """Write the fields of all steps to one VTKHDF file with times; collective.

    ParaView opens it as it is. It has the displacement u^ at the nodes; in the cells
    eps_E, the mean of sigma^, and the von Mises stress of it and of the finite
    elements, with the names of :func:`erc_contact.output.write_fields`. A mesh of
    several steps is written once.

    Args:
        history: The history.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    comm = history.errors[0].domain.comm
    meshes: list[dict[str, np.ndarray]] = []
    mesh_numbers = []
    points = []
    cells = []
    last: Domain | None = None
    for error in history.errors:
        pair = error.admissible
        model = error.model
        # Steps on the same mesh share it in the file.
        if error.domain is not last:
            meshes.append(gather_rows(comm, **body_nodes(model.space)))
        last = error.domain
        mesh_numbers.append(len(meshes) - 1)
        points.append(gather_rows(comm, displacement=nodal_displacement(pair)))
        cells.append(gather_rows(comm, **cell_stresses(pair), eps_E=error.indicators))
    dim = history.errors[0].domain.dim

    def write() -> None:
        times = history.column("time")
        _write_series(Path(path), times, meshes, mesh_numbers, points, cells, dim)

    on_root(comm, path, write)


def write_meshes(meshes: Sequence[tuple[Domain, np.ndarray]], path: str | Path) -> None:
    """Write all meshes of a run with eps_E to one VTKHDF file; collective.

    ParaView opens it as it is. The times of the file are the numbers of the meshes,
    from 1 on.

    Args:
        meshes: Pairs of a domain and eps_E of its owned cells, as in
            ``History.meshes``.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    first = meshes[0][0]
    comm = first.comm
    bodies = [gather_rows(comm, **body_mesh(domain)) for domain, _ in meshes]
    cells = [gather_rows(comm, eps_E=eps) for _, eps in meshes]
    points: list[dict[str, np.ndarray]] = [{} for _ in meshes]
    mesh_numbers = list(range(len(meshes)))

    def write() -> None:
        times = np.arange(len(meshes)) + 1.0
        _write_series(Path(path), times, bodies, mesh_numbers, points, cells, first.dim)

    on_root(comm, path, write)


def _write_series(
    path: Path,
    times: np.ndarray,
    meshes: Sequence[dict[str, np.ndarray]],
    mesh_numbers: Sequence[int],
    points: Sequence[dict[str, np.ndarray]],
    cells: Sequence[dict[str, np.ndarray]],
    d: int,
) -> None:
    """Write a VTKHDF file with several times.

    Args:
        path: The file.
        times: Times of the steps.
        meshes: Points and cells of each mesh.
        mesh_numbers: Number of the mesh of each step.
        points: Values at the points of each step.
        cells: Values in the cells of each step.
        d: Dimension of the cells.
    """
    steps_data = {"PointData": points, "CellData": cells}
    with new_vtkhdf(path) as vtk:
        steps = vtk.create_group("Steps")
        steps.attrs["NSteps"] = len(times)
        steps["Values"] = times
        steps["PartOffsets"] = np.array(mesh_numbers)
        steps["NumberOfParts"] = np.ones(len(times), dtype=int)
        _write_meshes(vtk, meshes, mesh_numbers, d)
        for kind, data in steps_data.items():
            # Values of all steps stand in one array, each step from its offset on.
            for name in data[0]:
                arrays = [step[name] for step in data]
                vtk[f"{kind}/{name}"] = np.concatenate(arrays)
                steps[f"{kind}Offsets/{name}"] = _starts([len(array) for array in arrays])


def _write_meshes(
    vtk: Any, meshes: Sequence[dict[str, np.ndarray]], mesh_numbers: Sequence[int], d: int
) -> None:
    """Write the meshes to a group of a VTKHDF file, and where each step's mesh begins.

    Args:
        vtk: The group, which has a group "Steps".
        meshes: Points and cells of each mesh.
        mesh_numbers: Number of the mesh of each step.
        d: Dimension of the cells.
    """
    points = [mesh["points"] for mesh in meshes]
    cells = []
    offsets = []
    types = []
    for mesh in meshes:
        kind, nodes = vtk_cells(mesh["cells"], d)
        cells.append(nodes)
        offsets.append(np.arange(0, nodes.size + 1, nodes.shape[1]))
        types.append(np.full(len(nodes), kind, dtype=np.uint8))
    point_counts = np.array([len(x) for x in points])
    cell_counts = np.array([len(nodes) for nodes in cells])
    node_counts = np.array([nodes.size for nodes in cells])
    vtk["NumberOfPoints"] = point_counts
    vtk["NumberOfCells"] = cell_counts
    vtk["NumberOfConnectivityIds"] = node_counts
    vtk["Points"] = np.concatenate(points)
    vtk["Connectivity"] = np.concatenate([nodes.ravel() for nodes in cells])
    vtk["Offsets"] = np.concatenate(offsets)
    vtk["Types"] = np.concatenate(types)
    steps = vtk["Steps"]
    mesh_of_step = list(mesh_numbers)
    steps["PointOffsets"] = _starts(point_counts)[mesh_of_step]
    steps["CellOffsets"] = _starts(cell_counts)[mesh_of_step][:, None]
    steps["ConnectivityIdOffsets"] = _starts(node_counts)[mesh_of_step][:, None]


def _starts(lengths: npt.ArrayLike) -> np.ndarray:
    """Return where each of several arrays begins if they stand in a row."""
    return np.concatenate([[0], np.cumsum(lengths)[:-1]])
