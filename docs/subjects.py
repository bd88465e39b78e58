"""Group the demos of the gallery by subject; say how their notebooks begin."""

from typing import Any

SUBJECTS = {
    "Contact of bodies": (
        "block two_blocks hertz hertz_cylinders sphere sphere_in_shell pin_in_lug wide_hole "
        "receding wavy_surface parabolic_layers platens press_fit disc_sector punch brake "
        "chain_link crack masonry wood"
    ),
    "Rings": "o_ring ball_on_layer turned_bolt turned_press_fit",
    "CAD and bolted assemblies": "part clamp flange_from_cad as1 bolt flange bracket",
    "Loading histories": "hysteresis cattaneo_mindlin around thermostat",
    "Plasticity": "plastic_layer lug imprint autofrettage yielding_bolt shrink_fit",
    "Numbers": "force_bounds run_time paper greco incompressible many_solutions",
    "Other codes": "other_code",
}
"""Subjects in their order -> the demos of each, in theirs."""
DEMOS = [demo for demos in SUBJECTS.values() for demo in demos.split()]
FIRST_CELL = 'from pathlib import Path\n\n__file__ = str(Path("notebook.ipynb").resolve())'
"""First cell of a notebook: its folder is where a demo finds its files."""
OPENING = """.. raw:: html

    <div class="sphx-glr-thumbnails">

"""
CLOSING = """.. raw:: html

    </div>

"""
THUMBNAIL = '.. raw:: html\n\n    <div class="sphx-glr-thumbcontainer"'
"""How a thumbnail of the page begins, which has the name of its demo below."""


def heading(subject: str) -> str:
    """Return the heading of a subject."""
    return f"{subject}\n{'-' * len(subject)}\n\n"


def by_subject(page: str) -> str:
    """Return the page of the gallery, whose thumbnails are in order, with headings."""
    for number, (subject, demos) in enumerate(SUBJECTS.items()):
        first = page.index(f":doc:`/gallery/{demos.split()[0]}`")
        if number == 0:
            place = page.index(OPENING)
            page = page[:place] + heading(subject) + page[place:]
        else:
            place = page.rindex(THUMBNAIL, 0, first)
            page = page[:place] + CLOSING + heading(subject) + OPENING + page[place:]
    # The examples in a folder of their own are a subject, too.
    own = "Classes of your own"
    return page.replace(f"{own}\n{'=' * len(own)}\n", heading(own).rstrip("\n") + "\n")


def group(app: Any, page: str, source: list[str]) -> None:
    """Write the headings when the page of the gallery is read."""
    if page == "gallery/index":
        source[0] = by_subject(source[0])


def setup(app: Any) -> None:
    """Group the page of the gallery that sphinx-gallery has made."""
    app.connect("source-read", group)
