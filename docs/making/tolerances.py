"""Tables of the verdict's tolerances, read from their module: value, unit, reason and source."""

import ast
import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

from logs.verdict import tolerances
from logs.verdict.rules.registry import RULES

ROOT = Path(__file__).parents[2]
VERDICT = ROOT / "logs" / "verdict"
# Characters.  A longer text before the first stop of a comment is a sentence, not a unit.
MAX_UNIT_LENGTH = 60


class Tolerance(NamedTuple):
    """A constant: its name, its formatted value and unit, its meaning, and the heading above it."""

    name: str
    value: str
    unit: str
    text: str
    heading: str


def _shown(value: object, angle: bool) -> str:
    """Return a value as text; an angle in degrees."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {_shown(one, angle)}" for key, one in value.items())
    if isinstance(value, int | float):
        return f"{math.degrees(value):.6g}°" if angle else f"{value:.10g}"
    return str(value)


@cache
def tolerance_list() -> tuple[Tolerance, ...]:
    """Return every constant of `logs.verdict.tolerances`, in the order of the file."""
    source = (VERDICT / "tolerances.py").read_text(encoding="utf-8")
    lines, out, heading = source.splitlines(), [], ""
    starts = {node.lineno - 1: node for node in ast.parse(source).body if isinstance(node, ast.Assign)}
    comment: list[str] = []
    for number, line in enumerate(lines):
        if line.startswith("#"):
            comment.append(line[1:].strip())
        elif number in starts:
            text = " ".join(comment)
            for name, expression in _assigned(starts[number]):
                angle = "radians" in expression or "math.pi" in expression
                meaning = text.removeprefix("rad.").strip() if angle else text
                unit, _, after = meaning.partition(".  ")
                has_unit = not angle and after and len(unit) <= MAX_UNIT_LENGTH
                shown = _shown(getattr(tolerances, name), angle)
                out.append(Tolerance(name, shown, unit if has_unit else "", after if has_unit else meaning, heading))
        elif not line:
            if comment:
                heading = " ".join(comment)
            comment = []
        if number in starts:
            comment = []
    return tuple(out)


def _assigned(node: ast.Assign) -> list[tuple[str, str]]:
    """Return each name of an assignment with its expression."""
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = zip(target.elts, value.elts, strict=True)
        return [(ast.unparse(name), ast.unparse(one)) for name, one in pairs]
    return [(ast.unparse(target), ast.unparse(value))]


def _table(rows: list[Tolerance]) -> str:
    body = "\n".join(
        f"| `{one.name}` | {one.value} | {one.unit} | {_rules(one.name)} | {one.text.replace('|', '/')} |"
        for one in rows
    )
    return f"| constant | value | unit | rules | meaning and source |\n|---|---|---|---|---|\n{body}"


def _rules(name: str) -> str:
    """Return the names of the rules that judge with a tolerance."""
    return ", ".join(rule.name for rule in RULES.values() if name in rule.tolerances)


def tolerance_tables() -> str:
    """Return every tolerance, one table per heading."""
    headings = dict.fromkeys(one.heading for one in tolerance_list())
    parts = [
        f"## {heading}\n\n{_table([one for one in tolerance_list() if one.heading == heading])}" for heading in headings
    ]
    return "\n\n".join(parts)
