"""The verdict on a real autopilot's flights against sums of our own on pymavlink's rows, and the simulator's truth."""

import json
import math
import os
import re
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import Geod

from logs.importers.imported_flight import make_flight
from logs.importers.open_log import open_log
from logs.importers.raw_log import ModeChange, example_raw_log
from planfly.flight_options import LogOptions
from planfly.workflow import imported_flights
from planfly.workflow.imported_flights import ImportedFlight, fly_again, import_flight
from tests.logs.importers.columns.column_files import circle, write_log
from tests.logs.importers.judged_flights import judged
from tests.logs.importers.pymavlink_rows import FLIGHTS, mission_lines, read_rows
from world.arrays import Floats
from world.errors import LogError
from world.scenario import load_scenario

TRUTH: dict[str, Any] = json.loads((FLIGHTS / "truth.json").read_text())
SCENARIOS = {"tight": "tight", "steep": "steep", "ridge-10mps": str(FLIGHTS / "ridge-10mps.toml")}
# The folder of the whole logs, of which the thinned ones here were made.
WHOLE = Path(os.environ.get("PLANFLY_FLIGHTS", Path(__file__).parents[4] / "shared" / "flights"))
# The axes of WGS 84.
A, E2 = 6_378_137.0, 6.69437999014e-3


@pytest.fixture(scope="module")
def flights() -> dict[str, ImportedFlight]:
    return {name: imported(FLIGHTS / f"{name}.BIN", name) for name in TRUTH}


def imported(path: Path, name: str) -> ImportedFlight:
    return import_flight(path, LogOptions(scenario=SCENARIOS[name]))


def flat(lat: Any, lon: Any, lat0: float, lon0: float) -> Floats:
    """East and north of a near place, m, by the radii of the ellipsoid there."""
    w = 1.0 - E2 * math.sin(math.radians(lat0)) ** 2
    north = A * (1.0 - E2) / w**1.5 * np.radians(np.asarray(lat) - lat0)
    east = A / math.sqrt(w) * math.cos(math.radians(lat0)) * np.radians(np.asarray(lon) - lon0)
    return np.stack([east, north], axis=-1)


def off_the_legs(name: str) -> tuple[float, float]:
    """Greatest distance of the flight from the nearest leg, and least height above the ground below it, m."""
    rows = read_rows(FLIGHTS / f"{name}.BIN", "POS")["POS"]
    way = [line for line in mission_lines(FLIGHTS / f"{name}.waypoints")[1:] if line[3] == 16]
    start = TRUTH[name]["free_flight_starts_log_s"]
    rows = [row for row in rows if row.TimeUS * 1e-6 >= start]
    farthest = 0.0
    # From the first waypoint on: what was flown to get there is no leg.
    first = np.argmin([np.hypot(*flat(row.Lat, row.Lng, way[0][8], way[0][9])) for row in rows])
    for row in rows[int(first) :]:
        nearest = math.inf
        for one, two in pairwise(way):
            end, place = (flat(lat, lon, one[8], one[9]) for lat, lon in ((two[8], two[9]), (row.Lat, row.Lng)))
            along = min(1.0, max(0.0, float(place @ end) / float(end @ end)))
            nearest = min(nearest, float(np.hypot(*(place - along * end))))
        farthest = max(farthest, nearest)
    ground = load_scenario(SCENARIOS[name]).terrain
    assert ground is not None
    origin = load_scenario(SCENARIOS[name]).origin
    heights = []
    for row in rows[int(first) :]:
        east, north = flat(row.Lat, row.Lng, origin.lat_deg, origin.lon_deg)
        heights.append(row.Alt - float(ground.height(east, north)))
    return farthest, min(heights)


@pytest.mark.parametrize("name", ["tight", "steep"])
def test_the_verdict_is_within_a_metre_of_sums_of_our_own(flights: dict[str, ImportedFlight], name: str) -> None:
    farthest, lowest = off_the_legs(name)
    found = flights[name].verdict.findings
    corridor = max(item.flown for item in found if item.rule == "corridor" and item.flown is not None)
    clearance = min(item.flown for item in found if item.rule == "clearance" and item.flown is not None)
    assert clearance == pytest.approx(lowest, abs=1.0)
    # Each leg's distance is from it and its neighbours; nearer legs beyond them do not count.
    assert farthest <= corridor + 1.0
    assert corridor == pytest.approx(TRUTH[name]["cross_track_to_legs_max_m"], abs=1.0)


