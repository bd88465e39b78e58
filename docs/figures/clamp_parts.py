"""Draws clamp_parts.png: the names of the clamp that a STEP file gives.

python docs/figures/clamp_parts.py
"""

from pathlib import Path

import erc_contact as ec

HERE = Path(__file__).parent
clamp = ec.read_mesh(HERE.parents[1] / "meshes" / "clamp.step", size=8.0)
ec.draw_parts(clamp, HERE / "clamp_parts.png")
