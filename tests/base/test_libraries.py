"""What the package does to the libraries that it stands on, and what of theirs it uses beside their public names.

- Import and runs leave DOLFINx, UFL and the numbers of the user's Constants as they
  are.
- One switch refuses all changes; results are then the same.
- Each private name of another library is in a table here, with the module that uses it:
  a new release without one of them says at once where to look.
"""

import ast
import importlib
import re
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import jit as dolfinx_jit
from processes import output, started
from scenes import block, prototype_block

import erc_contact as ec
from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.patches import SWITCH
from erc_contact.newton.linear import mumps

ROOT = Path(ec.__file__).parents[1]
PATHS = [*(ROOT / "namedmesh").rglob("*.py"), *(ROOT / "erc_contact").rglob("*.py")]

PRIVATE = {
    "erc_contact/base/runtime/compiled.py": {
        "_counter",
        "_cache",
        "_ufl_typecode_",
        "_ufl_is_terminal_",
    },
    "erc_contact/base/runtime/form_library.py": {
        "_compilation_signature",
        "_compute_option_signature",
    },
    "erc_contact/base/runtime/parts.py": {"_cache"},
    "erc_contact/base/runtime/patches.py": {"_method_cache"},
    "erc_contact/base/ufl_tables.py": {"_handlers_cache"},
    "namedmesh/graphs.py": {"_cpp_object"},
    "namedmesh/partition.py": {"_cpp_object"},
}
"""Private attributes of objects of other libraries, by the module that uses them."""
UNPROMISED = {
    "dolfinx.jit.ffcx_jit": "erc_contact/base/runtime/compiled.py",
    "dolfinx.jit.mpi_jit_decorator": "erc_contact/base/runtime/form_library.py",
    "dolfinx.jit.get_options": "erc_contact/base/runtime/form_library.py",
    "ffcx.compiler.compile_ufl_objects": "namedmesh/base/releases.py",
    "ffcx.codegeneration.jit.UFC_FORM_DECL": "erc_contact/base/runtime/form_library.py",
    "ffcx.ir.analysis.valuenumbering.ValueNumberer.get_node_symbols": (
        "erc_contact/base/runtime/compiled.py"
    ),
    "ffcx.naming.compute_signature": "erc_contact/base/runtime/form_library.py",
    "ufl.algorithms.apply_derivatives.GenericDerivativeRuleset": "erc_contact/base/ufl_tables.py",
    "ufl.corealg.dag_traverser.DAGTraverser": "erc_contact/base/runtime/patches.py",
    "dolfinx.cpp.la.petsc.create_matrix": "erc_contact/base/sparse.py",
    "dolfinx.cpp.mesh.entities_to_geometry": "namedmesh/partition.py",
}
"""Names of other libraries that no page of theirs promises to users -> module that uses them."""
CHANGED = "print('same', dolfinx.jit.ffcx_jit is before, Constant(mesh, 1.0).count() < 100)\n"
SCRIPT = f"""
from mpi4py import MPI
import dolfinx.jit
from dolfinx.fem import Constant
from dolfinx.mesh import create_unit_square

before = dolfinx.jit.ffcx_jit
mesh = create_unit_square(MPI.COMM_SELF, 1, 1)
import erc_contact as ec
{CHANGED}
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7))
scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.1, -0.05)), contacts=ec.Contact("bottom", friction=0.3))
ec.adapt(scene, block, accuracy=0.5)
{CHANGED}
"""


def private_names():
    """The private names that a module reads or sets on objects, or gives as words, and that no module defines."""
    used, own = {}, set()
    for path in PATHS:
        for node in ast.walk(ast.parse(path.read_text())):
            name = getattr(node, "attr", None) or getattr(node, "value", None)
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                own.add(node.name)
            elif isinstance(node, ast.Name | ast.arg):
                own.add(getattr(node, "id", None) or getattr(node, "arg", None))
            elif isinstance(node, ast.JoinedStr):
                own.update(
                    getattr(part, "value", None)
                    for part in node.values
                    if isinstance(part, ast.Constant)
                )
            elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") in (
                "self",
                "cls",
            ):
                own.add(node.attr)
            elif isinstance(node, ast.Attribute | ast.Constant) and re.fullmatch(
                r"_[a-z]\w*", str(name)
            ):
                used.setdefault(str(path.relative_to(ROOT)), set()).add(name)
    left = {module: names - own for module, names in used.items()}
    return {module: names for module, names in left.items() if names}


