"""The radio link along a path: outages by the arithmetic of free space, hills, and the loss of the link."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Command, Frame, Home, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.return_starts import flown_starts
from logs.verdict.returns.returns_text import returns_headline
from logs.verdict.rules.link_rule import JudgedLink, duration_text, judge_link
from tests.logs.verdict.judging import judge, of
from tests.logs.verdict.rules.flown_circuits import flown_circuit
from tests.synthetic import edited, fly_path, make_scenario, make_setup
from world.frames import GeoOrigin
from world.radio import make_link
from world.scenario_tables import LinkTable
from world.terrain import make_gridded_terrain

WAY = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]
# Free space takes 104.48 dB over 4 km at 1 GHz; 20 dBm + 94.48 dBm - 10 dB are left.  From an antenna of 500 m the
# aircraft at 300 m is 4 km away where it is sqrt(4000^2 - 200^2) = 3995 m north; 25 m/s take 80.2 s from there.
FOUR_KILOMETRES = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -94.48, "antenna_m": 500.0}
OUTAGE_S = (6000.0 - 3995.0) / 25.0


def linked(setup: FlightSetup, **entries: Any) -> FlightSetup:
    table = LinkTable(**{**FOUR_KILOMETRES, "east_m": 0.0, "north_m": 0.0, **entries})
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), setup.scenario.terrain)
    return replace(setup, scenario=replace(setup.scenario, link=link))


def with_home(setup: FlightSetup, autopilot: Autopilot) -> FlightSetup:
    return replace(setup, mission=replace(setup.mission, home=Home(46.0, 8.0, 0.0)), autopilot=autopilot)


def arduplane(text: str) -> ArduPlane:
    return ArduPlane(ArduPilotParameters.from_text(text, "mine.param"))


def test_a_scenario_without_a_link_has_no_finding() -> None:
    assert not [item for item in judge_geometry(make_setup(WAY)).findings if item.rule == "link"]


@pytest.mark.parametrize(("accepted", "ok"), [(0.0, False), (OUTAGE_S - 1.0, False), (OUTAGE_S + 1.0, True)])
def test_an_outage_is_as_long_as_the_leg_beyond_the_range(accepted: float, ok: bool) -> None:
    setup = linked(make_setup(WAY), max_outage_s=accepted)
    item = of(judge_geometry(setup), "link")
    assert item.ok is ok
    assert item.planned == pytest.approx(OUTAGE_S, abs=0.3)
    assert item.limit == pytest.approx(accepted)
    facts = {fact.what: fact.value for fact in item.facts}
    # At its end it is 6003.3 m away: 20 log(6003.3 / 4000) = 3.53 dB too far.
    assert facts["smallest margin left after the fade margin"] == pytest.approx(-3.53, abs=0.02)
    assert facts["greatest distance from the station"] == pytest.approx(6003.3, abs=0.1)
    flown = of(judge(setup, fly_path(setup)), "link")
    assert flown.ok is ok
    assert flown.flown == pytest.approx(OUTAGE_S, abs=1.0)


def test_the_place_is_the_leg_and_the_position_of_the_least_margin() -> None:
    """The station stands at the end: the start, on leg 0, is the furthest."""
    setup = linked(make_setup(WAY), north_m=6000.0)
    for item in (of(judge_geometry(setup), "link"), of(judge(setup, fly_path(setup)), "link")):
        assert item.place == FLIGHT
        assert "the link margin is up to 3.5 dB below the required fade margin" in item.reason
        assert "It is lowest on leg 0 (to item 1) at 0 s (east 0 m, north 0 m, 6.0 km from the station" in item.reason
    assert "on leg 1 (to item 2) at 240 s" in of(judge_geometry(linked(make_setup(WAY))), "link").reason


def test_within_range_the_link_is_ok() -> None:
    setup = linked(make_setup([[0, 0, 300], [0, 3000, 300]]))
    item = of(judge_geometry(setup), "link")
    assert (item.ok, item.planned) == (True, 0.0)
    assert "in line of sight" in item.reason


def test_a_hill_interrupts_the_link() -> None:
    """A ridge of 800 m at 2 km takes more than 20 dB from an antenna of 3 m; without it 1.4 dB are left at 3.4 km."""
    peaks = {"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 2000.0, "height_m": 800.0, "sigma_m": 150.0}]}
    way = [[0, 0, 900], [0, 3300, 900]]
    clear = linked(make_setup(way), antenna_m=3.0)
    hidden = linked(make_setup(way, scenario=make_scenario(way, terrain=peaks)), antenna_m=3.0)
    assert of(judge_geometry(clear), "link").ok is True
    item = of(judge_geometry(hidden), "link")
    assert item.ok is False
    lost = re.search(r"behind the terrain, (.*) dB lost by diffraction", item.reason)
    assert lost is not None
    assert float(lost[1]) > 20.0


def test_an_outage_of_one_moment_is_an_outage() -> None:
    """A track that stands still in time, or a path so short that it lasts less than a second, is not lost for 0 s."""
    setup = linked(make_setup(WAY), sensitivity_dbm=0.0, power_dbm=-30.0)
    track = fly_path(setup)
    short = track.rows(0, 2)
    assert short.time[-1] - short.time[0] < 1.0
    requirements = route_requirements(setup)
    item = of_link(setup, short)
    assert (item.finding.ok, item.finding.limit) == (False, 0.0)
    assert f"below the required fade margin for {short.time[-1] - short.time[0]:.1f} s" in item.finding.reason
    assert requirements.legs == 2


def of_link(setup: FlightSetup, track: Any) -> JudgedLink:
    """Judge a link along a track of at least two rows."""
    requirements = route_requirements(setup)
    assert setup.scenario.link is not None
    return judge_link(requirements, align_track(requirements, track), setup.scenario.link)


def judge_link_flown(setup: FlightSetup) -> JudgedLink:
    return of_link(setup, fly_path(setup))


# ----------------------------------------------------------------------
# What is unknown.


def test_unknown_ground_and_missing_terrain_leave_it_open() -> None:
    setup = linked(make_setup(WAY))
    without = replace(setup, scenario=replace(setup.scenario, terrain=None))
    item = of(judge_geometry(without), "link")
    assert (item.ok, item.reason) == (None, "no terrain was given")
    track = fly_path(setup)
    far = edited(track, position=track.position + np.array([0.0, 90_000.0, 0.0]))
    assert of(judge(linked(setup, max_outage_s=3600.0), far), "link").ok is None


def test_a_track_that_leaves_the_terrain_is_judged_up_to_there() -> None:
    """Beyond the terrain nothing is known; before it the link is kept, or lost for longer than accepted."""
    setup = linked(make_setup(WAY), sensitivity_dbm=-150.0)
    track = fly_path(setup)
    north = np.where(track.position[:, 1] > 5000.0, 90_000.0, track.position[:, 1])
    leaving = edited(track, position=np.column_stack([track.position[:, 0], north, track.position[:, 2]]))
    kept = of(judge(setup, leaving), "link")
    assert kept.ok is None
    assert "Elsewhere the terrain below the radio path is unknown" in kept.reason
    assert of(judge(linked(setup), leaving), "link").ok is False


def test_a_station_without_a_position_is_at_home() -> None:
    setup = make_setup(WAY)
    link = make_link(LinkTable(**FOUR_KILOMETRES), "mine.toml", GeoOrigin(46.0, 8.0), None)
    setup = replace(setup, scenario=replace(setup.scenario, link=link))
    nowhere = replace(setup, mission=replace(setup.mission, home=None))
    item = of(judge_geometry(nowhere), "link")
    assert (item.ok, item.reason) == (None, "neither the station's position nor a home is known")
    at_home = replace(setup, mission=replace(setup.mission, home=Home(46.0, 8.0, 0.0)))
    item = of(judge_geometry(at_home), "link")
    assert item.planned == pytest.approx(OUTAGE_S, abs=0.3)
    assert not math.isnan(item.planned or math.nan)
    beyond = replace(setup, mission=replace(setup.mission, home=Home(46.9, 8.0, 0.0)))
    item = of(judge_geometry(beyond), "link")
    assert (item.ok, item.reason) == (None, "the ground at the station is unknown")


# ----------------------------------------------------------------------
# Reactions of the autopilot.


@pytest.mark.parametrize(
    ("autopilot", "use", "limit", "texts"),
    [
        (
            arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"),
            "telemetry",
            5.0,
            ["ArduPlane returns after 5 s (FS_LONG_ACTN 1): "],
        ),
        (
            arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\nFS_LONG_TIMEOUT 60\n"),
            "telemetry",
            60.0,
            ["ArduPlane returns after 60 s (FS_LONG_ACTN 1): "],
        ),
        (
            arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 3\n"),
            "telemetry",
            5.0,
            ["ArduPlane releases its parachute after 5 s (FS_LONG_ACTN 3)"],
        ),
        (
            arduplane("FS_SHORT_ACTN 1\nFS_SHORT_TIMEOUT 2\n"),
            "control",
            2.0,
            [
                "ArduPlane circles where it is after 2 s (FS_SHORT_ACTN 1), then returns after 7 s (FS_SHORT_ACTN 1): ",
            ],
        ),
        (
            Px4(Px4Parameters.defaults().changed(NAV_DLL_ACT=2)),
            "telemetry",
            10.0,
            [
                "PX4 circles where it is after 10 s (COM_FAIL_ACT_T 5), then returns after 15 s (NAV_DLL_ACT 2): ",
                "returns are safe: never lower than",
            ],
        ),
        (
            Px4(Px4Parameters.defaults().changed(NAV_DLL_ACT=3, COM_DL_LOSS_T=30, COM_FAIL_ACT_T=0)),
            "telemetry",
            30.0,
            ["PX4 lands where it is after 30 s (NAV_DLL_ACT 3)"],
        ),
        (Px4(Px4Parameters.defaults()), "control", 0.5, ["then returns after 5.5 s (NAV_RCL_ACT 2): "]),
    ],
    ids=["ArduPlane", "its timeout", "its parachute", "its RC", "PX4", "its landing", "its RC's default"],
)
def test_a_loss_that_ends_the_mission_is_not_accepted(
    autopilot: Autopilot, use: str, limit: float, texts: list[str]
) -> None:
    """The outage of 80 s is accepted by the scenario, but the autopilot leaves its mission in it."""
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0, use=use), autopilot)
    for item in (of(judge_geometry(setup), "link"), of(judge(setup, fly_path(setup)), "link")):
        assert (item.ok, item.limit, item.limit_source) == (False, limit, "autopilot")
        for text in texts:
            assert text in item.reason


@pytest.mark.parametrize(
    ("autopilot", "use", "setting"),
    [
        (ArduPlane(ArduPilotParameters.defaults()), "telemetry", " (FS_GCS_ENABL 0)"),
        (arduplane("FS_GCS_ENABL 1\n"), "telemetry", " (FS_LONG_ACTN 0)"),
        (arduplane("THR_FAILSAFE 0\nFS_LONG_ACTN 1\n"), "control", " (THR_FAILSAFE 0)"),
        (Px4(Px4Parameters.defaults()), "telemetry", " (NAV_DLL_ACT 0)"),
        (Px4(Px4Parameters.defaults().changed(NAV_DLL_ACT=2, COM_DLL_EXCEPT=1)), "telemetry", " (COM_DLL_EXCEPT 1)"),
        (Px4(Px4Parameters.defaults().changed(COM_RC_IN_MODE=4)), "control", " (COM_RC_IN_MODE 4)"),
        (PlanflyGuidance(), "telemetry", ""),
    ],
)
def test_an_autopilot_that_goes_on_is_said_to(autopilot: Autopilot, use: str, setting: str) -> None:
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0, use=use), autopilot)
    item = of(judge_geometry(setup), "link")
    assert (item.ok, item.limit, item.limit_source) == (True, 600.0, "scenario")
    assert item.reason.endswith(f". If the link is lost, {autopilot.title} continues its mission{setting}")


def test_an_outage_that_the_autopilot_does_not_notice_has_no_reaction() -> None:
    autopilot = arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\nFS_LONG_TIMEOUT 120\n")
    item = of(judge_geometry(with_home(linked(make_setup(WAY), max_outage_s=100.0), autopilot)), "link")
    assert (item.ok, item.limit) == (True, 100.0)
    assert "ArduPlane" not in item.reason


def test_without_a_home_a_return_is_not_judged() -> None:
    setup = linked(make_setup(WAY), max_outage_s=600.0)
    setup = replace(setup, autopilot=arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"))
    setup = replace(setup, mission=replace(setup.mission, home=None))
    reason = of(judge_geometry(setup), "link").reason
    assert reason.endswith("returns after 5 s (FS_LONG_ACTN 1): not judged, because the mission has no home")


def test_the_returns_begin_once_the_loss_is_noticed_and_are_judged_as_all_returns_are() -> None:
    """The outage begins at 159.8 s; ArduPlane reacts from 164.8 s on, and the flight ends at 240 s."""
    autopilot = arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n")
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0), autopilot)
    track = fly_path(setup)
    judged = of_link(setup, track)
    assert judged.returns is not None
    start = judged.along.outages[0].start if judged.along is not None else math.nan
    assert start == pytest.approx(3995.0 / 25.0, abs=0.5)
    times = [ret.time for ret in judged.returns.each]
    assert start + 4.0 < times[0] <= start + 5.0
    assert times[-1] == pytest.approx(float(track.time[-1]), abs=1.01)
    # The same seconds of the returns of the whole flight.
    world, starts = make_return_world(setup), flown_starts(setup, track, 1.0)
    every = {ret.time: ret for ret in judge_returns(world, starts, 1.0).each}
    # Compared as texts, in which what is not known equals itself.
    assert [repr(every[time]) for time in times] == [repr(ret) for ret in judged.returns.each]
    assert judged.finding.reason.endswith(returns_headline(judged.returns))


def item_at(seq: int, command: Command, north: float = 0.0) -> MissionItem:
    frame = Frame.MISSION if command == Command.DO_LAND_START else Frame.GLOBAL
    return MissionItem(seq, int(command), int(frame), (0.0,) * 4, 46.0 + north / 111_150.0, 8.0, 300.0)


@pytest.mark.parametrize(
    ("autopilot", "ok"),
    [
        (arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"), True),
        (Px4(Px4Parameters.defaults().changed(NAV_DLL_ACT=2)), False),
    ],
    ids=["ArduPlane", "PX4"],
)
def test_in_a_landing_sequence_arduplane_ignores_the_loss(autopilot: Autopilot, ok: bool) -> None:
    """The leg from 3 to 6 km belongs to the landing sequence; the link is lost from 3995 m on."""
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0), autopilot)
    items = (
        item_at(1, Command.NAV_WAYPOINT),
        item_at(2, Command.NAV_WAYPOINT, 3000.0),
        item_at(3, Command.DO_LAND_START),
        item_at(4, Command.NAV_WAYPOINT, 6000.0),
        item_at(5, Command.NAV_LAND, 6500.0),
    )
    route = setup.route.with_fields(item=[1, 2, 4])
    setup = replace(setup, mission=replace(setup.mission, items=items), route=route)
    assert of(judge_geometry(setup), "link").ok is ok
    flown = judge_link_flown(setup)
    assert (flown.finding.ok, flown.finding.limit) == (ok, 600.0 if ok else 10.0)


@pytest.mark.parametrize(
    ("accepted", "timeout", "limit", "source"),
    [(75.0, 18.0, 75.0, "scenario"), (78.0, 5.0, 5.0, "autopilot"), (600.0, 25.0, 25.0, "autopilot")],
)
def test_an_outage_that_ends_in_a_landing_sequence_counts_up_to_there(
    accepted: float, timeout: float, limit: float, source: str
) -> None:
    """The link is lost from 3995 m on, for 79 s at 25.36 m/s, and noticed up to 4500 m, for 19.9 s.

    The limit that is exceeded by more is stated, or the one that is nearer.
    """
    autopilot = arduplane(f"FS_GCS_ENABL 1\nFS_LONG_ACTN 3\nFS_LONG_TIMEOUT {timeout}\n")
    way = [[0, 0, 300], [0, 4500, 300], [0, 6000, 300]]
    setup = with_home(linked(make_setup(way), max_outage_s=accepted), autopilot)
    items = (
        item_at(1, Command.NAV_WAYPOINT),
        item_at(2, Command.NAV_WAYPOINT, 4500.0),
        item_at(3, Command.DO_LAND_START),
        item_at(4, Command.NAV_WAYPOINT, 6000.0),
    )
    route = setup.route.with_fields(item=[1, 2, 4])
    setup = replace(setup, mission=replace(setup.mission, items=items), route=route)
    item = of(judge_geometry(setup), "link")
    assert (item.limit, item.limit_source) == (limit, source)
    assert item.ok is (accepted == 600.0)


@pytest.mark.parametrize(("duration", "text"), [(0.04, "0.0 s"), (9.94, "9.9 s"), (10.0, "10 s"), (14.4, "14 s")])
def test_a_short_outage_is_stated_to_a_tenth_of_a_second(duration: float, text: str) -> None:
    assert duration_text(duration) == text


@pytest.mark.parametrize(
    ("landing", "ok"), [(3, True), (9, False)], ids=["on the leg to the landing", "on a leg before the landing"]
)
def test_without_a_landing_sequence_only_the_leg_to_the_landing_is_exempt(landing: int, ok: bool) -> None:
    """The link is lost on the leg to item 3, which is the landing, or one of several waypoints before it."""
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0), arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"))
    items = (
        item_at(1, Command.NAV_WAYPOINT),
        item_at(2, Command.NAV_WAYPOINT, 3000.0),
        *([] if landing == 3 else [item_at(3, Command.NAV_WAYPOINT, 6000.0)]),
        item_at(landing, Command.NAV_LAND, 6000.0),
    )
    route = setup.route.with_fields(item=[1, 2, 3])
    setup = replace(setup, mission=replace(setup.mission, items=items), route=route)
    assert of(judge_geometry(setup), "link").ok is ok
    assert judge_link_flown(setup).finding.ok is ok


def test_on_a_return_to_launch_a_loss_changes_nothing() -> None:
    setup = with_home(linked(make_setup(WAY), max_outage_s=600.0), arduplane("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"))
    assert judge_link_flown(setup).finding.ok is False
    returning = replace(setup, route=replace(setup.route, rtl_start=1))
    assert judge_link_flown(returning).finding.ok is True


def test_ground_with_a_hole_leaves_a_kept_link_open() -> None:
    axis = np.arange(-8000.0, 8001.0, 100.0)
    heights = np.zeros((axis.size, axis.size))
    heights[axis.searchsorted(4000.0), axis.searchsorted(0.0)] = np.nan
    ground = make_gridded_terrain(heights, axis, axis, source="hole", sha256="", datum="")
    setup = linked(make_setup(WAY, scenario=make_scenario(WAY, ground=ground)), sensitivity_dbm=-150.0)
    item = of(judge_geometry(setup), "link")
    assert item.ok is None
    assert item.reason.endswith("Elsewhere the terrain below the radio path is unknown")


def test_the_take_off_and_the_landing_are_part_of_the_link() -> None:
    """From a station whose link reaches 60 m, the link is kept only near it: on the rail, or on the strip."""
    flown = flown_circuit()
    approach = flown.setup.ground_phases.approach
    assert approach is not None
    # From the start the link is worst low before the landing point, from the end at the far corner of the circuit.
    for place, worst_leg in ((flown.track.position[0], approach.leg), (flown.track.position[-1], 1)):
        # 60 m at 1 GHz take 68.0 dB.
        setup = linked(
            flown.setup, east_m=float(place[0]), north_m=float(place[1]), antenna_m=3.0, sensitivity_dbm=-58.0
        )
        item = of(judge_flight(setup, flown.track, flown.flight.ended), "link")
        facts = {fact.what: fact.value for fact in item.facts}
        distances = np.linalg.norm(flown.track.position - place - [0.0, 0.0, 3.0], axis=1)
        assert facts["greatest distance from the station"] == pytest.approx(float(distances.max()), abs=30.0)
        assert item.flown == pytest.approx(float(flown.track.time[-1]), abs=20.0)
        assert f". It is lowest on leg {worst_leg} (to item " in item.reason
