"""Every command where the machine is in trouble: no traceback, one line and exit code 1, and nothing half-written.

A handful in every run; all of them with PLANFLY_SOAK=1.  As root a small file system is full and everything but the
working folder is read-only; anybody else has a limit on the size of files, and folders that nobody can write.
"""

import contextlib
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from logs.recording.reader import read_log
from tests.planfly.misuse.every_command import EVERY, Done, Given, check_whole, give, make_inputs
from tests.soak import SOAK, note, only_in_soak
from world.errors import LogError

MB = 2**20
# Left on the full disk, bytes: a page.
LEFT = 4096


def _may_mount() -> bool:
    command = ["unshare", "--mount", "mount", "-t", "tmpfs", "none", "/mnt"]
    return os.geteuid() == 0 and bool(shutil.which("unshare")) and not subprocess.run(command, check=False).returncode


MOUNTS = _may_mount()


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory, flight: Path, broken: Path) -> Path:
    return make_inputs(tmp_path_factory.mktemp("every") / "inputs", flight, broken, imported=SOAK)


def some(*names: str) -> pytest.MarkDecorator:
    """These commands, and all of them in a soak."""
    return pytest.mark.parametrize("name", EVERY if SOAK else names)


def seen(given: Given, done: Done, trouble: str) -> None:
    """It ended by itself, as it may or with one line that says why not."""
    assert done.code in (1, *given.codes), (done.code, done.lines)
    assert not any("Traceback" in line for line in done.lines), done.lines
    if done.code == 1:
        assert [line for line in done.lines if line.startswith("planfly: ")] == done.lines[-1:], done.lines
    note(f"every command: {trouble}", **{given.name: done.code})


def whole(folder: Path, inputs: Path) -> None:
    """What a command has left: its files are whole, and a flight's log is at worst as after a power cut."""
    for path in [path for path in folder.rglob("*.mcap") if not (inputs / path.name).exists()]:
        with contextlib.suppress(LogError):
            read_log(path)
        path.unlink()
    for name in inputs.iterdir():
        (folder / name.name).unlink(missing_ok=True)
    check_whole(folder)


def limited(which: int, most: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(which, (most, most))


@only_in_soak
@some("fly")
def test_600_mb_of_address_space(name: str, inputs: Path, tmp_path: Path) -> None:
    """Most libraries together are larger; OpenBLAS, for one, would never return."""
    given, folder = EVERY[name], tmp_path / "work"
    shutil.copytree(inputs, folder)
    done = give(given, folder, change=limited(resource.RLIMIT_AS, 600 * MB), limit=120.0)
    seen(given, done, "600 MB of address space")
    if done.code == 1:
        assert done.lines[-1].startswith("planfly: not enough memory: the limit of 614,400 kB of address space")
    whole(folder, inputs)


@only_in_soak
@some("campaign")
def test_32_descriptors(name: str, inputs: Path, tmp_path: Path) -> None:
    given, folder = EVERY[name], tmp_path / "work"
    shutil.copytree(inputs, folder)
    done = give(given, folder, change=limited(resource.RLIMIT_NOFILE, 32), limit=120.0)
    seen(given, done, "32 descriptors")
    whole(folder, inputs)


@contextlib.contextmanager
def full_disk(folder: Path, inputs: Path) -> Iterator[Callable[[], None] | None]:
    """A folder with the inputs and no room for more; what is to be done to a process that writes there."""
    folder.mkdir()
    if not MOUNTS:
        shutil.copytree(inputs, folder, dirs_exist_ok=True)
        yield limited(resource.RLIMIT_FSIZE, LEFT)
        return
    size = sum(-(-path.stat().st_size // 4096) * 4096 for path in inputs.iterdir()) + MB
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], check=True)
    try:
        shutil.copytree(inputs, folder, dirs_exist_ok=True)
        free = os.statvfs(folder)
        (folder / "filler").write_bytes(bytes(free.f_bavail * free.f_frsize - LEFT))
        yield None
    finally:
        # A worker that was killed may take a moment to be gone.
        until = time.monotonic() + 10.0
        while subprocess.run(["umount", str(folder)], check=False, capture_output=True).returncode:
            assert time.monotonic() < until, f"{folder} is still in use"
            time.sleep(0.1)


@pytest.mark.skipif(
    not SOAK, reason="a limit on files is a full disk in test_surroundings.py and test_fly.py: in make soak"
)
@some("check")
def test_a_full_disk(name: str, inputs: Path, tmp_path: Path) -> None:
    given, folder = EVERY[name], tmp_path / "full"
    with full_disk(folder, inputs) as change:
        # What it prints goes elsewhere: a full disk below standard output is another test's.
        done = give(given, folder, change=change, said=tmp_path / "said.txt")
        assert done.code == 1 or not given.target, (done.code, done.lines)
        seen(given, done, "a full disk")
        (folder / "filler").unlink(missing_ok=True)
        whole(folder, inputs)


# Everything but the working folder becomes read-only: sources, caches, HOME, /tmp.
READ_ONLY = 'mount --make-rprivate / && mount --bind . . && mount -o remount,ro,bind / && cd "$PWD" && exec "$@"'
NOWHERE = {"HOME": "/nonexistent", "NUMBA_CACHE_DIR": "/proc/none", "XDG_CACHE_HOME": "/proc/none"}


@only_in_soak
@some("recover")
def test_no_home_and_nothing_to_write(name: str, inputs: Path, tmp_path: Path) -> None:
    """A service account on a read-only install: each command runs; kernels are compiled for it alone."""
    given, folder = EVERY[name], tmp_path / "work"
    shutil.copytree(inputs, folder)
    python = (sys.executable, "-m", "planfly")
    program = ("unshare", "--mount", "sh", "-c", READ_ONLY, "sh", *python) if MOUNTS else python
    removed = ("TMPDIR", "TEMP", "TMP", "MPLCONFIGDIR", "NUMBA_CACHE_DIR")
    done = give(given, folder, program=program, limit=900.0, removed=removed, **NOWHERE)
    assert done.code in given.codes, (done.code, done.lines)
    assert not any("Traceback" in line for line in done.lines), done.lines
    note("every command: no home, read-only", **{name: done.code})
    whole(folder, inputs)


def _on_one_processor() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system binds no process to a processor")
@some("help")
def test_one_processor(name: str, inputs: Path, tmp_path: Path) -> None:
    """Nothing waits for another process to have one of its own."""
    given, folder = EVERY[name], tmp_path / "work"
    shutil.copytree(inputs, folder)
    done = give(given, folder, change=_on_one_processor)
    assert done.code in given.codes, (done.code, done.lines)
    note("every command: one processor", **{name: done.code})
    whole(folder, inputs)
