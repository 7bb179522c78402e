"""Autopilots that tests fly with: a fake of ours as a program, and the real ArduPlane where there is one."""

import os
import shlex
import sys
from pathlib import Path

from tests.clients import ROOT, need

_FAKE = Path(__file__).parent / "flight" / "real_autopilot" / "fake_autopilot.py"


def write_fake(folder: Path, fault: str = "none") -> Path:
    """Write a program that fails in one way of `tests.flight.real_autopilot.fake_autopilot.FAULTS`; its path."""
    program = folder / f"autopilot-{fault}"
    program.write_text(f'#!/bin/sh\nexec {shlex.join([sys.executable, str(_FAKE), fault])} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program


def find_arduplane() -> Path | None:
    """The program of a real ArduPlane, None where there is none."""
    program = Path(os.environ.get("PLANFLY_ARDUPLANE", ROOT.parent / "shared" / "autopilot" / "arduplane"))
    return program if program.exists() else None


def need_arduplane() -> Path:
    """The program of a real ArduPlane; without it a test is skipped, and fails in CI."""
    return Path(need(find_arduplane(), "ArduPlane", "built for software in the loop; PLANFLY_ARDUPLANE names it"))
