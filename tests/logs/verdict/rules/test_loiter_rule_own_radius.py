"""Circles of ArduPlane's own radius that are too tight for the bank, and circles that its roll limit does not hold.

At 25 m/s of equivalent airspeed 500 m above the sea it flies 25.6 m/s, by the standard atmosphere.
"""

import functools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission_files.formats import parse_mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.verdict import Verdict
from planfly.terminal.verdict_lines import verdict_lines
from planfly.workflow.open_flight import make_setup, open_flight
from planfly.workflow.uav import load_uav, max_turn_bank
from tests.logs.verdict.judging import of
from tests.mission_lines import ORIGIN, wp
from tests.soak import some
from world.scenario import scenario_from_spec, with_flight

SPEED = 25.0 * (1.0 - 0.0065 * 500.0 / 288.15) ** -2.128


def radius_at(bank_deg: float) -> float:
    """v^2 / (g tan bank), m."""
    return SPEED**2 / (9.80665 * math.tan(math.radians(bank_deg)))


def loiter(item: str, parameters: dict[str, float], **tables: Any) -> FlightSetup:
    """Two minutes or three turns around home at 500 m, by ArduPlane's law with these parameters."""
    place, kind = item.split(" ", 1)
    lines = [wp(0, -2000, 500, frame=0), wp(0, 0, 500, int(place), 0, kind), wp(0, 3000, 500, frame=0)]
    home = f"0 16 0 0 0 0 {ORIGIN.lat_deg} {ORIGIN.lon_deg} 0"
    text = "\n".join(["QGC WPL 110", *(f"{k} 0 {line} 1" for k, line in enumerate([home, *lines]))])
    end = {"east_m": 0.0, "north_m": -3000.0, "amsl_m": 500.0}
    spec = {
        "name": "own",
        "origin": {"lat_deg": ORIGIN.lat_deg, "lon_deg": ORIGIN.lon_deg},
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {"east_m": [-9000, 9000], "north_m": [-9000, 9000], "ceiling_amsl_m": 4000},
        "start": end,
        "destination": end | {"north_m": 4000.0},
    }
    scenario = scenario_from_spec(spec | tables, "own")
    uav = load_uav(scenario)
    law = ArduPlane(ArduPilotParameters.load(uav.aircraft)).with_parameters(**parameters)
    limits = replace(uav.limits, max_bank=min(uav.limits.max_bank, max_turn_bank(scenario, law)))
    flown_by = replace(uav, autopilot=law, limits=limits)
    return replace(make_setup(scenario, flown_by, parse_mission(text, "own.waypoints"), 1), nav="perfect")


@functools.cache
def flown(item: str, **parameters: float) -> Verdict:
    setup = loiter(item, parameters)
    done = fly_to_end(Flight(setup, load_uav(setup.scenario).aircraft))
    return judge_flight(setup, done.track, done.ended)


TIME, TURNS = "19 120 0 0 0", "18 3 0 0 0"
OWN = {"WP_LOITER_RAD": 60.0}


def test_in_open_country_a_circle_that_is_flown_wider_is_flyable() -> None:
    """63 m take 43 degrees of bank."""
    assert judge_geometry(loiter(TIME, OWN)).flyable
    assert judge_geometry(loiter(TIME, OWN)).headline == "flyable"
    # Its radius of 63 m is beyond the limit, so that it is not the radius that makes it pass.
    assert of(judge_geometry(loiter(TIME, OWN)), "loiter").margin is None
    (line,) = (line for line in verdict_lines(judge_geometry(loiter(TIME, OWN)), []) if line.startswith("  loiter"))
    assert "1 of 1 ok; waypoint 1 (item 2): " in line
    required = f"{radius_at(30.0):.0f} m"
    assert line.endswith(f"flown wider than WP_LOITER_RAD: the bank limit requires a radius of {required}")


def sphere(east: float, radius: float) -> dict[str, Any]:
    return {
        "threats": [
            {
                "name": "m",
                "east_m": east,
                "north_m": 0.0,
                "amsl_m": 500.0,
                "kill_radius_m": radius,
                "kill_scale_m": radius,
            }
        ]
    }


