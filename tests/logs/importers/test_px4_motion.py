"""PX4's log of a flight says of the motion what ArduPilot's says, and what it lacks is refused by name."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from aircraft.identification.estimate import estimate_clocks, fit_parameters, make_aligned_signals
from logs.importers.motion import MotionLog
from logs.importers.motion_log import read_motion
from logs.importers.open_log import open_log
from planfly.identification.records import flight_records
from tests.aircraft.identification.flown_truth import flown_truth
from tests.instrumented_flights import PX4_PARAMETERS, px4_topics, short_motion, write_px4
from tests.planfly.identification.test_records import PRIOR
from world.errors import LogError


def short(tmp_path: Path, parameters: Mapping[str, float] = {}, without: tuple[str, ...] = ()) -> MotionLog:
    topics = {name: table for name, table in px4_topics(short_motion()).items() if name not in without}
    return read_motion(write_px4(tmp_path / "a.ulg", topics, {**PX4_PARAMETERS, **parameters}))


@cache
def whole() -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    return px4_topics(flown_truth().log)


def test_series_are_those_that_were_written(tmp_path: Path) -> None:
    read, written = short(tmp_path), short_motion()
    assert (read.vehicle, read.program, read.program_kind) == ("plane", "PX4", "px4")
    for name in ("inertial", "velocity", "height", "battery"):
        found, expected = getattr(read, name), getattr(written, name)
        assert found.time == pytest.approx(expected.time)
        assert found.values == pytest.approx(expected.values)
    _, pitch, yaw = written.attitude.values.T
    assert np.sin(read.attitude.values[:, 1]) == pytest.approx(np.sin(pitch))
    # Angles of random size, the same turn: the nose points the same way.
    nose = np.cos(read.attitude.values[:, 1]) * np.cos(read.attitude.values[:, 2])
    assert nose == pytest.approx(np.cos(pitch) * np.cos(yaw))
    assert read.parameters == {"AIRSPEED_MIN": 18.0, "AIRSPEED_CRUISE": 25.0, "AIRSPEED_MAX": 31.0}
    assert read.home == pytest.approx((36.2578, -84.1401, 335.0))


def test_surfaces_are_mixed_by_the_airframes_torques(tmp_path: Path) -> None:
    """By hand: 1500 us is the middle, and 400 us the whole travel; the elevator's trim of -0.05 is taken off."""
    pulses = short_motion().outputs.values
    shares = short(tmp_path).controls.values
    assert shares[:, 1] == pytest.approx((pulses[:, 0] - 1500.0) / 400.0)
    assert shares[:, 0] == pytest.approx((pulses[:, 1] - 1500.0) / 400.0 + 8.4 / 30.0, abs=1e-6)
    assert shares[:, 2] == pytest.approx((pulses[:, 3] - 1500.0) / 400.0)
    throttle = (pulses[:, 2] - 1000.0) / 1000.0
    assert shares[:, 3] == pytest.approx(np.where(throttle < 0.02, 0.0, throttle))


def changed(
    tmp_path: Path,
    topics: Mapping[str, tuple[np.ndarray, dict[str, np.ndarray]]],
    parameters: Mapping[str, float] = {},
    changes: Mapping[str, float] = {},
) -> MotionLog:
    return read_motion(write_px4(tmp_path / "a.ulg", topics, {**PX4_PARAMETERS, **parameters}, changes))


