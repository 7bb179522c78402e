"""Waypoints reached and missed: by the mission's radius, by the path's own, and what is planned to miss."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4 import parameters as px4_parameters
from flight.autopilots.px4.autopilot import Px4
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict import summary
from logs.verdict.findings import UNKNOWN_AIRCRAFT, make_finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules.waypoint_rule import waypoint_findings
from tests.logs.verdict.judging import ROUTE, failing, judge, leg, of, waypoint
from tests.synthetic import bank_radius, bump, fly_path, make_setup, waypoint_stations

STRAIGHT = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]


def accepting(setup: FlightSetup, radius: float) -> FlightSetup:
    """The same with this acceptance radius stated for each waypoint, m."""
    return replace(setup, route=setup.route.with_fields(acceptance_radius=radius))


def corner(turn_deg: float) -> list[list[float]]:
    turn = math.radians(turn_deg)
    return [[0, 0, 300], [0, 5000, 300], [5000 * math.sin(turn), 5000 + 5000 * math.cos(turn), 300]]


@pytest.mark.parametrize(("aside", "ok"), [(9.9, True), (-9.9, True), (10.1, False), (-10.1, False)])
def test_ten_metres_beside_the_path_where_nobody_states_a_radius(aside: float, ok: bool) -> None:
    setup = make_setup(STRAIGHT)
    item = of(judge(setup, fly_path(setup, across=bump(3000.0, aside, 150.0))), "waypoint", waypoint(1))
    assert (item.ok, item.limit, item.limit_source) == (ok, 10.0, "fly-by path")
    assert item.flown == pytest.approx(abs(aside), abs=0.02)


def test_a_fly_by_passes_as_near_as_its_arc(setup: FlightSetup) -> None:
    """A 45 degree corner's arc passes R (1 / cos 22.5 - 1) = 9.1 m from its waypoint."""
    station = float(waypoint_stations(setup)[1])
    near = judge(setup, fly_path(setup, across=bump(station, 8.0, 150.0)))
    far = judge(setup, fly_path(setup, across=bump(station, 20.0, 150.0)))
    assert of(near, "waypoint", waypoint(1)).ok
    assert ("waypoint", waypoint(1)) in failing(far)
    assert of(far, "waypoint", waypoint(1)).flown == pytest.approx(9.1 + 20.0, abs=0.5)


@pytest.mark.parametrize(
    ("nav", "turbulence", "room"), [("perfect", "none", 0.6), ("perfect", "moderate", 1.0), ("gnss", "none", 5.1)]
)
def test_the_missions_own_radius(nav: str, turbulence: str, room: float) -> None:
    """Missed by what gusts move an aircraft and three standard deviations of 1.5 m of navigation, and no more."""
    made = make_setup(STRAIGHT, wind={"turbulence": turbulence})
    setup = replace(accepting(made, 20.0), nav=nav)  # type: ignore[arg-type]  # a name of the table
    for aside, ok in ((20.0 + room - 0.1, True), (20.0 + room + 0.1, False)):
        item = of(judge(setup, fly_path(setup, across=bump(3000.0, aside, 150.0))), "waypoint", waypoint(1))
        assert (item.ok, item.limit, item.limit_source) == (ok, 20.0, "mission")
        assert item.tolerance == pytest.approx(room)


@pytest.mark.parametrize("radius", [3.0, 30.0])
def test_it_counts_for_the_last_waypoint_too(radius: float) -> None:
    """Ended 25 m short of it: reached with a radius of 30 m, missed with one of 3 m."""
    setup = accepting(make_setup(STRAIGHT), radius)
    verdict = judge(setup, fly_path(setup, stop=5975.0))
    assert verdict.complete is (radius > 25.0)
    assert of(verdict, "waypoint", waypoint(2)).ok is (radius > 25.0)


def test_of_a_flight_that_ended_before_a_waypoint_its_end_counts() -> None:
    setup = make_setup(STRAIGHT)
    whole = fly_path(setup)
    ended = whole.rows(0, int(np.searchsorted(whole.position[:, 1], 2000.0)))
    items = [of(judge(setup, ended), "waypoint", waypoint(k)) for k in (1, 2)]
    assert items[0].flown == pytest.approx(setup.route.positions[1, 1] - ended.position[-1, 1], abs=0.01)
    assert [item.ok for item in items] == [False, None]


