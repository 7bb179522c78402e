"""An autopilot that states nothing but its name, its title and its control law flies once the catalog lists it."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

import planfly
from flight.autopilots import catalog
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import ControlLaw
from flight.autopilots.planfly.law import planfly_tick
from logs.recording.reader import read_log
from planfly import arguments
from world.arrays import Floats, Heights

TICKS: list[int] = []

MISSION = """QGC WPL 110
0 1 0 16 0 0 0 0 36.2578 -84.1401 335 1
1 0 3 16 0 0 0 0 36.2578 -84.1401 150 1
2 0 3 16 0 0 0 0 36.2623 -84.1401 150 1
3 0 3 16 0 0 0 0 36.2658 -84.1360 160 1
"""


def toy_tick(block: Floats, heights: Heights) -> int:
    TICKS.append(0)
    return planfly_tick(block, heights)


@dataclass(frozen=True)
class Toy(Autopilot):
    """An autopilot of a test."""

    name: ClassVar = "toy"
    title: ClassVar = "Toy"

    @property
    def control_law(self) -> ControlLaw:
        return ControlLaw(toy_tick)


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line of the catalog; the command line takes its names from there when it starts."""
    monkeypatch.setitem(sys.modules, "flight.autopilots.toy", sys.modules[__name__])
    monkeypatch.setattr(catalog, "AUTOPILOTS", (*catalog.AUTOPILOTS, catalog.Entry("toy", "toy.Toy")))
    assert isinstance(arguments.CHOICES, dict)
    monkeypatch.setitem(arguments.CHOICES, "autopilot", catalog.autopilot_names())


@pytest.mark.usefixtures("listed")
def test_it_flies_is_judged_and_read_back_from_its_log(tmp_path: Path) -> None:
    """Two legs of 500 m, on which the wind of the mission and the defaults of all parts apply."""
    mission = tmp_path / "two.waypoints"
    mission.write_text(MISSION, encoding="utf-8")
    flown = planfly.fly(mission, terrain="jacksboro", autopilot="toy", log=tmp_path / "two.mcap")
    assert len(TICKS) > 10.0 * 60  # 1,020 m at 25 m/s take 40 s
    assert flown.verdict.flyable
    assert flown.verdict.conditions.autopilot.startswith("Toy")
    read = read_log(tmp_path / "two.mcap")
    assert read.setup.autopilot == Toy()
