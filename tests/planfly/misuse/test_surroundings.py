"""What a machine may do to a command: each a line of its own, no traceback, and nothing half-written."""

import contextlib
import faulthandler
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

from logs.recording.example_log import example_log
from logs.recording.recorder import Recorder
from planfly.cli import main
from tests.planfly.conftest import FIELD
from tests.soak import SOAK
from tests.soak.test_hostile_files import WPL
from world.errors import PlanflyError
from world.files import lock_path, write_atomically

ROOT = Path(__file__).parents[3]
Done: TypeAlias = subprocess.CompletedProcess
# Of a mission whose take-off is not judged: exit code 3.
CHECK = ("check", "m.waypoints", "--geometry", "--scenario", "field.toml", "--guidance", "path")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    (tmp_path / "m.waypoints").write_text(WPL, encoding="ascii")
    return tmp_path


def program(*argv: str, change: Callable[[], None] | None = None, **environment: str) -> Done:
    """Run a command in a process of its own; change: what is done to the process first."""
    return subprocess.run(
        [sys.executable, "-m", "planfly", *argv],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        preexec_fn=change,
        errors="surrogateescape",
    )


def test_closed_streams(folder: Path) -> None:
    """The exit code comes without a place to say anything, and no file takes the closed streams' numbers."""

    def close() -> None:
        for number in (0, 1, 2):
            with contextlib.suppress(OSError):
                os.close(number)

    done = program("scenarios", "--json", "s.json", change=close)
    assert done.returncode == 0
    assert json.loads((folder / "s.json").read_text(encoding="utf-8"))


def test_a_full_disk_under_standard_output(folder: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "planfly", "scenarios"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
    assert (done.returncode, done.stderr) == (1, "planfly: standard output: No space left on device\n")


def test_a_full_disk_leaves_what_was_there(folder: Path) -> None:
    target = folder / "plan.json"
    target.write_text("old", encoding="utf-8")
    kept = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, kept[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            write_atomically(target, b"x" * 5000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, kept)
    assert caught.value.filename == str(target)
    assert target.read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in folder.iterdir()) == ["field.toml", "m.waypoints", "plan.json"]


@pytest.mark.parametrize("place", ["/sys", "/proc"])
def test_a_folder_that_takes_no_files(place: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the system's own, since whoever runs the tests may write into any other."""
    assert main([*CHECK, "--json", f"{place}/verdict.json"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"planfly: {place}/verdict.json: ")


@pytest.mark.skipif(
    not SOAK, reason="a command has neither in test_every_command.py and test_first_start.py: in make soak"
)
@pytest.mark.parametrize("changes", [{"HOME": "/nonexistent"}, {"XDG_CACHE_HOME": "/proc/none"}])
def test_no_home_and_no_cache(changes: dict[str, str]) -> None:
    """Kernels are compiled for this process alone."""
    code = (
        "import numpy as np\nfrom world.terrain import steepest_slopes\n"
        "print(steepest_slopes(np.zeros((2, 2), np.float32), 1.0).tolist())"
    )
    cached = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in cached}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=environment | {"PYTHONPATH": str(ROOT)} | changes,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "[[0.0]]\n", "")


def test_a_c_locale_and_a_terminal_of_ascii(folder: Path) -> None:
    """What it cannot show is escaped."""
    text = FIELD.replace('name = "field"', 'name = "Wiese · Öl"')
    (folder / "wiese.toml").write_text(text, encoding="utf-8")
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}
    done = program("check", "Öl.waypoints", **locale)
    assert done.returncode == 2
    assert done.stderr.startswith("planfly: ")
    assert "l.waypoints: " in done.stderr
    assert done.stderr.isascii()


