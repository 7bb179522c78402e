"""Files just within their size and just beyond it, missing ones, and bytes that are no text."""

from pathlib import Path

import pytest

from world.errors import MissionError, PlanflyError, ScenarioError
from world.text_files import did_you_mean, read_small_file, utf8_text


@pytest.mark.parametrize(("size", "ok"), [(0, True), (1000, True), (1001, False)])
def test_a_file_is_read_up_to_its_largest_size(tmp_path: Path, size: int, ok: bool) -> None:
    file = tmp_path / "a.plan"
    file.write_bytes(b"x" * size)
    if ok:
        assert read_small_file(file, 1000, "mission", MissionError) == b"x" * size
        return
    with pytest.raises(MissionError) as caught:
        read_small_file(file, 1000, "mission", MissionError)
    assert str(caught.value) == f"{file}: 1,001 bytes: a mission file has at most 1,000"


@pytest.mark.parametrize("error", [MissionError, ScenarioError])
def test_what_cannot_be_read_is_one_line_of_the_callers_error(tmp_path: Path, error: type[PlanflyError]) -> None:
    for path in (tmp_path, tmp_path / "none"):
        with pytest.raises(error) as caught:
            read_small_file(path, 10**6, "scenario", error)
        assert str(caught.value).startswith(f"{path}: cannot be read: ")
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
