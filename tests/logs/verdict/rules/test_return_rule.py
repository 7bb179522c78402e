"""A return to launch in the verdict: where it goes, and what holds it and what does not."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.route import make_route
from flight.simulation.setup import FlightSetup, ImportedLog
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.tick import RTL_ARRIVAL_RADIUS_M
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.findings import make_finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_progress import return_loiter_reach
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.rules.return_rule import return_findings, without_path_following_findings
from logs.verdict.verdict import Verdict
from logs.views.replay.timeline import timeline
from tests.logs.verdict.judging import of
from tests.mission_lines import setup_of, wp
from tests.soak import some
from world.terrain import Peak, make_peaks_terrain
from world.wind import Wind

HOME = "36.5 -84.2 100"
RTL = "0 20 0 0 0 0 0 0 0"
# East, and back: home is behind, and the ground is flat at 100 m.
WAY = (wp(500, 1000, 300), wp(2500, 1000, 300), RTL)


def by_arduplane(setup: FlightSetup, **parameters: float) -> FlightSetup:
    """A setup with ArduPlane's law, its mission laid out by its rules."""
    law = ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde"))).with_parameters(**parameters)
    scenario = setup.scenario
    laid = (setup.mission, scenario.origin, scenario.terrain, 25.0, False, setup.limits)
    route = make_route(*laid, law.route_rules)
    return replace(setup, autopilot=law, route=route)


def flown(setup: FlightSetup) -> tuple[Verdict, str]:
    done = fly_to_end(Flight(setup, load_aircraft("aerosonde")))
    return judge_flight(setup, done.track, done.ended), done.ended


def test_a_return_is_flyable_on_every_level_though_it_turns_about() -> None:
    for setup in (setup_of(*WAY, home=HOME), by_arduplane(setup_of(*WAY, home=HOME))):
        predicted = judge_geometry(setup)
        assert predicted.flyable, predicted.lines
        verdict, ended = flown(setup)
        assert (ended, verdict.flyable) == ("completed", True), verdict.lines
        found = of(verdict, "return")
        assert (found.ok, found.place.index, found.place.item) == (True, 2, 3)
        assert "to home, 2.7 km away, descending 200 m on a straight slope to 200 m AMSL" in found.reason


@pytest.mark.parametrize(
    ("north", "up"),
    some([(north, up) for north in (-30.0, 0.0, 60.0, 150.0, 260.0, 400.0) for up in (110.0, 300.0, 20.0)], 7),
)
def test_a_return_from_near_its_target_comes_to_its_end(north: float, up: float) -> None:
    # North over home, or short of it, or past it; level, to sink, to climb.
    way = (wp(0, north - 1500, up), wp(0, north, up), RTL)
    verdict, ended = flown(by_arduplane(setup_of(*way, home=HOME)))
    assert ended == "completed"
    assert of(verdict, "return").ok
    assert verdict.complete, verdict.lines


def test_nothing_holds_the_way_back_to_its_drawing_but_ground_and_energy_do() -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    verdict, _ = flown(setup)
    legs = {item.place.index for item in verdict.findings if item.rule == "corridor"}
    assert legs == {0}
    assert {item.place.index for item in verdict.findings if item.rule == "waypoint"} == {0, 1}
    assert not [item for item in verdict.findings if item.rule in ("turn", "loiter")]
    low = [item for item in verdict.findings if item.rule == "clearance" and item.place.index != 0]
    assert low
    assert all(item.ok for item in low)
    assert of(verdict, "energy").ok


def test_a_drawn_leg_that_holds_nothing_of_the_way_says_nothing_once_the_way_was_flown() -> None:
    requirements = route_requirements(by_arduplane(setup_of(*WAY, home=HOME)))
    unflown = [
        make_finding("clearance", requirements.leg_place(leg), ok=None, reason="the leg was not flown")
        for leg in (0, 3, 4)
    ]
    # Beside its target it may have ended in the ground.
    aligned: Any = SimpleNamespace(passed=np.array([True, True]), has_flown=lambda leg: leg == 4)
    for arrived, left in ((True, [0, 4]), (None, [0, 3, 4]), (False, [0, 3, 4])):
        end = make_finding("return", requirements.waypoint_place(2), ok=arrived, reason="")
        kept = without_path_following_findings(requirements, aligned, [*unflown, end])
        assert [item.place.index for item in kept if item.rule == "clearance"] == left


