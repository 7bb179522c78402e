"""The radio link along a path: outages by the arithmetic of free space, hills, and the loss of the link."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Home
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_scenario, make_setup
from world.frames import GeoOrigin
from world.radio import make_link
from world.scenario_tables import LinkTable

WAY = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]
# Free space takes 104.48 dB over 4 km at 1 GHz; 20 dBm + 94.48 dBm - 10 dB are left.  From an antenna of 500 m the
# aircraft at 300 m is 4 km away where it is sqrt(4000^2 - 200^2) = 3995 m north; 25 m/s take 80.2 s from there.
FOUR_KILOMETRES = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -94.48, "antenna_m": 500.0}
OUTAGE_S = (6000.0 - 3995.0) / 25.0


def linked(setup: FlightSetup, **entries: Any) -> FlightSetup:
    table = LinkTable(**{**FOUR_KILOMETRES, "east_m": 0.0, "north_m": 0.0, **entries})
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), setup.scenario.terrain)
    return replace(setup, scenario=replace(setup.scenario, link=link))


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
    assert "behind the terrain" in item.reason


def test_unknown_ground_and_missing_terrain_leave_it_open() -> None:
    setup = linked(make_setup(WAY))
    without = replace(setup, scenario=replace(setup.scenario, terrain=None))
    item = of(judge_geometry(without), "link")
    assert (item.ok, item.reason) == (None, "no terrain was given")
    track = fly_path(setup)
    far = edited(track, position=track.position + np.array([0.0, 90_000.0, 0.0]))
    assert of(judge(linked(setup, max_outage_s=3600.0), far), "link").ok is None


def test_a_lost_station_that_ends_the_mission_is_not_accepted() -> None:
    """FS_GCS_ENABL 1 with FS_LONG_ACTN 1 returns after 5 s: an outage that the scenario accepts ends the mission."""
    text = "FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n"
    setup = linked(make_setup(WAY), max_outage_s=600.0)
    home = replace(setup.mission, home=Home(46.0, 8.0, 0.0))
    plane = ArduPlane(ArduPilotParameters.of_text(text, "mine.param"))
    failing = of(judge_geometry(replace(setup, mission=home, autopilot=plane)), "link")
    assert (failing.ok, failing.limit) == (False, 5.0)
    assert "then returns (FS_LONG_ACTN 1): " in failing.reason
    patient = ArduPlane(ArduPilotParameters.defaults())
    passing = of(judge_geometry(replace(setup, mission=home, autopilot=patient)), "link")
    assert passing.ok is True
    assert "continues its mission without the link" in passing.reason


def test_a_lost_station_lets_px4_return_by_its_own_parameters() -> None:
    """NAV_DLL_ACT 2 returns at RTL_RETURN_ALT or the height of the flight, 300 m; 0, PX4's default, does nothing."""
    setup = linked(make_setup(WAY), max_outage_s=600.0)
    mission = replace(setup.mission, home=Home(46.0, 8.0, 0.0))
    for action, ok, said in (
        (2.0, False, "; PX4 then returns (NAV_DLL_ACT 2): all "),
        (3.0, False, "; PX4 then leaves the mission (NAV_DLL_ACT 3)"),
        (0.0, True, "; PX4 continues its mission without the link"),
    ):
        px4 = Px4(Px4Parameters.defaults().changed(NAV_DLL_ACT=action, FW_AIRSPD_TRIM=25.0, FW_AIRSPD_MAX=30.0))
        finding = of(judge_geometry(replace(setup, mission=mission, autopilot=px4)), "link")
        assert finding.ok is ok
        assert said in finding.reason


def test_a_station_without_a_position_is_at_home() -> None:
    setup = make_setup(WAY)
    table = LinkTable(**FOUR_KILOMETRES)
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), None)
    setup = replace(setup, scenario=replace(setup.scenario, link=link))
    nowhere = replace(setup, mission=replace(setup.mission, home=None))
    assert of(judge_geometry(nowhere), "link").ok is None
    at_home = replace(setup, mission=replace(setup.mission, home=Home(46.0, 8.0, 0.0)))
    item = of(judge_geometry(at_home), "link")
    assert item.planned == pytest.approx(OUTAGE_S, abs=0.3)
    assert not math.isnan(item.planned or math.nan)
