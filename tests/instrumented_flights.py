"""Flights of aircraft of known truth as their autopilot's sensors would have logged them, for identification.

An Aerosonde is changed by numbers edited in its model (nothing of what writes an identified model is used), flown by
ArduPlane's law in planfly's own simulation, and seen by sensors: accelerometers behind by a lag and a delay and with a
bias, gyros behind by a delay, attitude a little off, airspeed with a wrong scale and noise, servo outputs in whole
microseconds at 25 Hz.  All of it comes from a seed.
"""

import math
import re
import shutil
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import savgol_filter

import planfly
from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission_files.formats import waypoints_text
from flight.simulation.track import Track
from logs.importers.motion import MotionLog, Samples
from planfly.identification.manoeuvres import make_identification_mission
from tests.logs.importers.written_logs import DataflashWriter
from world.arrays import Floats

HOME = (36.2578, -84.1401, 335.0)


@dataclass(frozen=True, slots=True)
class Truth:
    """How an aircraft differs from the Aerosonde: factors, but for the two offsets.

    roll_inertia, pitch_inertia, yaw_inertia: over those of the Aerosonde scaled by mass.
    """

    mass: float = 1.0
    lift_slope: float = 1.0
    lift_offset: float = 0.0
    zero_lift_drag: float = 1.0
    induced_drag: float = 1.0
    thrust: float = 1.0
    motor_speed: float = 1.0
    propeller_torque: float = 1.0
    pitch_offset: float = 0.0
    pitch_stiffness: float = 1.0
    pitch_damping: float = 1.0
    elevator_power: float = 1.0
    dihedral_effect: float = 1.0
    roll_damping: float = 1.0
    roll_from_yaw: float = 1.0
    aileron_power: float = 1.0
    weathercock: float = 1.0
    yaw_from_roll: float = 1.0
    yaw_damping: float = 1.0
    adverse_yaw: float = 1.0
    rudder_power: float = 1.0
    roll_inertia: float = 1.0
    pitch_inertia: float = 1.0
    yaw_inertia: float = 1.0
    side_force: float = 1.0
    lift_of_rate: float = 1.0
    lift_of_elevator: float = 1.0

    def parameters(self) -> dict[str, float]:
        """The true value of each parameter of an identification: moments over their moment of inertia."""
        over = {
            "pitch": self.pitch_inertia,
            "roll": self.roll_inertia,
            "yaw": self.yaw_inertia,
        }
        return {
            "lift-slope": self.lift_slope,
            "lift-offset": self.lift_offset,
            "zero-lift-drag": self.zero_lift_drag,
            "induced-drag": self.induced_drag,
            "thrust": self.thrust,
            "motor-speed": self.motor_speed,
            "propeller-torque": self.propeller_torque,
            # The base's own moment at zero counts over the inertia as well.
            "pitch-offset": (0.0135 + self.pitch_offset) / over["pitch"] - 0.0135,
            "pitch-stiffness": self.pitch_stiffness / over["pitch"],
            "pitch-damping": self.pitch_damping / over["pitch"],
            "elevator-power": self.elevator_power / over["pitch"],
            "dihedral-effect": self.dihedral_effect / over["roll"],
            "roll-damping": self.roll_damping / over["roll"],
            "roll-from-yaw": self.roll_from_yaw / over["roll"],
            "aileron-power": self.aileron_power / over["roll"],
            "weathercock": self.weathercock / over["yaw"],
            "yaw-from-roll": self.yaw_from_roll / over["yaw"],
            "yaw-damping": self.yaw_damping / over["yaw"],
            "adverse-yaw": self.adverse_yaw / over["yaw"],
            "rudder-power": self.rudder_power / over["yaw"],
        }


# Of Truth's fields: a number of the model's text and what is beside it.
_NUMBERS = {
    "dihedral_effect": r"<v> (-0\.13) </v> <p> aero/beta-rad",
    "roll_damping": r"<v> (-0\.51) </v>",
    "roll_from_yaw": r"<v> (0\.25) </v>",
    "aileron_power": r"<v> (0\.17) </v>",
    "pitch_stiffness": r"<v> (-2\.74) </v>",
    "pitch_damping": r"<v> (-38\.21) </v>",
    "elevator_power": r"<v> (-0\.99) </v>",
    "weathercock": r"<v> (0\.073) </v>",
    "yaw_from_roll": r"<v> (0\.069) </v> <p> velocities/p",
    "yaw_damping": r"<v> (-0\.095) </v>",
    "adverse_yaw": r"<v> (-0\.011) </v>",
    "rudder_power": r"<v> (-0\.069) </v> <p> surface/rudder",
    "side_force": r"<v> (-0\.98) </v>",
    "lift_of_rate": r"<v> (7\.95) </v>",
    "lift_of_elevator": r"<v> (0\.13) </v> <p> surface/elevator",
    "zero_lift_drag": r'<property value="(0\.043)"> aero/parasite-drag',
    "induced_drag": r"<v> (0\.02320027706739877) </v>",
}


