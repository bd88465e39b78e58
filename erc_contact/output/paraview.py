"""Fields of a result: means of stresses, and files for ParaView.

All functions but :func:`von_mises` are collective: data are gathered to rank 0 of the mesh's
communicator, which writes.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, mu friction coefficient,
u^ and sigma^ admissible displacement and stress, eps_E relative error of one element.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import ufl

from erc_contact.admissible.contact import ContactTraction
from erc_contact.admissible.macro import tensors
from erc_contact.admissible.pair import Admissible
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.simplex import bernstein, lagrange, node_between, node_vertices, nodes
from erc_contact.model.expressions import evaluate
from erc_contact.model.model import Model
from erc_contact.output.files import PARTS, degree_of, gathered, grid_of, on_root, save_grid, subdivided
from erc_contact.results.questions import contact_status
from erc_contact.scene.material import mandel_basis


def write_fields(error: ConstitutiveError, folder: str | Path) -> None:
    """Write the fields for ParaView; collective.

    ``body.vtkhdf``: at the nodes ``displacement`` (u^); in the cells ``eps_E`` and means of stresses, ``stress``
    (sigma^), ``stress_fe`` (rebalanced finite element stress; both 3x3, row by row) and ``von_mises`` (of sigma^).
    Where the material does not tell the stress out of plane (:func:`tells_out_of_plane`), that component is nan, and
    ``von_mises_in_plane`` stands in place of ``von_mises``: the von Mises stress of the part in plane.
    ``contact_<name>.vtkhdf`` for each contact, each facet with points of its own: at the points ``traction`` (r^),
    ``pressure`` (-r_n) and ``friction_bound`` (b, the most that |r_t| may be), in the cells ``mean_traction`` and
    ``status`` (0 open, 1 slip, 2 stick).
    Degree 2 is written by quadratic cells, with values at all nodes. VTK integrates these by straight parts, and lines
    not at all: so the facets in 2D are polylines, and the integral of ``mean_traction`` is the force, exactly.

    Args:
        error: What is written, with its admissible pair.
        folder: Where; it is made if it is missing.

    Note:
        VTKHDF files, written by rank 0 through pyvista: DOLFINx 0.11 itself writes one array a file only.
    """
    admissible, model = error.admissible, error.admissible.solution.model
    body = gathered(model.comm, **body_nodes(model), displacement=nodal_displacement(admissible))
    stress = mean_stress(admissible)
    fe = _spatial(model, admissible.fe_stress[: model.domain.owned_cells].mean(axis=1))
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    values = {"stress": stress.reshape(-1, 9), "stress_fe": fe.reshape(-1, 9), mises: von_mises(stress)}
    cells = gathered(model.comm, **values, eps_E=error.cells)
    contacts = [whole_contact(admissible, t) for t in admissible.tractions]

    def write() -> None:
        grid = grid_of(body["points"], body["cells"], model.d)
        grid.point_data["displacement"] = body["displacement"]
        grid.cell_data.update(cells)
        save_grid(grid, Path(folder) / "body.vtkhdf")
        for contact in contacts:
            assert contact is not None
            traction, points = contact.traction, _written(contact)
            shape = bernstein(model.d - 1, contact.degree, points)
            x = np.matmul(lagrange(model.d - 1, contact.degree, points), contact.x)
            surface = grid_of(x.reshape(-1, 3), np.arange(x[..., 0].size).reshape(x.shape[:2]), model.d - 1)
            values = np.matmul(shape, traction.values)
            surface.point_data["traction"] = _padded(values.reshape(-1, model.d))
            surface.point_data["pressure"] = (-traction.normal @ shape.T).ravel()
            surface.point_data["friction_bound"] = (traction.bound @ shape.T).ravel()
            surface.cell_data["mean_traction"] = _padded(traction.values.mean(axis=1))
            surface.cell_data["status"] = contact_status(traction)
            save_grid(surface, Path(folder) / f"contact_{traction.contact.name}.vtkhdf")

    on_root(model.comm, Path(folder) / "body.vtkhdf", write)


def mean_stress(admissible: Admissible) -> np.ndarray:
    """Mean of sigma^ in each owned cell [force/area], shape (owned, 3, 3); collective.

    The stress out of plane is that of the material's ``out_of_plane``, and nan where it has none.
    """
    model = admissible.solution.model
    return _spatial(model, tensors(admissible.stress.mean(axis=(1, 2)), model.d))


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress ``sqrt(3/2) |dev sigma|`` of tensors (n, 3, 3) [force/area], shape (n,).

    Where the stress out of plane is not known (nan) it counts as 0: this is the von Mises stress of the part in plane.
    """
    known = np.nan_to_num(stress)
    deviator = known - np.trace(known, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2))


