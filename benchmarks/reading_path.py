"""Write the page `docs/inside/path.md`, the modules that a small scene runs.

    python benchmarks/reading_path.py > docs/inside/path.md

Small scenes run while the interpreter notes which functions of the packages start, and
which of their lines run. A module is on the way of the block if a third of the lines of
its functions run. A feature adds the modules of which a fifth runs that does not run
without it. Left out is what depends on the clock or on what was compiled before.
"""

import ast
import importlib
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from textwrap import fill
from types import CodeType

from import_graph import MODULES, ORDER, imports, stage

import erc_contact as ec

SHARE = 1 / 3
"""Part of a module's lines that run where the module is on the way of the block."""
ADDED = 1 / 5
"""Part of a module's lines that run for a feature alone where the feature adds it."""
SOME = 1 / 20
"""Part of a module's lines from which on a feature has some lines in it."""
BLOCK = "The block of the README"
HEAD = """# The reading path

What to read first, if you want to change the package. The block of the README goes from
its rectangle through `Scene`, `solve`, `equilibrate` and `constitutive_error` to its
refined mesh. This is the code that it runs: {modules} modules with {lines} lines, of
{all_modules} with {all_lines} in both packages. They stand in the order of imports: a
module uses modules above it, in the stages of [Where things
are](../contributing.md#where-things-are).

The column "run" has the part of the lines of a module's functions that run; from
{least}% on a module is in the table. Its other lines run for features, or refuse bad
input.

Below it each feature has the modules that it adds: {added}% of their lines run that a
block without the feature does not run, whether its values are numbers or functions, in an
adaptive run or by hand. The column "asked for in" has the modules of the block's way that
import such a module; "more of it" means that the block needs it, too. Meshes of features
are made beforehand. Left out is what depends on the clock or on what was compiled before:
progress, and [repairs of other libraries](../import.md#why-and-until-when).

```console
python benchmarks/reading_path.py > docs/inside/path.md
```
"""
PASSED = (
    "{count} modules more are entered for a few lines, most to say that the scene has not what"
    " they are about: {names}."
)
PLAIN = "A block on the mesh of the features"
VARYING = "Values that vary in space"
ADAPTIVE = "Adaptive runs"
"""Scenes whose lines count as known for the features that come after them."""
WIDTH = 120
"""Characters of a line of the page."""
LEFT_OUT = ("erc_contact.base.runtime.", "erc_contact.base.progress", "namedmesh.base.releases")
TOOL = 4
"""A number of `sys.monitoring` that no other tool has taken."""
MATERIAL = ec.Elastic(E=1.0, nu=0.3)
PRESSED = ec.Displacement("top", (0.02, -0.01))
FRICTION = ec.Contact("bottom", friction=0.3)


@dataclass
class Trace:
    """Hold what ran: modules that were entered, and the lines that ran in each file."""

    entered: set[str] = field(default_factory=set)
    lines: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))

    def note_start(self, code: CodeType, offset: int) -> object:
        """Note that a function starts.

        What dataclasses generate has the globals of their module, but not its file.
        """
        module = sys._getframe(1).f_globals.get("__name__", "")
        if module in MODULES and not module.startswith(LEFT_OUT):
            self.entered.add(module)
        return sys.monitoring.DISABLE

    def note_line(self, code: CodeType, line: int) -> object:
        """Note that a line runs."""
        self.lines[code.co_filename].add(line)
        return sys.monitoring.DISABLE

    def ran(self, module: str) -> set[int]:
        """Return the lines of a module's functions that ran."""
        return self.lines[str(MODULES[module])] & lines_of_functions(module)


def traced(run: Callable[[], object]) -> Trace:
    """Return what runs in a call."""
    trace = Trace()
    monitoring = sys.monitoring
    events = monitoring.events
    monitoring.use_tool_id(TOOL, "reading path")
    monitoring.register_callback(TOOL, events.PY_START, trace.note_start)
    monitoring.register_callback(TOOL, events.LINE, trace.note_line)
    monitoring.restart_events()
    monitoring.set_events(TOOL, events.PY_START | events.LINE)
    run()
    monitoring.set_events(TOOL, events.NO_EVENTS)
    monitoring.free_tool_id(TOOL)
    return trace


@cache
def lines_of_functions(module: str) -> set[int]:
    """Return the lines of a module that run only when a function is called."""
    path = MODULES[module]
    lines: set[int] = set()
    codes = [compile(path.read_text(), str(path), "exec")]
    while codes:
        code = codes.pop()
        codes += [inner for inner in code.co_consts if isinstance(inner, CodeType)]
        is_function = code.co_flags & 1  # CO_OPTIMIZED: neither a module nor a class
        if is_function:
            lines.update(line for *_, line in code.co_lines() if line)
            lines.discard(code.co_firstlineno)
    return lines


