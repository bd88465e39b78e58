"""Put the displacement of a file on the mesh of a model."""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import together
from erc_contact.model.model import Model
from namedmesh.for_solvers import FieldOnMesh


def values_of_file(model: Model, field: FieldOnMesh) -> np.ndarray:
    """Return the displacement of a file at the nodes of this rank [length], (nodes, d).

    At cuts of preloads it is without the jumps that their shifts add.

    Raises:
        InputError: If nodes are outside of the bodies of the file.
    """
    nodes = model.space.V.dofmap.list
    x = model.space.V.tabulate_dof_coordinates()[:, : model.space.d]
    return field.at_nodes(nodes, x) - model.jumps_at(field.cell_of_nodes(nodes), x)


def interpolated(model: Model, field: FieldOnMesh) -> fem.Function:
    """Return the displacement of a file at the nodes of a mesh [length]; collective.

    Raises:
        InputError: If nodes are outside of the bodies of the file.
    """
    u = model.space.function()
    u.x.array[:] = together(model.space.comm, values_of_file, model, field).ravel()
    u.x.scatter_forward()
    return u
