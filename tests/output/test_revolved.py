"""Pictures of axisymmetric bodies: r and z, pressures per area, and the body in 3D.

- Labels say r and z, and curves of a contact show the pressure per area.
- A mirrored picture has each element and line on both sides of the axis, and no r < 0.
- The report has forces along r and z, and no moments.
- The file for ParaView is the surface of the revolved body: its area is the area of
  cut and sides, and its displacement is radial and axial.
- Bodies that are not axisymmetric, and angles that are none, are refused.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.output import (
    draw_deformed,
    draw_error,
    draw_meshes,
    draw_revolved,
    plot_contact,
)

COMM = MPI.COMM_WORLD
SQUASHED = 0.2


def squashed_tube(hypothesis: str, degree: int) -> ec.ConstitutiveError:
    """A tube from 1 to 3 of height 2, squashed without friction: its stress is uniform."""
    tube = ec.rectangle((1.0, 0.0), (3.0, 2.0), cells=(4, 4))
    material = ec.Elastic(10.0, 0.25, hypothesis=hypothesis)
    supports = [ec.Displacement("top", (None, -SQUASHED))]
    if hypothesis != "axisymmetric":
        supports.append(ec.Displacement("left", (0.0, None)))
    scene = ec.Scene(material, supports, contacts=[ec.Contact("bottom")])
    return certified(scene, tube, degree=degree)


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_pictures_of_the_half_plane(degree):
    error = squashed_tube("axisymmetric", degree)
    for draw in (draw_error, draw_deformed):
        axes = draw(error)
        if COMM.rank == 0:
            assert (axes.get_xlabel(), axes.get_ylabel()) == ("r [length]", "z [length]")
    axes = plot_contact(error, "bottom")
    if COMM.rank == 0:
        assert axes.get_xlabel() == "r [length]"
        (curve,) = (line for line in axes.lines if line.get_label().startswith("pressure"))
        assert curve.get_ydata() == pytest.approx(10.0 * SQUASHED / 2)


@pytest.mark.parametrize("draw", [draw_error, pytest.param(draw_deformed, marks=pytest.mark.broad)])
def test_mirrored_pictures(draw):
    error = squashed_tube("axisymmetric", 2)
    half, whole = draw(error), draw(error, mirrored=True)
    if COMM.rank == 0:
        low, high = whole.get_xlim()
        assert low == pytest.approx(-high)
        assert high > 3.0
        assert whole.get_ylim()[1] == pytest.approx(half.get_ylim()[1], rel=0.05)
        assert len(whole.collections) == 2 * len(half.collections)
        paths = [path for drawn in whole.collections for path in drawn.get_paths()]
        r = np.sort(np.concatenate([path.vertices[:, 0] for path in paths]))
        assert r == pytest.approx(-r[::-1])
        assert whole.xaxis.get_major_formatter()(-2.0) == "2"
    with pytest.raises(ec.InputError, match="not axisymmetric"):
        draw(squashed_tube("plane strain", 1), mirrored=True)


@pytest.mark.broad
def test_report_has_no_moments(shared_tmp_path):
    tube = ec.rectangle((1.0, 0.0), (3.0, 2.0), cells=(4, 4))
    material = ec.Elastic(10.0, 0.25, hypothesis="axisymmetric")
    top = ec.Displacement("top", (None, -SQUASHED))
    scene = ec.Scene(material, top, contacts=[ec.Contact("bottom")])
    history = ec.adapt(scene, tube, accuracy=0.1)
    history.save(shared_tmp_path, pictures=True)
    report = (shared_tmp_path / "report.html").read_text()
    assert "<th>Fr</th><th>Fz</th></tr>" in report
    assert "<th>M" not in report
    axes = draw_meshes(history)
    if COMM.rank == 0:
        assert axes[-1].get_xlabel() == "r [length]"


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_surface_in_space(degree, shared_tmp_path):
    error = squashed_tube("axisymmetric", degree)
    path = shared_tmp_path / "revolved.vtkhdf"
    angle = 270.0
    assert draw_revolved(error, path, angle=angle) is None
    COMM.barrier()
    if COMM.rank == 0:
        import h5py

        with h5py.File(path) as file:
            data = {name: file[f"VTKHDF/{name}"][()] for name in ("Points", "Connectivity")}
            u = file["VTKHDF/PointData/displacement"][()]
            mises = file["VTKHDF/CellData/von_mises"][()]
        x = data["Points"]
        corners = x[data["Connectivity"].reshape(-1, 3)]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normals, axis=1).sum() / 2
        share = np.radians(angle) / (2 * np.pi)
        sides = 2 * np.pi * (1.0 + 3.0) * 2.0 + 2 * np.pi * (3.0**2 - 1.0**2)
        assert area == pytest.approx(2 * 4.0 + share * sides, rel=1e-3)
        assert mises == pytest.approx(10.0 * SQUASHED / 2)
        radius = np.hypot(x[:, 0], x[:, 1])
        outward = (u[:, :2] * x[:, :2]).sum(axis=1) / radius
        assert outward == pytest.approx(0.25 * SQUASHED / 2 * radius)
        assert np.linalg.norm(u[:, :2], axis=1) == pytest.approx(abs(outward))
        assert u[:, 2] == pytest.approx(-SQUASHED / 2 * x[:, 2], abs=1e-12)


@pytest.mark.serial
def test_picture_in_space(shared_tmp_path):
    axes = draw_revolved(squashed_tube("axisymmetric", 2), shared_tmp_path / "revolved.png")
    (image,) = axes.images
    pixels = image.get_array()[..., :3].reshape(-1, 3)
    seen = (pixels != 255).any(axis=1)
    assert 0.2 < seen.mean() < 0.9


def test_what_cannot_be_revolved_is_told():
    with pytest.raises(ec.InputError, match="not axisymmetric"):
        draw_revolved(squashed_tube("plane strain", 1))
    error = squashed_tube("axisymmetric", 1)
    for angle in (0.0, 361.0):
        with pytest.raises(ec.InputError, match=r"degrees in \(0, 360\]"):
            draw_revolved(error, angle=angle)
