"""What stands where an aircraft has no trim: closed throttles are filled from closed ones, by hand."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flight.autopilots import point_mass as subject
from flight.autopilots.point_mass import PointMass, excess_power, fill_excess_power, make_point_mass
from tests.flight.autopilots.arduplane.test_rtl_point_mass import uav
from world.wind import Wind

NONE = np.nan


def test_a_closed_throttle_without_a_trim_is_that_of_the_nearest_airspeed_and_then_height() -> None:
    """Three airspeeds and two heights; the next throttle climbs, and would make a glide that goes up."""
    closed = [[NONE, NONE], [-2.0, NONE], [-3.0, NONE]]
    climbs = [[1.5, 1.0], [NONE, 1.2], [NONE, 0.7]]
    full = [[4.0, NONE], [5.0, 3.0], [6.0, 2.5]]
    found = fill_excess_power(np.array([closed, climbs, full]))
    assert found[0].tolist() == [[-2.0, -2.0], [-2.0, -2.0], [-3.0, -3.0]]
    # The others by throttle: halfway between those that are known, or the nearest.
    assert found[1].tolist() == [[1.5, 1.0], [1.5, 1.2], [1.5, 0.7]]
    assert found[2].tolist() == [[4.0, 1.0], [5.0, 3.0], [6.0, 2.5]]


def test_a_height_without_any_trim_is_that_of_the_nearest() -> None:
    found = fill_excess_power(np.array([[[-2.0, NONE], [-3.0, NONE]], [[1.0, NONE], [2.0, NONE]]]))
    assert found.tolist() == [[[-2.0, -2.0], [-3.0, -3.0]], [[1.0, 1.0], [2.0, 2.0]]]


def made(monkeypatch: pytest.MonkeyPatch, slowest_glide: float) -> PointMass:
    """The aerosonde with other trims: 10 m/s by throttle less 2 m/s up, and none below 0.22 when slower than this."""

    def trim(_fdm: object, _amsl: float, given: dict[str, float], _near: object) -> SimpleNamespace | None:
        if given["throttle"] < 0.22 and given["airspeed"] < slowest_glide:
            return None
        return SimpleNamespace(climb=np.arcsin((10.0 * given["throttle"] - 2.0) / given["airspeed"]), alpha=0.05)

    monkeypatch.setattr(subject, "trim", trim)
    # Not the kept trims of that aircraft, nor these for anyone else.
    monkeypatch.setattr(subject, "_load_trim_tables", subject._load_trim_tables.__wrapped__)
    monkeypatch.setattr(subject, "read_tables", lambda *_: None)
    monkeypatch.setattr(subject, "write_tables", lambda *_: None)
    one = uav()
    return make_point_mass(one.aircraft, one.limits.envelope, one.airspeed, Wind(0.0, 0.0))


def test_a_glide_never_gets_the_thrust_of_a_throttle_that_has_a_trim(monkeypatch: pytest.MonkeyPatch) -> None:
    found = made(monkeypatch, 25.0)
    assert found.glides
    slow = [excess_power(found.excess, throttle, 18.0, 500.0, found.record) for throttle in (0.0, 0.25, 1.0)]
    assert slow == pytest.approx([-2.0, 0.5, 8.0])


def test_without_any_trim_of_a_closed_throttle_it_has_no_glide(monkeypatch: pytest.MonkeyPatch) -> None:
    found = made(monkeypatch, 1000.0)
    assert not found.glides
    # A return with an engine is flown still, by the nearest throttle.
    assert excess_power(found.excess, 0.1, 18.0, 500.0, found.record) == pytest.approx(0.5)


def test_trims_are_kept_to_the_last_bit_for_the_model_that_they_are_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subject, "user_cache_dir", lambda name: str(tmp_path / name))
    keep = subject._load_trim_tables.__wrapped__
    aircraft = uav().aircraft
    made = keep(aircraft)
    (file,) = (tmp_path / "planfly").iterdir()
    sound = file.read_text(encoding="utf-8")
    # A kept file is read, and no aircraft loaded.
    with monkeypatch.context() as patch:
        patch.setattr(subject, "Fdm", None)
        for one, again in zip(made, keep(aircraft), strict=True):
            np.testing.assert_array_equal(one, again)
    # One of another model, or that is damaged, is made anew.
    trims = {"excess": made[1], "alpha": np.zeros(len(made[0]))}
    monkeypatch.setattr(subject, "_compute_trim_tables", lambda *_: trims)
    for damaged in (sound.replace('"model_hash": "', '"model_hash": "0'), sound[:99], sound.replace("null", "[1]")):
        file.write_text(damaged, encoding="utf-8")
        assert keep(aircraft)[2:4] == (0.0, 0.0)
