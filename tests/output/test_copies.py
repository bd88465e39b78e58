"""Pictures and files of the whole of a body of which a part is computed.

Properties: the deformed copies of a file meet at their sides, for any magnification; they
have the volume of all, and stresses that turn with them; a picture of the whole reaches
over all copies; a body without copies is refused.
"""

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from scenes import AUGMENTED, certified

import erc_contact as ec
import namedmesh as nm
from erc_contact.output import draw_deformed, draw_error, write_fields

COMM = MPI.COMM_WORLD
SECTORS = 5


def cyclic():
    """A sector of a ring under pressure, in which a force turns with it."""
    plane = ec.rectangle((1.0, 0.0), (2.0, 1.0), cells=(3, 3))
    x = plane.mesh.geometry.x
    radius, angle = x[:, 0].copy(), 2 * np.pi / SECTORS * x[:, 1]
    x[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    ring = nm.Domain(plane.mesh, plane.facet_tags, plane.names)
    sides = ec.Cyclic("bottom", "top", axis=(0.0, 0.0), sectors=SECTORS)
    held = ec.Displacement("left", (0.0, 0.0))
    force = ec.BodyForce((lambda x: x[0] - x[1], lambda x: x[0] + x[1]))
    return certified(ec.Scene(ec.Elastic(1.0, 0.3), [sides, held], force), ring, AUGMENTED)


def periodic():
    """A cell that is sheared."""
    strain = ((0.02, 0.01), (0.01, 0.0))
    sides = [ec.Periodic("left", "right", strain), ec.Periodic("bottom", "top", strain)]
    cell = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(3, 3))
    stiffness = ec.Elastic(lambda x: 1 + 0.5 * x[0] * (2 - x[0]), 0.3)
    return certified(ec.Scene(stiffness, sides), cell, AUGMENTED)


@pytest.mark.parametrize(
    ("make", "copies"), [(cyclic, SECTORS), pytest.param(periodic, 9, marks=pytest.mark.broad)]
)
def test_copies_in_a_file_fit(make, copies, shared_tmp_path):
    error = make()
    for whole in (False, True):
        write_fields(error, shared_tmp_path / str(whole), whole=whole)
    if COMM.rank == 0:
        import pyvista

        one, every = (
            pyvista.read(shared_tmp_path / str(whole) / "body.vtkhdf") for whole in (False, True)
        )
        assert every.n_cells == copies * one.n_cells
        for factor in (0.0, 1.0, 7.0):
            moved = every.points + factor * every["displacement"]
            # The nodes of the ring and of 3 x 3 cells, each once.
            count = 4 * 3 * SECTORS if copies == SECTORS else 10 * 10
            assert len(np.unique(np.round(moved, 5), axis=0)) == count
        assert np.isclose(every.area, copies * one.area, rtol=1e-6)
        stress = every["stress"].reshape(copies, -1, 3, 3)
        own = np.linalg.eigvalsh(stress[:, :, :2, :2])
        assert abs(own - own[0]).max() < 1e-12 * abs(own).max()
        assert (abs(stress - stress[0]).max() > 0.1 * abs(own).max()) == (copies == SECTORS)


def test_a_picture_of_the_whole():
    error = cyclic()
    for draw in (draw_error, draw_deformed):
        axes = draw(error, whole=True)
        if COMM.rank == 0:
            low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
            assert (low < -1.8).all()
            assert (high > 1.8).all()
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    held = ec.Displacement("bottom", (0.0, 0.0))
    alone = certified(ec.Scene(ec.Elastic(1.0, 0.3), held), block, AUGMENTED)
    refused(lambda: draw_error(alone, whole=True), "is the whole")
