"""Draw named meshes: figures of matplotlib, bodies by pyvista.

Data are gathered on rank 0, which draws; no other rank imports matplotlib or pyvista.
Who draws fields on these meshes takes figures, skins and views from here.
"""

from namedmesh.pictures.figures import (
    COLOUR_CYCLE,
    DPI,
    draw_figure,
    new_figure,
    on_root,
    only_in_2d,
)
from namedmesh.pictures.grids import (
    body_mesh,
    degree_of,
    grid_of,
    number_cells,
    subdivide,
    vtk_cells,
)
from namedmesh.pictures.skin import DIVISIONS, Skin, outline, sample, skin_of, straight
from namedmesh.pictures.views import (
    SPACE,
    WORDS,
    ShownPart,
    corners_seen,
    images,
    lack_of_window,
    limits,
    show,
    views_of,
)

__all__ = [
    "COLOUR_CYCLE",
    "DIVISIONS",
    "DPI",
    "SPACE",
    "WORDS",
    "ShownPart",
    "Skin",
    "body_mesh",
    "corners_seen",
    "degree_of",
    "draw_figure",
    "grid_of",
    "images",
    "lack_of_window",
    "limits",
    "new_figure",
    "number_cells",
    "on_root",
    "only_in_2d",
    "outline",
    "sample",
    "show",
    "skin_of",
    "straight",
    "subdivide",
    "views_of",
    "vtk_cells",
]
