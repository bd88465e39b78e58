"""A process that solves often stays as it is: what a run made is freed when nobody has it any more.

Property: after a run the number of live meshes and compiled forms is what it was, on every interpreter; each of them
holds MPI communicators, of which there are some thousand.
"""

import gc

import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh

import erc_contact as ec


def live():
    """Meshes and forms that are alive."""
    gc.collect()
    return sum(isinstance(thing, dmesh.Mesh | fem.Form | fem.FunctionSpace) for thing in gc.get_objects())


@pytest.mark.serial
def test_runs_leave_nothing_behind():
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3, gap=lambda x: 0.01 * x[0] ** 2)],
    )
    counts = []
    for _ in range(3):
        ec.adapt(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), accuracy=1e-6, max_steps=2)
        counts.append(live())
    assert counts[2] == counts[1], counts
