"""The countable part of how this project writes: openings of docstrings, constants, and words that are replaced."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
CLAUSE = re.compile(r"(What|Whether|How|Where|Which|Who|Whoever|Whatever)\b")
REPLACED_WORDS = re.compile(r"\b(amiss|anew|whoever|nobody|anybody)\b", re.IGNORECASE)


def documented(tree: ast.Module) -> list[tuple[ast.AST, str]]:
    """Return the nodes of a module that have a docstring, and the docstrings."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    nodes = [node for node in ast.walk(tree) if isinstance(node, kinds)]
    return [(node, text) for node in nodes if (text := ast.get_docstring(node))]


def test_no_docstring_opens_with_a_clause() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for path in SOURCES
        for _, text in documented(ast.parse(path.read_text(encoding="utf-8")))
        if CLAUSE.match(text)
    ]
    assert found == []


def test_each_constant_has_its_own_line() -> None:
    found = []
    for path in SOURCES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            if isinstance(target, ast.Tuple) and all(isinstance(e, ast.Name) and e.id.isupper() for e in target.elts):
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []


def test_docstrings_do_without_the_replaced_words() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in SOURCES
        for _, text in documented(ast.parse(path.read_text(encoding="utf-8")))
        for match in REPLACED_WORDS.finditer(text)
    ]
    assert found == []
