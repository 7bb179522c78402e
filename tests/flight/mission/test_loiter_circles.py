"""Loiters: where a route joins a circle, goes around and leaves, by geometry and by flight."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.catalog import load_aircraft
from flight.guidance.path import fly_by_path
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.mission.loiter_circles import LoiterRules
from flight.mission.route import Route, RouteRules, make_route
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.views.replay.timeline import timeline
from tests.mission_lines import ORIGIN, ground, refusal, route, setup_of, wp
from tests.sampled_paths import sample_path
from tests.soak import scaled
from world.frames import to_map
from world.geometry import leg_slopes, signed_turns
from world.scenario_tables import MAP_EXTENT

TURN = 2.0 * math.pi


def circled(flown: Route, item: int) -> tuple[float, float]:
    """Signed angle (turns) that a route goes around at an item's corners, and their radius."""
    turns = np.zeros(len(flown.positions))
    turns[1:-1] = signed_turns(flown.positions)
    at = (flown.items == item) & (flown.arc_radii > 0.0)
    assert np.ptp(flown.arc_radii[at]) == 0.0
    return float(turns[at].sum()) / TURN, float(flown.arc_radii[at][0])


@settings(max_examples=scaled(60, 12), deadline=None)
@given(
    st.floats(-4000, 4000),
    st.floats(-4000, 4000),
    st.floats(-math.pi, math.pi),
    st.floats(400, 5000),
    st.floats(15, 350),
    st.booleans(),
    st.sampled_from([0.0, 0.5, 1.0, 2.0, 3.7]),
)
def test_the_path_is_the_circle(
    east: float, north: float, course: float, away: float, radius: float, left: bool, turns: float
) -> None:
    """Drawn from the corners: at least the turns asked for, at the radius, joined and left on tangents."""
    out_e, out_n = east + away * math.sin(course), north + away * math.cos(course)
    signed = -radius if left else radius
    flown = route(wp(0, 9000), wp(east, north, command=18, p=f"{turns} 0 {signed} 0"), wp(out_e, out_n))
    around, arc = circled(flown, 2)
    assert math.copysign(1.0, around) == math.copysign(1.0, signed)
    # Whole turns beyond one, as ArduPlane stores them.
    turns = turns if turns < 1.0 else math.floor(turns)
    assert turns - 1e-6 <= abs(around) < turns + 1.0 + 1e-6
    assert arc == pytest.approx(radius)
    corners = flown.positions[flown.items == 2, :2]
    step = abs(around) * TURN / len(corners)
    assert step <= math.pi / 4.0 + 1e-6
    middle = np.array([float(v) for v in to_map(ORIGIN, *place_of(east, north))])
    # A polygon around the circle: its corners are as far out as its angle says, its sides touch.
    distances = np.hypot(*(corners - middle).T)
    assert distances == pytest.approx(np.full(len(corners), radius / math.cos(step / 2.0)), abs=0.05)
    setup = replace(FLAT, route=flown)
    drawn = sample_path(fly_by_path(flown, setup.limits), 5.0)[:, :2]
    near = np.hypot(*(drawn - middle).T)
    # No point of the path is inside the circle, and the arcs lie on it.
    assert near.min() > radius - 0.05
    assert (np.abs(near - radius) < 0.05).sum() >= int(abs(around) * TURN * radius / 5.0) - 2


def place_of(east: float, north: float) -> tuple[float, float]:
    _, _, _, _, _, _, lat, lon, _ = wp(east, north).split()
    return float(lat), float(lon)


FLAT = setup_of(wp(0, 0), wp(0, 2000))


def test_loiters_last_as_long_as_asked() -> None:
    timed = route(wp(0, 0), wp(0, 2000, command=19, p="90 0 200 0"), wp(3000, 2000))
    assert 90.0 <= abs(circled(timed, 2)[0]) * TURN * 200.0 / 25.0 < 90.0 + TURN * 200.0 / 25.0
    endless = route(wp(0, 0), wp(0, 2000, command=17, p="0 0 -150 0"), wp(3000, 2000))
    assert endless.items[-1] == 2
    assert circled(endless, 2)[0] * TURN * -150.0 == pytest.approx(ENDLESS_LOITER_TIME_S * 25.0)
    assert any(
        "item 2: NAV_LOITER_UNLIM is flown for 60 s and at least one lap; the mission ends" in note
        for note in endless.notes
    )
    assert any("item 3: never reached" in note for note in endless.notes)
    # A minute is 0.6 laps of this circle, and the aircraft meets the wind from every side.
    wide = route(wp(0, 0), wp(0, 2000, command=17, p="0 0 400 0"))
    assert circled(wide, 2)[0] == pytest.approx(1.0)