def share(module: str, ran: set[int]) -> float:
    """Return the part of the lines of a module's functions that ran."""
    return len(ran) / max(len(lines_of_functions(module)), 1)


def certified(scene: ec.Scene, domain: ec.Domain, solver: str = "auto") -> ec.ConstitutiveError:
    """Go round the loop of the README once."""
    solution = ec.solve(scene, domain, solver=solver)
    admissible = ec.equilibrate(solution)
    error = ec.constitutive_error(admissible)
    domain.refined(ec.mark(error))
    return error


def block() -> None:
    """Solve the block of the README."""
    domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5)
    pushed = ec.Displacement("top", (0.1, -0.05))
    load = ec.Traction("right", (-0.0002, 0.0))
    certified(ec.Scene(MATERIAL, [pushed], [load], contacts=[FRICTION]), domain)


def features() -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield features with small scenes that have them, on meshes that are made here."""
    square = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    ring = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")
    lowered = ec.Displacement("top", (0.0, -0.01))
    plain = ec.Scene(MATERIAL, [PRESSED], contacts=[FRICTION])
    yield PLAIN, lambda: certified(plain, square)

    hill = ec.Contact("bottom", friction=lambda x: 0.3 + 0.1 * x[0], gap=lambda x: 0.01 * x[0] ** 2)
    stiffer = ec.Elastic(lambda x: 1.0 + x[1] ** 2, 0.3)
    varying = ec.Scene(stiffer, [PRESSED], contacts=[hill])
    yield VARYING, lambda: certified(varying, square)
    yield ADAPTIVE, lambda: ec.adapt(plain, square, accuracy=0.4)

    of_revolution = ec.Scene(ring, [lowered], contacts=[FRICTION])
    yield "A body of revolution", lambda: certified(of_revolution, square)

    cube = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(3, 3, 3))
    pressed = ec.Displacement("top", (0.02, 0.0, -0.01))
    in_space = ec.Scene(MATERIAL, [pressed], contacts=[FRICTION])
    yield "Three dimensions", lambda: certified(in_space, cube)
    yield "Multigrid", lambda: certified(plain, square, solver="iterative")

    lower = ec.rectangle((0.0, -1.0), (1.0, 0.0), cells=(3, 3))
    pair = ec.assembly({"upper": square, "lower": lower}).joined("upper bottom", "lower top")
    sides = ("upper bottom", "lower top")
    held = ec.Displacement("lower bottom", (0.0, 0.0))
    ends = [ec.Displacement("upper top", (0.02, -0.01)), held]
    touching = ec.Contact(sides[0], against=sides[1], friction=0.3)
    yield "Two bodies", lambda: certified(ec.Scene(MATERIAL, ends, contacts=[touching]), pair)

    bolt = ec.Preload(sides[0], against=sides[1], force=0.01)
    ends_of_bolt = [ec.Displacement("upper top", (None, 0.0)), held]
    yield "Preloads", lambda: certified(ec.Scene(MATERIAL, ends_of_bolt, ties=[bolt]), pair)

    copies = [ec.Periodic("left", "right")]
    yield (
        "Periodic bodies",
        lambda: certified(ec.Scene(MATERIAL, [PRESSED], contacts=[FRICTION, *copies]), square),
    )

    def at(time: float) -> ec.Scene:
        """Return the block that is pressed, and then pushed to the side."""
        push = ec.Displacement("top", (0.02 * time, -0.01))
        return ec.Scene(MATERIAL, [push], contacts=[FRICTION])

    yield "Loading histories", lambda: ec.evolve(at, square, [0.0, 1.0], accuracy=0.5)

    plastic = ec.Plastic(1.0, 0.3, yield_stress=0.005, hardening=0.1)
    yield "Plasticity", lambda: certified(ec.Scene(plastic, [lowered], contacts=[FRICTION]), square)

    bed = ec.Foundation(2.0, tangential=1.0)
    driven = (lambda x: 0.01 * x[0], 0.0)
    soft = ec.Contact("bottom", friction=0.3, foundation=bed, motion=driven)
    on_bed = ec.Scene(MATERIAL, [PRESSED], contacts=[soft])
    yield "Compliant foundations that move", lambda: certified(on_bed, square)

    stamp = ec.Rigid("top", (0.0, None), force=(None, -0.01), moment=0.0)
    yield "Rigid faces", lambda: certified(ec.Scene(MATERIAL, [stamp], contacts=[FRICTION]), square)

    def aimed() -> None:
        """Bound the force on a contact."""
        error = certified(ec.Scene(MATERIAL, [PRESSED], contacts=[FRICTION]), square)
        ec.interval(error, ec.Resultant("bottom", (0.0, 1.0)))

    yield "Goals", aimed


def first_sentence(module: str) -> str:
    """Return the first sentence about a module, without roles of Sphinx."""
    text = ast.get_docstring(ast.parse(MODULES[module].read_text())) or ""
    sentence = re.split(r"(?<=\.)\s", " ".join(text.split("\n\n")[0].split()))[0]
    plain = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", sentence).replace("``", "`")
    return plain.replace("|", "\\|")


def place(module: str) -> tuple[int, str]:
    """Return what modules are sorted by where imports leave a choice."""
    return ORDER.index(stage(module)), module


def in_reading_order(modules: Iterable[str]) -> list[str]:
    """Sort modules by stage, in a stage each after all that it imports."""
    order: dict[str, int] = {}

    def visit(module: str) -> None:
        """Put a module after what it imports."""
        if module not in order:
            for below in sorted(imports()[module], key=place):
                visit(below)
            order[module] = len(order)

    for module in sorted(MODULES, key=place):
        visit(module)
    return sorted(modules, key=lambda module: (ORDER.index(stage(module)), order[module]))


def shares() -> dict[str, dict[str, float]]:
    """Return the parts of modules that run: for the block, for each feature alone."""
    for module in MODULES:  # what runs when a module is imported is no call
        importlib.import_module(module)
    known = traced(block)
    result = {BLOCK: {module: share(module, known.ran(module)) for module in known.entered}}
    for name, run in features():
        trace = traced(run)
        result[name] = {}
        for module in trace.entered:
            result[name][module] = share(module, trace.ran(module) - known.ran(module))
        if name in (PLAIN, VARYING, ADAPTIVE):
            for file, ran in trace.lines.items():
                known.lines[file] |= ran
    del result[PLAIN]
    return result


def chosen(parts: dict[str, float], least: float) -> list[str]:
    """Return the modules of which so much runs, in reading order."""
    return in_reading_order(module for module, part in parts.items() if part >= least)


def short(module: str) -> str:
    """Return the path of a module, in erc_contact without the name of the package."""
    path = MODULES[module].relative_to(MODULES["namedmesh"].parents[1])
    return f"`{path.as_posix().removeprefix('erc_contact/')}`"


def lines(modules: Iterable[str]) -> int:
    """Return the number of lines of modules."""
    return sum(len(MODULES[module].read_text().splitlines()) for module in modules)


def table_of_block(parts: dict[str, float]) -> Iterator[str]:
    """Yield the rows of the block."""
    yield "| module | lines | run | subject |"
    yield "|---|---|---|---|"
    for module in chosen(parts, SHARE):
        run = f"{100 * parts[module]:.0f}%"
        yield f"| {short(module)} | {lines([module])} | {run} | {first_sentence(module)} |"


def table_of_feature(parts: dict[str, float], way: list[str]) -> Iterator[str]:
    """Yield the rows of a feature."""
    yield "| + module | lines | asked for in | subject |"
    yield "|---|---|---|---|"
    for module in chosen(parts, ADDED):
        importers = [other for other in way if module in imports()[other]]
        asked = "more of it" if module in way else ", ".join(map(short, importers))
        yield f"| {short(module)} | {lines([module])} | {asked} | {first_sentence(module)} |"
    some = [module for module in chosen(parts, SOME) if parts[module] < ADDED]
    if some:
        yield "\n" + filled(f"Some lines more: {', '.join(map(short, some))}.")


def filled(text: str) -> str:
    """Return text in lines as wide as a page, but code as it is."""
    paragraphs = text.split("\n\n")
    for number, paragraph in enumerate(paragraphs):
        if not paragraph.startswith("```"):
            paragraphs[number] = fill(
                paragraph, WIDTH, break_long_words=False, break_on_hyphens=False
            )
    return "\n\n".join(paragraphs)


def page() -> Iterator[str]:
    """Yield the pieces of the page."""
    measured = shares()
    of_block = measured.pop(BLOCK)
    way = chosen(of_block, SHARE)
    yield filled(
        HEAD.format(
            modules=len(way),
            lines=lines(way),
            all_modules=len(MODULES),
            all_lines=lines(MODULES),
            least=round(100 * SHARE),
            added=round(100 * ADDED),
        )
    )
    yield f"## {BLOCK}\n"
    yield from table_of_block(of_block)
    passed = in_reading_order(set(of_block) - set(way))
    names = ", ".join(map(short, passed))
    yield "\n" + filled(PASSED.format(count=len(passed), names=names))
    for feature, parts in measured.items():
        yield f"\n## + {feature}\n"
        yield from table_of_feature(parts, way)


if __name__ == "__main__":
    print("\n".join(page()))
