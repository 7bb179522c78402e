"""The script that chooses gains: what it searches on, how it searches, and that the committed files are its own."""

import math
import shutil
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft
from benchmarks.tuning.tune_gains import DIGITS, REPORTED, SEARCHED, TRAINED, rounded, search, write
from benchmarks.tuning.tuning_missions import Case, cases
from flight.guidance.gains import Gains, load_gains
from flight.guidance.model_gains import airframe_gains, gains_at_airspeed
from tests.setups import setup_maker, standard

NAMES = sorted(TRAINED)


def made(aircraft: Aircraft, numbers: Iterable[int], seed: int = 1) -> list[Case]:
    return cases(aircraft, setup_maker(aircraft), seed, numbers)


@pytest.mark.parametrize("name", NAMES)
def test_the_missions_are_of_every_kind_and_not_those_reported_on(name: str) -> None:
    aircraft = load_aircraft(name)
    trained, reported = made(aircraft, TRAINED[name]), made(aircraft, REPORTED)
    assert {case.straight for case in trained} == {True, False}
    assert {case.setup.guidance_hz for case in trained} == {30, 60}
    assert {case.setup.scenario.wind.turbulence for case in trained} == {"none", "light", "moderate"}
    assert {case.variation for case in trained} == {case.variation for case in reported}
    routes = [case.setup.route.positions for case in [*trained, *reported]]
    turns = [np.diff(np.arctan2(*np.diff(way[:, :2], axis=0).T)) for way in [*routes, standard()]]
    assert len({tuple(np.round(turn, 6)) for turn in turns}) == len(turns)
    for seed in (2, 3):
        assert len(made(aircraft, TRAINED[name], seed)) == len(trained)


def test_the_search_finds_the_least_and_does_so_again() -> None:
    aircraft = load_aircraft("aerosonde")
    begun = replace(load_gains(aircraft), **gains_at_airspeed(aircraft.airspeed))
    best = {
        name: value * (1.0 + 0.4 * math.sin(k))
        for k, (name, value) in enumerate(gains_at_airspeed(aircraft.airspeed).items())
    }

    def far(gains: Gains) -> float:
        return 1.0 + sum(math.log(getattr(gains, name) / value) ** 2 for name, value in best.items())

    found = search(begun, far, 20, 1)
    assert far(found) < 1.0 + 0.05 * (far(begun) - 1.0)
    assert search(begun, far, 20, 1) == found
    assert search(begun, far, 0, 1) == rounded(begun)
    untouched = [item.name for item in fields(Gains) if item.name not in SEARCHED]
    assert all(getattr(found, name) == getattr(begun, name) for name in untouched)


def test_what_is_written_is_what_is_read(tmp_path: Path) -> None:
    aircraft = load_aircraft("aerosonde")
    shutil.copy(aircraft.folder / "gains.toml", tmp_path)
    chosen = rounded(replace(load_gains(aircraft), **gains_at_airspeed(aircraft.airspeed)))
    write(replace(aircraft, folder=tmp_path), chosen, 3, 7)
    again = load_gains(replace(aircraft, folder=tmp_path))
    assert asdict(again) == pytest.approx(asdict(chosen), rel=10.0**-DIGITS)
    assert "tune_gains aerosonde --rounds 3 --seed 7 --write" in (tmp_path / "gains.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_the_airframes_own_gains_are_off_its_model(name: str) -> None:
    aircraft = load_aircraft(name)
    gains = load_gains(aircraft)
    for key, value in airframe_gains(aircraft).items():
        assert getattr(gains, key) == pytest.approx(value, rel=1e-3), key
    assert f"tune_gains {name} --rounds" in (aircraft.folder / "gains.toml").read_text(encoding="utf-8")
