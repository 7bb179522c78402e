"""Every command as its user gives it, on small files: what tests of a machine's troubles run."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from logs.recording.reader import read_log
from planfly.cli import COMMANDS
from tests.planfly.commands.imported_log_files import FLIGHTS
from tests.planfly.commands.test_survey import FIELD_SURVEY
from tests.planfly.conftest import FIELD
from tests.stopwatch import processes_of
from tests.world.made.forecast_files import open_meteo_answer, wind_dataset, write_json

ROOT = Path(__file__).parents[3]
# 0.8 km there and 0.4 km on.
SHORT = """QGC WPL 110
0 1 0 16 0 0 0 0 46 8 0 1
1 0 3 16 0 0 0 0 46 8 100 1
2 0 3 16 0 0 0 0 46 8.01 100 1
3 0 3 16 0 0 0 0 46.004 8.01 100 1
"""
_RADIO = ("--frequency", "915", "--power", "20", "--sensitivity", "-100")
_AREA = ("--box", "36.25,-84.3,36.3,-84.2")
_DEPARTURES = ("--from", "2026-05-01T06:00Z", "--to", "2026-05-01T06:00Z", "--flights", "10")
_CAMPAIGN = ("short.waypoints", "--scenario", "field.toml", "--workers", "1", "--out", "out")


@dataclass(frozen=True)
class Given:
    """A command line.

    codes: with which it may end where nothing is wrong.  target: what it writes, "" for nothing.
    """

    argv: tuple[str, ...]
    codes: tuple[int, ...] = (0,)
    target: str = ""

    @property
    def name(self) -> str:
        """The command's."""
        return self.argv[0]


# By the command's name; each command of the registry stands here.
EVERY = {
    given.name: given
    for given in (
        Given(("run", "tight", "--out", "out"), (4,), "out"),
        Given(("plan", "tight", "--out", "new.json"), target="new.json"),
        Given(("export", "plan.json", "new.plan"), target="new.plan"),
        Given(("fly", "short.waypoints", "--scenario", "field.toml", "--log", "new.mcap"), (0, 4), "new.mcap"),
        Given(
            ("studio", "short.waypoints", "--scenario", "field.toml", "--no-browser", "--port", "0", "--keep", "kept")
        ),
        Given(("serve", "--scenario", "field.toml", "--bind", "127.0.0.1:0", "--to", "127.0.0.1:9", "--log", "logs")),
        Given(("check", "flight.mcap", "--json", "new.json"), (0, 4), "new.json"),
        Given(("returns", "plan.json", "--every", "20", "--json", "new.json"), (0, 4), "new.json"),
        Given(("link", "flight.mcap", *_RADIO, "--json", "new.json"), (0, 3, 4), "new.json"),
        Given(("survey", "lines.waypoints", "--aircraft", "x8", "--out", "out"), (0, 4), "out"),
        Given(("report", "flight.mcap", "--out", "out"), (0, 4), "out"),
        Given(("compare", "flight.mcap", "flight.mcap", "--out", "out"), target="out"),
        Given(("replay", "flight.mcap", "--speed", "1000")),
        Given(("recover", "broken.mcap", "--out", "new.mcap"), (3,), "new.mcap"),
        Given(("import", "tight.BIN", "new.mcap"), (0, 3, 4), "new.mcap"),
        Given(("refly", "imported.mcap", "--out", "out"), (0, 3, 4), "out"),
        Given(("predict", "imported.mcap", "--aircraft", "aerosonde", "--out", "out"), (0, 3, 4), "out"),
        Given(("campaign", *_CAMPAIGN, "--flights", "2"), (0, 3, 4), "out"),
        # No flight is flyable in calm air, so that the search ends after three.
        Given(("winds", "steep.waypoints", *_CAMPAIGN[1:], "--flights", "150", "--directions", "4"), (4,), "out"),
        Given(
            ("battery", "short.waypoints", "--scenario", "field.toml", "--flights", "20", "--out", "out"),
            (0, 3, 4),
            "out",
        ),
        Given(("window", *_CAMPAIGN, "--forecast", "winds.json", *_DEPARTURES), (0, 3, 4), "out"),
        Given(
            ("ground-risk", "short.waypoints", "--scenario", "field.toml", "--flights", "20", "--out", "out"),
            (3,),
            "out",
        ),
        Given(("paper", "--problems", "7", "--runs", "1", "--jobs", "1", "--out", "out"), target="out"),
        Given(("aircraft", "aerosonde")),
        Given(("scenarios",)),
        # What it writes is less than the page that a full disk has left.
        Given(("new", "site", "--from", "46.5,8", "--to", "46.55,8.05")),
        Given(
            ("terrain", "--box", "36.25,-84.3,36.3,-84.2", "--source", "jacksboro", "--out", "new.tif"),
            target="new.tif",
        ),
        Given(("help",)),
        Given(("completion", "bash")),
    )
}
# What those say when they are there that serve until they are stopped.
READY = {"serve": " ready", "studio": "#t="}
assert list(EVERY) == [command.name for command in COMMANDS]


