"""What compiles is said before it begins, once, and only where something does."""

import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import pytest

from planfly.api.api_function import api_function
from planfly.kernel_units.unit_kernels import list_unit_kernels
from planfly.runtime import first_start
from planfly.runtime.stages import send_progress_to
from planfly.terminal.output import ON_STANDARD_ERROR, SILENT
from tests.soak import some
from world.compile_events import announce_compilation

ROOT = Path(__file__).parents[3]
CODE = """
import sys
from planfly.api.api_function import api_function
from world.geometry import wrap
@api_function()
def wrap_twice(*, angle: float) -> None:
    for _ in range(2):
        wrap(angle)
wrap_twice(angle=4.0)
"""
SAID = "compiling numeric kernels, which later runs load"
WAY_OUT = "set NUMBA_CACHE_DIR to a folder that can be written"


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """Units that were shared out, instead of being compiled: of each a kernel more is ready."""
    asked: list[list[str]] = []

    def compile_units(units: list[str], folder: Path, tell: object) -> None:
        assert folder == tmp_path
        asked.append(units)
        for done in range(1, len(units) + 1):
            assert callable(tell)
            tell(done)

    monkeypatch.setattr(first_start, "compile_units", compile_units)
    monkeypatch.setattr(first_start, "_compiled_units", set())
    monkeypatch.setattr("world.kernels.cache_folder", lambda: tmp_path)
    return asked


def test_units_are_counted_before_the_work_goes_on(shared: list[list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    whole = len(list_unit_kernels(("scores", "paper")))

    @api_function("scores", "paper")
    def compile_two(*, number: int) -> list[str]:
        assert capsys.readouterr().err == ""
        assert numba.njit(lambda a: a + 1)(number) == number + 1
        lines = capsys.readouterr().err.splitlines()
        announce_compilation()
        return lines

    with send_progress_to(ON_STANDARD_ERROR):
        begun, done = compile_two(number=1)
    assert begun == f"{SAID} ... (0 of {whole}, no estimate yet)"
    assert done.startswith(f"{SAID}: done in ")
    assert done.endswith(f" s: 2 of {whole}")
    assert capsys.readouterr().err == ""
    # What this process has shared out it does not share out again.
    compile_kernels("scores", "flight")
    compile_kernels("scores")
    assert shared == [["scores", "paper"], ["flight"]]


def compile_kernels(*units: str) -> None:
    """As a function of the API does that needs kernels of these units."""

    @api_function(*units)
    def compile_one(*, announce: Callable[[], None]) -> None:
        announce()

    compile_one(announce=announce_compilation)


def test_nothing_is_said_in_silence(shared: list[list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    with send_progress_to(SILENT):
        compile_kernels("scores")
        assert shared == [["scores"]]
        compile_kernels()
    assert capsys.readouterr().err == ""


def test_a_cold_process_says_it_once_and_a_warm_one_nothing(tmp_path: Path) -> None:
    said = [_said(NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    assert said == [f"{SAID} ...\n", ""]


def test_a_cache_that_cannot_be_written_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], shared: list[list[str]]
) -> None:
    folder = Path("/proc/none/kernels")
    monkeypatch.setattr("world.kernels.cache_folder", lambda: folder)
    with send_progress_to(ON_STANDARD_ERROR):
        compile_kernels("scores")
    said = f"compiling the numeric kernels: {folder} cannot be written, so they are not stored; {WAY_OUT}\n"
    assert (capsys.readouterr().err, shared) == (said, [])


# Refuses what the system refuses a user who owns nothing: to write anywhere but among temporary files.
OWNS_NOTHING = """
import os, sys
def refuse(event, args):
    if event == "os.mkdir" or (event == "open" and not isinstance(args[0], int)):
        writes = event == "os.mkdir" or args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if writes and not os.fsdecode(args[0]).startswith(("/dev/", "/tmp/")):
            raise PermissionError(13, "Permission denied", args[0])
    if event == "os.mkdir" and "planfly-kernels-" in os.fsdecode(args[0]):
        print("made", os.fsdecode(args[0]), file=sys.stderr)
sys.addaudithook(refuse)
"""
# What the environment of such a user has beside a path: a home that is not there, none, and folders that are none.
HOMELESS = ({"HOME": "/nonexistent"}, {}, {"HOME": "/dev/null", "TMPDIR": "/none", "XDG_CACHE_HOME": "/proc/none"})


@pytest.mark.skipif(sys.platform != "linux", reason="temporary files are where Linux has them")
@pytest.mark.parametrize("given", some(HOMELESS, 3))
def test_a_user_who_can_write_no_cache_gets_results_and_the_way_out(given: dict[str, str]) -> None:
    """Neither the sources nor a cache in a home: kernels are kept in a temporary folder while the command runs."""
    path = f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"} | given
    done = subprocess.run(
        [sys.executable, "-c", OWNS_NOTHING + CODE],
        cwd="/",
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (line,) = (one for one in done.stderr.splitlines() if "cannot be written" in one)
    assert line.startswith("compiling the numeric kernels for this command only: ")
    assert line.endswith(WAY_OUT)
    made, *_ = (one.removeprefix("made ") for one in done.stderr.splitlines() if one.startswith("made "))
    assert not Path(made).exists()


@pytest.mark.skipif(sys.platform != "linux", reason="temporary files are where Linux has them")
def test_a_command_leaves_no_temporary_folder_behind() -> None:
    """A command ends without the handlers of `atexit`."""
    code = f"{OWNS_NOTHING}sys.argv = ['planfly', 'check', 'none.waypoints']\nfrom planfly.cli import main\nmain()\n"
    path = f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": path, "HOME": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd="/", env=environment, capture_output=True, text=True, check=False
    )
    made, *_, said = done.stderr.splitlines()
    assert (done.returncode, made.partition(" ")[0]) == (2, "made")
    assert said == "planfly: none.waypoints: cannot be read: No such file or directory"
    assert not Path(made.removeprefix("made ")).exists()


def test_where_nothing_can_be_written_kernels_are_compiled_and_not_kept(tmp_path: Path) -> None:
    """The work is done all the same."""
    code = (
        "import tempfile, sys; from pathlib import Path\n"
        "from world import kernel_cache\n"
        "kernel_cache.can_write = lambda folder: False\n"
        "tempfile.mkdtemp = lambda prefix: (_ for _ in ()).throw(OSError(30, 'read-only'))\n"
        "from world.geometry import wrap\n"
        "from world import kernels\n"
        "print(wrap(4.0), kernels.IS_TEMPORARY)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    number, temporary = done.stdout.split()
    # 4 rad less a turn.
    assert (abs(float(number) - (4.0 - 2.0 * math.pi)) < 1e-12, temporary) == (True, "False")


def _said(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return done.stderr