def test_the_waypoint_before_a_return_is_reached_as_at_a_missions_end() -> None:
    # WP_RADIUS in the standard atmosphere's thinner air at 400 m, although the way back is drawn straight on from it.
    found = judge_geometry(by_arduplane(setup_of(*WAY, home=HOME))).findings
    limits = {item.place.index: item.limit for item in found if item.rule == "waypoint"}
    assert limits[1] == pytest.approx(90.0 * (1.0 - 2.25577e-5 * 400.0) ** -4.25588, abs=0.01)


def test_a_replay_tells_the_way_back_as_a_return(tmp_path: Path) -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    done = fly_to_end(Flight(setup, load_aircraft("aerosonde")))
    with Recorder(tmp_path / "a.mcap", setup) as recorder:
        recorder.write(done.track)
        recorder.finish(done.ended, judge_flight(setup, done.track, done.ended))
    log = read_log(tmp_path / "a.mcap")
    assert (log.setup.route.rtl_start, log.setup.route.rtl_loiter) == (1, setup.route.rtl_loiter)
    texts = [entry.text for entry in timeline(log) if entry.kind == "leg"]
    assert not [text for text in texts if text.startswith("loiter")]
    assert len([text for text in texts if text.startswith("return of item 3: leg 1 continues around its circle")]) == 2


@pytest.mark.parametrize("parameters", [{}, {"RTL_ALTITUDE": 20.0}])
def test_a_return_too_low_over_ground_fails_by_the_clearance(parameters: dict[str, float]) -> None:
    # 100 m over home keep the 30 m that a mission without limits has to; 20 m do not.
    setup = by_arduplane(setup_of(*WAY, home=HOME), **parameters)
    verdict, _ = flown(setup)
    failed = {item.rule for item in verdict.findings if item.ok is False}
    assert failed == ({"clearance"} if parameters else set())
    assert {item.rule for item in judge_geometry(setup).findings if item.ok is False} == failed
    # Its legs have no items: its altitude is suggested first, higher by what lacks of 30 m and by 1 m, rounded up.
    suggested = [(item.suggestions[0], item.flown) for item in verdict.findings if item.suggestions]
    assert len(suggested) == len(parameters)
    for (change,), height in suggested:
        assert height is not None
        assert (change.parameter, change.wanted) == ("RTL_ALTITUDE", math.ceil(20.0 + 30.0 - height + 1.0))


def test_a_return_that_meets_a_ridge_has_not_got_to_its_end() -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    # A hill of 400 m in the middle of the way, which is flown at some 300 m there.
    hill = make_peaks_terrain(
        np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), [Peak(1250.0, 500.0, 400.0, 300.0)], 1000.0
    )
    walled = setup.in_scenario(replace(setup.scenario, terrain=hill))
    verdict, ended = flown(walled)
    assert ended == "ground contact"
    assert of(verdict, "return").ok is None
    assert "did not reach its end" in of(verdict, "return").reason
    assert not verdict.flyable


@pytest.mark.parametrize("hill", [Peak(60.0, 0.0, 600.0, 60.0), Peak(-100.0, 0.0, 600.0, 80.0)])
def test_a_return_that_meets_a_hill_at_home_has_not_got_to_its_end(hill: Peak) -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    ground = make_peaks_terrain(np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), [hill], 100.0)
    verdict, ended = flown(setup.in_scenario(replace(setup.scenario, terrain=ground)))
    assert ended == "ground contact"
    assert of(verdict, "return").ok is None
    assert "did not reach its end: ground contact" in of(verdict, "return").reason


def test_a_return_with_an_empty_battery_has_not_got_to_its_end() -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    setup = replace(setup, battery=0.02 * setup.battery)
    verdict, ended = flown(setup)
    assert ended == "nothing is left in the battery or the tank"
    assert of(verdict, "return").ok is None


def test_a_planned_return_is_told_and_not_judged() -> None:
    setup = by_arduplane(setup_of(*WAY, home=HOME))
    found = of(judge_geometry(setup), "return")
    assert found.ok is None
    assert "descending 200 m on a straight slope" in found.reason
    assert "not flown yet" in found.reason


@pytest.mark.parametrize("autoland", [1, 2])
def test_a_return_that_goes_on_to_what_is_not_flown_is_left_open(autoland: int) -> None:
    """A landing sequence that begins with the landing: no other is flown in its place, however far that is."""
    lands = ("3 189 0 0 0 0 0 0 0", wp(0, 1500, 0, command=21))
    flown_on = ("3 189 0 0 0 0 0 0 0", wp(5300, 1500, 60), wp(5300, 0, 0, command=21))
    for after in (lands, (*lands, *flown_on)):
        setup = by_arduplane(setup_of(*WAY, *after, home=HOME), RTL_AUTOLAND=autoland)
        verdict = judge_geometry(setup)
        assert verdict.undecided
        assert verdict.headline.startswith("not judged in full: the landing at waypoint 2 (item 3) is not judged; ")
        assert verdict.headline.endswith("the destination of the return is unknown")
        assert "item 5 begins with the landing itself" in of(verdict, "return").reason
        assert of(verdict, "landing").reason == "the return does not continue to it"
    # As without RTL_AUTOLAND and the arming check that then fails, and as to a sequence that can be flown.
    assert not judge_geometry(by_arduplane(setup_of(*WAY, *lands, home=HOME), RTL_AUTOLAND=0, ARMING_CHECK=0)).undecided
    assert not judge_geometry(by_arduplane(setup_of(*WAY, *flown_on, home=HOME), RTL_AUTOLAND=autoland)).undecided


