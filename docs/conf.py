"""Configure Sphinx: pages in Markdown, demos as a gallery, the API from docstrings.

CONTRIBUTING.md has the commands.
"""

import logging
import sys
from importlib import metadata, util
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from sphinx_gallery.sorting import ExplicitOrder
from subjects import DEMOS, FIRST_CELL

# A style that furo needs makes the root logger repeat all rows.
logging.getLogger("erc_contact").propagate = False

project = "erc_contact"
author = "The erc_contact authors"
copyright = "2026, the erc_contact authors"
release = metadata.version("erc-contact")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinxcontrib.bibtex",
    "downloads",
    "links",
    "rendered",
    "subjects",
]
nitpicky = True
nitpick_ignore = [
    ("py:class", f"erc_contact.{name}")  # types of members that no page is about
    for name in (
        "admissible.cells.CellGeometry",
        "decks.plan.DeckPlan",
        "decks.told.Note",
        "decks.told.Told",
        "admissible.elastic.CellStress",
        "newton.distortion.Distortion",
        "model.law.constitution.Constitution",
        "model.contact.friction.Friction",
        "model.contact.friction_set.Disc",
        "model.contact.trace.Facets",
        "model.last_step.LastStep",
        "model.law.potential.Linearised",
        "model.space.Space",
        "model.law.strains.Strains",
        "newton.given.AnyField",
        "scene.goal.Goal",
        "newton.linear.solver.ElasticSolver",
        "error.runs.Run",
        "error.runs.AdaptiveRun",
        "error.runs.LoadingHistory",
    )
]
nitpick_ignore_regex = [
    ("py:.*", r"(?!erc_contact).*")
]  # names of other packages, whose pages CI does not ask

# The lists of names of other sites come over the network. So links to them are made
# where that is asked for, by sphinx-build -t linked; else the names are text.
intersphinx_mapping = (
    {
        "dolfinx": ("https://docs.fenicsproject.org/dolfinx/main/python/", None),
        "numpy": ("https://numpy.org/doc/stable/", None),
        "python": ("https://docs.python.org/3/", None),
        "pyvista": ("https://docs.pyvista.org/", None),
        "scipy": ("https://docs.scipy.org/doc/scipy/", None),
        "ufl": ("https://docs.fenicsproject.org/ufl/main/", None),
    }
    if tags.has("linked")  # noqa: F821 - Sphinx defines tags
    else {}
)

mathjax = str(
    Path(util.find_spec("sphinx-mathjax-offline").origin).parent
    / "static"
    / "mathjax"
    / "tex-svg.js"
)
mathjax_path = Path(mathjax).name  # formulas without a foreign server and without fonts

html_theme = "furo"
addresses = dict(
    entry.split(", ", 1) for entry in metadata.metadata("erc-contact").get_all("Project-URL") or ()
)
if "Source" in addresses:  # each page then links to its file
    html_theme_options = {
        "source_repository": addresses["Source"],
        "source_branch": "main",
        "source_directory": "docs/",
    }
html_title = "erc_contact"
html_static_path = ["_static", mathjax]
html_css_files = ["site.css"]
html_logo = html_favicon = "_static/logo.svg"

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

copybutton_exclude = ".linenos, .gp, .go"

autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "member-order": "bysource"}
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": "../demos",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("gallery_hooks.pictures",),
    "reset_modules": ("gallery_hooks.name_file",),
    "abort_on_example_error": True,
    "capture_repr": (),
    "download_all_examples": False,
    "within_subsection_order": ExplicitOrder([*(f"{demo}.py" for demo in DEMOS), "*"]),
    "first_notebook_cell": FIRST_CELL,
    "show_signature": False,
    "write_computation_times": False,
}
