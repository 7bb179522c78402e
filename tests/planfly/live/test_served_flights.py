"""Missions judged for a served vehicle, and logs that never overwrite one another."""

from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from flight.live.arming import ACCEPTED, ArmingState
from flight.live.flight_process import (
    STILL_LOITERING_TEXT,
    DivertFlight,
    EndFlight,
    JudgeMission,
    StartFlight,
    serve_flights,
)
from flight.live.telemetry import AUTO, CRITICAL, INFO, LOITER, WARNING
from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from logs.recording.reader import read_log
from logs.verdict.findings import Finding
from logs.verdict.places import FLIGHT, DecidingParameter, Place
from logs.verdict.verdict import Verdict
from planfly.live import served_flights
from planfly.live.served_flights import ServedFlights, ServeOptions, describe_verdict, load_served_scenario
from tests.logs.made_flight import make_track
from tests.planfly.conftest import FIELD
from tests.setups import waypoint_mission
from world.errors import LogError
from world.frames import to_geo


def failing(leg: int) -> Finding:
    return Finding("slope", Place("leg", leg), 9.0, 9.0, 8.0, "aircraft", 0.1, -1.0, "deg", "fit", False, "too steep")


def test_of_a_verdict_the_worst_comes_first_and_the_rest_is_counted() -> None:
    verdict = Verdict(tuple(failing(k) for k in range(6)), False, True, ("not flyable",), "geometry")
    texts = describe_verdict("geometry", verdict)
    assert texts[0] == ("verdict (geometry): NOT FLYABLE", WARNING)
    assert [text.text for text in texts[1:5]] == [f"slope at leg {k}: too steep" for k in range(4)]
    assert texts[5:] == (("and 2 more findings", WARNING),)
    late = DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", Place("leg", 4), -8.2)
    decided = describe_verdict("flown", replace(verdict, deciding=late))
    assert decided[1] == (
        "with TECS_HDEM_TCONST 3 s the aircraft is 8 m too low on leg 4; with 1.2 s the flight would pass",
        WARNING,
    )
    assert decided[2:] == texts[1:]
    clean = Verdict((), True, True, ("flyable",), "flown")
    assert describe_verdict("flown", clean) == (("verdict (flown): FLYABLE", INFO),)


def test_a_station_reads_the_words_of_the_terminal() -> None:
    lost = Finding("departure", FLIGHT, 0.0, 80.0, 75.0, "check", 0.0, -5.0, "deg", "every row", False, "bank 80°")
    verdict = Verdict((lost,), False, True, ("not flyable",), "flown")
    assert describe_verdict("flown", verdict)[1] == ("loss of control: bank 80°", WARNING)


@pytest.fixture
def options(tmp_path: Path) -> ServeOptions:
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    return ServeOptions("", 5.0, tmp_path / "logs", {"scenario": tmp_path / "field.toml"})


def mission(options: ServeOptions, *points: tuple[float, float, float]) -> Mission:
    origin = load_served_scenario(options).scenario.origin
    return waypoint_mission(np.array(points), np.full(len(points) - 1, 25.0), origin)


def test_a_mission_is_judged_before_it_is_flown(options: ServeOptions) -> None:
    flights = ServedFlights(options)
    assert flights.speed == 5.0
    level = mission(options, (0.0, 0.0, 150.0), (1500.0, 0.0, 150.0))
    prepared, judged = flights.prepare(JudgeMission(level, 3))
    assert prepared is not None
    assert (judged.number, judged.possible, judged.flyable) == (3, True, True)
    assert judged.texts[0].text.startswith("mission: 2 waypoints, 1.5 km; ")
    # Home is the ground below the start where the mission has none: field is level, at the sea.
    assert judged.home is not None
    assert judged.home.alt == pytest.approx(0.0, abs=0.1)
    steep = mission(options, (0.0, 0.0, 150.0), (500.0, 0.0, 450.0))
    _, judged = flights.prepare(JudgeMission(steep, 4))
    assert (judged.possible, judged.flyable) == (True, False)
    prepared, judged = flights.prepare(JudgeMission(Mission(None, ()), 5))
    assert prepared is None
    assert (judged.number, judged.possible, judged.flyable) == (5, False, False)
    assert [text.severity for text in judged.texts] == [CRITICAL]


def circle(options: ServeOptions, east: float, radius: float) -> MissionItem:
    lat, lon = to_geo(load_served_scenario(options).scenario.origin, east, 0.0)
    params = (radius, 0.0, 0.0, 0.0)
    return MissionItem(
        0, int(Command.NAV_FENCE_CIRCLE_EXCLUSION), int(Frame.GLOBAL), params, float(lat), float(lon), 0.0
    )


@pytest.mark.parametrize(("east", "armed"), [(750.0, False), (750.0 + 1500.0, True)])
def test_an_upload_that_crosses_its_own_fence_is_warned_of_and_not_armed(
    east: float, armed: bool, options: ServeOptions
) -> None:
    level = mission(options, (0.0, 0.0, 150.0), (1500.0, 0.0, 150.0))
    fenced = replace(level, fences=(circle(options, east, 200.0),))
    _, judged = ServedFlights(options).prepare(JudgeMission(fenced, 1))
    assert (judged.possible, judged.flyable) == (True, armed)
    warnings = [text.text for text in judged.texts if text.severity == WARNING]
    assert (
        any(
            text.startswith("fence item 0 (exclusion): 200.0 m inside for 14.3 s in all. The path ")
            for text in warnings
        )
        != armed
    )
    arming = ArmingState()
    arming.on_mission_uploaded()
    arming.on_mission_judged(judged)
    assert (arming.arm(True, 0.0).result == ACCEPTED) == armed


