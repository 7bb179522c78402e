"""Take-offs as flown: what passes, a motor that never starts, height lost, ground and a zone in the climb."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.autopilot import StoredAutopilot
from flight.autopilots.catalog import restore_autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import flown_phases
from logs.verdict.suggestions import suggest_better_launch
from tests.flight.autopilots.arduplane.flown_grounds import circuit, fly
from tests.logs.verdict.rules.flown_circuits import RAIL, STRIP, flown_circuit, found, moved, with_hole
from world.airfield import Launch
from world.scenario_tables import LaunchMethod
from world.wind import Wind


def test_a_good_take_off_passes_and_the_rules_of_the_items_are_silent() -> None:
    flown = flown_circuit()
    verdict = judge_flight(flown.setup, flown.track, flown.flight.ended)
    assert verdict.flyable, verdict.summary
    rules = {item.rule for item in verdict.findings}
    assert {"launch", "touchdown", "go_around"} <= rules
    assert not {"takeoff", "climbout", "landing", "approach"} & rules
    one = found(flown.setup, flown.track, "launch")
    assert one.ok is True
    assert "launched from a catapult on 90° at 20.0 m/s, 33.3 m/s²" in one.reason
    assert "Start: NAV_TAKEOFF (item 1): launched from a catapult at home" in verdict.summary


def test_a_flight_whose_motor_never_started_says_so_and_not_that_it_landed_badly() -> None:
    flown = fly(circuit(Launch("catapult", 1.5, 10.0, 6.0, 0.14), STRIP, TKOFF_THR_MINACC=15.0))
    one = found(flown.setup, flown.track, "launch", flown.flight.ended)
    assert one.ok is False
    assert "less than TKOFF_THR_MINACC 15: the motor never starts" in one.reason
    assert "it must climb to 60 m" in one.reason
    assert found(flown.setup, flown.track, "touchdown", flown.flight.ended).ok is None


def test_a_throw_that_falls_to_the_ground_states_what_was_flown() -> None:
    """Released 1.8 m above level ground at 3 m/s, it falls for 0.6 s and gets a few metres far."""
    flown = fly(circuit(Launch("hand", math.pi / 2.0, 3.0, 2.0, 0.0), STRIP))
    reason = found(flown.setup, flown.track, "launch", flown.flight.ended).reason
    assert flown.flight.ended == "ground contact"
    told = re.search(r"sinks (\d\.\d) m in the (\d) m flown, down to (\d\.\d) m above ground", reason)
    assert told is not None, reason
    assert 1 <= int(told[2]) <= 4
    # Released 1.8 m above ground.
    assert float(told[1]) + float(told[3]) == pytest.approx(1.8, abs=0.1)
    assert float(told[3]) < 0.3
    assert "in 100 m" not in reason


def test_the_start_states_the_throw_of_a_hand_launch() -> None:
    """The default throw: 10 m/s after 2 m are 10^2 / (2 * 2) = 25 m/s^2; a stated one: 6^2 / (2 * 1.5) = 12 m/s^2."""
    for launch, throw in (
        (Launch("hand", 1.5), "10.0 m/s after 2.0 m, 25.0 m/s²"),
        (Launch("hand", 1.5, 6.0, 1.5), "6.0 m/s after 1.5 m, 12.0 m/s²"),
    ):
        assert circuit(launch, STRIP).started.startswith(f"NAV_TAKEOFF (item 1): launched by hand ({throw}) at home, ")


@pytest.mark.parametrize(
    ("from_deg", "method", "wanted"),
    # The launch is on 90 degrees.
    [
        (270.0, "catapult", 270.0),
        (225.0, "hand", 225.0),
        (225.0, "runway", 270.0),
        (90.0, "hand", None),
        (0.0, "hand", None),
    ],
)
def test_a_launch_with_a_tailwind_is_offered_the_course_against_it(
    from_deg: float, method: LaunchMethod, wanted: float | None
) -> None:
    flown = flown_circuit()
    requirements, _ = flown_phases(route_requirements(flown.setup), flown.track)
    finding, ground = found(flown.setup, flown.track, "launch"), requirements.ground_phases
    assert ground is not None
    assert ground.procedures.take_off is not None
    take_off = replace(ground.procedures.take_off, launch=replace(RAIL, method=method))
    procedures = replace(ground.procedures, take_off=take_off)
    scenario = replace(flown.setup.scenario, wind=Wind(9.0, math.radians(from_deg)))
    setup = replace(flown.setup, scenario=scenario)
    windy = replace(requirements, setup=setup, ground_phases=replace(ground, procedures=procedures))
    changes = [change for (change,) in suggest_better_launch(windy, None, finding) if change.what == "launch course"]
    assert [change.wanted for change in changes] == ([] if wanted is None else [wanted])
    assert all(change.current == 90.0 for change in changes)


@pytest.mark.parametrize(
    ("thrown", "wind", "wanted"), [(6.0, 0.0, 14.0), (13.9, 0.0, 14.0), (14.0, 0.0, None), (6.0, 3.0, 11.0)]
)
def test_a_throw_that_is_too_slow_is_offered_the_speed_of_level_flight(
    thrown: float, wind: float, wanted: float | None
) -> None:
    """Level flight takes 13.5 m/s of airspeed; the launch is to the east, and so much of it is a wind from there."""
    flown = flown_circuit()
    requirements, _ = flown_phases(route_requirements(flown.setup), flown.track)
    finding, ground = found(flown.setup, flown.track, "launch"), requirements.ground_phases
    assert ground is not None
    assert ground.procedures.take_off is not None
    take_off = replace(ground.procedures.take_off, launch=replace(RAIL, method="hand"), speed=thrown)
    scenario = replace(flown.setup.scenario, wind=Wind(wind, math.radians(90.0)))
    least = replace(flown.setup.envelope, level_speed_min=np.full_like(flown.setup.envelope.level_speed_min, 13.5))
    setup = replace(flown.setup, scenario=scenario, limits=replace(flown.setup.limits, envelope=least))
    thrown_ground = replace(ground, procedures=replace(ground.procedures, take_off=take_off))
    calm = replace(requirements, setup=setup, ground_phases=thrown_ground)
    changes = [change for (change,) in suggest_better_launch(calm, None, finding)]
    assert [(change.what, change.wanted) for change in changes] == (
        [] if wanted is None else [("launch speed", wanted)]
    )


def test_a_climb_over_unknown_ground_is_not_judged() -> None:
    flown = flown_circuit()
    setup = with_hole(flown.setup, 150.0, 0.0)
    one = found(setup, flown.track, "launch")
    assert one.ok is None
    assert "the terrain below the launch's climb is unknown" in one.reason
    headline = judge_flight(setup, flown.track, "completed").headline
    assert headline == "not judged in full: the terrain below the launch's climb is unknown"


def test_a_climb_through_a_zone_fails_and_one_beside_it_does_not() -> None:
    flown = flown_circuit()

    def over(north: float) -> bool | None:
        corners = [[x, north + y] for x, y in ((100.0, -20.0), (140.0, -20.0), (140.0, 20.0), (100.0, 20.0))]
        zone = {"name": "town", "kind": "exclusion", "polygon_m": corners}
        setup = circuit(RAIL, STRIP, TKOFF_THR_MINACC=15.0, world={"zones": [zone]})
        return found(setup, flown.track, "launch").ok

    assert over(0.0) is False
    assert over(500.0) is True


def test_the_first_leg_is_held_to_its_corridor_once_it_is_flown_along() -> None:
    """Launched the other way, the aircraft is 260 m off the leg before it has turned onto it; the corridor is 180 m."""
    launch = Launch("catapult", math.radians(250.0), 20.0, 6.0, 0.2)
    flown = fly(circuit(launch, None))
    track = flown.track
    corridor = [item for item in judge_flight(flown.setup, track, "completed").findings if item.rule == "corridor"]
    assert corridor[0].ok is True
    assert np.abs(track.position[:, 1]).max() > 200.0
    # Off the leg once it is on course, it fails.
    off = moved(track, slice(int(np.argmax(track.position[:, 0] > 800.0)), len(track)), north=-200.0)
    again = [item for item in judge_flight(flown.setup, off, "completed").findings if item.rule == "corridor"]
    assert again[0].ok is False


@pytest.mark.parametrize("autopilot", [PlanflyGuidance.name, "px4"])
def test_an_autopilot_that_flies_no_take_off_says_so_in_a_line(autopilot: str) -> None:
    setup = flown_circuit().setup
    other = replace(setup, autopilot=restore_autopilot(autopilot, StoredAutopilot()))
    assert not other.ground_phases
    assert "flies no take-off and no landing: both are judged only by geometry" in judge_geometry(other).summary
