"""Let a process solve for days.

Mesh, solve, pair, error, refine, save, again and again.

Each cycle meshes a square anew with gmsh, runs `adapt` through two meshes in a new
checkpoint, and saves the fields and the table; every hundredth cycle saves the
pictures, too, and of the first hundred every twentieth, so that what is made once is
made there. Every hundredth cycle it measures what a process may run out of:

- resident memory of all ranks [MB];
- open files of all ranks;
- communicators: how many MPI could still make before it refuses, on the rank that has
  fewest;
- entries of the folder for temporary files, which is the benchmark's own.

What is measured after cycle 100 is the scale: nothing may grow by more than 5% until
the end. The process ends with code 1 if something does. The first variable keeps glibc
from holding large arrays that were freed: without it twice the memory is resident, half
of it free and in pieces. The second one keeps UCX, which MPICH may send by, from noting
all memory that is mapped: without it each rank grows by some 10 kB a cycle.

    export MALLOC_MMAP_THRESHOLD_=131072 UCX_MEM_EVENTS=n OMP_NUM_THREADS=1
    [mpiexec -n 2] python benchmarks/soak.py [--cycles 2000] [--dim 2]
"""

import argparse
import gc
import logging
import os
import resource
import shutil
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import erc_contact as ec

from mpi4py import MPI  # isort: skip - after erc_contact, which loads MPI first

from erc_contact.output.paraview import write_fields

EVERY = 100
"""Cycles between two measurements."""
WARM = 20
"""Cycles between two pictures in the beginning."""
GROWTH = 1.05
"""What may be left at the end, over what there was after the first measurement."""
MANY = 100_000
"""Communicators that are tried for at most; MPICH has some two thousand."""


def problem(dim: int) -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, *[0.01] * (dim - 2), -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3, gap=lambda x: 0.01 * x[0] ** 2)],
    )


def cycle(scene: ec.Scene, dim: int, folder: Path, *, pictures: bool) -> None:
    make, size = (ec.rectangle, 0.3) if dim == 2 else (ec.box, 0.6)
    domain = make((0.0,) * dim, (1.0,) * dim, size=size)
    with tempfile.TemporaryDirectory() as kept:
        path = domain.comm.bcast(kept)
        history = ec.adapt(scene, domain, accuracy=1e-6, max_steps=2, checkpoint=path)
        domain.mesh.comm.barrier()
    if pictures:
        history.save(folder)
    write_fields(history.best, folder)
    history.to_csv(folder / "history.csv")


def free_communicators(comm: MPI.Comm) -> int:
    """Count the communicators that MPI can still make."""
    made: list[MPI.Comm] = []
    try:
        while len(made) < MANY:
            made.append(comm.Dup())
    except MPI.Exception:
        pass
    for one in made:
        one.Free()
    return len(made)


def measured(comm: MPI.Comm) -> dict[str, float]:
    gc.collect()
    memory = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
    return {
        "memory": comm.allreduce(memory),
        "files": comm.allreduce(len(os.listdir("/proc/self/fd"))),
        "communicators": comm.allreduce(free_communicators(MPI.COMM_SELF), MPI.MIN),
        "temporary": len(os.listdir(tempfile.gettempdir())),
    }


def flat(first: dict[str, float], last: dict[str, float]) -> bool:
    """Tell whether nothing has grown, or run out."""
    grown = [last[name] <= GROWTH * first[name] for name in ("memory", "files", "temporary")]
    return all(grown) and last["communicators"] >= first["communicators"] / GROWTH


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cycles", type=int, default=2000)
    parser.add_argument("--dim", type=int, default=2)
    options = parser.parse_args()
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    comm = MPI.COMM_WORLD
    own = comm.bcast(tempfile.mkdtemp(prefix="soak_") if comm.rank == 0 else None)
    tempfile.tempdir, folder = own, Path(own) / "results"
    scene, first = problem(options.dim), dict[str, float]()
    began = perf_counter()
    for number in range(1, options.cycles + 1):
        cycle(
            scene, options.dim, folder, pictures=number % (EVERY if number > EVERY else WARM) == 0
        )
        if number % EVERY == 0 or number == options.cycles:
            last = measured(comm)
            first = first or last
            if comm.rank == 0:
                told = ", ".join(f"{name} {value:.6g}" for name, value in last.items())
                print(f"{number:6d} cycles, {perf_counter() - began:7.0f} s: {told}", flush=True)
    good = flat(first, last)
    if comm.rank == 0:
        print(
            "flat" if good else "NOT FLAT", f"on {comm.size} ranks, Python {sys.version.split()[0]}"
        )
        shutil.rmtree(own)
    sys.exit(not good)


if __name__ == "__main__":
    main()
