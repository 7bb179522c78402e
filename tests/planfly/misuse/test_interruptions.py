"""SIGINT and SIGTERM in any phase of any command: over within a second, and nothing left but whole files.

A few moments of a few commands; with PLANFLY_SOAK=1 moments all over the time that every command takes.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from logs.recording.reader import read_log
from tests.autopilots import find_arduplane
from tests.instances import make_instance, scenario_text
from tests.planfly.conftest import FIELD
from tests.planfly.misuse.every_command import check_whole
from tests.soak import SOAK, at_most, note, only_in_soak
from tests.stopwatch import Stopwatch, processes_of

pytestmark = pytest.mark.alone

LIMIT = at_most(1.0)
# s in which a process of its own that only waits for the command's end has ended, too.
_GONE = 1.0
MOMENTS = 8
# 1.5 km east, 1.1 km north and back.
ROUND = """QGC WPL 110
0 1 0 16 0 0 0 0 46 8 0 1
1 0 3 16 0 0 0 0 46 8 100 1
2 0 3 16 0 0 0 0 46 8.02 100 1
3 0 3 16 0 0 0 0 46.01 8.02 100 1
"""
# Long enough a way that its flight is under way whenever the signal comes: 100 rounds.
LONG = f"{ROUND}4 0 3 177 1 12 0 0 0 0 0 1\n"
# Without seeds a search goes on for all its generations: hours.
PLANNER = 'algorithm = "umda-smooth"\nwaypoints = 10\npopulation = 2000\ngenerations = 100000\n'
PAPER = ("paper", "--problems", "7", "--runs", "3", "--jobs", "2", "--out", "out")
FLY = ("fly", "long.waypoints", "--scenario", "field.toml", "--log", "f.mcap")
CAMPAIGN = ("campaign", "round.waypoints", "--scenario", "field.toml", "--workers", "2", "--out", "out")
WINDS = ("winds", *CAMPAIGN[1:])
SERVE = ("serve", "--scenario", "field.toml", "--bind", "127.0.0.1:0", "--to", "127.0.0.1:9", "--log", "logs")


@dataclass(frozen=True)
class Case:
    """A command and when it is interrupted: so long after it has printed a line with these words, s."""

    argv: tuple[str, ...]
    words: str
    delay: float
    number: signal.Signals
    cold: bool = False
    # A file that is to have grown to so many bytes before: on a cold start kernels are compiled first.
    grown: str = ""
    size: int = 200_000


FEW = (
    # It is ended by Ctrl-C in tests/planfly/commands/test_plan.py.
    *((Case(("plan", "endless.toml", "--out", "plan.json"), "planning", 0.5, signal.SIGTERM),) if SOAK else ()),
    # What is left of its log is seen in tests/logs/recording/test_crash_safe_recorder.py.
    *((Case(FLY, "flying", 0.2, signal.SIGINT, grown="f.mcap"),) if SOAK else ()),
    # Each vehicle of the other tests is ended so.
    *((Case(SERVE, "flight logs", 0.3, signal.SIGINT),) if SOAK else ()),
    # Its table is there, which is what an interruption leaves: on a loaded machine it comes late.
    Case(CAMPAIGN, "flying", 3.0, signal.SIGINT, grown="out/campaign.sqlite", size=0),
    # They end as a campaign does.
    *((Case(WINDS, "flying", 3.0, signal.SIGINT, grown="out/winds.sqlite", size=0),) if SOAK else ()),
    *((Case(PAPER, "planning", 1.5, signal.SIGINT),) if SOAK else ()),
    # Kernels are compiled meanwhile.
    Case(("run", "jacksboro", "--out", "out"), "", 4.0, signal.SIGTERM, cold=True),
)
EVERY = (
    ("plan", "endless.toml", "--out", "new.json"),
    ("run", "tight", "--out", "out"),
    FLY,
    ("check", "long.waypoints", "--scenario", "field.toml"),
    ("check", "flight.mcap"),
    ("report", "flight.mcap", "--out", "out"),
    ("compare", "flight.mcap", "flight.mcap", "--out", "out"),
    ("replay", "flight.mcap"),
    ("replay", "flight.mcap", "--movie", "film.gif"),
    ("export", "plan.json", "m.plan"),
    ("recover", "broken.mcap", "--out", "mended.mcap"),
    ("aircraft", "aerosonde"),
    ("scenarios",),
    (*PAPER,),
    (*SERVE,),
    (*CAMPAIGN,),
    WINDS,
)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "field.toml").write_text(FIELD, encoding="utf-8")
    (folder / "long.waypoints").write_text(LONG, encoding="ascii")
    (folder / "round.waypoints").write_text(ROUND, encoding="ascii")
    if SOAK:
        head, tail = scenario_text("endless", make_instance(0, 7), "a search that does not end").split("[planner]\n")
        text = f"{head}[planner]\n{PLANNER}\n[flight]{tail.split('[flight]')[1]}"
        (folder / "endless.toml").write_text(text, encoding="utf-8")
    return folder


def alive(session: int) -> list[str]:
    """Command lines of a session's processes that have not ended."""
    found = []
    for number in processes_of(session):
        with contextlib.suppress(OSError):
            found.append(Path(f"/proc/{number}/cmdline").read_text(encoding="utf-8").replace("\0", " "))
    return found


