"""Contacts whose bodies are held softly: r^ keeps the resultants of the contact forces.

- a stiff block on a soft pad, as one body, tied and as two bodies: e is near the true
  error however soft the pad is, with both methods and degrees;
- a slender block in bending, under a gap that is tilted, and with friction;
- a run with a soft pad reaches its accuracy;
- usual scenes are left alone; ranks agree.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from scenes import certified, mostly_serial

import erc_contact as ec
from erc_contact.admissible import equilibrate as stage
from erc_contact.admissible.balance_parts import TooCoarse

METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def padded(n: int, soft: float, comm: MPI.Comm = MPI.COMM_WORLD) -> tuple[ec.Scene, ec.Domain]:
    """Return a block that a soft pad at its left and a curved contact hold."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * n, n), comm=comm)
    pad = ec.rectangle((-0.5, 0.0), (0.0, 1.0), cells=(n // 2, n), comm=comm)
    parts = ec.assembly({"block": block, "pad": pad})
    scene = ec.Scene(
        ec.Elastic({"block": 1.0, "pad": soft}, 0.3),
        ec.Displacement("pad left", (0.0, 0.0)),
        ec.Traction("block top", (0.0, lambda x: -0.01 - 0.002 * x[0])),
        ec.Contact("block bottom", gap=lambda x: 0.01 * (x[0] - 1.0) ** 2),
    )
    return scene, parts.joined("pad right", "block left", tied=True)


@cache
def fine_pad() -> ec.ConstitutiveError:
    """Return the finest pair, for each method and degree."""
    return certified(*padded(24, 1e-4), degree=2)


@pytest.fixture
def makings(monkeypatch) -> list[bool]:
    """Whether each r^ was made again."""
    made = []
    original = stage.with_soft_contacts

    def counted(*arguments):
        kept = original(*arguments)
        made.append(kept is not None)
        return kept

    monkeypatch.setattr(stage, "with_soft_contacts", counted)
    return made


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", [1, 2])
def test_a_soft_pad(method, degree, makings):
    fine = fine_pad()
    error = certified(*padded(4, 1e-4), method=method, degree=degree)
    assert makings[-1]
    # The energy of the finest pair is below the exact one by less than a percent of e^2.
    true = np.sqrt(2 * (ec.potential_energy(error).high - ec.potential_energy(fine).high))
    assert true <= error.absolute < 1.9 * true
    force, of_solution = (result.force("block bottom") for result in (error, error.solution))
    assert force.force[1] == pytest.approx(of_solution.force[1], rel=1e-5)
    assert force.moment == pytest.approx(of_solution.moment, rel=1e-5)
    # What was certified is allowed: no pull, and outside the foundation.
    profile = error.profile("block bottom")
    assert profile["pressure"].min() >= 0.0
    assert abs(error.reactions()["balance"].force).max() < 1e-10


@pytest.mark.broad
@pytest.mark.parametrize("method", METHODS)
def test_a_body_on_a_body_that_a_soft_pad_holds(method):
    upper = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    pad = ec.rectangle((-0.5, 0.0), (0.0, 1.0), cells=(2, 4))
    base = ec.rectangle((0.0, -1.0), (2.0, 0.0), cells=(8, 4))
    parts = ec.assembly({"block": upper, "pad": pad, "base": base})
    domain = parts.joined("pad right", "block left", tied=True).joined("block bottom", "base top")
    scenes = []
    for soft in (1e-6, 1e-3):
        scenes.append(
            ec.Scene(
                ec.Elastic({"block": 1.0, "base": 1.0, "pad": soft}, 0.3),
                [
                    ec.Displacement("pad left", (0.0, 0.0)),
                    ec.Displacement("base bottom", (0.0, 0.0)),
                ],
                ec.Traction("block top", (0.0, lambda x: -0.01 - 0.002 * x[0])),
                ec.Contact(
                    "block bottom", against="base top", gap=lambda x: 0.01 * (x[0] - 1.0) ** 2
                ),
            )
        )
    errors = [certified(scene, domain, method=method) for scene in scenes]
    # The pad hardly matters.
    assert errors[0].relative == pytest.approx(errors[1].relative, rel=0.05)
    assert errors[0].relative < 0.2
    here, there = (errors[0].force(part).force for part in ("block bottom", "base top"))
    assert here == pytest.approx(-there, rel=1e-12)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("contact", "method", "degree", "most"),
    [
        (ec.Contact("bottom", gap=lambda x: 0.01 * x[0]), ec.AugmentedLagrangian(), 2, 0.04),
        (ec.Contact("bottom", friction=0.3), ec.Nitsche(), 1, 0.15),
    ],
)
def test_a_slender_block(contact, method, degree, most):
    """Its true error is about 0.7 of ``most``; eps was 13.6% and 68.9%."""
    block = ec.rectangle((0.0, 0.0), (2.0, 20.0), cells=(1, 10))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.005, -0.02)), contacts=contact)
    assert certified(scene, block, method=method, degree=degree).relative < most


@pytest.mark.parametrize("method", mostly_serial(METHODS, METHODS[:1], METHODS[1:]))
def test_a_run_with_a_soft_pad(method):
    scene, domain = padded(4, 1e-5)
    history = ec.adapt(scene, domain, accuracy=0.05, method=method, max_cells=4000)
    assert history.reached


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_usual_scenes_are_left_alone(method, makings):
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("top", (0.02, -0.05)),
        contacts=ec.Contact("bottom", friction=0.3),
    )
    block = ec.rectangle((0.0, 0.0), (3.0, 1.0), cells=(9, 3))
    for degree in (1, 2):
        certified(scene, block, method=method, degree=degree)
    assert makings == [False, False]


@pytest.mark.serial
def test_resultants_that_cannot_be_kept_lose_nothing(monkeypatch):
    solution = ec.solve(*padded(4, 1e-4))
    kept = ec.constitutive_error(ec.equilibrate(solution))
    original = stage.admissible_tractions

    def failing(model, solved, others):
        if others.motions:
            raise TooCoarse("no traction", np.empty(0, dtype=np.int32))
        return original(model, solved, others)

    monkeypatch.setattr(stage, "admissible_tractions", failing)
    first = ec.constitutive_error(ec.equilibrate(solution))
    assert first.absolute > 1.5 * kept.absolute


def test_ranks_agree():
    shared, alone = (
        certified(*padded(4, 1e-4, comm)).absolute for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    assert shared == pytest.approx(alone, rel=1e-9)
