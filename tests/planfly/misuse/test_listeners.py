"""Every socket on which planfly waits for somebody, as the system lists them, against the table of the network page."""

import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import psutil
import pytest

from flight.autopilots.arduplane_sitl.physics import PhysicsPort
from flight.autopilots.px4_sitl.physics import SimulatorPort
from flight.autopilots.sitl.link import TcpLink, UdpLink
from logs.recording.example_log import write_example_log
from planfly.cli import build_parser, main
from tests.planfly.conftest import FIELD
from tests.soak.test_hostile_files import WPL

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "network-security.md"
# What opens a socket, in a source; and the files that may, with the commands of the table whose listeners they hold.
OPENS = re.compile(r"socket\.socket\(|create_server\(|start_server\(|\.LocalCluster\(|HTTPServer\(|\bListener\(")
HOLD = {
    "flight/autopilots/arduplane_sitl/physics.py": "`fly`, `run` with `--sitl`",
    "flight/autopilots/px4_sitl/physics.py": "`fly`, `run` with `--sitl ./px4`",
    # Of both; it also asks the system for ports that are free, and closes them.
    "flight/autopilots/sitl/link.py": "`fly`, `run` with `--sitl`",
    "flight/live/link.py": "`serve`",
    "planfly/replays/foxglove_server.py": "`replay --foxglove`",
    "planfly/replays/origin_gate.py": "`replay --foxglove`",
    "planfly/studio/open_studio.py": "`studio`",
}


def table() -> dict[str, Counter[str]]:
    """Of each command of the table, its sockets, with the fixed ports left out: "TCP 127.0.0.1"."""
    found: dict[str, Counter[str]] = {}
    rows = [line.strip("|").split("|") for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:3] == "| `"]
    for command, _, place, *_ in (row for row in rows if len(row) == 5):
        kind = re.fullmatch(r" ((?:TCP|UDP) [\d.]+), (?:free port|port \d+) ", place)
        assert kind, place
        found.setdefault(command.strip(), Counter())[kind[1]] += 1
    return found


def listening(pid: int) -> Counter[str]:
    """Sockets of a process and its children on which somebody may be heard, each as "TCP 127.0.0.1"."""
    process = psutil.Process(pid)
    found: Counter[str] = Counter()
    for one in (process, *process.children(recursive=True)):
        for connection in one.net_connections(kind="inet"):
            if connection.status in (psutil.CONN_LISTEN, psutil.CONN_NONE):
                found[f"{'TCP' if connection.status == psutil.CONN_LISTEN else 'UDP'} {connection.laddr.ip}"] += 1
    return found


@pytest.mark.parametrize("command", ["`replay --to`", "`replay --foxglove`"])
def test_a_replay(tmp_path: Path, command: str) -> None:
    if "foxglove" in command:
        pytest.importorskip("foxglove")
    how = ["--to", "127.0.0.1:9", "--wait", "100"] if "--to" in command else ["--foxglove", "--port", "0"]
    log = write_example_log(tmp_path / "a.mcap")
    with subprocess.Popen([sys.executable, "-m", "planfly", "replay", log, *how], stdout=subprocess.DEVNULL) as process:
        try:
            wanted = table()[command]
            while process.poll() is None and listening(process.pid).total() < wanted.total():
                time.sleep(0.05)
            assert listening(process.pid) == wanted
        finally:
            process.kill()


def test_the_studio(tmp_path: Path) -> None:
    keep = str(tmp_path / "kept")
    how = [sys.executable, "-m", "planfly", "studio", "--no-browser", "--port", "0", "--keep", keep]
    with subprocess.Popen(how, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            while b"#t=" not in process.stdout.readline():
                assert process.poll() is None
            assert listening(process.pid) == table()["`studio`"]
        finally:
            process.terminate()
            process.wait(30)


@pytest.mark.parametrize(
    ("command", "sockets"),
    [("--sitl", (PhysicsPort, TcpLink)), ("--sitl ./px4", (SimulatorPort, UdpLink))],
)
def test_an_autopilot(command: str, sockets: tuple[type[PhysicsPort | SimulatorPort], type[TcpLink | UdpLink]]) -> None:
    before = listening(psutil.Process().pid)
    physics, link = (opened() for opened in sockets)
    try:
        assert listening(psutil.Process().pid) - before == table()[f"`fly`, `run` with `{command}`"]
    finally:
        physics.close()
        link.close()


def test_no_other_source_opens_a_socket() -> None:
    opened = {
        file.relative_to(ROOT).as_posix()
        for folder in ("planfly", "logs", "flight", "planner", "aircraft", "world")
        for file in (ROOT / folder).rglob("*.py")
        if OPENS.search(file.read_text(encoding="utf-8"))
    }
    assert opened == set(HOLD)
    assert set(HOLD.values()) | {"`replay --to`"} == set(table())


def test_the_ports_of_the_table_are_those_of_the_options() -> None:
    page, commands = PAGE.read_text(encoding="utf-8"), build_parser().commands
    assert f"UDP {commands['serve'].get_default('bind').replace(':', ', port ')} |" in page
    assert f"TCP 127.0.0.1, port {commands['replay'].get_default('port')} |" in page
    assert commands["replay"].get_default("bind") == "127.0.0.1:0"


# Sockets that Python has bound since they were looked at last; an audit hook stays for good.
_bound: list[object] = []


@pytest.mark.usefixtures("blank_pictures")
def test_no_other_command_opens_a_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    (tmp_path / "m.waypoints").write_text(WPL, encoding="ascii")
    write_example_log(tmp_path / "a.mcap")
    sys.addaudithook(lambda event, args: _bound.append(args[1]) if event == "socket.bind" else None)
    _bound.clear()
    for line in (
        "plan tight --out plan.json",
        "export plan.json a.waypoints",
        "fly m.waypoints --scenario field.toml --guidance path",
        "check m.waypoints --scenario field.toml --guidance path",
        "check a.mcap",
        "report a.mcap",
        "compare a.mcap a.mcap",
        "replay a.mcap",
        "recover a.mcap",
        "aircraft",
        "scenarios",
    ):
        assert main(line.split()) in (0, 3, 4), line
        assert _bound == [], line
