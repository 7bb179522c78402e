"""A model is tried in another process, once a version: what kills that process is an error here, and no crash."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from flight.dynamics import model_trial
from flight.dynamics.model_trial import try_model
from tests.own_aircraft import assert_refused, change_model
from world.errors import FlightError


class Tried:
    """What the other process does, and how often it was asked."""

    def __init__(self) -> None:
        self.code: int | None = 0
        self.folders: list[str] = []

    def run(self, arguments: list[str], **_: Any) -> "subprocess.CompletedProcess[bytes]":
        self.folders.append(arguments[-1])
        if self.code is None:
            raise subprocess.TimeoutExpired(arguments, 60.0)
        return subprocess.CompletedProcess(arguments, self.code)


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> Tried:
    fake = Tried()
    monkeypatch.setattr(model_trial.subprocess, "run", fake.run)
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
