"""Draw the pictures at the top of the home page, for light and dark pages.

They are written to the folder strip beside this script. Bodies stand on a transparent
ground and serve both kinds of pages; plots are drawn for each.

python docs/figures/strip.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv
from PIL import Image
from vtkmodules.vtkIOHDF import vtkHDFReader

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

HERE = Path(__file__).parent
FOLDER = HERE / "strip"
SIZE = 4.0, 3.0
"""Width and height of a picture [inches]."""
DPI = 100
GROUNDS = {"light": "default", "dark": "dark_background"}
"""Style of matplotlib for each kind of page."""
LOOK = ["namedmesh.pictures.style", {"font.size": 22, "lines.linewidth": 3.0}]
"""Font of all our pictures, large enough for a picture of a quarter of the page."""


def save(figure, name):
    """Write a figure of matplotlib as WebP, on a transparent ground."""
    path = FOLDER / f"{name}.webp"
    figure.savefig(path, dpi=DPI, transparent=True, pil_kwargs={"quality": 80, "method": 6})
    plt.close(figure)


def draw_clamp():
    """Draw the clamp of ``demos/clamp.py`` from CAD, with its von Mises stress."""
    clamp = ec.read_mesh(HERE.parents[1] / "meshes" / "clamp.step", size=8.0)
    thread, *faces = clamp.touching()
    scene = ec.Scene(
        ec.Elastic(210e3, 0.3),
        ec.Displacement("1", (0.0, 0.0, 0.0)),
        loads=ec.Traction("13", pressure=20.0),
        ties=ec.Tied(*thread),
        contacts=[ec.Contact(*pair, friction=0.15) for pair in faces],
    )
    error = ec.adapt(scene, clamp, accuracy=0.2, degree=2, strategy=ec.Mark()).error
    with TemporaryDirectory() as folder:
        ec.output.write_fields(error, folder)
        reader = vtkHDFReader()
        reader.SetFileName(str(Path(folder) / "body.vtkhdf"))
        reader.Update()
        body = pv.wrap(reader.GetOutput())
    stress = body.cell_data["von_mises"]
    plotter = pv.Plotter(off_screen=True, window_size=[int(DPI * side) for side in SIZE])
    warped = body.warp_by_vector("displacement", factor=200.0)
    look = {"cmap": "viridis", "clim": (0.0, np.quantile(stress, 0.98))}
    plotter.add_mesh(warped, scalars=stress, show_scalar_bar=False, **look)
    plotter.view_vector((-0.8, -1.0, 0.55), viewup=(0.0, 0.0, 1.0))
    plotter.camera.zoom(1.0)
    plotter.enable_anti_aliasing("ssaa")
    picture = plotter.screenshot(transparent_background=True, return_img=True)
    Image.fromarray(picture).save(FOLDER / "clamp.webp", quality=80, method=6)


def draw_mesh(error):
    """Draw the mesh of a run, coloured by the error of its elements."""
    geometry = error.domain.mesh.geometry
    x, cells = geometry.x, cell_nodes(geometry)
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    colours = np.log10(error.indicators)
    axes.tripcolor(x[:, 0], x[:, 1], cells, colours, cmap="viridis", edgecolors="#00000060", lw=0.3)
    axes.set(aspect="equal")
    axes.axis("off")
    save(figure, "mesh")


def draw_traction(error):
    """Plot pressure and shear of the contact, and the friction bound."""
    contact = error.profile("bottom")
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    axes.plot(contact["x"], contact["pressure"], "C0", label="pressure")
    axes.plot(contact["x"], contact["shear"], "C1", label="shear")
    bound = contact["friction_bound"]
    axes.fill_between(contact["x"], -bound, bound, color="gray", alpha=0.3, label="friction bound")
    axes.set(xlabel="x [mm]", ylabel="[MPa]", ylim=(None, 400.0))
    axes.legend(frameon=False, fontsize=19, handlelength=1.0)
    return figure


def draw_interval(errors, bounds):
    """Plot the interval of the pressing force over the error of the mesh."""
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    percent = 100 * np.array(errors)
    low = np.array([each.low for each in bounds])
    high = np.array([each.high for each in bounds])
    axes.fill_between(percent, low, high, color="C0", alpha=0.35)
    axes.plot(percent, (low + high) / 2, "C0o-", ms=6)
    axes.set(xlabel="error [%]", ylabel="force [N/mm]")
    axes.invert_xaxis()
    return figure


errors, bounds = [], []


def bounded(error, step):
    """Keep the interval of the pressing force on each mesh."""
    errors.append(error.relative)
    bounds.append(ec.resultant(error, "bottom", (0.0, 1.0)))


block = ec.rectangle((0.0, 0.0), (20.0, 14.0), size=2.5)
support = ec.Displacement("top", (0.008, -0.01))
pushed = ec.Scene(ec.Elastic(70e3, 0.3), support, contacts=ec.Contact("bottom", friction=0.3))
tresca = ec.Contact("bottom", friction=ec.Tresca(15.0))
given = ec.Scene(ec.Elastic(70e3, 0.3), support, contacts=tresca)
ec.adapt(given, block, accuracy=0.01, callback=bounded)
error = ec.adapt(pushed, block, accuracy=0.04).error

FOLDER.mkdir(exist_ok=True)
draw_clamp()
draw_mesh(error)
for ground, style in GROUNDS.items():
    with plt.style.context([style, *LOOK]):
        save(draw_traction(error), f"traction-{ground}")
        save(draw_interval(errors, bounds), f"interval-{ground}")
