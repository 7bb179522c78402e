"""Imported flights: what is judged, what is not and why, and that what is wrong is wrong all the same."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import Damage, Heights, ImportedLog, RowFaults
from logs.importers.raw_log import LogSeries, ModeChange, RawLog, example_raw_log
from logs.verdict.imported.judge_imported_flight import altitude_source_text, damage_text, row_faults_text
from logs.verdict.judge_flight import judge_flight
from logs.verdict.verdict import verdict_json
from planfly.flight_options import LogOptions
from tests.logs.importers.judged_flights import judged, outcome, reasons

AEROSONDE = LogOptions(aircraft="aerosonde")


def without(*names: str) -> RawLog:
    raw = example_raw_log()
    return replace(raw, series={name: found for name, found in raw.series.items() if name not in names})


def with_rows(keep: Iterable[bool]) -> RawLog:
    """The example with some of its rows alone."""
    raw, rows = example_raw_log(), np.array(list(keep))
    series = {name: LogSeries(one.source, one.time[rows], one.values[rows]) for name, one in raw.series.items()}
    return replace(raw, series=series)


def bulging(raw: RawLog, metres: float) -> RawLog:
    """A flight that swings out to the east and back on its first leg."""
    own = raw.series["position"]
    swing = np.sin(np.pi * np.clip((own.time - 35.0) / 30.0, 0.0, 1.0))
    values = own.values.copy()
    values[:, 1] += metres * swing / (111_320.0 * np.cos(np.radians(46.0)))
    return replace(raw, series={**raw.series, "position": LogSeries("POS", own.time, values)})


def with_modes(*modes: tuple[float, str]) -> RawLog:
    return replace(example_raw_log(), modes=tuple(ModeChange(time, name, name == "AUTO") for time, name in modes))


def test_a_flight_along_its_legs_is_flyable_and_complete(tmp_path: Path) -> None:
    flight = judged(tmp_path, options=AEROSONDE)
    assert flight.verdict.flyable
    assert flight.verdict.complete
    assert outcome(flight, "corridor") == [True, True]
    assert outcome(flight, "waypoint") == [True, True, True]


@pytest.mark.parametrize(
    ("lacks", "rule", "reason"),
    [
        ("airspeed", "speed", "the log contains no airspeed"),
        ("airspeed", "stall", "the log contains no airspeed"),
        ("attitude", "stall", "the log contains no attitude"),
        ("throttle", "energy", "the log contains no battery current and voltage"),
    ],
)
def test_a_rule_without_its_quantity_says_so(tmp_path: Path, lacks: str, rule: str, reason: str) -> None:
    flight = judged(tmp_path, without(lacks), AEROSONDE)
    assert reasons(flight, rule) == {reason}
    assert flight.verdict.flyable


def test_a_quantity_that_is_missing_for_a_while_is_told_with_its_times(tmp_path: Path) -> None:
    raw = example_raw_log()
    own = raw.series["airspeed"]
    keep = (own.time < 50.0) | (own.time > 60.0)
    holed = replace(raw, series={**raw.series, "airspeed": LogSeries("ARSP", own.time[keep], own.values[keep])})
    (reason,) = reasons(judged(tmp_path, holed, AEROSONDE), "speed")
    assert reason == "the log contains no airspeed at 51 rows from 50.0 s to 60.0 s"


def test_an_aircraft_that_is_not_named_has_no_limits(tmp_path: Path) -> None:
    flight = judged(tmp_path)
    for rule in ("turn", "slope", "speed"):
        assert reasons(flight, rule) == {"no aircraft was named; name it with --aircraft"}
    assert outcome(flight, "corridor") == [True, True]


def test_a_landing_of_an_aircraft_that_is_not_named_has_no_limit(tmp_path: Path) -> None:
    raw = example_raw_log()
    found = raw.missions[-1]
    *items, last = found.mission.items
    landing = replace(found.mission, items=(*items, replace(last, command=21, alt=last.alt - 20.0)))
    landing_log = replace(raw, missions=(*raw.missions[:-1], replace(found, mission=landing)))
    assert reasons(judged(tmp_path, landing_log), "landing") == {"no aircraft was named; name it with --aircraft"}


@pytest.mark.parametrize(("datum", "judged_by"), [("unstated", False), ("ellipsoid", False), ("amsl", True)])
def test_heights_of_another_datum_are_not_held_against_the_plans(tmp_path: Path, datum: str, judged_by: bool) -> None:
    flight = judged(tmp_path, replace(example_raw_log(), datum=datum), AEROSONDE)  # type: ignore[arg-type]
    assert outcome(flight, "slope") == [judged_by or None] * 2


def test_a_datum_that_a_person_states_counts_where_the_log_states_none(tmp_path: Path) -> None:
    said = {**AEROSONDE, "datum": "amsl"}
    assert outcome(judged(tmp_path, replace(example_raw_log(), datum="unstated"), said), "slope") == [True, True]
    assert outcome(judged(tmp_path, replace(example_raw_log(), datum="ellipsoid"), said), "slope") == [None, None]


@pytest.mark.parametrize(("beside", "ok"), [(119.0, True), (121.0, False)])
def test_the_corridor_is_twice_the_logged_radius(tmp_path: Path, beside: float, ok: bool) -> None:
    """WP_RADIUS of the log is 60 m: pairs just inside and just outside of 120 m."""
    flight = judged(tmp_path, bulging(example_raw_log(), beside))
    assert outcome(flight, "corridor")[0] is ok
    assert flight.verdict.flyable is ok


def test_a_gap_is_not_bridged_in_silence(tmp_path: Path) -> None:
    time = example_raw_log().series["position"].time
    flight = judged(tmp_path, with_rows((time < 40.0) | (time > 45.0)), AEROSONDE)
    assert outcome(flight, "corridor") == [None, True]
    assert "the log has no rows from 39.8 s to 45.2 s" in reasons(flight, "corridor")
    assert "Rows: 1 gap" in flight.verdict.summary
    completion = next(item for item in flight.verdict.findings if item.rule == "completion")
    assert "1 gap with a total of 5.4 s; the longest is from 39.8 s to 45.2 s" in completion.reason
    assert flight.verdict.flyable


@pytest.mark.parametrize(("until", "undecided"), [(49.7, False), (50.3, True)])
def test_a_pause_of_over_ten_seconds_leaves_a_flight_undecided(tmp_path: Path, until: float, undecided: bool) -> None:
    """Rows every 0.2 s, the last before the pause at 39.8 s."""
    time = example_raw_log().series["position"].time
    flight = judged(tmp_path, with_rows((time < 39.9) | (time > until)), AEROSONDE)
    assert flight.verdict.undecided is undecided
    assert flight.verdict.flyable is not undecided
    says = "not judged from 39.8 s to 50.4 s, because the log has no rows"
    assert flight.verdict.headline.startswith(says) is undecided


def test_what_is_wrong_beside_a_gap_is_wrong(tmp_path: Path) -> None:
    time = example_raw_log().series["position"].time
    flight = judged(tmp_path, bulging(with_rows((time < 40.0) | (time > 45.0)), 200.0))
    assert outcome(flight, "corridor")[0] is False


def test_only_stretches_in_auto_are_judged_each_with_its_time(tmp_path: Path) -> None:
    flight = judged(tmp_path, with_modes((20.0, "AUTO"), (80.0, "FBWA")), AEROSONDE)
    assert (
        "Judged: the flight in AUTO from 20.0 s to 80.0 s, on legs 0 to 1, leg 1 in part; leg 0 begins at 30.0 s"
        in flight.verdict.lines
    )
    assert not flight.verdict.flyable
    completion = next(item for item in flight.verdict.findings if item.rule == "completion")
    assert completion.reason.startswith("AUTO was left for FBWA at 80.0 s, on the way to waypoint 2 (item 3); 1 of 2")
    assert len(flight.track) == 460, "the rest is shown"


def test_a_stretch_that_begins_within_the_mission_is_judged_from_there(tmp_path: Path) -> None:
    flight = judged(tmp_path, with_modes((20.0, "FBWA"), (50.0, "AUTO")), AEROSONDE)
    assert {item.place.index for item in flight.verdict.findings if item.rule == "corridor"} == {1}
    # The log begins in flight: the first leg may have been flown along the mission before.
    assert outcome(flight, "completion") == [None]
    assert flight.verdict.undecided
    assert flight.verdict.headline.startswith("not judged from end to end: the log begins in flight, and leg 0 is not")
    setup = flight.setup
    assert setup.imported_log is not None
    on_the_ground = replace(setup, imported_log=replace(setup.imported_log, begins_in_flight=False))
    verdict = judge_flight(on_the_ground, flight.track, "")
    completion = next(item for item in verdict.findings if item.rule == "completion")
    assert (completion.ok, completion.margin) == (False, -1)
    assert completion.reason == "leg 0 is not flown along the mission; 1 of 2 legs flown, including the last leg"
    assert verdict.answer == "not flown as planned"


def test_what_the_aircraft_is_not_known_well_enough_for_is_left_open(tmp_path: Path) -> None:
    flight = judged(tmp_path, options=AEROSONDE)
    assert flight.verdict.answer == "flown as planned"
    unsure = replace(flight.setup.envelope, source="a data sheet", fastest_sd=10.0)
    limits = replace(flight.setup.limits, envelope=unsure)
    verdict = judge_flight(replace(flight.setup, limits=limits), flight.track, "")
    assert verdict.undecided
    assert [level.undecided for level in verdict.levels] == [True]
    assert verdict.headline.startswith("not judged in full: airspeeds on 2 legs are too close to the limit to judge")
    told = json.loads(verdict_json(verdict))
    assert (told["answer"], told["undecided"], told["flyable"]) == ("not judged in full", True, False)


@pytest.mark.parametrize(("seconds", "seen"), [(9.0, True), (11.0, False)])
def test_rows_seldom_enough_leave_a_flight_open_though_none_is_missing(
    tmp_path: Path, seconds: float, seen: bool
) -> None:
    """A track of one row each so many seconds has no pause; where the aircraft was between them nobody knows."""
    time = example_raw_log().series["position"].time
    _, first = np.unique(np.floor(time / seconds), return_index=True)
    kept = np.zeros(len(time), dtype=bool)
    kept[first] = True
    assert float(np.diff(time[kept]).max()) == pytest.approx(seconds, abs=0.5)
    verdict = judged(tmp_path, with_rows(kept), AEROSONDE).verdict
    assert ("the log has no rows" in verdict.unjudged) is not seen


def test_a_log_that_ends_on_the_way_says_nothing_of_the_rest(tmp_path: Path) -> None:
    time = example_raw_log().series["position"].time
    flight = judged(tmp_path, with_rows(time < 90.0), AEROSONDE)
    assert outcome(flight, "completion") == [None]
    assert not flight.verdict.flyable
    assert flight.verdict.undecided
    assert flight.verdict.headline.startswith("not judged from end to end: ")
    # The last waypoint was not reached, and that is no fault.
    assert outcome(flight, "waypoint") == [True, True, None]


def test_a_flight_without_auto_is_not_judged(tmp_path: Path) -> None:
    flight = judged(tmp_path, with_modes((20.0, "FBWA")))
    assert flight.verdict.headline == "not flown as planned: completion (no part of the flight followed the mission)"
    assert "Judged: nothing, because no part of the flight followed the mission" in flight.verdict.lines


def test_two_stretches_are_judged_together(tmp_path: Path) -> None:
    modes = with_modes((20.0, "AUTO"), (45.0, "FBWA"), (48.0, "AUTO"))
    flight = judged(tmp_path, modes, AEROSONDE)
    judged_lines = [line for line in flight.verdict.lines if line.startswith("Judged:")]
    assert len(judged_lines) == 2
    # Three seconds by hand on the first leg: neither as planned, nor not.
    assert outcome(flight, "completion") == [None]
    assert "leg 0 is flown only in part" in flight.verdict.headline
    assert len(outcome(flight, "departure")) == 1


def test_a_log_that_is_not_whole_is_not_complete(tmp_path: Path) -> None:
    flight = judged(tmp_path, options=AEROSONDE)
    assert judge_flight(flight.setup, flight.track, "").flyable
    assert not judge_flight(flight.setup, flight.track, "", log_complete=False).flyable


@pytest.mark.parametrize(("mode", "complete"), [("RTL", True), ("FBWA", False)])
def test_a_return_that_the_mission_ends_with_completes_it(tmp_path: Path, mode: str, complete: bool) -> None:
    """Autopilots leave AUTO for a mode of their own where the mission says return to launch."""
    raw = with_modes((20.0, "AUTO"), (109.0, mode))
    logged = raw.missions[0]
    back = replace(logged.mission.items[0], seq=4, command=20, lat_deg=0.0, lon_deg=0.0, alt=0.0)
    mission = replace(logged.mission, items=(*logged.mission.items, back))
    flight = judged(tmp_path, replace(raw, missions=(replace(logged, mission=mission),)), AEROSONDE)
    assert outcome(flight, "completion") == [complete]


def test_each_fault_of_rows_is_counted_by_name() -> None:
    faults = RowFaults(doubled=1, unordered=2, unusable=3, glitches=4, clock_jumps=(5.0, 6.0))
    assert row_faults_text(faults, 2) == (
        "2 gaps, 1 duplicate, 2 out of order, 3 without a position or a time, 4 position glitches,"
        " 2 clock jumps (at 5.0 s, 6.0 s)"
    )


def test_each_datum_is_named() -> None:
    said = {
        datum: altitude_source_text(ImportedLog("a", "", "", heights=Heights("POS", datum)))
        for datum in ("amsl", "ellipsoid", "pressure", "unstated")
    }
    assert len(set(said.values())) == 4
    assert said["ellipsoid"] == "from POS, above the WGS 84 ellipsoid"


def test_what_is_lost_is_told() -> None:
    assert damage_text(Damage(places=1, size=1200, unreadable=2)) == (
        "1 place in the file (1,200 bytes) cannot be read; 2 messages contain no usable data"
    )
