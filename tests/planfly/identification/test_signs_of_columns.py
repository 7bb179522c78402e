"""A changed sign in a table of columns is found by the motion of a real flight."""

import re
import shutil
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.alignment import Clocks
from aircraft.identification.estimate import fit_parameters, make_aligned_signals
from logs.importers.motion_log import read_motion
from planfly.identification.base_numbers import base_model
from planfly.identification.checks import check_estimate
from planfly.identification.records import flight_records
from world.errors import LogError

THOR = Path(__file__).parents[3] / "examples" / "real" / "thor75"
# Part of the automatic flight, s of the log.
START_S = 350.0
END_S = 400.0


def _check_signs(table: Path) -> None:
    """Estimate an Ultra Stick from a part of a flight, and check the estimate."""
    aircraft = load_aircraft("ultrastick25e")
    base, log = base_model(aircraft), read_motion(table)
    part = flight_records(log, aircraft)[0].part_between(START_S, END_S)
    signals = make_aligned_signals([part], [Clocks(servo_lag=base.servo_lag)], base)
    check_estimate(fit_parameters(signals, base), base, {}, table.name)


def test_the_shipped_table_has_the_signs_of_the_flight() -> None:
    _check_signs(THOR / "thor_flight75.columns.toml")


@pytest.mark.parametrize("surface", ["elevator", "aileron"])
def test_a_changed_sign_is_refused(tmp_path: Path, surface: str) -> None:
    text = (THOR / "thor_flight75.columns.toml").read_text(encoding="utf-8")
    # Both halves of the ailerons, as the autopilot and as the pilot moved them.
    changed = re.sub(rf"(\[\[columns\.{surface}(?:_left|_right)?\]\]\n)", r"\1scale = -1.0\n", text)
    assert changed.count("scale = -1.0") == (2 if surface == "elevator" else 4)
    table = tmp_path / "changed.columns.toml"
    table.write_text(changed, encoding="utf-8")
    shutil.copyfile(THOR / "thor_flight75.mat", tmp_path / "thor_flight75.mat")
    with pytest.raises(LogError, match=f"the {surface} seems reversed"):
        _check_signs(table)
