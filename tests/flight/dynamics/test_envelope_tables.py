"""The envelope from JSBSim's trims, and its cache."""

import json
import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import flight.dynamics.envelope_tables
from aircraft.catalog import load_aircraft, model_hash, read_aircraft
from aircraft.envelope import Envelope
from aircraft.uncertainty import Uncertainty
from flight.dynamics.envelope_tables import _level_speed_range, cache_file, compute_tables, load_envelope
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import Trim
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight.dynamics.envelope_tables, "user_cache_dir", lambda name: str(folder / name))
        yield


@pytest.fixture(scope="module")
def computed(_own_cache: None) -> dict[bool, Envelope]:
    """As it is computed, by whether the motor brakes: nothing is in the cache, whichever tests came before."""
    for motor_braking in (False, True):
        cache_file(AEROSONDE, motor_braking).unlink(missing_ok=True)
    return {motor_braking: load_envelope(AEROSONDE, motor_braking=motor_braking) for motor_braking in (False, True)}


def _assert_equal(a: Envelope, b: Envelope) -> None:
    for field in fields(Envelope):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))


def _angles_deg(envelope: Envelope, airspeed: float, amsl: float) -> tuple[float, float]:
    climb, descent = envelope.air_angles(airspeed, amsl)
    return math.degrees(climb), math.degrees(descent)


def test_figures_of_the_aerosonde(computed: dict[bool, Envelope]) -> None:
    coasting, braking = computed[False], computed[True]
    climb, descent = _angles_deg(coasting, 25.0, 500.0)
    assert climb == pytest.approx(13.7, abs=0.15)
    assert descent == pytest.approx(7.8, abs=0.2)
    assert _angles_deg(coasting, 30.0, 500.0)[0] == pytest.approx(4.8, abs=0.1)
    assert _angles_deg(braking, 25.0, 500.0)[1] == pytest.approx(16.4, abs=0.2)
    np.testing.assert_allclose(coasting.climb, braking.climb, atol=2e-9)
    assert coasting.level_speeds(0.0) == pytest.approx((15.9, 32.5), abs=0.1)
    assert coasting.max_bank == AEROSONDE.max_bank
    assert coasting.model_hash == model_hash(AEROSONDE)


def test_in_wind_the_slopes_over_the_ground_change() -> None:
    envelope = load_envelope(AEROSONDE)
    tail, head = (math.degrees(envelope.slope_limits(25.0, 500.0, wind)[0]) for wind in (10.0, -10.0))
    assert tail == pytest.approx(10.0, abs=0.4)
    assert head == pytest.approx(22.5, abs=0.4)


def test_shape_of_the_envelope() -> None:
    envelope = load_envelope(AEROSONDE)
    flown = ~np.isnan(envelope.climb) & ~np.isnan(envelope.descent)
    level = (envelope.airspeed[:, None] > envelope.level_speed_min + 0.5) & (
        envelope.airspeed[:, None] < envelope.level_speed_max
    )
    # There are trims wherever level flight is possible, climbs are climbs up to the fastest level flight and not
    # beyond, and a slower climb is a steeper one.
    assert flown[level].all()
    assert (envelope.climb[level] > 0.0).all()
    assert (envelope.climb[envelope.airspeed[:, None] > envelope.level_speed_max] < 0.0).all()
    assert (np.diff(envelope.climb, axis=0)[~np.isnan(np.diff(envelope.climb, axis=0))] < 0.0).all()
    # With the elevator at its stop the lift coefficient is one number, so the speed goes with the density's root:
    # 1.225 to 0.8191 kg/m^3 at 4000 m.
    ratio = envelope.level_speed_min[envelope.amsl == 4000.0][0] / envelope.level_speed_min[0]
    assert ratio == pytest.approx(math.sqrt(1.225 / 0.8191), rel=2e-3)


