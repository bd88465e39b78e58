"""Count the decisions that ask for a feature, in each package: `python tests/base/branches.py`.

A decision is an `if`, a conditional expression, a `while`, a `case` or the `if` of a
comprehension. An axis is a feature that a scene has or has not, as two bodies or a
body of revolution; a decision is on it if its condition matches the pattern of the
axis. The table of today is the limit, and is kept beside this script:

    python tests/base/branches.py > tests/base/branches.txt
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
KEPT = Path(__file__).with_suffix(".txt")
PACKAGES = ("erc_contact", "namedmesh")
AXES = {
    "axisymmetry": r"axisymmetric|circumference|\bhoop|(?<!sp)rings|off_axis|meets_axis|on_axis|radial",
    "potential": r"linearised|has_potential|\bpotential|convexity|is_linear\b|\.(law_)?state\b",
    "two bodies": r"\bthere\b|\bagainst\b|interfaces|\bpartners\b",
    "degree": r"\bdegree (==|>|<|!=|>=)|\bk (==|>) [12]|degree\) (==|>)",
    "dimension": r"\bd (==|!=|<|>) [23]|\.dim (==|!=) [23]|dim (==|<|>) [23]",
    "ranks": r"comm\.size|\brank\b|\.rank",
    "compliance": r"is_compliant|stiffness is|tangential_stiffness|(tangential|springs) is",
    "moving foundation": r"\.motion\b|\bmotion is|\.moved\b|\bmoved is",
    "history": r"\bbefore\b|is_later_step|last is|\blast\b|after is|\bstate is",
    "curved facets": r"offset|corner_normals|turning|curved_facets|of_corners|gap_vectors|is_kinked",
    "bilateral": r"bilateral",
    "no friction": r"friction is (not )?None|\.friction\b(?! is)|depends_on_pressure|dependence",
    "periodic": r"[pP]eriodic|\bpair\.(turns|axis)|frames is|self\.rotation|_turns is|turns_there|\bturns is|\.is_symmetry|law is (not )?HELD",
    "preload": r"[pP]reload|bolts|\bshift is|shifts",
    "unheld": r"unheld|free_motions|\brelief\b|motions",
    "rigid faces": r"loose_faces|\bfaces\b|Rigid",
    "springs": r"\.springs\b",
    "bodies apart": r"\bbetween\b|apart",
    "multiplier": r"multiplier",
    "given strains": r"\bstrains\b",
    "varying data": r"varies|sampled",
    "rest": r"at_rest|is_rest|is_noise",
}
"""Pattern of the conditions on each axis."""

type Table = dict[tuple[str, str], Counter[str]]
"""Package and axis -> decisions in each module that has some."""


def conditions(tree: ast.AST) -> Iterator[str]:
    """Yield the condition of every decision."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If | ast.IfExp | ast.While):
            yield ast.unparse(node.test)
        elif isinstance(node, ast.comprehension):
            yield from map(ast.unparse, node.ifs)
        elif isinstance(node, ast.match_case):
            yield ast.unparse(node.pattern)


def decisions_of(code: str) -> Counter[str]:
    """Count the decisions of a module on each axis."""
    counts: Counter[str] = Counter()
    for condition in conditions(ast.parse(code)):
        for axis, pattern in AXES.items():
            counts[axis] += bool(re.search(pattern, condition))
    return +counts


def counted() -> Table:
    """Count the decisions of the packages as they are."""
    table: Table = {}
    for package in PACKAGES:
        for axis in AXES:
            table[package, axis] = Counter()
        folder = ROOT / package
        for module in sorted(folder.rglob("*.py")):
            name = module.relative_to(folder).as_posix()
            for axis, count in decisions_of(module.read_text()).items():
                table[package, axis][name] = count
    return table


def written(table: Table) -> str:
    """Return a table as text: a line for each axis, below it a line for each module."""
    lines = []
    for (package, axis), modules in table.items():
        lines.append(f"{package}: {axis}: {modules.total()} decisions, {len(modules)} modules")
        for module, count in modules.items():
            lines.append(f"{count:4d} {module}")
    return "\n".join(lines)


def read(text: str) -> Table:
    """Return the table that `written` has written."""
    table: Table = {}
    modules: Counter[str] = Counter()
    for line in text.splitlines():
        if line.startswith(" "):
            count, module = line.split()
            modules[module] = int(count)
        else:
            package, axis, _ = line.split(": ")
            modules = table[package, axis] = Counter()
    return table


def grown(before: Counter[str], after: Counter[str]) -> Iterator[str]:
    """Yield a line for each module with more decisions than before."""
    for module, count in (after - before).items():
        if module in before:
            yield f"{module}: {before[module]} -> {before[module] + count}"
        else:
            yield f"{module}: {count}, new on this axis"


if __name__ == "__main__":
    print(written(counted()))
