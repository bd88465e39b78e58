"""Kill, damage and hinder runs that are kept.

Does the same call end with the same history, and never with a wrong one?

- `kills`: a run in 2D (marking), one of a curved body (gmsh meshes its true shape
  again) and one in 3D, on 1, 2 or 3 ranks, are killed (SIGKILL to all) at a random
  moment and go on, on another number of ranks each time, until they are through. The
  history must be the history of the undisturbed run: cells, Newton steps, eps to 1e-8.
  (In 3D the solver is the direct one: with multigrid round-off, and so the ranks, may
  decide on one Newton step more or less.)
- `damage`: each file of a checkpoint truncated, emptied, removed, and with one byte
  changed: all bytes of the smallest file, samples of the others. Each must be found,
  and the run must go on from the last good level, or say why not.
- `faults`: a full disk, a folder that cannot be written, a folder that is removed, a
  rank that dies. The first two mount a tmpfs of their own, which takes root.
- `cost`: seconds of writing over the seconds of the run.

Any failure is counted, and the process ends with code 1.

    OMP_NUM_THREADS=1 python benchmarks/survive.py [kills] [damage] [faults] [cost]
    [--kills 30] [--seed 0]
"""

import argparse
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from time import monotonic, perf_counter, process_time, sleep
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from mpi4py import MPI  # isort: skip

from erc_contact.run import checkpoint
from erc_contact.run.levels import Folder, unpack_level
from namedmesh.keeping import BLOCK, Damaged

MESHES = Path(__file__).parent.parent / "meshes"
SAME = 1e-8
"""Difference of eps between two runs that are the same."""
SOON = 20.0
"""Time in which a run whose rank has died must have ended [s]."""


def flat() -> tuple[ec.Scene, ec.Domain, dict]:
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14)), {"max_steps": 12}


def curved() -> tuple[ec.Scene, ec.Domain, dict]:
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.02))],
        contacts=[ec.Contact("arc", friction=0.3, gap=lambda x: x[1], normal=(0.0, -1.0))],
    )
    settings = {"max_steps": 6, "strategy": ec.SizeMap(leap=2.0), "degree": 2}
    return scene, ec.read_mesh(MESHES / "half_disc.geo", scripts=True), settings


def space() -> tuple[ec.Scene, ec.Domain, dict]:
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.02, 0.01, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return (
        scene,
        ec.box((0.0,) * 3, (1.0,) * 3, cells=(2, 2, 2)),
        {"max_steps": 7, "strategy": ec.Mark(0.3), "solver": "direct"},
    )


PROBLEMS = {"flat": flat, "curved": curved, "space": space}


def run(name: str, folder: Path | None, **changes: object) -> ec.History:
    scene, domain, settings = PROBLEMS[name]()
    return ec.adapt(scene, domain, 1e-3, **settings | {"checkpoint": folder} | changes)


def child(name: str, folder: str) -> None:
    """Run in a process of its own; print each mesh, and the rows at the end."""
    comm = MPI.COMM_WORLD

    def tell(*_: object) -> None:
        pids = comm.gather(os.getpid())
        if pids:
            print("mesh", *pids, flush=True)

    tell()
    history = run(name, Path(folder) if folder != "-" else None, callback=tell)
    if comm.rank == 0:
        print("rows", json.dumps(rows(history)), flush=True)


def rows(history: ec.History) -> list[tuple[int, int, float]]:
    return [(step.cells, step.newton_steps, step.eps) for step in history.steps]


def same(a: list, b: list) -> bool:
    return len(a) == len(b) and all(
        x[:2] == y[:2] and abs(x[2] - y[2]) <= SAME * y[2]
        for x, y in zip(map(tuple, a), map(tuple, b), strict=True)
    )


