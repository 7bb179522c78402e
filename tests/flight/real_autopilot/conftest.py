"""Autopilots to fly with: a fake of ours as a program, and the real ArduPlane where there is one."""

import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.clients import ROOT, need

FAKE = Path(__file__).with_name("fake_autopilot.py")
MakeFake = Callable[..., Path]


@pytest.fixture
def fake_autopilot(tmp_path: Path) -> MakeFake:
    """A function that writes a program which fails in one way, "none" by default, and returns its path."""

    def make(fault: str = "none") -> Path:
        program = tmp_path / f"autopilot-{fault}"
        program.write_text(f'#!/bin/sh\nexec {shlex.join([sys.executable, str(FAKE), fault])} "$@"\n', encoding="utf-8")
        program.chmod(0o755)
        return program

    return make


@pytest.fixture
def arduplane() -> Path:
    """The program of a real ArduPlane."""
    found = os.environ.get("PLANFLY_ARDUPLANE", ROOT.parent / "shared" / "autopilot" / "arduplane")
    how = "software in the loop; PLANFLY_ARDUPLANE names it"
    return Path(need(found, "ArduPlane", how))
