"""The example log is a flight like any other: recorded and read back, it is the same."""

from dataclasses import replace
from pathlib import Path

from logs.recording.example_log import example_log, write_example_log
from logs.recording.reader import read_log
from tests.logs.log_copies import same


def test_the_example_comes_back_from_its_file(tmp_path: Path) -> None:
    path = write_example_log(tmp_path / "example.mcap")
    same(replace(read_log(path), source="example"), example_log())
