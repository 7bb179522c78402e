"""What a script learns of bad input by `except planfly.PlanflyError`: file, field, value and what is allowed."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import planfly
from aircraft.catalog import load_aircraft
from planfly.campaigns.tables import CAMPAIGN_DATABASE
from tests.world.made.made_scenario import SMALL

_ITEM = "{}\t0\t3\t16\t0\t0\t0\t0\t{}\t8.0\t500\t1\n"
_MISSION = "QGC WPL 110\n" + _ITEM.format(0, 46.0) + _ITEM.format(1, 46.01) + _ITEM.format(2, 46.02)


class _Known(NamedTuple):
    """What the error is to hold; file: its last part.  allowed: how it begins."""

    file: str
    field: str
    value: Any
    allowed: str


def _scenario() -> object:
    return planfly.plan(_file("a.toml", SMALL + "\n[wind]\nspeed_mps = 41.0\n"))


def _own_aircraft() -> str:
    shutil.copytree(load_aircraft("aerosonde").folder, "mine")
    text = Path("mine/aerosonde.toml").read_text()
    Path("mine/mine.toml").write_text(text.replace("mass_kg = 11.0", "mass_kg = -1"))
    return "./mine"


def _terrain(elevation: np.ndarray[Any, Any], xmax: float = 8.5) -> object:
    np.savez("a.npz", elevation=elevation, xmin=8.0, xmax=xmax, ymin=46.0, ymax=46.5)
    return planfly.check(_file("a.waypoints", _MISSION), terrain="a.npz")


def _no_terrain() -> object:
    return planfly.plan(_file("a.toml", SMALL.replace('"flat"\namsl_m = 200', '"dem"\npath = "none.tif"')))


def _file(name: str, text: str) -> str:
    Path(name).write_text(text)
    return name


def _spread(table: str) -> object:
    return planfly.campaign("tight", spread=_file("a.toml", table))


# What is asked, and what the error is to hold.
CASES: dict[str, tuple[Callable[[], object], _Known]] = {
    "a scenario": (_scenario, _Known("a.toml", "wind.speed_mps", 41.0, "allowed 0..40")),
    "a scenario's terrain": (_no_terrain, _Known("a.toml", "terrain.path", "none.tif", "")),
    "an elevation file's edges": (
        lambda: _terrain(np.zeros((9, 9)), xmax=1000.0),
        _Known("a.npz", "west, east, south, north edge", [8.0, 1000.0, 46.0, 46.5], "expected degrees of longitude"),
    ),
    "an elevation file's heights": (
        lambda: _terrain(np.zeros(9)),
        _Known("a.npz", "elevation", (9,), "expected a 2-D array of numbers"),
    ),
    "a .waypoints": (
        lambda: planfly.check(_file("a.waypoints", _MISSION.replace("46.01", "91.5"))),
        _Known("a.waypoints", "latitude", 91.5, "allowed -90..90 degrees"),
    ),
    "a .plan": (
        lambda: planfly.check(_file("a.plan", '{"fileType": "Fence"}')),
        _Known("a.plan", "fileType", "Fence", 'expected "Plan"'),
    ),
    "a complex item of a .plan": (
        lambda: planfly.check(
            _file("a.plan", '{"fileType": "Plan", "mission": {"items": [{"type": "ComplexItem"}]}}'),
        ),
        _Known("a.plan", "mission.items.0.type", "ComplexItem", "only SimpleItem, "),
    ),
    "a parameter file": (
        lambda: planfly.plan("tight", params=_file("a.parm", "WP_RADIUS\t90\nwp radius\t9\n")),
        _Known("a.parm", "", "wp radius\t9", "expected a name and a value"),
    ),
    "a log": (lambda: planfly.read_log(_file("a.mcap", "no log")), _Known("a.mcap", "", None, "")),
    "an aircraft's name": (
        lambda: planfly.aircraft("boeing"),
        _Known("boeing", "", None, "built-in aircraft: aerosonde"),
    ),
    "an aircraft's folder": (lambda: planfly.aircraft(_own_aircraft()), _Known("mine.toml", "mass_kg", -1, "")),
    "a folder that a flight names": (
        lambda: planfly.plan("tight", aircraft=_own_aircraft()),
        _Known("mine.toml", "mass_kg", -1, ""),
    ),
    "an airspeed": (
        lambda: planfly.plan("tight", airspeed=59.0),
        _Known("", "airspeed", 59.0, "allowed 18..31 m/s for aerosonde"),
    ),
    "a spread": (
        lambda: _spread('[mass]\ndistribution = "norm"\nloc = "one"\nsource = "a guess"'),
        _Known("a.toml", "mass.loc", "one", "expected a finite number"),
    ),
    "a spread's distribution": (
        lambda: _spread('[mass]\ndistribution = "gauss"\nsource = "a guess"'),
        _Known("a.toml", "mass.distribution", "gauss", "expected a continuous distribution of scipy.stats"),
    ),
    "an export's suffix": (
        lambda: planfly.export(_file("a.waypoints", _MISSION), "b.doc"),
        _Known("b.doc", "suffix", ".doc", "expected one of .waypoints"),
    ),
    "an export onto a file": (
        lambda: planfly.export(_file("a.waypoints", _MISSION), _file("b.plan", "")),
        _Known("b.plan", "", None, ""),
    ),
    "a campaign that is not there": (
        lambda: planfly.campaign(_file("a.waypoints", _MISSION), out="none", resume=True),
        _Known(CAMPAIGN_DATABASE, "", None, ""),
    ),
    "a scheduler": (
        lambda: planfly.campaign(_file("a.waypoints", _MISSION), scheduler="udp://host"),
        _Known("", "scheduler", "udp://host", "expected tcp://HOST:PORT"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_script_learns_where_it_is_what_it_is_and_what_may_be(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ask, known = CASES[case]
    with pytest.raises(planfly.PlanflyError) as caught:
        ask()
    error, line = caught.value, str(caught.value)
    assert known == (Path(error.file).name, error.field, error.value, error.allowed[: len(known.allowed)])
    # The line says the same to a person.
    assert "\n" not in line
    assert all(part in line for part in (error.file, error.field, error.allowed))
