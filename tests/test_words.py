"""The countable part of how this project writes: openings of docstrings, constants, and words that are replaced."""

import ast
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
CLAUSE = re.compile(r"(What|Whether|How|Where|Which|Who|Whoever|Whatever)\b")
# Longest first line of a docstring, characters.
MAX_FIRST_LINE = 100
REPLACED_WORDS = re.compile(r"\b(amiss|anew|whoever|nobody|anybody)\b", re.IGNORECASE)


@cache
def module_bodies() -> dict[str, list[ast.stmt]]:
    """Parse all sources once, which is most of what these tests take."""
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")).body for path in SOURCES}


@cache
def docstrings() -> list[tuple[str, str]]:
    """Return the file and the text of each docstring."""
    return [(file, text) for file, body in module_bodies().items() for text in docstrings_in(body)]


def docstrings_in(body: list[ast.stmt]) -> Iterator[str]:
    """Yield the docstring of a module, class or function from its statements, and those of what it defines."""
    first = body[0] if body else None
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        yield inspect.cleandoc(first.value.value)
    statements: list[ast.AST] = list(body)
    for node in statements:
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield from docstrings_in(node.body)
        else:
            for block in ("body", "orelse", "handlers", "finalbody", "cases"):
                statements += getattr(node, block, ())


def test_docstrings_are_found_wherever_they_stand() -> None:
    source = """"A module."
class A:
    "A class."
    x: int = 1
    "Not a docstring."
    def f(self):
        "A method."
        if self:
            async def g(): "An inner function."
try:
    pass
except ValueError:
    def h():
        "A function."
"""
    found = ["A module.", "A class.", "A method.", "An inner function.", "A function."]
    assert list(docstrings_in(ast.parse(source).body)) == found


def test_no_docstring_opens_with_a_clause() -> None:
    found = [f"{file}: {text.splitlines()[0]}" for file, text in docstrings() if CLAUSE.match(text)]
    assert found == []


def test_the_first_line_of_a_docstring_has_at_most_100_characters() -> None:
    found = [f"{file}: {first}" for file, text in docstrings() if len(first := text.splitlines()[0]) > MAX_FIRST_LINE]
    assert found == []


def test_each_constant_has_its_own_line() -> None:
    found = []
    for file, body in module_bodies().items():
        for node in body:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            if isinstance(target, ast.Tuple) and all(isinstance(e, ast.Name) and e.id.isupper() for e in target.elts):
                found.append(f"{file}:{node.lineno}")
    assert found == []


def test_docstrings_do_without_the_replaced_words() -> None:
    found = [f"{file}: {match.group()}" for file, text in docstrings() for match in REPLACED_WORDS.finditer(text)]
    assert found == []
