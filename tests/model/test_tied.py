"""Tied joints: parts of two bodies that a scene glues.

Properties: the error equals the error of the mesh in one piece; the force through the
    joint
balances what acts on either body, and is opposite on both; its traction has it as its
resultant; checkpoints, refinement and contacts beside it keep the joint.
"""

import dataclasses

import pytest
from bricks import NAMES, bricks, glued
from domains import refused
from mpi4py import MPI
from scenes import certified
from test_joined import joined
from test_two_bodies import vector

import erc_contact as ec
from namedmesh.base.names import file_stem

COMM = MPI.COMM_WORLD
CELLS = {2: (4, 2), 3: (2, 2, 1)}
TIE = ec.Tied(*NAMES)
MATERIAL = ec.Elastic({"upper": 1.0, "lower": 300.0}, {"upper": 0.3, "lower": 0.2})


def scene(d, ties=TIE):
    """Two glued bricks, pressed and pushed on a foundation with friction."""
    top = ec.Displacement("upper outer", vector(d, 0.02, -0.05))
    side = ec.Traction("upper left", vector(d, 0.01, 0.003))
    contact = ec.Contact("lower outer", friction=0.4)
    return ec.Scene(MATERIAL, [top], [side], [contact], ties=ties)


@pytest.mark.broad
@pytest.mark.on_ranks("2-2", "1-3")
@pytest.mark.parametrize(("degree", "d"), [(1, 2), (2, 2), (1, 3)])
def test_error_is_that_of_one_body(degree, d):
    """And the force is that on either body, by u and by sigma^."""
    method = ec.Nitsche() if degree == 2 else ec.AugmentedLagrangian()
    for solver in ("direct", "iterative")[: 3 - degree]:
        options = {"method": method, "degree": degree, "solver": solver}
        whole = certified(scene(d, ()), glued(d, CELLS[d]), **options)
        error = certified(scene(d), bricks(d, CELLS[d]), **options)
        assert error.absolute == pytest.approx(whole.absolute, rel=1e-9)
        assert error.relative == pytest.approx(whole.relative, rel=1e-9)
        for result in (error, error.solution):
            reactions = result.reactions()
            size = abs(reactions["upper outer"].force).max()
            for quantity in ("force", "moment"):
                here, there, top, bottom, loads, rest = (
                    getattr(reactions[name], quantity)
                    for name in (*NAMES, "upper outer", "lower outer", "tractions", "balance")
                )
                assert abs(here + there).max() < 1e-12 * size
                assert abs(here + top + loads).max() < 1e-8 * size
                assert abs(there + bottom).max() < 1e-8 * size
                assert abs(rest).max() < 1e-8 * size
            profile = result.profile(NAMES[0])
            assert set(profile["status"]) == {2}
            assert abs(profile["gap"]).max() == abs(profile["slip"]).max() == 0.0
            if result is error:
                pressure = reactions[NAMES[0]].force[-1]
                assert (profile["weight"] * profile["pressure"]).sum() == pytest.approx(pressure)


def test_joint_with_a_support_at_its_edge():
    """A node that a support has, too: the support belongs to one body, or to both."""
    left = [ec.Displacement(f"{body} left", (0.0, 0.0)) for body in ("upper", "lower")]
    load = ec.Traction("upper outer", (0.003, -0.01))
    for supports in (left[:1], left[1:], left):
        error = certified(ec.Scene(MATERIAL, supports, [load], ties=TIE), bricks(2, CELLS[2]))
        for result in (error, error.solution):
            reactions = result.reactions()
            assert abs(reactions["balance"].force).max() < 1e-10
            on_upper = [reactions[name] for name in reactions if name.startswith("upper")]
            total = sum((force.force for force in on_upper), reactions["tractions"].force)
            if result is error or len(supports) == 1:
                assert abs(total).max() < 1e-10


