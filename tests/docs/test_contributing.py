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