def interrupted(case: Case, inputs: Path, folder: Path) -> tuple[int | None, float, str]:
    """Run a command and interrupt it: exit code, seconds of its own that its end took (`Stopwatch`), and what it said.

    A code of None is a command that had ended before the signal came.
    """
    # A short path, as a socket among temporary files needs: pytest's own folders have long ones.
    with tempfile.TemporaryDirectory() as temporary:
        return _interrupted(case, inputs, folder, Path(temporary))


def _interrupted(case: Case, inputs: Path, folder: Path, temporary: Path) -> tuple[int | None, float, str]:
    work = folder / "work"
    shutil.copytree(inputs, work)
    environment = os.environ | {"TMPDIR": str(temporary), "PYTHONUNBUFFERED": "1"}
    if case.cold:
        environment["NUMBA_CACHE_DIR"] = str(folder / "kernels")
    said = folder / "said"
    with said.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "planfly", *case.argv],
            cwd=work,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            # Some shells start what they run in the background deaf.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
    try:
        until = time.monotonic() + 900.0
        while process.poll() is None and not begun_work(case, said, work):
            assert time.monotonic() < until, said.read_text(encoding="utf-8")
            time.sleep(0.02)
        time.sleep(case.delay)
        over = process.poll() is not None
        # Ctrl-C reaches all processes of a terminal, SIGTERM the one that it is sent to.
        if not over and case.number == signal.SIGINT:
            os.killpg(process.pid, case.number)
        elif not over:
            process.send_signal(case.number)
        with Stopwatch(process.pid) as watch:
            code = process.wait(300.0)
        until = time.monotonic() + _GONE
        while (left := alive(process.pid)) and time.monotonic() < until:
            time.sleep(0.05)
    finally:
        for line in alive(process.pid):
            print("killed", line)
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert left == [], f"{case}: a process is left"
    assert [str(path) for path in temporary.rglob("*")] == [], f"{case}: a temporary file is left"
    check_whole(work)
    assert not over or code in (0, 3, 4), f"{case}: {code}: {said.read_text(encoding='utf-8')}"
    return (None if over else code), watch.seconds, said.read_text(encoding="utf-8")


def begun_work(case: Case, said: Path, work: Path) -> bool:
    """Whether the command has come so far as the case has it."""
    grown = work / case.grown
    return case.words in said.read_text(encoding="utf-8") and (
        not case.grown or (grown.exists() and grown.stat().st_size > case.size)
    )


