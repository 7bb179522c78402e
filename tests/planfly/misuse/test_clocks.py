"""A laptop that sleeps, and a wall clock that is set back: what goes on by the clock goes on where it was."""

import itertools
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from logs.recording.reader import read_log
from planfly.campaigns.tables import read_table
from planfly.cli import main
from planfly.commands import replay
from tests.flight.live.fake_vehicle import KEY
from tests.logs.made_flight import make_setup, make_track, record
from tests.planfly.conftest import FIELD, Served
from tests.planfly.misuse.every_command import SHORT
from tests.soak import SOAK, only_in_soak
from tests.stations import UdpStation, item
from world import running_clock

LAT, LON = 460_000_000, 80_000_000
ROUTE = [
    item(0, LAT, LON, 0.0),
    item(1, LAT, LON, 100.0),
    item(2, LAT, LON + 33_333, 100.0, frame=3),
    item(3, LAT, LON + 300_000, 100.0),
]
# A wall clock that is an hour back as soon as a file is there.
SET_BACK = """
import os, time
real = time.time
time.time = lambda: real() - (3600.0 if os.path.exists({flag!r}) else 0.0)
"""


@only_in_soak
def test_a_served_flight_goes_on_through_a_sleep_and_a_clock_that_is_set_back(
    serve: Callable[..., Served], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a signed link.  All of its processes are stopped for 3 s, as a sleep stops them, and later it is an hour ago.

    The flight is 3 s late, and lacks no row; the station hears all of it, and the log knows nothing of the clock.
    """
    (tmp_path / "key").write_text(KEY.hex(), encoding="ascii")
    (tmp_path / "key").chmod(0o600)
    flag = tmp_path / "back"
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(SET_BACK.format(flag=str(flag)), encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "site"), *filter(None, sys.path)]))
    vehicle = serve("--scenario", "field.toml", "--sign-key", "key")
    with UdpStation(vehicle.port) as station:
        station.mav.signing.secret_key, station.mav.signing.sign_outgoing = KEY, True
        station.mav.signing.timestamp = round((time.time() - 1_420_070_400.0) * 1e5)
        station.parser.signing.secret_key = KEY
        assert station.upload(ROUTE) == 0
        started = time.monotonic()
        station.fly()
        begun = station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.vy > 0)
        before = station.listen(0.7)
        os.killpg(vehicle.process.pid, signal.SIGSTOP)
        time.sleep(3.0)
        while station.receive():
            pass
        os.killpg(vehicle.process.pid, signal.SIGCONT)
        after = station.listen(1.5)
        assert station.command(512, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == mavlink.MAV_RESULT_ACCEPTED
        flag.touch()
        late = station.listen(1.0)
        station.send(mavlink.MAVLink_command_long_message(1, 1, 512, 0, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, *[0.0] * 6))
        told = station.until(lambda m: m.get_type() == "SYSTEM_TIME")
        assert told.get_signed()
        assert told.time_unix_usec / 1e6 == pytest.approx(time.time() - 3600.0, abs=60.0)
        assert station.command(400, 0, 21196) == mavlink.MAV_RESULT_ACCEPTED
        real = time.monotonic() - started
        station.until(lambda m: m.get_type() == "STATUSTEXT" and "log" in m.text)
    assert vehicle.stop() == 0
    east = [m.lon for m in (begun, *before, *after) if m.get_type() == "GLOBAL_POSITION_INT"]
    # 25 m/s and a light wind for as long as it flew: never 3 s in one leap.
    steps = np.diff(east) * 1e-7 * 111_320.0 * np.cos(np.deg2rad(46.0))
    assert steps.max() < 40.0
    boots = [m.time_boot_ms for m in late if m.get_type() == "ATTITUDE"]
    assert len(boots) > 20
    assert all(early <= later for early, later in itertools.pairwise(boots))
    assert not any("old" in line or "replayed" in line for line in vehicle.lines if line.startswith("frames dropped"))
    log = read_log(vehicle.folder / "logs" / "flight-001.mcap")
    assert log.complete
    assert np.allclose(np.diff(log.track.time), 1.0 / 60.0, atol=1e-6)
    assert 0.5 < log.end_time < real - 3.0 + 0.6, "half a second is made up for at most"


def test_a_replay_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """12 s in 3 s, asleep for an hour: what comes next is not what would have come meanwhile."""
    record(tmp_path / "f.mcap", make_setup(), make_track(12.0))
    now, waited = 100.0, 0.0

    def sleep(seconds: float) -> None:
        nonlocal now, waited
        # No clock of a system's tells a millionth of a microsecond.
        seconds = max(seconds, 1e-6)
        now, waited = now + seconds + (3600.0 if waited == 0.0 else 0.0), waited + seconds

    monkeypatch.setattr(replay, "time", SimpleNamespace(sleep=sleep))
    monkeypatch.setattr(running_clock, "time", SimpleNamespace(monotonic=lambda: now))
    assert main(["replay", str(tmp_path / "f.mcap"), "--speed", "4"]) == 0
    assert "s  end " in capsys.readouterr().out
    # The hour counts as a second of the 3.
    assert waited == pytest.approx(3.0 - (1.0 - 0.1), abs=0.01)


# A wall clock that an hour is taken from where one file is there, and a day added where another is.
SET = """
import os, time
real = time.time
time.time = lambda: real() - 3600.0 * os.path.exists({back!r}) + 86400.0 * os.path.exists({forth!r})
"""
FLIGHTS = 40


@pytest.mark.skipif(not SOAK, reason="half a minute; set PLANFLY_SOAK=1")
def test_a_campaign_survives_a_clock_that_is_set_back_and_forth(tmp_path: Path) -> None:
    """Of its process and its workers: no flight is lost, and none took an hour."""
    for name in ("site", "out"):
        (tmp_path / name).mkdir()
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    (tmp_path / "short.waypoints").write_text(SHORT, encoding="ascii")
    back, forth = tmp_path / "back", tmp_path / "forth"
    (tmp_path / "site" / "sitecustomize.py").write_text(SET.format(back=str(back), forth=str(forth)), encoding="utf-8")
    argv = ["campaign", "short.waypoints", "--scenario", "field.toml", "--flights", str(FLIGHTS), "--workers", "2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "planfly", *argv, "--out", "out", "--overwrite"],
        cwd=tmp_path,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), *filter(None, sys.path)])},
    )
    until = time.monotonic() + 300.0
    for flag in (back, forth, back):
        begun = logged(tmp_path / "out")
        while process.poll() is None and logged(tmp_path / "out") < begun + 20_000:
            assert time.monotonic() < until
            time.sleep(0.05)
        assert process.poll() is None, "it was over before its clock was set"
        flag.unlink() if flag.exists() else flag.touch()
    said, _ = process.communicate(timeout=300.0)
    assert process.returncode in (0, 3, 4), said
    assert "Traceback" not in said
    table = read_table(tmp_path / "out" / "campaign.sqlite")
    assert len(table["flight"]) == FLIGHTS
    assert "lost" not in table["outcome"].tolist()
    assert 0.0 < table["seconds"].min() <= table["seconds"].max() < 60.0


def logged(folder: Path) -> int:
    """Bytes of the log of a table's rows, which nobody else can read meanwhile: 4 kB or more each."""
    log = folder / "campaign.sqlite-wal"
    return log.stat().st_size if log.exists() else 0


def test_durations_are_taken_from_clocks_that_nobody_sets() -> None:
    """The wall clock is read where a station is told the time, and nowhere else."""
    root = Path(__file__).parents[3]
    found = [
        path.relative_to(root).as_posix()
        for package in ("aircraft", "flight", "logs", "planfly", "planner", "world")
        for path in sorted((root / package).rglob("*.py"))
        if re.search(
            r"\btime\.time(_ns)?\(|from time import .*\btime\b|datetime\.(now|utcnow|today)\(", path.read_text("utf-8")
        )
    ]
    assert found == ["flight/live/vehicle.py", "planfly/replays/stations.py"]
