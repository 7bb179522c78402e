"""Every tolerance of the verdict is a positive number that something uses."""

import math
import re
from pathlib import Path

import pytest

from flight.autopilots.parts import FeasibilityLimits
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict import tolerances

NAMES = [name for name in vars(tolerances) if name.isupper()]
USED = {
    word
    for path in Path(tolerances.__file__).parents[1].rglob("*.py")
    if path != Path(tolerances.__file__)
    for word in re.findall(r"\b[A-Z][A-Z0-9_]+\b", path.read_text(encoding="utf-8"))
}


def numbers(value: object) -> list[float]:
    """The numbers of a tolerance: one, or one by each turbulence."""
    found = list(value.values()) if isinstance(value, dict) else [value]
    assert all(isinstance(number, int | float) for number in found), value
    return [float(number) for number in found]


@pytest.mark.parametrize("name", NAMES)
def test_it_is_used_positive_and_finite(name: str) -> None:
    assert name in USED, f"{name} is used nowhere"
    value = getattr(tolerances, name)
    # Calm air adds nothing to where a gust may carry the aircraft.
    smallest = 0.0 if name == "GUST_OFFSET_M" else math.ulp(0.0)
    assert all(smallest <= number < math.inf for number in numbers(value))


def test_more_turbulence_allows_no_less() -> None:
    for table in (tolerances.GUST_OFFSET_M, tolerances.CORNER_CUT_TOLERANCE_M):
        assert list(table) == ["none", "light", "moderate"]
        assert list(table.values()) == sorted(table.values())


def test_px4s_defaults_are_those_of_its_parameters() -> None:
    """FW_LND_ANG and MIS_DIST_1WP as PX4's reference has them, MIS_TKO_LAND_REQ as its planes."""
    usual = FeasibilityLimits()
    assert (tolerances.PX4_FIRST_WAYPOINT_DISTANCE_M, usual.requires) == (10_000.0, 2)
    assert math.degrees(usual.landing_angle + tolerances.PX4_LANDING_BUFFER_RAD) == pytest.approx(5.1)
    assert Px4(Px4Parameters.defaults()).checks.feasibility == usual
