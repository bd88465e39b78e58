"""Units are words: pictures, views and reports write them, and nothing is computed with them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block

import erc_contact as ec
from erc_contact import output
from erc_contact.results import Force
from erc_contact.run.fingerprint import fingerprint
from erc_contact.scene.units import in_units

COMM = MPI.COMM_WORLD
UNITS = "mm, N/mm, MPa"


def error(units):
    scene = ec.Scene(
        ec.Elastic(E=1.0, nu=0.3),
        ec.Displacement("top", (0.02, -0.05)),
        contacts=[ec.Contact("bottom", friction=0.3)],
        units=units,
    )
    return ec.constitutive_error(
        ec.equilibrate(ec.solve(scene, block(2), ec.AugmentedLagrangian()))
    )


@pytest.fixture(scope="module")
def both():
    return error(""), error(UNITS)


def test_units_change_no_number(both):
    plain, with_units = both
    assert with_units.absolute == plain.absolute
    assert np.array_equal(with_units.indicators, plain.indicators)
    scenes = [each.solution.scene for each in both]
    assert scenes[0] == scenes[1]
    first, second = (fingerprint(scene, plain.domain, {}) for scene in scenes)
    assert first == second


def test_pictures_have_units(both):
    from matplotlib.text import Text

    for each, length, stress in zip(both, ("length", "mm"), ("force/area", "MPa"), strict=True):
        drawn = [output.draw_deformed(each), output.plot_contact(each, "bottom")]
        page = each.show().page
        if COMM.rank > 0:
            continue
        for axes in drawn:
            words = [text.get_text() for text in axes.figure.findobj(Text)]
            assert f"x [{length}]" in words
            assert any(f"[{stress}]" in said for said in words)
        assert f"pressure of contacts [{stress}]" in page


def test_prints_have_units(both):
    """Numbers with a dimension that forces, intervals, maxima, errors and certificates print."""
    plain, with_units = both
    certified = ec.certify(with_units.solution.scene, with_units.domain, with_units.solution.u)
    moved = replace(certified, off_supports=0.25)
    energy = ec.interval(with_units, ec.Energy())
    for number in (energy, ec.potential_energy(with_units)):
        assert str(number).split(", ")[0].endswith(" N/mm·mm")
    force = ec.resultant(with_units, "bottom", (0.0, 1.0))
    assert re.fullmatch(r"\S+ N/mm, between \S+ N/mm and \S+ N/mm \(estimated\)", str(force))
    for result in (with_units, with_units.solution):
        of_part = result.force("bottom")
        assert re.fullmatch(r"force \(\S+, \S+\) N/mm, moment \S+ N/mm·mm", str(of_part))
        assert str(of_part + of_part).count("N/mm") == 2
        assert "force [N/mm]" in of_part._repr_html_()
    assert "up to 0.25 mm." in str(moved)
    assert "0.25 mm" in moved._repr_html_()
    assert " MPa at (" in str(with_units.maximum("von Mises"))
    assert " mm at (" in str(with_units.maximum("displacement"))
    assert "sqrt(N/mm·mm)" in repr(with_units)
    assert "sqrt(N/mm·mm)" in str(ec.coulomb_certificate(with_units))
    assert "unit" not in repr(force)
    words = [str(plain.force("bottom")), str(ec.potential_energy(plain)), repr(plain)]
    assert not any("mm" in each or "[" in each for each in words)


def test_forces_of_a_history_print_a_line_for_each_step():
    forces = Force(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0], [6.0]]), "mm, N, MPa")
    assert str(forces).splitlines() == [
        "force (1, 2) N, moment 5 N·mm",
        "force (3, 4) N, moment 6 N·mm",
    ]
    assert forces._repr_html_().count("force [N]") == 2


@pytest.mark.serial
def test_report_has_units(tmp_path):
    scene = error(UNITS).solution.scene
    history = ec.adapt(scene, block(2), accuracy=0.5, method=ec.AugmentedLagrangian())
    history.save(tmp_path, pictures=True)
    page = (tmp_path / "report.html").read_text()
    assert "exact solution [N/mm]" in page
    assert "moments [N/mm·mm]" in page
    assert "units=&#x27;mm, N/mm, MPa&#x27;," in page
    assert "[force" not in page
    assert "[length" not in page


@pytest.mark.serial
def test_units_are_three_words():
    text = "e [sqrt(force length)], u [length], a share [-] of F [force]"
    assert in_units(text, "m, N, Pa") == "e [sqrt(N·m)], u [m], a share [-] of F [N]"
    assert in_units(text, "") == text
    assert in_units("K [force/length^1.5]", "mm, N, MPa") == "K [MPa·√mm]"
    for units in ("mm", "mm, N", "mm, , MPa", "mm, N, MPa, s", 3):
        with pytest.raises(ec.InputError, match="as in 'mm, N, MPa'"):
            ec.Scene(ec.Elastic(E=1.0, nu=0.3), units=units)
