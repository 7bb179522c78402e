from pathlib import Path

import pytest

from planfly.identification.servos import read_servos
from world.errors import FlightError


@pytest.mark.parametrize(
    "text",
    [
        "[elevator]\noutput = 2\npulse_us = [1100, 1900]\n",
        "[elevator]\noutput = 2\npulse_us = [2, 1]\nvalue_deg = [1, 2]",
    ],
)
def test_a_bad_table_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "ardupilot.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FlightError, match="not a table of servo outputs") as refused:
        read_servos(file)
    assert "\n" not in str(refused.value)
