"""Draws clamp_parts.webp: the names of the clamp that a STEP file gives.

python docs/figures/clamp_parts.py
"""

from pathlib import Path

from PIL import Image

import erc_contact as ec

HERE = Path(__file__).parent
clamp = ec.read_mesh(HERE.parents[1] / "meshes" / "clamp.step", size=8.0)
path = HERE / "clamp_parts.webp"
ec.draw_parts(clamp, path)
picture = Image.open(path).convert("RGB")
small = picture.resize((1000, 1000 * picture.height // picture.width), Image.Resampling.LANCZOS)
small.save(path, quality=75, method=6)
