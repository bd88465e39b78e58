"""Extreme scenes with every contact method.

Units, materials, friction, shapes, meshes, supports, loads.

Properties: a scene that has a solution converges, with a traction in the cone; one that
has none is refused, by one method or the other in turn (``benchmarks/extremes.py`` asks
both), and no field is returned; eps and Newton steps depend neither on units nor on the
size of the load where no gap has a size.
"""

from itertools import cycle

import numpy as np
import pytest
from domains import partly_broad
from edge_scenes import BEYOND, SOLVABLE, UNITS, UNSOLVABLE
from extreme_bodies import block
from scenes import certified

import erc_contact as ec
from erc_contact.admissible.cells import cell_geometry
from erc_contact.admissible.elastic import cell_stress
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.trace import split
from namedmesh.simplex import rule

pytestmark = pytest.mark.serial
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]
methods = pytest.mark.parametrize("method", METHODS, ids=["Nitsche", "AL"])
SAME = 1e-6
"""Relative difference of eps between systems of units that counts as none [-]."""


def check(error: ec.ConstitutiveError) -> None:
    """All is finite.

    The method's own traction is in the cone, to round-off of the largest stress.
    """
    solution = error.solution
    model = solution.model
    space = model.space
    points, _ = rule(space.d - 1, space.contact_degree)
    tractions = [space.evaluate(solution.traction(c), points, c.facets) for c in model.contacts]
    inside = abs(
        cell_stress(model, cell_geometry(space), solution.u).in_plane
    ).max()  # an open contact's is round-off of it
    scale = max(inside, *(abs(r).max() for r in tractions)) or 1.0
    assert np.isfinite([error.relative, inside, abs(solution.u.x.array).max()]).all()
    for contact, r in zip(model.contacts, tractions, strict=True):
        r_n, _, shear = split(r / scale, contact.direction[:, None, :])
        parameters = friction_parameters(space, contact, points)
        bound = contact.friction_bound(np.maximum(-r_n, 0.0) * scale, parameters) / scale
        assert max(r_n.max(), (shear - bound).max()) < 1e-12


@pytest.mark.broad
@pytest.mark.parametrize("name", SOLVABLE)
def test_scene_that_has_a_solution(name):
    """With one method at least.

    The other may end in NotConverged, near nu = 1/2 on coarse meshes.
    """
    failed = []
    for method in METHODS:
        try:
            # To round-off: multigrid ends at 1e-10 of the forces.
            error = certified(*SOLVABLE[name](), method, solver="direct")
        except ec.NotConverged as reason:
            failed.append(str(reason))
            continue
        check(error)
    assert len(failed) < len(METHODS), "\n".join(failed)


@pytest.mark.parametrize(
    "method",
    [
        *(ec.Nitsche(gamma=g) for g in (1e-2, 1e3, 1e6)),
        *(ec.AugmentedLagrangian(gamma=g) for g in (1e-2, 1e3, 1e6)),
    ]
    + [ec.Nitsche(theta=theta) for theta in (-1, 1)],
    ids=str,
)
def test_parameters_of_the_methods(method):
    check(certified(*block(n=8), method))


@pytest.mark.parametrize("method", [*METHODS, ec.Nitsche(theta=-1), ec.Nitsche(theta=1)], ids=str)
def test_strong_friction(method):
    """Either it converges, or it says that it does not."""
    check(certified(*block(n=8, friction=2.0), method))


@pytest.mark.parametrize(
    ("name", "method"), list(zip(UNSOLVABLE, cycle(METHODS), strict=False)), ids=str
)
def test_scene_that_has_none(name, method):
    """The solver's errors, no field that the error would have to refuse."""
    with pytest.raises(ec.ErcContactError):
        ec.solve(*UNSOLVABLE[name](), method)


@methods
@pytest.mark.parametrize("name", partly_broad(UNITS, ("block", "displacement")))
def test_units(name, method):
    errors = [certified(*make(), method) for make in UNITS[name]]
    assert [error.relative for error in errors] == pytest.approx(
        [errors[0].relative] * len(errors), rel=SAME
    )
    assert len({error.solution.newton_steps for error in errors}) == 1


@methods
@pytest.mark.parametrize("name", BEYOND)
def test_loads_beyond_double_precision(name, method):
    try:
        error = certified(*BEYOND[name](), method)
    except ec.InputError:
        return
    check(error)