def changed_aerosonde(folder: Path, truth: Truth) -> Aircraft:
    """An aircraft of this truth in a folder, which must not exist."""
    shutil.copytree(load_aircraft("aerosonde").folder, folder, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    name = folder.name
    for file in folder.glob("aerosonde.*"):
        file.rename(file.with_stem(name))
    model = folder / f"{name}.xml"
    text = model.read_text(encoding="utf-8")
    for field, pattern in _NUMBERS.items():
        text = _scaled(text, pattern, getattr(truth, field))
    text = _scaled(text, r"<v> (0\.0135) </v>\s*<product> <v> -?\d", 1.0 + truth.pitch_offset / 0.0135)
    # Lift: a straight line in place of the book's curve, up to where it would bend.
    slope, zero = 5.61 * truth.lift_slope, 0.23 + truth.lift_offset
    text = text.replace(
        "<sum> <v> 0.23 </v> <product> <v> 5.61 </v>", f"<sum> <v> {zero:.9g} </v> <product> <v> {slope:.9g} </v>"
    )
    rows = "".join(f"  {x:.2f}  {zero + slope * x:.6f}\n" for x in np.arange(-0.3, 0.301, 0.1))
    text = re.sub(
        r"(<tableData>\n).*?(\s*</tableData>)", lambda found: found[1] + rows + found[2], text, count=1, flags=re.DOTALL
    )
    for number in ("0.0001578453316288675", "-0.001261059923893397", "-0.0278451056"):
        text = _scaled(text, rf"<v> ({re.escape(number)}) </v>", truth.thrust)
    for number in ("4.481882984769055e-06", "5.267825369703993e-05", "-0.0021814459596799997"):
        text = _scaled(text, rf"<v> ({re.escape(number)}) </v>", truth.propeller_torque)
    speed = 1.0 / truth.motor_speed
    text = _scaled(text, r"<v> (0\.10326602715373306) </v>", speed * speed)
    for number in ("0.09878582674669366", "-1.5680289959792644", "0.0658572178311291"):
        text = _scaled(text, rf"<v> ({re.escape(number)}) </v>", speed)
    for axes, factor in (
        ("xx", truth.roll_inertia),
        ("yy", truth.pitch_inertia),
        ("zz", truth.yaw_inertia),
        ("xz", 1.0),
    ):
        text = _scaled(text, rf'<i{axes} unit="SLUG\*FT2"> ([\d.]+)', factor * truth.mass)
    text = _scaled(text, r'<emptywt unit="LBS"> ([\d.]+)', truth.mass)
    model.write_text(text, encoding="utf-8")
    table = folder / f"{name}.toml"
    table.write_text(_scaled(table.read_text(encoding="utf-8"), r"mass_kg = ([\d.]+)", truth.mass), encoding="utf-8")
    return read_aircraft(folder)


def _scaled(text: str, pattern: str, factor: float) -> str:
    """Text with every number that a pattern's group finds multiplied."""
    assert re.search(pattern, text), pattern
    return re.sub(pattern, lambda found: found[0].replace(found[1], f"{float(found[1]) * factor:.12g}", 1), text)


# ----------------------------------------------------------------------
# Sensors.


@dataclass(frozen=True, slots=True)
class Sensors:
    """What is between a motion and its log; angles rad, the rest SI.

    lag, delay: of the accelerometers behind the gyros, s.  gyro_delay: of the gyros, s.
    bias: (3,) of the accelerometers.  level: of the autopilot's pitch.  airspeed: its factor.
    noise: of accelerometers, gyros, airspeed and velocity.  battery: whether current and voltage are logged.
    """

    lag: float = 0.04
    delay: float = 0.02
    gyro_delay: float = 0.01
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    level: float = 0.0
    airspeed: float = 1.0
    noise: tuple[float, float, float, float] = (0.05, 0.002, 0.08, 0.05)
    battery: bool = False


def drawn_sensors(seed: int, *, battery: bool = False) -> Sensors:
    """Sensors as they come, by a seed: their errors within the standard deviations that identification allows for."""
    draw = np.random.default_rng([seed, 5])
    level = float(draw.normal(0.0, math.radians(0.15)))
    # The autopilot's estimator takes a bias ahead for a tilt: the two go together, but for what it finds itself.
    ahead = float(draw.normal(0.0, 0.01)) + 0.5 * level * 9.81
    return Sensors(
        lag=float(draw.uniform(0.02, 0.07)),
        delay=float(draw.uniform(0.0, 0.04)),
        gyro_delay=float(draw.uniform(0.0, 0.02)),
        bias=(ahead, float(draw.normal(0.0, 0.02)), float(draw.normal(0.0, 0.03))),
        level=level,
        airspeed=1.0 + float(draw.normal(0.0, 0.007)),
        battery=battery,
    )


def sensed(track: Track, aircraft: Aircraft, sensors: Sensors, seed: int) -> MotionLog:
    """The log of a flight's motion, at the rates of ArduPlane's default LOG_BITMASK."""
    draw = np.random.default_rng([seed, 9])
    hertz = 60.0
    time = track.time + 20.0
    roll, pitch, yaw = np.unwrap(track.attitude.astype(np.float64), axis=0).T
    velocity = track.velocity.astype(np.float64)
    change = savgol_filter(velocity, 9, 3, deriv=1, delta=1.0 / hertz, axis=0)
    latitude = math.radians(HOME[0])
    gravity = (
        9.780325 * (1.0 + 0.00193185 * math.sin(latitude) ** 2) / math.sqrt(1.0 - 0.00669438 * math.sin(latitude) ** 2)
    )
    # North, east, down.
    force = np.column_stack([change[:, 1], change[:, 0], -change[:, 2] - gravity + 3.086e-6 * track.position[:, 2]])
    body = _to_body(force, roll, pitch, yaw)
    accelerometers = _late(body, time, sensors.delay + sensors.gyro_delay, sensors.lag) + np.array(sensors.bias)
    gyros = _late(track.rates.astype(np.float64), time, sensors.gyro_delay, 0.0)
    fast, medium, slow = (np.arange(time[0], time[-1], 1.0 / rate) for rate in (50.0, 25.0, 10.0))

    def at(values: Floats, grid: Floats, noise: float = 0.0) -> Samples:
        table = np.column_stack([np.interp(grid, time, column) for column in np.atleast_2d(values.T)])
        return Samples(grid, table + noise * draw.standard_normal(table.shape))

    inertial = np.column_stack([accelerometers, gyros])
    noise = np.array([sensors.noise[0]] * 3 + [sensors.noise[1]] * 3)
    imu = at(inertial, fast)
    imu = Samples(imu.time, imu.values + noise * draw.standard_normal(imu.values.shape))
    height = track.position[:, 2]
    ratio = (1.0 - 2.25577e-5 * height) ** -2.12794
    wind = np.column_stack([gaussian_filter1d(track.wind[:, k].astype(np.float64), 10.0 * hertz) for k in (1, 0)])
    shown = np.column_stack([roll, pitch + sensors.level, yaw])
    volts = aircraft.battery_voltage
    rows = np.searchsorted(time, medium)
    pulses = np.round(_pulses(track.commands[rows].astype(np.float64)))
    outputs = np.zeros((len(medium), 14))
    outputs[:, :4] = pulses
    equivalent = track.airspeed.astype(np.float64) / ratio * sensors.airspeed
    battery = at(np.column_stack([np.full(len(time), volts), track.current]), slow)
    return MotionLog(
        source=f"{aircraft.name}-{seed}.BIN",
        sha256="0" * 64,
        program="ArduPlane V4.6.0",
        vehicle="plane",
        inertial=imu,
        outputs=Samples(medium, outputs),
        attitude=at(shown, medium),
        velocity=at(np.column_stack([velocity[:, 1], velocity[:, 0], -velocity[:, 2]]), medium, 0.0),
        wind=at(wind, medium),
        airspeed=at(equivalent, slow, sensors.noise[2]),
        ratio=at(ratio, medium),
        height=at(height, medium, 0.1),
        battery=replace(battery, values=battery.values + [0.0, 0.3] * draw.standard_normal(battery.values.shape))
        if sensors.battery
        else Samples(np.zeros(0), np.zeros((0, 2))),
        modes=((float(time[0]), 10),),
        parameters=dict(PARAMETERS),
        home=HOME,
    )


PARAMETERS: Mapping[str, float] = {
    "AIRSPEED_MIN": 18.0,
    "AIRSPEED_CRUISE": 25.0,
    "AIRSPEED_MAX": 31.0,
    "LOG_BITMASK": 65535.0,
    **{
        f"SERVO{k}_{name}": value
        for k, function in ((1, 4), (2, 19), (3, 70), (4, 21))
        for name, value in (
            ("FUNCTION", function),
            ("MIN", 1000.0 if k == 3 else 1100.0),
            ("MAX", 2000.0 if k == 3 else 1900.0),
            ("TRIM", 1000.0 if k == 3 else 1500.0),
            ("REVERSED", 0.0),
        )
    },
}


def _pulses(commands: Floats) -> Floats:
    """(n, 4) microseconds of outputs 1 to 4, of elevator, aileron, rudder (rad) and throttle, as rigged."""
    elevator, aileron, rudder = np.degrees(commands[:, :3]).T
    return np.column_stack(
        [
            1500.0 + 400.0 * aileron / 30.0,
            1500.0 - 400.0 * (elevator + 8.4) / 30.0,
            1000.0 + 1000.0 * commands[:, 3],
            1500.0 - 400.0 * rudder / 30.0,
        ]
    )


def _to_body(force: Floats, roll: Floats, pitch: Floats, yaw: Floats) -> Floats:
    north, east, down = force.T
    ahead = north * np.cos(yaw) + east * np.sin(yaw)
    right = east * np.cos(yaw) - north * np.sin(yaw)
    x = ahead * np.cos(pitch) - down * np.sin(pitch)
    below = ahead * np.sin(pitch) + down * np.cos(pitch)
    return np.column_stack(
        [x, right * np.cos(roll) + below * np.sin(roll), below * np.cos(roll) - right * np.sin(roll)]
    )


def _late(values: Floats, time: Floats, delay: float, lag: float) -> Floats:
    """Behind a first-order lag, exactly for values that are straight between samples, and a delay."""
    made = values.copy()
    if lag > 0.0:
        step = float(time[1] - time[0])
        decay = math.exp(-step / lag)
        slope = (1.0 - decay) * lag / step
        for k in range(1, len(made)):
            made[k] = decay * made[k - 1] + (slope - decay) * values[k - 1] + (1.0 - slope) * values[k]
    return np.column_stack([np.interp(time - delay, time, column) for column in made.T])


# ----------------------------------------------------------------------
# Flights.


def fly_identification(
    folder: Path, truth: Truth, seed: int, *, repeats: int = 1, turbulence: str = "light", wind: float = 4.0
) -> tuple[Track, Aircraft]:
    """Fly the mission of manoeuvres with an aircraft of this truth in a folder; repeats: how often all of it."""
    flown = folder / f"v{seed}"
    aircraft = read_aircraft(flown) if flown.exists() else changed_aerosonde(flown, truth)
    mission = make_identification_mission(aircraft, load_envelope(aircraft), *HOME, repeats=repeats)
    file = folder / f"identify-{seed}-{repeats}.waypoints"
    file.write_text(waypoints_text(mission), encoding="utf-8")
    course = float(np.random.default_rng([seed, 3]).uniform(0.0, 360.0))
    made = planfly.fly(
        str(file),
        aircraft=str(flown),
        seed=seed,
        wind=(wind, course),
        turbulence=turbulence,
        params=str(flown / "ardupilot.parm"),
    )
    return made.track, aircraft


def write_motion(path: Path, log: MotionLog) -> Path:
    """Write a motion as a dataflash log."""
    out = DataflashWriter()
    rows: list[tuple[float, str, str, str, tuple[float, ...]]] = []

    def put(samples: Samples, name: str, letters: str, columns: str, ahead: tuple[int, ...] = ()) -> None:
        for time, values in zip(samples.time.tolist(), samples.values.tolist(), strict=True):
            rows.append((time, name, "Q" + letters, "TimeUS," + columns, (*ahead, *values)))

    put(
        replace(log.inertial, values=log.inertial.values[:, [3, 4, 5, 0, 1, 2]]),
        "IMU",
        "Bffffff",
        "I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
        (0,),
    )
    put(
        replace(log.outputs, values=log.outputs.values.astype(np.int64)),
        "RCOU",
        "H" * 14,
        ",".join(f"C{k}" for k in range(1, 15)),
    )
    put(replace(log.attitude, values=np.degrees(log.attitude.values)), "ATT", "fff", "Roll,Pitch,Yaw")
    put(log.velocity, "XKF1", "Bfff", "C,VN,VE,VD", (0,))
    put(log.wind, "XKF2", "Bff", "C,VWN,VWE", (0,))
    put(log.airspeed, "ARSP", "BBf", "I,U,Airspeed", (0, 1))
    put(log.ratio, "CTUN", "f", "E2T")
    put(log.height, "POS", "f", "Alt")
    put(log.battery, "BAT", "Bff", "Inst,Volt,Curr", (0,))
    out.message("MSG", "QZ", "TimeUS,Message", 1, log.program)
    if log.home is not None:
        lat, lon, amsl = log.home
        out.message("ORGN", "QBLLf", "TimeUS,Type,Lat,Lng,Alt", 1, 1, lat, lon, amsl)
    for name, value in log.parameters.items():
        out.message("PARM", "QNf", "TimeUS,Name,Value", 1, name, value)
    for time, mode in log.modes:
        out.message("MODE", "QBBB", "TimeUS,Mode,ModeNum,Rsn", round(time * 1e6), mode, mode, 2)
    for time, name, letters, columns, values in sorted(rows, key=lambda row: row[0]):
        out.message(name, letters, columns, round(time * 1e6), *values)
    path.write_bytes(bytes(out.data))
    return path


# ----------------------------------------------------------------------
# PX4.

PX4_PARAMETERS: Mapping[str, float] = {
    "CA_AIRFRAME": 1,
    "CA_ROTOR_COUNT": 1,
    "CA_SV_CS_COUNT": 4,
    "FW_AIRSPD_MIN": 18.0,
    "FW_AIRSPD_TRIM": 25.0,
    "FW_AIRSPD_MAX": 31.0,
    "CA_SV_CS0_TYPE": 1,
    "CA_SV_CS0_TRQ_R": -0.5,
    "CA_SV_CS1_TYPE": 2,
    "CA_SV_CS1_TRQ_R": 0.5,
    "CA_SV_CS2_TYPE": 3,
    "CA_SV_CS2_TRQ_P": 1.0,
    "CA_SV_CS3_TYPE": 4,
    "CA_SV_CS3_TRQ_Y": 1.0,
    "CA_SV_CS2_TRIM": -0.05,
}


def px4_topics(log: MotionLog) -> dict[str, tuple[Floats, dict[str, Floats]]]:
    """The topics of a motion as PX4 would have logged it: stamps (s), and fields.

    Surfaces are shares of 30 degrees, up and right positive: two ailerons, elevator, rudder.  A motor told to give less
    than 2 % of its thrust is stopped, for which PX4 has no number.
    """
    roll, pitch, yaw = 0.5 * log.attitude.values.T
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    turn = np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )
    one, two, three, four = log.outputs.values[:, :4].T
    aileron, elevator, rudder = (one - 1500.0) / 400.0, (two - 1500.0) / 400.0 + 8.4 / 30.0, (four - 1500.0) / 400.0
    unused = np.full((len(one), 8), np.nan)
    servos, motors = unused.copy(), unused.copy()
    servos[:, :4] = np.column_stack([-aileron, aileron, elevator - 0.05, rudder])
    throttle = (three - 1000.0) / 1000.0
    motors[:, 0] = np.where(throttle < 0.02, np.nan, throttle)
    height, status = log.height, log.attitude.time[::25]
    place = np.column_stack([np.full(len(height.time), HOME[0]), np.full(len(height.time), HOME[1]), height.values])
    ratio = np.interp(log.airspeed.time, log.ratio.time, log.ratio.values[:, 0])[:, np.newaxis]
    made = {
        "sensor_combined": (
            log.inertial.time,
            {"gyro_rad": log.inertial.values[:, 3:], "accelerometer_m_s2": log.inertial.values[:, :3]},
        ),
        "vehicle_attitude": (log.attitude.time, {"q": turn}),
        "vehicle_local_position": (
            log.velocity.time,
            {name: log.velocity.values[:, k] for k, name in enumerate(("vx", "vy", "vz"))},
        ),
        "vehicle_global_position": (height.time, {name: place[:, k] for k, name in enumerate(("lat", "lon", "alt"))}),
        "airspeed_validated": (
            log.airspeed.time,
            {
                "calibrated_airspeed_m_s": log.airspeed.values,
                "true_airspeed_m_s": log.airspeed.values * ratio,
                "selected_airspeed_index": np.ones(len(ratio)),
            },
        ),
        "wind": (
            log.wind.time[::25],
            {"windspeed_north": log.wind.values[::25, 0], "windspeed_east": log.wind.values[::25, 1]},
        ),
        "actuator_servos": (log.outputs.time, {"control": servos}),
        "actuator_motors": (log.outputs.time, {"control": np.column_stack([motors, motors[:, 1:5]])}),
        "battery_status": (
            log.battery.time,
            {"voltage_v": log.battery.values[:, 0], "current_a": log.battery.values[:, 1]},
        ),
        "vehicle_status": (
            status,
            {
                "vehicle_type": np.full(len(status), 2.0),
                "nav_state": np.full(len(status), 3.0),
                "in_transition_mode": np.zeros(len(status)),
                "arming_state": np.full(len(status), 2.0),
            },
        ),
        "home_position": (
            status[:1],
            {name: np.full(1, value) for name, value in zip(("lat", "lon", "alt"), HOME, strict=True)},
        ),
    }
    return {name: table for name, table in made.items() if len(table[0])}


