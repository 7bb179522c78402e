"""A small scenario file, and the one line that a file with one fault is refused with."""

from pathlib import Path

import pytest

from world.errors import PlanflyError
from world.scenario import load_scenario

SMALL = """
name = "small"
[terrain]
kind = "flat"
amsl_m = 200
[area]
east_m = [-5000, 5000]
north_m = [-4000, 4000]
[start]
east_m = -4000
north_m = 0
amsl_m = 400
[destination]
east_m = 4000
north_m = 0
height_m = 200
"""

THREAT = """
[[threats]]
east_m = 0
north_m = 900
kill_radius_m = 800
kill_scale_m = 200
"""


def refused(tmp_path: Path, text: str | bytes) -> str:
    """The one line that a file with this text is refused with; its own name must stand in it."""
    file = tmp_path / "bad.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(PlanflyError) as caught:
        load_scenario(str(file))
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert message.isprintable()
    return message.removeprefix(f"{file}: ")


def with_fault(old: str, new: str) -> str:
    """The small file with a part replaced, or with something appended where no part is named."""
    assert SMALL.count(old) >= 1
    return SMALL.replace(old, new, 1) if old else f"{SMALL}{new}\n"
