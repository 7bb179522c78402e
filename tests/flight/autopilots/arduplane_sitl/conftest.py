"""Autopilots to fly with: a fake of ours as a program, and the real ArduPlane where there is one."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.autopilots import need_arduplane, write_fake

MakeFake = Callable[..., Path]


@pytest.fixture
def fake_autopilot(tmp_path: Path) -> MakeFake:
    """A function that writes a program which fails in one way, "none" by default, and returns its path."""
    return lambda fault="none": write_fake(tmp_path, fault)


@pytest.fixture
def arduplane() -> Path:
    """The program of a real ArduPlane."""
    return need_arduplane()