def test_loiter_to_altitude_spirals_within_the_envelope() -> None:
    flown = setup_of(wp(0, 0), wp(0, 1500, 600, command=31, p="1 150 0 0"), wp(3000, 1500, 600)).route
    at = flown.items == 2
    assert flown.positions[at, 2][-1] == pytest.approx(900.0, abs=0.01)
    assert (np.diff(flown.positions[:, 2]) >= -1e-9).all()
    # 500 m at 60 % of what the aircraft climbs (13.7 degrees at 25 m/s and 500 m, less at 900 m).
    assert 5.0 < math.degrees(leg_slopes(flown.positions).max()) < 0.6 * 13.7
    down = setup_of(wp(0, 0, 700), wp(0, 1500, 100, command=31, p="1 -150 0 0"), wp(3000, 1500, 100)).route
    assert math.degrees(leg_slopes(down.positions).min()) > -0.6 * 7.8
    assert circled(down, 2)[0] < -1.0


def test_a_loiter_without_a_radius_has_the_aircrafts_own() -> None:
    """R = 625 / (9.80665 tan 30) = 110.39 m in calm air; a tenth over it in whole tens of metres is 130 m."""
    lines = (wp(0, 0), wp(0, 2000, command=18, p="1 0 0 0"), wp(3000, 2000))
    assert circled(setup_of(*lines).route, 2)[1] == 130.0
    assert "item 2: the loiter has no radius, so a radius of 130 m is used" in setup_of(*lines).route.notes
    # (25 + 8)^2 / (9.80665 tan 30) = 192.3 m downwind.
    assert circled(setup_of(*lines, wind={"speed_mps": 8.0, "from_deg": 0.0}).route, 2)[1] == 220.0


def test_stops_inside_a_circle_are_left_out() -> None:
    over = route(wp(0, 0), wp(0, 2000), wp(0, 2000, command=18, p="1 0 120 0"), wp(10, 1990), wp(3000, 2000))
    assert list(dict.fromkeys(over.items.tolist())) == [1, 3, 5]
    assert [note.split(":")[0] for note in over.notes] == ["items 2, 4"]
    start = route(wp(0, 0), wp(0, 0, command=18, p="1 0 120 0"), wp(3000, 2000))
    assert "the flight starts in the air, trimmed, on the loiter of item 2" in start.started
    assert math.hypot(*start.positions[0, :2]) == pytest.approx(120.0, abs=0.1)
    two = route(wp(0, 0), wp(0, 2000, command=18, p="1 0 120 0"), wp(0, 2050, command=19, p="30 0 -100 0"), wp(3000, 0))
    assert any("item 3: no tangent joins its circle" in note for note in two.notes)
    assert circled(two, 3)[1] == 120.0
    here = route(wp(0, 0), wp(0, 2000), "2 18 1 0 120 0 0 0 0", wp(3000, 2000))
    assert list(dict.fromkeys(here.items.tolist())) == [1, 3, 4]
    assert (here.positions[here.items == 3, 2] == 400.0).all()


def test_a_jump_back_to_a_loiter_flies_it_again() -> None:
    flown = route(wp(0, 0), wp(0, 2000, command=18, p="1 0 150 0"), wp(3000, 2000), "2 177 2 1 0 0 0 0 0")
    assert circled(flown, 2)[0] > 2.0


def test_circles_too_wide_or_too_long_are_refused() -> None:
    assert "item 2: loiter radius 30000 m" in refusal(wp(0, 0), wp(0, 2000, command=18, p="1 0 30000 0"))
    assert "turns to loiter" in refusal(wp(0, 0), wp(0, 2000, command=19, p="3e38 0 100 0"))
    # Turns are at most 255, of eight corners each.
    many = [wp(0, 2000 * k, command=18, p="255 0 100 0") for k in range(1, 7)]
    assert "more than 10,000 waypoints" in refusal(wp(0, 0), *many)
    assert MAP_EXTENT > 30_000.0


@pytest.fixture(scope="module")
def flight() -> tuple[FlightSetup, Any]:
    setup = setup_of(
        wp(-1500, -2000),
        wp(-1500, 0, command=18, p="2 0 150 0"),
        wp(0, 1500, 140, command=19, p="20 0 -160 0"),
        "2 178 0 22 -1 0 0 0 0",
        wp(1500, 0, 260, command=31, p="1 0 0 0"),
        wp(1500, -1500, 260),
        wp(0, -1500, 260, command=17, p="0 0 140 0"),
    )
    return setup, fly_to_end(Flight(setup, load_aircraft("aerosonde")))


