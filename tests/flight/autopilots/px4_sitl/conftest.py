"""PX4 to fly with: a fake of ours as a program with start-up files, and the real PX4 where there is one."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.autopilots import need_px4, write_fake_px4

MakeFake = Callable[..., Path]


@pytest.fixture
def fake_px4(tmp_path: Path) -> MakeFake:
    """A function that writes a program which fails in one way, "none" by default, and returns its path."""
    return lambda fault="none": write_fake_px4(tmp_path, fault)


@pytest.fixture
def px4() -> Path:
    """The program of a real PX4."""
    return need_px4()
