"""Tell sphinx-gallery about the demos: where each is, and where its pictures are."""

import builtins
import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

DEMOS = Path(__file__).parents[1] / "demos"
FIRST = ("deformed", "tightened", "near", "error_map")
"""Pictures that tell what a demo is about.

The first picture of a page is its thumbnail in the gallery.
"""


def pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Move the pictures that a block of a demo has written into the gallery.

    They are in the folder of the demo in results.
    """
    found = sorted(Path("results", Path(block_vars["src_file"]).stem).rglob("*.png"), key=_place)
    moved = [shutil.move(path, next(block_vars["image_path_iterator"])) for path in found]
    return figure_rst(moved, gallery_conf["src_dir"])


def _place(picture: Path) -> tuple[int, str]:
    """Order pictures: the pictures of :data:`FIRST`, then all others by their names."""
    return (FIRST.index(picture.stem) if picture.stem in FIRST else len(FIRST)), str(picture)


def name_file(gallery_conf: dict[str, Any], name: str | None) -> None:
    """Define ``__file__`` for a demo, which finds its mesh by it.

    sphinx-gallery runs scripts without it.
    """
    if name is not None:
        builtins.__file__ = str(next(DEMOS.rglob(name)))
