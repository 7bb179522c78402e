"""What of a log is used, and what is refused by name, in one line each."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly
from aircraft.catalog import load_aircraft
from logs.importers.motion import MotionLog, Samples
from planfly.identification.records import flight_records, log_outputs
from planfly.identification.servos import read_servos
from tests.aircraft.identification.flown_truth import flown_truth
from tests.instrumented_flights import PARAMETERS
from world.errors import LogError

NONE = Samples(np.zeros(0), np.zeros((0, 1)))
PRIOR = load_aircraft("aerosonde")


def changed(parameters: Mapping[str, float] = {}, **fields: Any) -> MotionLog:
    return replace(flown_truth().log, parameters=PARAMETERS | dict(parameters), **fields)


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (
            lambda: changed(inertial=NONE),
            "no IMU, the inertial sensors: LOG_BITMASK 65535 records them (the log has 65535)",
        ),
        (lambda: changed(outputs=NONE), "no RCOU, the servo outputs: LOG_BITMASK 65535"),
        (lambda: changed(attitude=NONE), "no ATT"),
        (lambda: changed(airspeed=NONE), "no ARSP of a sensor in use (U = 1), the airspeed"),
        (lambda: changed(wind=NONE), "no XKF2, the wind"),
        (lambda: changed(airspeed=NONE, wind=NONE), "U = 1), the airspeed; no XKF2, the wind"),
        (
            lambda: changed(airspeed=Samples(flown_truth().log.airspeed.time, 0.0 * flown_truth().log.airspeed.values)),
            "the airspeed stays at 0 m/s: expected a sensor's airspeed",
        ),
        (lambda: changed(vehicle="copter", program="ArduCopter V4.5.7"), "flown by a copter (ArduCopter V4.5.7)"),
        (lambda: changed(vehicle="rover", program="ArduRover V4.5.7"), "flown by a rover"),
        (lambda: changed({"SERVO1_FUNCTION": 24.0}), "output 1 (SERVO1_FUNCTION 24, flaperon) moves"),
        (lambda: changed({"SERVO2_FUNCTION": 79.0}), "V-tail"),
        (lambda: changed({"SERVO1_FUNCTION": 77.0, "SERVO2_FUNCTION": 78.0}), "but the base aerosonde has a tail"),
        (lambda: changed({"SERVO2_FUNCTION": 0.0}), "no output has the SERVOn_FUNCTION of the elevator"),
        (lambda: changed(modes=((0.0, 10), (120.0, 19))), "flight on lifting motors is not used"),
    ],
)
def test_refusals_are_one_line_each(log: Any, said: str) -> None:
    with pytest.raises(LogError) as refused:
        flight_records(log(), PRIOR)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("v3-3.BIN: ")


def test_stretches_of_a_quadplane_are_cut_and_the_rest_is_used() -> None:
    log = changed(modes=((0.0, 10), (100.0, 19), (140.0, 10)))
    before, after = flight_records(log, PRIOR)
    assert before.time[-1] < 100.0
    assert after.time[0] > 140.0


def test_a_pause_of_the_sensors_parts_two_stretches() -> None:
    log = flown_truth().log
    keep = (log.inertial.time < 150.0) | (log.inertial.time > 153.0)
    parts = flight_records(replace(log, inertial=Samples(log.inertial.time[keep], log.inertial.values[keep])), PRIOR)
    assert [part.time[0] > 150.0 for part in parts] == [False, True]


@pytest.mark.parametrize("name", ["airspeed", "wind"])
def test_air_that_was_not_measured_is_not_used(name: str) -> None:
    """A sensor out of use for two seconds parts two stretches, and one that fails for good ends the last."""
    log = changed()
    air = getattr(log, name)
    keep = ((air.time < 150.0) | (air.time > 152.0)) & (air.time < 330.0)
    parts = flight_records(replace(log, **{name: Samples(air.time[keep], air.values[keep])}), PRIOR)
    assert [part.time[0] > 150.0 for part in parts] == [False, True]
    assert parts[0].time[-1] <= 150.0
    assert parts[-1].time[-1] <= 330.0 < log.inertial.time[-1]


def test_a_blocked_airspeed_sensor_is_not_used() -> None:
    """A blocked tube gives a steady airspeed with noise, while the velocity through the air varies by 2 m/s."""
    log = changed()
    flight = log.airspeed.time[-1] - log.airspeed.time[0]
    time = log.velocity.time
    # Airspeed and ground velocity vary alike along the heading, with a period of 8 s.
    yaw = np.interp(time, log.attitude.time, np.unwrap(log.attitude.values[:, 2]))
    surge = 2.0 * np.sin(2.0 * np.pi * time / 8.0)
    velocity = log.velocity.values + np.column_stack([surge * np.cos(yaw), surge * np.sin(yaw), 0.0 * surge])
    moving = replace(log, velocity=Samples(time, velocity))

    def blocked(begin: float, end: float) -> MotionLog:
        values, rows = log.airspeed.values.copy(), (log.airspeed.time > begin) & (log.airspeed.time < end)
        values[rows, 0] = 25.0 + np.random.default_rng(0).normal(0.0, 0.01, rows.sum())
        return replace(moving, airspeed=Samples(log.airspeed.time, values))

    assert flight > 300.0
    assert len(flight_records(moving, PRIOR)) == 1
    before, after = flight_records(blocked(150.0, 190.0), PRIOR)
    assert 149.0 < before.time[-1] < 152.0
    assert 188.0 < after.time[0] < 191.0
    with pytest.raises(LogError, match=r"airspeed: hardly varies for 1\d\d s of \d+ s of flight: the ground velocity"):
        flight_records(blocked(100.0, 280.0), PRIOR)


def test_only_the_missing_columns_are_named() -> None:
    log = changed(outputs=NONE, program_kind="columns", missing={"inertial": (), "outputs": ("throttle",)})
    with pytest.raises(LogError, match=r"^v3-3.BIN: no throttle: expected in \[columns\] of its table$"):
        flight_records(log, PRIOR)


def test_outputs_are_read_off_the_logs_parameters() -> None:
    """Full travel is the model's largest deflection; more microseconds are nose up, a trailing edge up."""
    found = log_outputs(changed({"SERVO1_REVERSED": 1.0, "SERVO2_TRIM": 1450.0}), PRIOR)
    pulses = np.array([1100.0, 1450.0, 1500.0, 1900.0])
    assert np.degrees(found["aileron"].control(pulses)[[0, 3]]) == pytest.approx([30.0, -30.0])
    assert np.degrees(found["elevator"].control(pulses)[[0, 1, 3]]) == pytest.approx([30.0, 0.0, -30.0])
    assert found["throttle"].control(np.array([1000.0, 1770.0])) == pytest.approx([0.0, 0.77])