def named(path):
    """The object of a dotted name, whose first words name a module."""
    words = path.split(".")
    for last in range(len(words), 0, -1):
        try:
            thing = importlib.import_module(".".join(words[:last]))
        except ImportError:
            continue
        for word in words[last:]:
            thing = getattr(thing, word)
        return thing
    raise ImportError(path)


@pytest.mark.broad
@pytest.mark.serial
def test_private_names_are_in_the_table():
    assert private_names() == PRIVATE


def test_private_names_exist(block):
    mesh = block.mesh
    number = fem.Constant(mesh, 1.0)
    form = number * ufl.dx(mesh)
    owners = {
        "_counter": ufl.Constant,
        "_cache": form,
        "_ufl_typecode_": number,
        "_ufl_is_terminal_": number,
        "_ufl_signature_data_": mesh.ufl_domain(),
        "_cpp_object": mesh,
        "_handlers_cache": ufl.corealg.multifunction.MultiFunction,
    }
    for module, names in PRIVATE.items():
        for name in names & owners.keys():  # of the rest some interpreters have none
            assert hasattr(owners[name], name), (
                f"{type(owners[name])} has no {name}: look at {module}"
            )


@pytest.mark.serial
@pytest.mark.parametrize(("name", "module"), list(UNPROMISED.items()))
def test_names_exist_that_nobody_promises(name, module):
    try:
        named(name)
    except (ImportError, AttributeError) as failure:
        raise AssertionError(f"{name} is gone: look at {module}") from failure


@pytest.mark.serial
@pytest.mark.parametrize("name", mumps._ARGUMENTS)
def test_functions_of_petsc_exist(name):
    assert hasattr(mumps._LIBRARY, name), (
        f"PETSc has no {name}: look at erc_contact/newton/linear/mumps.py"
    )


@pytest.mark.broad
@pytest.mark.serial
def test_import_and_runs_change_nothing_for_others(tmp_path):
    with started(SCRIPT, 1, tmp_path) as process:
        lines = [line for line in output(process, 300).splitlines() if line.startswith("same")]
    assert lines == ["same True True"] * 2


def test_changes_are_refused_by_one_switch(monkeypatch):
    domain = block(2)
    usual = ec.solve(prototype_block(), domain, ec.Nitsche())
    known = len(compiled._known)
    monkeypatch.setenv(SWITCH, "0")
    monkeypatch.setattr(dolfinx_jit, "ffcx_jit", seen := Seen(dolfinx_jit.ffcx_jit))
    plain = ec.solve(prototype_block(), block(2), ec.Nitsche())
    assert seen.calls > 0
    assert len(compiled._known) == known
    assert compiled.constant(domain.mesh, 1.0).count() < compiled.FIRST_NUMBER
    assert np.allclose(plain.u.x.array, usual.u.x.array, rtol=0.0, atol=1e-12)


class Seen:
    """DOLFINx's compiler of forms, counting calls."""

    def __init__(self, usual):
        self.usual, self.calls = usual, 0

    def __call__(self, *arguments, **named):
        self.calls += 1
        return self.usual(*arguments, **named)


def test_changes_end_where_a_call_fails(block):
    before, counter = dolfinx_jit.ffcx_jit, fem.Constant(block.mesh, 1.0).count()
    with pytest.raises(AttributeError, match="ufl_operands"):
        compiled.expression("no UFL", np.zeros((1, 2)), block.mesh.comm)
    with pytest.raises(RuntimeError, match="dtype"):
        compiled.constant(block.mesh, "no number")
    assert dolfinx_jit.ffcx_jit is before
    assert counter < fem.Constant(block.mesh, 1.0).count() < counter + 3


def test_names_of_the_package_are_public_ones():
    assert set(dir(ec)) == {*ec.__all__, "goals", "output", "results"}
    assert all(getattr(ec, name) is getattr(ec.goals, name) for name in ec.goals.__all__)
