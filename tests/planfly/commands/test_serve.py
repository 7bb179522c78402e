"""A served vehicle over real sockets, with a ground station of our own."""

import math
import os
import random
import re
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.station_requests import FORCE
from flight.live.telemetry import MODE_NAMES
from flight.simulation.simulate import Flight, fly_to_end
from logs.recording.reader import read_log
from planfly.cli import main
from planfly.workflow.uav import load_uav
from tests.planfly.conftest import FIELD, Served
from tests.planfly.misuse.test_listeners import listening, table
from tests.soak import SOAK, only_in_soak, scaled, tally, widen
from tests.stations import UdpStation, item
from tests.stopwatch import Stopwatch

LAT, LON = 460_000_000, 80_000_000
ROUTE = [
    item(0, LAT, LON, 0.0),
    item(1, LAT, LON, 100.0),
    item(2, LAT, LON + 33_333, 100.0, frame=3),
    item(3, LAT + 3_000, LON + 65_000, 100.0),
]
# Flown in some twelve seconds.
NEAR = [*ROUTE[:2], item(2, LAT, LON + 20_000, 100.0, frame=3), item(3, LAT + 3_000, LON + 32_000, 100.0)]
# 4 km out: long enough for whatever is done to it.
LONG = [*ROUTE[:3], item(3, LAT, LON + 300_000, 100.0)]
# Vehicles that fly at the same time where each is killed.
AT_ONCE = 10
STEEP = [*ROUTE[:3], item(3, LAT, LON + 65_000, 300.0)]


def done(message: object) -> bool:
    return message.get_type() == "MISSION_CURRENT" and message.mission_state == 5


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A vehicle at 50 times real time that tests have one after the other: starting one takes longer than they do."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "field.toml").write_text(FIELD, encoding="utf-8")
    vehicle = Served(folder, "--scenario", "field.toml", "--speed", "50")
    yield vehicle
    assert vehicle.stop() == 0
    assert not [line for line in vehicle.lines if line.startswith("frames dropped")]


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A vehicle at real time for two tests, the second of which kills it; in a soak that has vehicles of its own."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "field.toml").write_text(FIELD, encoding="utf-8")
    vehicle = Served(folder, "--scenario", "field.toml")
    yield vehicle
    if vehicle.process.poll() is None:
        assert vehicle.stop() == 0


@only_in_soak
def test_a_served_flight_is_the_flight_of_fly_at_real_time(real: Served) -> None:
    """Rates within 5 %, under 15 % of a core, and the very flight that ``planfly fly`` gives."""
    vehicle = real
    with UdpStation(vehicle.port) as station:
        assert station.upload(NEAR) == 0
        station.fly()
        station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.vy > 0)
        before, begun, used = len(station.log), time.monotonic(), vehicle.cpu()
        with Stopwatch(vehicle.process.pid) as watch:
            station.listen(5.0)
        seconds = time.monotonic() - begun
        share = (vehicle.cpu() - used) / seconds
        counts = Counter(message.get_type() for message in station.log[before:])
        for kind, rate in (("ATTITUDE", 30.0), ("GLOBAL_POSITION_INT", 10.0)):
            # What it waits for a core may cost it messages.
            assert 0.95 * rate * watch.seconds < counts[kind] < 1.05 * rate * seconds
        assert {"VFR_HUD", "SYS_STATUS", "WIND", "HOME_POSITION", "EXTENDED_SYS_STATE", "HEARTBEAT"} <= set(counts)
        print(f"{share:.3f} of a core, attitude {counts['ATTITUDE'] / seconds:.2f} Hz")
        assert share < 0.15, f"{share:.3f} of a core"
        station.until(done)
        station.until(lambda m: m.get_type() == "STATUSTEXT" and "log" in m.text)
        reached = [m.seq for m in station.log if m.get_type() == "MISSION_ITEM_REACHED"]
        assert reached == [1, 2, 3]
        assert "verdict (flown): FLYABLE" in station.texts()
    log = read_log(vehicle.folder / "logs" / "flight-001.mcap")
    assert log.complete
    assert log.ended == "completed"
    again = fly_to_end(Flight(log.setup, load_uav(log.setup.scenario).aircraft))
    assert again.track.position.tobytes() == log.track.position.tobytes()
    assert main(["check", str(vehicle.folder / "logs" / "flight-001.mcap")]) == 0


def flown_until_a_power_cut(vehicle: Served, logs: str, seed: int) -> tuple[Path, float]:
    """Kill -9 of all of a vehicle's processes, in flight, at any moment: its log, and how long it has flown, s."""
    with UdpStation(vehicle.port) as station:
        assert station.upload(LONG) == 0
        station.fly()
        begun = station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.vy > 0).time_boot_ms
        last = station.listen(random.Random(seed).uniform(1.0, 4.0))
        vehicle.kill()
    flown = max(m.time_boot_ms for m in last if m.get_type() == "GLOBAL_POSITION_INT") - begun
    return max((vehicle.folder / logs).iterdir()), flown / 1000.0


