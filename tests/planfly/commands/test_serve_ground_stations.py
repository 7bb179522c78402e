"""The ground stations that people have: MAVSDK and MAVProxy, as subprocesses, offline.

MAVProxy is GPL: nothing of it is imported.  In CI a client that is missing fails; elsewhere the test is skipped and
says why.
"""

import importlib.util
import json
import queue
import random
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink_messages

from logs.recording.reader import read_log
from tests.clients import need as client
from tests.planfly.conftest import Served
from tests.soak import SOAK, only_in_soak

pytestmark = pytest.mark.client

SCRIPT = Path(__file__).parents[2] / "clients" / "mavsdk_session.py"
PROXY = Path(__file__).parents[2] / "clients" / "lossy_proxy.py"
LAT, LON = 460_000_000, 80_000_000
ITEMS = [
    [0, 16, 0, 0, LAT, LON, 0.0],
    [0, 16, 0, 0, LAT, LON, 100.0],
    [3, 16, 0, 12, LAT, LON + 33_333, 100.0],
    [0, 16, 0, 0, LAT + 3_001, LON + 65_007, 100.0],
]
WPL = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0000000\t8.0000000\t0.000000\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0000000\t8.0000000\t100.000000\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.0000000\t8.0033333\t100.000000\t1
3\t0\t0\t16\t0\t0\t0\t0\t46.0003001\t8.0065007\t100.000000\t1
"""
FENCE = "QGC WPL 110\n0\t0\t3\t5004\t50\t0\t0\t0\t46.0100000\t8.0100000\t0\t1\n"
RALLY = "QGC WPL 110\n0\t0\t3\t5100\t0\t0\t0\t0\t46.0010000\t8.0100000\t80\t1\n"


def need(package: str) -> None:
    spec = importlib.util.find_spec(package)
    client(spec.origin if spec else None, package, f"pip install {package}")


def free_port() -> int:
    """A port that nobody listens on, below those that systems hand out: no other test's socket takes it."""
    while True:
        port = random.SystemRandom().randrange(10_000, 30_000)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            try:
                one.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port


def mavsdk(folder: Path, port: int, rows: list[list[float]], task: str, limit: float = 600.0) -> dict[str, object]:
    need("mavsdk")
    (folder / "items.json").write_text(json.dumps(rows), encoding="utf-8")
    result = subprocess.run(
        [sys.executable, SCRIPT, str(port), "items.json", task],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=limit,
    )
    # MAVSDK's errors name every item that was sent, by its address.
    assert result.returncode == 0, re.sub(r"<mavsdk[^>]*>,? ?", "", result.stderr)[-3000:]
    return json.loads(result.stdout.strip().splitlines()[-1])


def uploads_arms_starts_and_sees_the_end(folder: Path, port: int) -> dict[str, object]:
    """A flight by MAVSDK's items as they are: what its script found."""
    found = mavsdk(folder, port, ITEMS, "fly")
    assert found["back"] == ITEMS, "identical integers"
    assert found["downloads"] == 1
    assert (found["healthy"], found["armed"], found["early"], found["finished"]) == (True, True, False, True)
    return found


@pytest.mark.skipif(not SOAK, reason="the vehicle of the next but one is flown so, too: in make soak")
@pytest.mark.parametrize("speed", [1, 50])
def test_mavsdk_uploads_arms_starts_and_sees_the_end(serve: Callable[..., Served], tmp_path: Path, speed: int) -> None:
    need("mavsdk")
    port = free_port()
    vehicle = serve("--scenario", "field.toml", "--speed", str(speed), to=port)
    found = uploads_arms_starts_and_sees_the_end(tmp_path, port)
    if speed == 1:
        assert found["flown_s"] > 15.0
        assert found["places"] > 100
    assert vehicle.stop() == 0
    assert read_log(tmp_path / "logs" / "flight-001.mcap").ended == "completed"


