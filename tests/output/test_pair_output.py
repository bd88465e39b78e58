"""What is drawn, written and said of a contact between two bodies.

- A picture draws facing points as far apart as they are, times the factor: what is
  closed touches, no body enters another one, with any gap; no element is turned inside
  out by the gap that is drawn, and no foundation is drawn between bodies.
- A foundation goes with its body; bodies are pulled apart on demand.
- A profile has the displacement of both sides; files for ParaView hold both bodies and
  the jump. The same on any number of ranks.
- Reports and plots name both sides, and say which forces are internal.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import certified
from test_output import read, texts
from test_split import SIDES, layers, tagged

import erc_contact as ec
from erc_contact import output
from erc_contact.output import deformed
from erc_contact.output.deformed import magnification
from erc_contact.output.gathered import whole_contact
from erc_contact.output.verdict import verdict
from erc_contact.scene.words import in_words

COMM = MPI.COMM_WORLD
MATERIAL = ec.Elastic(E={"upper": 3.0, "lower": 1.0}, nu=0.3)
GAPS = {
    "none": 0.0,
    "constant": 0.05,
    "interference": -0.02,
    "parabola": lambda x: 0.1 * (x[0] - 0.8) ** 2,
}


def tilted_pair(d, *, down=-0.06, gap=0.0, on_foundation=False):
    """A punch that tilts onto a block: a part of the contact opens.

    The block is held, or lies on a foundation, and then the contact is the block's.
    """
    top = (0.01, *[0.0] * (d - 2), lambda x: down + 0.05 * x[0])
    supports = [ec.Displacement("top", top)]
    if on_foundation:
        contact = ec.Contact("block", against="punch", friction=0.3, gap=gap)
        return ec.Scene(MATERIAL, supports, [], [contact, ec.Contact("bottom", friction=0.5)])
    supports.append(ec.Displacement("bottom", (0.0,) * d))
    return ec.Scene(
        MATERIAL, supports, [], [ec.Contact("punch", against="block", friction=0.3, gap=gap)]
    )


def error_of(scene, d, degree=1):
    """The error of a scene with the sides punch and block.

    The upper body is the stiffer one: computed is on the side of the lower one.
    """
    solution = ec.solve(scene, layers(d).split(SIDES), ec.AugmentedLagrangian(), degree=degree)
    return ec.constitutive_error(ec.equilibrate(solution))


@pytest.fixture
def drawn(monkeypatch):
    """What rank 0 would draw: skin, positions of its nodes, lines and foundations."""
    record = []

    def draw_map(ax, skin, x, values, scale, views, lines, grounds, title, letters, **copies):
        from matplotlib.figure import Figure

        assert copies == {"mirrored": False, "motions": []}

        record.append((skin, x, lines, grounds))
        axes = Figure().subplots(1, len(views))
        np.ravel(axes)[0].set_title(title)
        return axes

    monkeypatch.setattr(deformed, "draw_map", draw_map)
    return record


def title_of(axes):
    words = texts(np.ravel(axes)[0].figure)
    (title,) = [text for text in words if text.startswith("displacement")]
    return title


def apart(pair, x):
    """Distances of facing points along the normal."""
    n = np.zeros((len(pair.x), 1, 3))
    n[:, 0, : pair.d] = pair.traction.contact.direction
    return ((x[pair.partners] - x[pair.traction.nodes]) * n).sum(axis=-1)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("gap", "d", "degree"),
    [
        *((gap, 2, 1) for gap in GAPS),
        ("parabola", 2, 2),
        ("none", 3, 1),
        ("interference", 3, 1),
        ("parabola", 3, 1),
    ],
)
def test_distances_are_drawn_as_they_are(gap, d, degree, drawn):
    down = -0.06 - 0.05 * (gap == "constant")
    error = error_of(tilted_pair(d, down=down, gap=GAPS[gap]), d, degree)
    (traction,) = error.admissible.tractions
    pair = whole_contact(error.admissible, traction)
    for factor in (None, 4.0):
        axes = output.draw_deformed(error, factor=factor)
        if COMM.rank > 0:
            continue
        skin, x, lines, grounds = drawn.pop()
        title = title_of(axes)
        times = float(title.split("×")[1].split()[0].strip(","))
        assert times == factor or (factor is None and 1.0 <= times < 3.0)
        assert grounds == []
        assert pair.gap_left.min() > -1e-12
        assert pair.gap_left.max() > 0.01
        assert apart(pair, x) == pytest.approx(times * pair.gap_left, abs=1e-9)
        said = f"displacement and gap × {times:g}, gap drawn on punch"
        if gap == "none":
            said = f"displacement × {times:g}"
        assert title == f"{said}\norange: closed contact"
        orange = [part for part, look in lines if look["color"] == "#D55E00"]
        assert len(orange) == 2
        sides = x[skin.triangles[:, 1:3]] - x[skin.triangles[:, :1]]
        if d == 2:
            assert np.linalg.det(sides[..., :2]).min() > 0


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_a_side_at_rest_is_drawn_at_rest(d, drawn):
    """An interference moves no body off the support that holds it: it is drawn inside the body."""
    ends = [ec.Displacement(side, (0.0,) * d) for side in ("top", "bottom")]
    contact = ec.Contact("punch", against="block", gap=-0.02)
    error = error_of(ec.Scene(ec.Elastic(1.0, 0.3), ends, contacts=contact), d)
    pair = whole_contact(error.admissible, error.admissible.tractions[0])
    height = error.domain.sides[d - 1]
    output.draw_deformed(error, factor=4.0)
    if COMM.rank == 0:
        _, x, _, _ = drawn[0]
        assert apart(pair, x) == pytest.approx(4.0 * pair.gap_left, abs=1e-9)
        assert np.ptp(x[:, d - 1]) == pytest.approx(height, abs=1e-9)


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_a_constant_clearance_is_no_kink(d, drawn):
    """Between two clamped bodies it is drawn as a shift of one of them, with its support."""
    ends = [ec.Displacement(side, (0.0,) * d) for side in ("top", "bottom")]
    contact = ec.Contact("punch", against="block", gap=0.02)
    push = ec.BodyForce((0.0,) * (d - 1) + (-0.01,))
    error = error_of(ec.Scene(ec.Elastic(1.0, 0.3), ends, push, contacts=contact), d)
    output.draw_deformed(error, factor=2.0)
    if COMM.rank == 0:
        _, x, _, _ = drawn[0]
        height = error.domain.sides[d - 1]
        assert np.ptp(x[:, d - 1]) == pytest.approx(height + 2.0 * 0.02, abs=1e-9)


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_foundation_goes_with_its_body(d, drawn):
    """The block makes room for the gap, downward, and its foundation with it."""
    error = error_of(tilted_pair(d, down=-0.15, gap=0.05, on_foundation=True), d)
    block, bottom = (
        whole_contact(error.admissible, traction) for traction in error.admissible.tractions
    )
    output.draw_deformed(error, factor=3.0)
    if COMM.rank == 0:
        _, x, _, grounds = drawn[0]
        ground, _ = grounds[-1]
        assert apart(block, x) == pytest.approx(3.0 * block.gap_left, abs=1e-9)
        height = x[bottom.traction.nodes][..., d - 1]
        assert ground.points[:, d - 1].min() == pytest.approx(-0.15, abs=1e-9)
        assert height == pytest.approx(3.0 * (bottom.gap_left - 0.05), abs=1e-9)


@pytest.mark.serial
def test_bodies_are_pulled_apart(drawn):
    error = error_of(tilted_pair(2, gap=GAPS["parabola"]), 2)
    pair = whole_contact(error.admissible, error.admissible.tractions[0])
    axes = output.draw_deformed(error, factor=2.0, pull=0.3)
    with pytest.raises(ec.InputError, match="a distance > 0"):
        output.draw_deformed(error, pull=-1.0)
    if COMM.rank == 0:
        _, x, _, _ = drawn[0]
        assert apart(pair, x) == pytest.approx(2.0 * pair.gap_left + 0.3, abs=1e-9)
        assert "bodies pulled apart by 0.3 [length]" in title_of(axes)


@pytest.mark.serial
def test_bodies_behind_move_along(drawn):
    """Three layers with two gaps: the upper two make room for the lower gap."""
    stack = ec.rectangle((0.0, 0.0), (2.0, 1.5), cells=(8, 6))
    domain = tagged(
        stack,
        lambda x: 1 + (x[:, 1] > 0.5) + (x[:, 1] > 1.0),
        {"low": 1, "middle": 2, "high": 3},
    )
    domain = domain.split({"under high": "high", "over middle": "middle"})
    domain = domain.split({"under middle": "middle", "over low": "low"})
    contacts = [
        ec.Contact("under high", against="over middle", gap=0.03, friction=0.2),
        ec.Contact("under middle", against="over low", gap=0.02, friction=0.2),
    ]
    supports = [ec.Displacement("top", (0.0, -0.2)), ec.Displacement("bottom", (0.0, 0.0))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, [], contacts)
    error = certified(scene, domain, ec.AugmentedLagrangian())
    pairs = [whole_contact(error.admissible, traction) for traction in error.admissible.tractions]
    output.draw_deformed(error, factor=2.0)
    if COMM.rank == 0:
        skin, x, _, _ = drawn[0]
        for pair in pairs:
            assert apart(pair, x) == pytest.approx(2.0 * pair.gap_left, abs=1e-9)
        heights = skin.points[:, 1]
        assert heights.min() == pytest.approx(0.0, abs=1e-12)
        assert heights.max() == pytest.approx(1.5 + 2.0 * (0.03 + 0.02))


@pytest.mark.on_ranks("2-2", "3-1")
@pytest.mark.parametrize(
    ("d", "degree"), [(2, 1), (2, 2), pytest.param(3, 1, marks=pytest.mark.broad)]
)
def test_profile_has_both_sides(d, degree):
    error = error_of(tilted_pair(d, gap=GAPS["parabola"]), d, degree)
    for result in (error, error.solution):
        table = result.profile("punch")
        axes = "xyz"[:d]
        assert table.dtype.names[-2 * d :] == tuple(
            f"{side}_{axis}" for side in ("u", "other_u") for axis in axes
        )
        jump = np.stack([table[f"u_{axis}"] - table[f"other_u_{axis}"] for axis in axes], axis=1)
        gap = 0.1 * (table["x"] - 0.8) ** 2
        # A gap of the solution is the scene's gap; the other is interpolated.
        assert table["gap"] == pytest.approx(gap + jump[:, -1], abs=2e-3)
        tangential = np.linalg.norm(jump[:, :-1], axis=1)
        assert abs(table["slip"]) == pytest.approx(tangential, abs=1e-12)
    x = np.stack([table[axis] for axis in axes], axis=1)
    some = x[:: max(1, len(x) // 20)]
    inside = some + 1e-7 * np.eye(d)[-1]
    u = np.stack([table[f"u_{axis}"] for axis in axes], axis=1)[:: max(1, len(x) // 20)]
    assert error.solution.at(inside).displacement == pytest.approx(u, abs=1e-6)
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.01))],
        contacts=[ec.Contact("bottom")],
    )
    if d == 2:
        alone = ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)))
        assert alone.profile("bottom").dtype.names[-1] == "weight"


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_files_hold_both_bodies_and_the_jump(d, shared_tmp_path):
    error = error_of(tilted_pair(d, gap=GAPS["parabola"]), d)
    surface = whole_contact(error.admissible, error.admissible.tractions[0])
    force = error.force("punch").force
    output.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        body = read(shared_tmp_path / "body.vtkhdf")
        on_interface = abs(body.points[:, d - 1] - 0.5) < 1e-12
        u = body["displacement"][on_interface]
        # Two nodes at each place of the interface.
        _, number = np.unique(body.points[on_interface].round(9), axis=0, return_inverse=True)
        assert np.all(np.bincount(number) == 2)
        order = np.argsort(number, kind="stable").reshape(-1, 2)
        assert np.ptp(u[order], axis=1).max() > 0.01
        contact = read(shared_tmp_path / "contact_punch.vtkhdf")
        assert np.sort(contact["gap"]) == pytest.approx(np.sort(surface.gap_left.ravel()))
        assert contact["slip"][:, d - 1] == pytest.approx(0.0, abs=1e-14)
        slip = np.linalg.norm(surface.slip, axis=-1).max()
        assert np.linalg.norm(contact["slip"], axis=1).max() == pytest.approx(slip)
        sizes = contact.compute_cell_sizes()["Length" if d == 2 else "Area"]
        assert sizes @ contact["mean_traction"][:, :d] == pytest.approx(force)


@pytest.mark.broad
@pytest.mark.serial
def test_contact_plots_name_both_sides():
    for d in (2, 3):
        error = error_of(tilted_pair(d), d)
        axes = output.plot_contact(error.admissible, "punch")
        if COMM.rank == 0:
            words = texts(np.ravel(axes)[0].figure)
            said = ["traction of block\non punch [force/area]", "punch seen from block"][d - 2]
            assert said in words
            assert not any("foundation" in text for text in words)


@pytest.mark.broad
@pytest.mark.serial
def test_report_says_what_is_internal(shared_tmp_path):
    scene = tilted_pair(2)
    history = ec.adapt(scene, layers(2).split(SIDES), accuracy=0.9, tighten=0)
    history.save(shared_tmp_path, pictures=True)
    forces = history.reactions()
    assert forces["punch"].force == pytest.approx(-forces["block"].force, abs=1e-12)
    assert ("punch against block", "contact, Coulomb friction 0.3, gap 0.0") in in_words(scene)
    assert "the friction bound of punch against block depends" in verdict(history.error)[0][1]
    if COMM.rank == 0:
        page = (shared_tmp_path / "report.html").read_text()
        for words in (
            "<th>punch (internal, from block)</th>",
            "<th>block (internal, from punch)</th>",
            "<th>punch against block</th>",
            "Traction on the contact punch against block",
        ):
            assert words in page
        assert "foundation" not in page
        table = np.genfromtxt(shared_tmp_path / "contact_punch.csv", delimiter=",", names=True)
        assert "other_u_y" in table.dtype.names


def test_supports_that_push_bodies_into_each_other_are_told():
    scene = tilted_pair(2, gap=-0.02)
    held = replace(scene, supports=[ec.Displacement("left", (0.0, 0.0))])
    with pytest.raises(ec.InputError, match=r"Supports push 'punch' into 'block' by 0\.02"):
        ec.solve(held, layers(2).split(SIDES))


@pytest.mark.serial
@pytest.mark.parametrize("gap", [pytest.param(-0.02, marks=pytest.mark.broad), 0.02])
def test_body_inside_another_one(gap, drawn):
    """No rigid motion makes room for the gap around it: the inner body has it drawn."""
    domain = tagged(
        ec.rectangle((0.0, 0.0), (2.0, 2.0), cells=(8, 8)),
        lambda x: np.where(abs(x[:, :2] - 1.0).max(axis=1) < 0.5, 1, 2),
        {"upper": 1, "lower": 2},
    ).split(SIDES)
    sides = [ec.Displacement("left", (0.0, 0.0)), ec.Displacement("right", (0.0, 0.0))]
    contact = ec.Contact("punch", against="block", friction=0.3, gap=gap)
    load = ec.BodyForce((0.0, lambda x: -0.01 * (1.0 - abs(x[0] - 1.0))))
    scene = ec.Scene(MATERIAL, sides, [load], [contact])
    error = certified(scene, domain, ec.AugmentedLagrangian())
    pair = whole_contact(error.admissible, error.admissible.tractions[0])
    output.draw_deformed(error, factor=3.0)
    if COMM.rank == 0:
        skin, x, _, _ = drawn[0]
        assert apart(pair, x) == pytest.approx(3.0 * pair.gap_left, abs=1e-9)
        sides = x[skin.triangles[:, 1:3]] - x[skin.triangles[:, :1]]
        assert np.linalg.det(sides[..., :2]).min() > 0


@pytest.mark.serial
def test_small_body_is_not_drawn_out_of_shape():
    """A block on a plate 20 times as large: its height would change by more than itself."""
    small = ec.rectangle((-0.1, 0.0), (0.1, 0.2), size=0.1)
    plate = ec.rectangle((-2.0, -2.0), (2.0, 0.0), size=1.0)
    domain = ec.assembly({"small": small, "plate": plate}).joined("small bottom", "plate top")
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("small top", (0.0, -0.01)), ec.Displacement("plate bottom", (0.0, 0.0))],
        [],
        [ec.Contact("small bottom", against="plate top", friction=0.3)],
    )
    error = certified(scene, domain)
    factor = magnification(error)
    u = error.at([(0.0, 0.2), (0.0, 1e-6)]).displacement[:, 1]
    size = 0.2 * 2**0.5
    assert 0.2 < factor * abs(u[1] - u[0]) / (0.12 * size) <= 1
    assert factor < 0.5 * 0.06 * domain.extent / 0.01
