"""Malformed .waypoints files: each is refused in one line that names the line, the field and what is allowed."""

from pathlib import Path

import pytest

from tests.flight.mission_files.malformed_files import BAD_WPL, refused


@pytest.mark.parametrize("case", sorted(BAD_WPL))
def test_malformed_waypoints_are_refused(case: str, tmp_path: Path) -> None:
    text, wanted = BAD_WPL[case]
    file = tmp_path / "bad.waypoints"
    file.write_text(text, encoding="utf-8", newline="")
    refused(file, wanted)
