"""Write the fields of an admissible pair for ParaView: u^, sigma^, r^, eps_E.

Rank 0 writes the files through pyvista, because DOLFINx 0.11 writes only one array to a
file.

Symbols: u^ and sigma^ admissible displacement and stress, r^ admissible contact
traction, r_n and r_t its normal and tangential parts, b friction bound, g gap before
the deformation, w^ displacement of a contact: on a foundation u^, between two bodies
the jump of u^; w^_n and w^_t its normal and tangential parts, eps_E share of one
element of the relative error.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run, error_of
from erc_contact.model.copies import Motion, shown_copies
from erc_contact.output.files import PARTS, save_grid
from erc_contact.output.gathered import WholeContact, body_nodes, nodal_displacement, whole_contact
from erc_contact.results.states import state, states_of
from erc_contact.results.stresses import cell_stresses
from namedmesh.base.names import file_stem
from namedmesh.base.ranks import gather_rows
from namedmesh.for_solvers import in_space
from namedmesh.pictures import grid_of, on_root, subdivide
from namedmesh.simplex import bernstein, lagrange, nodes


def write_fields(
    error: ConstitutiveError | Run, folder: str | Path, *, whole: bool = False
) -> None:
    """Write the fields for ParaView as VTKHDF files; collective.

    ``body.vtkhdf`` has at the nodes

    - ``displacement``: u^ [length],

    and in the cells

    - ``eps_E``: share of the relative error [-],
    - ``stress``: mean of sigma^ in the cell [force/area], 3x3, row by row,
    - ``stress_fe``: mean of the rebalanced finite element stress [force/area], 3x3, row
      by row,
    - ``von_mises``: von Mises stress of ``stress`` [force/area]. If the material does
      not tell the stress out of plane, this component of the stresses is nan, and the
      von Mises stress of the part in plane is written instead, with the name
      ``von_mises_in_plane``,
    - ``stress_best``, ``von_mises_best``: the same of the mean of sigma^ and C eps(u^),
      whose error is known best,
    - of a law with a state its entries after the load step, of
      :class:`erc_contact.Plastic` ``plastic_strain`` (3x3, row by row) and
      ``accumulated`` [-].

    ``contact_<name>.vtkhdf`` is written for each contact; for a pair it has the facets
    of the side with its name. Each facet has points of its own. The file has at the
    points

    - ``traction``: r^ [force/area],
    - ``pressure``: -r_n [force/area],
    - ``friction_bound``: b [force/area], the greatest ``|r_t|`` that the law allows,
      of orthotropic friction along its axis,
    - ``gap``: the gap that is left, g - w^_n [length],
    - ``slip``: w^_t, or its change since the last step of a history [length], without
      the tangential deflection of a compliant foundation,

    and in the cells

    - ``mean_traction``: mean of r^ on the facet [force/area],
    - ``status``: 0 open, 1 slip, 2 stick, 3 closed without friction.

    ``<name>`` is the name of the part, see :class:`erc_contact.History`; ``part`` at
    the root of the file tells it in full.

    For degree 2 the cells are quadratic, with values at all nodes, and facets in 2D are
    polylines. ParaView integrates quadratic cells by straight parts, and quadratic
    lines not at all. Its integral of ``mean_traction`` is exactly the contact force.

    Args:
        error: The error with its admissible pair, or a history.
        folder: Folder of the files, which is made if it is missing.
        whole: Whether ``body.vtkhdf`` has the copies, too, that make the whole of a
            body with planes of symmetry or sectors; of periodic sides the next copies.

    Raises:
        InputError: If the whole is asked for of a body that has no copies.
        OSError: If a file cannot be written.
    """
    error = error_of(error)
    admissible = error.admissible
    space = error.model.space
    body = gather_rows(space.comm, **body_nodes(space), displacement=nodal_displacement(admissible))
    fields = cell_stresses(admissible)
    for name, shape in states_of(admissible).items():
        values = state(admissible, name)
        fields[name] = values.reshape(-1, 9) if shape else values
    cells = gather_rows(space.comm, **fields, eps_E=error.indicators)
    contacts = [whole_contact(admissible, traction) for traction in admissible.tractions_per_area]
    copies = shown_copies(error.model, "write_fields: whole") if whole else []

    def write() -> None:
        of_body, of_cells = _with_copies(body, cells, copies) if copies else (body, cells)
        grid = grid_of(of_body["points"], of_body["cells"], space.d)
        grid.point_data["displacement"] = of_body["displacement"]
        grid.cell_data.update(of_cells)
        save_grid(grid, Path(folder) / "body.vtkhdf")
        for contact in contacts:
            assert contact is not None
            name = contact.traction.contact.name
            file = f"contact_{file_stem(name)}.vtkhdf"
            save_grid(_contact_grid(contact), Path(folder) / file, part=name)

    on_root(space.comm, Path(folder) / "body.vtkhdf", write)


def _with_copies(
    body: dict[str, np.ndarray],
    cells: dict[str, np.ndarray],
    copies: Sequence[tuple[Motion, np.ndarray]],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return points, cells and fields of all copies of a body, in their order.

    Args:
        body: "points" and "displacement" [length], and "cells".
        cells: Fields in the cells: numbers, and tensors of nine columns.
        copies: From :func:`erc_contact.model.copies.shown_copies`.
    """
    parts: dict[str, list[np.ndarray]] = {name: [] for name in (*body, *cells)}
    for number, ((turn, shift), jump) in enumerate(copies):
        parts["points"].append(body["points"] @ turn.T + shift)
        parts["displacement"].append(body["displacement"] @ turn.T + jump)
        parts["cells"].append(body["cells"] + number * len(body["points"]))
        for name, values in cells.items():
            parts[name].append(_turned(values, turn))
    whole = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    return {name: whole[name] for name in body}, {name: whole[name] for name in cells}


