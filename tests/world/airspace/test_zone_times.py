"""Times of activity: lines of text by the calendar, and zones left out of a scenario that is flown at another time."""

import json
from pathlib import Path

import pytest

from tests.world.made.made_scenario import SMALL
from world.airspace.zone_times import is_active, parse_period, parse_span
from world.errors import ScenarioError
from world.scenario import load_scenario, scenario_from_spec, with_flight_time

# 2026-05-01 is a Friday.
FRIDAY_NIGHT = "../.. FRI 22:00/06:00"


@pytest.mark.parametrize(
    ("times", "at", "active"),
    [
        ([], "2026-05-01T10:00Z", True),
        (["BY NOTAM"], "2026-05-01T10:00Z", True),
        (["2026-05-01T00:00Z/2026-05-02T00:00Z"], "2026-05-01T10:00Z", True),
        (["2026-05-01T00:00Z/2026-05-02T00:00Z"], "2026-05-02T00:01Z/2026-05-02T01:00Z", False),
        # A flight that is on its way when the zone begins.
        (["2026-05-01T10:30Z/.."], "2026-05-01T10:00Z", True),
        (["2026-05-01T11:01Z/.."], "2026-05-01T10:00Z", False),
        (["../2026-05-01T09:59Z"], "2026-05-01T10:00Z", False),
        (["../.. SAT,SUN"], "2026-05-01T10:00Z", False),
        (["../.. SAT,SUN"], "2026-05-01T23:30Z", True),
        (["../.. 07:00/20:00"], "2026-05-01T20:01Z", False),
        (["../.. 07:00/20:00"], "2026-05-01T19:59Z", True),
        # Ten in the evening in Zurich's summer is eight in the evening in UTC.
        (["../.. 07:00/20:00"], "2026-05-01T22:30+02:00", False),
        ([FRIDAY_NIGHT], "2026-05-01T21:30Z", True),
        ([FRIDAY_NIGHT], "2026-05-02T05:59Z", True),
        ([FRIDAY_NIGHT], "2026-05-02T06:01Z", False),
        ([FRIDAY_NIGHT], "2026-05-01T05:00Z/2026-05-01T06:00Z", False),
        # One of several is enough.
        (["../.. SAT", "../.. FRI 00:00/24:00"], "2026-05-01T10:00Z", True),
    ],
)
def test_by_the_calendar(times: list[str], at: str, active: bool) -> None:
    assert is_active(times, *parse_span(at)) == active


@pytest.mark.parametrize("text", ["../..", FRIDAY_NIGHT, "2026-05-01T00:00Z/.. SAT,SUN 07:00/24:00"])
def test_a_period_is_written_as_it_is_read(text: str) -> None:
    period = parse_period(text)
    assert period is not None
    assert period.text() == text


@pytest.mark.parametrize(
    "text",
    [
        "always",
        "2026-05-01",
        "2026-05-01T00:00/..",
        "../.. FRIDAY",
        "../.. 07:00",
        "../.. 24:30/25:00",
        "../.. 07:00/20:00 SAT",
        "../.. SAT 07:00/20:00 UTC",
        "2026-05-02T00:00Z/2026-05-01T00:00Z",
        "2026-02-30T00:00Z/..",
    ],
)
def test_what_is_no_period(text: str) -> None:
    with pytest.raises(ValueError, match=r"allowed|ends before"):
        parse_period(text)


ZONES = """
[[zones]]
name = "market"
kind = "exclusion"
east_m = 0.0
north_m = 1500.0
radius_m = 90.0
times = ["../.. SAT 05:00/12:00"]

[[zones]]
name = "mast"
kind = "exclusion"
east_m = 300.0
north_m = 1500.0
radius_m = 90.0
"""


def test_a_zone_that_is_not_active_is_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(SMALL + ZONES, encoding="utf-8")
    scenario = load_scenario(str(path))
    assert [zone.name for zone in scenario.zones] == ["market", "mast"]
    assert scenario.notes == (
        "1 zone has times of activity, but is treated as active at all times, because no time of flight is given"
        " (--at)",
    )
    friday = with_flight_time(scenario, "2026-05-01T10:00Z")
    assert [zone.name for zone in friday.zones] == ["mast"]
    assert friday.notes == (
        "1 of 1 zone with times of activity is not active from 2026-05-01 10:00 to 2026-05-01 11:00 UTC and is ignored",
    )
    # What is written down of it is the same scenario again, in which another time can be asked for.
    again = scenario_from_spec(json.loads(json.dumps(friday.to_json())), "a log")
    assert again.zones == friday.zones
    assert [zone.name for zone in with_flight_time(again, "2026-05-02T10:00Z").zones] == ["market", "mast"]


@pytest.mark.parametrize(
    "at", ["noon", "2026-05-01T10:00", "2026-05-01T10:00Z/2026-05-01T09:00Z", "9999-12-31T23:59-14:00"]
)
def test_what_is_no_time_of_a_flight(at: str) -> None:
    with pytest.raises(ScenarioError, match="at"):
        with_flight_time(load_scenario("tight"), at)
