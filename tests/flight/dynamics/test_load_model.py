"""Models that cannot be loaded, or must not be: each is refused in one line that names its file."""

import socket
from pathlib import Path

import pytest

from aircraft.catalog import read_aircraft
from flight.dynamics.fdm import Fdm
from tests.own_aircraft import assert_refused, change_model
from tests.soak import SOAK


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_missing_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_model(tmp_path, "<fdm_config", "<fdm_config")
    Path("own/own.xml").unlink()
    assert_refused(capsys, "own.xml", "cannot be read: No such file")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<p> aero/beta-rad </p>", "<p> aero/side-angle </p>", "property aero/side-angle is read, but neither"),
        ("<p> aero/beta-rad </p>", "<p> propulsion/engine[7]/thrust-lbs </p>", "propulsion/engine[7]/thrust-lbs"),
        ("motor/battery-current-a", "motor/amperes", "the model does not define the property motor/battery-current-a"),
    ],
)
def test_an_unknown_property(old: str, new: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_model(tmp_path, old, new)
    assert_refused(capsys, "own.xml", said)


@pytest.mark.parametrize(
    "channel",
    [
        '<input port="5599"/>',
        '<input port="5599" protocol="UDP" action="ECHO"/>',
        '<output name="own.csv" type="CSV" rate="10"><rates>ON</rates></output>',
        '<output name="localhost" type="SOCKET" port="5599" rate="10"/>',
        '<output file="elsewhere"/>',
    ],
)
def test_an_xml_that_opens_a_port_or_writes_a_file(
    channel: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change_model(tmp_path, "</fdm_config>", channel + "</fdm_config>")
    line = Path("own/own.xml").read_text(encoding="utf-8").split(channel)[0].count("\n") + 1
    assert_refused(capsys, f"own.xml:{line}: ", "opens a port or writes a file; the model is refused")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 5599))


def test_a_channel_in_a_file_that_the_model_brings_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_model(tmp_path, "<propulsion/>", '<propulsion/><system file="radio"/>')
    Path("own/radio.xml").write_text('<system name="radio">\n<output type="SOCKET" port="5599"/>\n</system>\n')
    assert_refused(capsys, "radio.xml:2: <output> opens a port or writes a file")
    Path("own/radio.xml").unlink()
    assert_refused(capsys, "own.xml:", 'file="radio"', "not in the aircraft's folder")


# The Aerosonde's model has 11 kg: 1 % is 0.11 kg.
@pytest.mark.parametrize(
    ("mass", "taken"), [(11.108, True), (11.112, False), *([(10.892, True), (10.888, False)] if SOAK else [])]
)
def test_a_mass_that_is_not_the_models(
    mass: float, taken: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change_model(tmp_path, "<fdm_config", "<fdm_config")
    table = Path("own/own.toml")
    table.write_text(table.read_text(encoding="utf-8").replace("mass_kg = 11.0", f"mass_kg = {mass}"), encoding="utf-8")
    if taken:
        Fdm(read_aircraft(tmp_path / "own"))
    else:
        assert_refused(capsys, f"own.toml: mass_kg = {mass}", "own.xml has 11 kg with its fuel", "at most 1 %")
