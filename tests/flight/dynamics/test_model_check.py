"""Models that are refused before JSBSim sees them, with file and line."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from flight.dynamics import model_check
from flight.dynamics.fdm import Fdm
from flight.dynamics.model_check import try_model
from tests.own_aircraft import assert_refused, change_model
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")
# As it is but in tests (tests/conftest.py).
TRY = model_check._run_trial


@pytest.fixture
def model(tmp_path: Path) -> Aircraft:
    return read_aircraft(Path(shutil.copytree(AEROSONDE.folder, tmp_path / "aerosonde")))


def test_copied_model_flies(model: Aircraft) -> None:
    Fdm(model).start(47.0, 8.0, 500.0, 1.0, 25.0)


def test_a_model_that_changes_after_it_was_read_is_checked_again(model: Aircraft) -> None:
    Fdm(model).start(47.0, 8.0, 500.0, 1.0, 25.0)
    text = model.model_file.read_text(encoding="utf-8")
    model.model_file.write_text(text.replace("</fdm_config>", '<input port="5555"/></fdm_config>'), encoding="utf-8")
    with pytest.raises(FlightError, match="<input> opens a port"):
        Fdm(model)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</fdm_config>", '<input port="5555"/></fdm_config>', "<input> opens a port"),
        ("</fdm_config>", "<input><property>a/b</property></input></fdm_config>", "<input> opens a port"),
        ("</fdm_config>", '<output name="f.csv" type="CSV" rate="9"/></fdm_config>', "<output> opens a port or writes"),
        ("</fdm_config>", '<output file="unitest"/></fdm_config>', "<output> opens a port"),
        ("<propulsion/>", '<propulsion><engine file="electric"/></propulsion>', "includes another file"),
        ("<input> command/elevator-rad", '<input port="1"> command/elevator-rad', "<input> opens a port"),
        ("</flight_control>", '<output type="SOCKET"/></flight_control>', "<output> opens a port"),
        ("<p> aero/beta-rad </p>", "<p> aero/side-angle </p>", "property aero/side-angle is read, but neither"),
        ("> aero/alpha-rad </indep", "> aero/alfa </indep", "property aero/alfa is read, but neither"),
        ("<input> command/rudder-rad", "<input> -command/rudder", "property command/rudder is read, but neither"),
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
    with pytest.raises(FlightError, match="the model does not define the property motor/battery-current-a"):
        Fdm(model)


# ----------------------------------------------------------------------
# A model is tried in another process, once a version: what kills that process is an error here, and no crash.


class Tried:
    """What the other process does, and how often it was asked."""

    def __init__(self) -> None:
        self.code: int | None = 0
        self.folders: list[str] = []

    def run(self, arguments: list[str], **_: Any) -> "subprocess.CompletedProcess[bytes]":
        self.folders.append(arguments[-1])
        if self.code is None:
            raise subprocess.TimeoutExpired(arguments, 60.0)
        return subprocess.CompletedProcess(arguments, self.code, b"", b"")


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> Tried:
    fake = Tried()
    monkeypatch.setattr(model_check, "_run_trial", TRY)
    monkeypatch.setattr(model_check.subprocess, "run", fake.run)
    return fake


@pytest.fixture
def own(tmp_path: Path) -> Aircraft:
    """A copy that no other test has tried."""
    return read_aircraft(Path(shutil.copytree(load_aircraft("aerosonde").folder, tmp_path / "aerosonde")))


# 3 is what the process ends with where it refuses the model: loading it here says why.
@pytest.mark.parametrize("code", [0, 3])
def test_a_process_that_ends_by_itself_is_no_error(tried: Tried, own: Aircraft, code: int) -> None:
    tried.code = code
    try_model(own)
    assert tried.folders == [str(own.folder)]


@pytest.mark.parametrize(("code", "how"), [(1, "aborts the process"), (-6, "aborts the process"), (None, "hangs")])
def test_a_process_that_dies_or_hangs_is(tried: Tried, own: Aircraft, code: int | None, how: str) -> None:
    tried.code = code
    with pytest.raises(FlightError) as caught:
        try_model(own)
    assert str(caught.value).startswith(f"{own.model_file}: JSBSim {how} with this model")


def test_each_version_is_tried_once(tried: Tried, own: Aircraft) -> None:
    try_model(own)
    try_model(own)
    assert len(tried.folders) == 1
    with own.model_file.open("a") as stream:
        stream.write("\n")
    try_model(own)
    assert len(tried.folders) == 2


def test_a_model_that_aborts_jsbsim(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(model_check, "_run_trial", TRY)
    # An engine that JSBSim would make is one of those names that cannot be looked up before: this one it does not
    # make, because there is only a tank.
    change_model(tmp_path, "<p> aero/beta-rad </p>", "<p> propulsion/engine[7]/thrust-lbs </p>")
    model = Path("own/own.xml")
    tank = '<propulsion><tank type="FUEL"><location unit="IN"><x>0</x><y>0</y><z>0</z></location><capacity unit="LBS">1'
    text = model.read_text(encoding="utf-8")
    assert "<propulsion/>" in text
    tank += '</capacity><contents unit="LBS">0</contents></tank></propulsion>'
    model.write_text(text.replace("<propulsion/>", tank), encoding="utf-8")
    assert_refused(capsys, "own.xml", "JSBSim")
