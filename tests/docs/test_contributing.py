"""CONTRIBUTING.md names files that are there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
# What stands in backticks and has a file's suffix, or ends as a folder does.
PATH = re.compile(r"`([\w./-]+(?:\.(?:py|md|toml|js|json)|/))`")


def test_every_path_is_there() -> None:
    """Whole, or its end, as in "`tables.py` beside it"; capitals stand for a name to choose."""
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = {path for path in PATH.findall(guide) if not re.search("[A-Z]{3}", path)}
    rooms = [path for path in ROOT.iterdir() if not path.name.startswith(".")]
    inside = [file for room in rooms if room.name not in ("build", "runs") for file in room.rglob("*.*")]
    there = "".join(f"/{file.relative_to(ROOT).as_posix()}\n" for file in (*rooms, *inside))
    missing = {path for path in named if f"/{path}" + ("" if path.endswith("/") else "\n") not in there}
    assert missing == set()
    assert len(named) > 100


def test_every_name_is_in_the_code() -> None:
    """A name in backticks that is written as Python's, and is no word of English, occurs in a source file."""
    guide = re.sub(r"```.*?```", "", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    named = {name for name in re.findall(r"`(_?[A-Za-z]\w*)`", guide) if "_" in name or name.isupper()}
    folders = ("planfly", "logs", "flight", "planner", "aircraft", "world", "tests", "docs/making")
    code = "\n".join(file.read_text(encoding="utf-8") for folder in folders for file in (ROOT / folder).rglob("*.py"))
    words = set(re.findall(r"\w+", code))
    # Capitals stand for a name to choose; a unit is the end of a name.
    units = {"_M", "_S", "_MPS", "_DEG", "_RAD"}
    assert {name for name in named - words - units if "NAME" not in name} == set()
    assert len(named) > 60