def started(name: str, folder: Path | str, ranks: int) -> subprocess.Popen:
    launch = [] if ranks == 1 else [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)]
    own = {"OMP_NUM_THREADS": "1", "MPIR_CVAR_CH4_PROGRESS_THROTTLE": "1"}
    own |= {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI"))}
    command = [*launch, sys.executable, "-u", __file__, "--child", name, str(folder)]
    return subprocess.Popen(
        command, env=own, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def after_death(process: subprocess.Popen, moment: float) -> str:
    """Kill all ranks some seconds after they began; return what they have told.

    They may be through before.
    """
    assert process.stdout is not None
    pids = [int(word) for word in process.stdout.readline().split()[1:]]
    ends = monotonic() + moment
    while process.poll() is None and monotonic() < ends:
        sleep(0.005)
    for pid in pids if process.poll() is None else ():
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return process.communicate(timeout=60)[0]


def told_rows(text: str) -> list | None:
    found = [line for line in text.splitlines() if line.startswith("rows")]
    return json.loads(found[0][5:]) if found else None


def kills(count: int, seed: int) -> Counter:
    """Kill each run so many times in all."""
    rng, result = np.random.default_rng(seed), Counter[str]()
    for name in PROBLEMS:
        began = perf_counter()
        undisturbed = rows(run(name, None))
        length = perf_counter() - began
        done = 0
        while done < count:
            with tempfile.TemporaryDirectory() as own:
                folder, ranks = Path(own) / "kept", int(rng.integers(1, 4))
                last, before, steps = None, 0, 0
                while last is None:
                    steps += 1
                    moment = (
                        float(rng.uniform(0.0, 1.5 * length * ranks)) if done < count else 3600.0
                    )
                    last = told_rows(after_death(started(name, folder, ranks), moment))
                    done += last is None
                    there = len(Folder(folder).numbers())
                    result["level lost"] += there < before
                    before, ranks = there, int(rng.choice([r for r in (1, 2, 3) if r != ranks]))
                good = same(last, undisturbed)
                result[f"{name}: {'same' if good else 'OTHER'} history"] += 1
                result["failures"] += not good
                print(
                    f"{name}: {steps - 1} kills, {'same' if good else 'OTHER'} history", flush=True
                )
        result[f"{name}: kills"] = done
    result["failures"] += result["level lost"]
    return result


def damage(seed: int) -> Counter:
    """Damage the files of a checkpoint in all ways."""
    rng, result = np.random.default_rng(seed), Counter[str]()
    with tempfile.TemporaryDirectory() as own:
        kept = Path(own) / "kept"
        undisturbed = rows(run("flat", kept, max_steps=4))
        for number in Folder(kept).numbers():
            content = Folder(kept).file(number).read_bytes()
            some = [*range(BLOCK), *rng.integers(BLOCK, len(content), 2000)]
            places = range(len(content)) if number == 1 else some
            for place in places:
                wrong = bytearray(content)
                wrong[place] ^= 1 << int(rng.integers(8))
                result["bytes"] += 1
                result["bytes not found"] += accepted(bytes(wrong))
            for length in rng.integers(0, len(content), 500):
                result["lengths"] += 1
                result["lengths not found"] += accepted(content[:length])
            for kind in ("truncated", "emptied", "removed", "one byte", "of another level"):
                folder = Path(own) / "again"
                shutil.copytree(kept, folder)
                path = Folder(folder).file(number)
                damaged(path, kind, content, rng, Folder(kept).file(number % 4 + 1).read_bytes())
                try:
                    good = same(rows(run("flat", folder, max_steps=4)), undisturbed)
                    result[f"{kind}: {'same' if good else 'OTHER'} history"] += 1
                except ec.InputError as reason:
                    good = True
                    result[f"{kind}: refused"] += 1
                    print(f"{kind} {number}: {reason}")
                result["failures"] += not good
                shutil.rmtree(folder)
    result["failures"] += result["bytes not found"] + result["lengths not found"]
    return result


def accepted(content: bytes) -> bool:
    try:
        unpack_level(content)
    except Damaged:
        return False
    return True


def damaged(path: Path, kind: str, content: bytes, rng: np.random.Generator, other: bytes) -> None:
    if kind == "removed":
        path.unlink()
        return
    wrong = bytearray(content)
    wrong[int(rng.integers(len(wrong)))] ^= 1 << int(rng.integers(8))
    half = content[: len(content) // 2]
    path.write_bytes(
        {"truncated": half, "emptied": b"", "one byte": bytes(wrong), "of another level": other}[
            kind
        ]
    )


def faults() -> Counter:
    """Hinder a run from being kept; and let a rank die."""
    result, undisturbed = Counter[str](), rows(run("flat", None, max_steps=6))
    for kind in ("full disk", "read-only", "removed"):
        with tempfile.TemporaryDirectory() as own:
            folder = Path(own) / "kept"
            folder.mkdir()
            if (
                kind != "removed"
                and subprocess.run(
                    ["mount", "-t", "tmpfs", "-o", "size=120k", "tmpfs", str(folder)], check=False
                ).returncode
            ):
                result[f"{kind}: not tried, no mount"] += 1
                continue

            def happens(
                error: object, step: ec.Step, kind: str = kind, folder: Path = folder
            ) -> None:
                if step.cells == undisturbed[1][0] and kind == "read-only":
                    subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
                if step.cells == undisturbed[1][0] and kind == "removed":
                    shutil.rmtree(folder)

            try:
                history = run("flat", folder, max_steps=6, callback=happens)
                there = Folder(folder).numbers()
                expected = {"full disk": [1, 2], "read-only": [1, 2], "removed": []}[kind]
                intact = there == expected and all(Folder(folder).read(n).about for n in there)
                again = run("flat", folder, max_steps=6) if there else history
            finally:
                if kind != "removed":
                    subprocess.run(["umount", str(folder)], check=True)
            good = same(rows(history), undisturbed) and intact and same(rows(again), undisturbed)
            result[f"{kind}: {'result returned, earlier levels intact' if good else 'FAILED'}"] += 1
            result["failures"] += not good
    with tempfile.TemporaryDirectory() as own:
        process = started("space", Path(own) / "kept", 2)
        assert process.stdout is not None
        pids = [process.stdout.readline().split()[1:] for _ in range(3)][-1]
        began = monotonic()
        os.kill(int(pids[1]), signal.SIGKILL)
        process.communicate(timeout=60)
        seconds, levels = monotonic() - began, len(Folder(Path(own) / "kept").numbers())
        good = seconds < SOON and levels >= 2
        result[
            f"rank that dies: {'ended' if good else 'FAILED'} in {seconds:.2f} s "
            f"with {levels} levels"
        ] += 1
        result["failures"] += not good
    return result


def cost() -> Counter:
    """Print seconds of writing over the seconds of the run.

    They are processor seconds: what waits for the disk depends on the disk.
    """
    result, add = Counter[str](), checkpoint.Checkpoint.add
    spent = 0.0

    def timed(*arguments: Any, **named: Any) -> None:
        nonlocal spent
        began = process_time()
        add(*arguments, **named)
        spent += process_time() - began

    checkpoint.Checkpoint.add = timed  # type: ignore[method-assign]
    for name, changes in (("flat", {"max_steps": 20}), ("curved", {}), ("space", {})):
        run(name, None, **changes | {"max_steps": 3})  # compiles
        with tempfile.TemporaryDirectory() as own:
            spent, began = 0.0, process_time()
            history = run(name, Path(own), **changes)
            whole = process_time() - began
            size = sum(path.stat().st_size for path in Path(own).iterdir()) / 1e6
        print(
            f"{name}: {history.steps[-1].cells} cells, {whole:.2f} s, "
            f"writing {spent / whole:.1%}, {size:.1f} MB"
        )
        result["failures"] += spent > 0.1 * whole
    checkpoint.Checkpoint.add = add  # type: ignore[method-assign]
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*")
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child", nargs=2)
    options = parser.parse_args()
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    if options.child:
        child(*options.child)
        return
    calls = {
        "kills": lambda: kills(options.kills, options.seed),
        "damage": lambda: damage(options.seed),
        "faults": faults,
        "cost": cost,
    }
    failures = 0
    for part in options.parts or calls:
        found = calls[part]()
        failures += found.pop("failures", 0)
        print(
            f"{part}: " + "; ".join(f"{what} {number}" for what, number in sorted(found.items())),
            flush=True,
        )
    print(f"{failures} failures")
    sys.exit(failures > 0)


if __name__ == "__main__":
    main()
