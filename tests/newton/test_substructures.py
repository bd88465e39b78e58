"""The direct solver by parts.

It solves the equations of the whole body, with the Schur complement on the contact.

- ``(K + D) u = b`` to round-off with the matrix that PETSc assembles for all ranks, for
  forces everywhere and for forces at the contact only, where S_L times the displacement
  gives the forces back (its signs and its order);
- parts without cells, without anything inside, and bodies that ranks share in no
  vertex;
- what cannot be factorised is an InputError on all ranks, wherever it is found;
- blocks of a large factor are compressed, and the solution is the same;
- units do not change a digit of the Schur complement;
- a plain factor in the place of a factor with a large Schur complement solves the same.
"""

from contextlib import nullcontext

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import block, prototype_block, random_scene, two_squares

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton.linear import mumps, stiffness
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.linear.substructures import (
    SchurComplement,
    Separator,
    Substructures,
    _family,
)

COMM = MPI.COMM_WORLD


def one_square() -> tuple[ec.Scene, ec.Domain]:
    """Two triangles: on three ranks one has none, and no node is inside a part."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [],
        [ec.Traction("top", pressure=0.1)],
        [ec.Contact("bottom", friction=0.3)],
    )
    return scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))


def two_bodies() -> tuple[ec.Scene, ec.Domain]:
    supports = [ec.Displacement(f"top{i}", (0.01, -0.02)) for i in (1, 2)]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), supports, [], [ec.Contact("bottom1", friction=0.3)]
    ), two_squares()


def no_contact() -> tuple[ec.Scene, ec.Domain]:
    supports = [ec.Displacement("bottom", (0.0, 0.0))]
    return ec.Scene(ec.Elastic(1.0, 0.3), supports, [ec.Traction("top", pressure=0.1)]), block(4)


CASES = {
    **{f"random {seed}": (lambda seed=seed: random_scene(seed)) for seed in range(6)},
    "one square": one_square,
    "two bodies": two_bodies,
    "no contact": no_contact,
}


def solved(elastic: Stiffness, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Solution and right side on this rank, and the residual of all over the forces that cancel in it."""
    whole = elastic.stiffness()
    elastic.add_glue(whole)
    b, x, r = whole.createVecLeft(), whole.createVecRight(), whole.createVecLeft()
    b.array[:] = values
    parts = Substructures(elastic.model, elastic.form, elastic.glue, elastic.layer.local)
    parts.solve(b, x)
    whole.mult(x, r)
    r.axpy(-1.0, b)
    size = abs(whole.getDiagonal().array * x.array).max(initial=0.0)
    size = COMM.allreduce(float(size), MPI.MAX)
    parts.destroy()
    return (
        x.array.copy(),
        b.array.copy(),
        COMM.allreduce(float(abs(r.array).max(initial=0.0)), MPI.MAX) / size,
    )


def check(case: str, degree: int) -> None:
    scene, domain = CASES[case]()
    model = bind(scene, domain, degree)
    elastic = Stiffness(model)
    owned = elastic.owned
    rng = np.random.default_rng(COMM.rank)
    residual = solved(elastic, rng.standard_normal(owned))[2]
    print(f"residual {residual:.1e}")
    assert residual < 1e-12
    if not elastic.contact_size:
        return
    at_contact = np.zeros(owned)
    local = elastic.layer.local
    local = local[local < owned]
    at_contact[local] = rng.standard_normal(len(local))
    x, b, residual = solved(elastic, at_contact)
    assert residual < 1e-12
    u, force = model.space.function(), model.space.function()
    u.x.array[:owned], force.x.array[:owned] = x, b
    u_L, force_L = elastic.gather(u), elastic.gather(force)
    if COMM.rank == 0:
        assert np.array_equal(elastic.schur, elastic.schur.T)
        forces = abs(elastic.schur) @ abs(u_L)
        assert abs(elastic.schur @ u_L - force_L).max() < 1e-12 * forces.max()