@pytest.mark.parametrize("first", range(0, scaled(200, 1), AT_ONCE))
def test_a_power_cut_loses_at_most_a_second(serve: Callable[..., Served], real: Served, first: int) -> None:
    """What is logged is exact, and no more than a second is lost; a few vehicles at once, since they mostly wait."""

    def flown(seed: int) -> tuple[Path, float]:
        if not SOAK:
            return flown_until_a_power_cut(real, "logs", seed)
        logs = f"logs-{seed}"
        return flown_until_a_power_cut(serve("--scenario", "field.toml", "--log", logs), logs, seed)

    seeds = range(first, min(first + AT_ONCE, scaled(200, 1)))
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(flown, seeds))
    lost = []
    for path, seconds in found:
        log = read_log(path)
        assert not log.complete
        assert log.end_time >= seconds - 1.0
        whole = fly_to_end(Flight(log.setup, load_uav(log.setup.scenario).aircraft)).track
        count = len(log.track)
        assert count > 30
        assert np.array_equal(whole.position[:count], log.track.position)
        assert np.array_equal(whole.controls[:count], log.track.controls)
        lost.append(seconds - log.end_time)
    tally("kill -9 of a served flight", kills=len(lost), damaged=0)
    widen("kill -9 of a served flight", longest_lost_s=round(max(lost), 3))


def test_a_mission_that_cannot_be_flown_is_armed_only_by_force(quick: Served) -> None:
    """It is stored, warned of, and armed only by force; the forced flight is logged and judged."""
    with UdpStation(quick.port) as station:
        assert station.upload(STEEP) == 0
        assert station.command(400, 1) == mavlink.MAV_RESULT_DENIED
        station.listen(0.3)
        assert "NOT FLYABLE" in station.texts()
        assert "slope: leg" in station.texts()
        far = [ROUTE[0], item(1, -LAT, LON, 100.0), item(2, -LAT, LON + 40_000, 100.0)]
        assert station.upload(far) == 0
        assert station.command(400, 1, 21196) == mavlink.MAV_RESULT_DENIED
        assert "mission cannot be flown" in station.texts()
        assert station.upload(STEEP) == 0
        station.send(mavlink.MAVLink_param_set_message(1, 1, b"PFLY_FORCE", 1.0, 9))
        station.until(lambda m: m.get_type() == "PARAM_VALUE" and m.param_value == 1.0)
        station.fly()
        station.until(lambda m: m.get_type() == "STATUSTEXT" and m.text.startswith("log"))
        assert "verdict (flown): NOT FLYABLE" in station.texts()
        station.send(mavlink.MAVLink_param_set_message(1, 1, b"PFLY_FORCE", 0.0, 9))
        station.until(lambda m: m.get_type() == "PARAM_VALUE" and m.param_value == 0.0)
    assert main(["check", str(max((quick.folder / "logs").iterdir()))]) == 4


