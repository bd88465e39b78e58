"""Draw plots and pictures of a run, and write files for ParaView.

Curves and maps are drawn by matplotlib, bodies by pyvista. All functions are
collective. Data are gathered on rank 0 of the mesh's communicator, which draws and
writes. The other ranks import neither matplotlib nor pyvista. An exception on rank 0 is
raised on all ranks. No display is needed.

Pictures and plots go to a file, whose suffix gives the format (png, pdf or svg), and
whose folder is made if it is missing; or on axes of matplotlib that are given as
``ax``, in 2D; or without either in a new figure. They return the axes on rank 0. In pdf
and svg files, bodies in the plane are lines and polygons, and bodies in 3D are
images.
"""

from erc_contact.output.comparison import compare
from erc_contact.output.contact_plots import plot_contact
from erc_contact.output.curves import plot_history
from erc_contact.output.deformed import draw_deformed, draw_near
from erc_contact.output.mesh_pictures import draw_meshes
from erc_contact.output.paraview import write_fields
from erc_contact.output.pictures import draw_error, draw_state
from erc_contact.output.revolved import draw_revolved
from erc_contact.output.series import write_meshes
from erc_contact.output.size_pictures import draw_sizes
from erc_contact.output.view_page import View
from erc_contact.output.views import show_error, show_history, show_solution
from namedmesh import draw_parts

__all__ = [
    "View",
    "compare",
    "draw_deformed",
    "draw_error",
    "draw_meshes",
    "draw_near",
    "draw_parts",
    "draw_revolved",
    "draw_sizes",
    "draw_state",
    "plot_contact",
    "plot_history",
    "show_error",
    "show_history",
    "show_solution",
    "write_fields",
    "write_meshes",
]