def test_tie_beside_a_contact_in_a_run(shared_tmp_path):
    """Sides that did not match; the run refines them, and goes on from its folder."""
    domain = joined("overhang")[1]
    pair = domain.pairs[0]
    bottom = ec.Displacement("lower bottom", (0.0, 0.0))
    tied = ec.Scene(
        MATERIAL, [bottom], [ec.Traction("upper top", (0.1, -0.2))], ties=ec.Tied(*pair[::-1])
    )
    runs = [ec.adapt(tied, domain, 1e-3, max_steps=n, checkpoint=shared_tmp_path) for n in (2, 3)]
    runs.append(ec.adapt(tied, domain, 1e-3, max_steps=3))
    assert runs[1].column("eps") == pytest.approx(runs[2].column("eps"), rel=1e-10)
    runs[2].save(shared_tmp_path / "saved", pictures=False)
    assert (shared_tmp_path / "saved" / f"contact_{file_stem(pair[1])}.csv").exists()
    assert f"{pair[0]} (internal" in (shared_tmp_path / "saved" / "report.html").read_text()
    for run in runs:
        force = run.force("upper bottom").force
        assert force == pytest.approx((-0.2, 0.4))
        assert run.force("lower top").force == pytest.approx(-force)
        assert "tied" in repr(run.error.domain)


def test_history():
    """The joint is in every row; a scene without it is refused."""

    def at(time):
        whole = scene(2)
        return dataclasses.replace(whole, loads=[ec.Traction("upper left", (0.01 * time, 0.0))])

    history = ec.evolve(at, bricks(2, CELLS[2]), [1.0, 2.0], 0.5, tighten=0)
    assert history.force(NAMES[0]) == pytest.approx(history.force("lower outer"), abs=1e-12)
    free = dataclasses.replace(at(1.0), ties=())
    refused(lambda: ec.solve(free, history.error.domain, after=history.error.solution), "tied")


def beside_each_other():
    """Two bodies on a third one, and beside each other."""
    whole = {
        "a": ((-1.0, 0.0), (0.0, 1.0)),
        "b": ((0.0, 0.0), (1.0, 1.0)),
        "c": ((-1.0, -1.0), (1.0, 0.0)),
    }
    cells = {"a": (2, 2), "b": (2, 2), "c": (4, 2)}
    bodies = {name: ec.rectangle(*ends, cells=cells[name]) for name, ends in whole.items()}
    both = ec.assembly(bodies).joined("a right", "b left").joined("a bottom", "c top")
    return both.joined("b bottom", "c top outside")


def test_two_bodies_that_are_tied_touch_a_third():
    """The joint ends at the contact, at a point of all three: each body is in balance."""
    domain = beside_each_other()
    supports = [ec.Displacement("c bottom", (0.0, 0.0)), ec.Displacement("a top", (0.01, -0.03))]
    contacts = [
        ec.Contact("a bottom", against="c top", friction=0.3),
        ec.Contact("b bottom", against="c top outside", friction=0.3),
    ]
    tie = ec.Tied("a right", "b left")
    material = ec.Elastic({"a": 1.0, "b": 5.0, "c": 2.0}, 0.3)
    error = certified(ec.Scene(material, supports, [], contacts, ties=tie), domain)
    reactions = error.reactions()
    for body in "abc":
        total = sum(force.force for part, force in reactions.items() if part.startswith(f"{body} "))
        assert abs(total).max() < 1e-14
    ties = [tie, ec.Tied("a bottom", "c top")]
    ending = ec.Scene(material, supports, [], contacts[1:], ties=ties)
    # The contact ends inside the body that both joints make.
    inside = certified(ending, domain)
    total = sum(force.force for force in inside.reactions().values())
    assert abs(total).max() < 1e-14


def test_a_loose_body_beside_a_joint_is_told():
    domain = beside_each_other()
    supports = [ec.Displacement("c bottom", (0.0, 0.0))]
    contacts = [ec.Contact("a bottom", against="c top")]
    contacts.append(ec.Contact("b bottom", against="c top outside"))
    tie = ec.Tied("a right", "b left")
    material = ec.Elastic({"a": 1.0, "b": 5.0, "c": 2.0}, 0.3)
    loads = ec.BodyForce((0.001, -0.001))
    loose = ec.Scene(material, supports, loads, contacts, ties=tie)
    with pytest.raises(ec.NotHeldError, match="translation in x"):
        ec.solve(loose, domain)


def test_wrong_ties():
    refused(lambda: ec.Tied("a", "a"), "itself")
    refused(lambda: scene(2, [TIE, TIE]), "2 tied joints")
    contact = ec.Contact(NAMES[0], against=NAMES[1])
    refused(lambda: ec.Scene(MATERIAL, contacts=contact, ties=TIE), "Tied", "Contact")
    refused(lambda: ec.solve(scene(2), glued(2, CELLS[2])), "no pair", "joined")
    error = certified(scene(2), bricks(2, CELLS[2]))
    refused(lambda: ec.resultant(error, NAMES[0], (0.0, 1.0)), "tied joint")