@pytest.mark.parametrize("name", TRUTH)
def test_the_verdict_agrees_with_the_simulators_truth(flights: dict[str, ImportedFlight], name: str) -> None:
    truth, found = TRUTH[name], flights[name].verdict.findings
    clearance = min(item.flown for item in found if item.rule == "clearance" and item.flown is not None)
    assert clearance == pytest.approx(truth["least_clearance_m"], abs=1.0)
    entered = [item for item in found if item.rule == "threat" and item.place.kind == "missile" and item.ok is False]
    assert len(entered) == truth["kill_spheres_entered"]
    nearest = [fact.value for item in found if item.rule == "threat" for fact in item.facts if fact.what == "nearest"]
    if nearest:
        assert min(nearest) == pytest.approx(truth["least_distance_to_a_kill_sphere_m"], abs=1.0)
    overshoot, passed = measured(flights[name], "overshoot"), measured(flights[name], "nearest pass")
    for corner in truth["corners"]:
        assert passed[corner["waypoint"]] == pytest.approx(corner["nearest_pass_m"], abs=1.0), corner
        # A leg that was never joined has no far side.
        if (name, corner["waypoint"]) != ("tight", 14):
            assert overshoot[corner["waypoint"]] == pytest.approx(corner["overshoot_m"], abs=1.0), corner


def test_a_leg_that_was_not_joined_is_named_and_has_no_overshoot(flights: dict[str, ImportedFlight]) -> None:
    """`tight` comes nearest to waypoint 14 when it is past waypoint 15's place on the line between the two."""
    assert 14 not in measured(flights["tight"], "overshoot")
    rows = read_rows(FLIGHTS / "tight.BIN", "POS")["POS"]
    way = [line for line in mission_lines(FLIGHTS / "tight.waypoints")[1:] if line[3] == 16]
    before, here, there = ((way[k][8], way[k][9]) for k in (13, 14, 15))
    # From its pass of waypoint 13 on, which is the only one.
    first = np.argmin([np.hypot(*flat(row.Lat, row.Lng, *before)) for row in rows])
    leg = flat(*there, *here)
    places = [flat(row.Lat, row.Lng, *here) for row in rows[int(first) :]]
    nearest = min(places, key=lambda place: float(np.hypot(*place)))
    beyond = float(nearest @ leg) / float(np.hypot(*leg)) - float(np.hypot(*leg))
    turn = next(item for item in flights["tight"].verdict.findings if (item.rule, item.place.index) == ("turn", 14))
    told = re.search(r"passed (\d+) m beyond the end of the next leg", turn.reason)
    assert told is not None, turn.reason
    assert float(told.group(1)) == pytest.approx(beyond, abs=1.0)
    assert turn.ok is None


def measured(flight: ImportedFlight, what: str) -> dict[int, float]:
    """A number of the turns, by waypoint."""
    turns = [item for item in flight.verdict.findings if item.rule == "turn" and item.place.index is not None]
    return {int(turn.place.index or 0): fact.value for turn in turns for fact in turn.facts if fact.what == what}


def test_what_failed_is_what_the_truth_has(flights: dict[str, ImportedFlight]) -> None:
    assert flights["ridge-10mps"].verdict.undecided
    failed = {
        name: {item.rule for item in flight.verdict.findings if item.ok is False} for name, flight in flights.items()
    }
    assert failed["steep"] == {"slope", "clearance"}
    assert {"turn", "threat", "corridor", "waypoint"} <= failed["tight"]
    for flight in flights.values():
        completion = next(item for item in flight.verdict.findings if item.rule == "completion")
        assert completion.ok is None, "the last waypoint stands a kilometre past the log's end"


def test_the_wind_is_the_one_that_blew(flights: dict[str, ImportedFlight]) -> None:
    """10 m/s over the ridges, none in the others."""
    assert flights["ridge-10mps"].setup.scenario.wind.speed == pytest.approx(10.0, abs=0.6)
    for name in ("tight", "steep"):
        assert flights[name].setup.scenario.wind.speed < 0.3