def tells_out_of_plane(model: Model) -> bool:
    """Whether all stresses are known: in 3D, and where the material has a method ``out_of_plane``."""
    return model.d == 3 or hasattr(model.scene.material, "out_of_plane")


def _spatial(model: Model, stress: np.ndarray) -> np.ndarray:
    """Stresses of owned cells as tensors of space, that out of plane at the middle of cells, shape (owned, 3, 3)."""
    d = model.d
    full = np.zeros((len(stress), 3, 3))
    full[:, :d, :d] = stress
    if not tells_out_of_plane(model):
        full[:, 2, 2] = np.nan
    elif d == 2:
        basis = mandel_basis(d)
        material: Any = model.scene.material
        images = [material.out_of_plane(ufl.as_matrix(b.tolist()), **model.parameters) for b in basis]
        cells = np.arange(len(stress), dtype=np.int32)
        row = evaluate(ufl.as_vector(images), model.domain, nodes(d, 0), cells)[:, 0]
        full[:, 2, 2] = np.einsum("nk,kij,nij->n", row, basis, stress)
    return full


# -- all ranks together -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Surface:
    """A contact of all ranks, facet by facet; on rank 0.

    Attributes:
        traction: r^; its ``contact`` has no values but the direction of these facets.
        x: Places of the nodes [length], shape (n, m, 3).
        vertices: Global numbers of the vertices, shape (n, d).
        gap: The gap at the nodes [length], shape (n, m).
    """

    traction: ContactTraction
    x: np.ndarray
    vertices: np.ndarray
    gap: np.ndarray

    @property
    def d(self) -> int:
        """Dimension of the body."""
        return self.traction.values.shape[-1]

    @property
    def degree(self) -> int:
        """Degree of r^."""
        return 1 if self.x.shape[1] == self.d else 2


def whole_contact(admissible: Admissible, traction: ContactTraction) -> Surface | None:
    """A contact of all ranks on rank 0, None elsewhere; collective."""
    model, contact = admissible.solution.model, traction.contact
    own = model.owned(contact.facets)
    parts = gathered(
        model.comm,
        area=traction.area[own],
        values=traction.values[own],
        bound=traction.bound[own],
        direction=contact.direction[own],
        nodes=model.global_numbers(traction.nodes[own]),
        x=model.V.tabulate_dof_coordinates()[traction.nodes[own]],
        gap=model.gap_at_nodes(contact)[own],
    )
    if not parts:
        return None
    x, gap, vertices = parts.pop("x"), parts.pop("gap"), parts["nodes"][:, : model.d]
    contact = replace(contact, direction=parts.pop("direction"))
    return Surface(ContactTraction(contact, **parts), x, vertices, gap)


def body_mesh(domain: Domain) -> dict[str, np.ndarray]:
    """Owned vertices (n, 3) as points, owned cells (m, d+1) by global numbers of these, positively oriented."""
    geometry = domain.mesh.geometry
    return _numbered(geometry.x, geometry.dofmaps[0][: domain.owned_cells], geometry.index_map(), domain.dim)


def body_nodes(model: Model) -> dict[str, np.ndarray]:
    """The same with all nodes of the displacement: points (n, 3), cells (m, N)."""
    cells, x = model.nodes[: model.domain.owned_cells], model.V.tabulate_dof_coordinates()
    return _numbered(x, cells, model.V.dofmap.index_map, model.d)


def nodal_displacement(admissible: Admissible) -> np.ndarray:
    """u^ at the points of :func:`body_nodes` of this rank [length], shape (n, 3)."""
    model = admissible.solution.model
    return _padded(admissible.displacement.x.array.reshape(-1, model.d)[: model.V.dofmap.index_map.size_local])


def _padded(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, d) in space, (n, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _written(surface: Surface) -> np.ndarray:
    """Reference points at which a facet is written: its nodes, or those of a polyline."""
    d, k = surface.d - 1, surface.degree
    return subdivided(d, PARTS)[0] if (d, k) == (1, 2) else nodes(d, k)


def _numbered(x: np.ndarray, cells: np.ndarray, nodes: Any, d: int) -> dict[str, np.ndarray]:
    k = degree_of(cells, d)
    ends = x[cells[:, : d + 1], :d]
    turned = np.linalg.det(ends[:, 1:] - ends[:, :1]) < 0
    swapped = np.array([*range(d - 1), d, d - 1])[node_vertices(d, k)]
    cells = np.where(turned[:, None], cells[:, node_between(d, k)[swapped[:, 0], swapped[:, 1]]], cells)
    numbers = nodes.local_to_global(cells.ravel().astype(np.int32)).reshape(cells.shape)
    return {"points": x[: nodes.size_local].copy(), "cells": numbers}
