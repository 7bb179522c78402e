"""The table of planfly's extras: what each adds, and what it installs."""

import re
import tomllib
from pathlib import Path

from world.extras import EXTRAS

ROOT = Path(__file__).parents[2]


def extras_table() -> str:
    """Return one row per extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    rows = ["| extra | for | installs |", "|---|---|---|"]
    for extra in EXTRAS.values():
        packages = [re.split("[<>=]", one)[0] for one in project["optional-dependencies"][extra.name]]
        rows.append(f"| `{extra.name}` | {extra.purpose} | {', '.join(packages)} |")
    return "\n".join(rows)