@pytest.mark.parametrize(
    "name",
    ["with space.waypoints", "two\nlines.waypoints", "\u202egnp.waypoints", "-dash.waypoints", "naïve ☃.waypoints"],
)
def test_names_of_any_kind(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Read, and in an error on one line that turns no text around."""
    shutil.copy("m.waypoints", name)
    given = f"./{name}"
    assert main(["check", given, *CHECK[2:]]) == 3
    assert main(["export", given, f"{given}.plan"]) == 0
    assert Path(f"{name}.plan").is_file()
    capsys.readouterr()
    Path(name).write_text("none", encoding="utf-8")
    assert main(["check", given]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.rstrip("\n").isprintable()


def test_a_name_that_is_no_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bytes that are no UTF-8."""
    assert main(["check", os.fsdecode(b"\xff\xfe.waypoints")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("planfly: ")
    assert len(said.splitlines()) == 1


def test_a_target_that_is_a_link_stays_one(folder: Path) -> None:
    (folder / "real").mkdir()
    (folder / "link.json").symlink_to(folder / "real" / "verdict.json")
    assert main([*CHECK, "--json", "link.json"]) == 3
    assert (folder / "link.json").is_symlink()
    assert (folder / "real" / "verdict.json").read_text(encoding="utf-8").startswith("{")
    # One that leads nowhere is an error with its own name.
    (folder / "lost.json").symlink_to(folder / "none" / "verdict.json")
    with pytest.raises(FileNotFoundError) as caught:
        write_atomically(folder / "lost.json", "{}")
    assert caught.value.filename == str(folder / "lost.json")


@pytest.mark.parametrize(
    "argv", [("--params", "loop"), ("--aircraft", "./loop"), ("--scenario", "loop"), ("--json", "loop")]
)
def test_a_link_that_leads_to_itself(argv: tuple[str, str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "loop").symlink_to(folder / "loop")
    assert main(["check", "--geometry", "m.waypoints", *argv]) == (1 if argv[0] == "--json" else 2)
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "loop" in said[0]
    assert (folder / "loop").is_symlink()


@pytest.mark.parametrize(
    "argv",
    [
        ("check", "pipe.waypoints"),
        ("check", "pipe.mcap"),
        ("check", "pipe.gpx"),
        ("plan", "pipe.toml"),
        ("check", "m.waypoints", "--params", "pipe.parm"),
        ("check", "m.waypoints", "--fence", "pipe.waypoints"),
        ("check", "m.waypoints", "--terrain", "pipe.tif"),
        ("check", "m.waypoints", "--aircraft", "./pipe"),
    ],
)
def test_a_pipe_that_nobody_writes_into_is_not_waited_for(
    argv: tuple[str, ...], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = next(part for part in argv if "pipe" in part)
    (folder / "pipe").mkdir()
    os.mkfifo(folder / ("pipe/pipe.toml" if name == "./pipe" else name))
    # It would be for ever.
    faulthandler.dump_traceback_later(60.0, exit=True, file=sys.__stderr__)
    try:
        assert main([*argv]) == 2
    finally:
        faulthandler.cancel_dump_traceback_later()
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "pipe" in said[0]


def test_two_runs_into_one_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second is refused while the first writes; afterwards the folder is free."""
    (folder / "out").mkdir()
    with lock_path(folder / "out"):
        assert main(["run", "tight", "--out", "out"]) == 2
    assert capsys.readouterr().err.endswith(
        "planfly: out: another planfly process is writing there; wait until it ends, or name another file or folder\n"
    )
    assert list((folder / "out").iterdir()) == []
    with lock_path(folder / "out"):
        pass


def test_two_flights_into_one_log(folder: Path) -> None:
    """The second does not touch the first's log."""
    path, setup = folder / "f.mcap", example_log().setup
    with Recorder(path, setup) as first:
        size = path.stat().st_size
        with pytest.raises(PlanflyError, match=r"f\.mcap: another planfly process is writing there"):
            Recorder(path, setup)
        assert path.stat().st_size == size
        del first
    with Recorder(path, setup):
        pass
