"""Models that are refused before JSBSim sees them, with file and line."""

import shutil
from pathlib import Path

import pytest

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from flight.dynamics.fdm import Fdm
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")


@pytest.fixture
def model(tmp_path: Path) -> Aircraft:
    return read_aircraft(Path(shutil.copytree(AEROSONDE.folder, tmp_path / "aerosonde")))


def test_copied_model_flies(model: Aircraft) -> None:
    Fdm(model).start(47.0, 8.0, 500.0, 1.0, 25.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</fdm_config>", '<input port="5555"/></fdm_config>', "<input> opens a port"),
        ("</fdm_config>", "<input><property>a/b</property></input></fdm_config>", "<input> opens a port"),
        ("</fdm_config>", '<output name="f.csv" type="CSV" rate="9"/></fdm_config>', "<output> opens a port or writes"),
        ("</fdm_config>", '<output file="unitest"/></fdm_config>', "<output> opens a port"),
        ("<propulsion/>", '<propulsion><engine file="electric"/></propulsion>', "brings in another file"),
        ("<input> command/elevator-rad", '<input port="1"> command/elevator-rad', "<input> opens a port"),
        ("</flight_control>", '<output type="SOCKET"/></flight_control>', "<output> opens a port"),
        ("<p> aero/beta-rad </p>", "<p> aero/side-angle </p>", "property aero/side-angle is read, and neither"),
        ("> aero/alpha-rad </indep", "> aero/alfa </indep", "property aero/alfa is read, and neither"),
        ("<input> command/rudder-rad", "<input> -command/rudder", "property command/rudder is read, and neither"),
    ],
)
def test_models_are_refused_with_file_and_line(model: Aircraft, old: str, new: str, message: str) -> None:
    text = model.model_file.read_text()
    line = text[: text.index(old)].count("\n") + 1
    model.model_file.write_text(text.replace(old, new, 1))
    with pytest.raises(FlightError, match=message) as caught:
        Fdm(model)
    assert str(caught.value).startswith(f"{model.model_file}:{line}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE x [<!ENTITY a "b">]><fdm_config/>', "document type declaration"),
        ("<runscript/>", "root element is <runscript>"),
        ("<fdm_config>", "not well-formed"),
        ("", "not well-formed"),
        ("<fdm_config/>", "JSBSim"),
    ],
)
def test_other_files_are_refused(model: Aircraft, text: str, message: str) -> None:
    model.model_file.write_text(text)
    with pytest.raises(FlightError, match=message) as caught:
        Fdm(model)
    assert "\n" not in str(caught.value)


def test_missing_model_is_refused(model: Aircraft) -> None:
    model.model_file.unlink()
    with pytest.raises(FlightError, match="cannot be read: No such file"):
        Fdm(model)


def test_model_without_our_properties_is_refused(model: Aircraft) -> None:
    text = model.model_file.read_text()
    model.model_file.write_text(text.replace("motor/battery-current-a", "motor/amperes"))
    with pytest.raises(FlightError, match="property motor/battery-current-a is needed and not defined"):
        Fdm(model)