def test_an_upload_with_a_fence_that_is_none_cannot_be_flown(options: ServeOptions) -> None:
    level = mission(options, (0.0, 0.0, 150.0), (1500.0, 0.0, 150.0))
    prepared, judged = ServedFlights(options).prepare(
        JudgeMission(replace(level, fences=(circle(options, 900.0, 0.0),)), 1)
    )
    assert prepared is None
    assert "fence item 0: radius 0 m: must be above 0" in judged.texts[0].text


def test_a_diverted_flight_lands_nowhere_whatever_strip_there_is(options: ServeOptions, tmp_path: Path) -> None:
    """What goes on in the air is flown, and judged, as what ends there."""
    strip = '[home]\nplace = "start"\n[landing]\neast_m = 2500\nnorth_m = 0\n[flight]\nautopilot = "ardupilot"\n'
    (tmp_path / "field.toml").write_text(FIELD + strip, encoding="utf-8")
    way = mission(options, (0.0, 0.0, 100.0), (1000.0, 0.0, 100.0), (1900.0, 0.0, 55.0))
    lat, lon = (float(value) for value in to_geo(load_served_scenario(options).scenario.origin, 2500.0, 0.0))
    land = MissionItem(4, int(Command.NAV_LAND), int(Frame.GLOBAL), (0.0,) * 4, lat, lon, 0.0)
    whole = replace(way, items=(*way.items, land))
    flights = ServedFlights(options)
    prepared, _ = flights.prepare(JudgeMission(whole, 1))
    assert prepared is not None
    assert prepared.setup.ground_phases.approach is not None
    diverted = flights.prepare_diversion(DivertFlight(AUTO, whole), np.array([0.0, -300.0, 100.0])).setup
    assert not diverted.ground_phases
    assert any("not flown to the ground" in note for note in diverted.notes)


def test_a_log_takes_the_next_free_number_and_holds_the_flight(options: ServeOptions) -> None:
    flights = ServedFlights(options)
    prepared, _ = flights.prepare(JudgeMission(mission(options, (0.0, 0.0, 150.0), (1500.0, 0.0, 150.0)), 1))
    assert prepared is not None
    options.logs.mkdir()
    (options.logs / "flight-001.mcap").write_bytes(b"another's")
    log = flights.open_log(prepared.setup, AUTO)
    made = make_track(seconds=1.0)
    track = replace(made, leg=np.zeros_like(made.leg))
    log.write(track.rows(0, 30))
    log.write(track.rows(30, 60))
    judged = log.finish("stopped", lambda: False)
    assert judged.texts[-1] == (f"log {options.logs / 'flight-002.mcap'}", INFO)
    read = read_log(options.logs / "flight-002.mcap")
    assert (read.ended, len(read.track)) == ("stopped", 60)
    assert [(event.text, event.level) for event in read.events] == [("flight ended: stopped", "error")]
    assert read.recorded_verdict is not None
    assert read.recorded_verdict["flyable"] is judged.flyable is False
    assert (options.logs / "flight-001.mcap").read_bytes() == b"another's"
    cut = flights.open_log(prepared.setup, AUTO)
    cut.write(track)
    cut.abandon()
    assert not read_log(options.logs / "flight-003.mcap").complete


def _holds_rows(log: Path) -> bool:
    try:
        return len(read_log(log).track) > 0
    except LogError:
        return False


def test_a_circle_without_end_is_logged_in_pieces_about_one_place(
    options: ServeOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(served_flights, "LOITER_DURATION_S", 30.0)
    level = mission(options, (0.0, 0.0, 150.0), (2500.0, 0.0, 150.0))
    ours, theirs = Pipe()
    thread = Thread(target=serve_flights, args=(theirs, ServedFlights(replace(options, speed=100.0))))
    thread.start()
    home = Home(46.0, 8.0, 0.0)
    for request in (JudgeMission(level, 1), StartFlight(), DivertFlight(LOITER, replace(level, home=home))):
        ours.send(request)
    pieces = 0
    while pieces < 3 or not _holds_rows(options.logs / "flight-003.mcap"):
        pieces = len(list(options.logs.glob("flight-*.mcap"))) if options.logs.exists() else 0
        ours.poll(0.05) and ours.recv_bytes()
    ours.send(EndFlight(quit=True))
    while thread.is_alive():
        ours.poll(0.05) and ours.recv_bytes()
    ours.close()
    theirs.close()
    one, two = (read_log(options.logs / f"flight-00{number}.mcap") for number in (2, 3))
    assert one.ended == STILL_LOITERING_TEXT
    assert one.track.time[-1] == pytest.approx(30.0, abs=6.0), "from where the circle is joined on"
    middles = [(log.setup.mission.items[-1].lat_deg, log.setup.mission.items[-1].lon_deg) for log in (one, two)]
    assert middles[0] == middles[1]