@pytest.mark.skipif(not SOAK, reason="MAVSDK uploads, flies and is answered in other tests: in make soak")
def test_mavsdks_mission_plugin_sends_no_home(serve: Callable[..., Served], tmp_path: Path) -> None:
    need("mavsdk")
    port = free_port()
    vehicle = serve("--scenario", "field.toml", "--speed", "20", to=port)
    found = mavsdk(tmp_path, port, [[46.0, 8.0, 100.0], [46.0, 8.0033, 100.0], [46.0003, 8.0065, 110.0]], "plan")
    assert (found["finished"], found["progress"]) == (True, [3, 3])
    assert vehicle.stop() == 0
    log = read_log(tmp_path / "logs" / "flight-001.mcap")
    assert len(log.setup.route.points) == 3
    assert log.setup.route.positions[:, 2] == pytest.approx([100.0, 100.0, 110.0])


def test_mavsdk_flies_and_has_it_hold_go_elsewhere_go_on_and_return(
    serve: Callable[..., Served], tmp_path: Path
) -> None:
    """What a person asks MAVSDK for is flown, a log each, with the parameter that was set; the rest is refused."""
    need("mavsdk")
    rows = [[46.0, 8.0, 100.0], [46.0, 8.0033, 100.0], [46.0, 8.0165, 100.0], [46.0, 8.03, 100.0]]
    port = free_port()
    vehicle = serve("--scenario", "field.toml", "--speed", "5", to=port)
    uploads_arms_starts_and_sees_the_end(tmp_path, port)
    found = mavsdk(tmp_path, port, rows, "ask")
    assert found["ground"] == {"item": "SUCCESS", "set": "SUCCESS", "lowered": 20.0, "listed": -20.0}
    done = dict.fromkeys(("pause", "resume", "hold", "go", "item", "return"), "SUCCESS")
    assert found["flight"] == {**done, "speed": "UNSUPPORTED", "orbit": "UNSUPPORTED"}
    vehicle.wait(lambda line: "flying in RTL" in line)
    assert vehicle.stop() == 0
    modes = [line.split("flying in ")[1] for line in vehicle.lines if "flying in " in line]
    assert modes == ["LOITER", "AUTO", "LOITER", "GUIDED", "GUIDED", "RTL"], "MAVSDK's go-to is a mode, then a place"
    # What is left within a second has no log.
    first, *logs = (read_log(path) for path in sorted((tmp_path / "logs").glob("*.mcap")))
    assert first.ended == "completed"
    assert len(logs[0].setup.route.positions) == 3, "from the second place on"
    assert logs[-1].setup.mission.items[-1].command == mavlink_messages.MAV_CMD_NAV_RETURN_TO_LAUNCH
    assert {log.setup.autopilot.parameters.wp_radius for log in logs} == {70.0}


@pytest.mark.skipif(not SOAK, reason="a bad link is tried with a station of ours, too: in make soak")
def test_mavsdk_uploads_over_a_bad_link(serve: Callable[..., Served], tmp_path: Path) -> None:
    """One datagram in ten lost each way: 200 items, all arrive as they were sent."""
    need("mavsdk")
    count = 200
    port, middle = free_port(), free_port()
    vehicle = serve("--scenario", "field.toml", to=middle)
    rows = [[0, 16, 0, 0, LAT + 900 * (k % 20), LON + 500 * k, 100.0] for k in range(count)]
    proxy = subprocess.Popen([sys.executable, PROXY, str(middle), str(vehicle.port), str(port), "0.1"])
    try:
        found = mavsdk(tmp_path, port, rows, "upload", 300.0)
    finally:
        proxy.kill()
        proxy.wait()
    assert found["back"] == rows
    assert vehicle.stop() == 0


