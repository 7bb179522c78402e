"""Places are values: equal by what they hold, usable as keys, and not to be changed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.autopilot import AutopilotProgram
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import (
    FLIGHT,
    MISSION,
    PLAN,
    AirframeAnswer,
    DecidingParameter,
    Disagreement,
    Place,
    ReferenceFlights,
)
from logs.verdict.verdict import Verdict, verdict_json
from logs.verdict.wording import deciding_text
from tests.logs.verdict.judging import judge, leg
from tests.logs.verdict.rules.flown_circuits import flown_circuit, moved
from tests.mission_lines import setup_of, wp
from tests.synthetic import bump, edited, fly_path, make_setup


def test_places_of_the_same_data_are_one_key() -> None:
    # What a leg leads to comes with its index; logs of before do not hold it.
    assert Place("leg", 3, to_item=4) == Place("leg", 3)
    found = {Place("waypoint", 3, item=4): "turn", Place("leg", 3): "slope"}
    assert found[Place("waypoint", 3, 4)] == "turn"
    assert found[Place("leg", 3)] == "slope"
    different = {
        Place("waypoint", 3),
        Place("waypoint", 3, item=4),
        Place("leg", 3),
        Place("missile", 3, name="a"),
        Place("radar", 3, name="a"),
        Place("radar", 3, name="b"),
        FLIGHT,
        MISSION,
        PLAN,
    }
    assert len(different) == 9


# ----------------------------------------------------------------------
# Three levels in one verdict: which are asked, where they differ, and whose fault a failure is.

STRAIGHT = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]
PASSED = AirframeAnswer(True, "flyable")
DECIDING = DecidingParameter("NAVL1_PERIOD", 17.0, 14.0, "s", "corridor", leg(1), 70.0)


@pytest.fixture(scope="module")
def autopilot() -> FlightSetup:
    return replace(
        make_setup(STRAIGHT, limits={"corridor_m": 60.0}), autopilot=ArduPlane(ArduPilotParameters.defaults())
    )


def aside(setup: FlightSetup, metres: float, reference: ReferenceFlights | None) -> Verdict:
    """The verdict on a flight that is so far beside its second leg."""
    return judge_flight(setup, fly_path(setup, across=bump(4500.0, metres, 150.0)), "completed", reference=reference)


def test_a_verdict_has_the_levels_that_were_asked(autopilot: FlightSetup) -> None:
    ideal = replace(autopilot, autopilot=PlanflyGuidance())
    asked = {
        ("geometry",): judge_geometry(ideal),
        ("geometry", "airframe"): aside(ideal, 0.0, None),
        ("geometry", "autopilot"): aside(autopilot, 0.0, None),
        ("geometry", "airframe", "autopilot"): aside(autopilot, 0.0, ReferenceFlights(PASSED)),
    }
    for names, verdict in asked.items():
        assert tuple(level.name for level in verdict.levels) == names
        assert verdict.flyable
        assert all(level.flyable for level in verdict.levels)
        assert verdict.levels[-1].headline == verdict.headline
    three = asked["geometry", "airframe", "autopilot"]
    assert three.lines[-2:] == (
        "Geometry only (no flight): flyable; flight and geometry agree on every finding that both judge",
        "Without the autopilot (planfly's guidance, exact navigation): flyable; both flights agree",
    )


def test_where_only_the_autopilot_fails_the_second_line_says_so(autopilot: FlightSetup) -> None:
    verdict = aside(autopilot, 70.0, ReferenceFlights(PASSED, DECIDING))
    assert verdict.lines[:2] == (
        "not flyable: corridor on leg 1, to item 2 (70 m > 60 m)",
        "The aircraft can fly this mission, but ArduPlane with these parameters cannot: with NAVL1_PERIOD 17 s the"
        " aircraft is 70 m off leg 1; with 14 s the flight would pass",
    )
    assert [level.flyable for level in verdict.levels] == [True, True, False]
    for level in verdict.levels[:2]:
        assert level.disagreements == (Disagreement("corridor", leg(1), level.name, there=True, here=False),)
    assert verdict.lines[-1].endswith(
        "flyable; corridor at leg 1 (to item 2) passes with planfly's guidance and fails in flight"
    )
    assert verdict.deciding == DECIDING
    written = json.loads(verdict_json(verdict))
    assert [level["name"] for level in written["levels"]] == ["geometry", "airframe", "autopilot"]
    assert written["deciding_parameter"]["name"] == "NAVL1_PERIOD"
    assert written["deciding_parameter"]["text"] == deciding_text(DECIDING)
    undecided = aside(autopilot, 70.0, ReferenceFlights(PASSED))
    assert undecided.lines[1].endswith(
        "cannot: no parameter value that was tried lets the flight pass with a margin for simulation errors"
    )


def test_a_mission_that_the_autopilot_rejects_needs_no_other_parameters() -> None:
    """PX4 supports no DO_SET_SERVO in missions, whatever its parameters are."""
    servo = "2 183 5 1500 0 0 0 0 0"
    setup = setup_of(wp(0, 500), wp(0, 3500), servo, wp(3000, 3500), home="36.5 -84.2 300")
    refused = replace(setup, autopilot=Px4(Px4Parameters.defaults()))
    verdict = judge_flight(refused, fly_path(refused), "completed", reference=ReferenceFlights(PASSED))
    assert verdict.lines[0].startswith("not flyable: mission item 3")
    assert verdict.lines[1] == "The aircraft can fly this mission, but PX4 cannot: it rejects an item of the mission"


@pytest.mark.parametrize(
    ("pitch_deg", "seconds", "is_named"), [(14.2, 5.2, True), (13.8, 8.0, False), (14.2, 4.8, False)]
)
def test_a_pitch_at_its_limit_is_named_where_the_flight_fails(
    autopilot: FlightSetup, pitch_deg: float, seconds: float, is_named: bool
) -> None:
    """TECS_PITCH_MAX is 15 degrees; within 1 degree of it the pitch is at its limit, and from 5 s on that is said."""
    track = fly_path(autopilot, across=bump(4500.0, 70.0, 150.0))
    attitude = np.array(track.attitude)
    attitude[np.abs(track.time - 180.0) < 0.5 * seconds, 1] = math.radians(pitch_deg)
    verdict = judge_flight(autopilot, edited(track, attitude=attitude), "completed", reference=ReferenceFlights(PASSED))
    line = "Pitch: at its limit TECS_PITCH_MAX 15° for 5 s on leg 1 (to item 2)"
    assert (line in verdict.lines) is is_named


def test_a_slope_beyond_the_aircrafts_is_not_the_autopilots_fault(autopilot: FlightSetup) -> None:
    """The aircraft climbs 12.3 degrees at this airspeed, and the legs are flown as drawn."""
    for slope_deg, is_autopilot in ((11.8, True), (12.8, False)):
        top = 500.0 + 2000.0 * math.tan(math.radians(slope_deg))
        points = [[0, 0, 500], [0, 1000, 500], [0, 3000, top], [0, 6000, top]]
        setup = replace(make_setup(points, limits={"corridor_m": 60.0}), autopilot=autopilot.autopilot)
        said = aside(setup, 70.0, ReferenceFlights(PASSED)).lines[1]
        assert said.startswith("The aircraft can fly this mission, but ArduPlane") is is_autopilot


def test_a_launch_that_fails_is_not_the_autopilots_fault() -> None:
    """The airframe's flight begins in the air; the launch sinks 3 m where 1 m is allowed."""
    flown = flown_circuit()
    low = moved(flown.track, slice(20, 60), up=-3.0)
    verdict = judge_flight(flown.setup, low, "completed", reference=ReferenceFlights(PASSED))
    assert "launch" in {finding.rule for finding in verdict.failed}
    assert not any(line.startswith("The aircraft can fly") for line in verdict.lines)
    (airframe,) = [level for level in verdict.levels if level.name == "airframe"]
    assert "launch" not in {disagreement.rule for disagreement in airframe.disagreements}