@pytest.mark.parametrize(("turn", "offset"), [(120.0, 110.4), (150.0, 316.1), (90.0, 45.7)])
def test_an_arc_that_passes_too_far_is_known_before_the_flight(turn: float, offset: float) -> None:
    """R (1 / cos(turn / 2) - 1) with R = 110.35 m."""
    own = bank_radius() * (1.0 / math.cos(math.radians(turn / 2)) - 1.0)
    assert own == pytest.approx(offset, abs=0.5)
    missed = of(judge_geometry(accepting(make_setup(corner(turn)), own - 0.1)), "waypoint", waypoint(1))
    assert (missed.ok, missed.planned) == (False, pytest.approx(own))
    assert missed.reason.startswith(f"the arc of the {turn:.0f}° corner passes the waypoint {own:.1f} m away")
    assert missed.margin == pytest.approx(-0.1, abs=1e-5)
    reached = of(judge_geometry(accepting(make_setup(corner(turn)), own + 0.1)), "waypoint", waypoint(1))
    assert (reached.ok, reached.margin) == (True, pytest.approx(0.1, abs=1e-5))
    over = accepting(make_setup(corner(turn), fly_over=(1,)), 10.0)
    assert of(judge_geometry(over), "waypoint", waypoint(1)).reason == "flown over"


def test_arduplane_turns_at_its_own_radius() -> None:
    """90 m at sea level from a right angle on, half of it at 45 degrees, none straight on; all of it at the end."""
    turns = {0.0: 0.0, 45.0: 45.0, 90.0: 90.0, 120.0: 90.0}
    for turn, radius in turns.items():
        points = [[e, n, 0.0] for e, n, _ in corner(turn)]
        setup = replace(
            make_setup(points, terrain={"kind": "flat", "amsl_m": -400.0}),
            autopilot=ArduPlane(ArduPilotParameters.defaults()),
        )
        verdict = judge_geometry(setup)
        assert of(verdict, "waypoint", waypoint(1)).limit == pytest.approx(radius)
        assert of(verdict, "waypoint", waypoint(2)).limit == pytest.approx(90.0)
        assert {item.limit_source for item in verdict.findings if item.rule == "waypoint"} == {"autopilot"}
        assert all(item.ok for item in verdict.findings if item.rule == "waypoint")
    # True by equivalent airspeed squared is the ratio of densities: 1.225 by 1.112 kg/m^3 at 1,000 m (US Standard
    # Atmosphere, 1976).
    high = replace(
        make_setup([[e, n, 1000.0] for e, n, _ in corner(90.0)]), autopilot=ArduPlane(ArduPilotParameters.defaults())
    )
    assert of(judge_geometry(high), "waypoint", waypoint(1)).limit == pytest.approx(90.0 * 1.225 / 1.112, rel=1e-3)


