"""Some scenes of benchmarks/extremes.py, with every contact method.

Properties: a scene that has a solution converges, with a traction in the cone; one that has none is refused, no field
is returned; eps and Newton steps depend neither on units nor on the size of the load where no gap has a size.
"""

from dataclasses import replace

import numpy as np
import pytest
from extreme_scenes import SCENES
from extremes import SAME, pairs, run, unit_independence

pytestmark = pytest.mark.serial
SOLVED = [
    *("nu 0", "nu 0.49", "nu 0.4999"),
    *("mu 0 sheared hard", "mu 1 sheared hard", "mu 20 sheared hard"),
    *("gamma 1e-2", "gamma 1e+3", "gamma 1e+6", "theta -1", "theta 1"),
    *(
        "opens altogether",
        "just touches",
        "slips everywhere",
        "tips onto an edge",
        "stands pushed",
        "stands above a gap",
    ),
    *("tower leans", "slope", "wedge", "three contacts", "continuum of solutions", "column", "at the contact 1"),
    *("graded 1:1e5 in rows", "slivers", "one square", "clamp", "Hertz mu 0.3, sheared", "zero load", "e+300"),
]
"""Parts of the names of scenes that have a solution."""
NAMES = [name for name in SCENES if SCENES[name].solvable and any(part in name for part in SOLVED)]
REFUSED = [name for name in SCENES if not SCENES[name].solvable]
IN_UNITS = list(dict.fromkeys(extreme.same_as for extreme in SCENES.values() if extreme.same_as))


def rows(names):
    """Every row of these scenes, without the effectivity."""
    return [run(name, replace(extreme, levels=0), m) for name, extreme, m in pairs() if name in names]


@pytest.mark.parametrize("name", NAMES)
def test_scene_that_has_a_solution(name):
    """With one method at least; the other may end in NotConverged, near nu = 1/2 on coarse meshes."""
    every = rows([name])
    assert any(row.expected for row in every), "\n".join(f"{row}\n{row.message}" for row in every)
    for row in every:
        assert row.expected or row.outcome == "NotConverged", f"{row}\n{row.message}"
        if row.outcome == "converged":
            assert np.isfinite([row.eps, row.penetration, row.cone, row.complementarity, row.friction]).all(), str(row)
            assert row.cone < 1e-12, str(row)


@pytest.mark.parametrize("name", REFUSED)
def test_scene_that_has_none(name):
    for row in rows([name]):
        assert row.expected, f"a field was returned\n{row}"


@pytest.mark.parametrize("name", IN_UNITS)
def test_units(name):
    same = [other for other in SCENES if SCENES[other].same_as == name]
    same = rows([name, *same[::3]])
    for steps, difference in unit_independence(same).values():
        assert difference <= SAME, "\n".join(map(str, same))
        assert len(set(steps)) == 1, "\n".join(map(str, same))