def test_a_station_without_heartbeats_uploads_floats_and_flies(quick: Served) -> None:
    """A script on this machine that knows only MISSION_ITEM; the flight starts at the item that it sets."""
    with UdpStation(quick.port, mute=True) as station:
        station.send(mavlink.MAVLink_mission_count_message(1, 1, len(LONG), 0))
        for k, one in enumerate(LONG):
            station.until(lambda m, k=k: m.get_type().startswith("MISSION_REQUEST") and m.seq == k)
            place = (one.x / 1e7, one.y / 1e7, one.z)
            station.send(
                mavlink.MAVLink_mission_item_message(1, 1, k, one.frame, one.command, 0, 1, *[0.0] * 4, *place, 0)
            )
        assert station.until(lambda m: m.get_type() == "MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
        station.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
        station.until(lambda m: m.get_type() == "MISSION_CURRENT" and m.seq == 2)
        station.fly()
        station.until(done)
        assert [m.seq for m in station.log if m.get_type() == "MISSION_ITEM_REACHED"] == [2, 3]
        assert "MISSION_ITEM_INT is exact" in station.texts()
        station.until(lambda m: m.get_type() == "STATUSTEXT" and m.text.startswith("log"))
    log = read_log(max((quick.folder / "logs").iterdir()))
    assert [one.seq for one in log.setup.mission.items] == [2, 3]


def test_of_two_stations_over_sockets_one_wins(quick: Served) -> None:
    rng = random.Random(4)
    with UdpStation(quick.port) as one, UdpStation(quick.port, system=254) as two:
        for station in (one, two):
            station.until(lambda m: m.get_type() == "HEARTBEAT")
        for _ in range(100 if SOAK else 5):
            first, second = (one, two) if rng.random() < 0.5 else (two, one)
            first.send(mavlink.MAVLink_mission_count_message(1, 1, len(ROUTE), 0))
            first.until(lambda m: m.get_type() == "MISSION_REQUEST_INT")
            second.send(mavlink.MAVLink_mission_count_message(1, 1, len(LONG), 0))
            assert second.until(lambda m: m.get_type() == "MISSION_ACK").type == mavlink.MAV_MISSION_DENIED
            assert first.upload(ROUTE) == 0
            first.send(mavlink.MAVLink_mission_request_int_message(1, 1, 3, 0))
            back = first.until(lambda m: m.get_type() == "MISSION_ITEM_INT")
            assert (back.x, back.y) == (ROUTE[3].x, ROUTE[3].y)


def test_its_sockets_are_those_of_the_table_of_the_network_page(quick: Served) -> None:
    assert listening(quick.process.pid) == table()["`serve`"]


def test_the_vehicle_outlives_the_process_that_flies(quick: Served) -> None:
    """The vehicle stays, says so, and flies the next mission."""
    with UdpStation(quick.port) as station:
        assert station.upload(LONG) == 0
        station.fly()
        flying = [n for n in quick.children() if "spawn_main" in Path(f"/proc/{n}/cmdline").read_text("utf-8")]
        os.kill(flying[0], signal.SIGKILL)
        station.until(lambda m: m.get_type() == "STATUSTEXT" and "died" in m.text)
        assert station.command(400, 1) == mavlink.MAV_RESULT_DENIED
        assert station.upload(ROUTE) == 0
        station.fly()
        station.until(done)


@pytest.mark.skipif(not SOAK, reason="a stranger who attacks a signed link hears nothing either: in make soak")
def test_a_key_shuts_strangers_out(serve: Callable[..., Served], tmp_path: Path) -> None:
    """A station that signs is served; one that does not is called by heartbeats alone."""
    key = bytes(range(32))
    (tmp_path / "key").write_text(key.hex(), encoding="ascii")
    (tmp_path / "key").chmod(0o600)
    vehicle = serve("--scenario", "field.toml", "--sign-key", "key")
    with UdpStation(vehicle.port) as stranger, UdpStation(vehicle.port, system=254) as station:
        for mav in (station.mav, station.parser):
            mav.signing.secret_key = key
            mav.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)
        station.mav.signing.sign_outgoing = True
        assert station.upload(ROUTE) == 0
        assert station.until(lambda m: m.get_type() == "ATTITUDE").get_signed()
        assert stranger.listen(1.5) == []
    assert vehicle.stop() == 0


EPOCH_2015 = 1_420_070_400


def signed_frames(key: bytes, stamps: list[int], link_id: int, system: int = 253) -> list[bytes]:
    """A frame that asks for all parameters for each timestamp, signed by pymavlink."""
    mav = mavlink.MAVLink(None, system, 190)
    mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.link_id = key, True, link_id
    frames = []
    for stamp in stamps:
        mav.signing.timestamp = stamp
        frames.append(mavlink.MAVLink_param_request_list_message(1, 1).pack(mav))
    return frames


def attacks(key: bytes, heard: bytes) -> dict[str, list[bytes]]:
    """Datagrams by the reason for which a vehicle drops each; heard: a frame of the station, signed."""
    now = int((time.time() - EPOCH_2015) * 1e5)
    minute, day = 6_000_000, 8_640_000_000
    # A frame of the station under other link ids, which its signature covers.
    moved = [heard[:-13] + bytes([n]) + heard[-12:] for n in range(256) if n != heard[-13]]
    return {
        "future": signed_frames(key, [2**48 - 1, 2**48 - 2, now + 2 * day], 7),
        "forged": [*moved, *signed_frames(bytes(32), [2**48 - 1] * 200, 8)],
        # The same frame again, and a system's clock that goes back.
        "replayed": [heard] * 50,
        "old": signed_frames(key, [now - 2 * minute, now - 365 * day, 1], 9),
        "unsigned": [mavlink.MAVLink_param_request_list_message(1, 1).pack(mavlink.MAVLink(None, 253, 190))] * 2000,
    }


