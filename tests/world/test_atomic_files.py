"""A file is written whole or not at all."""

import fcntl
import os
import stat
import sys
from pathlib import Path

import pytest

from world import atomic_files
from world.atomic_files import hold, write_folder, write_whole
from world.errors import PlanflyError


def test_text_and_bytes_replace_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text("old", encoding="utf-8")
    write_whole(file, "höher\n")
    assert file.read_bytes() == "höher\n".encode()
    write_whole(file, b"\0\1")
    assert file.read_bytes() == b"\0\1"
    assert list(tmp_path.iterdir()) == [file]


def test_a_result_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("", encoding="utf-8")
    write_whole(tmp_path / "whole", "")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "whole")]
    assert modes[0] == modes[1]


def test_a_failed_write_leaves_what_was_there_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "plan.json"
    file.write_text("old", encoding="utf-8")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        write_whole(file, "new")
    assert file.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_a_folder_is_there_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folder(tmp_path / "made", {"a": b"1", "in/b": b"2"})
    assert {str(path.relative_to(tmp_path / "made")) for path in (tmp_path / "made").rglob("*")} == {"a", "in", "in/b"}
    written = Path.write_bytes

    def fails_at_b(self: Path, data: bytes) -> int:
        if self.name == "b":
            raise OSError(28, "No space left on device")
        return written(self, data)

    monkeypatch.setattr(Path, "write_bytes", fails_at_b)
    with pytest.raises(OSError, match="No space left") as caught:
        write_folder(tmp_path / "half", {"a": b"1", "in/b": b"2"})
    assert caught.value.filename == str(tmp_path / "half")
    assert [path.name for path in tmp_path.iterdir()] == ["made"]


def test_a_folder_that_holds_something_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").write_text("keep", encoding="utf-8")
    with pytest.raises(OSError, match=r"not empty|exists"):
        write_folder(tmp_path / "there", {"a": b"1"})
    assert [path.name for path in tmp_path.rglob("*")] == ["there", "mine"]


class _Windows:
    """What msvcrt does with the lock of a file, by the means of this system."""

    LK_NBLCK = 2

    @staticmethod
    def locking(handle: int, mode: int, count: int) -> None:
        assert (mode, count) == (2, 1)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise PermissionError(13, "Permission denied") from error


@pytest.fixture
def on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atomic_files, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", _Windows)


@pytest.mark.usefixtures("on_windows")
def test_a_target_is_kept_to_one_process_where_there_is_no_flock(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").touch()
    for target in (tmp_path / "a.mcap", tmp_path):
        with hold(target), pytest.raises(PlanflyError, match="another planfly is writing there"), hold(target):
            pass
        with hold(target):
            # It stays open to others, who would read it.
            assert target.exists()
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert not (tmp_path.parent / f".{tmp_path.name}.planfly-lock").exists()


def test_a_target_that_may_not_be_read_is_not_said_to_be_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> int:
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(PermissionError), hold(tmp_path):
        pass
