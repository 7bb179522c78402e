"""Files just within their size and just beyond it, missing ones, and bytes that are no text."""

import fcntl
import os
import stat
import sys
import tomllib
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from world import file_locks
from world.errors import MissionError, PlanflyError, ScenarioError
from world.files import (
    absolute_path,
    did_you_mean,
    lock_path,
    read_at_most,
    read_small_file,
    read_toml,
    toml_table,
    toml_text,
    utf8_text,
    write_atomically,
    write_folder,
)


@pytest.mark.parametrize(("size", "ok"), [(0, True), (1000, True), (1001, False)])
def test_a_file_is_read_up_to_its_largest_size(tmp_path: Path, size: int, ok: bool) -> None:
    file = tmp_path / "a.plan"
    file.write_bytes(b"x" * size)
    if ok:
        assert read_small_file(file, 1000, "mission", MissionError) == b"x" * size
        return
    with pytest.raises(MissionError) as caught:
        read_small_file(file, 1000, "mission", MissionError)
    assert str(caught.value) == f"{file}: 1,001 bytes: a mission file has at most 1,000 bytes"


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "link"])
def test_a_pipe_and_a_device_are_refused_at_once(tmp_path: Path, name: str) -> None:
    """Nobody writes into the pipe, and the device has no end."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    path = tmp_path / name
    with pytest.raises(MissionError) as caught:
        read_small_file(path, 1000, "mission", MissionError)
    assert str(caught.value) == f"{path}: not a plain file; expected a mission file"


@pytest.mark.parametrize(("size", "ok"), [(1000, True), (1001, False)])
def test_a_pipe_of_the_shell_is_read_to_its_end(size: int, ok: bool) -> None:
    ours, theirs = os.pipe()
    os.write(theirs, b"x" * size)
    os.close(theirs)
    try:
        path = Path(f"/dev/fd/{ours}")
        if ok:
            assert read_at_most(path, 1000, "mission") == b"x" * size
            return
        with pytest.raises(ValueError, match="more than 1,000 bytes: a mission file has at most 1,000 bytes"):
            read_at_most(path, 1000, "mission")
    finally:
        os.close(ours)


def test_a_name_of_many_parts_takes_no_memory_by_its_square() -> None:
    assert toml_table(".".join("a" * 101) + " = 1")["a"]
    for text in (
        ".".join("a" * 20_000) + " = 1",
        "[" + " . ".join("a" * 20_000) + "]",
        "x = {" + "a." * 20_000 + "a=1}",
    ):
        tracemalloc.start()
        with pytest.raises(ValueError, match="more than 100 parts"):
            toml_table(text)
        assert tracemalloc.get_traced_memory()[1] < 2**24
        tracemalloc.stop()
    # Text and numbers are no names.
    assert toml_table(f'a = [{"1.5, " * 1000}]\nb = "{"x" * 100_000}"\nc = "{"one. two, " * 1000}"')["b"]


@pytest.mark.parametrize("name", ["loop", "a\0b"])
def test_a_path_that_leads_nowhere_is_whole_anyhow(name: str, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "link").symlink_to(tmp_path / "there")
    assert absolute_path(tmp_path / name) == str(tmp_path / name)
    assert absolute_path(tmp_path / "link") == str(tmp_path / "there")


_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
_VALUES = st.one_of(
    _TEXTS,
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=2), max_size=2),
)
_TABLES = st.recursive(
    st.dictionaries(_TEXTS, _VALUES, max_size=4),
    lambda tables: st.dictionaries(
        _TEXTS, st.one_of(_VALUES, tables, st.lists(tables, min_size=1, max_size=3)), max_size=4
    ),
    max_leaves=8,
)


@given(_TABLES)
def test_the_text_of_a_table_is_read_as_this_table(table: dict[str, Any]) -> None:
    """By Python's own parser of TOML, with any texts as keys and values."""
    assert tomllib.loads(toml_text(table)) == table


