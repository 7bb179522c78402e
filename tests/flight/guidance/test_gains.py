"""Gains as compiled code reads them, and files that are refused."""

from dataclasses import asdict, replace
from pathlib import Path

import pytest

from aircraft.catalog import Aircraft
from flight.guidance.gains import GAINS, load_gains
from world.errors import FlightError
from world.kernels import field_names


def test_the_record_holds_each_gain_by_its_name(aerosonde: Aircraft) -> None:
    gains = load_gains(aerosonde)
    record = gains.record()
    assert {name: float(record[name]) for name in field_names(GAINS)} == asdict(gains)
    # 0.2 to 0.3 s of roll lead.
    assert 0.1 <= gains.turn_lead <= 0.4


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("", "missing "),
        ("surprise = 1.0", "unknown surprise"),
        ("roll_gain_1_s = nan", "not a finite number"),
        ("roll_gain_1_s = true", "not a finite number"),
        ('roll_gain_1_s = "4"', "not a finite number"),
        ("= 3", "gains.toml: "),
    ],
)
def test_bad_gains_are_refused_in_one_line(line: str, wanted: str, aerosonde: Aircraft, tmp_path: Path) -> None:
    folder = tmp_path
    with pytest.raises(FlightError, match="gains"):
        load_gains(replace(aerosonde, folder=folder))
    text = (aerosonde.folder / "gains.toml").read_text(encoding="utf-8")
    kept = [row for row in text.splitlines() if not row.startswith("roll_gain")]
    (folder / "gains.toml").write_text("\n".join([*kept, line]), encoding="utf-8")
    with pytest.raises(FlightError, match=wanted) as caught:
        load_gains(replace(aerosonde, folder=folder))
    assert "\n" not in str(caught.value)