def test_no_trim_has_no_angles() -> None:
    envelope = load_envelope(AEROSONDE)
    assert np.isnan(envelope.air_angles(16.5, 4000.0)).all()
    assert np.isnan(envelope.air_angles(10.0, 0.0)).all()
    assert np.isnan(envelope.slope_limits(60.0, 0.0)).all()
    # Between the slowest level flight, 15.9 m/s, and the slowest trim of the table there are limits all the same.
    assert not np.isnan(envelope.air_angles(16.2, 0.0)).any()
    assert np.isnan(envelope.air_angles(15.0, 0.0)).all()
    assert envelope.air_angles(25.0, -50.0) == envelope.air_angles(25.0, 0.0)


@pytest.mark.parametrize("motor_braking", [False, True])
def test_cached_and_computed_are_equal_to_the_last_bit(computed: dict[bool, Envelope], motor_braking: bool) -> None:
    file = cache_file(AEROSONDE, motor_braking)
    assert file.is_file()
    _assert_equal(computed[motor_braking], load_envelope(AEROSONDE, motor_braking=motor_braking))
    assert not list(file.parent.glob("*.tmp"))


def test_cache_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    envelope = load_envelope(AEROSONDE)
    monkeypatch.setattr(flight.dynamics.envelope_tables, "Fdm", None)
    _assert_equal(envelope, load_envelope(AEROSONDE))


