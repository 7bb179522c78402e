"""macOS and Windows: what Python has on Linux alone has another way beside it."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import planfly
from planfly.planning.paper import usable_cores
from tests.soak import SOAK

ROOT = Path(planfly.__file__).parents[1]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
# What Windows (and of the first two macOS) does not have, and the files that use it where it is there.
LINUX_ALONE = {
    "os.sched_getaffinity": set(),
    "os.getuid": set(),
    "os.geteuid": set(),
    "os.fork": set(),
    # Programs of autopilots run on Linux and macOS.
    "os.killpg": {"flight/autopilots/sitl/process.py"},
    "os.setsid": set(),
    "os.set_blocking": {"planfly/terminal/signal_watch.py"},
    "signal.pthread_sigmask": {"world/interruption.py"},
    "signal.SIGHUP": set(),
    "signal.SIGALRM": set(),
    "signal.SIGKILL": {"flight/autopilots/sitl/process.py"},
    "select.select": set(),
    "import fcntl": {"world/file_locks.py"},
    "import resource": {"planfly/runtime/process_setup.py"},
    "import select": set(),
    "import pwd": set(),
    "import termios": set(),
}
# Deletes them, as far as nothing of Python's own needs them here, and stands in for the lock that Windows has instead.
ELSEWHERE = """
import fcntl, os, signal, subprocess, sys, types  # Python knows Windows by its msvcrt: subprocess comes before it
lock = fcntl.flock
def locking(handle, mode, count):
    lock(handle, 6)
sys.modules["msvcrt"] = types.SimpleNamespace(LK_NBLCK=2, locking=locking)
for module in ("fcntl", "resource", "pwd", "termios"):
    sys.modules[module] = None
for module, name in ((os, "sched_getaffinity"), (os, "set_blocking"),
                     (os, "fork"), (signal, "pthread_sigmask"), (signal, "SIGHUP"), (signal, "SIGALRM")):
    delattr(module, name)
sys.argv[0] = "planfly"
from planfly.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""


_WORDS = re.compile(rf"\b({'|'.join(sorted({re.split('[. ]', name)[1] for name in LINUX_ALONE}))})\b")


def names_in(file: Path) -> set[str]:
    """Dotted names that a file uses, and its imports; none of a file without a word of those that are looked for."""
    text = file.read_text(encoding="utf-8")
    if not _WORDS.search(text):
        return set()
    nodes = list(ast.walk(ast.parse(text)))
    imports = {f"import {alias.name}" for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return imports | {ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute)}


def test_what_is_linuxs_alone_stands_where_it_has_another_way() -> None:
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    assert len(files) > 300
    used: dict[str, set[str]] = {name: set() for name in LINUX_ALONE}
    for file in files:
        for name in names_in(file) & LINUX_ALONE.keys():
            used[name].add(file.relative_to(ROOT).as_posix())
    assert used == LINUX_ALONE


def elsewhere(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    (folder / "elsewhere.py").write_text(ELSEWHERE)
    return subprocess.run(
        [sys.executable, folder / "elsewhere.py", *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(not SOAK, reason="a whole run beside those of other tests: in make soak")
def test_a_plan_is_made_and_flown_and_judged_there(tmp_path: Path) -> None:
    done = elsewhere(tmp_path, "run", "tight", "--seed", "1", "--out", "out")
    assert (done.returncode, "Traceback" in done.stderr) == (4, False), done.stderr
    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["complete"]
    assert not list(tmp_path.glob(".*lock"))


def test_cores_are_counted_there(monkeypatch: pytest.MonkeyPatch) -> None:
    may_use = usable_cores()
    assert may_use == len(os.sched_getaffinity(0))
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert usable_cores() == 7
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert usable_cores() == 1
