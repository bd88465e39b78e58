"""The command ``erc-contact``: each subcommand on a small deck, as users call it.

It is a process of its own, on one rank or two; what it returns is part of it.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from processes import environment

HERE = Path(__file__).parent
SECONDS = 200
pytestmark = pytest.mark.serial


def command(folder, *words, ranks=1):
    """What the command returns, prints, and says of errors."""
    mpiexec = str(Path(sys.executable).parent / "mpiexec")
    launch = [] if ranks == 1 else [mpiexec, "-n", str(ranks)]
    run = subprocess.run(
        [*launch, sys.executable, "-m", "erc_contact", *map(str, words)],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    return run.returncode, run.stdout, run.stderr


def last_line(text):
    return text.rstrip().splitlines()[-1]


@pytest.mark.broad
@pytest.mark.parametrize("name", ["parts", "deck", "certify", "refine", "solve", "check"])
def test_each_has_help_with_an_example(name, tmp_path):
    returned, told, _ = command(tmp_path, name, "--help")
    assert returned == 0
    assert f"erc-contact {name}" in told.split("example:")[1]


@pytest.mark.broad
def test_parts_of_a_deck(tmp_path):
    returned, told, _ = command(tmp_path, "parts", HERE / "prepomax_slide.inp")
    assert returned == 0
    assert "Slave           2    20" in told
    assert "Master  Slave      20         0" in told
    assert last_line(told) == "Picture: parts.png"
    assert (tmp_path / "parts.png").stat().st_size > 1000


@pytest.mark.broad
def test_what_a_deck_is(tmp_path):
    returned, told, _ = command(tmp_path, "deck", HERE / "freecad_contact.inp")
    assert returned == 0
    assert "DEPConstraintContact against INDConstraintContact" in told
    assert "assumed" in told
    assert "left out" in told
    assert last_line(told) == "Report: freecad_contact_deck/deck.txt"
    assert (tmp_path / "freecad_contact_deck" / "deck.txt").read_text().strip() in told


@pytest.mark.broad
def test_a_solution_on_two_ranks(tmp_path):
    """Rank 0 prints; the force is the pressure of 8 on 10 times 10."""
    deck = HERE / "freecad_contact.inp"
    returned, told, wrong = command(tmp_path, "solve", deck, "-o", "out", ranks=2)
    assert returned == 0, wrong
    assert told.count("Forces on the parts at the end:") == 1
    assert "DEPConstraintContact  z  800  between 800 and 800 (proved)" in told
    assert last_line(told) == "Report: out/report.html"
    assert "Reached" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.broad
def test_steps_are_a_history(tmp_path):
    deck = HERE / "prepomax_slide.inp"
    returned, told, wrong = command(tmp_path, "solve", deck, "--accuracy", 0.3)
    assert returned == 0, wrong
    assert "All 2 steps to t = 2 are done." in told
    assert (tmp_path / "prepomax_slide_solved" / "evolution.csv").exists()


@pytest.mark.broad
def test_an_accuracy_that_is_not_reached(tmp_path):
    deck = HERE / "prepomax_tube.inp"
    returned, told, _ = command(tmp_path, "solve", deck, "--accuracy", 1e-3, "--max-cells", 8)
    assert returned == 1
    assert last_line(told) == "Report: prepomax_tube_solved/report.html"


@pytest.mark.broad
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_refused_deck(ranks, tmp_path):
    """One message tells the card and its line; without the card, the deck is taken."""
    text = (HERE / "prepomax_strip.inp").read_text()
    (tmp_path / "job.inp").write_text(text.replace("*Step", "*Equation\n1\n1, 1, 1.\n*Step", 1))
    returned, told, wrong = command(tmp_path, "deck", "job.inp", ranks=ranks)
    assert returned == 2
    assert not told
    assert wrong.count("*EQUATION (job.inp:") == 1
    assert "Traceback" not in wrong
    returned, told, _ = command(tmp_path, "deck", "job.inp", "--without", "*EQUATION", ranks=ranks)
    assert returned == 0
    assert "*EQUATION" in told


def test_a_wrong_command_line(tmp_path):
    returned, _, wrong = command(tmp_path, "solve")
    assert returned == 2
    assert "the following arguments are required: deck" in wrong


calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")


def computed(folder, name):
    """Deck and result of CalculiX in a folder."""
    shutil.copy(HERE / f"{name}.inp", folder)
    subprocess.run(["ccx", name], cwd=folder, check=True, capture_output=True, timeout=SECONDS)
    return f"{name}.inp", f"{name}.frd"


@pytest.mark.broad
@calculix
def test_a_result_of_calculix_is_certified(tmp_path):
    """Its contact is a penalty of 1e6, which leaves an error of a thousandth."""
    files = computed(tmp_path, "freecad_contact")
    returned, told, wrong = command(tmp_path, "certify", *files)
    assert returned == 0, wrong
    assert "freecad_contact.frd at t = 1 has the error eps = 0.1153%" in told
    assert "Bodies penetrate by up to 8e-06" in told
    assert "Forces: 2 of 2 are known of freecad_contact.frd and have an interval" in told
    folder = tmp_path / "freecad_contact_certified"
    assert last_line(told) == "Report: freecad_contact_certified/report.html"
    page = (folder / "report.html").read_text()
    assert "Share of each element in eps." in page
    assert "Bodies penetrate" in page
    assert (folder / "verdict.txt").read_text().splitlines()[0] in told


@pytest.mark.broad
@calculix
def test_a_finer_deck_does_not_depend_on_the_ranks(tmp_path):
    """A concrete column under its weight: eps of 6% falls with the square of the size."""
    files = computed(tmp_path, "prepomax_weight")
    for ranks in (1, 2):
        words = ("refine", *files, "--accuracy", 0.02, "-o", f"next_{ranks}.inp")
        returned, told, wrong = command(tmp_path, *words, ranks=ranks)
        assert returned == 0, wrong
        assert "for about 2%" in told
        assert last_line(told) == f"Deck: next_{ranks}.inp"
    alone, together = ((tmp_path / f"next_{ranks}.inp").read_text() for ranks in (1, 2))
    assert alone == together


@pytest.mark.broad
@calculix
def test_a_result_that_is_not_accurate_enough(tmp_path):
    """The last of several steps is taken, and what one step leaves out is told."""
    files = computed(tmp_path, "prepomax_slide")
    returned, told, _ = command(tmp_path, "certify", *files)
    assert returned == 1
    assert "prepomax_slide.frd at t = 2" in told
    assert "several steps with friction" in told


@pytest.mark.broad
@calculix
def test_a_result_that_ends_early_is_compared_with_its_own_time(tmp_path):
    deck, result = computed(tmp_path, "prepomax_slide")
    lines = (tmp_path / result).read_text().splitlines(keepends=True)
    heads = [i for i, line in enumerate(lines) if line.startswith("    1PSTEP")]
    second = next(i for i in heads if lines[i + 1].startswith("  100CL  103"))
    (tmp_path / result).write_text("".join([*lines[:second], " 9999\n"]))
    _, told, _ = command(tmp_path, "certify", deck, result)
    assert "prepomax_slide.frd at t = 1 has the error" in told
    assert "before the end of the deck at t = 2" in told


@pytest.mark.broad
@calculix
def test_a_bolt_has_the_shift_of_its_result(tmp_path):
    """Its force is E A/L times the shift, 200000 100/40 0.04, as the deck asks for."""
    returned, told, wrong = command(tmp_path, "certify", *computed(tmp_path, "prepomax_bolt"))
    assert returned == 0, wrong
    assert "The bolt at Cut side 1 is shortened by 0.04 as in the result" in told
    assert "The force 20000 that the deck asks for is in the interval of its force." in told
    assert "Cut side 1  bolt  20000  between 20000 and 20000 (proved)" in told


@pytest.mark.broad
@calculix
def test_a_plastic_deck_is_not_certified_and_says_what_to_do(tmp_path):
    deck, result = computed(tmp_path, "prepomax_weight")
    path = tmp_path / deck
    path.write_text(path.read_text().replace("*Density", "*Plastic\n10., 0.\n*Density", 1))
    returned, _, wrong = command(tmp_path, "certify", deck, result)
    assert returned == 2
    assert "`erc-contact solve` compute it with its error" in wrong
