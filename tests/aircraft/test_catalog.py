"""The catalogue: units, and bad metadata."""

import math
import shutil
from pathlib import Path

import pytest

from aircraft.catalog import (
    Aircraft,
    copy_aircraft_folder,
    find_aircraft,
    load_aircraft,
    model_hash,
    read_aircraft,
)
from flight.dynamics.fdm import Fdm
from world.errors import FlightError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(load_aircraft("aerosonde").folder, tmp_path / "aerosonde"))


def _edit(folder: Path, old: str, new: str) -> None:
    file = folder / "aerosonde.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_aerosonde_comes_in_si_and_radians() -> None:
    aircraft = load_aircraft("aerosonde")
    assert aircraft.mass == 11.0
    assert aircraft.airspeed == 25.0
    assert aircraft.max_bank == pytest.approx(math.radians(30.0))
    assert aircraft.surface_rate == pytest.approx(math.radians(200.0))
    assert aircraft.battery_energy == pytest.approx(888.0 * 3600.0)
    assert aircraft.model_file.is_file()


def test_limits_of_the_metadata_are_those_of_the_model() -> None:
    aircraft = load_aircraft("aerosonde")
    text = aircraft.model_file.read_text()
    assert text.count(f"<max> {aircraft.max_elevator!r} </max>") == 3
    assert text.count(f"<rate_limit> {aircraft.surface_rate!r} </rate_limit>") == 3
    assert text.count(f"<lag> {1.0 / aircraft.surface_lag:.0f} </lag>") == 3
    assert text.count(f"<lag> {1.0 / aircraft.motor_lag:.0f} </lag>") == 1
    assert f'<property value="{aircraft.battery_voltage}"> motor/battery-v' in text


@pytest.mark.parametrize("name", ["", "zeppelin", "../aircraft/aerosonde", "aerosonde.xml"])
def test_unknown_name_lists_the_known_ones(name: str) -> None:
    with pytest.raises(FlightError, match=r"no aircraft called .*built-in aircraft: aerosonde, c172x, "):
        load_aircraft(name)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg = 11.0", "", r"missing mass_kg$"),
        ("mass_kg = 11.0", "mass_kg = 11.0\nmass_lb = 24", r"unknown key mass_lb$"),
        ("mass_kg = 11.0", "mass_kg = -1", r"mass_kg = -1 is not a positive number$"),
        ("mass_kg = 11.0", "mass_kg = nan", r"mass_kg = nan is not a positive number$"),
        ("mass_kg = 11.0", "mass_kg = true", r"mass_kg = True is not a positive number$"),
        ("mass_kg = 11.0", 'mass_kg = "11"', r"mass_kg = '11' is not a positive number$"),
        ("mass_kg = 11.0", "mass_kg = ", r"Invalid value"),
        ("airspeed_mps = 25.0", "airspeed_mps = 50.0", r"<= airspeed_max_mps, found"),
        ("title = ", "title = 1 #", r"title = 1 is not a string$"),
    ],
)
def test_bad_metadata_is_one_line_with_the_file(folder: Path, old: str, new: str, message: str) -> None:
    _edit(folder, old, new)
    with pytest.raises(FlightError, match=message) as caught:
        read_aircraft(folder)
    assert "\n" not in str(caught.value)
    assert str(folder / "aerosonde.toml") in str(caught.value)


def test_missing_and_undecodable_metadata(folder: Path) -> None:
    (folder / "aerosonde.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(FlightError, match=r"aerosonde\.toml: .*decode"):
        read_aircraft(folder)
    (folder / "aerosonde.toml").unlink()
    with pytest.raises(FlightError, match=r"aerosonde\.toml: No such file"):
        read_aircraft(folder)


@pytest.mark.parametrize("file", ["aerosonde.xml", "aerosonde.toml"])
def test_hash_follows_the_models_files(folder: Path, file: str) -> None:
    aircraft = read_aircraft(folder)
    before = model_hash(aircraft)
    assert before == model_hash(load_aircraft("aerosonde"))
    (folder / "README.md").write_text("prose does not count")
    (folder / "gains.toml").write_text("# nor do the gains\n")
    assert model_hash(aircraft) == before
    with (folder / file).open("a") as stream:
        stream.write("\n")
    assert model_hash(aircraft) != before


def test_a_battery_or_fuel(folder: Path) -> None:
    battery, cessna = load_aircraft("aerosonde"), load_aircraft("c172x")
    assert battery.battery_voltage == 44.4
    assert cessna.battery_voltage == 0.0
    assert cessna.battery_energy == pytest.approx(117.9 * 43.5e6)
    _edit(folder, "battery_v = 44.4", "fuel_kg = 2")
    with pytest.raises(FlightError, match=r"missing fuel_mj_per_kg$"):
        read_aircraft(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model = 3", r"model = 3 is not a table$"),
        ("[model]\ncolour = 3", r"model: unknown key colour$"),
        ("[model]\nengine_settles = 1", r"model\.engine_settles = 1 is not true or false$"),
        ("[model.command]\nflap = 1", r"model\.command: unknown key flap$"),
        ("[model.command]\nelevator = 1", r"model\.command\.elevator = 1 is not a property name and 2 number"),
        ('[model.command]\nelevator = ["a b", 1, 1]', r"is not a property name and 2 number"),
        ('[model.command]\nelevator = ["a", 1, 0]', r"is not a property name and 2 number"),
        ('[model.reading]\npower = ["a", true]', r"is not a property name and 1 number"),
        ('[model.reading]\npower = ["a"]', r"is not a property name and 1 number"),
        ('[model.reading]\npower = ["a", inf]', r"is not a property name and 1 number"),
    ],
)
def test_bad_model_tables(folder: Path, text: str, message: str) -> None:
    file = folder / "aerosonde.toml"
    # A top-level key has to stand before the first table.
    file.write_text(text + "\n" + file.read_text() if text.startswith("model") else file.read_text() + "\n" + text)
    with pytest.raises(FlightError, match=message) as caught:
        read_aircraft(folder)
    assert str(caught.value).startswith(f"{file}: ")