# 2.25 times the 116 m of 30 degrees: the aircraft may be anywhere within 261 m.
REACH = 2.25 * radius_at(30.0)


@pytest.mark.parametrize("away", [-20.0, 20.0])
def test_a_missile_where_a_wider_circle_may_lead_leaves_geometry_open(away: float) -> None:
    """Its sphere ends 20 m within what the circle may get to, far outside the 63 m that are drawn, and 20 m beyond."""
    verdict = judge_geometry(loiter(TIME, OWN, **sphere(REACH + 300.0 + away, 300.0)))
    item = of(verdict, "loiter")
    assert (item.ok, verdict.flyable, verdict.undecided) == ((True, True, False) if away > 0 else (None, False, True))
    if away < 0.0:
        assert "missile m is in range; only a simulated flight shows" in item.reason
        assert (
            verdict.headline
            == "not judged in full: only a simulated flight shows how the circle at waypoint 1 (item 2) is flown"
        )


@pytest.mark.parametrize(("height", "open_"), [(0.0, False), (200.0, True), (-200.0, True)])
def test_a_zone_beside_it_counts_at_the_circles_height(height: float, open_: bool) -> None:
    """A cylinder of 50 m, 150 m from the middle, up to 200 m above or below the circle: or only far below it."""
    floor, ceiling = (0.0, 300.0) if height == 0.0 else (min(500.0, 500.0 + height), max(500.0, 500.0 + height))
    zone = {"name": "z", "kind": "exclusion", "east_m": 150.0, "north_m": 60.0, "radius_m": 50.0}
    zone |= {"floor_amsl_m": floor - 1.0, "ceiling_amsl_m": ceiling + 1.0}
    verdict = judge_geometry(loiter(TIME, OWN, zones=[zone]))
    assert (of(verdict, "loiter").ok is None) is open_
    assert verdict.undecided is open_


@pytest.mark.parametrize(("north", "open_"), [(REACH - 10.0, True), (REACH + 10.0, False)])
def test_the_areas_edge_beside_it_leaves_geometry_open(north: float, open_: bool) -> None:
    area = {"east_m": [-9000, north], "north_m": [-9000, 9000], "ceiling_amsl_m": 4000}
    verdict = judge_geometry(loiter(TIME, OWN, area=area))
    assert (of(verdict, "loiter").ok is None) is open_


def test_a_wind_that_leaves_no_way_around_is_no_matter_of_the_radius() -> None:
    item = of(judge_geometry(loiter(TIME, OWN, wind={"speed_mps": 30.0, "from_deg": 270.0})), "loiter")
    assert item.ok is False
    assert "at 26 m/s the circle cannot be flown in this wind" in item.reason


def test_a_circle_that_a_steep_roll_limit_holds_is_not_flown_wider() -> None:
    """74 m at 26 m/s take 42 degrees: within ROLL_LIMIT_DEG 55 it is held, beyond the 30 degrees of the limit."""
    steep = {"ROLL_LIMIT_DEG": 55.0, "WP_LOITER_RAD": 70.0}
    for verdict in (judge_geometry(loiter(TURNS, steep)), flown(TURNS, **steep)):
        item = of(verdict, "loiter")
        assert item.ok is False
        assert not verdict.flyable
        assert "flown wider" not in item.reason
        assert f"the aircraft's bank limit of 30° the aircraft needs {radius_at(30.0):.0f} m" in item.reason


def test_five_degrees_of_bank_more_are_the_tolerance_of_bank() -> None:
    """Shipped aircraft may bank to 35 degrees by their parameters where a scenario's 30 are the limit."""
    assert of(judge_geometry(loiter(TURNS, {"ROLL_LIMIT_DEG": 35.0, **OWN})), "loiter").ok
    assert of(judge_geometry(loiter(TURNS, {"ROLL_LIMIT_DEG": 35.5, **OWN})), "loiter").ok is False


