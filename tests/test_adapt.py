"""The adaptive loop: rates, marking, limits that end it with the best result.

- eps against cells has slope -1/2 (adaptive), and the slope that the clamped corner dictates (uniform: h^0.7112);
- Doerfler marking carries the fraction with the fewest elements;
- limits of cells and of steps, and a solve that fails late, end the loop with the best result and clear words.
"""

import csv

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block, common_block, prototype_block

import erc_contact as ec
from erc_contact import adapt as adapt_function

CORNER = 0.7112
"""Singular exponent of a clamped-free corner of 90 degrees, nu = 0.3."""


def test_adaptive_rate():
    history = ec.adapt(prototype_block(), block(4), accuracy=0.004)
    assert history.reached
    assert history.best.relative <= 0.004
    print(f"slope {history.slope('cells', last=4):.3f}")
    assert history.slope("cells", last=4) == pytest.approx(-0.5, abs=0.05)


@pytest.mark.serial
def test_uniform_rate_is_that_of_the_corner():
    history = ec.adapt(prototype_block(), block(8), accuracy=1e-6, strategy=ec.Uniform(), max_steps=7)
    slope = history.slope("cells", last=3)
    print(f"\nuniform slope {slope:.3f}, corner {-CORNER / 2:.3f}")
    assert slope == pytest.approx(-CORNER / 2, abs=0.02)


@pytest.mark.parametrize("fraction", [0.1, 0.5, 1.0])
def test_marking_carries_the_fraction_with_the_fewest(fraction):
    error = ec.constitutive_error(ec.equilibrate(ec.solve(prototype_block(), block(4))))
    comm = error.admissible.solution.domain.mesh.comm
    marked = ec.mark(error, fraction)
    carried = comm.allreduce(float(np.sum(error.cells[marked] ** 2)), MPI.SUM)
    assert carried >= fraction * error.relative**2 * (1 - 1e-5)
    rest = np.delete(error.cells, marked)
    least = comm.allreduce(float(error.cells[marked].min(initial=np.inf)), MPI.MIN)
    assert comm.allreduce(float(rest.max(initial=0.0)), MPI.MAX) <= least * (1 + 1e-5)
    if fraction < 1:
        without = carried - least**2
        number = comm.allreduce(int(np.sum(abs(error.cells[marked] - least) < 1e-5 * least)), MPI.SUM)
        assert without < fraction * error.relative**2 or number > 1  # ties are marked together


def test_limits_end_with_the_best_result():
    few = ec.adapt(common_block(), block(4), accuracy=1e-3, max_steps=2)
    assert not few.reached
    assert len(few.steps) == 2
    assert "max_steps = 2" in few.outcome
    assert few.best.relative == min(few.column("eps"))
    small = ec.adapt(common_block(), block(4), accuracy=1e-3, max_cells=400)
    assert "max_cells = 400" in small.outcome
    assert max(small.column("cells")) <= 400


def test_failure_on_a_later_mesh_keeps_what_there_is(monkeypatch):
    """A real failure: from the second mesh on, Newton may take no step."""
    from petsc4py import PETSc

    class Impatient:
        def next(self, error, accuracy, max_cells):
            PETSc.Options()["erc_contact_snes_max_it"] = 0
            return error.admissible.solution.domain.refined()

    try:
        history = ec.adapt(common_block(), block(4), accuracy=1e-3, strategy=Impatient())
    finally:
        PETSc.Options().delValue("erc_contact_snes_max_it")
    assert len(history.steps) == 1
    assert "did not converge" in history.outcome
    assert history.best.relative == history.steps[0].eps


def test_history_rows_and_csv(shared_tmp_path):
    history = ec.adapt(common_block(), block(4), accuracy=0.2)
    assert np.all(np.diff(history.column("seconds")) > 0)
    assert np.allclose(history.column("eps") ** 2, history.column("bulk") ** 2 + history.column("contact") ** 2)
    history.to_csv(shared_tmp_path / "history.csv")
    MPI.COMM_WORLD.barrier()
    with (shared_tmp_path / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["cells"]) for row in rows] == [step.cells for step in history.steps]
    assert [float(row["eps"]) for row in rows] == [step.eps for step in history.steps]
    assert len(str(history).splitlines()) == len(history.steps) + 2
    assert max(map(len, str(history).splitlines())) <= 80
    assert adapt_function is ec.adapt


@pytest.mark.parametrize("accuracy", [0.0, -1.0, float("nan"), float("inf")])
def test_accuracy_must_be_positive(accuracy):
    with pytest.raises(ec.InputError, match="accuracy"):
        ec.adapt(common_block(), block(2), accuracy=accuracy)
