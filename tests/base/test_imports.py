"""The package can be read from top to bottom, and costs nothing that is not asked for.

- Packages stand in the order of the data; a module imports only from its own package
  and from those above.
- Inside a stage, some packages know less than their place in the order allows.
- No circle between modules. Imports inside functions and those for types alone count,
  too.
- The longest chain of modules that import each other stays short.
- No name of a class stands for two of them.
- ``import erc_contact`` loads no plotting or file-format package.
- What users copy, a block of a page or a demo, loads MPI before DOLFINx and PETSc.
"""

import ast
import re
import subprocess
import sys
from collections import Counter
from graphlib import TopologicalSorter

import pytest
from import_graph import MODULES, ORDER, imports, stage
from processes import ROOT

pytestmark = pytest.mark.serial
NARROW = {
    "erc_contact.base.runtime": ("erc_contact.base.", "namedmesh.base."),
    "erc_contact.newton.linear": ("erc_contact.base.", "namedmesh.", "erc_contact.model."),
}
"""Package inside a stage -> what it may import beside itself: repairs know no mechanics, solvers no contact method."""
FLOORS = {"namedmesh": 10, "erc_contact": 19}
"""Modules in the longest chain of imports of each package.

The last two are the command and its subcommands, which call what users call.
"""
DOORS = 15
"""Modules of namedmesh that erc_contact enters: its public names, what solvers need, simplices, pictures, files of domains, the base."""


def test_modules_import_from_above_only():
    without_place = [module for module in MODULES if stage(module) not in ORDER]
    assert not without_place, "give their packages a place in ORDER"
    from_below = [
        (module, other)
        for module, others in imports().items()
        for other in others
        if ORDER.index(stage(other)) > ORDER.index(stage(module))
    ]
    assert not from_below, "these import from stages that come later"


def test_meshes_know_no_mechanics():
    """Namedmesh is a package of its own, which erc_contact enters by few doors."""
    doors = set()
    for module, others in imports().items():
        of_meshes = {other for other in others if stage(other) == "namedmesh"}
        if stage(module) == "namedmesh":
            assert others == of_meshes, module
        else:
            doors |= of_meshes
    assert len(doors) <= DOORS, sorted(doors)


@pytest.mark.parametrize("package", NARROW)
def test_inner_packages_know_little(package):
    inside = [module for module in MODULES if f"{module}.".startswith(f"{package}.")]
    allowed = (f"{package}.", *NARROW[package])
    foreign = {
        (module, other)
        for module in inside
        for other in imports()[module]
        if not f"{other}.".startswith(allowed)
    }
    assert len(inside) > 5
    assert not foreign


@pytest.mark.broad
def test_no_module_asks_which_elastic_solver_it_has():
    """What differs between them is in the interface, ``newton/linear/solver.py``."""
    asked = []
    for module, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                names = {name.id for name in ast.walk(node.args[1]) if isinstance(name, ast.Name)}
                asked += [module] * (not names.isdisjoint({"Elastic", "Multigrid", "Stiffness"}))
    assert not asked


def test_no_circles_and_no_long_chains():
    height = {}
    for module in TopologicalSorter(imports()).static_order():  # raises CycleError
        root = module.split(".")[0]
        below = (height[other] for other in imports()[module] if other.split(".")[0] == root)
        height[module] = 1 + max(below, default=0)
        assert height[module] <= FLOORS[root], module


@pytest.mark.broad
def test_each_class_name_has_one_meaning():
    names = Counter(
        node.name
        for path in MODULES.values()
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef)
    )
    assert not [name for name, count in names.items() if count > 1]


@pytest.mark.broad
def test_import_loads_no_optional_package():
    code = "import sys, erc_contact; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert "erc_contact" in run.stdout.split()
    assert not {"pyvista", "vtkmodules", "matplotlib", "meshio", "gmsh", "rich", "scipy"} & set(
        run.stdout.split()
    )


WITHOUT_PICTURES = """
import sys
sys.modules.update(dict.fromkeys(("matplotlib", "pyvista", "vtkmodules", "vtk")))
import erc_contact as ec
block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
scene = ec.Scene(
    ec.Elastic(1.0, 0.3),
    ec.Displacement("top", (0.0, -0.01)),
    contacts=[ec.Contact("bottom", friction=0.3)],
)
history = ec.adapt(scene, block, accuracy=0.3)
print(history, history.force("bottom"), ec.interval(history, ec.Energy()))
for draw in (
    lambda: ec.output.draw_deformed(history.error, "body.png"),
    lambda: ec.output.write_fields(history.error, "body.vtkhdf"),
    lambda: ec.draw_parts(block),
):
    try:
        draw()
    except ec.InputError as reason:
        print("told:", reason)
"""


@pytest.mark.broad
def test_the_core_works_without_pictures(tmp_path):
    """One sentence tells how pictures are had."""
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_PICTURES],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("told: Pictures and files for ParaView need") == 3, run.stdout
    assert run.stdout.count("pip install 'erc-contact[pictures]'") == 3


LOADS_MPI, NEEDS_MPI = {"mpi4py", "erc_contact", "dolfinx_solver"}, {"dolfinx", "petsc4py"}
"""Packages that load MPI, and those that fail in uv's environment where it is not loaded."""
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SCRIPTS = [
    path
    for folder in ("demos", "benchmarks", "docs/figures")
    for path in (ROOT / folder).rglob("*.py")
]


def packages(code):
    """Packages that code imports at its top, in its order."""
    for node in ast.parse(code).body:
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0]


def test_what_users_copy_loads_mpi_first():
    codes = {}
    for page in PAGES:
        blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
        codes |= {
            f"{page.name}, block {number}": block for number, block in enumerate(blocks, start=1)
        }
    codes |= {str(path.relative_to(ROOT)): path.read_text() for path in SCRIPTS}
    needy = 0
    for place, code in codes.items():
        ours = [name for name in packages(code) if name in LOADS_MPI | NEEDS_MPI]
        needy += not NEEDS_MPI.isdisjoint(ours)
        assert not ours or ours[0] in LOADS_MPI, f"{place} imports {ours[0]} before MPI"
    assert needy >= 5
