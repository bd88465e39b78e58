"""Fields of a result: means of stresses, the status of the contact, and files for ParaView.

All functions but :func:`contact_status` and :func:`von_mises` are collective: data are gathered to rank 0 of the mesh's
communicator, which writes; the other ranks do not import pyvista. What fails on rank 0 is raised on all ranks. The
folder of a path is made if it is missing.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, mu friction coefficient,
u^ and sigma^ admissible displacement and stress, eps_E relative error of one element.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible import Admissible
from erc_contact.admissible.contact import MARGIN, ContactTraction
from erc_contact.admissible.macro import tensors
from erc_contact.domain import Domain
from erc_contact.error import ConstitutiveError
from erc_contact.exceptions import raise_together
from erc_contact.expressions import evaluate
from erc_contact.material import Elastic
from erc_contact.model import Model

FONTS = {"font.family": "STIXGeneral", "mathtext.fontset": "stix", "font.size": 11.0}
OPEN, SLIP, STICK = 0, 1, 2
"""Codes of :func:`contact_status`."""


def contact_status(traction: ContactTraction) -> np.ndarray:
    """Whether each facet of a contact is open, slips or sticks, by its admissible traction.

    A facet without pressure is ``OPEN``, but in a bilateral contact; one whose nodes all have ``|r_t| >= (1 - 1e-6) b``
    with b the friction bound is ``SLIP``, so every pressed facet of a contact without friction; the others are
    ``STICK``. Where the bound must be sampled on a facet, r^ is shrunk to be allowed between the nodes, too, by at most
    about the variation of b/p: that much less is slip.

    Args:
        traction: r^ on a contact.

    Returns:
        OPEN, SLIP or STICK for each facet of ``traction.contact.facets``, shape (n,).
    """
    pressure = -traction.normal
    bound = traction.bound.sum(axis=1)
    slope = np.divide(traction.bound, pressure, out=np.zeros_like(pressure), where=pressure > 0)
    most = slope.max(axis=1, initial=0.0)
    variation = np.divide(np.ptp(slope, axis=1), most, out=np.zeros_like(most), where=most > 0)
    variation = np.where(traction.contact.sampled, variation, 0.0)
    shear = np.linalg.norm(traction.tangential, axis=-1).sum(axis=1)
    slips = shear >= (1 - 1e-6 - (1 + MARGIN) * variation) * bound
    opens = pressure.max(axis=1, initial=0.0) <= 1e-10 * pressure.max(initial=0.0)
    opens &= not traction.contact.bilateral
    return np.where(opens, OPEN, np.where(slips, SLIP, STICK))


def write_fields(error: ConstitutiveError, folder: str | Path) -> None:
    """Write the fields for ParaView; collective.

    ``body.vtkhdf``: at the points ``displacement`` (u^); in the cells ``eps_E`` and means of stresses, ``stress``
    (sigma^), ``stress_fe`` (rebalanced finite element stress; both 3x3, row by row) and ``von_mises`` (of sigma^).
    ``contact_<name>.vtkhdf`` for each contact, each facet with points of its own: at the points ``traction`` (r^),
    ``pressure`` (-r_n) and ``friction_bound`` (b, the most that |r_t| may be), in the cells ``status`` (0 open, 1 slip,
    2 stick).

    Args:
        error: What is written, with its admissible pair.
        folder: Where; it is made if it is missing.

    Note:
        VTKHDF files, written by rank 0 through pyvista: DOLFINx 0.11 itself writes one array a file only.
    """
    admissible, model = error.admissible, error.admissible.solution.model
    body = gathered(model.comm, **body_mesh(model.domain), u=nodal_displacement(admissible))
    stress = mean_stress(admissible)
    fe = _spatial(model, admissible.fe_stress[: model.domain.owned_cells].mean(axis=1))
    tensor = {"stress": stress.reshape(-1, 9), "stress_fe": fe.reshape(-1, 9)}
    cells = gathered(model.comm, **tensor, von_mises=von_mises(stress), eps_E=error.cells)
    contacts = [(t.contact.name, *whole_contact(admissible, t)) for t in admissible.tractions]

    def write() -> None:
        grid = grid_of(body["points"], body["cells"])
        grid.point_data["displacement"] = body["u"]
        grid.cell_data.update(cells)
        grid.save(Path(folder) / "body.vtkhdf")
        for name, traction, x in contacts:
            surface = grid_of(x.reshape(-1, 3), traction.nodes)
            values = traction.values.reshape(-1, model.d)
            surface.point_data["traction"] = np.pad(values, ((0, 0), (0, 3 - model.d)))
            surface.point_data["pressure"] = -traction.normal.ravel()
            surface.point_data["friction_bound"] = traction.bound.ravel()
            surface.cell_data["status"] = contact_status(traction)
            surface.save(Path(folder) / f"contact_{name}.vtkhdf")

    on_root(model.comm, Path(folder) / "body.vtkhdf", write)


def mean_stress(admissible: Admissible) -> np.ndarray:
    """Mean of sigma^ in each owned cell [force/area], with the stress out of plane, shape (owned, 3, 3); collective."""
    model = admissible.solution.model
    return _spatial(model, tensors(admissible.stress.mean(axis=(1, 2)), model.d))


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress ``sqrt(3/2) |dev sigma|`` of tensors of shape (n, 3, 3) [force/area], shape (n,)."""
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2))


