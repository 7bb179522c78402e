"""``planfly recover``: what can be read of a log becomes a whole one."""

from pathlib import Path

from logs.recording.reader import read_log
from planfly.cli import main


def test_recover_writes_a_whole_log_once(broken: Path, flight: Path, tmp_path: Path) -> None:
    target = tmp_path / "whole.mcap"
    assert main(["recover", str(broken), "--out", str(target)]) == 3
    assert len(read_log(target).track) == len(read_log(broken).track)
    assert main(["recover", str(broken), "--out", str(target)]) == 2
    assert main(["recover", str(flight / "flight.mcap"), "--out", str(tmp_path / "other.mcap")]) == 0
    assert not (tmp_path / "other.mcap").exists()