def make_inputs(folder: Path, flight: Path, broken: Path, *, imported: bool) -> Path:
    """Make the files that the commands read.

    flight, broken: the fixtures.  imported: whether an imported log is to be there, too, which refly reads.
    """
    folder.mkdir()
    (folder / "field.toml").write_text(FIELD, encoding="utf-8")
    (folder / "short.waypoints").write_text(SHORT, encoding="ascii")
    (folder / "steep.waypoints").write_text(SHORT.replace("46.004 8.01 100", "46.004 8.01 900"), encoding="ascii")
    write_json(folder / "winds.json", open_meteo_answer(wind_dataset(3.0, 1.0), 46.0, 8.0))
    shutil.copy(FIELD_SURVEY, folder / "lines.waypoints")
    for path in (flight / "flight.mcap", flight / "plan.json", broken, FLIGHTS / "tight.BIN"):
        shutil.copy(path, folder)
    if not imported:
        return folder
    subprocess.run(
        [sys.executable, "-m", "planfly", "import", "tight.BIN", "imported.mcap"],
        cwd=folder,
        check=False,
        capture_output=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert (folder / "imported.mcap").is_file()
    return folder


@dataclass(frozen=True)
class Done:
    """How a command ended: its exit code, None for one that had to be killed, and the lines on standard error."""

    code: int | None
    lines: list[str]


def give(
    given: Given,
    folder: Path,
    *,
    change: Callable[[], None] | None = None,
    limit: float = 300.0,
    serves: bool = True,
    said: Path | None = None,
    program: tuple[str, ...] = (sys.executable, "-m", "planfly"),
    removed: tuple[str, ...] = (),
    **environment: str,
) -> Done:
    """Run a command in a folder that holds its inputs.

    change: what is done to the process first.  limit: s until it is killed, with all that it started.  serves: whether
    a vehicle is expected to be there at last, which is then ended as by Ctrl-C.  said: the file that it prints into,
    for a while.  program: what runs the command.  removed, environment: variables that are taken out, and set.
    """
    said = said or folder / "said.txt"
    kept = {name: value for name, value in os.environ.items() if name not in removed}
    with said.open("w", encoding="utf-8") as errors:
        process = subprocess.Popen(
            [*program, *given.argv],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=errors,
            stderr=subprocess.STDOUT,
            env=kept | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"} | environment,
            start_new_session=True,
            preexec_fn=change,
        )
    try:
        if given.name in READY and serves:
            until = time.monotonic() + limit
            while process.poll() is None and READY[given.name] not in said.read_text(encoding="utf-8"):
                assert time.monotonic() < until, said.read_text(encoding="utf-8")
                time.sleep(0.05)
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        code: int | None = process.wait(limit)
    except subprocess.TimeoutExpired:
        code = None
    finally:
        for number in processes_of(process.pid):
            os.kill(number, signal.SIGKILL)
        process.wait()
    lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
    said.unlink()
    return Done(code, lines)


def check_whole(folder: Path) -> None:
    """Every file that is there is whole."""
    for path in folder.rglob("*"):
        assert not path.name.startswith("."), f"{path.name}: a temporary file is left"
        if path.name == "broken.mcap" or path.is_dir():
            continue
        if path.suffix == ".mcap":
            # What was recovered from a damaged log says for ever that it is not the whole flight.
            assert read_log(path).complete != (path.name == "mended.mcap"), path.name
        elif path.suffix in (".json", ".plan"):
            json.loads(path.read_text(encoding="utf-8"))
        elif path.suffix in (".png", ".gif"):
            assert path.read_bytes().rstrip(b"\0")[-8:].endswith((b"IEND\xaeB`\x82", b";")), path.name
        elif path.suffix == ".html":
            assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
