"""Try every mesh file below a folder: what comes in, and what is said otherwise.

    python benchmarks/files.py FOLDER [ENDING ...]

Each file is read in a process of its own, so that one that would end the interpreter is
a row of the table. Endings restrict the files, ".inp" for instance. At the end stands
for each folder in it how many came in, how many hold no solid, how many were refused in
a sentence, and how many ended otherwise.
"""

import multiprocessing
import re
import signal
import sys
import time
from collections import Counter, defaultdict
from multiprocessing.connection import Connection
from pathlib import Path

import erc_contact as ec

ENDINGS = (
    *(".msh", ".unv", ".med", ".cgns", ".mesh", ".meshb", ".bdf", ".nas", ".inp", ".frd"),
    *(".vtk", ".vtu", ".pvtu", ".vti", ".vts", ".vtr", ".vtkhdf", ".xdmf", ".xmf", ".su2"),
    *(".cdb", ".mail", ".mmed", ".rmed", ".k", ".key", ".dyn"),
    *(".e", ".exo", ".ex2", ".g", ".gen", ".mdpa", ".elements", ".node", ".ele", ".fem", ".dat"),
    *(".step", ".stp", ".iges", ".igs", ".brep", ".geo", ".stl", ".avs", ".vol", ".ugrid"),
)
"""Endings of files that may hold a mesh or a drawing."""
NO_SOLID = (
    "no cells of a solid",
    "a shell; allowed",
    "has dimension",
    "enclose no solid",
    "no solid,",
)
"""Words of refusals of files without solids."""
WORDS = ("read", "no solid", "refused", "crashed")
"""What may come of a file."""
PATIENCE = 120.0
"""Time that a file has [s]."""
SHOWN = 180
"""Characters of names or of a sentence in a row."""


def read(path: Path) -> ec.Domain:
    """Read a file; a drawing gets cells of the size that its refusal proposes."""
    try:
        return ec.read_mesh(path)
    except ec.InputError as reason:
        proposed = re.search(r"for instance size=([\d.e+-]*\d)", str(reason))
        if proposed is None:
            raise
        return ec.read_mesh(path, size=float(proposed[1]))


def tried(path: Path, answers: Connection) -> None:
    """Read a file and send what came of it."""
    begin = time.perf_counter()
    try:
        domain = read(path)
    except ec.InputError as reason:
        kind = "no solid" if any(words in str(reason) for words in NO_SOLID) else "refused"
        answers.send((kind, time.perf_counter() - begin, str(reason)))
        return
    parts = ", ".join(domain.names)
    regions = ", ".join(domain.regions)
    words = f"{domain.cells} cells in {domain.dim}D; regions {regions}; parts {parts}"
    answers.send(("read", time.perf_counter() - begin, words))


def row(path: Path) -> tuple[str, float, str]:
    """Return what came of a file: a word, seconds, and more words."""
    context = multiprocessing.get_context("fork")
    answers, end = context.Pipe(duplex=False)
    process = context.Process(target=tried, args=(path, end))
    process.start()
    end.close()
    try:
        if answers.poll(PATIENCE):
            return answers.recv()
        process.kill()
        return "crashed", PATIENCE, "no answer"
    except EOFError:
        process.join()
        code = process.exitcode or 0
        cause = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return "crashed", 0.0, cause
    finally:
        process.join()


def main() -> None:
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    endings = tuple(sys.argv[2:]) or ENDINGS
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in endings or not path.is_file():
            continue
        word, seconds, words = row(path)
        counts[path.relative_to(folder).parts[0] if path.parent != folder else "."][word] += 1
        text = " ".join(words.replace(str(folder) + "/", "").split())
        print(f"{word:8} {seconds:6.2f} s  {path.relative_to(folder)}: {text[:SHOWN]}", flush=True)
    counts["all"] = sum(counts.values(), Counter())
    for source, found in counts.items():
        words = ", ".join(f"{found[word]} {word}" for word in WORDS)
        print(f"{source}: {words} of {found.total()}")


if __name__ == "__main__":
    main()