def test_toml_is_a_table_or_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("a = [1]\n", encoding="utf-8")
    assert read_toml(file, "gains") == {"a": [1]}
    for text, said in (
        ("a = " + "[" * 100_000, "nested too deeply"),
        ("a = " + "9" * 10_000, "digits"),
        ("a", "Expected"),
        ("a." * 101 + "a = 1", "100 parts"),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=said):
            read_toml(file, "gains")
    file.write_text("a = 1000000", encoding="utf-8")
    with pytest.raises(ValueError, match="11 bytes: a gains file has at most 10 bytes"):
        read_toml(file, "gains", max_bytes=10)


@pytest.mark.parametrize("error", [MissionError, ScenarioError])
def test_what_cannot_be_read_is_one_line_of_the_callers_error(tmp_path: Path, error: type[PlanflyError]) -> None:
    for path, reason in ((tmp_path, "is a folder; expected a scenario file"), (tmp_path / "none", "cannot be read: ")):
        with pytest.raises(error) as caught:
            read_small_file(path, 10**6, "scenario", error)
        assert str(caught.value).startswith(f"{path}: {reason}")
        assert "\n" not in str(caught.value)


def test_text_is_utf8_with_or_without_a_byte_order_mark(tmp_path: Path) -> None:
    for data in ("zwölf\n".encode(), "\ufeffzwölf\n".encode()):
        assert utf8_text(data, tmp_path, MissionError) == "zwölf\n"


@pytest.mark.parametrize(("data", "line", "byte"), [(b"\xff", 1, 0), (b"a\nb\n\xe4", 3, 4)])
def test_what_is_no_text_is_named_by_line_and_byte(tmp_path: Path, data: bytes, line: int, byte: int) -> None:
    with pytest.raises(MissionError) as caught:
        utf8_text(data, tmp_path, MissionError)
    assert str(caught.value) == f"{tmp_path}:{line}: not a text file in UTF-8 (byte {byte})"


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("jaksboro", ": did you mean 'jacksboro'?"),
        ("TIGHT", ": did you mean 'tight'?"),
        ("paper-7", ": did you mean 'paper-07'?"),
        ("volcano", ""),
        ("", ""),
    ],
)
def test_a_near_name_is_named_and_no_far_one(name: str, near: str) -> None:
    assert did_you_mean(name, ["jacksboro", "tight", "paper-07"]) == near


# ----------------------------------------------------------------------
# A file is written whole or not at all.


def test_text_and_bytes_replace_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text("old", encoding="utf-8")
    write_atomically(file, "höher\n")
    assert file.read_bytes() == "höher\n".encode()
    write_atomically(file, b"\0\1")
    assert file.read_bytes() == b"\0\1"
    assert list(tmp_path.iterdir()) == [file]


def test_a_result_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("", encoding="utf-8")
    write_atomically(tmp_path / "whole", "")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "whole")]
    assert modes[0] == modes[1]


def test_a_failed_write_leaves_what_was_there_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "plan.json"
    file.write_text("old", encoding="utf-8")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        write_atomically(file, "new")
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
    monkeypatch.setattr(file_locks, "LOCKS_FOLDERS", False)
    monkeypatch.setitem(sys.modules, "msvcrt", _Windows)


@pytest.mark.usefixtures("on_windows")
def test_a_target_is_kept_to_one_process_where_there_is_no_flock(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").touch()
    for target in (tmp_path / "a.mcap", tmp_path):
        with (
            lock_path(target),
            pytest.raises(PlanflyError, match="another planfly process is writing there"),
            lock_path(target),
        ):
            pass
        with lock_path(target):
            # It stays open to others, who would read it.
            assert target.exists()
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert not (tmp_path.parent / f".{tmp_path.name}.planfly-lock").exists()


def test_a_target_that_may_not_be_read_is_not_said_to_be_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> int:
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(PermissionError), lock_path(tmp_path):
        pass