def with_motors(*columns: tuple[int, float]) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Topics in which these motors run at these shares, and no other has a number."""
    topics = px4_topics(short_motion())
    motors = topics["actuator_motors"][1]["control"]
    motors[:] = np.nan
    for number, share in columns:
        motors[:, number] = share
    return topics


def test_a_stopped_motor_has_no_throttle(tmp_path: Path) -> None:
    """PX4 has no number for a motor that it stops: an idle glide is not flown with the throttle before it."""
    topics = with_motors((0, 0.6))
    motors = topics["actuator_motors"][1]["control"]
    half = len(motors) // 2
    motors[half:] = np.nan
    throttle = changed(tmp_path, topics).controls.values[:, 3]
    assert throttle[:half] == pytest.approx(np.full(half, 0.6))
    assert throttle[half:] == pytest.approx(np.zeros(len(motors) - half))
    # One of two stopped: half of both.
    topics = with_motors((0, 0.6))
    assert changed(tmp_path, topics, {"CA_ROTOR_COUNT": 2}).controls.values[:, 3] == pytest.approx(0.3)


def test_what_is_told_to_surfaces_before_arming_is_not_used(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    times, fields = topics["vehicle_status"]
    fields["arming_state"][:2] = 1.0
    read = changed(tmp_path, topics)
    assert read.controls.time[0] == pytest.approx(times[2])
    assert len(read.controls.time) == len(short_motion().outputs.time) - 50


def test_a_vtols_throttle_is_that_of_the_rotors_that_push(tmp_path: Path) -> None:
    """PX4's example: four rotors up, and a fifth ahead; all count."""
    vtol = {"CA_AIRFRAME": 2, "CA_ROTOR_COUNT": 5, "CA_ROTOR4_AX": 1.0, "CA_ROTOR4_AZ": 0.0}
    topics = with_motors((0, 0.2), (1, 0.2), (2, 0.2), (3, 0.2), (4, 0.7))
    assert changed(tmp_path, topics, vtol).controls.values[:, 3] == pytest.approx(0.7)
    with pytest.raises(LogError, match="CA_ROTOR_COUNT 5: no rotor pushes forward") as refused:
        changed(tmp_path, topics, vtol | {"CA_ROTOR4_AX": 0.0, "CA_ROTOR4_AZ": -1.0})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "topic", "title"), [("FLAP", "flaps_setpoint", "flaps"), ("SPOIL", "spoilers_setpoint", "spoilers")]
)
def test_ailerons_that_flaps_move_as_well_are_refused_where_they_do(
    tmp_path: Path, name: str, topic: str, title: str
) -> None:
    topics = px4_topics(short_motion())
    time = topics["vehicle_status"][0]
    topics[topic] = (time, {"normalized_setpoint": np.linspace(0.0, 1.0, len(time))})
    with pytest.raises(LogError) as refused:
        changed(tmp_path, topics, {f"CA_SV_CS1_{name}": 0.5})
    said = f"CA_SV_CS1_{name} 0.5: {title} deflect this surface in flight, which the model does not represent"
    assert str(refused.value).endswith(said)
    # Neither where they stay in, nor where nothing of them reaches a surface.
    changed(tmp_path, topics, {f"CA_SV_CS1_{name}": 0.0})
    topics[topic][1]["normalized_setpoint"][:] = 0.3
    changed(tmp_path, topics, {f"CA_SV_CS1_{name}": 0.5})


def test_airspeed_of_releases_before_1_12_is_read(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    fields = topics["airspeed_validated"][1]
    fields["equivalent_airspeed_m_s"] = fields.pop("calibrated_airspeed_m_s")
    read, written = changed(tmp_path, topics), short_motion().airspeed
    assert read.airspeed.time == pytest.approx(written.time)
    assert read.airspeed.values == pytest.approx(written.values)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["CA_SV_CS0_TYPE", "CA_AIRFRAME", "CA_ROTOR_COUNT", "CA_SV_CS2_TRIM"])
def test_parameters_that_are_no_numbers_are_not_there(tmp_path: Path, name: str, value: float) -> None:
    read = changed(tmp_path, px4_topics(short_motion()), {name: value})
    assert np.isfinite(read.controls.values).all()


