"""Pictures for papers.

Vectors, axes of the user's, nothing cut off, nothing that was not computed.

- Curves of degree 1 keep the mean of the traction on each facet, follow a line exactly,
  and do not change their sign.
- A singular peak stays in the picture, and the rest can be read.
- svg and pdf files of bodies in the plane hold no image; degree 2 is drawn with curved
  edges there, too.
- Axes that are given are drawn on and returned, with the style of their figure; in 3D
  they are refused in words.
- Maps of a contact in 3D are what an eye in the foundation sees.
- All words of a figure are inside it, no panel covers another one, and both views of a
  body in 3D are images of their own.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import measured
from test_output import punch

import erc_contact as ec
from erc_contact import output
from erc_contact.output.along import through_means
from erc_contact.output.contact_plots import (
    CURVES_SIZE,
    PRESSURE,
    _write_legend,
    contact_curves,
)
from erc_contact.output.deformed import magnification
from erc_contact.output.foundations import UNSEEN, foundation_of, round_factor
from erc_contact.output.gathered import whole_contact, whole_contacts
from erc_contact.output.windows import near_window
from erc_contact.results.stresses import cell_stresses, linear_mises, vertex_stress
from namedmesh.pictures import new_figure

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module", params=[1, pytest.param(2, marks=pytest.mark.broad)])
def error(request):
    return measured(
        punch(2)[0], ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=(16, 4)), degree=request.param
    )


@pytest.mark.serial
def test_curves_keep_means_lines_and_signs():
    rng = np.random.default_rng(5)
    lengths, points = rng.uniform(0.1, 1.0, 30), np.linspace(0.0, 1.0, 2001)
    parts = np.array([7, 8, 20])
    for means in (
        rng.uniform(0.0, 1.0, 30) * (rng.random(30) < 0.8),
        rng.normal(size=30),
        np.zeros(30),
    ):
        curve = through_means(means, lengths, parts, points)
        assert np.trapezoid(curve, points, axis=1) == pytest.approx(means, abs=1e-6)
        assert np.all(curve * means[:, None] >= -1e-12)
        inside = np.setdiff1d(np.arange(1, 30), parts)
        assert curve[inside, 0] == pytest.approx(curve[inside - 1, -1], abs=1e-12)
    s = np.append(0.0, np.cumsum(lengths))
    line = through_means(5.0 + 0.5 * (s[1:] + s[:-1]), lengths, parts[:0], points[::500])
    assert line == pytest.approx(5.0 + s[:-1, None] + lengths[:, None] * points[::500], rel=1e-12)


@pytest.mark.serial
def test_peaks_stay_in_the_picture():
    (traction,) = (pair := measured(*punch(2)).admissible).tractions
    surface = whole_contact(pair, traction)
    linear = contact_curves(surface)
    assert linear.get_yscale() == "linear"
    facet = -traction.normal_component.mean(axis=1)
    surface.traction.values[facet.argmax()] *= 1e4
    peak = float((-surface.traction.normal_component).max())
    axes = contact_curves(surface)
    low, high = axes.get_ylim()
    assert axes.get_yscale() == "symlog"
    assert low < 0 < peak < high
    for line in axes.lines:
        y = line.get_ydata()
        assert np.nanmax(y) <= high
        assert np.nanmin(y) >= low
    ticks = axes.yaxis.get_ticklocs()
    places = np.sort(axes.transData.transform(np.column_stack([0 * ticks, ticks]))[:, 1])
    assert len(ticks) > 4
    assert np.diff(places).min() > 12  # pixels: numbers do not overlap
    rest = np.nanquantile(
        np.concatenate([x.get_ydata() for x in axes.lines if x.get_color() == PRESSURE]), 0.6
    )
    shown, zero = (axes.transData.transform((0.0, value))[1] for value in (rest, 0.0))
    assert shown - zero > 0.1 * axes.bbox.height


@pytest.mark.broad
@pytest.mark.serial
def test_vectors_hold_no_image(error, shared_tmp_path):
    """Lines of elements of degree 2 have more points than their ends."""
    output.draw_deformed(error, shared_tmp_path / "deformed.svg", factor=5.0)
    output.draw_error(error, shared_tmp_path / "error.pdf")
    output.plot_contact(error.admissible, "bottom", shared_tmp_path / "contact.svg")
    output.draw_meshes([(error.domain, error.indicators)], shared_tmp_path / "meshes.svg")
    if COMM.rank == 0:
        for name in ("deformed", "contact", "meshes"):
            text = (shared_tmp_path / f"{name}.svg").read_text()
            images = re.findall("<image", text)
            assert len(images) == (name == "deformed")  # its colour bar
            assert text.count("<path") > (10 if name == "contact" else error.domain.cells)
        text = (shared_tmp_path / "error.pdf").read_bytes()
        assert b"/Type3" not in text
        assert text.startswith(b"%PDF")


@pytest.mark.serial
@pytest.mark.parametrize("statuses", [(2,), (1, 2), (0, 1, 2)])
@pytest.mark.parametrize("degree", [1, 2])
def test_no_entry_of_a_legend_stands_alone(degree, statuses):
    axes = new_figure(*CURVES_SIZE).subplots()
    for label in ("friction bound", "pressure", "shear along (1, 0)"):
        axes.plot([0.0, 1.0], label=label)
    _write_legend(axes, np.array(statuses), degree)
    axes.figure.draw_without_rendering()
    texts = axes.get_legend().get_texts()
    _, entries = np.unique([round(t.get_window_extent().y0, -1) for t in texts], return_counts=True)
    assert entries.min() > 1


def small_contact(**options):
    """A block on a round foundation, whose contact is small beside it."""
    domain = ec.rectangle((-1.0, 0.0), (1.0, 1.0), cells=(48, 24))
    contact = ec.Contact("bottom", gap=lambda x: x[0] ** 2, **options)
    support = ec.Displacement("top", (0.0, -0.005))
    return measured(ec.Scene(ec.Elastic(1.0, 0.3), support, contacts=contact), domain)


@pytest.mark.serial
def test_curves_without_friction_have_no_shear():
    """Shear and bound would be lines of zeros."""
    for friction in (0.0, 0.3):
        axes = output.plot_contact(small_contact(friction=friction).admissible, "bottom")
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        assert ("friction bound" in labels) == (friction > 0)
        assert any("shear" in label for label in labels) == (friction > 0)
        assert ("closed" in labels) == (friction == 0)


@pytest.mark.broad
@pytest.mark.serial
def test_maps_without_friction_have_no_shear():
    for friction, count in ((0.0, 2), (0.4, 3)):
        scene, domain = punch(3)
        contact = replace(scene.contacts[0], friction=friction)
        pair = measured(replace(scene, contacts=[contact]), domain).admissible
        panels = output.plot_contact(pair, "bottom")
        assert len(panels) == count


@pytest.mark.serial
def test_a_picture_near_a_contact_shows_it_alone():
    """Gap and displacement are magnified alike: what is closed is drawn closed."""
    error = small_contact()
    window = near_window(error, "bottom")
    assert np.ptp(window[:, 0]) < 1.0
    axes = output.draw_near(error, "bottom")
    low, high = axes.get_xlim()
    closed = error.profile("bottom")
    closed = closed["x"][closed["status"] != 0]
    assert low < closed.min() < closed.max() < high
    assert high - low < 1.0
    shown = output.draw_error(error, near="bottom").get_xlim()
    assert np.allclose(shown, window[:, 0])
    assert np.ptp(output.draw_error(error).get_xlim()) >= 2.0
    with pytest.raises(ec.InputError, match="no small part"):
        output.draw_error(measured(*punch(2)), near="bottom")
    with pytest.raises(ec.InputError, match="no small part"):
        output.draw_near(measured(*punch(2)), "bottom")
    with pytest.raises(ec.InputError, match="nowhere"):
        output.draw_near(error, "nowhere")


@pytest.mark.serial
def test_a_body_on_a_soft_foundation_is_drawn_on_it():
    """The foundation moves with the body: it is not entered by what is magnified."""
    error = small_contact(foundation=ec.Foundation(0.05))
    factor = round_factor(magnification(error))
    contacts = whole_contacts(error.admissible)
    true = -min(contact.gap_left.min() for contact in contacts)
    entry = max(foundation_of(contact).entry(factor) for contact in contacts)
    assert factor > 2
    assert true > 0
    assert entry < true + 1.1 * UNSEEN * error.domain.extent


@pytest.mark.on_ranks("1")
def test_axes_are_drawn_on_and_returned(error):
    given = dict.fromkeys(("one", "two", "few", "contact"))
    if COMM.rank == 0:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(12, 6))
        axes = figure.subplots(2, 4).ravel()
        given = {"one": axes[0], "two": axes[1:3], "few": axes[3:6], "contact": axes[6]}
    run = {"run": ec.adapt(error.solution.scene, error.domain, 0.9, tighten=0)}
    found = {
        "one": output.draw_error(error, ax=given["one"]),
        "two": output.plot_history(run, ax=given["two"]),
        "few": output.draw_meshes([(error.domain, error.indicators)] * 5, ax=given["few"]),
        "contact": output.plot_contact(error.admissible, "bottom", ax=given["contact"]),
    }
    new = output.draw_deformed(error)
    with pytest.raises(ec.InputError, match="ax has 3 axes; it needs 2"):
        output.plot_history(run, ax=np.arange(3))
    if COMM.rank > 0:
        assert new is None
        assert list(found.values()) == [None] * 4
        return
    for name, axes in given.items():
        assert np.all(np.ravel(found[name]) == np.ravel(axes))
        assert all(one.has_data() for one in np.ravel(axes))
    assert new.figure is not figure
    assert new.get_title().startswith("displacement")
    assert new.get_xlabel() == "x [length]"


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_stress_of_degree_2_is_linear_in_elements(d):
    """In pure bending sigma^ is linear.

    At the vertices of elements it is what it is there.
    """
    bend, sides = 0.01, ("left", "right", "bottom", "top", "front", "back")[: 2 * d]
    u = (lambda x: -bend * x[0] * x[1], lambda x: bend / 2 * x[0] ** 2, 0.0)[:d]
    scene = ec.Scene(
        ec.Elastic(E=1.0, nu=0.0), supports=[ec.Displacement(name, u) for name in sides]
    )
    domain = (ec.rectangle if d == 2 else ec.box)(
        (0.0,) * d, (2.0, 1.0, 1.0)[:d], cells=(2, 1, 1)[:d]
    )
    error = measured(scene, domain, degree=2)
    assert error.relative < 1e-8
    model = error.solution.model
    x = model.space.V.tabulate_dof_coordinates()[
        error.admissible.cell_geometry.vertices[: domain.owned_cells]
    ]
    expected = np.zeros((*x.shape[:2], 3, 3))
    expected[..., 0, 0] = -bend * x[..., 1]
    for kind in ("admissible", "best", "elastic"):
        assert vertex_stress(error.admissible, kind) == pytest.approx(expected, abs=1e-9)
    with pytest.raises(ec.InputError, match="'best'"):
        vertex_stress(error.admissible, "exact")


def test_best_stress_is_drawn_where_it_is_asked_for(error):
    """Its picture has other colours, its name, and the colours of its file."""
    of_sigma = output.draw_deformed(error)
    best = output.draw_deformed(error, stress="best")
    if COMM.rank == 0:
        labels = [axes.figure.axes[-1].get_xlabel() for axes in (of_sigma, best)]
        assert "(best)" not in labels[0]
        assert "(best)" in labels[1]
    pair = error.admissible
    both = linear_mises(pair), linear_mises(pair, "best")
    assert not np.allclose(*both)
    if error.degree == 1:
        assert both[1][:, 0] == pytest.approx(cell_stresses(pair)["von_mises_best"])


@pytest.mark.serial
def test_contact_in_space_is_seen_from_the_foundation():
    error = measured(*punch(3))
    panels = output.plot_contact(error.admissible, "bottom")
    with pytest.raises(ec.InputError, match="leave ax out"):
        output.draw_error(error, ax=object())
    if COMM.rank == 0:
        assert len(panels) == 3
        (left, right), (low, high) = panels[0].get_xlim(), panels[0].get_ylim()
        assert left < right  # x to the right, y downward: z points away from the eye
        assert low > high
        assert panels[1].get_title() == "seen from the foundation"


@pytest.mark.broad
@pytest.mark.serial
def test_words_have_room_and_views_differ():
    whole = measured(*punch(3))
    axes = output.draw_deformed(whole)
    panels = [axes, output.plot_contact(whole, "bottom"), output.draw_error(whole)]
    for shown in panels:
        figure = np.ravel(shown)[0].figure
        renderer = figure.canvas.get_renderer()
        artists = (*figure.axes, *figure.texts)
        boxes = []
        for artist in artists:
            is_panel = artist in figure.axes
            extent = artist.get_tightbbox if is_panel else artist.get_window_extent
            boxes.append(extent(renderer))
        for number, box in enumerate(boxes):
            inside = figure.bbox.padded(2).get_points()
            assert np.all((box.get_points() >= inside[0]) & (box.get_points() <= inside[1]))
            assert not any(box.overlaps(other) for other in boxes[:number])
    above, below = (panel.images[0].get_array() for panel in axes)
    assert above.shape != below.shape or np.any(above != below)
    colours = [len(np.unique(image.reshape(-1, 3), axis=0)) for image in (above, below)]
    assert min(colours) > 10
