"""A folder for an aircraft of one's own holds what flies as the one that it was made from."""

import shutil
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft, read_aircraft
from aircraft.own_folder import make_own_folder
from flight.dynamics.fdm import Fdm
from world.errors import FlightError


@pytest.mark.parametrize("name", ["aerosonde", "c172x"])
def test_the_same_aircraft_under_another_name(name: str, tmp_path: Path) -> None:
    source = load_aircraft(name)
    files = make_own_folder(tmp_path / "my-plane", source)
    assert sorted(path.name for path in (tmp_path / "my-plane").iterdir()) == list(files)
    assert [path.name for path in tmp_path.iterdir()] == ["my-plane"]
    mine = read_aircraft(tmp_path / "my-plane")
    numbers = ("mass", "airspeed", "stall_speed", "max_bank", "battery_energy", "surface_rate")
    assert [getattr(mine, key) for key in numbers] == [getattr(source, key) for key in numbers]
    states = []
    for aircraft in (source, mine):
        fdm = Fdm(aircraft)
        fdm.start(46.0, 8.0, 600.0, 1.0, aircraft.airspeed)
        fdm.step(60)
        states.append(fdm.read())
    assert states[0] == states[1]


def test_a_folder_made_from_a_folder_brings_its_engines(tmp_path: Path) -> None:
    first = tmp_path / "first"
    make_own_folder(first, load_aircraft("aerosonde"))
    (first / "Engines").mkdir()
    (first / "Engines" / "prop.xml").write_text("<propeller/>", encoding="utf-8")
    (first / "first.xml~").write_text("old", encoding="utf-8")
    shutil.copy(first / "gains.toml", first / "notes.txt")
    made = make_own_folder(tmp_path / "second", read_aircraft(first))
    assert made == (
        "Engines/prop.xml", "README.md", "ardupilot.parm", "ardupilot.toml", "gains.toml", "second.toml", "second.xml",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        ("there", "there: exists; name a folder that does not"),
        ("nowhere/mine", "its folder .*nowhere does not exist"),
        ("my plane", "a folder's name of letters, digits"),
        ("gains", "none of ardupilot, gains, README"),
        ("link", "link: exists"),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_is_left(folder: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "lost")
    with pytest.raises(FlightError, match=said):
        make_own_folder(tmp_path / folder, load_aircraft("aerosonde"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "there"]