class MavProxy:
    """A headless MAVProxy whose keyboard and screen are ours."""

    def __init__(self, folder: Path, port: int) -> None:
        modules = "wp,fence,rally,param,arm,mode,misc,cmdlong,link,log,output"
        script = Path(sys.executable).with_name("mavproxy.py")
        self.process = subprocess.Popen(
            [sys.executable, script, f"--master=udpin:127.0.0.1:{port}", "--no-state", f"--default-modules={modules}"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            bufsize=1,
        )
        self.text = ""
        self._pieces: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self._pieces.put(line)

    def type(self, line: str) -> None:
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def expect(self, pattern: str, limit: float = 30.0) -> str:
        """Wait until the screen shows a pattern after what was already waited for."""
        end, seen = time.monotonic() + limit, ""
        while time.monotonic() < end:
            try:
                seen += self._pieces.get(timeout=0.1)
            except queue.Empty:
                continue
            if re.search(pattern, seen):
                self.text += seen
                return seen
        raise AssertionError(f"{pattern!r} was not shown:\n{self.text}{seen}")

    def close(self) -> None:
        self.process.kill()
        self.process.wait(10.0)
        self._reader.join(5.0)
        self.process.stdin.close()
        self.process.stdout.close()


@pytest.fixture
def mavproxy(tmp_path: Path) -> Iterator[Callable[[int], MavProxy]]:
    need("MAVProxy")
    started: list[MavProxy] = []

    def start(port: int) -> MavProxy:
        started.append(MavProxy(tmp_path, port))
        return started[-1]

    yield start
    for one in started:
        one.close()


@only_in_soak
def test_mavproxy_loads_arms_flies_elsewhere_and_saves(
    serve: Callable[..., Served], mavproxy: Callable[[int], MavProxy], tmp_path: Path
) -> None:
    for name, text in (("m.waypoints", WPL), ("f.txt", FENCE), ("r.txt", RALLY)):
        (tmp_path / name).write_text(text, encoding="ascii")
    port = free_port()
    vehicle = serve("--scenario", "field.toml", "--speed", "5", to=port)
    user = mavproxy(port)
    user.expect(r"Received \d+ parameters", 60.0)
    user.type("wp load m.waypoints")
    user.expect(r"TYPE_MISSION: ACCEPTED[\s\S]*verdict \(geometry\): FLYABLE")
    user.type("fence load f.txt")
    user.expect("TYPE_FENCE: ACCEPTED")
    user.type("rally load r.txt")
    user.expect("TYPE_RALLY: ACCEPTED")
    user.type("wp save back.txt")
    user.expect("Saved 4 waypoints")
    user.type("arm throttle")
    user.expect("COMPONENT_ARM_DISARM: ACCEPTED")
    user.type("param set WP_RADIUS 70")
    user.expect(r"verdict \(geometry\): FLYABLE")
    user.type("param show WP_RADIUS")
    user.expect(r"WP_RADIUS\s+70\.0")
    user.type("mode AUTO")
    user.expect("mission started")
    # A log holds a second at the least.
    time.sleep(1.5)
    user.type("mode LOITER")
    user.expect("flying in LOITER")
    user.type("guided 46.001 8.002 130")
    user.expect("flying in GUIDED")
    user.type("mode RTL")
    user.expect("flying in RTL")
    user.expect("flight completed")
    user.expect(r"(?s)(?=.*DISARMED)(?=.*verdict \(flown in RTL\): FLYABLE)")
    user.type("link")
    user.expect(r"link 1 OK .* 0\.0% loss")
    assert "fence breach" not in user.text
    assert vehicle.stop() == 0
    log, last = (read_log(tmp_path / "logs" / f"flight-00{number}.mcap") for number in (1, 4))
    assert (log.setup.autopilot.parameters.wp_radius, last.ended) == (70.0, "completed")
    sent, kept = (
        [[float(value) for value in line.split()[8:11]] for line in text.splitlines()[1:]]
        for text in (WPL, (tmp_path / "back.txt").read_text(encoding="ascii"))
    )
    # It truncates what it sends, one unit of 1e-7 degrees, and saves six decimals, five units.
    flown = [[item.lat_deg, item.lon_deg] for item in log.setup.mission.items]
    for mine, saved, stored in zip(sent[1:], kept[1:], flown, strict=True):
        assert stored == pytest.approx(mine[:2], abs=1.5e-7)
        assert saved[:2] == pytest.approx(stored, abs=5.5e-7)