def test_names_and_folders(tmp_path: Path, folder: Path) -> None:
    assert find_aircraft("aerosonde").is_embedded
    assert not find_aircraft(str(folder)).is_embedded
    with pytest.raises(FlightError, match=r"nowhere\.toml: No such file"):
        find_aircraft(str(tmp_path / "nowhere"))
    (folder / "aerosonde.xml").unlink()
    with pytest.raises(FlightError, match=r"aerosonde\.xml: the aircraft model cannot be read"):
        model_hash(read_aircraft(folder))


def test_metadata_agrees_with_the_trims() -> None:
    from flight.dynamics.fdm import Fdm
    from flight.dynamics.trim import fastest_level_flight, slowest_level_flight

    cessna = slowest_level_flight(Fdm(load_aircraft("c172x")), 0.0)
    assert cessna is not None
    assert cessna.airspeed == pytest.approx(load_aircraft("c172x").stall_speed, abs=0.1)
    aircraft: Aircraft = load_aircraft("aerosonde")
    fdm = Fdm(aircraft)
    slow, fast = slowest_level_flight(fdm, 0.0), fastest_level_flight(fdm, 0.0)
    assert slow is not None
    assert fast is not None
    assert slow.airspeed == pytest.approx(aircraft.stall_speed, abs=0.05)
    assert aircraft.airspeed_max < fast.airspeed < aircraft.airspeed_max + 2.0


# ----------------------------------------------------------------------
# A folder for an aircraft of one's own holds what flies as the one that it was made from.


@pytest.mark.parametrize("name", ["aerosonde", "c172x"])
def test_the_same_aircraft_under_another_name(name: str, tmp_path: Path) -> None:
    source = load_aircraft(name)
    files = copy_aircraft_folder(tmp_path / "my-plane", source)
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


def test_a_folder_is_replaced_only_if_asked_and_only_if_it_is_an_aircrafts(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    copy_aircraft_folder(folder, load_aircraft("aerosonde"))
    (folder / "uncertainty.toml").write_text("of the aircraft before", encoding="utf-8")
    (folder / "flight.BIN").write_bytes(b"my log")
    with pytest.raises(FlightError, match="exists; overwrite=True replaces it"):
        copy_aircraft_folder(folder, load_aircraft("zagi"))
    copy_aircraft_folder(folder, load_aircraft("zagi"), overwrite=True)
    assert read_aircraft(folder).mass == load_aircraft("zagi").mass
    assert (folder / "flight.BIN").read_bytes() == b"my log"
    assert not (folder / "uncertainty.toml").exists()
    (tmp_path / "photos").mkdir()
    with pytest.raises(FlightError, match=r"photos: not an aircraft's folder: it has no photos\.toml"):
        copy_aircraft_folder(tmp_path / "photos", load_aircraft("zagi"), overwrite=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "photos"]


def test_a_folder_made_from_a_folder_brings_its_engines(tmp_path: Path) -> None:
    first = tmp_path / "first"
    copy_aircraft_folder(first, load_aircraft("aerosonde"))
    (first / "Engines").mkdir()
    (first / "Engines" / "prop.xml").write_text("<propeller/>", encoding="utf-8")
    (first / "first.xml~").write_text("old", encoding="utf-8")
    shutil.copy(first / "gains.toml", first / "notes.txt")
    made = copy_aircraft_folder(tmp_path / "second", read_aircraft(first))
    assert made == (
        "Engines/prop.xml",
        "README.md",
        "ardupilot.parm",
        "ardupilot.toml",
        "gains.toml",
        "second.toml",
        "second.xml",
    )


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        ("there", "there: exists; overwrite=True replaces it, or name another folder"),
        ("nowhere/mine", "its parent folder '.*nowhere' does not exist"),
        ("my plane", "expected a folder name of letters, digits"),
        ("gains", "other than ardupilot, draws, gains, posterior, uncertainty, README"),
        ("link", "link: exists"),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_is_left(folder: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "lost")
    with pytest.raises(FlightError, match=said):
        copy_aircraft_folder(tmp_path / folder, load_aircraft("aerosonde"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "there"]
