"""Flights that end before their route does: a verdict with its own exit code, and a log that can be checked."""

from pathlib import Path

import pytest

from planfly.cli import main
from tests.own_aircraft import change_model, fly, write_mission, write_scenario


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_dive_into_the_ground(capsys: pytest.CaptureFixture[str]) -> None:
    write_scenario()
    write_mission(400.0, 400.0, 400.0, 400.0)
    assert fly() == 4
    text = capsys.readouterr().out
    assert text.startswith("not flyable")
    assert "ground contact" in text
    assert main(["check", "f.mcap"]) == 4


def test_a_start_under_the_terrain(capsys: pytest.CaptureFixture[str]) -> None:
    write_scenario()
    write_mission(-5.0, 800.0, 800.0)
    assert fly() == 4
    text = capsys.readouterr().out
    assert text.startswith(
        "not flyable: completion (not started: start at -5 m AMSL: not above the terrain, which is at 0 m"
    )
    assert "log       none: nothing was flown" in text
    assert not Path("f.mcap").exists()


# ln(4 - t) is minus infinity from the fourth second on, and no number soon after.
POISON = """<function name="aero/poison">
<ln><difference><value>4</value><p>simulation/sim-time-sec</p></difference></ln>
</function>"""


def test_a_state_that_is_not_a_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_model(tmp_path, '<axis name="PITCH">', '<axis name="PITCH">' + POISON)
    assert fly() == 4
    text = capsys.readouterr().out
    assert text.startswith("not flyable")
    assert "not a number" in text
    assert main(["check", "f.mcap"]) == 4
