"""A telemetry log says of the motion what was sent, at the times at which it was made."""

import struct
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from aircraft.catalog import find_aircraft
from logs.importers.motion import MotionLog
from logs.importers.motion_log import read_motion
from logs.importers.open_log import open_log
from planfly.identification.records import flight_records, log_outputs
from tests.instrumented_flights import PARAMETERS
from world.errors import LogError

HERTZ = 10.0
SECONDS = 240.0
BOOT_S = 4200.0
SPEED = 24.0
PARAMETERS_SENT = {name: value for name, value in PARAMETERS.items() if name.startswith(("SERVO", "AIRSPEED"))}


class Sink:
    """Packets with the time of their reception, 0.25 s late."""

    def __init__(self) -> None:
        self.data, self.now = bytearray(), 0.0

    def write(self, packet: bytes) -> None:
        self.data += struct.pack(">Q", round((1.7e9 + self.now + 0.25) * 1e6)) + packet


def write(
    path: Path, *, autopilot: int = 3, without: tuple[str, ...] = (), currents: tuple[int, ...] = (1250,)
) -> Path:
    """Write a level flight to the north-east; micros() of 32 bits starts again within it, at 4294.97 s."""
    sink = Sink()
    vehicle = dialect.MAVLink(sink, 1, 1)
    for name, value in PARAMETERS_SENT.items():
        vehicle.param_value_send(name.encode(), value, 9, len(PARAMETERS_SENT), 0)
    for k in range(round(SECONDS * HERTZ)):
        sink.now = BOOT_S + k / HERTZ
        millis, micros = round(sink.now * 1e3), round(sink.now * 1e6)
        north = SPEED * np.sqrt(0.5) * k / HERTZ
        place = round((46.0 + north / 111_195.0) * 1e7), round((8.0 + north / 77_000.0) * 1e7)
        vehicle.global_position_int_send(millis, *place, 500_000, 100_000, 1697, 1697, -50, 4500)
        vehicle.attitude_send(millis, 0.1, 0.05, 0.7854, 0.0, 0.0, 0.0)
        if "RAW_IMU" not in without:
            vehicle.raw_imu_send(micros, 50, -20, -1000, 10, -20, 30, 0, 0, 0)
        pulses = [1500 + k % 100, 1400, 1600, 1500, 0, 0, 0, 0]
        vehicle.servo_output_raw_send(micros % 2**32, 0, *pulses)
        vehicle.servo_output_raw_send(micros % 2**32, 1, *[1000] * 8)
        if "VFR_HUD" not in without:
            vehicle.vfr_hud_send(22.0 + 1e-4 * (k % 2), SPEED, 45, 60, 500.0, 0.5)
        if k % 10 == 0:
            vehicle.heartbeat_send(1, autopilot, 81, 10, 4)
            current = currents[k // 10 % len(currents)]
            vehicle.sys_status_send(0, 0, 0, 0, 24_000, current, 80, 0, 0, 0, 0, 0, 0)
            if "WIND" not in without:
                vehicle.wind_send(270.0, 3.0, 0.0)
    path.write_bytes(bytes(sink.data))
    return path


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> MotionLog:
    return read_motion(write(tmp_path_factory.mktemp("tlog") / "a.tlog"))


def test_each_message_arrives_in_si_units(motion: MotionLog) -> None:
    assert motion.inertial.values[0] == pytest.approx([0.4903, -0.1961, -9.80665, 0.01, -0.02, 0.03], abs=1e-4)
    assert motion.velocity.values[0] == pytest.approx([16.97, 16.97, -0.5])
    assert motion.airspeed.values[0] == pytest.approx([22.0])
    assert motion.height.values[0] == pytest.approx([500.0])
    # From the west at 3 m/s: the air moves to the east.
    assert motion.wind.values[0] == pytest.approx([0.0, 3.0], abs=1e-9)
    assert motion.battery.values[0] == pytest.approx([24.0, 12.5])
    assert motion.outputs.values[7, :4].tolist() == [1507.0, 1400.0, 1600.0, 1500.0]
    assert motion.modes[0] == (pytest.approx(BOOT_S, abs=0.2), 10)


@pytest.mark.parametrize(
    ("currents", "rows", "amps"),
    [
        # MAVLink: -1 is a current that the autopilot did not measure.
        ((1250, 1250, -1), 160, {12.5}),
        # An offset of the sensor is a measurement.
        ((1250, -5), 240, {12.5, -0.05}),
        ((-1,), 0, set()),
    ],
)
def test_a_current_that_is_not_measured_costs_its_own_sample_alone(
    tmp_path: Path, currents: tuple[int, ...], rows: int, amps: set[float]
) -> None:
    path = write(tmp_path / "a.tlog", currents=currents)
    battery = read_motion(path).battery
    assert len(battery.time) == rows
    if rows:
        assert set(battery.values[:, 1].round(3).tolist()) == amps
        # 24 V times the mean current for 239 s; the sample after a missing one counts for both seconds.
        mean = 12.5 if -1 in currents else 6.25
        energy = open_log(path).series["battery"].values[-1, 1]
        assert energy == pytest.approx(24.0 * mean * 239.0 / 3600.0, rel=0.02)
    else:
        assert "battery" not in open_log(path).series


def test_rows_have_the_times_at_which_they_were_made(motion: MotionLog) -> None:
    expected = BOOT_S + np.arange(round(SECONDS * HERTZ)) / HERTZ
    assert motion.inertial.time == pytest.approx(expected, abs=1e-3)
    assert motion.outputs.time == pytest.approx(expected, abs=1e-3)
    assert motion.attitude.time == pytest.approx(expected, abs=1e-3)


def test_an_identification_takes_the_outputs_by_their_functions(motion: MotionLog) -> None:
    prior = find_aircraft("aerosonde")
    records = flight_records(motion, prior)
    assert sum(record.seconds for record in records) == pytest.approx(SECONDS - 15.0, abs=2.0)
    outputs = log_outputs(motion, prior)
    elevator = outputs["elevator"].control(np.array([1400.0]))[0]
    assert records[0].controls[0, 0] == pytest.approx(elevator)


def test_a_log_without_wind_gets_it_from_the_triangle_of_velocities(tmp_path: Path) -> None:
    wind = read_motion(write(tmp_path / "a.tlog", without=("WIND",))).wind
    # 22 m/s of equivalent airspeed are 22.54 m/s at 500 m, less 0.5 m/s of climb; 24.0 m/s over ground.
    level = np.sqrt((22.0 / np.sqrt(0.9529)) ** 2 - 0.25)
    assert wind.values[50] == pytest.approx([16.97 - level * np.sqrt(0.5)] * 2, abs=0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"without": ("RAW_IMU",)}, "no RAW_IMU, the inertial sensors: SRn_RAW_SENS 25, .* send them"),
        ({"without": ("VFR_HUD", "WIND")}, "no VFR_HUD with the airspeed of a sensor"),
        ({"autopilot": 12}, "telemetry of PX4 does not state what its outputs move"),
    ],
)
def test_what_a_log_lacks_is_named(tmp_path: Path, options: dict[str, object], said: str) -> None:
    with pytest.raises(LogError, match=said) as refused:
        flight_records(read_motion(write(tmp_path / "a.tlog", **options)), find_aircraft("aerosonde"))  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
