"""What is said and drawn of a body that yields and remembers."""

import numpy as np
import pytest
from mpi4py import MPI

import erc_contact as ec
from erc_contact.output.evolutions import plot_energies
from erc_contact.output.verdict import verdict

LAW = ec.Plastic(1e3, 0.3, yield_stress=3.0, hardening=20.0)


def scene_at(t, material=LAW):
    """A block that is pressed on a foundation."""
    return ec.Scene(
        material, ec.Displacement("top", (0.0, -0.01 * t)), contacts=ec.Contact("bottom")
    )


def plate(size):
    return ec.rectangle((0.0, 0.0), (2.0, 1.0), size=size)


def second_step(first, domain):
    """The error of a second step on a mesh."""
    second = ec.solve(scene_at(1.5), domain, after=first)
    return ec.constitutive_error(ec.equilibrate(second))


def words_of(error):
    return " ".join(words for _, words in verdict(error))


@pytest.fixture(scope="module")
def first():
    return ec.solve(scene_at(1.0), plate(0.5))


def test_a_new_mesh_tells_what_it_moved_of_the_state(first):
    error = second_step(first, plate(0.37))
    moved = error.model.linearised.law.state.moved
    assert 1e-3 < moved < 1.0
    assert "of the state of the material" in words_of(error)


def test_a_refined_mesh_moves_nothing(first):
    domain = first.domain
    error = second_step(first, domain.refined(np.arange(domain.owned_cells)))
    assert "The new mesh moved" not in words_of(error)
    assert "the state of the material that they left" in words_of(error)


def test_the_verdict_of_a_potential_claims_no_norm_of_errors(first):
    words = words_of(ec.constitutive_error(ec.equilibrate(first)))
    assert "e bounds the errors of u^" not in words
    assert "potential energy of u^" in words
    assert "ec.resultant" not in words


@pytest.mark.parametrize(
    ("material", "drawn"),
    [(LAW, True), pytest.param(ec.Elastic(1e3, 0.3), False, marks=pytest.mark.broad)],
)
def test_energies_draw_plastic_work_where_there_is_some(material, drawn):
    evolution = ec.evolve(lambda t: scene_at(t, material), plate(0.5), [0.5, 1.0], accuracy=0.5)
    panels = plot_energies(evolution)
    if MPI.COMM_WORLD.rank == 0:
        assert ("plastic work" in panels[0].get_legend_handles_labels()[1]) == drawn
