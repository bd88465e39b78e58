"""Fields of a result: means of stresses, and files for ParaView.

All functions but :func:`von_mises` are collective: data are gathered to rank 0 of the mesh's
communicator, which writes.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, mu friction coefficient,
u^ and sigma^ admissible displacement and stress, eps_E relative error of one element.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.simplex import bernstein, lagrange, nodes
from erc_contact.model.stress import stress_in_space, tells_out_of_plane, von_mises
from erc_contact.output.files import PARTS, gathered, grid_of, on_root, save_grid, subdivided
from erc_contact.output.gathered import Surface, _padded, body_nodes, nodal_displacement, whole_contact
from erc_contact.results.maximum import mean_stress
from erc_contact.results.profile import contact_status


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
    admissible, model = error.admissible, error.solution.model
    body = gathered(model.comm, **body_nodes(model), displacement=nodal_displacement(admissible))
    stress = mean_stress(admissible)
    fe = stress_in_space(model, admissible.fe_stress[: model.domain.owned_cells].mean(axis=1))
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    values = {"stress": stress.reshape(-1, 9), "stress_fe": fe.reshape(-1, 9), mises: von_mises(stress)}
    cells = gathered(model.comm, **values, eps_E=error.indicators)
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
            surface.point_data["pressure"] = (-traction.normal_component @ shape.T).ravel()
            surface.point_data["friction_bound"] = (traction.friction_bound @ shape.T).ravel()
            surface.cell_data["mean_traction"] = _padded(traction.values.mean(axis=1))
            surface.cell_data["status"] = contact_status(traction)
            save_grid(surface, Path(folder) / f"contact_{traction.contact.name}.vtkhdf")

    on_root(model.comm, Path(folder) / "body.vtkhdf", write)


# -- all ranks together -----------------------------------------------------------------------------------------------


def _written(surface: Surface) -> np.ndarray:
    """Reference points at which a facet is written: its nodes, or those of a polyline."""
    d, k = surface.d - 1, surface.degree
    return subdivided(d, PARTS)[0] if (d, k) == (1, 2) else nodes(d, k)
