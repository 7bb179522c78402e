"""Interruption: what is done whole, what is removed, and children that neither hear Ctrl-C nor outlive their parent."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from world.interruption import (
    Interrupted,
    children_ignore_sigint,
    delay_signals,
    interrupt,
    remove_at_end,
    remove_temporary_paths,
)


def test_a_signal_waits_for_the_end_of_what_is_done_whole() -> None:
    done = []
    with pytest.raises(Interrupted) as caught, delay_signals():  # noqa: PT012
        with delay_signals():
            interrupt(signal.SIGTERM)
            done.append("inner")
        done.append("outer")
    assert done == ["inner", "outer"]
    assert caught.value.number == signal.SIGTERM
    with pytest.raises(Interrupted):
        interrupt(signal.SIGINT)


def test_what_is_unfinished_is_removed(tmp_path: Path) -> None:
    folder, file = tmp_path / "folder", tmp_path / "file"
    with remove_at_end(folder), remove_at_end(file):
        folder.mkdir()
        (folder / "inside").write_text("", encoding="utf-8")
        file.write_text("", encoding="utf-8")
        remove_temporary_paths()
        assert list(tmp_path.iterdir()) == []
        file.write_text("again", encoding="utf-8")
    assert list(tmp_path.iterdir()) == []


def test_what_others_still_write_in_is_removed_after_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, remove = tmp_path / "folder", shutil.rmtree

    def remove_too_soon(path: Path, **options: bool) -> None:
        # Between its last look into the folder and the folder's own end, another process makes a file.
        remove(path, **options)
        path.mkdir()
        (path / "late").write_text("", encoding="utf-8")

    with monkeypatch.context() as writing:
        writing.setattr("world.interruption.shutil.rmtree", remove_too_soon)
        with remove_at_end(folder):
            folder.mkdir()
        assert not remove_temporary_paths()
        assert (folder / "late").exists()
    assert remove_temporary_paths()
    assert list(tmp_path.iterdir()) == []


def test_what_is_gone_is_forgotten(tmp_path: Path) -> None:
    file = tmp_path / "file"
    with remove_at_end(file):
        file.write_text("half", encoding="utf-8")
    file.write_text("whole, and another's", encoding="utf-8")
    assert remove_temporary_paths()
    assert file.exists()


PARENT = """
import multiprocessing, sys, time
from pathlib import Path
from world.interruption import children_ignore_sigint, end_children, end_with_parent, remove_at_end

def work(folder):
    end_with_parent()
    with remove_at_end(Path(folder) / "half"):
        (Path(folder) / "half").write_text("")
        Path(folder, "begun").write_text("")
        time.sleep(600)

if __name__ == "__main__":
    child = multiprocessing.get_context("spawn").Process(target=work, args=(sys.argv[1],), daemon=True)
    with children_ignore_sigint():
        child.start()
    print(child.pid, flush=True)
    try:
        time.sleep(600)
    except KeyboardInterrupt:
        time.sleep(0.3)
        print("alive", child.is_alive(), flush=True)
        end_children([child])
        print("ended", child.exitcode, flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_children_do_not_hear_ctrl_c_and_go_with_their_parent(number: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT, encoding="utf-8")
    folder = tmp_path / "work"
    folder.mkdir()
    paths = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, str(script), str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": paths},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    child = int(process.stdout.readline())
    until = time.monotonic() + 120.0
    while not (folder / "begun").exists() and time.monotonic() < until:
        time.sleep(0.02)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.kill()
    said, _ = process.communicate(timeout=120.0)
    if number == signal.SIGINT:
        assert said == "alive True\nended 143\n"
    until = time.monotonic() + 120.0
    while (folder / "half").exists() and time.monotonic() < until:
        time.sleep(0.02)
    assert [path.name for path in folder.iterdir()] == ["begun"]
    stat = Path(f"/proc/{child}/stat")
    assert not stat.exists() or stat.read_text("ascii").rsplit(")", 1)[1].split()[0] == "Z"


def test_children_are_started_where_signals_cannot_be_blocked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(signal, "pthread_sigmask")
    with children_ignore_sigint():
        pass


FORCED_END = """
import multiprocessing, os
from world.interruption import children_ignore_sigint

with children_ignore_sigint():
    semaphore = multiprocessing.get_context("spawn").Semaphore()
os._exit(3)
"""


def test_semaphores_of_a_forced_end_are_freed_without_a_word() -> None:
    # The resource tracker holds the pipe open until it has freed them.
    process = subprocess.run(
        [sys.executable, "-c", FORCED_END], cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=120.0
    )
    assert (process.returncode, process.stdout, process.stderr) == (3, "", "")