def test_a_surface_that_is_told_to_go_beyond_its_stop_stays_there() -> None:
    """As the Aerosonde is rigged, 1900 us are 38.4 degrees of elevator, trailing edge up; its stop is at 30."""
    log = changed()
    pulses = log.outputs.values.copy()
    pulses[:, :2] = [1900.0, 1900.0]
    told = replace(log, outputs=Samples(log.outputs.time, pulses))
    (record,) = flight_records(told, PRIOR, read_servos(PRIOR.folder / "ardupilot.toml"))
    assert np.degrees(record.controls[100, :2]) == pytest.approx([-30.0, 30.0])
    pulses[:, 1] = 1700.0
    (record,) = flight_records(told, PRIOR, read_servos(PRIOR.folder / "ardupilot.toml"))
    assert np.degrees(record.controls[100, 0]) == pytest.approx(-23.4)


def test_elevons_are_half_their_sum_and_difference(tmp_path: Path) -> None:
    """ArduPlane's left elevon is elevator less aileron, its right one their sum: nose up, and roll to the right."""
    wing = planfly.new_aircraft(tmp_path / "foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
    log = changed({"SERVO1_FUNCTION": 77.0, "SERVO2_FUNCTION": 78.0, "SERVO2_REVERSED": 1.0})
    up, roll = 0.3, 0.2
    pulses = log.outputs.values.copy()
    pulses[:, 0], pulses[:, 1] = 1500.0 + 400.0 * (up - roll), 1500.0 - 400.0 * (up + roll)
    (record,) = flight_records(replace(log, outputs=Samples(log.outputs.time, pulses)), wing)
    elevator, aileron = record.controls[100, :2]
    # The model's elevator is positive with the trailing edge down, its aileron with a roll to the right.
    assert (elevator, aileron) == pytest.approx((-up * wing.max_elevator, roll * wing.max_elevator))


def test_one_elevon_alone_is_refused(tmp_path: Path) -> None:
    wing = planfly.new_aircraft(tmp_path / "foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
    with pytest.raises(LogError, match="only one elevon; expected SERVOn_FUNCTION 77 and 78"):
        flight_records(changed({"SERVO1_FUNCTION": 77.0}), wing)


def test_a_log_without_modes_is_flown_on_the_wing() -> None:
    assert len(flight_records(changed(modes=()), PRIOR)) == 1
