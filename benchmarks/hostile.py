"""Change files of a folder at random, and look what reading them does.

``python benchmarks/hostile.py [FOLDER] [SEED] [COUNT]`` changes each time a file of the
folder (by default ``meshes``) in a way of its own: bytes, numbers, lines, words, its
end, its name; and it puts commands into it. What must come out is a domain or an
InputError in our words. It counts what is neither, and what is written to the disk.
"""

from __future__ import annotations

import logging
import os
import random
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import perf_counter

import erc_contact as ec

ACTS = b'\nSystemCall "touch acted"; Printf("x") > "acted too"; Save "acted.msh";\n'
CARDS = (
    b"*INCLUDE, INPUT=/etc/passwd\n",
    b"*NSET, NSET=N, GENERATE\n1,999999999999,1\n",
    b"INCLUDE '/etc/passwd'\n",
    b"\0" * 50,
)
NUMBERS = (b"99999999999", b"-1", b"1e308", b"nan", b"18446744073709551616", b"0")
WORDS = (b"../../x", b"$(touch acted)", b"\x1b[2J", b"A" * 300, b"")
ENDINGS = (".geo", ".msh", ".inp", ".vtu", ".med", ".xdmf", ".bdf", ".xao", ".opt", ".mesh", "")
GREATEST = 300_000
"""Greatest file that is changed [bytes]."""
OF_PYTHON = re.compile(r"[a-z]Error\b|unpack|index out|NoneType|object has no|invalid literal")
"""Words of Python that no message may have."""


def changed(content: bytes, rng: random.Random) -> bytes:
    """Return the content of a file after a change."""
    place = rng.randrange(len(content) + 1)
    kind = rng.randrange(6)
    if kind == 0:
        return content[:place] + bytes([rng.randrange(256)]) + content[place + 1 :]
    if kind == 1:
        return content[:place]
    if kind == 2:
        return content[:place] + rng.choice((ACTS, *CARDS)) + content[place:]
    if kind == 3:
        lines = content.split(b"\n")
        rng.shuffle(lines)
        return b"\n".join(lines)
    pattern = rb"[A-Za-z_]{4,}" if kind == 4 else rb"(?<![\w.])-?\d+\.?\d*"
    found = list(re.finditer(pattern, content))
    if not found:
        return ACTS + content
    match = rng.choice(found)
    new = rng.choice(WORDS if kind == 4 else NUMBERS)
    return content[: match.start()] + new + content[match.end() :]


def main(folder: Path, seed: int, count: int) -> None:
    """Try changed files, and print what came of them."""
    logging.disable(logging.CRITICAL)
    rng = random.Random(seed)
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    contents = {path: path.read_bytes() for path in files if path.stat().st_size < GREATEST}
    outcomes: Counter[str] = Counter()
    began = perf_counter()
    with tempfile.TemporaryDirectory() as top:
        inside = Path(top) / "deep" / "inside"
        inside.mkdir(parents=True)
        os.chdir(inside)
        for _ in range(count):
            source = rng.choice(list(contents))
            content = contents[source]
            for _ in range(rng.choice((1, 1, 2, 3))):
                content = changed(content, rng)
            name = source.name if rng.random() < 0.7 else f"file{rng.choice(ENDINGS)}"
            path = inside / name
            path.write_bytes(content)
            try:
                ec.read_mesh(path)
                outcome = "domains"
            except ec.InputError as reason:
                outcome = "refused"
                if OF_PYTHON.search(str(reason)):
                    outcome = "words of Python"
                    print(f"{source.name} as {name}: {reason}")
            except Exception as reason:
                outcome = f"bare {type(reason).__name__}"
                print(f"{source.name} as {name}: {outcome}: {reason}")
            path.unlink()
            outcomes[outcome] += 1
            written = [p for p in Path(top).rglob("*") if p not in (inside, inside.parent)]
            outcomes["written"] += len(written)
            for new in written:
                print(f"{source.name} as {name}: wrote {new}")
                new.unlink()
        os.chdir(folder)
    print(f"{count} files in {perf_counter() - began:.0f} s: {dict(outcomes)}")


if __name__ == "__main__":
    given = sys.argv[1:]
    meshes = Path(__file__).resolve().parents[1] / "meshes"
    main(
        Path(given[0]).resolve() if given else meshes,
        int(given[1]) if len(given) > 1 else 0,
        int(given[2]) if len(given) > 2 else 300,
    )
