"""Every colour stands in the theme: no file of Python, CSS, JavaScript or HTML holds one of its own."""

import ast
import re
from pathlib import Path

import pytest
from matplotlib.colors import CSS4_COLORS, TABLEAU_COLORS

from logs import theme

ROOT = Path(__file__).parents[2]
PACKAGES = ("aircraft", "flight", "logs", "planfly", "planner", "world")
# A terminal has colours of its own, which it calls by name.
OWN_COLOURS = ("logs/theme.py", "planfly/terminal/command_parser.py")
_LITERAL = re.compile(r"#[0-9a-fA-F]{3}\b|#[0-9a-fA-F]{6}(?:[0-9a-fA-F]{2})?\b|\b(?:rgba?|hsla?)\((?!\))")
# Not words that Python and the field use otherwise: a tan is no colour.
_NAMES = set(CSS4_COLORS) | {name.removeprefix("tab:") for name in TABLEAU_COLORS} - {"tan", "linen", "peru", "snow"}
_IN_STYLE = re.compile(rf"[:\s\"'](?:{'|'.join(sorted(_NAMES))})\s*[;\"'}}]")


def sources(*suffixes: str) -> list[Path]:
    found = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*")) if path.suffix in suffixes]
    return [path for path in found if path.relative_to(ROOT).as_posix() not in OWN_COLOURS]


def colours_of_python(text: str) -> list[str]:
    """Strings that are colours; docstrings are none, nor are the names of a pixel's channels."""
    tree = ast.parse(text)
    said = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple) and node.elts and ast.unparse(node.elts[0]) in ("'red'", "'green'", "'blue'"):
            said |= {id(part) for part in node.elts}
    strings = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said
    ]
    return [text for text in strings if _LITERAL.search(text) or text in _NAMES]


def test_no_python_file_has_a_colour_of_its_own() -> None:
    files = sources(".py")
    assert len(files) > 200
    texts = {path.name: path.read_text(encoding="utf-8") for path in files}
    # Parsing takes longer than looking: only what may hold a colour is parsed.
    named = re.compile(rf"[\"'](?:{'|'.join(sorted(_NAMES))})[\"']")
    held = {name: text for name, text in texts.items() if _LITERAL.search(text) or named.search(text)}
    found = {name: colours for name, text in held.items() if (colours := colours_of_python(text))}
    assert found == {}


def test_no_style_script_or_template_has_a_colour_of_its_own() -> None:
    files = sources(".css", ".js", ".html")
    assert len(files) > 15
    found = {}
    for path in files:
        text = path.read_text(encoding="utf-8")
        style = text if path.suffix == ".css" else "".join(re.findall(r"<style>.*?</style>", text, re.DOTALL))
        if colours := [*_LITERAL.findall(text), *_IN_STYLE.findall(style)]:
            found[path.name] = colours
    assert found == {}


@pytest.mark.parametrize("text", ['line(color="#d55e00")', "fill = 'white'", 'x = "rgba(0,0,0,0.5)"'])
def test_a_colour_in_python_is_found(text: str) -> None:
    assert colours_of_python(text)


def luminance(text: str) -> float:
    """Relative luminance of WCAG 2.2, 0 to 1."""
    parts = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in theme.rgb(text)]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("dark", [False, True])
def test_words_can_be_read_and_limits_are_no_threats(dark: bool) -> None:
    ground = {name: theme.colour(name, dark=dark) for name in ("paper", "plot")}
    for name in ("ink", "quiet", "link", "good", "bad", "open", "fail", "limit"):
        for behind in ground.values():
            assert contrast(theme.colour(name, dark=dark), behind) >= 4.5, name
    used = [theme.colour(role, dark=dark) for role in ("limit", "missile", "radar", "fail", "commanded", "planned")]
    assert len(set(used)) == len(used)


def test_every_role_reaches_page_and_script() -> None:
    style, looks = theme.css_variables(), theme.page_styles()
    for role in theme.ROLE_STYLES:
        assert style.count(f"--{role}: ") == 2
        assert set(looks[role]) == {"width", "dash", "fill", "size", "face", "edge", "symbol"}
    assert all(
        re.fullmatch("#[0-9a-f]{6}", text) for look in theme.ROLE_STYLES.values() for text in (look.light, look.dark)
    )
