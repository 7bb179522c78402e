"""Autopilots that tests fly with: a fake of ours as a program, and the real ArduPlane where there is one."""

import os
import shlex
import sys
from pathlib import Path

import pytest

_FAKE = Path(__file__).parent / "flight" / "autopilots" / "arduplane_sitl" / "fake_autopilot.py"


def write_fake(folder: Path, fault: str = "none") -> Path:
    """Write a program that fails in one way of the fake autopilot's `FAULTS`; its path."""
    program = folder / f"autopilot-{fault}"
    program.write_text(f'#!/bin/sh\nexec {shlex.join([sys.executable, str(_FAKE), fault])} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program


def find_arduplane() -> Path | None:
    """The program of a real ArduPlane that ``PLANFLY_ARDUPLANE`` names; None where it names none."""
    named = os.environ.get("PLANFLY_ARDUPLANE")
    return Path(named) if named else None


def need_arduplane() -> Path:
    """The program of a real ArduPlane; a test without one is skipped, in CI too, and a path to nothing fails it."""
    program = find_arduplane()
    if program is None:
        pytest.skip("PLANFLY_ARDUPLANE names no ArduPlane (a program built for software in the loop)")
    assert program.is_file(), f"PLANFLY_ARDUPLANE: {program}: no such file"
    return program
