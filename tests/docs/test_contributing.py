"""CONTRIBUTING.md names files that are there."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
# What stands in backticks and has a file's suffix, or ends as a folder does.
PATH = re.compile(r"`([\w./-]+(?:\.(?:py|md|toml|js|json)|/))`")


def test_every_path_is_there() -> None:
    """Whole, or its end, as in "`tables.py` beside it"; capitals stand for a name to choose."""
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = {path for path in PATH.findall(guide) if not re.search("[A-Z]{3}", path)}
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    there = "".join(f"/{file}\n" for file in done.stdout.splitlines())
    missing = {path for path in named if f"/{path}" + ("" if path.endswith("/") else "\n") not in there}
    assert missing == set()
    assert len(named) > 100
