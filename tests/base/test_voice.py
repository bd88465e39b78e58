"""The voice of the package: names and first sentences say the noun."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import ROOT

MODULES = sorted(
    path for package in ("namedmesh", "erc_contact") for path in (ROOT / package).rglob("*.py")
)
BARE = {"one", "other", "rest", "both", "own"}
"""Words that stand before a noun and are no name."""
IDIOMS = ("at", "each", "of its", "of their")
"""What makes an idiom of such a word: at rest, each other, of its own."""
AFTER = (
    "above|alone|are|at|below|beyond|by|can|does|do|for|from|had|has|have|in|is|lies|lie|may|must"
    "|of|on|than|that|to|was|were|which|whose|will|with|without"
)
"""Words after which no noun of the word before comes."""
STANDS_ALONE = re.compile(
    "".join(rf"(?<!\b{idiom} )" for idiom in IDIOMS)
    + rf"\b(?:ones|(?:{'|'.join(sorted(BARE))})(?=[.,;:]|$| (?:{AFTER})\b))",
    re.IGNORECASE,
)


def names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every name that a module gives to a value, a parameter, an attribute, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.lineno, node.name
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            # __eq__(self, other) is the convention of Python.
            if not getattr(node, "name", "").startswith("__"):
                for argument in ast.walk(node.args):
                    if isinstance(argument, ast.arg):
                        yield argument.lineno, argument.arg
        elif isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr


def first_sentences(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """The first sentence of every docstring, up to its first semicolon, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            text = " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
            yield getattr(node, "lineno", 1), re.split(r"(?<=[.;:])(?: |$)", text)[0]


def in_modules(found: dict[Path, list[tuple[int, str]]]) -> list[str]:
    return [
        f"{module.relative_to(ROOT)}:{line}: {text}"
        for module, lines in found.items()
        for line, text in lines
    ]


@pytest.mark.broad
@pytest.mark.serial
def test_names_are_nouns():
    """A reader cannot guess what `other` is; `other_side` is read."""
    found = {}
    for module in MODULES:
        tree = ast.parse(module.read_text())
        found[module] = [(line, name) for line, name in names(tree) if name in BARE]
    assert in_modules(found) == []


@pytest.mark.broad
@pytest.mark.serial
def test_first_sentences_say_the_noun():
    """Not "the stress less the linear one", but "the stress less the linear stress"."""
    found = {}
    for module in MODULES:
        sentences = first_sentences(ast.parse(module.read_text()))
        found[module] = [(line, text) for line, text in sentences if STANDS_ALONE.search(text)]
    assert in_modules(found) == []


@pytest.mark.parametrize(
    ("sentence", "stands_alone"),
    [
        ("Return the stress less the linear one.", True),
        ("Carry a mesh over to one whose nodes are split.", True),
        ("Mesh one of the bodies anew.", True),
        ("Limit sizes to the largest ones that grow.", True),
        ("Hold the forces of one side, and the rest.", True),
        ("Return the displacement of a body at rest.", False),
        ("Find parts that face each other and touch.", False),
        ("Read a file in a process of its own.", False),
        ("Return one row of both sides in one order.", False),
    ],
)
@pytest.mark.serial
def test_rule_of_bare_words(sentence, stands_alone):
    assert bool(STANDS_ALONE.search(sentence)) == stands_alone
