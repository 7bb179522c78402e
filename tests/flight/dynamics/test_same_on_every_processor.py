"""A trim is the same to the last digit, whatever processor NumPy's linear algebra is made for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SCRIPT = """
from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import straight
fdm = Fdm(load_aircraft("aerosonde"))
for speed in (24.0, 27.0, 30.0):
    for climb in (-0.05, 0.0, 0.05):
        print(speed, climb, *(value.hex() for value in straight(fdm, speed, 500.0, climb).vector()))
"""


def trims(core: str) -> list[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_CORETYPE": core}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def plain() -> list[str]:
    found = trims("Haswell")
    assert len(found) == 9
    return found


@pytest.mark.parametrize("core", ["Prescott", "Nehalem", "Sandybridge"])
def test_trim_is_the_same(plain: list[str], core: str) -> None:
    """OpenBLAS has other sums for each; a flight starts from a trim, and keeps what it starts with."""
    assert trims(core) == plain