def _damage_cut(text: str) -> str:
    return text[: len(text) // 2]


def _damage_schema(text: str) -> str:
    return text.replace('"schema": ', '"schema": 9')


def _damage_hash(text: str) -> str:
    return text.replace(model_hash(AEROSONDE), "0" * 64)


def _damage_jsbsim(text: str) -> str:
    return text.replace('"jsbsim": "', '"jsbsim": "0.')


def _damage_shape(text: str) -> str:
    content = json.loads(text)
    content["tables"]["climb"] = content["tables"]["climb"][:-1]
    return json.dumps(content)


def _damage_ragged(text: str) -> str:
    content = json.loads(text)
    content["tables"]["climb"][0] = [1.0]
    return json.dumps(content)


def _damage_grid(text: str) -> str:
    content = json.loads(text)
    content["tables"]["amsl"][0] = -1.0
    return json.dumps(content)


def _damage_missing(text: str) -> str:
    content = json.loads(text)
    del content["tables"]["descent"]
    return json.dumps(content)


@pytest.mark.parametrize(
    "damage",
    [
        _damage_cut,
        _damage_schema,
        _damage_hash,
        _damage_jsbsim,
        _damage_shape,
        _damage_ragged,
        _damage_grid,
        _damage_missing,
        lambda _: "",
        lambda _: "[]",
        lambda _: "null",
        lambda _: '{"tables": 3}',
    ],
)
def test_damaged_cache_is_computed_anew(damage: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    envelope = load_envelope(AEROSONDE)
    file = cache_file(AEROSONDE, False)
    sound = file.read_text()
    assert damage(sound) != sound
    file.write_text(damage(sound))
    # The trims themselves are tested above; here they only need to be asked for.
    tables = {name: getattr(envelope, name) for name in flight.dynamics.envelope_tables._TABLE_NAMES}
    asked = []

    def compute(*arguments: object) -> dict[str, object]:
        asked.append(arguments)
        return tables

    monkeypatch.setattr(flight.dynamics.envelope_tables, "compute_tables", compute)
    _assert_equal(envelope, load_envelope(AEROSONDE))
    assert len(asked) == 1
    assert file.read_text() == sound


def test_undecodable_cache_is_computed_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    envelope = load_envelope(AEROSONDE)
    file = cache_file(AEROSONDE, False)
    sound = file.read_text()
    tables = {name: getattr(envelope, name) for name in flight.dynamics.envelope_tables._TABLE_NAMES}
    monkeypatch.setattr(flight.dynamics.envelope_tables, "compute_tables", lambda *_: tables)
    file.write_bytes(b"\xff\xfe\x00")
    _assert_equal(envelope, load_envelope(AEROSONDE))
    assert file.read_text() == sound


def test_unwritable_cache_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    envelope = load_envelope(AEROSONDE)
    tables = {name: getattr(envelope, name) for name in flight.dynamics.envelope_tables._TABLE_NAMES}
    # A folder below a file can be neither made nor read, whoever runs the test.
    monkeypatch.setattr(flight.dynamics.envelope_tables, "user_cache_dir", lambda name: str(tmp_path / "file" / name))
    monkeypatch.setattr(flight.dynamics.envelope_tables, "compute_tables", lambda *_: tables)
    _assert_equal(envelope, load_envelope(AEROSONDE))


def level_trim(airspeed: float) -> Trim:
    return Trim(airspeed, 0.0, *(0.0,) * 6, throttle=0.5)


@pytest.mark.parametrize("missed", [level_trim(12.0), None])
def test_a_search_that_misses_the_range_of_level_flight_starts_again_inside_it(
    missed: Trim | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search for the fastest flight that ends at 12 m/s, or nowhere, although the grid has level flight at 28 m/s."""
    for name, first, again in (
        ("fastest_level_flight", missed, level_trim(34.0)),
        ("slowest_level_flight", None, level_trim(9.0)),
    ):
        found = {False: first, True: again}
        monkeypatch.setattr(
            flight.dynamics.envelope_tables, name, lambda _fdm, _amsl, near=None, found=found: found[near is not None]
        )
    assert _level_speed_range(Fdm(AEROSONDE), 0.0, [level_trim(28.0), level_trim(12.0)]) == (9.0, 34.0)


def test_without_a_search_that_succeeds_the_grid_states_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("fastest_level_flight", "slowest_level_flight"):
        monkeypatch.setattr(flight.dynamics.envelope_tables, name, lambda *_: None)
    assert _level_speed_range(Fdm(AEROSONDE), 0.0, [level_trim(28.0), level_trim(12.0)]) == (12.0, 28.0)
    assert all(math.isnan(speed) for speed in _level_speed_range(Fdm(AEROSONDE), 0.0, []))


@pytest.mark.parametrize("name", ["elevator", "throttle"])
def test_a_command_that_moves_nothing_is_the_stated_reason(name: str, tmp_path: Path) -> None:
    aircraft = read_aircraft(Path(shutil.copytree(AEROSONDE.folder, tmp_path / "aerosonde")))
    command = {"elevator": "command/elevator-rad", "throttle": "command/throttle-norm"}[name]
    text = aircraft.model_file.read_text()
    assert text.count(f"<input> {command} </input>") == 1
    aircraft.model_file.write_text(text.replace(f"<input> {command} </input>", "<input> command/rudder-rad </input>"))
    with pytest.raises(FlightError, match=f"the {name} command {command} has no effect: it changes no") as caught:
        compute_tables(aircraft, False)
    assert str(caught.value).startswith(f"{aircraft.model_file}: ")


@pytest.mark.parametrize(("source", "expected"), [("a data sheet", 16.0), ("flight logs", 15.904)])
def test_the_stated_stall_speed_of_a_data_sheet_is_the_slowest_level_flight(
    source: str, expected: float, computed: dict[bool, Envelope], monkeypatch: pytest.MonkeyPatch
) -> None:
    """16 m/s EAS at 2000 m, where the standard atmosphere has 0.8217 of the density at sea level, are 17.65 m/s."""
    monkeypatch.setattr(flight.dynamics.envelope_tables, "read_uncertainty", lambda _: Uncertainty(source, 0.05, 0.05))
    found = load_envelope(replace(AEROSONDE, stall_speed=16.0))
    assert found.level_speeds(0.0)[0] == pytest.approx(expected, abs=1e-3)
    assert found.level_speeds(2000.0)[0] == pytest.approx(expected / math.sqrt(0.8217), rel=2e-3)
    assert found.level_speeds(0.0)[1] == computed[False].level_speeds(0.0)[1]