def test_every_kind_of_loiter_is_flown(flight: tuple[FlightSetup, Any]) -> None:
    setup, flown = flight
    assert flown.ended == "completed"
    verdict = judge_flight(setup, flown.track, flown.ended)
    assert verdict.flyable, verdict.summary
    loiters = [item for item in verdict.findings if item.rule == "loiter"]
    assert [item.place.item for item in loiters] == [2, 3, 5, 7]
    for finding in loiters:
        assert finding.planned is not None
        assert finding.flown == pytest.approx(finding.planned, abs=1.0)
        assert finding.margin is not None
        assert finding.margin > 0.0
    assert not any(item.rule in ("turn", "waypoint") and item.place.item == 2 for item in verdict.findings)
    # By the track alone: metres from the first circle's middle, and the angle flown around it.
    middle = np.array([-1500.0, 0.0])
    off = flown.track.position[:, :2] - middle
    on = np.abs(np.hypot(*off.T) - 150.0) < 1.0
    angle = np.unwrap(np.arctan2(off[on, 0], off[on, 1]))
    assert angle[-1] - angle[0] >= 2.0 * TURN - 0.1
    assert judge_geometry(setup).flyable


def test_a_circle_tighter_than_the_wind_allows_fails() -> None:
    """25 m/s + 6 m/s: R = 961 / (9.80665 tan 30) = 169.7 m downwind, so 140 m is no circle, and 111 m in calm is."""
    lines = (wp(0, -2500), wp(0, 0, command=18, p="1 0 140 0"), wp(2500, 0))
    assert judge_geometry(setup_of(*lines)).flyable
    windy = setup_of(*lines, wind={"speed_mps": 6.0, "from_deg": 250.0})
    verdict = judge_geometry(windy)
    assert not verdict.flyable
    (loiter,) = [item for item in verdict.findings if item.rule == "loiter"]
    assert loiter.limit == pytest.approx(169.7, abs=0.5)
    assert "needs 170 m in this wind" in loiter.reason
    flown = fly_to_end(Flight(windy, load_aircraft("aerosonde")))
    assert not judge_flight(windy, flown.track, flown.ended).flyable