def test_what_decides_a_real_autopilots_flight_is_what_its_law_shows(autopilot: FlightSetup) -> None:
    program = AutopilotProgram("ArduPlane V4.6.0-dev (7fbc1660)", "0" * 64, {}, {})
    real = replace(autopilot, autopilot=ArduPlaneSitl(ArduPilotParameters.defaults(), program))
    said = aside(real, 70.0, ReferenceFlights(PASSED, DECIDING)).lines[1]
    assert said.endswith(f"cannot: {deciding_text(DECIDING)}, by the simulated flight")
    assert aside(real, 70.0, ReferenceFlights(PASSED)).lines[1].endswith("with these parameters cannot")


def test_levels_that_find_the_worst_at_other_corners_of_a_circle_are_compared() -> None:
    """25 m above ground are drawn, 30 m are required; flown is from 60 m above that at its begin down to 20 m."""
    lines = (wp(0, 500, 25), wp(0, 2500, 25, command=18, p="2 0 200 0"), wp(2500, 2500, 25))
    setup = setup_of(*lines, home="36.5 -84.2 100")
    radii = [float(radius) for radius in route_requirements(setup).radius[1:-1]]
    verdict = judge(setup, fly_path(setup, radius=radii, up=lambda s: np.maximum(20.0, 60.0 - 0.01 * s)))
    (planned,) = [
        item for item in judge_geometry(setup).findings if item.rule == "clearance" and item.place.number == 0
    ]
    (flown,) = [item for item in verdict.findings if item.rule == "clearance" and item.place.number == 0]
    assert (planned.ok, flown.ok) == (False, True)
    assert planned.place.index != flown.place.index
    found = [(item.rule, item.place.number, item.there, item.here) for item in verdict.levels[0].disagreements]
    assert ("clearance", 0, False, True) in found
    assert "clearance at leg 0 (to item 2) fails by geometry and passes in flight" in verdict.summary