def test_a_return_to_a_wide_circle_comes_to_its_end() -> None:
    """Once around takes 6 minutes, and it comes to its circle before where that is drawn to begin."""
    verdict, ended = flown(by_arduplane(setup_of(*WAY, home=HOME), RTL_RADIUS=1500.0))
    assert ended == "completed"
    assert of(verdict, "return").ok
    assert verdict.complete, verdict.lines


def test_a_return_whose_circle_is_wider_than_the_arrival_radius_comes_to_its_end() -> None:
    """At 12 degrees of bank and 25 m/s the radius is 25² / (9.81 tan 12°) = 300 m, and the wind carries it along."""
    setup = setup_of(*WAY, home=HOME)
    setup = replace(setup, limits=replace(setup.limits, max_bank=math.radians(12.0)))
    setup = by_arduplane(setup, ROLL_LIMIT_DEG=12.0)
    wind = Wind(4.0, math.radians(270.0))
    setup = setup.in_scenario(replace(setup.scenario, wind=wind))
    done = fly_to_end(Flight(setup, load_aircraft("aerosonde")))
    assert done.ended == "completed"
    loiter = setup.route.rtl_loiter
    assert loiter is not None
    assert math.dist(done.track.position[-1, :2], loiter[:2]) > RTL_ARRIVAL_RADIUS_M
    verdict = judge_flight(setup, done.track, done.ended)
    assert of(verdict, "return").ok
    assert verdict.complete, verdict.lines


@pytest.mark.parametrize(
    ("seconds", "radius", "arrived"),
    [(0.0, 0.0, True), (-30.0, 0.0, False), (-70.0, 500.0, False), (-50.0, 500.0, False)],
)
def test_an_imported_return_has_circled_at_its_height(seconds: float, radius: float, arrived: bool) -> None:
    # Of an imported flight nobody knows how it ended but by its rows.  Around 500 m it flies for two minutes and more.
    setup = by_arduplane(setup_of(*WAY, home=HOME), RTL_RADIUS=radius)
    done = fly_to_end(Flight(setup, load_aircraft("aerosonde")))
    rows = done.track.rows(0, len(done.track) + round(seconds / float(done.track.time[1] - done.track.time[0])))
    requirements = route_requirements(setup)
    aligned = align_track(requirements, rows)
    assert aligned is not None
    assert (return_loiter_reach(setup.route, aligned.track) is not None) is arrived
    imported = replace(setup, imported_log=ImportedLog("a.BIN", "", ""))
    found = return_findings(route_requirements(imported), aligned)
    assert [one.ok for one in found] == [True if arrived else None]
    assert ("the flight did not reach its end" in found[0].reason) is not arrived


BEHIND_THE_HILL = (wp(0, 500, 600), wp(4500, 500, 600))
UNLIMITED = wp(4500, 500, 600, command=17)


def behind_a_hill(*lines: str, summit: float = 450.0, **parameters: float) -> FlightSetup:
    """A mission over a hill half way: a return sinks evenly to RTL_ALTITUDE, 100 m over home at 100 m."""
    hill = Peak(2250.0, 250.0, summit, 300.0)
    ground = make_peaks_terrain(np.array([[-6000.0, 6000.0], [-6000.0, 6000.0]]), [hill], 100.0)
    setup = by_arduplane(setup_of(*lines, home="36.5 -84.2 0"), **{"RTL_ALTITUDE": 100.0, **parameters})
    return setup.in_scenario(replace(setup.scenario, terrain=ground))