def _turned(values: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return numbers as they are, and tensors (n, 9) turned; what is nan stays so."""
    if values.ndim == 1:
        return values
    tensors = np.nan_to_num(values).reshape(-1, 3, 3)
    turned = (turn @ tensors @ turn.T).reshape(values.shape)
    return np.where(np.isnan(values), np.nan, turned)


def _contact_grid(surface: WholeContact) -> Any:
    """Make the grid of a contact with its fields, see :func:`write_fields`."""
    traction = surface.traction
    d = surface.d
    points = _written_points(surface)
    # r^ is given by Bernstein coefficients, gap and slip by values at the nodes.
    shape = bernstein(d - 1, surface.degree, points)
    nodal = lagrange(d - 1, surface.degree, points)
    x = np.matmul(nodal, surface.x)
    facets = np.arange(x[..., 0].size).reshape(x.shape[:2])
    grid = grid_of(x.reshape(-1, 3), facets, d - 1)
    values = np.matmul(shape, traction.values)
    slip = np.matmul(nodal, surface.slip)
    grid.point_data["traction"] = in_space(values.reshape(-1, d))
    grid.point_data["pressure"] = traction.at_points(points)[0].ravel()
    grid.point_data["friction_bound"] = (traction.friction_bound @ shape.T).ravel()
    grid.point_data["gap"] = (surface.gap_left @ nodal.T).ravel()
    grid.point_data["slip"] = in_space(slip.reshape(-1, d))
    grid.cell_data["mean_traction"] = in_space(traction.values.mean(axis=1))
    grid.cell_data["status"] = surface.status
    return grid


def _written_points(surface: WholeContact) -> np.ndarray:
    """Return the reference points of the values that are written on a facet.

    They are its nodes, or the points of a polyline.

    Returns:
        Shape (q, d-1).
    """
    d = surface.d - 1
    if d == 1 and surface.degree == 2:
        return subdivide(d, PARTS)[0]
    return nodes(d, surface.degree)
