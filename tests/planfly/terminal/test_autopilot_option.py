"""The option that has a real autopilot fly: its program is checked first."""

import argparse
from pathlib import Path

import pytest

from planfly.terminal.autopilot_option import autopilot_program
from world.errors import FlightError


def test_without_the_option_there_is_none() -> None:
    assert autopilot_program(argparse.Namespace(autopilot=None)) is None


def test_a_program_is_looked_at_first(tmp_path: Path) -> None:
    given = argparse.Namespace(autopilot=str(tmp_path / "none"))
    with pytest.raises(FlightError, match="none: no such file"):
        autopilot_program(given)
    file = tmp_path / "program"
    file.write_text("#!/bin/sh\n", encoding="utf-8")
    with pytest.raises(FlightError, match="not executable"):
        autopilot_program(argparse.Namespace(autopilot=str(file)))
    file.chmod(0o755)
    assert autopilot_program(argparse.Namespace(autopilot=str(file))) == file