def test_a_count_of_surfaces_that_is_no_number_is_none(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no surface controls the elevator"):
        changed(tmp_path, px4_topics(short_motion()), {"CA_SV_CS_COUNT": float("nan")})


def test_parameters_that_change_in_flight_keep_the_last(tmp_path: Path) -> None:
    read = changed(tmp_path, px4_topics(short_motion()), changes={"FW_AIRSPD_MIN": 16.0, "FW_AIRSPD_MAX": float("nan")})
    assert read.parameters["AIRSPEED_MIN"] == 16.0
    assert "AIRSPEED_MAX" not in read.parameters


def with_second_battery(**fields: float) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """The first battery at 22 V and 10 A; the second at 21 V and 4 A, twice as often, and what is said of both."""
    topics = px4_topics(short_motion())
    time = topics["battery_status"][0]
    for name, when, volts, amps in (("", time, 22.0, 10.0), (" 1", np.linspace(time[0], time[-1], 79), 21.0, 4.0)):
        one = np.ones(len(when))
        table = {"voltage_v": volts * one, "current_a": amps * one, "connected": one, "source": 0.0 * one}
        topics["battery_status" + name] = (
            when,
            table | ({key: value * one for key, value in fields.items()} if name else {}),
        )
    return topics


@pytest.mark.parametrize(
    ("second", "volts", "amps"),
    [
        ({}, 21.5, 14.0),
        ({"connected": 0.0}, 22.0, 10.0),
        # Of the motors' controllers: the same current, measured again.
        ({"source": 2.0}, 22.0, 10.0),
    ],
)
def test_currents_of_several_batteries_are_added(
    tmp_path: Path, second: dict[str, float], volts: float, amps: float
) -> None:
    battery = changed(tmp_path, with_second_battery(**second)).battery
    assert len(battery.time) == len(short_motion().battery.time)
    assert battery.values == pytest.approx(np.tile([volts, amps], (len(battery.time), 1)))


def test_a_battery_whose_current_is_not_measured_leaves_the_current_unknown(tmp_path: Path) -> None:
    assert len(changed(tmp_path, with_second_battery(current_a=-1.0)).battery.time) == 0


def test_a_sample_without_current_costs_itself_alone(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    time, table = topics["battery_status"]
    amps = np.full(len(time), 10.0)
    amps[3] = -1.0
    topics["battery_status"] = (time, table | {"current_a": amps})
    battery = changed(tmp_path, topics).battery
    assert battery.values[:, 1].tolist() == [10.0] * (len(time) - 1)


def test_elevons_are_half_their_sum_and_difference(tmp_path: Path) -> None:
    elevons = {
        "CA_SV_CS_COUNT": 2,
        "CA_SV_CS0_TYPE": 5,
        "CA_SV_CS0_TRQ_P": 0.5,
        "CA_SV_CS1_TYPE": 6,
        "CA_SV_CS1_TRQ_P": 0.5,
    }
    read = short(tmp_path, elevons)
    assert read.elevons
    # In the topic the two are -a and a.
    aileron = (short_motion().outputs.values[:, 0] - 1500.0) / 400.0
    assert read.controls.values[:, 1] == pytest.approx(aileron)
    assert read.controls.values[:, 0] == pytest.approx(np.zeros(len(aileron)), abs=1e-9)
    with pytest.raises(LogError, match="flown with elevons, but the base aerosonde has a tail"):
        flight_records(read, PRIOR)


def test_airspeed_that_no_sensor_measured_is_not_used(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    fields = topics["airspeed_validated"][1]
    fields["selected_airspeed_index"][:7] = 0.0
    read = read_motion(write_px4(tmp_path / "a.ulg", topics, PX4_PARAMETERS))
    assert len(read.airspeed.time) == len(short_motion().airspeed.time) - 7


def test_stretches_on_lifting_motors_are_named(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    times, fields = topics["vehicle_status"]
    fields["vehicle_type"][1] = 1.0
    fields["in_transition_mode"][2] = 1.0
    read = read_motion(write_px4(tmp_path / "a.ulg", topics, PX4_PARAMETERS))
    begins = [begin for begin, _ in read.hovering]
    ends = [end for _, end in read.hovering]
    assert begins == pytest.approx(times[1:3])
    assert ends == pytest.approx(times[2:4])


def test_controls_of_releases_before_1_14_are_read(tmp_path: Path) -> None:
    topics = px4_topics(short_motion())
    time, _ = topics.pop("actuator_servos")
    topics["actuator_controls_0"] = (time, {"control": np.tile([0.1, -0.2, 0.3, 0.6, 0, 0, 0, 0], (len(time), 1))})
    shares = read_motion(write_px4(tmp_path / "a.ulg", topics, {})).controls.values
    # Roll, pitch, yaw and throttle there; pitch, roll, yaw, throttle here.
    assert shares[0] == pytest.approx([-0.2, 0.1, 0.3, 0.6])


@pytest.mark.parametrize("topic", ["airspeed_wind", "wind_estimate"])
def test_the_wind_of_releases_before_1_14_is_read(tmp_path: Path, topic: str) -> None:
    topics = px4_topics(short_motion())
    topics[topic] = topics.pop("wind")
    path = write_px4(tmp_path / "a.ulg", topics, PX4_PARAMETERS)
    wind = short_motion().wind
    found = read_motion(path).wind
    assert found.values == pytest.approx(wind.values[:: len(wind.values) // len(found.values)][: len(found.values)])
    # North and east there, east and north in an imported log.
    imported = open_log(path).series["wind"]
    assert (imported.source, imported.values[0].tolist()) == (topic, found.values[0, ::-1].tolist())


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"CA_AIRFRAME": 2, "CA_ROTOR_COUNT": -1}, "CA_ROTOR_COUNT 0: no rotor pushes forward"),
        ({"CA_SV_CS2_TYPE": 7}, "CA_SV_CS2_TYPE 7: a V-tail, whose mix is not modelled"),
        ({"CA_SV_CS3_TYPE": 10}, "CA_SV_CS3_TYPE 10: the flap moves in flight"),
        ({"CA_AIRFRAME": 3}, "CA_AIRFRAME 3: a tiltrotor; expected a plane"),
        ({"CA_SV_CS_COUNT": 2}, "no surface controls the elevator"),
    ],
)
def test_mixes_that_are_not_modelled_are_named(tmp_path: Path, parameters: dict[str, float], said: str) -> None:
    with pytest.raises(LogError) as refused:
        short(tmp_path, parameters)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("without", "said"),
    [
        (("sensor_combined",), "no sensor_combined, the inertial sensors: SDLOG_PROFILE 17"),
        (("actuator_servos",), "no actuator_servos and actuator_motors, nor actuator_controls_0"),
        (("vehicle_attitude",), "no vehicle_attitude, the attitude"),
        (("vehicle_local_position",), "no vehicle_local_position, the velocity"),
        (("vehicle_global_position",), "no vehicle_global_position, the height"),
        (("airspeed_validated", "wind"), "no airspeed_validated from a sensor in use, the airspeed; no wind, the wind"),
    ],
)
def test_what_a_log_lacks_is_named(tmp_path: Path, without: tuple[str, ...], said: str) -> None:
    with pytest.raises(LogError) as refused:
        flight_records(short(tmp_path, without=without), PRIOR)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_same_flight_gives_the_same_aircraft(tmp_path: Path) -> None:
    flown = flown_truth()
    records = flight_records(read_motion(write_px4(tmp_path / "a.ulg", whole(), PX4_PARAMETERS)), PRIOR)
    assert [record.seconds for record in records] == pytest.approx(
        [record.seconds for record in flown.records], abs=1.0
    )
    # PX4 logs its servo outputs at 25 Hz, with another delay than ArduPlane.
    found, expected = (
        fit_parameters(make_aligned_signals(each, clocks, flown.base), flown.base)
        for each, clocks in ((records, estimate_clocks(records, flown.base)), (flown.records, flown.estimate.clocks))
    )
    assert found.with_current
    off = np.abs(found.values - expected.values) / flown.estimate.sds
    # Of pulses at 25 Hz on a grid of 50 Hz, one may fall a row later.
    assert off.max() < 0.8
