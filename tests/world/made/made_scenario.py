"""Scenarios made for tests: one of every key, and a small file with the one line that a fault in it is refused with."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from world.errors import PlanflyError
from world.scenario import Scenario, load_scenario


def made_spec(**changes: Any) -> dict[str, Any]:
    """JSON data of a scenario with every kind of position and threat; tables may be replaced."""
    spec: dict[str, Any] = {
        "name": "made",
        "terrain": {
            "kind": "peaks",
            "peak": [{"east_m": 0.0, "north_m": 0.0, "height_m": 500.0, "sigma_m": 600.0}],
        },
        "area": {"east_m": [-3000, 3000], "north_m": [-2000, 2000]},
        "start": {"east_m": -2500, "north_m": 100, "height_m": 120, "course_deg": 90},
        "destination": {"lat_deg": 46.005, "lon_deg": 8.02, "amsl_m": 300},
        "threats": [
            {"east_m": 200, "north_m": 0, "kill_radius_m": 400, "kill_scale_m": 100},
            {"name": "b", "east_m": 0, "north_m": 0, "height_m": 9, "detection_radius_m": 1, "detection_scale_m": 2},
            {"east_m": 0, "north_m": 0, "amsl_m": 77, "kill_radius_m": 1, "kill_scale_m": 2},
        ],
        "wind": {"speed_mps": 6, "from_deg": 270, "gradient": 0.01, "turbulence": "light"},
    }
    return spec | changes


def same_scenario(a: Scenario, b: Scenario) -> bool:
    """Whether two scenarios agree in their data and, bit for bit, in their arrays."""
    # JSON states who flies where a file may leave it to the default.
    same = (
        a.name,
        a.origin,
        a.floor,
        a.ceiling,
        a.start_course,
        a.limits,
        a.planner,
        a.flight.with_stated_defaults(),
        a.wind,
    ) == (
        b.name,
        b.origin,
        b.floor,
        b.ceiling,
        b.start_course,
        b.limits,
        b.planner,
        b.flight.with_stated_defaults(),
        b.wind,
    ) and a.to_json() == b.to_json()
    arrays = [(getattr(a, name), getattr(b, name)) for name in ("bounds", "start", "destination")]
    arrays += [
        (getattr(a.threats, name), getattr(b.threats, name)) for name in ("position", "kill_radius", "kill_scale")
    ]
    same = same and (a.launch, a.landing) == (b.launch, b.landing)
    if a.home is not None and b.home is not None:
        arrays.append((a.home, b.home))
    if a.returns is not None and b.returns is not None:
        asked = [(one.require, one.rtl_altitude, one.rtl_autoland) for one in (a.returns, b.returns)]
        same = same and asked[0] == asked[1]
        arrays.append((a.returns.rally, b.returns.rally))
    if a.terrain is not None and b.terrain is not None:
        arrays += [(a.terrain.heights, b.terrain.heights), (a.terrain.to_pixel.to_rows(), b.terrain.to_pixel.to_rows())]
    return same and all(np.array_equal(x, y) for x, y in arrays)


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
