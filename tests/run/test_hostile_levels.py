"""Level files of others, whose sums are right: what makes no sense is left out, and nothing runs.

A level is taken apart, changed and packed again, as anybody can do it.
"""

import logging

import numpy as np
import pytest

import erc_contact as ec
from erc_contact.run.levels import unpack_level
from namedmesh.keeping import pack

pytestmark = pytest.mark.serial
ACTS = 'SystemCall "touch acted";\nPoint(1) = {0, 0, 0};\n'
SQUARE = """
Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1}; Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Physical Curve("foot", 7) = {1}; Physical Curve("roof", 3) = {3}; Physical Surface("body", 5) = {1};
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The contents of a level file of a shape that a script has made."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "square.geo").write_text(SQUARE)
    square = ec.read_mesh(folder / "square.geo", scripts=True)
    press = ec.Displacement("roof", (0.0, -0.02))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), press, contacts=ec.Contact("foot"))
    ec.adapt(scene, square, accuracy=0.9, checkpoint=folder / "run")
    return (folder / "run" / "level_0001.vtkhdf").read_bytes()


def test_a_shape_of_a_script_is_kept_as_a_table(whole, tmp_path, monkeypatch):
    """Its groups keep their tags, so that a new mesh has the names."""
    monkeypatch.chdir(tmp_path)
    level = unpack_level(whole)
    geometry = level.about["geometry"]
    assert geometry["suffix"] == ".json"
    assert "Point(" not in geometry["text"]
    (tmp_path / "level_0001.vtkhdf").write_bytes(whole)
    domain = ec.read_history(tmp_path).best.domain
    finer = domain.remeshed(0.2)
    assert finer.cells > domain.cells
    assert finer.names == domain.names == {"foot": 7, "roof": 3}


def about(**changed):
    return lambda level: level.about.update(changed)


def of_shape(**changed):
    return lambda level: level.about["geometry"].update(changed)


def table(name, change):
    def change_table(level):
        level.tables[name] = change(level.tables[name])

    return change_table


def without(name):
    return lambda level: level.about.pop(name)


ENTITIES = '{"entities": [%s], "inside": [], "groups": []}'
CHANGES = {
    "a script": of_shape(suffix=".geo", text=ACTS),
    "a script as a table": of_shape(text=ACTS),
    "a script as BREP": of_shape(suffix=".xao", text=ACTS),
    "a path as form": of_shape(suffix="/../../x.geo"),
    "a call as an entity": of_shape(text=ENTITIES % '["SystemCall", 1, [1]]'),
    "no number of a point": of_shape(text=ENTITIES % '["Point", 1, [NaN, 0, 0]]'),
    "an unknown kind of shape": of_shape(kind="Scripted"),
    "names that are no text": about(names=[1, 2]),
    "tags that are no numbers": about(names={"foot": "1"}),
    "a dimension of 7": about(dim=7),
    "no rows": about(rows=[]),
    "a row of words": about(rows=[{"cells": "many"}]),
    "an error of words": about(error={}),
    "an accuracy of words": about(accuracy="fine"),
    "a million multipliers": about(multipliers=10**6),
    "pairs of nothing": about(interfaces=[{"names": ["a"], "tags": [1], "regions": [1, 2], "on": None}]),
    "no names": without("names"),
    "no method": without("method"),
    "a node that is not there": table("cells", lambda cells: cells + 10**6),
    "a node below 0": table("cells", lambda cells: cells - 1),
    "a cell of one node": table("cells", np.zeros_like),
    "nodes as floats": table("cells", lambda cells: cells.astype(float)),
    "a point at infinity": table("VTKHDF/Points", lambda x: x / 0.0),
    "all points in one place": table("VTKHDF/Points", np.zeros_like),
    "points in the plane": table("VTKHDF/Points", lambda x: x[:, :2]),
    "fields of other shapes": table("u", lambda u: u[:-1]),
    "tags of other shapes": table("facets", lambda tags: tags[:, :1]),
    "no share of the error": table("VTKHDF/CellData/eps_E", lambda eps: eps * np.nan),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", CHANGES)
def test_what_makes_no_sense_is_left_out(name, whole, tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    level = unpack_level(whole)
    CHANGES[name](level)
    head, content = pack(level)
    (tmp_path / "level_0001.vtkhdf").write_bytes(head + bytes(content))
    with caplog.at_level(logging.WARNING), pytest.raises(ec.InputError, match="holds no mesh"):
        ec.read_history(tmp_path)
    assert "level_0001.vtkhdf is left out: it is no level of a run" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["level_0001.vtkhdf"]