def _spatial(model: Model, stress: np.ndarray) -> np.ndarray:
    """Stresses of owned cells as tensors of space: plane strain has a stress out of plane, shape (owned, 3, 3)."""
    d, material = model.d, model.scene.material
    full = np.zeros((len(stress), 3, 3))
    full[:, :d, :d] = stress
    if d == 2 and isinstance(material, Elastic) and material.hypothesis == "plane strain":
        cells = np.arange(len(stress), dtype=np.int32)
        nu = evaluate(model.parameters["nu"], model.domain, np.full((1, d), 1 / (d + 1)), cells)[:, 0]
        full[:, 2, 2] = nu * np.trace(stress, axis1=1, axis2=2)
    return full


# -- gathering -----------------------------------------------------------------------------------------------------


def on_root(comm: MPI.Comm, path: str | Path, draw: Callable[[], None]) -> None:
    """Draw on rank 0 with the folder made; what fails is raised on all ranks; collective."""
    error: Exception | None = None
    if comm.rank == 0:
        try:
            from matplotlib import rc_context  # noqa: PLC0415

            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with rc_context(FONTS):
                draw()
        except Exception as reason:
            error = reason
    raise_together(comm, error)


def gathered(comm: MPI.Comm, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of all ranks one after the other, on rank 0; nothing elsewhere; collective."""
    parts = comm.gather(arrays)
    return {name: np.concatenate([part[name] for part in parts]) for name in arrays} if parts else {}


def body_mesh(domain: Domain) -> dict[str, np.ndarray]:
    """Owned points (n, 3) and owned cells (m, d+1) by global point numbers, positively oriented as VTK wants it."""
    geometry = domain.mesh.geometry
    nodes, cells = geometry.index_map(), geometry.dofmaps[0][: domain.owned_cells]
    numbers = nodes.local_to_global(np.ascontiguousarray(cells).ravel()).reshape(cells.shape)
    x = geometry.x[cells, : domain.dim]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    numbers[turned, -2:] = numbers[turned, :-3:-1]
    return {"points": geometry.x[: nodes.size_local].copy(), "cells": numbers}


def nodal_displacement(admissible: Admissible) -> np.ndarray:
    """u^ at the owned points, in the order of :func:`body_mesh`, shape (n, 3)."""
    model = admissible.solution.model
    geometry = model.mesh.geometry
    values, u = admissible.displacement.x.array.reshape(-1, model.d), np.zeros_like(geometry.x)
    u[geometry.dofmaps[0].ravel(), : model.d] = values[model.vertices.ravel()]
    return u[: geometry.index_map().size_local]


def whole_contact(admissible: Admissible, traction: ContactTraction) -> tuple[ContactTraction, np.ndarray]:
    """The traction of all ranks at the vertices, counted facet by facet, and their places (n, d, 3); only on rank 0."""
    model, contact = admissible.solution.model, traction.contact
    own = contact.facets[:, 0] < model.domain.owned_cells
    d = model.d
    x = model.V.tabulate_dof_coordinates()[traction.nodes[own, :d]]
    parts = {"area": traction.area[own], "values": traction.values[own, :d], "bound": traction.bound[own, :d]}
    parts |= {"x": x, "direction": contact.direction[own]}
    parts = gathered(model.comm, **parts) or parts
    x, contact = parts.pop("x"), replace(contact, direction=parts.pop("direction"))
    return ContactTraction(contact, np.arange(len(x) * model.d).reshape(-1, model.d), **parts), x


# -- drawing, on rank 0 --------------------------------------------------------------------------------------------


def grid_of(points: np.ndarray, cells: np.ndarray) -> Any:
    """Lines, triangles or tetrahedra for pyvista."""
    import pyvista  # noqa: PLC0415

    kind = {2: pyvista.CellType.LINE, 3: pyvista.CellType.TRIANGLE, 4: pyvista.CellType.TETRA}[cells.shape[1]]
    return pyvista.UnstructuredGrid({kind: cells}, points)