def test_a_loiter_cut_short_is_not_complete(flight: tuple[FlightSetup, Any]) -> None:
    setup, flown = flight
    half = flown.track.rows(0, len(flown.track) // 4)
    verdict = judge_flight(setup, half, "completed")
    assert not verdict.flyable
    assert not any(item.ok for item in verdict.findings if item.rule == "loiter")


def test_loiters_over_terrain_have_the_height_of_their_middle() -> None:
    flown = route(wp(0, 0), wp(0, 2000, 250, command=18, frame=10, p="1 0 150 0"), wp(2500, 0), terrain=ground(320.0))
    assert (flown.positions[flown.items == 2, 2] == 570.0).all()


def test_a_replay_tells_a_loiter_in_one_line(flight: tuple[FlightSetup, Any], tmp_path: Path) -> None:
    setup, flown = flight
    with Recorder(tmp_path / "a.mcap", setup) as recorder:
        recorder.write(flown.track)
        recorder.finish(flown.ended, judge_flight(setup, flown.track, flown.ended))
    log = read_log(tmp_path / "a.mcap")
    assert (log.setup.route.arc_radii == setup.route.arc_radii).all()
    texts = [entry.text for entry in timeline(log) if entry.kind == "leg"]
    around = [text for text in texts if text.startswith("loiter of item")]
    assert [text.split(":")[0] for text in around] == [f"loiter of item {item}" for item in (2, 3, 7)]
    # Item 5 has its height on the way in and is left at once, on one arc.
    assert len(texts) < 14
    lowest = [entry.text for entry in timeline(log) if entry.kind == "ground"]
    assert len(lowest) == len(texts)


def laid_for(rules: LoiterRules, *lines: str) -> Route:
    made = setup_of(*lines)
    return make_route(
        made.mission, ORIGIN, made.scenario.terrain, 25.0, False, made.limits, rules=RouteRules(loiters=rules)
    )


def test_a_loiter_without_a_radius_has_that_of_the_autopilots_parameter() -> None:
    lines = wp(0, -1500), wp(0, 0, 100, 19, p="60 0 0 0"), wp(1500, 1500)
    left = laid_for(LoiterRules(radius=-130.0, radius_name="NAV_LOITER_RAD"), *lines)
    turns, radius = circled(left, 2)
    assert turns < -1.0
    assert radius == 130.0
    assert "item 2: the loiter has no radius, so NAV_LOITER_RAD (130 m to the left) is used" in left.notes
    stated = laid_for(LoiterRules(radius=-130.0), wp(0, -1500), wp(0, 0, 100, 19, p="60 0 200 0"), wp(1500, 1500))
    assert circled(stated, 2)[1] == 200.0


def test_the_way_to_a_loiter_to_a_height_is_level_where_the_height_is_held() -> None:
    lines = wp(0, -1500), wp(0, 0, 250, 31, p="0 200 0 0"), wp(1500, 1500, 250)
    held = laid_for(LoiterRules(holds_height=True, max_climb_rate=2.5, altitude_tolerance=10.0), *lines)
    corners = held.positions[held.items == 2, 2]
    assert (corners[0], corners[-1]) == (400.0, 550.0)
    # 140 m at 2.5 m/s and 25 m/s are 1,400 m, 1.11 of its circles.
    assert 1.11 < circled(held, 2)[0] < 2.25
    assert laid_for(LoiterRules(), *lines).positions[1, 2] > 480.0


def test_a_circle_left_when_its_time_is_over_is_drawn_no_longer() -> None:
    lines = wp(0, -1500), wp(0, 0, 100, 19, p="60 0 150 0"), wp(1500, 1500)
    # 60 s at 25 m/s are 1.59 circles of 150 m.
    assert 0.59 < circled(laid_for(LoiterRules(steers_to_center=True), *lines), 2)[0] < 1.59
    assert 1.59 < circled(laid_for(LoiterRules(), *lines), 2)[0] < 2.59


def test_what_comes_after_the_last_waypoint_is_said() -> None:
    rules = LoiterRules(80.0, "NAV_LOITER_RAD", ends_in_circle=True)
    note = (
        "item 2: after the last waypoint the aircraft loiters around it indefinitely, with NAV_LOITER_RAD, 80 m;"
        " one lap is simulated"
    )
    assert any(line.startswith(note) for line in laid_for(rules, wp(0, -1500), wp(0, 0)).notes)
    for last in (wp(0, 0, command=17, p="0 0 150 0"), "3 20 0 0 0 0 0 0 0", wp(0, 0, command=21)):
        assert not any("indefinitely" in line for line in laid_for(rules, wp(0, -1500), wp(900, -1500), last).notes)
    assert not any("indefinitely" in line for line in laid_for(LoiterRules(), wp(0, -1500), wp(0, 0)).notes)


def test_a_circle_that_is_left_heading_for_what_follows_is_drawn_as_it_is_flown() -> None:
    """Its turns count from where it turns away from the middle, a quarter of a circle before the tangent's place."""
    onward = {"ahead": wp(0, 1500), "beside": wp(1500, 0), "back": wp(100, -1500)}
    rules = LoiterRules(steers_to_center=True, exits_on_heading=True)
    for where, parts in (("ahead", 0.0), ("beside", 0.25), ("back", 0.5)):
        for turns in (1, 3):
            lines = wp(0, -1500), wp(0, 0, 100, 18, p=f"{turns} 0 150 0"), onward[where]
            around, _ = circled(laid_for(rules, *lines), 2)
            assert around == pytest.approx(turns + parts, abs=0.07)
    # Ten degrees before a whole number of turns is enough.
    lines = wp(0, -1500), wp(0, 0, 100, 18, p="2 0 150 0"), wp(-200, 1500)
    assert circled(laid_for(rules, *lines), 2)[0] == pytest.approx(1.98, abs=0.04)


def test_a_circle_tighter_than_the_aircraft_turns_is_gone_around_less_often() -> None:
    lines = wp(0, -1500), wp(0, 0, 100, 19, p="120 0 30 0"), wp(1500, 1500)
    # 120 s at 25 m/s are 15.9 circles of 30 m, and 3.7 of the 130 m that the aircraft flies on its own.
    assert 3.0 < circled(laid_for(LoiterRules(steers_to_center=True, exits_on_heading=True), *lines), 2)[0] < 4.5
    assert circled(laid_for(LoiterRules(steers_to_center=True), *lines), 2)[0] > 14.0


def test_a_radius_is_what_the_autopilot_reads_of_it_and_grows_with_height() -> None:
    rules = LoiterRules(
        radius=60.0,
        radius_name="WP_LOITER_RAD",
        radius_of=lambda one: 0.0 if one.seconds else 200.0,
        radius_scale=lambda up: 1.0 + up / 1000.0,
    )
    unread = "its radius of 150 m is ignored, so WP_LOITER_RAD ({} is used"
    # 100 m above home's 300 m: 1.4 times as wide.
    for loiter, radius, note in (
        (wp(0, 0, 100, 19, p="60 0 -150 0"), -84.0, unread.format("60 m to the left)")),
        (wp(0, 0, 100, 19, p="60 0 150 0"), 84.0, unread.format("60 m)")),
        (
            wp(0, 0, 100, 18, p="2 0 207 0"),
            280.0,
            "the loiter radius of 207 m is flown as 280 m, because the autopilot enlarges it with altitude",
        ),
    ):
        made = laid_for(rules, wp(0, -1500), loiter, wp(1500, 1500))
        turns, arc = circled(made, 2)
        assert math.copysign(arc, turns) == pytest.approx(radius)
        assert f"item 2: {note}" in made.notes
