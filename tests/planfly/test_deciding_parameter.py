"""The parameter that decides, found among flights that pass or fail by a rule of the test's own."""

from collections.abc import Callable

import pytest

from flight.ardupilot.parameters import ArduPilotParameters, default_parameters
from logs.verdict.findings import Fact, Finding, make_finding
from logs.verdict.places import Place
from planfly.deciding_parameter import deciding_parameter

LEG = Place("leg", 4)
LOW = make_finding("clearance", LEG, ok=False, reason="", flown=52.0, limit=60.0, margin=-8.0)
HEIGHTS = make_finding("slope", LEG, ok=True, reason="", facts=[Fact("height error", -8.4, "m")])
WIDE = make_finding("corridor", LEG, ok=False, reason="", flown=210.0, limit=180.0, margin=-30.0)


class Flights:
    """Flies by a test, and counts."""

    def __init__(self, passes: Callable[[ArduPilotParameters], bool]) -> None:
        self.count = 0
        self._passes = passes

    def __call__(self, parameters: ArduPilotParameters) -> bool:
        self.count += 1
        return self._passes(parameters)


@pytest.mark.parametrize(
    ("most", "passing"),
    [(2.81, 2.8), (2.79, 2.6), (1.21, 1.2), (1.19, 1.0), (1.0, 1.0)],
)
def test_the_nearest_value_that_passes_is_named(most: float, passing: float) -> None:
    flights = Flights(lambda new: new.tecs_height_demand_time <= most)
    found = deciding_parameter(default_parameters(), (LOW, HEIGHTS), flights)
    assert found is not None
    assert (found.name, found.current, found.passing, found.unit) == ("TECS_HDEM_TCONST", 3.0, passing, "s")
    assert (found.rule, found.place, found.off) == ("clearance", LEG, -8.4)
    # The farthest value, and the nine between it and the present one by halves.
    assert flights.count <= 5


def test_what_failed_says_where_to_look_first() -> None:
    passes = Flights(lambda new: new.tecs_height_demand_time < 2.0 or new.navl1_period < 15.0)
    found = deciding_parameter(default_parameters(), (LOW,), passes)
    assert found is not None
    assert found.name == "TECS_HDEM_TCONST"
    found = deciding_parameter(default_parameters(), (WIDE,), passes)
    assert found is not None
    assert (found.name, found.passing, found.off) == ("NAVL1_PERIOD", 14.0, 210.0)


@pytest.mark.parametrize(
    ("name", "passes", "passing"),
    [
        ("WP_RADIUS", lambda new: new.wp_radius <= 62.0, 60.0),
        ("WP_RADIUS", lambda new: new.wp_radius >= 118.0, 120.0),
        ("TECS_CLMB_MAX", lambda new: new.tecs_climb_max >= 6.2, 6.5),
    ],
)
def test_both_ways(name: str, passes: Callable[[ArduPilotParameters], bool], passing: float) -> None:
    found = deciding_parameter(default_parameters(), (WIDE,), passes)
    assert found is not None
    assert (found.name, found.passing) == (name, passing)


def test_none_where_none_decides() -> None:
    flights = Flights(lambda new: False)
    assert deciding_parameter(default_parameters(), (WIDE,), flights) is None
    assert flights.count == 8
    assert deciding_parameter(default_parameters(), (HEIGHTS,), flights) is None


def test_a_value_beyond_the_farthest_is_not_tried() -> None:
    quick = default_parameters().changed(TECS_HDEM_TCONST=1.0)
    seen: list[float] = []

    def passes(new: ArduPilotParameters) -> bool:
        seen.append(new.tecs_height_demand_time)
        return False

    assert deciding_parameter(quick, (LOW,), passes) is None
    assert set(seen) == {1.0}


def test_findings_that_pass_are_not_blamed() -> None:
    fine: Finding = make_finding("corridor", LEG, ok=True, reason="")
    assert deciding_parameter(default_parameters(), (fine,), lambda new: True) is None