def test_a_stated_circle_needs_the_autopilots_own_bank() -> None:
    """130 m, 136 m at this height, where 20 degrees hold 184 m: the law goes around half again as wide."""
    verdict = flown("18 3 0 130 0", ROLL_LIMIT_DEG=20.0)
    item = of(verdict, "loiter")
    assert item.ok is False
    assert item.limit == pytest.approx(radius_at(20.0), rel=0.002)
    assert "ArduPlane's bank limit of 20°" in item.reason


def judged_with(setup: FlightSetup, item: str, **parameters: float) -> Verdict:
    """A flight by the law with these parameters, judged as one of another setup."""
    own = loiter(item, parameters)
    done = fly_to_end(Flight(own, load_uav(own.scenario).aircraft))
    return judge_flight(setup, done.track, done.ended)


def test_a_stated_circle_flown_half_again_as_wide_fails() -> None:
    """136 m, that 35 degrees hold, flown with 20 degrees: 184 m and more."""
    item = of(
        judged_with(loiter("18 3 0 130 0", {"ROLL_LIMIT_DEG": 35.0}), "18 3 0 130 0", ROLL_LIMIT_DEG=20.0), "loiter"
    )
    assert item.ok is False
    assert item.flown is not None
    assert item.flown > 1.25 * 136.0 + 10.0
    assert "at most 181 m" in item.reason


def test_the_bank_that_was_flown_counts_before_the_one_that_could_be() -> None:
    """At ROLL_LIMIT_DEG 55 a circle of 60 m would be held with 43 degrees: flown with 20, it was not."""
    item = of(judged_with(loiter(TURNS, {"ROLL_LIMIT_DEG": 55.0, **OWN}), TURNS, ROLL_LIMIT_DEG=20.0), "loiter")
    assert item.ok is True
    assert "flown wider" in item.reason


@pytest.mark.parametrize("radius", some([10.0, 30.0], 2))
def test_a_circle_of_a_tiny_own_radius_keeps_its_corridor(radius: float) -> None:
    verdict = flown(TIME, WP_LOITER_RAD=radius)
    assert not [item for item in verdict.failed if item.rule == "corridor"]


def test_an_own_circle_of_a_low_roll_limit_keeps_its_corridor() -> None:
    """At 20 degrees it swings as wide as 184 m make it, 274 m off its legs: that harms nothing here."""
    verdict = flown(TURNS, ROLL_LIMIT_DEG=20.0)
    assert of(verdict, "loiter").ok
    assert not [item for item in verdict.failed if item.rule == "corridor"]


def test_the_bank_limit_is_the_lesser_of_scenario_and_autopilot() -> None:
    setup = loiter(TURNS, {})
    law, stated = setup.autopilot, with_flight(setup.scenario, max_bank_deg=30.0)
    assert max_turn_bank(stated, law.with_parameters(ROLL_LIMIT_DEG=20.0)) == math.radians(20.0)
    assert max_turn_bank(stated, law.with_parameters(ROLL_LIMIT_DEG=50.0)) == math.radians(30.0)
    assert max_turn_bank(setup.scenario, law.with_parameters(ROLL_LIMIT_DEG=50.0)) == math.radians(50.0)


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 180.0, 270.0])
def test_a_loiter_without_end_meets_the_wind_from_every_side(tmp_path: Path, from_deg: float) -> None:
    """Joined from its center, three quarters of a lap are drawn, which from 180 degrees lack the fastest course."""
    lines = [wp(0, 0, 0), wp(0, 0, 100), wp(4000, 3000, 100), wp(4000, 3000, 100, command=17, p="0 0 250 0")]
    file = tmp_path / "own.waypoints"
    file.write_text("\n".join(["QGC WPL 110", *(f"{k} 0 {line} 1" for k, line in enumerate(lines))]), encoding="utf-8")
    setup = open_flight(file, {"wind": (10.0, from_deg), "autopilot": "ardupilot"})
    (finding,) = (one for one in judge_geometry(setup).findings if one.rule == "loiter")
    amsl = setup.route.positions[-1, 2]
    ground_speed = 25.0 * (1.0 - 0.0065 * amsl / 288.15) ** -2.128 + 10.0
    assert finding.limit == pytest.approx(ground_speed**2 / (9.80665 * math.tan(setup.limits.max_bank)), rel=0.005)
