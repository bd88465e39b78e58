"""A view of a body in 3D is one page that needs nothing else, and shows what was computed.

- Its triangles are those of the body, drawn at X + s u^ up to the places of the page.
- The pressure that it shows sums up to the force of the contact, on both sides of a pair.
- A browser loads it without a network and without an error of its console, and turns it.
"""

import json
import re
import shutil
import subprocess
import zlib
from base64 import b64decode
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block

import erc_contact as ec
from erc_contact.output import comparison, view_page, views
from erc_contact.output.gathered import whole_body
from namedmesh.simplex import measures

COMM = MPI.COMM_WORLD
BROWSER = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)


@pytest.fixture(scope="module")
def error():
    scene = ec.Scene(
        ec.Elastic(E=1.0, nu=0.3),
        ec.Displacement("top", (0.02, -0.05)),
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    solution = ec.solve(scene, block(2), ec.AugmentedLagrangian())
    return ec.constitutive_error(ec.equilibrate(solution))


def unpacked(view):
    """What a page has inside: its head, triangles of meshes, and places and colours of steps."""
    text = re.search(r'type="application/json">(.*?)</script>', view.page, re.DOTALL)[1]
    head = json.loads(text)
    data = zlib.decompress(b64decode(head["packed"]))
    start = 0

    def following(kind, *shape):
        nonlocal start
        values = np.frombuffer(data, kind, int(np.prod(shape)), start).reshape(shape)
        start += values.nbytes
        return values

    triangles = [following("<u4", mesh["triangles"], 3) for mesh in head["meshes"]]
    places = [following("<u2", frame["points"], 3) for frame in head["frames"]]
    colours = [
        [following("u1", head["meshes"][frame["mesh"]]["triangles"]) for _ in head["fields"]]
        for frame in head["frames"]
    ]
    assert start == len(data)
    return head, triangles, places, colours


def test_page_has_the_deformed_body(error):
    view = error.show()
    body, _ = whole_body(error.admissible)
    if COMM.rank > 0:
        assert view.page == ""
        return
    head, (triangles,), (places,), ((stress, share, pressure),) = unpacked(view)
    bodys = head["meshes"][0]["body"]
    assert bodys == len(body["cells"])
    factor = float(head["words"].split("× ")[1])
    x = body["points"] + factor * body["u"]
    scaled = x / np.ptp(x, axis=0).max()
    drawn = places[np.unique(triangles[:bodys])] / view_page.PLACES
    assert drawn - drawn[0] == pytest.approx(scaled - scaled[0], abs=2 / view_page.PLACES)
    # grey is what has no value: contacts of cells, and cells of contacts
    for of_cells in (stress, share):
        assert np.all(of_cells[:bodys] > 0)
        assert not of_cells[bodys:].any()
    assert not pressure[:bodys].any()
    assert np.all(pressure[bodys:] > 0)
    assert [field["label"] for field in head["fields"]] == [
        "von Mises stress [force/area]",
        f"{views.ERROR}, log scale",
        views.PRESSURE,
    ]


def test_pressure_of_a_view_has_the_force_of_the_contact(error, monkeypatch):
    """Of the error and of the solution, whose tractions differ."""
    taken = []
    of_contacts = views._pieces_of
    monkeypatch.setattr(
        views, "_pieces_of", lambda *given: taken.append(of_contacts(*given)) or taken[-1]
    )
    body, _ = whole_body(error.admissible)
    for result in (error, error.solution):
        result.show()
        force = result.force("bottom").force[1]
        if COMM.rank == 0:
            pieces = taken[-1]
            lengths = measures(body["points"][pieces["vertices"]][..., :2])
            assert lengths @ pieces["pressure"] == pytest.approx(force, rel=1e-9)
            assert np.all(pieces["normals"] == (0.0, -1.0))


def test_steps_share_their_mesh(error):
    times = np.array([0.5, 1.0])
    history = SimpleNamespace(errors=(error, error), column=lambda name: times)
    view = ec.output.show_history(history)
    if COMM.rank == 0:
        head, triangles, places, _ = unpacked(view)
        assert len(triangles) == 1
        assert [frame["words"] for frame in head["frames"]] == ["t = 0.5", "t = 1"]
        assert np.array_equal(*places)


def test_views_stay_small(error, monkeypatch):
    """Steps are left out but for the last one; a mesh that is too large is refused on all ranks."""
    view = error.show()
    steps = 5
    history = SimpleNamespace(errors=(error,) * steps, column=lambda name: np.arange(steps))
    whole = ec.output.show_history(history)
    size = COMM.bcast(
        len(zlib.decompress(b64decode(unpacked(view)[0]["packed"]))) if COMM.rank == 0 else None
    )
    monkeypatch.setattr(view_page, "MOST_BYTES", int(2.2 * size))
    some = ec.output.show_history(history)
    if COMM.rank == 0:
        assert len(unpacked(whole)[0]["frames"]) == steps
        words = [frame["words"] for frame in unpacked(some)[0]["frames"]]
        assert words == ["t = 0", "t = 2", "t = 4"]
    monkeypatch.setattr(view_page, "MOST_BYTES", size - 1)
    with pytest.raises(ec.InputError, match="too large for a page"):
        error.show()


def test_two_runs_side_by_side(error, shared_tmp_path):
    def run(accuracy):
        scene = error.solution.scene
        return ec.adapt(scene, block(2), accuracy=accuracy, method=ec.AugmentedLagrangian())

    coarse, fine = run(0.5), run(0.09)
    file = shared_tmp_path / "two.html"
    ec.output.compare(coarse, fine, file, ("coarse", "fine"))
    numbers = comparison._numbers_of(fine)
    if COMM.rank == 0:
        page = file.read_text()
        assert page.count("<iframe") == 2
        assert "<td>0.5</td><td>0.09</td>" in page
        assert all(f"<td>{number:.6g}</td>" in page for number in numbers.values())
        assert not re.search(r'(src|href)="(?!data:)', page)
    with pytest.raises(ec.InputError, match="Domain is no run with its results"):
        ec.output.compare(coarse, error.domain, file)


PROBE = """<script>
window.onerror = (words) => { document.title = "failed: " + words; };
setTimeout(() => {
  const pictures = [canvas.toDataURL()];
  const seen = () => { const now = canvas.toDataURL(); const is_new = !pictures.includes(now);
    pictures.push(now); return is_new; };
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  const turned = seen();
  byId("field").selectedIndex = 2; byId("field").onchange();
  const coloured = seen();
  byId("step").value = 0; byId("step").oninput();
  const stepped = seen();
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  document.title = JSON.stringify({ turned, coloured, stepped, wide });
}, 1000);
</script></body>"""
"""What asks the page in the browser."""


@pytest.mark.serial
@pytest.mark.skipif(BROWSER is None, reason="no browser of the family of Chromium")
def test_browser_turns_the_view(error, tmp_path):
    """On a screen of 390 pixels, with no network; the console says nothing."""
    other = ec.solve(
        ec.Scene(
            ec.Elastic(E=1.0, nu=0.3),
            ec.Displacement("top", (0.0, -0.02)),
            contacts=[ec.Contact("bottom", friction=0.3)],
        ),
        error.domain,
        ec.AugmentedLagrangian(),
    )
    other_error = ec.constitutive_error(ec.equilibrate(other))
    history = SimpleNamespace(errors=(other_error, error), column=lambda name: np.arange(2.0))
    page = ec.output.show_history(history).page
    file = tmp_path / "view.html"
    file.write_text(page.replace("</body>", PROBE))
    options = (
        "--headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader "
        "--window-size=390,600 --virtual-time-budget=5000 --enable-logging=stderr --dump-dom "
        "--proxy-server=127.0.0.1:9"
    )
    run = subprocess.run(
        [BROWSER, *options.split(), f"--user-data-dir={tmp_path / 'profile'}", file.as_uri()],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    title = re.search("<title>(.*?)</title>", run.stdout)[1]
    told = json.loads(title.replace("&quot;", '"'))
    assert told == {"turned": True, "coloured": True, "stepped": True, "wide": 0}
    assert "CONSOLE" not in run.stderr