@pytest.mark.parametrize(
    ("lines", "parameters", "ok"),
    [
        (BEHIND_THE_HILL, {}, False),
        (BEHIND_THE_HILL, {"RTL_ALTITUDE": 600.0}, True),
        ((BEHIND_THE_HILL[0], wp(4500, 500, 600, command=19)), {}, False),  # a loiter by time ends, too
        ((BEHIND_THE_HILL[0], UNLIMITED), {}, None),
    ],
)
def test_the_return_after_the_last_item_counts_as_an_items(
    lines: tuple[str, ...], parameters: dict[str, float], ok: bool | None
) -> None:
    """`Plane::exit_mission_callback`: at 4.5 km from home 600 m, at home 100 m, so at the summit 350 m of 450 m."""
    setup = behind_a_hill(*lines, **parameters)
    for verdict in (judge_geometry(setup), flown(setup)[0]):
        found = [item for item in verdict.findings if item.rule == "return"]
        assert [item.ok for item in found] == ([] if ok is None else [ok])
        assert verdict.flyable is not (ok is False), verdict.lines
        assert ok is not False or "return after the last item (hits the ground)" in verdict.headline
        # A loiter by time has a time, which an unlimited loiter could not keep.
        is_mended = ok is False and lines == BEHIND_THE_HILL
        offered = [change.what for item in found for one in item.suggestions for change in one]
        assert offered == (["end loiter"] if is_mended else [])


def test_the_return_of_a_mission_without_home_is_not_judged_and_the_first_line_says_so() -> None:
    """As without elevation data: flyable, a line that says why, and a skipped case."""
    setup = behind_a_hill(*BEHIND_THE_HILL)
    homeless = replace(setup, mission=replace(setup.mission, home=None))
    reason = "ArduPlane returns to home by itself after the last item, but the mission has no home"
    for verdict in (judge_geometry(homeless), flown(homeless)[0]):
        assert (verdict.flyable, verdict.undecided) == (True, False)
        assert verdict.headline.startswith("flyable; return not judged")
        assert f"Not judged: return ({reason})" in verdict.lines
        assert (of(verdict, "return").ok, of(verdict, "return").reason) == (None, reason)
        assert f'<skipped message="not judged: {reason}" />' in verdict.to_junit("a")
    # Where ArduPlane does not return by itself, there is nothing to say.
    endless = behind_a_hill(BEHIND_THE_HILL[0], UNLIMITED)
    assert judge_geometry(replace(endless, mission=replace(endless.mission, home=None))).headline == "flyable"


@pytest.mark.parametrize(
    ("east", "above", "judged"),
    [(0.0, 0.0, False), (0.0, 1.0, False), (6.0, -8.0, False), (6.0, 9.0, True), (0.0, 30.0, True)],
)
def test_a_mission_that_ends_within_10_m_of_its_scenarios_destination_is_judged_up_to_there(
    east: float, above: float, judged: bool
) -> None:
    # sqrt(6^2 + 8^2) is 10 m, as FINAL_WAYPOINT_TOLERANCE_M, and sqrt(6^2 + 9^2) 10.8 m.
    setup = behind_a_hill(*BEHIND_THE_HILL)
    destination = setup.route.positions[-1] - np.array([east, 0.0, above])
    scenario = replace(setup.scenario, external=False, destination=destination)
    verdict = judge_geometry(setup.in_scenario(scenario))
    found = [item for item in verdict.findings if item.rule == "return"]
    unjudged = [line for line in verdict.lines if line.startswith("Not judged: return")]
    if judged:
        distance = f"{math.hypot(east, above):.1f} m from it, and at most 10 m are allowed"
        assert [item.ok for item in found] == [False]
        assert distance in found[0].reason
        assert found[0].reason.endswith("A landing or NAV_LOITER_UNLIM at the end of the mission prevents this return")
        assert not unjudged
    else:
        assert not found
        ends = "the mission ends at the scenario's destination; ArduPlane then returns to launch"
        assert unjudged == [f"Not judged: return ({ends})"]


@pytest.mark.parametrize("last", [UNLIMITED, RTL])
def test_a_mission_without_a_return_of_arduplanes_own_says_nothing_of_it(last: str) -> None:
    setup = behind_a_hill(BEHIND_THE_HILL[0], last, RTL_ALTITUDE=600.0)
    scenario = replace(setup.scenario, external=False, destination=setup.route.positions[-1])
    assert not [line for line in judge_geometry(setup.in_scenario(scenario)).lines if "Not judged: return" in line]


def test_the_return_after_the_last_item_needs_its_energy() -> None:
    setup = behind_a_hill(*BEHIND_THE_HILL, RTL_ALTITUDE=600.0)
    needed = of(judge_geometry(setup), "energy").planned
    assert needed is not None
    # The mission leaves 30 %; the return is as long again.
    verdict = judge_geometry(replace(setup, battery=needed / 0.7))
    assert of(verdict, "energy").ok
    assert "uses more energy than allowed" in of(verdict, "return").reason
    assert not verdict.flyable
