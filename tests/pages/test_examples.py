"""The examples in the docstrings run, and show what they say.

All public names have an example, and so have the tables and protocols that a contributor
meets first. The page of the API has the code that the examples share.
"""

import doctest
import inspect
import logging
import re
import shutil

import pytest
from processes import ROOT

import erc_contact as ec
import namedmesh
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.tighten.tables import MacroTable
from erc_contact.error.laws import LawError
from erc_contact.model.contact.side import Side
from erc_contact.model.contact.trace import Trace
from erc_contact.model.data.quadrature import Cuts, integrate
from erc_contact.model.law.constitution import Constitution
from namedmesh.joining.curve import Curve
from namedmesh.simplex import bernstein

import gmsh  # isort: skip - after erc_contact, as in all tests

PAGE = ROOT / "docs" / "api" / "index.md"
CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
PUBLIC = [getattr(ec, name) for name in ec.__all__]
INNER = [
    bernstein,
    CellGeometry,
    Cones,
    Constitution,
    Curve,
    Cuts,
    integrate,
    LawError,
    MacroTable,
    Side,
    Trace,
]
"""What a contributor meets first; their examples know the names of their module, too."""
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
pytestmark = pytest.mark.serial


def examples(value):
    """Collect the examples of a function, or of a class and its members."""
    name = value.__name__
    module = inspect.getmodule(value)
    found = doctest.DocTestFinder().find(value, name, module=module, globs={})
    return [test for test in found if test.examples]


@pytest.fixture(scope="module")
def square(tmp_path_factory):
    """A folder with ``square.msh``, which gmsh has in memory, too."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    square = gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 1.0, 1.0)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [square], name="body")
    gmsh.model.addPhysicalGroup(1, [1], name="bottom")
    gmsh.model.addPhysicalGroup(1, [3], name="top")
    gmsh.model.mesh.generate(2)
    folder = tmp_path_factory.mktemp("examples")
    gmsh.write(str(folder / "square.msh"))
    shutil.copy(ROOT / "tests" / "decks" / "abaqus_press.inp", folder / "press.inp")
    yield folder
    gmsh.finalize()


@pytest.fixture(scope="module")
def shared(square):
    """Names that all examples know; they write to a folder of their own."""
    names = {"gmsh": gmsh, "nm": namedmesh}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(square)
        for block in CODE.findall(PAGE.read_text()):
            exec(compile(block, str(PAGE), "exec"), names)
        yield names


@pytest.fixture
def silent():
    """The log as it was, whatever an example does to it."""
    log = logging.getLogger("erc_contact")
    handlers, level = list(log.handlers), log.level
    yield
    log.handlers[:] = handlers
    log.setLevel(level)


def run_examples(value, names):
    """Run the examples of a value, which has one of its own, with these names."""
    tests = examples(value)
    assert any(test.name == value.__name__ for test in tests), "give its docstring an Example"
    for test in tests:
        test.globs = dict(names)
        said = []
        runner = doctest.DocTestRunner(optionflags=OPTIONS)
        runner.run(test, out=said.append)
        assert runner.failures == 0, "".join(said)


@pytest.mark.broad
@pytest.mark.parametrize("value", PUBLIC, ids=lambda value: value.__name__)
def test_public_name_has_an_example_that_runs(value, shared, silent):
    run_examples(value, shared)


@pytest.mark.parametrize("value", INNER, ids=lambda value: value.__name__)
def test_inner_name_has_an_example_that_runs(value, shared, silent):
    run_examples(value, vars(inspect.getmodule(value)) | shared)


@pytest.mark.parametrize("value", PUBLIC + INNER, ids=lambda value: value.__name__)
def test_examples_are_short(value):
    """Four statements at most: what needs more belongs to a page or a demo."""
    assert all(len(test.examples) <= 4 for test in examples(value))
