"""A guard of a process group and a folder: it acts where its owner is gone, and only there."""

import os
import signal
import subprocess
import time
from pathlib import Path

from flight.autopilots.guard import Guard


def group_of_two(tmp_path: Path) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(["/bin/sh", "-c", "sleep 60; echo over"], start_new_session=True, cwd=tmp_path)


def test_who_leaves_in_order_finds_everything_as_it_was(tmp_path: Path) -> None:
    folder, group = tmp_path / "folder", group_of_two(tmp_path)
    folder.mkdir()
    with Guard() as guard:
        guard.register_folder(folder)
        guard.register_group(group.pid)
    assert folder.exists()
    assert group.poll() is None
    os.killpg(group.pid, signal.SIGKILL)
    group.wait()


def test_where_its_owner_is_gone_it_ends_the_group_and_removes_the_folder(tmp_path: Path) -> None:
    folder, group = tmp_path / "folder", group_of_two(tmp_path)
    (folder / "logs").mkdir(parents=True)
    (folder / "logs" / "1.BIN").write_text("log")
    (tmp_path / "lock").touch()
    guard = Guard()
    guard.register_folder(folder)
    guard.register_file(tmp_path / "lock")
    guard.register_file(tmp_path / "never made")
    guard.register_group(group.pid)
    # As the system does for an owner that was killed.
    guard._pipe.close()
    assert group.wait(20.0) == -signal.SIGKILL
    guard._process.wait(20.0)
    assert not folder.exists()
    assert not (tmp_path / "lock").exists()


def test_a_guard_that_is_gone_harms_nobody(tmp_path: Path) -> None:
    with Guard() as guard:
        guard._process.kill()
        guard._process.wait()
        time.sleep(0.01)
        guard.register_folder(tmp_path)
    assert tmp_path.exists()
