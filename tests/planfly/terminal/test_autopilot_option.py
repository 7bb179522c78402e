"""The option that has a real autopilot fly: its program checked first, and SIGTERM as Ctrl-C while it may run."""

import argparse
import os
import signal
from pathlib import Path

import pytest

from planfly.terminal.autopilot_option import autopilot_program
from world.errors import FlightError


def test_without_the_option_there_is_none_and_signals_stay() -> None:
    kept = signal.getsignal(signal.SIGTERM)
    with autopilot_program(argparse.Namespace(autopilot=None)) as program:
        assert program is None
        assert signal.getsignal(signal.SIGTERM) is kept


def test_a_program_is_looked_at_first(tmp_path: Path) -> None:
    given = argparse.Namespace(autopilot=str(tmp_path / "none"))
    with pytest.raises(FlightError, match="none: no such file"), autopilot_program(given):
        raise AssertionError("not reached")


def test_sigterm_interrupts_while_it_may_run(tmp_path: Path) -> None:
    file = tmp_path / "program"
    file.write_text("#!/bin/sh\n", encoding="utf-8")
    file.chmod(0o755)
    kept = signal.getsignal(signal.SIGTERM)
    with autopilot_program(argparse.Namespace(autopilot=str(file))) as program:
        assert program == file
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is kept
