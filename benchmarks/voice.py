"""Measure how densely a package is written: `python benchmarks/voice.py [folder ...]`.

One row a package (a folder with modules) and one of all: characters a code line with
its indentation, comprehensions in 100 code lines, comment lines in 1000 code lines, the
longest line, and the longest module. Docstrings, comments and blank lines are not code.
For comparison, DOLFINx has 39 characters, 1.8 comprehensions, 86 comment lines.

The last column counts "that of" and "those of" in 1000 words of docstrings, of strings
below constants, and of comments: there a pronoun stands for a noun that the reader has
to find. scikit-fem, DOLFINx, Irksome and Dedalus have 0.00, FElupe 0.03.
"""

import ast
import io
import re
import sys
import tokenize
from dataclasses import dataclass
from pathlib import Path

COMPREHENSIONS = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp
PRONOUN = re.compile(r"\b(that|those)\s+of\b", re.IGNORECASE)
"""A pronoun in the place of a noun."""


@dataclass(frozen=True)
class Figures:
    """Hold the counts of one or several modules."""

    code_lines: int = 0
    characters: int = 0
    comprehensions: int = 0
    comment_lines: int = 0
    longest_line: int = 0
    longest_module: int = 0
    words: int = 0
    pronouns: int = 0

    def __add__(self, other: "Figures") -> "Figures":
        """Return the counts of both."""
        return Figures(
            self.code_lines + other.code_lines,
            self.characters + other.characters,
            self.comprehensions + other.comprehensions,
            self.comment_lines + other.comment_lines,
            max(self.longest_line, other.longest_line),
            max(self.longest_module, other.longest_module),
            self.words + other.words,
            self.pronouns + other.pronouns,
        )

    @property
    def pronoun_rate(self) -> float:
        """Return the number of pronouns in the place of a noun in 1000 words."""
        return 1000 * self.pronouns / max(self.words, 1)

    def row(self, name: str) -> str:
        """Return the figures as one line of a table."""
        code = max(self.code_lines, 1)
        return (
            f"{name:40s} {self.code_lines:6d} {self.characters / code:6.1f}"
            f" {100 * self.comprehensions / code:6.2f} {1000 * self.comment_lines / code:6.1f}"
            f" {self.longest_line:5d} {self.longest_module:5d} {self.pronoun_rate:7.2f}"
        )


def prose_of(text: str) -> str:
    """Return docstrings, strings below constants, and comments of a module."""
    prose = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            prose.append(str(node.value.value))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            prose.append(token.string.lstrip("#: "))
    return "\n".join(prose)


def figures_of(path: Path) -> Figures:
    """Count lines, characters, comprehensions and comments of a module."""
    text = path.read_text()
    lines = text.splitlines()
    tree = ast.parse(text)
    docstrings: set[int] = set()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            continue
        if ast.get_docstring(node) is not None:
            words = node.body[0]
            docstrings.update(range(words.lineno, (words.end_lineno or words.lineno) + 1))
    comments: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        alone = token.line.strip().startswith("#")
        if token.type == tokenize.COMMENT and alone:
            comments.add(token.start[0])
    code = []
    for number, line in enumerate(lines, start=1):
        if line.strip() and number not in docstrings and number not in comments:
            code.append(line.rstrip())
    prose = prose_of(text)
    return Figures(
        code_lines=len(code),
        characters=sum(map(len, code)),
        comprehensions=sum(isinstance(node, COMPREHENSIONS) for node in ast.walk(tree)),
        comment_lines=len(comments),
        longest_line=max(map(len, lines), default=0),
        longest_module=len(lines),
        words=len(prose.split()),
        pronouns=len(PRONOUN.findall(prose)),
    )


def main(folders: list[str]) -> None:
    """Print the table of the packages in `folders`."""
    print(
        f"{'package':40s} {'code':>6s} {'chars':>6s} {'compr':>6s} {'comm':>6s}"
        f" {'line':>5s} {'module':>5s} {'that of':>7s}"
    )
    total = Figures()
    for folder in folders:
        root = Path(folder)
        modules = sorted(root.rglob("*.py"))
        packages = sorted({module.parent for module in modules})
        for package in packages:
            inside = Figures()
            for module in modules:
                if module.parent == package:
                    inside += figures_of(module)
            print(inside.row(str(package)))
            total += inside
    print(total.row("all"))


if __name__ == "__main__":
    main(sys.argv[1:] or ["erc_contact"])
