"""Pictures of a run: curves and maps by matplotlib, bodies by pyvista.

All functions are collective: data are gathered to rank 0 of the mesh's communicator, which draws; the other ranks
import neither matplotlib nor pyvista. What fails on rank 0 is raised on all ranks. No display is needed. The folder
of a path is made if it is missing; the suffix of a picture chooses its format (png, pdf, svg).
"""

from __future__ import annotations

from erc_contact.output.pictures import draw_deformed, draw_error, draw_meshes, draw_sizes
from erc_contact.output.plots import plot_contact, plot_history

__all__ = ["draw_deformed", "draw_error", "draw_meshes", "draw_sizes", "plot_contact", "plot_history"]