def test_track_rows_are_those_of_the_log(flights: dict[str, ImportedFlight]) -> None:
    flight = flights["tight"]
    rows = read_rows(FLIGHTS / "tight.BIN", "POS", "ATT", "XKF2")
    origin = flight.setup.scenario.origin
    for k in np.linspace(0, len(flight.track) - 1, 10).astype(int):
        place = min(rows["POS"], key=lambda row: abs(row.TimeUS * 1e-6 - flight.track.time[k]))
        assert flight.track.time[k] == pytest.approx(place.TimeUS * 1e-6, abs=1e-6)
        # Direction and distance from the origin, on the ellipsoid.
        azimuth, _, distance = Geod(ellps="WGS84").inv(origin.lon_deg, origin.lat_deg, place.Lng, place.Lat)
        east, north = distance * math.sin(math.radians(azimuth)), distance * math.cos(math.radians(azimuth))
        assert flight.track.position[k] == pytest.approx([east, north, place.Alt], abs=0.1)
        angle = min(rows["ATT"], key=lambda row: abs(row.TimeUS - place.TimeUS))
        assert flight.track.attitude[k] == pytest.approx(np.radians([angle.Roll, angle.Pitch, angle.Yaw]), abs=0.01)
        wind = min(rows["XKF2"], key=lambda row: abs(row.TimeUS - place.TimeUS))
        assert flight.track.wind[k, :2] == pytest.approx([wind.VWE, wind.VWN], abs=0.01)


def test_a_log_is_read_in_five_seconds_an_hour() -> None:
    hours = TRUTH["steep"]["flight_s"] / 3600.0
    spent = []
    for _ in range(3):
        began = time.process_time()
        make_flight(open_log(FLIGHTS / "steep.BIN"))
        spent.append(time.process_time() - began)
    assert min(spent) < 5.0 * hours


@pytest.mark.skipif(not (WHOLE / "truth.json").exists(), reason="PLANFLY_FLIGHTS names no folder of whole logs")
@pytest.mark.parametrize("name", ["demo", "ridge-5mps", "ridge-10mps", "steep", "tight"])
def test_whole_logs_agree_with_their_truth(name: str) -> None:
    folder = WHOLE
    truth = json.loads((folder / "truth.json").read_text())[name]
    scenario = str(folder / f"{name}.toml") if (folder / f"{name}.toml").exists() else name
    options = LogOptions(scenario=scenario) if name != "demo" else LogOptions(terrain=str(folder / "terrain.tif"))
    flight, spent = None, []
    for _ in range(2):
        # The first brings the kernels along.
        began = time.process_time()
        flight = import_flight(folder / f"{name}.BIN", options)
        spent.append(time.process_time() - began)
    assert flight is not None
    assert min(spent) < 5.0 * truth["flight_s"] / 3600.0
    found = flight.verdict.findings
    corridor = max(item.flown for item in found if item.rule == "corridor" and item.flown is not None)
    clearance = min(item.flown for item in found if item.rule == "clearance" and item.flown is not None)
    if truth["cross_track_to_legs_max_m"] > 5.0:
        assert corridor == pytest.approx(truth["cross_track_to_legs_max_m"], abs=1.0)
    assert clearance == pytest.approx(truth["least_clearance_m"], abs=1.0)


def test_a_task_without_heights_gets_those_that_were_flown(tmp_path: Path) -> None:
    raw = example_raw_log()
    task = replace(raw.missions[0], with_heights=False)
    flight = judged(tmp_path, replace(raw, missions=(task,)), LogOptions(aircraft="aerosonde"))
    assert [item.ok for item in flight.verdict.findings if item.rule == "slope"] == [None, None]
    assert flight.setup.imported_log is not None
    assert not flight.setup.imported_log.plan_heights


def test_notes_tell_what_a_person_should_know(tmp_path: Path) -> None:
    raw = replace(example_raw_log(), parameters={})
    flight = judged(tmp_path, raw)
    assert "Note: the log contains no parameters: ArduPlane's defaults are used" in flight.verdict.lines
    assert "Wind: 3.0 m/s on average, from 000°, according to XKF2 of the log" in flight.verdict.lines
    assert (
        "Heights: from POS, above mean sea level, according to the log;"
        " other heights differ at the start: GPS.Alt by +0.5 m" in flight.verdict.lines
    )


def silent(_done: float, _whole: float, _remark: str) -> None:
    """Report nothing."""


