"""A served vehicle, as a person starts it, and a flight whose log commands read."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from logs.views import drawing, figures
from planfly.cli import main
from planfly.planning import pareto_plans
from planner.search.plan_front import plan_front
from tests.logs.blank_pictures import draw_nothing
from tests.shared import made_once
from tests.soak import SOAK, at_most
from tests.stopwatch import Stopwatch, processes_of

FIELD = """name = "field"
[terrain]
kind = "flat"
amsl_m = 0
[area]
east_m = [-3000, 3000]
north_m = [-3000, 3000]
ceiling_amsl_m = 600
[start]
east_m = 0
north_m = 0
height_m = 100
[destination]
east_m = 500
north_m = 0
height_m = 100
[wind]
speed_mps = 3
from_deg = 250
turbulence = "light"
"""


class Served:
    """``planfly serve`` in a process of its own."""

    def __init__(self, folder: Path, *argv: str, to: int = 9) -> None:
        command = [sys.executable, "-m", "planfly", "serve", "--log", "logs", "--bind", "127.0.0.1:0"]
        self.folder = folder
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            [*command, "--to", f"127.0.0.1:{to}", *argv],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        try:
            first = self.wait(lambda line: line.startswith("vehicle "))
            self.port = int(first.split(",")[0].rsplit(":", 1)[1])
            self.wait(lambda line: line.endswith(" ready"))
        except AssertionError:
            self.kill()
            raise

    def _read(self) -> None:
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))

    def wait(self, condition: Callable[[str], bool], limit: float = 300.0) -> str:
        """The first line that meets a condition."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            for line in list(self.lines):
                if condition(line):
                    return line
            time.sleep(0.02)
        raise AssertionError("\n".join(self.lines))

    def children(self) -> list[int]:
        """Process ids of the full family."""
        return processes_of(self.process.pid)

    def cpu(self) -> float:
        """Seconds of processor time that the family has used."""
        ticks = 0
        for number in self.children():
            fields = (
                Path(f"/proc/{number}/stat").read_text(encoding="ascii", errors="replace").rsplit(")", 1)[1].split()
            )
            ticks += int(fields[11]) + int(fields[12])
        return ticks / os.sysconf("SC_CLK_TCK")

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        """End it as Ctrl-C does, within 2 s (`Stopwatch`) and with all its processes, and give its exit code."""
        if self.process.poll() is None:
            # To all of them, as from a terminal.
            os.killpg(self.process.pid, number)
        with Stopwatch(self.process.pid) as watch:
            code = self.process.wait(120.0)
            # What multiprocessing starts to clean up after it ends once it sees that its parent has.
            end = time.monotonic() + 60.0
            while self.children() and time.monotonic() < end:
                time.sleep(0.02)
        assert watch.seconds < at_most(2.0)
        assert self.children() == []
        self._reader.join(60.0)
        self.process.stdout.close()
        return code

    def kill(self) -> None:
        """End the whole family at once, as a power cut does."""
        for number in self.children():
            os.kill(number, signal.SIGKILL)
        self.process.wait(120.0)
        self._reader.join(60.0)
        self.process.stdout.close()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Served]]:
    """Start vehicles in a folder that has ``field.toml``; what still runs at the end is killed."""
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    started: list[Served] = []

    def start(*argv: str, to: int = 9) -> Served:
        started.append(Served(tmp_path, *argv, to=to))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.kill()


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a dask scheduler whose worker is a thread of this process: none has to start for it."""
    pytest.importorskip("distributed")
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        scheduler_kwargs={"dashboard": False},
        dashboard_address="127.0.0.1:0",
        worker_dashboard_address=None,
        memory_limit=0,
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def blank_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """See `draw_nothing`."""
    draw_nothing(monkeypatch)


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures without content, for tests that look at their names: drawing is most of what reports take."""
    monkeypatch.setattr(figures, "draw", lambda _: None)
    monkeypatch.setattr(drawing, "png_bytes", lambda _: b"\x89PNG")
    monkeypatch.setattr(drawing, "svg_bytes", lambda _: b"<svg></svg>")


@pytest.fixture
def short_fronts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search for fronts for 10 of their 400 generations, outside the soak."""
    if not SOAK:
        monkeypatch.setattr(pareto_plans, "plan_front", partial(plan_front, generations=10))


@pytest.fixture(scope="session")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short flight, its pictures blank: plan.json and flight.mcap of the scenario `tight`."""
    folder = tmp_path_factory.mktemp("flight") / "tight"

    def files() -> dict[str, bytes]:
        with pytest.MonkeyPatch.context() as patch:
            draw_nothing(patch)
            assert main(["run", "tight", "--out", str(folder)]) == 4
        return {file.name: file.read_bytes() for file in folder.iterdir()}

    made = made_once("tight-run", files)
    folder.mkdir(exist_ok=True)
    for name, data in made.items():
        (folder / name).write_bytes(data)
    return folder


@pytest.fixture(scope="session")
def broken(flight: Path) -> Path:
    """Its log, cut off after three quarters."""
    data = (flight / "flight.mcap").read_bytes()
    path = flight.parent / "broken.mcap"
    path.write_bytes(data[: len(data) * 3 // 4])
    return path
