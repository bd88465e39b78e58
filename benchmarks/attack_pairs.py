"""Attack the equilibrium that pairs claim, by an evaluation of its own, in numpy alone.

Random scenes of one to three bodies in the plane and in 3D: moduli with ratios from
1e-12 to 1e12, units of force from 1e-25 to 1e12 and of length from 1e-9 to 1e9, bodies
that a contact alone holds, that hang on a vertex, that lie in a round bowl, or that are
one cell; solutions, and `certify` of zeros, translations, rotations and noise. On 1, 2
and 3 ranks, as many as there are.

sigma^ of each pair is gathered and evaluated at random points: its divergence by
differences within sub-cells, its jumps across facets of sub-cells and cells, its
tractions on the boundary against loads and friction law, the resultants and moments of
each body. Each is compared with the greatest stress of the body.

- out of balance: pairs whose own evaluation is beyond :data:`UNBALANCED`; none may;
- guaranteed, reached: pairs that call e a bound, or have eps below 2%;
- apart: proved intervals of the energy, of a certified displacement and of the solution
  of the same scene, that do not intersect; none may;
- other: scenes whose outcome or eps is not the same on all numbers of ranks; none may.

    OMP_NUM_THREADS=1 mpiexec -n 3 python benchmarks/attack_pairs.py [seed] [count]
"""

from __future__ import annotations

import logging
import sys
from collections import Counter
from dataclasses import dataclass
from functools import partial

from mpi4py import MPI

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from pair_evaluation import UNBALANCED, gathered, own_imbalance
from pair_scenes import random_case

from tasks import on_ranks, tell  # isort: skip

COUNTS = (1, 2, 3)
"""Numbers of ranks."""
REACHED = 0.02
"""eps that a run would call reached [-]."""
SAME = 1e-2
"""Relative difference of eps between numbers of ranks that counts as none [-].

Ratios of moduli of 1e10 leave 1e-3 of it to round-off.
"""
TINY = 1e-9
"""eps below which it is round-off [-]."""


@dataclass(frozen=True)
class Outcome:
    """Hold what a scene gave on some ranks.

    Attributes:
        ending: "pair", or the name of the exception.
        eps: Relative error.
        said: Imbalance that the pair tells.
        own: The value of the own evaluation.
        guaranteed: Whether e is called a bound.
        energy: Interval of the potential energy, where it is proved.
    """

    ending: str
    eps: float = np.nan
    said: float = np.nan
    own: float = np.nan
    guaranteed: bool = False
    energy: tuple[float, float] | None = None


def outcome(seed: int, number: int, comm: MPI.Comm, *, solved: bool = False) -> Outcome:
    """Solve or certify a scene; collective on the communicator.

    ``solved`` solves scenes whose displacement is given, too.
    """
    try:
        case = random_case(np.random.default_rng([seed, number]), comm)
        if case.given is None or solved:
            solution = ec.solve(case.scene, case.domain, degree=case.degree, solver=case.solver)
            error = ec.constitutive_error(ec.equilibrate(solution))
        else:
            error = ec.certify(case.scene, case.domain, case.given, degree=case.degree).error
    except ec.ErcContactError as reason:
        return Outcome(type(reason).__name__)
    pair = error.admissible
    own = own_imbalance(case, gathered(pair), np.random.default_rng([seed, number, 1]))
    bounds = ec.potential_energy(error)
    energy = (bounds.low, bounds.high) if bounds.guaranteed else None
    return Outcome("pair", error.relative, pair.imbalance, own, error.guaranteed, energy)


def pairs(seed: int = 0, count: int = 200) -> None:
    """Print what pairs claim and what they do not keep; collective."""
    counts = [ranks for ranks in COUNTS if ranks <= MPI.COMM_WORLD.size]
    totals: Counter[str] = Counter()
    said = own = 0.0
    for number in range(count):
        name = random_case(np.random.default_rng([seed, number]), MPI.COMM_SELF).name
        runs = on_ranks(counts, partial(outcome, seed, number))
        first = runs[0]
        found = Counter({first.ending: 1})
        for run in runs:
            if run.ending != "pair":
                continue
            said, own = max(said, run.said), max(own, run.own)
            wrong = not run.own <= UNBALANCED
            found["out of balance"] += wrong
            found["guaranteed"] += wrong and run.guaranteed
            found["reached"] += wrong and run.eps <= REACHED
        if first.energy is not None and " certify" in name:
            other = outcome(seed, number, MPI.COMM_SELF, solved=True)
            if other.energy is not None:
                found["intervals"] += 1
                low = max(first.energy[0], other.energy[0])
                found["apart"] += low > min(first.energy[1], other.energy[1])
        found["other"] = any(differs(first, run) for run in runs[1:])
        totals.update(found)
        bad = {key: found[key] for key in ("out of balance", "apart", "other") if found[key]}
        if bad:
            tell(f"{number}: {name}: {bad} {runs}")
    tell(f"{counts} ranks: {dict(+totals)}; imbalance said {said:.1e}, own {own:.1e} at most")
    kept = ("out of balance", "guaranteed", "reached", "apart", "other")
    tell(", ".join(f"{key}: {totals[key]}" for key in kept))


def differs(one: Outcome, other: Outcome) -> bool:
    """Tell whether two numbers of ranks gave something else."""
    if one.ending != other.ending:
        return True
    if one.ending != "pair" or max(one.eps, other.eps) < TINY:
        return False
    return abs(one.eps - other.eps) > SAME * one.eps


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    pairs(*(int(argument) for argument in sys.argv[1:]))