@pytest.mark.parametrize(("stated", "limit_deg"), [(None, 45.0), (40.0, 40.0)])
def test_a_log_is_judged_with_the_autopilots_bank_where_the_aircraft_can_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stated: float | None, limit_deg: float
) -> None:
    """ArduPlane's default ROLL_LIMIT_DEG is 45; the scenario that is made around a mission allows 60 degrees."""
    load = imported_flights.load_envelope
    agile = math.radians(60.0)
    monkeypatch.setattr(
        imported_flights, "load_envelope", lambda *given, **how: replace(load(*given, **how), max_bank=agile)
    )
    raw = example_raw_log()
    bank = {} if stated is None else {"ROLL_LIMIT_DEG": stated}
    others = {name: value for name, value in raw.parameters.items() if name != "ROLL_LIMIT_DEG"}
    flight = judged(tmp_path, replace(raw, parameters=others | bank))
    assert math.degrees(flight.setup.limits.max_bank) == pytest.approx(limit_deg)


def test_the_model_flies_the_legs_of_the_longest_stretch_in_the_wind_of_the_log(tmp_path: Path) -> None:
    flight = judged(tmp_path, options=LogOptions(aircraft="aerosonde"))
    (again,) = fly_again(flight.setup, flight.track, None, None, silent)
    assert (len(again.legs), again.ended, again.stands_in) == (2, "completed", False)
    # 3 m/s from the north: 25 m/s of equivalent airspeed are 25.6 at 500 m, less 3 against the wind.
    flown, model = again.legs[0].ground_speed
    assert flown == pytest.approx(25.0, abs=0.1)
    assert model == pytest.approx(25.6 - 3.0, abs=0.5)
    assert again.setup.autopilot.parameters is not None
    assert again.setup.autopilot.parameters.wp_radius == 60.0


def test_another_aircraft_stands_in_where_none_is_named(tmp_path: Path) -> None:
    flight = judged(tmp_path)
    assert fly_again(flight.setup, flight.track, None, None, silent)[0].stands_in
    assert not fly_again(flight.setup, flight.track, "aerosonde", None, silent)[0].stands_in


def test_a_flight_that_followed_no_mission_is_not_flown_again(tmp_path: Path) -> None:
    raw = replace(example_raw_log(), modes=(ModeChange(20.0, "FBWA", False),))
    flight = judged(tmp_path, raw)
    with pytest.raises(LogError, match="followed no leg of its mission"):
        fly_again(flight.setup, flight.track, None, None, silent)


def test_every_stretch_is_flown_again_the_longest_first(tmp_path: Path) -> None:
    """AUTO from 20 s to 75 s, and from 76 s on: the turn is at 70 s, the end at 110 s."""
    modes = (ModeChange(20.0, "AUTO", True), ModeChange(75.0, "FBWA", False), ModeChange(76.0, "AUTO", True))
    flight = judged(tmp_path, replace(example_raw_log(), modes=modes), LogOptions(aircraft="aerosonde"))
    found = fly_again(flight.setup, flight.track, None, None, silent)
    assert [(again.stretch.start, again.first, len(again.legs)) for again in found] == [(20.0, 0, 2)]
    turned = (ModeChange(20.0, "AUTO", True), ModeChange(40.0, "FBWA", False), ModeChange(68.0, "AUTO", True))
    flight = judged(tmp_path, replace(example_raw_log(), modes=turned), LogOptions(aircraft="aerosonde"))
    found = fly_again(flight.setup, flight.track, None, None, silent)
    assert [(again.stretch.start, again.first, len(again.legs)) for again in found] == [(20.0, 0, 1), (68.0, 1, 1)]


@pytest.mark.parametrize("throttle", [None, 0.0])
def test_a_throttle_that_never_moves_is_noted(tmp_path: Path, throttle: float | None) -> None:
    """The log of a powered flight has two throttles, and the log of a glider has 0 in all rows."""
    changed = {} if throttle is None else {"thr": np.full(len(circle()["t"]), throttle)}
    table = write_log(tmp_path, **changed)
    plan = tmp_path / "plan.waypoints"
    plan.write_text(
        "QGC WPL 110\n"
        "0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t400.0\t1\n"
        "1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.001\t500.0\t1\n"
        "2\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.012\t500.0\t1\n",
        encoding="utf-8",
    )
    source = import_flight(table, LogOptions(plan=str(plan))).setup.imported_log
    assert source is not None
    assert ("the throttle never moves: 0 in all rows" in source.notes) == (throttle is not None)
