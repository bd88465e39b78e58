"""Tables by their rows: which rows are equal, and values of rows with the same entries."""

import numpy as np
import pytest

from namedmesh.rows import equal_rows, in_space, look_up, rows_within

pytestmark = pytest.mark.serial


def test_values_are_found_by_entries_in_any_order():
    rows = np.array([[3, 1], [2, 5]])
    found = look_up(rows, np.array([10, 20]), np.array([[5, 2], [1, 3], [1, 2]]))
    assert found.tolist() == [20, 10, -1]
    nothing = np.empty((0, 2), dtype=int)
    assert look_up(nothing, np.empty(0, dtype=int), rows, missing=7).tolist() == [7, 7]


def test_equal_rows_are_pairs_whose_earlier_row_is_first():
    table = np.array([[1.0, 2.0], [0.0, 0.0], [1.0, 2.0], [2.0, 1.0], [1.0, 2.0]])
    first, second = equal_rows(table)
    assert first.tolist() == [0, 2]
    assert second.tolist() == [2, 4]
    assert not len(equal_rows(table[:2])[0])


def test_points_of_the_plane_get_a_third_component():
    assert in_space(np.array([[1.0, 2.0]])).tolist() == [[1.0, 2.0, 0.0]]


@pytest.mark.parametrize("seed", range(5))
def test_numbers_within_ranges(seed):
    rng = np.random.default_rng(seed)
    known = rng.permutation(50)[:20]
    ranges = rng.integers(-5, 60, (4, 2))
    within = (known[:, None] >= ranges[:, 0]) & (known[:, None] <= ranges[:, 1])
    assert rows_within(known, ranges).tolist() == np.flatnonzero(within.any(axis=1)).tolist()
    assert len(rows_within(known, np.array([[0, 10**18]]))) == 20
