"""What a body remembers, and laws that tell how convex they are.

- A law without conjugate has the same numbers as with it; the bound of the displacement holds.
- The balance of energies has the springs in it.
- A step may follow one of another degree on the same mesh.
- Ranks without cells take part.
- States and convexities that are no such thing are refused.
"""

import dataclasses

import numpy as np
import pytest
from domains import refused
from laws import Hencky, Quadratic, TwoModuli
from mpi4py import MPI
from scenes import certified, pressed

import erc_contact as ec
from erc_contact.error import fenchel
from erc_contact.error.load_work import assemble_number
from erc_contact.model.carrying import carry_displacement, carry_state
from erc_contact.model.law.law_state import LawState
from erc_contact.model.model import Model

COMM = MPI.COMM_WORLD
STEEL = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.01, hardening=0.02, kinematic=0.03)


def slab(cells=(6, 3)):
    """A slab (0, 2) x (0, 1)."""
    return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=cells)


def scaled(unit, n):
    """A square of n x n cells, each cut in two."""
    return ec.rectangle((0.0, 0.0), (unit, unit), cells=(n, n))


def on_parabola(material, down=0.03, **entries):
    """A slab that is pressed on its foundation and pushed along it."""
    scene = pressed(material, (0.004, -down), gap=lambda x: 0.005 * x[0] ** 2)
    return dataclasses.replace(scene, **entries)


@dataclasses.dataclass(frozen=True)
class OnlyEnergy:
    """A law of which only the energy of another one is known, and how convex it is."""

    law: object
    convex_by: object

    @property
    def parameters(self):
        return self.law.parameters

    def __getattr__(self, name):
        if name in ("E", "nu", "K", "G", "limit", "rest", "share"):
            return getattr(self.law, name)
        raise AttributeError(name)

    def check(self, name, low, high):
        pass

    def potential(self, strain, **parameters):
        return self.law.potential(strain, **parameters)

    def convexity(self, **parameters):
        return self.convex_by(**parameters)

    def modulus(self, **parameters):
        return self.law.modulus(**parameters)


@pytest.mark.broad
@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_supremum_by_newton_is_the_conjugate(degree):
    known = certified(on_parabola(Quadratic(1.0, 0.3)), slab(), degree=degree)
    found = certified(
        on_parabola(OnlyEnergy(Quadratic(1.0, 0.3), lambda E, nu: 1)), slab(), degree=degree
    )
    assert found.relative == pytest.approx(known.relative, rel=1e-9)
    assert found.displacement_error == pytest.approx(found.absolute)


@pytest.mark.broad
@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_supremum_of_a_law_with_a_kink_is_the_conjugate(degree):
    """A step of Newton's method may pass the kink, more than once."""
    law = TwoModuli(1.0, 0.4, 0.2)
    domain = slab()
    known = certified(on_parabola(law), domain, degree=degree)
    only_energy = OnlyEnergy(law, lambda K, G, share: share)
    found = certified(on_parabola(only_energy), domain, degree=degree)
    assert found.relative == pytest.approx(known.relative, rel=1e-6)


@pytest.mark.broad
@pytest.mark.serial
def test_the_error_of_the_displacement_is_bounded():
    """In the elastic norm, against a solution three levels finer."""
    for material in (STEEL, Hencky(1.0, 0.4, 0.01, 0.1)):
        error = certified(on_parabola(material), slab())
        fine = ec.solve(on_parabola(material), slab((48, 24)))
        model = fine.model
        elastic = dataclasses.replace(fine.scene, material=ec.Elastic(1.0, 0.3))
        if isinstance(material, Hencky):
            elastic = dataclasses.replace(fine.scene, material=Quadratic(*material.elastic))
        difference = carry_displacement(
            error.admissible.displacement, error.solution.model.space, model.space
        )
        assert difference is not None
        difference.x.array[:] -= fine.u.x.array
        norm = ec.solve(elastic, fine.domain).model
        square = assemble_number(norm.space, norm.stiffness(difference, difference))
        assert 0.3 * error.absolute < np.sqrt(square) < error.displacement_error


@pytest.mark.broad
@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_cells_that_yield_in_part_are_integrated(degree, monkeypatch):
    """A cell that counts as linear has the same gap by integrals adapted to the law."""
    first = ec.solve(on_parabola(STEEL, 0.012), slab((4, 2)), degree=degree)
    solution = ec.solve(on_parabola(STEEL, 0.012), slab((8, 4)), degree=degree, start=first)
    pair = ec.equilibrate(solution)
    gap = fenchel.fenchel_error(pair).gap
    monkeypatch.setattr(
        fenchel, "_is_linear", lambda beyond, law, near, pair: np.zeros(len(pair.stress), bool)
    )
    adapted = fenchel.fenchel_error(pair).gap
    share = ec.results.plastic_share(pair)
    assert 0.05 < share < 0.95
    assert abs(gap - adapted).max(initial=0.0) < 1e-5 * gap.sum()


@pytest.mark.broad
def test_springs_are_in_the_balance_of_energies():
    spring = ec.Spring("right", normal=0.2)

    def scene_at(t):
        return on_parabola(STEEL, 0.03 * t, springs=spring)

    evolution = ec.evolve(scene_at, slab(), [0.5, 1.0], 0.5)
    last = evolution.steps[-1]
    assert last.plastic_work > 0.1 * last.work
    assert abs(last.imbalance) < 0.05 * last.work