def test_where_the_aircraft_fails_too_no_parameter_is_blamed(autopilot: FlightSetup) -> None:
    failed = AirframeAnswer(False, "not flyable: corridor on leg 1 (65.0 m > 60.0 m)", (("corridor", leg(1)),))
    verdict = aside(autopilot, 70.0, ReferenceFlights(failed))
    assert "The aircraft can" not in verdict.summary
    assert verdict.levels[1].disagreements == ()
    assert verdict.lines[-1].endswith("(65.0 m > 60.0 m); both flights agree")


def test_what_is_left_open_of_the_aircraft_is_no_failure(autopilot: FlightSetup) -> None:
    verdict = aside(autopilot, 0.0, ReferenceFlights(AirframeAnswer(False, "not judged in full: a slope on leg 1")))
    assert [level.undecided for level in verdict.levels] == [False, True, False]


def test_where_only_the_aircraft_fails_the_verdict_is_the_autopilots(autopilot: FlightSetup) -> None:
    failed = AirframeAnswer(False, "not flyable: corridor on leg 1 (65.0 m > 60.0 m)", (("corridor", leg(1)),))
    verdict = aside(autopilot, 0.0, ReferenceFlights(failed, DECIDING))
    assert (verdict.flyable, verdict.deciding) == (True, None)
    assert verdict.levels[1].disagreements == (Disagreement("corridor", leg(1), "airframe", there=False, here=True),)


@pytest.mark.parametrize(
    ("rule", "off", "text"),
    [
        (
            "clearance",
            -8.2,
            "with TECS_HDEM_TCONST 3 s the aircraft is 8 m too low on leg 4; with 1.2 s the flight would pass",
        ),
        (
            "clearance",
            8.2,
            "with TECS_HDEM_TCONST 3 s the aircraft is 8 m too high on leg 4; with 1.2 s the flight would pass",
        ),
        (
            "corridor",
            41.0,
            "with TECS_HDEM_TCONST 3 s the aircraft is 41 m off leg 4; with 1.2 s the flight would pass",
        ),
        (
            "waypoint",
            None,
            "with TECS_HDEM_TCONST 3 s the flight fails waypoint at leg 4; with 1.2 s the flight would pass",
        ),
    ],
)
def test_words_of_a_deciding_parameter(rule: str, off: float | None, text: str) -> None:
    assert deciding_text(DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", rule, leg(4), off)) == text


def test_a_flight_that_never_began_fails_its_own_level_and_not_geometry(autopilot: FlightSetup) -> None:
    for setup, name in ((autopilot, "autopilot"), (replace(autopilot, autopilot=PlanflyGuidance()), "airframe")):
        verdict = judge_flight(setup, fly_path(setup).rows(0, 0), "not started: no progress")
        assert [(level.name, level.flyable) for level in verdict.levels] == [("geometry", True), (name, False)]
        assert verdict.headline == verdict.levels[-1].headline
        assert "not started: no progress" in verdict.headline
        assert verdict.lines[-1] == "Geometry only (no flight): flyable"


def test_a_flight_that_fails_at_take_off_does_not_pass_with_another_guidance() -> None:
    """The circuit ends 2 s after its launch; the airframe's flight begins in the air, and flies all its legs."""
    flown = flown_circuit()
    track = flown.track.rows(0, int(np.searchsorted(flown.track.time, flown.track.time[0] + 2.0)))
    verdict = judge_flight(flown.setup, track, "it hit the ground", reference=ReferenceFlights(PASSED))
    failed_rules = {finding.rule for finding in verdict.failed}
    assert {"launch", "completion"} <= failed_rules
    (airframe,) = (level for level in verdict.levels if level.name == "airframe")
    assert airframe.disagreements == ()
    assert verdict.lines[-1].endswith("flyable; it begins in the air, after the take-off that failed")
    assert "passes with planfly's guidance" not in verdict.summary
