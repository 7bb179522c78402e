"""What is no mission file is refused in one line; any text is read or refused."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.mission_files.formats import parse_mission
from tests.flight.mission_files.malformed_files import BAD_BYTES, HOME_LINE, refused
from tests.soak import scaled
from world.errors import MissionError


@pytest.mark.parametrize("suffix", ["waypoints", "plan"])
@pytest.mark.parametrize("case", sorted(BAD_BYTES))
def test_what_is_no_text_is_refused(case: str, suffix: str, tmp_path: Path) -> None:
    data, wanted = BAD_BYTES[case]
    file = tmp_path / f"bad.{suffix}"
    file.write_bytes(data)
    refused(file, wanted)


def test_what_is_no_mission_file_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "missing.waypoints", "cannot be read")
    (tmp_path / "folder.plan").mkdir()
    refused(tmp_path / "folder.plan", "is a folder; expected a mission file")
    (tmp_path / "a.kml").write_text("<kml/>")
    refused(tmp_path / "a.kml", "suffix '.kml': expected one of .waypoints, .plan, .txt")


@settings(max_examples=scaled(300, 25), deadline=None)
@given(st.text(max_size=60), st.sampled_from(["a.waypoints", "a.plan"]))
def test_any_text_is_read_or_refused(text: str, source: str) -> None:
    for head in ("", "QGC WPL 110\n", HOME_LINE + "\n", '{"fileType": "Plan", "version": 1, "mission": '):
        message = message_of(head + text, source)
        assert len(message.splitlines()) <= 1


def message_of(text: str, source: str) -> str:
    """The error of reading a text, empty where there is none."""
    try:
        parse_mission(text, source)
    except MissionError as error:
        return str(error)
    return ""
