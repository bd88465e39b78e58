"""Files with several meshes for ParaView: all steps of a loading history, or all meshes of an adaptive run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.output.files import gathered, on_root, vtk_cells
from erc_contact.output.gathered import body_mesh, body_nodes, nodal_displacement
from erc_contact.results.stresses import cell_stresses


class LoadingHistory(Protocol):
    """Stand for a loading history, as far as it is drawn and written.

    An ``Evolution`` has these members.
    """

    @property
    def errors(self) -> tuple[ConstitutiveError, ...]:
        """Return the error at the end of each step."""

    def column(self, name: str) -> np.ndarray:
        """Return one number of each step: "time", "work", "dissipated", ..."""

    def force(self, contact: str) -> np.ndarray:
        """Return the resultant on a contact at the end of each step [force].

        Returns:
            Forces, shape (steps, d).
        """


def write_series(history: LoadingHistory, path: str | Path) -> None:
    """Write the fields of all steps to one VTKHDF file with times, which opens in ParaView as it is; collective.

    It has the displacement u^ at the nodes; in the cells eps_E, the mean of sigma^, its
    von Mises stress, and that of the finite elements, with the names of
    :func:`erc_contact.output.write_fields`. A mesh of several steps is written once.

    Args:
        history: The history.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    comm = history.errors[0].domain.mesh.comm
    meshes: list[dict[str, np.ndarray]] = []
    which, points, cells = [], [], []
    last: Any = None
    for error in history.errors:
        pair, model = error.admissible, error.solution.model
        if error.domain is not last:
            meshes.append(gathered(comm, **body_nodes(model)))
        last = error.domain
        which.append(len(meshes) - 1)
        points.append(gathered(comm, displacement=nodal_displacement(pair)))
        cells.append(gathered(comm, **cell_stresses(pair), eps_E=error.indicators))

    def write() -> None:
        _write_series(
            Path(path),
            history.column("time"),
            meshes,
            which,
            (points, cells),
            history.errors[0].domain.dim,
        )

    on_root(comm, path, write)


def write_meshes(meshes: Sequence[tuple[Domain, np.ndarray]], path: str | Path) -> None:
    """Write all meshes of a run with eps_E to one VTKHDF file, which opens in ParaView as it is; collective.

    The times of the file are the numbers of the meshes, from 1 on.

    Args:
        meshes: Pairs of a domain and eps_E of its owned cells, as in
            ``History.meshes``.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    comm, dim = meshes[0][0].mesh.comm, meshes[0][0].dim
    bodies = [gathered(comm, **body_mesh(domain)) for domain, _ in meshes]
    cells = [gathered(comm, eps_E=eps) for _, eps in meshes]
    numbers = np.arange(len(meshes))

    def write() -> None:
        _write_series(
            Path(path), numbers + 1.0, bodies, numbers.tolist(), ([{} for _ in meshes], cells), dim
        )

    on_root(comm, path, write)


def _write_series(
    path: Path,
    times: np.ndarray,
    meshes: Sequence[dict[str, np.ndarray]],
    which: Sequence[int],
    data: tuple[Sequence[dict[str, np.ndarray]], Sequence[dict[str, np.ndarray]]],
    d: int,
) -> None:
    """Write a VTKHDF file with several times.

    Args:
        path: The file.
        times: Times of the steps.
        meshes: Points and cells of each mesh.
        which: Number of the mesh of each step.
        data: Values at the points and in the cells of each step.
        d: Dimension of the cells.
    """
    import h5py  # noqa: PLC0415

    kinds = [vtk_cells(mesh["cells"], d) for mesh in meshes]
    counts = {
        "NumberOfPoints": np.array([len(mesh["points"]) for mesh in meshes]),
        "NumberOfCells": np.array([len(cells) for _, cells in kinds]),
        "NumberOfConnectivityIds": np.array([cells.size for _, cells in kinds]),
    }
    starts = {
        name: np.concatenate([[0], np.cumsum(of)[:-1]])[list(which)] for name, of in counts.items()
    }
    with h5py.File(path, "w") as file:
        vtk = file.create_group("VTKHDF")
        vtk.attrs["Version"], vtk.attrs["Type"] = (2, 0), np.bytes_("UnstructuredGrid")
        for name, of in counts.items():
            vtk[name] = of
        vtk["Points"] = np.concatenate([mesh["points"] for mesh in meshes])
        vtk["Connectivity"] = np.concatenate([cells.ravel() for _, cells in kinds])
        vtk["Offsets"] = np.concatenate(
            [np.arange(0, cells.size + 1, cells.shape[1]) for _, cells in kinds]
        )
        vtk["Types"] = np.concatenate(
            [np.full(len(cells), kind, dtype=np.uint8) for kind, cells in kinds]
        )
        steps = vtk.create_group("Steps")
        steps.attrs["NSteps"] = len(times)
        steps["Values"] = times
        steps["PartOffsets"] = np.array(which)
        steps["NumberOfParts"] = np.ones(len(times), dtype=int)
        steps["PointOffsets"] = starts["NumberOfPoints"]
        steps["CellOffsets"] = starts["NumberOfCells"][:, None]
        steps["ConnectivityIdOffsets"] = starts["NumberOfConnectivityIds"][:, None]
        for kind, values in zip(("PointData", "CellData"), data, strict=True):
            for name in values[0]:
                lengths = np.array([len(of[name]) for of in values])
                vtk[f"{kind}/{name}"] = np.concatenate([of[name] for of in values])
                steps[f"{kind}Offsets/{name}"] = np.concatenate([[0], np.cumsum(lengths)[:-1]])
