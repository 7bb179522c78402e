"""The timeline's entries against numbers got in another way."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import ImportedLog
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, LogEvent, read_log
from logs.verdict.measures.track_alignment import find_leg_ends, with_legs
from logs.views.replay.instruments import make_instruments
from logs.views.replay.timeline import TimelineEntry, entry_lines, timeline
from tests.logs.made_flight import make_setup, make_track


@pytest.fixture(scope="module")
def log(log_file: Path) -> FlightLog:
    return read_log(log_file)


def texts(entries: list[TimelineEntry], kind: str) -> list[str]:
    return [entry.text for entry in entries if entry.kind == kind]


def test_legs_turns_and_the_end_stand_in_order_of_time(log: FlightLog) -> None:
    entries = timeline(log)
    assert entries == timeline(log)
    assert [entry.time for entry in entries] == sorted(entry.time for entry in entries)
    assert entries[0].kind == "start"
    assert entries[-1].kind == "end"
    # Course of the first leg: atan2(900 m east, 700 m north) = 52.1 degrees; its length the root of 900^2 + 700^2.
    assert texts(entries, "leg")[0] == "leg 0 to waypoint 1 (item 2): course 052°, 1140 m, slope +0.5°, 25.0 m/s"
    assert len(texts(entries, "leg")) == 3
    # 52.13 - 18.43 = 33.69 degrees, to the left; 0.45 rad = 25.8 degrees of bank.
    assert texts(entries, "turn")[0] == "turn left 33.7° at waypoint 1 (item 2), peak bank 25.8°"
    assert "full for 4.0 s" in texts(entries, "throttle")
    assert texts(entries, "event") == ["warning: half way up", "arrived"]
    assert texts(entries, "end")[0].startswith("completed; 8.0 s, 2.72 km, 9.0 Wh")


def test_a_real_flight_begins_where_its_log_does_without_seed_or_trim(log: FlightLog) -> None:
    def start(given: FlightLog) -> str:
        return timeline(given)[0].text

    real = dataclasses.replace(log, setup=dataclasses.replace(log.setup, imported_log=ImportedLog("a.BIN", "", "")))
    assert "seed" in start(log)
    assert log.setup.route.started in start(log)
    assert "; imported log a.BIN, from " in start(real)
    assert "seed" not in start(real)
    assert log.setup.route.started not in start(real)


def test_the_lowest_clearance_of_each_leg_is_that_of_a_fine_sampling(log: FlightLog) -> None:
    entries = [entry for entry in timeline(log) if entry.kind == "ground"]
    terrain = log.setup.scenario.terrain
    assert terrain is not None
    fine = np.linspace(0.0, log.end_time, 40_001)
    position = np.stack([np.interp(fine, log.track.time, log.track.position[:, k]) for k in range(3)], axis=1)
    height = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
    legs = with_legs(log.track, find_leg_ends(log.setup, log.track)).leg
    leg = legs[np.searchsorted(log.track.time, fine, side="right") - 1]
    for k, entry in enumerate(sorted(entries, key=lambda item: item.text)):
        lowest = float(height[leg == k].min())
        assert entry.text.startswith(f"lowest height on leg {k}: {lowest:.1f} m above ground")
    # The recorded clearance, 999 m, is not believed.
    assert not any("999" in entry.text for entry in entries)


def test_a_leg_below_the_required_clearance_is_marked(log: FlightLog) -> None:
    lowered = dataclasses.replace(log.track, position=log.track.position - np.array([0.0, 0.0, 60.0]))
    found = texts(timeline(dataclasses.replace(log, track=lowered)), "ground")
    assert any("49.4 m above ground, below the required 60 m" in text for text in found)


def test_a_threat_is_entered_and_left(log: FlightLog) -> None:
    found = [entry for entry in timeline(log) if entry.kind == "threat"]
    assert [entry.text.split(":")[0] for entry in found] == [
        "inside the missile range of Alfa (400 m)",
        "outside the missile range of Alfa",
        "inside the radar range of threat 2 (800 m)",
        "still inside the radar range of threat 2",
    ]
    near = np.sqrt(((log.track.position - log.setup.scenario.threats.position[0]) ** 2).sum(axis=1))
    inside = log.track.time[near <= 400.0]
    assert found[0].time == pytest.approx(inside[0], abs=0.02)
    assert found[1].time == pytest.approx(inside[-1], abs=0.02)
    assert f"closest {near.min():.0f} m" in found[1].text


def test_missing_terrain_and_a_missing_end_have_entries(log: FlightLog) -> None:
    bare = dataclasses.replace(make_setup(with_plan=False).scenario, terrain=None, external=True)
    cut = dataclasses.replace(
        log,
        setup=dataclasses.replace(log.setup, scenario=bare),
        ended=None,
        complete=False,
        problem="the file ends at byte 7",
    )
    entries = timeline(cut)
    assert texts(entries, "ground") == ["no terrain in the log: clearance is unknown"]
    assert texts(entries, "end")[0].startswith("not recorded;")
    assert entries[-1].text == "the log is not complete: the file ends at byte 7"


def test_lines_fit_a_terminal_and_cannot_steer_it(log: FlightLog) -> None:
    nasty = LogEvent(3.0, "\x1b[2J\rall " + "very long words " * 20 + "x" * 300, "info")
    entries = timeline(dataclasses.replace(log, events=(nasty,)))
    lines = [line for entry in entries for line in entry_lines(entry)]
    assert all(len(line) <= 100 and line.isprintable() for line in lines)
    assert lines[0].startswith("     0.00 s  start    aerosonde, scenario synthetic, seed 7")


def test_one_row_and_unknown_numbers_have_a_timeline_too(log: FlightLog) -> None:
    single = dataclasses.replace(log, track=log.track.rows(0, 1), events=(), end_time=0.0)
    assert {entry.kind for entry in timeline(single)} >= {"start", "leg", "end"}
    terrain = log.setup.scenario.terrain
    assert terrain is not None
    # No ground is known north of 690 m, so under the last leg.
    heights = np.array(terrain.heights)
    heights[int(terrain.to_pixel(0.0, 690.0)[1]) :] = math.nan
    scenario = dataclasses.replace(log.setup.scenario, terrain=dataclasses.replace(terrain, heights=heights))
    setup = dataclasses.replace(log.setup, scenario=scenario)
    attitude = np.full((len(log.track), 3), math.nan, dtype=np.float32)
    lost: Track = dataclasses.replace(make_track(), attitude=attitude)
    entries = timeline(dataclasses.replace(log, setup=setup, track=lost))
    assert any("no terrain data under it" in text for text in texts(entries, "ground"))
    assert any("peak bank nan" in text for text in texts(entries, "turn"))


def test_the_recorded_legs_are_not_believed(log: FlightLog) -> None:
    lying = dataclasses.replace(log.track, leg=np.zeros(len(log.track), dtype=np.int32))
    assert timeline(dataclasses.replace(log, track=lying)) == timeline(log)
    assert make_instruments(dataclasses.replace(log, track=lying)).frame(6.0) == make_instruments(log).frame(6.0)