@pytest.mark.parametrize(("aside", "ok"), [(59.0, True), (-59.0, True), (61.0, False), (-61.0, False)])
def test_past_the_line_beside_it_counts_for_arduplane_within_the_corridor(aside: float, ok: bool) -> None:
    stated = make_setup(STRAIGHT, limits={"corridor_m": 60.0})
    setup = replace(accepting(stated, 10.0), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    track = fly_path(setup, across=bump(3000.0, aside, 150.0))
    item = of(judge(setup, track), "waypoint", waypoint(1))
    assert item.ok is ok
    assert f"the line across the leg at the waypoint was crossed {abs(aside):.0f} m to the side" in item.reason
    # Planfly's own guidance has to come near.
    assert not of(judge(accepting(stated, 10.0), track), "waypoint", waypoint(1)).ok


def test_fly_over_waypoints_are_flown_over(setup: FlightSetup, track: Track) -> None:
    over = make_setup(ROUTE, fly_over=(3,))
    # The fly-by cuts waypoint 3 by 30 m: good for a fly-by, a miss for a fly-over.
    assert ("waypoint", waypoint(3)) in failing(judge(over, track))
    assert of(judge(over, track), "waypoint", waypoint(3)).limit == pytest.approx(10.0)


@pytest.mark.parametrize("high", [20.0, -40.0])
def test_a_height_off_the_plan_is_told_and_no_miss(setup: FlightSetup, high: float) -> None:
    station = float(waypoint_stations(setup)[1])
    verdict = judge(setup, fly_path(setup, up=bump(station, high, 100.0)))
    item = of(verdict, "waypoint", waypoint(1))
    assert item.ok
    assert [(fact.what, fact.unit) for fact in item.facts] == [("height error", "m")]
    assert item.facts[0].value == pytest.approx(high, abs=1.0)
    assert f"{abs(item.facts[0].value):.1f} m {'above' if high > 0.0 else 'below'}" in item.reason


@pytest.mark.parametrize(
    ("errors", "note"),
    [
        ((24.0, -24.0), ""),
        ((26.0, 0.0), "; waypoint 1 (item 1) passed 26 m above its altitude"),
        ((-30.0, -49.0), "; waypoint 2 (item 2) passed 49 m below its altitude, and 1 more by over 25 m"),
    ],
)
def test_the_headline_names_a_waypoint_passed_far_from_its_altitude(errors: tuple[float, float], note: str) -> None:
    setup = make_setup([[0, 0, 300], [0, 3000, 300], [0, 6000, 300], [0, 9000, 300]])

    def offset(s: np.ndarray) -> np.ndarray:
        return np.sum([bump(3000.0 * k, error, 800.0)(s) for k, error in enumerate(errors, 1)], axis=0)

    headline = judge(setup, fly_path(setup, up=offset)).headline
    assert "altitude" in headline or not note
    assert headline.removeprefix("flyable").split("; an aircraft")[0].endswith(note)
    assert ("altitude" in headline) is bool(note)


def test_an_undecided_headline_names_that_waypoint_too() -> None:
    setup = make_setup([[0, 0, 300], [0, 3000, 300], [0, 6000, 300], [0, 9000, 300]])
    findings = judge(setup, fly_path(setup, up=bump(3000.0, -40.0, 800.0))).findings
    undecided = make_finding("speed", leg(1), ok=None, reason="", check=UNKNOWN_AIRCRAFT)
    headline = summary.headline([*findings, undecided], flyable=False)
    assert headline.startswith("not judged in full: airspeed on 1 leg is too close")
    assert headline.endswith("; waypoint 1 (item 1) passed 40 m below its altitude")


@pytest.mark.parametrize(("aside", "ok", "margin"), [(15.0, True, 5.0), (30.0, False, -10.0)])
def test_a_waypoints_margin_is_what_is_left_of_its_radius(aside: float, ok: bool, margin: float) -> None:
    setup = accepting(make_setup(STRAIGHT), 20.0)
    item = of(judge(setup, fly_path(setup, across=bump(3000.0, aside, 150.0))), "waypoint", waypoint(1))
    assert (item.ok, item.margin) == (ok, pytest.approx(margin, abs=0.02))
    assert (
        "the waypoint counts as reached within 20 m (the mission's radius) plus 0.6 m for navigation and gusts"
        in item.reason
    ) is not ok


@pytest.mark.parametrize(("aside", "ok"), [(50.0, True), (70.0, False)])
def test_past_the_line_of_the_last_waypoint_counts_for_arduplane_within_the_corridor(aside: float, ok: bool) -> None:
    stated = make_setup(STRAIGHT, limits={"corridor_m": 60.0})
    setup = replace(accepting(stated, 10.0), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    north = STRAIGHT[-1][1]
    longer = make_setup([*STRAIGHT[:-1], [0, north + 500.0, STRAIGHT[-1][2]]])
    item = of(judge(setup, fly_path(longer, across=bump(north, aside, 150.0))), "waypoint", waypoint(2))
    assert item.ok is ok
    assert f"the line across the leg at the waypoint was crossed {aside:.0f} m to the side" in item.reason


def test_past_the_line_beside_it_there_is_no_margin() -> None:
    setup = replace(accepting(make_setup(STRAIGHT), 10.0), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    for aside, margin in ((50.0, None), (4.0, 6.0)):
        item = of(judge(setup, fly_path(setup, across=bump(3000.0, aside, 150.0))), "waypoint", waypoint(1))
        assert item.ok
        assert item.margin == (None if margin is None else pytest.approx(margin, abs=0.02))


def test_px4_turns_by_its_own_radius_and_says_so() -> None:
    setup = replace(
        accepting(make_setup(STRAIGHT), 120.0), autopilot=Px4(px4_parameters.Px4Parameters.defaults("1.17"))
    )
    planned = of(judge_geometry(setup), "waypoint", waypoint(1)).reason
    assert planned == (
        "PX4 turns to the next leg 10 m before the waypoint, or once the aircraft has passed the waypoint; PX4 does not"
        " read the mission's 120 m"
    )
    own = replace(setup, route=setup.route.with_fields(acceptance_radius=0.0))
    told = of(judge_geometry(own), "waypoint", waypoint(1)).reason
    assert told == "PX4 turns to the next leg 10 m before the waypoint, or once the aircraft has passed the waypoint"


def test_a_flight_without_a_track_missed_no_waypoint(setup: FlightSetup) -> None:
    """The cause, a crash at the launch, is a finding of its own."""
    found = waypoint_findings(route_requirements(setup), None)
    assert {(item.ok, item.reason) for item in found} == {(None, "not reached: nothing was flown")}
