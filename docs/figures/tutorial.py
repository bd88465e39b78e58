"""Take the pictures of "First steps" from what the code of that page writes.

They are written to the folder tutorial beside this script.

python docs/figures/tutorial.py
"""

import os
import re
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

HERE = Path(__file__).parent
PAGE = HERE.parent / "first_steps.md"
PICTURES = {
    "first": "results/first/contact_bottom.png",
    "bridge": "results/bridge/deformed.png",
    "blocks": "results/blocks/error_map.png",
    "cycle": "results/cycle/loop_bottom.png",
    "certified": "results/certified.png",
}
"""Where the code of the page writes the picture of each step."""
WIDTH = {"cycle": 440}
"""Width of a picture on its page [pixels], where it is not 720."""

code = "\n".join(re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL))
with TemporaryDirectory() as folder:
    os.chdir(folder)
    exec(compile(code, str(PAGE), "exec"), {})
    for name, path in PICTURES.items():
        picture = Image.open(path).convert("RGB")
        width = WIDTH.get(name, 720)
        height = round(picture.height * width / picture.width)
        small = picture.resize((width, height), Image.Resampling.LANCZOS)
        small.save(HERE / "tutorial" / f"{name}.webp", quality=80, method=6)
    os.chdir(HERE)