@pytest.mark.on_ranks("random 1-1", "random 3-2", "one square-1", "two bodies-2", "no contact-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("case", CASES)
def test_it_solves_the_equations_of_the_whole_body(case, degree):
    check(case, degree)


@pytest.mark.ranks
@pytest.mark.parametrize("case", CASES)
def test_it_does_so_on_three_ranks(case):
    check(case, 1)


@pytest.mark.serial
@pytest.mark.parametrize("size", [1, 2, 3, 5, 8, 13])
def test_the_tree_reaches_all_ranks_once(size):
    families = [_family(rank, size) for rank in range(size)]
    assert families[0][0] is None
    assert sorted(child for _, children in families for child in children) == list(range(1, size))
    for rank, (_, children) in enumerate(families):
        assert all(families[child][0] == rank for child in children)


@pytest.mark.serial
@pytest.mark.parametrize("parts", [2, 3, 4, 7])
def test_joints_eliminate_what_lies_between_parts(parts):
    """Random definite matrices of parts, the last three numbers kept.

    The same as eliminating all at once.
    """
    rng = np.random.default_rng(parts)
    touched = [np.sort(rng.choice(np.arange(17), 9, replace=False)) for _ in range(parts)]
    touched[0] = np.arange(20)  # all are touched, the unknowns of L from 17 on
    total = np.bincount(np.concatenate(touched), minlength=20) + (np.arange(20) >= 17)
    whole, left = np.zeros((20, 20)), []
    for numbers in touched:
        a = rng.standard_normal((len(numbers), 30))
        left.append(SchurComplement(numbers, np.ones(len(numbers), int), total[numbers], a @ a.T))
        whole[np.ix_(numbers, numbers)] += a @ a.T
    joint = left[0]
    for part in left[1:]:
        joint = Separator(joint, part).interface
    inner = np.setdiff1d(np.arange(20), joint.numbers)
    assert np.array_equal(inner, np.arange(17))
    i, o = np.ix_(inner, inner), np.ix_(inner, joint.numbers)
    expected = whole[np.ix_(joint.numbers, joint.numbers)] - whole[o].T @ np.linalg.solve(
        whole[i], whole[o]
    )
    assert np.allclose(joint.schur, expected, rtol=0, atol=1e-12 * abs(whole).max())


def test_what_cannot_be_factorised_is_told_on_all_ranks(monkeypatch):
    """A stiffness that is zero on the last rank only."""
    model = bind(prototype_block(), block(8), 1)
    elastic = Stiffness(model)
    inside = mumps.factorise

    def failing(matrix, *arguments):
        if COMM.rank == COMM.size - 1:
            matrix.scale(0.0)
        return inside(matrix, *arguments)

    monkeypatch.setattr("erc_contact.newton.linear.substructures.factorise", failing)
    with pytest.raises(ec.InputError, match="cannot be factorised"):
        Substructures(model, elastic.form, elastic.glue, elastic.layer.local)


def test_a_joint_that_is_not_definite_is_told():
    flat = SchurComplement(np.arange(2), np.ones(2, int), np.array([2, 3]), -np.eye(2))
    with pytest.raises(ec.InputError, match="cannot be factorised"):
        Separator(flat, flat)


@pytest.mark.broad
@pytest.mark.serial
def test_compressed_factors_solve_as_the_others(monkeypatch):
    """Units far from 1.

    What is left out of a factor is measured by the softest equation.
    """
    monkeypatch.setattr(
        mumps, "sigterm_blocked", lambda: nullcontext(True)
    )  # other threads of pytest might take it
    for E in (1e-9, 1.0, 2.1e11):
        scene = ec.Scene(
            ec.Elastic(E, 0.3),
            ec.Displacement("top", (0.02, -0.05)),
            contacts=ec.Contact("bottom", friction=0.3),
        )
        elastic = Stiffness(bind(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(120, 120)), 1))
        matrix = elastic.stiffness()
        elastic.add_glue(matrix)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        found = []
        for limit in (100, 10**9):
            monkeypatch.setattr(mumps, "COMPRESSED_FROM", limit)
            factor = mumps.factorise(matrix, elastic.layer.numbers)
            compressed = factor.mumps.getMumpsIcntl(35)
            found.append((compressed, factor.schur_complement()))
        (yes, small), (no, usual) = found
        assert (yes, no) == (2, 0)
        print(f"E = {E:g}: {abs(small - usual).max() / abs(usual).max():.1e}")
        assert abs(small - usual).max() < 1e-13 * abs(usual).max()


@pytest.mark.serial
@pytest.mark.parametrize("exponent", [-130, -67, 67, 130])
def test_units_do_not_change_a_digit(exponent):
    """Below entries of 1e-16 MUMPS alone is wrong by a tenth."""
    bodies = {
        "u": ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)),
        "l": ec.rectangle((0.0, -1.0), (1.0, 0.0), cells=(3, 3)),
    }
    domain = ec.assembly(bodies).joined("u bottom", "l top")

    def made(unit: float) -> tuple[np.ndarray, np.ndarray]:
        scene = ec.Scene(
            ec.Elastic({"u": unit, "l": 2.0**40 * unit}, 0.3),
            [ec.Displacement("u top", (0.02, -0.05)), ec.Displacement("l bottom", (0.0, 0.0))],
            contacts=ec.Contact("u bottom", against="l top", friction=0.3),
        )
        elastic = Stiffness(bind(scene, domain, 1))
        force = elastic.model.space.function()
        force.x.array[:] = unit * np.cos(np.arange(len(force.x.array)))
        elastic.free()  # the next factor is a plain one
        return elastic.schur / unit, elastic.solve_glued(force, supports=False).x.array

    for known, found in zip(made(1.0), made(2.0**exponent), strict=True):
        assert abs(known).max() > 0
        assert np.array_equal(known, found)


def rigid_face() -> tuple[ec.Scene, ec.Domain]:
    """A block that a free rigid face presses."""
    face = ec.Rigid("top", force=(0.001, -0.02), moment=0.001)
    return ec.Scene(
        ec.Elastic(1.0, 0.3), face, contacts=[ec.Contact("bottom", friction=0.3)]
    ), block(8)


def stacked() -> tuple[ec.Scene, ec.Domain]:
    sizes = {"lower": (5, 2), "upper": (3, 2)}
    bodies = {
        name: ec.rectangle((0.0, y), (1.0, y + 1.0), cells=cells)
        for y, (name, cells) in enumerate(sizes.items())
    }
    supports = [
        ec.Displacement("lower bottom", (0.0, 0.0)),
        ec.Displacement("upper top", (0.0, -0.02)),
    ]
    contact = ec.Contact("upper bottom", against="lower top", friction=0.3)
    domain = ec.assembly(bodies).joined("upper bottom", "lower top")
    return ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=[contact]), domain


@pytest.mark.serial
@pytest.mark.parametrize("case", [prototype_block, rigid_face, stacked])
def test_a_plain_factor_takes_over(case, monkeypatch):
    scene, domain = case() if case is not prototype_block else (prototype_block(), block(8))
    known = ec.solve(scene, domain)
    monkeypatch.setattr(stiffness, "DENSE", 0.0)
    found = ec.solve(scene, domain)
    assert found.stiffness._factor._schur_on is None
    assert known.stiffness._factor._schur_on is not None
    change = abs(found.u.x.array - known.u.x.array).max()
    assert change <= 1e-10 * abs(known.u.x.array).max()
