"""What a log of PX4 (`.ulg`) holds of an aircraft's motion, as `logs.importers.motion_log` has it of ArduPilot's.

All topics are of one clock.  What the surfaces do is `actuator_servos`, with the airframe that the control allocation
was told (CA_*), or `actuator_controls_0` of releases before 1.14.  Names are of PX4's message and parameter references.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from logs.importers.motion_log import MotionLog, Samples, first_on_ground, rising
from logs.importers.px4_log import Topics, open_topics
from world.errors import LogError

Floats = NDArray[np.float64]

_TOPICS = [
    "sensor_combined", "vehicle_angular_velocity", "vehicle_acceleration", "vehicle_attitude", "vehicle_local_position",
    "vehicle_global_position", "airspeed_validated", "wind", "wind_estimate", "actuator_servos", "actuator_motors",
    "actuator_controls_0", "battery_status", "vehicle_status", "home_position",
]  # fmt: skip
NONE = Samples(np.zeros(0), np.zeros((0, 1)))
# CA_AIRFRAME: a fixed wing, and one with lifting motors beside it, whose first rotors they are.
_WING, _STANDARD_VTOL = 1, 2
_AIRFRAMES = {
    0: "a multirotor", 3: "a tiltrotor", 4: "a tailsitter", 5: "a rover", 6: "a rover", 7: "a craft without wings",
    8: "a multirotor", 9: "a custom airframe",
}  # fmt: skip
# CA_SV_CSn_TYPE.
_MODELLED = frozenset({1, 2, 3, 4, 5, 6, 15})
_ELEVONS = frozenset({5, 6})
_MIXED = {7: "a V-tail", 8: "a V-tail", 12: "a custom surface", 13: "an A-tail", 14: "an A-tail"}
_FLAPS = {9: "flap", 10: "flap", 11: "airbrake", 17: "spoiler", 18: "spoiler"}
_AXES = ("P", "R", "Y")
# A flap moves that leaves its place by more, of its travel of 2.
_MOVES = 0.05
# vehicle_status.vehicle_type of a fixed wing.
_FIXED_WING = 2
# ArduPlane's parameters by PX4's, with what they are multiplied with.
_PARAMETERS: Mapping[str, tuple[str, float]] = {
    "FW_AIRSPD_MIN": ("AIRSPEED_MIN", 1.0), "FW_AIRSPD_TRIM": ("AIRSPEED_CRUISE", 1.0),
    "FW_AIRSPD_MAX": ("AIRSPEED_MAX", 1.0), "FW_R_LIM": ("ROLL_LIMIT_DEG", 1.0),
    "FW_THR_TRIM": ("TRIM_THROTTLE", 100.0),
}  # fmt: skip


def read_px4_motion(path: Path, digest: str) -> MotionLog:
    """Read a log's motion; digest: SHA-256 of its bytes.

    Raises LogError, in one line, for a file that cannot be read, and for surfaces that no model of is estimated.
    """
    topics = open_topics(path, _TOPICS)
    with np.errstate(all="ignore"):
        parameters = topics.parameters()
        velocity = _samples(topics, "vehicle_local_position", ("vx", "vy", "vz"))
        place = _samples(
            topics, "vehicle_global_position", ("lat", "lon", "alt"), ("latitude", "longitude", "altitude")
        )
        attitude = topics.attitude()
        controls, elevons = _controls(topics, parameters)
        airspeed, ratio = _airspeed(topics)
        home = topics.home()
        height = NONE if not len(place.time) else Samples(place.time, place.values[:, 2:])
        return MotionLog(
            source=str(path),
            sha256=digest,
            program=topics.program(),
            vehicle=topics.vehicle(),
            inertial=_inertial(topics),
            outputs=NONE,
            attitude=NONE if attitude is None else rising(attitude.time, attitude.values),
            velocity=velocity,
            wind=_wind(topics),
            airspeed=airspeed,
            ratio=ratio,
            height=height,
            battery=_samples(topics, "battery_status", ("voltage_v", "current_a")),
            parameters={
                name: parameters[own] * factor for own, (name, factor) in _PARAMETERS.items() if own in parameters
            },
            home=first_on_ground(place, velocity) if home is None else (home.lat_deg, home.lon_deg, home.alt),
            program_kind="px4",
            controls=controls,
            elevons=elevons,
            hovering=tuple(_hovering(topics)),
        )


def _samples(topics: Topics, topic: str, *choices: tuple[str, ...]) -> Samples:
    found = topics.table(topic, *choices)
    return NONE if found is None else rising(found.time, found.values)


def _inertial(topics: Topics) -> Samples:
    force, rates = tuple(f"accelerometer_m_s2[{k}]" for k in range(3)), tuple(f"gyro_rad[{k}]" for k in range(3))
    both = _samples(topics, "sensor_combined", force + rates)
    if len(both.time):
        return both
    three = tuple(f"xyz[{k}]" for k in range(3))
    forces, turning = (_samples(topics, name, three) for name in ("vehicle_acceleration", "vehicle_angular_velocity"))
    if len(forces.time) < 2 or len(turning.time) < 2:
        return NONE
    inside = (forces.time >= turning.time[0]) & (forces.time <= turning.time[-1])
    time = forces.time[inside]
    also = [np.interp(time, turning.time, column) for column in turning.values.T]
    return Samples(time, np.column_stack([forces.values[inside], *also]))


def _wind(topics: Topics) -> Samples:
    """To where the air moves, north and east."""
    for topic in ("wind", "wind_estimate"):
        found = _samples(topics, topic, ("windspeed_north", "windspeed_east"))
        if len(found.time):
            return found
    return NONE


def _airspeed(topics: Topics) -> tuple[Samples, Samples]:
    """Calibrated airspeed where a sensor measured it, and true by calibrated."""
    columns = ("calibrated_airspeed_m_s", "true_airspeed_m_s")
    found = topics.table("airspeed_validated", columns)
    if found is None:
        return NONE, NONE
    # From 1 on sensors; 0 and below, and 4 (synthetic), are no measurements.
    for name in ("airspeed_source", "selected_airspeed_index"):
        chosen = topics.table("airspeed_validated", (*columns, name))
        if chosen is not None:
            number = chosen.values[:, 2]
            measured = (number >= 1.0) & (number <= 3.0)
            break
    else:
        measured = np.ones(len(found.time), np.bool_)
    time, values = found.time[measured], found.values[measured]
    moving = values[:, 0] > 1.0
    ratio = values[moving, 1:] / values[moving, :1]
    return rising(time, values[:, :1]), rising(time[moving], ratio)


def _hovering(topics: Topics) -> Iterable[tuple[float, float]]:
    """Stretches (s) in which a VTOL was not a plane, or on its way to being one."""
    kinds = topics.table("vehicle_status", ("vehicle_type", "in_transition_mode"), ("vehicle_type",))
    if kinds is None:
        return
    plane = kinds.values[:, 0] == _FIXED_WING
    if kinds.values.shape[1] > 1:
        plane &= kinds.values[:, 1] == 0.0
    ends = np.append(kinds.time[1:], np.inf)
    for begin, end, flying in zip(kinds.time.tolist(), ends.tolist(), plane.tolist(), strict=True):
        if not flying:
            yield begin, end


def _controls(topics: Topics, parameters: Mapping[str, float]) -> tuple[Samples, bool]:
    """(n, 4) pitch up, roll and yaw right as shares of full travel, and throttle; and whether elevons do it.

    A surface's positive is up, or right; its torque scales (CA_SV_CSn_TRQ_*) say which axes it moves, and an axis is
    the mean of its surfaces by these.  Raises LogError for surfaces that no model of is estimated.
    """
    servos, motors = (
        _actuators(topics, name, size) for name, size in (("actuator_servos", 8), ("actuator_motors", 12))
    )
    if len(servos.time) < 2 or len(motors.time) < 2:
        # Roll, pitch, yaw and throttle as they were before the mixer.
        old = _samples(topics, "actuator_controls_0", tuple(f"control[{k}]" for k in range(4)))
        return (Samples(old.time, old.values[:, [1, 0, 2, 3]]) if len(old.time) else NONE), False
    airframe = int(parameters.get("CA_AIRFRAME", _WING))
    if airframe not in (_WING, _STANDARD_VTOL):
        raise _refusal(topics, "CA_AIRFRAME", airframe, f"{_AIRFRAMES.get(airframe, 'unknown')}: a plane is expected")
    scales = np.zeros((3, 8))
    elevons = False
    for k in range(int(np.clip(parameters.get("CA_SV_CS_COUNT", 0.0), 0.0, 8.0))):
        kind = int(parameters.get(f"CA_SV_CS{k}_TYPE", 0.0))
        used = servos.values[np.isfinite(servos.values[:, k]), k]
        moves = len(used) > 0 and float(np.ptp(used)) > _MOVES
        if kind in _MODELLED:
            scales[:, k] = [parameters.get(f"CA_SV_CS{k}_TRQ_{axis}", 0.0) for axis in _AXES]
            elevons = elevons or kind in _ELEVONS
            servos.values[:, k] -= parameters.get(f"CA_SV_CS{k}_TRIM", 0.0)
        elif kind in _MIXED:
            raise _refusal(topics, f"CA_SV_CS{k}_TYPE", kind, f"{_MIXED[kind]}: its mix is not modelled")
        elif kind in _FLAPS and moves:
            message = f"{_FLAPS[kind]} moves in flight, and no model of it is estimated"
            raise _refusal(topics, f"CA_SV_CS{k}_TYPE", kind, message)
    for axis, row in zip(("elevator", "aileron"), scales, strict=False):
        if not row.any():
            allowed = "CA_SV_CSn_TYPE with CA_SV_CSn_TRQ_P and CA_SV_CSn_TRQ_R are expected"
            raise LogError(f"{topics.source}: no surface is the {axis}'s: {allowed}", file=topics.source)
    sums = np.abs(scales).sum(axis=1, keepdims=True)
    shares = np.nan_to_num(servos.values) @ (scales / np.where(sums > 0.0, sums, 1.0)).T
    first = int(parameters.get("CA_ROTOR_COUNT", 0.0)) if airframe == _STANDARD_VTOL else 0
    pushing = motors.values[:, first:]
    running = np.isfinite(pushing)
    throttle = np.where(running, pushing, 0.0).sum(axis=1) / np.maximum(1, running.sum(axis=1))
    rows = np.clip(np.searchsorted(motors.time, servos.time, side="right") - 1, 0, len(motors.time) - 1)
    return Samples(servos.time, np.column_stack([shares, np.clip(throttle[rows], 0.0, 1.0)])), elevons


def _actuators(topics: Topics, topic: str, size: int) -> Samples:
    """(n, size) of one topic; what is not used has no number."""
    found = topics.table(topic, tuple(f"control[{k}]" for k in range(size)))
    if found is None:
        return NONE
    # Rows without any number are those of a vehicle that is not armed.
    kept = np.isfinite(found.values).any(axis=1)
    steps = rising(found.time[kept], np.flatnonzero(kept)[:, np.newaxis].astype(np.float64))
    return Samples(steps.time, found.values[steps.values[:, 0].astype(np.intp)])


def _refusal(topics: Topics, field: str, value: int, message: str) -> LogError:
    return LogError(f"{topics.source}: {field} {value} is {message}", file=topics.source, field=field, value=value)
