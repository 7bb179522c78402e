"""Autopilots that tests fly with: fakes of ours as programs, and the real ArduPlane and PX4 where there are any."""

import os
import shlex
import sys
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.sitl import flight as sitl_flight

_AUTOPILOTS = Path(__file__).parent / "flight" / "autopilots"
_FAKE = _AUTOPILOTS / "arduplane_sitl" / "fake_autopilot.py"
_FAKE_PX4 = _AUTOPILOTS / "px4_sitl" / "fake_px4.py"


def write_fake(folder: Path, fault: str = "none") -> Path:
    """Write a program that fails in one way of the fake autopilot's `FAULTS`; its path."""
    return _write_program(folder / f"autopilot-{fault}", _FAKE, fault)


def write_fake_px4(folder: Path, fault: str = "none") -> Path:
    """Write a program that fails in one way of the fake PX4's `FAULTS`, with start-up files beside it; its path."""
    script = folder / "etc" / "init.d-posix" / "rcS"
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text("#!/bin/sh\n", encoding="utf-8")
    return _write_program(folder / f"px4-{fault}", _FAKE_PX4, fault)


def _write_program(program: Path, fake: Path, fault: str) -> Path:
    program.write_text(f'#!/bin/sh\nexec {shlex.join([sys.executable, str(fake), fault])} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program


def arduplane_program(program: Path) -> ArduPlaneSitl:
    """Return the autopilot of an ArduPlane program, with the aerosonde's parameters."""
    return ArduPlaneSitl(ArduPilotParameters.load(load_aircraft("aerosonde")), binary=program)


def shorten_run_in(patch: pytest.MonkeyPatch) -> None:
    """For the fakes, which fly steadily at once, where a real autopilot needs the run-in to settle."""
    patch.setattr(sitl_flight, "MIN_RUN_IN_DISTANCE_M", 100.0)
    patch.setattr(sitl_flight, "MIN_RUN_IN_TIME_S", 4.0)


def find_arduplane() -> Path | None:
    """The program of a real ArduPlane that ``PLANFLY_ARDUPLANE`` names; None where it names none."""
    named = os.environ.get("PLANFLY_ARDUPLANE")
    return Path(named) if named else None


def need_arduplane() -> Path:
    """The program of a real ArduPlane; a test without one is skipped, in CI too, and a path to nothing fails it."""
    return _needed(find_arduplane(), "PLANFLY_ARDUPLANE", "an ArduPlane")


def find_px4() -> Path | None:
    """The program of a real PX4 that ``PLANFLY_PX4`` names; None where it names none."""
    named = os.environ.get("PLANFLY_PX4")
    return Path(named) if named else None


def need_px4() -> Path:
    """The program of a real PX4, as `need_arduplane` has it."""
    return _needed(find_px4(), "PLANFLY_PX4", "a PX4")


def _needed(program: Path | None, variable: str, kind: str) -> Path:
    if program is None:
        pytest.skip(f"{variable} does not name {kind} (a program built for software in the loop)")
    assert program.is_file(), f"{variable}: {program}: no such file"
    return program
