"""Releases of other packages: what is too old is told, what is there is used.

- Old DOLFINx and cffi are refused in a sentence that names the way.
- What differs between releases is asked for in one module.
- gmsh without Netgen, and VTK that cannot draw without a display, end no run.
"""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from import_graph import MODULES

import erc_contact as ec
from erc_contact.output import gallery
from namedmesh.base import releases
from namedmesh.gmsh_session import has_netgen
from namedmesh.joining import filling
from namedmesh.pictures import views

pytestmark = pytest.mark.serial
BRIDGED = r"\.dofmaps\[0\]|\.cmaps\[0\]|\.dofmap\b(?!\.)|compile_ufl_objects|extra_domain_integral"
"""What has another name in another release."""


@pytest.mark.parametrize("version", ["0.9.0", "0.9.0.post1", "0.8.1", "0.3"])
def test_old_dolfinx_is_refused_with_the_wheel(version):
    words = rf"needs DOLFINx 0\.10 or newer, and this is {re.escape(version)}; .*pip install"
    with pytest.raises(ImportError, match=words):
        releases.check_releases(version, "2.0.0")


@pytest.mark.parametrize(
    "version", ["0.10.0", "0.10.0.post2", "0.11.0.dev0", "0.11.0", "0.12.0.dev0", "1.0"]
)
def test_dolfinx_from_0_10_on_will_do(version):
    releases.check_releases(version, "2.1.1")


def test_old_cffi_is_refused():
    with pytest.raises(ImportError, match=r"cffi 2\.0 or newer, and this is 1\.17\.1"):
        releases.check_releases("0.11.0", "1.17.1")


def test_one_module_knows_releases():
    others = [path for path in MODULES.values() if path.name != "releases.py"]
    assert len(others) > 300
    asking = [path.name for path in others if re.search(BRIDGED, path.read_text())]
    assert [name for name in asking if name not in ("points.py", "space.py", "surface.py")] == []


def test_geometry_of_0_10_is_read(monkeypatch):
    """In 0.10 a mesh has one type of cell, and FFCx returns header and body."""
    monkeypatch.setattr(releases, "IS_0_10", True)
    nodes = np.zeros((2, 3), dtype=np.int32)
    geometry = SimpleNamespace(dofmap=nodes, cmap="element")
    assert releases.cell_nodes(geometry) is nodes
    assert releases.coordinate_map(geometry) == "element"
    seen = {}

    def compiled(sources, options, prefix):
        seen.update(sources=sources, prefix=prefix)
        return "header", "body"

    monkeypatch.setattr(releases.ffcx.compiler, "compile_ufl_objects", compiled)
    assert releases.c_code(["form"], "name", {}) == "body"
    assert seen == {"sources": ["form"], "prefix": "name"}
    assert releases.other_domains(SimpleNamespace()) == {}


def test_reason_of_old_petsc(monkeypatch):
    reasons = SimpleNamespace(DIVERGED_FNORM_NAN=-4)
    monkeypatch.setattr(
        releases, "PETSc", SimpleNamespace(SNES=SimpleNamespace(ConvergedReason=reasons))
    )
    assert releases.not_a_number() == -4


@pytest.mark.parametrize(
    ("options", "has"),
    [("Mesh Netgen OpenCASCADE", True), ("Netgen[contrib]", True), ("Mesh NoNetgen", False)],
)
def test_gmsh_tells_whether_it_has_netgen(options, has):
    option = SimpleNamespace(getString=lambda name: options)
    assert has_netgen(SimpleNamespace(option=option)) is has


def test_bodies_in_space_that_were_meshed_apart_need_netgen(monkeypatch):
    monkeypatch.setattr(filling, "has_netgen", lambda gmsh: False)
    monkeypatch.setattr(filling, "POOR", 2.0)  # all cells are poor
    upper = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2))
    lower = ec.box((-1.0, -1.0, -1.0), (2.0, 2.0, 0.0), cells=(4, 4, 2))
    both = ec.assembly({"a": upper, "b": lower})
    with pytest.raises(ec.InputError, match=r"built without it.*pip install gmsh"):
        both.joined("a bottom", "b top")


@pytest.mark.broad
def test_a_run_is_saved_without_pictures_that_cannot_be_drawn(monkeypatch, tmp_path, caplog):
    lack = "without a display this needs VTK 9.4"
    monkeypatch.setattr(views, "lack_of_window", lambda: lack)
    domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    shown = gallery.Gallery(domain, Path(tmp_path), 0.0, every=True)
    with caplog.at_level("WARNING", logger="erc_contact"):
        shown.add("parts.png", "The parts.", "code", lambda path: ec.draw_parts(domain, path))
    assert shown.drawn == {}
    assert shown.missing == {}  # there was time for it
    assert lack in caplog.text
