"""``planfly replay --to``: a log played into a ground station of our own over a real socket."""

import subprocess
import sys
from pathlib import Path

import pytest

from logs.recording.reader import read_log
from planfly.cli import main
from tests.planfly.conftest import FIELD
from tests.stations import UdpStation, item

LAT, LON = 460_000_000, 80_000_000
ROUTE = [
    item(0, LAT, LON, 0.0),
    item(1, LAT, LON, 100.0),
    item(2, LAT, LON + 33_333, 100.0, frame=3),
    item(3, LAT + 3_000, LON + 65_000, 100.0),
]


def done(message: object) -> bool:
    return message.get_type() == "MISSION_CURRENT" and message.mission_state == 5


@pytest.fixture
def served_log(tmp_path: Path) -> Path:
    """A flight log of the route above, made without a vehicle."""
    (tmp_path / "f.toml").write_text(FIELD, encoding="utf-8")
    rows = [(0, LAT, LON, 0.0, 0), *((one.seq, one.x, one.y, one.z, one.frame) for one in ROUTE[1:])]
    lines = [
        f"{k}\t{int(k == 0)}\t{frame}\t16\t0\t0\t0\t0\t{x / 1e7:.7f}\t{y / 1e7:.7f}\t{z}\t1"
        for k, x, y, z, frame in rows
    ]
    (tmp_path / "m.waypoints").write_text("\n".join(["QGC WPL 110", *lines]) + "\n", encoding="ascii")
    log = tmp_path / "played.mcap"
    assert main(["fly", str(tmp_path / "m.waypoints"), "--scenario", str(tmp_path / "f.toml"), "--log", str(log)]) == 0
    return log


def test_a_log_is_played_into_a_station(tmp_path: Path, served_log: Path) -> None:
    """Heartbeats call it; positions, modes and the end come as they were flown."""
    log = read_log(served_log)
    with UdpStation(9) as station:
        port = station.socket.getsockname()[1]
        play = subprocess.Popen(
            [sys.executable, "-m", "planfly", "replay", str(served_log), "--to", f"127.0.0.1:{port}", "--speed", "8"],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        station.socket.settimeout(60.0)
        _, station.to = station.socket.recvfrom(4096)
        station.socket.settimeout(0.01)
        station.until(done)
        _, errors = play.communicate(timeout=120.0)
    assert play.returncode == 0, errors
    east = [m.lon for m in station.log if m.get_type() == "GLOBAL_POSITION_INT"]
    assert len(set(east)) > 15
    assert max(east) - min(east) > 0.95 * (ROUTE[3].y - ROUTE[1].y)
    assert log.ended in station.texts()
    assert main(["replay", str(served_log), "--to", "127.0.0.1:9", "--wait", "0.3"]) == 2
