"""A log that is cut short: every command that reads it says so, and ends with 3."""

from pathlib import Path

import pytest

from logs.recording.reader import read_log
from planfly.cli import main


@pytest.mark.parametrize("command", ["check", "report", "replay", "recover"])
def test_an_unfinished_log_ends_with_3_and_its_end_time(
    broken: Path, tmp_path: Path, command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "cut.mcap"
    copy.write_bytes(broken.read_bytes())
    assert main([command, str(copy)]) == 3
    out = capfd.readouterr()
    assert f"{copy}: incomplete: " in out.err
    assert f"ends at {read_log(broken).end_time:.1f} s" in out.err
    assert not out.out.startswith("flyable")