@only_in_soak
def test_no_attack_on_a_signed_link_ends_a_flight_but_ctrl_c(serve: Callable[..., Served], tmp_path: Path) -> None:
    """Timestamps of the far future, wrong link ids, replay, rollback and a flood, all in flight.

    The mission is from a file, with a gap in its numbers, and is given to stations that ask for it; the log is closed.
    """
    key = bytes(range(32))
    (tmp_path / "key").write_text(key.hex(), encoding="ascii")
    (tmp_path / "key").chmod(0o600)
    lines = ["0 1 0 16 0 0 0 0 46 8 0 1", "3 0 0 16 0 0 0 0 46 8 100 1", "7 0 3 16 0 0 0 0 46 8.03 100 1"]
    (tmp_path / "m.waypoints").write_text("\n".join(["QGC WPL 110", *lines]) + "\n", encoding="ascii")
    vehicle = serve("m.waypoints", "--scenario", "field.toml", "--sign-key", "key")
    with UdpStation(vehicle.port, system=254) as station, UdpStation(vehicle.port, mute=True) as thief:
        for mav in (station.mav, station.parser):
            mav.signing.secret_key = key
            mav.signing.timestamp = int((time.time() - EPOCH_2015) * 1e5)
        station.mav.signing.sign_outgoing = True
        station.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
        assert station.until(lambda m: m.get_type() == "MISSION_COUNT").count == 3
        station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 2, 0))
        back = station.until(lambda m: m.get_type() == "MISSION_ITEM_INT")
        assert (back.seq, back.frame, back.x, back.y) == (2, 3, LAT, LON + 300_000)
        station.fly()
        station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.vy > 0)
        heard = mavlink.MAVLink_param_request_read_message(1, 1, b"", 0).pack(station.mav)
        station.socket.sendto(heard, station.to)
        station.until(lambda m: m.get_type() == "PARAM_VALUE")
        tried = attacks(key, heard)
        for reason, datagrams in tried.items():
            for number, data in enumerate(datagrams):
                thief.socket.sendto(data, thief.to)
                if number % 50 == 49:
                    # What the vehicle answers between two bursts: the kernel's queue for its socket is short.
                    station.command(511, 30, 33_333)
            assert station.command(511, 30, 33_333) == 0, reason
        assert station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT").get_signed()
        assert thief.listen(0.5) == []
    assert vehicle.stop() == 0
    (told,) = (line for line in vehicle.lines if line.startswith("frames dropped"))
    counts = {word: int(count.replace(",", "")) for count, word in (part.split() for part in told[16:].split(", "))}
    assert counts == {reason: len(datagrams) for reason, datagrams in tried.items()}
    assert sum("more than a day ahead" in line for line in vehicle.lines) == 1
    log = read_log(vehicle.folder / "logs" / "flight-001.mcap")
    assert log.complete
    assert log.ended == "stopped: the vehicle was shut down"


@pytest.mark.skipif(not SOAK, reason="others stand by, too, and this one is the largest: in make soak")
def test_the_default_scenario_stands_by(serve: Callable[..., Served]) -> None:
    vehicle = serve()
    with UdpStation(vehicle.port) as station:
        place = station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT")
        assert math.isclose(place.lat / 1e7, 36.3, abs_tol=0.1)
        assert math.isclose(place.relative_alt / 1e3, 150.0, abs_tol=1.0)
        state = station.until(lambda m: m.get_type() == "MISSION_CURRENT")
        assert state.mission_state == mavlink.MISSION_STATE_NO_MISSION
        assert station.command(176, 1, 10) == mavlink.MAV_RESULT_DENIED
        station.send(mavlink.MAVLink_param_request_list_message(1, 1))
        count = station.until(lambda m: m.get_type() == "PARAM_VALUE").param_count
        station.listen(0.5)
        names = {m.param_id for m in station.log if m.get_type() == "PARAM_VALUE"}
        assert len(names) == count
        assert {"AIRSPEED_CRUISE", "PFLY_FORCE"} <= names
    assert vehicle.stop() == 0


@pytest.mark.parametrize(
    ("argv", "word"),
    [
        (["--bind", "0.0.0.0:0"], "--bind 0.0.0.0:0"),
        (["--to", "192.0.2.1:14550"], "--to 192.0.2.1"),
        (["--to", "here:14550"], "expected an IP address"),
        (["--to", "127.0.0.1:x"], "expected IP:PORT"),
        (["--speed", "0"], "0.1 to 100"),
        (["none.waypoints"], "no such file"),
        (["--sign-key", "none"], "none: cannot be read"),
        (["--allow", "300.1.1.1"], "--allow 300.1.1.1"),
        ([], "mission: missing; expected a mission, or --scenario NAME, in which to wait for the upload of a mission"),
        (["--aircraft", "nothing", "--scenario", "jacksboro-air"], "no aircraft called 'nothing'"),
        (["--wind", "8", "--scenario", "jacksboro-air"], "--wind"),
    ],
)
def test_bad_usage_is_refused(
    argv: list[str], word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        code = main(["serve", *argv])
    except SystemExit as exit_:
        code = exit_.code
    assert code == 2
    assert word in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_its_help_names_modes_and_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    """Every mode that a station may choose but MANUAL, in which nothing flies, and the parameter of planfly's own."""
    with pytest.raises(SystemExit):
        main(["serve", "--help"])
    out = capsys.readouterr().out
    assert [name for name in (*MODE_NAMES.values(), FORCE) if not re.search(rf"\b{name}\b", out)] == ["MANUAL"]