@pytest.mark.broad
def test_another_degree_on_the_same_mesh():
    domain = slab()
    first = ec.solve(on_parabola(STEEL), domain)
    straight = ec.solve(on_parabola(STEEL), domain, degree=2)
    started = ec.solve(on_parabola(STEEL), domain, degree=2, start=first)
    assert started.force("bottom").force == pytest.approx(straight.force("bottom").force, rel=1e-8)
    again = ec.solve(on_parabola(STEEL), domain, degree=2, after=first)
    assert again.force("bottom").force[1] == pytest.approx(
        straight.force("bottom").force[1], rel=0.2
    )


@pytest.mark.broad
@pytest.mark.serial
def test_a_ring_that_is_let_go():
    """Nothing is left of its stress but round-off, which counts as none."""
    law = ec.Plastic(1.0, 0.43, 0.01, 0.032, kinematic=0.075, hypothesis="axisymmetric")

    def scene(down):
        return ec.Scene(law, ec.Displacement("top", (None, -down)), contacts=ec.Contact("bottom"))

    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    press = ec.solve(scene(0.084), domain)
    free = ec.solve(scene(0.025), domain, after=press)
    assert press.force("bottom").force[1] > 0.1
    assert abs(free.force("bottom").force[1]) < 1e-12
    # The plastic strain of the release is left: the ring is shorter than it was.
    again = certified(scene(0.07), domain, after=free)
    assert 0.0 < again.force("bottom").force[1] < press.force("bottom").force[1]
    assert again.relative < 1e-3


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_a_state_on_a_refined_mesh_in_any_unit(unit):
    """Children inherit it, however small the body is."""
    coarse, fine = (Model(on_parabola(STEEL), scaled(unit, n), 1) for n in (2, 8))
    field = LawState.of(coarse.space, 1, lambda x, cells: (x @ [[3.0], [7.0]]) / unit)
    carried_over = carry_state(field, fine.space)
    middles = fine.space.cell_corners()[fine.space.owned_cells].mean(axis=1)
    columns, rows = (np.floor(2 * middles[:, axis] / unit) for axis in (0, 1))
    # A cell of the coarse mesh is left or right of the diagonal of its square.
    within = 2 * middles / unit - np.column_stack([columns, rows])
    key = 4 * columns + 2 * rows + (within[:, 0] > within[:, 1])
    values = carried_over.in_cells(fine.space.owned_cells)[:, 0, 0]
    key, values = (np.concatenate(COMM.allgather(known)) for known in (key, values))
    assert carried_over.moved < 1e-14
    for number in np.unique(key):
        assert np.ptp(values[key == number]) == 0.0
    assert len(np.unique(values)) == 8


@pytest.mark.broad
def test_bodies_that_overlap_keep_their_states():
    """Modelled with an interference; the upper body yields. Its cells lie over those of the lower."""
    bodies = {
        "upper": ec.rectangle((0.0, 0.9), (1.0, 1.9), cells=(4, 4)),
        "lower": ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)),
    }
    domain = ec.assembly(bodies).joined("upper bottom", "lower top", apart=0.2)
    material = ec.Plastic(1.0, 0.3, {"upper": 0.01, "lower": 1e6}, 0.05)
    held = [
        ec.Displacement("upper top", (0.0, 0.05)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    contact = ec.Contact("upper bottom", against="lower top")
    first = ec.solve(ec.Scene(material, held, contacts=contact), domain)
    fine = domain.refined()
    state = ec.solve(first.scene, fine, after=first).model.linearised.law.state
    cells = np.arange(fine.owned_cells)
    accumulated = state.in_cells(cells)[..., -1].max(axis=1)
    tags = fine.cell_tags
    lower = np.isin(cells, tags.find(fine.regions["lower"]))
    assert COMM.allreduce(accumulated[~lower].max(initial=0.0), MPI.MAX) > 0.01
    assert accumulated[lower].max(initial=0.0) == 0.0
    assert state.moved < 1e-12


@pytest.mark.broad
def test_a_start_on_another_body():
    """It gives the contact only; a state cannot be known there."""
    other = ec.solve(on_parabola(STEEL), ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)))
    alone, started = (ec.solve(on_parabola(STEEL), slab(), start=start) for start in (None, other))
    assert started.force("bottom").force == pytest.approx(alone.force("bottom").force, rel=1e-8)


@pytest.mark.ranks
def test_ranks_without_cells():
    domain = slab((1, 1))
    error = certified(on_parabola(STEEL), domain)
    later = ec.solve(on_parabola(STEEL, 0.02), domain, after=error.solution)
    known = COMM.allgather(later.force("bottom").force)
    assert np.ptp(known, axis=0).max() == 0.0
    assert 0.0 < ec.results.plastic_share(error) <= 1.0


# -- what is refused
# -------------------------------------------------------------------------------------


class Forgetful(ec.Plastic):
    """Plasticity that forgets its plastic strain."""

    def new_state(self, strain, **values):
        return {"accumulated": super().new_state(strain, **values)["accumulated"]}


def test_states_that_are_none():
    refused(lambda: ec.solve(on_parabola(Forgetful(1.0, 0.3, 0.01, 0.05)), slab()), "new_state has")
    first = ec.solve(on_parabola(STEEL), slab())
    refused(
        lambda: ec.solve(on_parabola(Quadratic(1.0, 0.3)), slab(), after=first),
        "has the state none",
    )
    error = certified(on_parabola(Quadratic(1.0, 0.3)), slab())
    refused(lambda: ec.results.state(error, "accumulated"), "has no state 'accumulated'")


@pytest.mark.parametrize(("share", "words"), [(1.1, "too large"), (0.0, "must be > 0")])
def test_convexities_that_are_none(share, words):
    law = OnlyEnergy(Quadratic(1.0, 0.3), lambda E, nu: share)
    refused(lambda: ec.solve(on_parabola(law), slab()), words)