@only_in_soak
@pytest.mark.parametrize("case", FEW, ids=lambda case: f"{case.argv[0]}-{case.number.name}")
def test_a_command_ends_at_once_and_whole(case: Case, inputs: Path, tmp_path: Path) -> None:
    code, took, said = interrupted(case, inputs, tmp_path)
    assert code == (0 if case.argv[0] == "serve" else 128 + case.number), said
    assert took < LIMIT
    assert "Traceback" not in said
    if case.argv[0] in ("campaign", "winds"):
        (line,) = (line for line in said.splitlines() if "interrupted" in line)
        assert line.endswith("continue with --resume")
        assert "Warning" not in said
    if case.argv[0] == "fly":
        log = read_log(tmp_path / "work" / "f.mcap")
        assert (log.ended, log.recorded_verdict) == ("interrupted", None)
        assert len(log.track) > 100


@pytest.mark.skipif(not SOAK, reason="minutes; set PLANFLY_SOAK=1")
def test_every_command_at_any_moment(inputs: Path, flight: Path, broken: Path, tmp_path: Path) -> None:
    shutil.copytree(inputs, tmp_path / "inputs")
    for name in ("flight.mcap", "plan.json"):
        shutil.copy(flight / name, tmp_path / "inputs" / name)
    shutil.copy(broken, tmp_path / "inputs")
    commands, under_way = list(EVERY), set[str]()
    arduplane = find_arduplane()
    if arduplane is not None:
        commands.append((*EVERY[2], "--sitl", str(arduplane)))
    rng = np.random.default_rng(17)
    longest, count = 0.0, 0
    for n, argv in enumerate(commands):
        for k in range(MOMENTS):
            number = (signal.SIGINT, signal.SIGTERM)[k % 2]
            # Python itself starts in the first 0.4 s.
            case = Case(argv, "", 0.8 + float(rng.uniform(0.0, 6.0)) * (k + 1) / MOMENTS, number, cold=k == MOMENTS - 1)
            code, took, said = interrupted(case, tmp_path / "inputs", tmp_path / f"{n}-{k}")
            if code is None:
                continue
            under_way.add(argv[0])
            # A few end in order: a search with its best plan, a vehicle with its log, and what was over anyhow.
            assert code in (128 + number, -number, 0, 3, 4), f"{case}: {code}: {said}"
            assert took < LIMIT, f"{case}: {took:.2f} s"
            assert "Traceback" not in said, f"{case}: {said}"
            longest, count = max(longest, took), count + 1
            shutil.rmtree(tmp_path / f"{n}-{k}")
    assert count > len(commands) * MOMENTS // 2
    assert under_way >= {"plan", "run", "fly", "paper", "serve", "campaign", "winds"}
    note("interruptions", count=count, commands=len(commands), longest_s=round(longest, 2), left=0)


@pytest.mark.skipif(not SOAK, reason="minutes; set PLANFLY_SOAK=1")
def test_a_run_at_any_moment_of_its_kernels(inputs: Path, tmp_path: Path) -> None:
    """Kernels are read from the cache when they are called, and make named tuples: not to be interrupted either."""
    rng = np.random.default_rng(18)
    longest, count = 0.0, 0
    for k in range(60):
        case = Case(("run", "tight", "--out", "out"), "", float(rng.uniform(0.8, 2.0)), signal.SIGINT)
        code, took, said = interrupted(case, inputs, tmp_path / str(k))
        shutil.rmtree(tmp_path / str(k))
        if code is None:
            continue
        assert code in (128 + signal.SIGINT, -signal.SIGINT, 4), f"{case}: {code}: {said}"
        assert took < LIMIT, f"{case}: {took:.2f} s"
        assert "Traceback" not in said, f"{case}: {said}"
        longest, count = max(longest, took), count + 1
    assert count > 40
    note("interruptions: kernels", count=count, longest_s=round(longest, 2))