def write_px4(
    path: Path,
    topics: Mapping[str, tuple[Floats, Mapping[str, Floats]]],
    parameters: Mapping[str, float],
    changes: Mapping[str, float] = {},
) -> Path:
    """Write topics as a `.ulg` (PX4, "ULog File Format"), all numbers as doubles.

    topics: by name; "battery_status 1" is its second instance.  changes: of parameters, in flight.
    """

    def message(letter: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + letter + body

    head = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40)))
    stamps, pieces = [], []
    for number, (name, (time, fields)) in enumerate(topics.items()):
        tables = {key: values.reshape(len(time), -1) for key, values in fields.items()}
        kinds = "".join(
            f"double{f'[{table.shape[1]}]' if table.shape[1] > 1 else ''} {key};" for key, table in tables.items()
        )
        if name == name.split()[0]:
            head += message(b"F", f"{name}:uint64_t timestamp;{kinds}".encode())
        rows = np.hstack(list(tables.values())).astype("<f8")
        for when, row in zip(np.rint(time * 1e6).astype(np.int64).tolist(), rows, strict=True):
            stamps.append(when)
            pieces.append(message(b"D", struct.pack("<HQ", number, when) + row.tobytes()))
    key = b"char[3] sys_name"
    head += message(b"I", bytes([len(key)]) + key + b"PX4")

    def stated(name: str, value: float) -> bytes:
        whole = isinstance(value, int)
        text = f"{'int32_t' if whole else 'float'} {name}".encode()
        return message(b"P", bytes([len(text)]) + text + struct.pack("<i" if whole else "<f", value))

    for name, value in parameters.items():
        head += stated(name, value)
    for number, name in enumerate(topics):
        topic, *instance = name.split()
        head += message(b"A", struct.pack("<BH", int(instance[0]) if instance else 0, number) + topic.encode())
    order = np.argsort(np.array(stamps), kind="stable").tolist()
    later = b"".join(stated(name, value) for name, value in changes.items())
    path.write_bytes(bytes(head) + b"".join(pieces[k] for k in order) + later)
    return path


def short_motion(seconds: float = 4.0) -> MotionLog:
    """A log of a few seconds with random numbers in every series: no flight, for readers and writers."""
    draw = np.random.default_rng(4)

    def some(width: int, hertz: float) -> Samples:
        time = np.round(20.0 + np.arange(round(seconds * hertz)) / hertz, 6)
        return Samples(time, draw.normal(size=(len(time), width)))

    outputs = some(14, 25.0)
    return MotionLog(
        source="short.BIN",
        sha256="",
        program="ArduPlane V4.6.0",
        vehicle="plane",
        inertial=some(6, 50.0),
        outputs=replace(outputs, values=draw.integers(1000, 2000, outputs.values.shape).astype(np.float64)),
        attitude=some(3, 25.0),
        velocity=some(3, 25.0),
        wind=some(2, 25.0),
        airspeed=some(1, 10.0),
        ratio=some(1, 25.0),
        height=some(1, 25.0),
        battery=some(2, 10.0),
        modes=((20.0, 10),),
        parameters=dict(PARAMETERS),
    )
