"""Read the motion of an aircraft from a PX4 log (`.ulg`), for an identification.

All topics share one clock.  Surface deflections come from `actuator_servos` and the parameters of the control
allocation (CA_*), or from `actuator_controls_0` in logs of releases before 1.14.  Names follow PX4's message and
parameter references.  `logs.importers.motion_log` reads the same from ArduPilot's logs.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from logs.importers.motion import MotionLog, Samples, find_first_ground_position, sort_samples
from logs.importers.px4_log import WIND_TOPICS, Topics, open_topics
from world.errors import LogError

_TOPICS = [
    "sensor_combined",
    "vehicle_angular_velocity",
    "vehicle_acceleration",
    "vehicle_attitude",
    "vehicle_local_position",
    "vehicle_global_position",
    "airspeed_validated",
    *WIND_TOPICS,
    "actuator_servos",
    "actuator_motors",
    "actuator_controls_0",
    "battery_status",
    "vehicle_status",
    "home_position",
    "flaps_setpoint",
    "spoilers_setpoint",
]
NO_SAMPLES = Samples(np.zeros(0), np.zeros((0, 1)))
# Value of CA_AIRFRAME of a fixed wing.
_WING = 1
# Value of CA_AIRFRAME of a fixed wing with additional lifting motors, which are its first rotors.
_STANDARD_VTOL = 2
_AIRFRAMES = {
    0: "a multirotor",
    3: "a tiltrotor",
    4: "a tailsitter",
    5: "a rover",
    6: "a rover",
    7: "a craft without wings",
    8: "a multirotor",
    9: "a custom airframe",
}
# Values of CA_SV_CSn_TYPE for surfaces that are modelled: ailerons, elevators, rudders and elevons.
_MODELLED = frozenset({1, 2, 3, 4, 5, 6, 15})
# Values for elevons.
_ELEVONS = frozenset({5, 6})
# Values for surfaces that cannot be modelled, because they act about several axes.
_MIXED = {7: "a V-tail", 8: "a V-tail", 12: "a custom surface", 13: "an A-tail", 14: "an A-tail"}
# Values for surfaces that may be ignored if they do not move.
_FLAPS = {9: "flap", 10: "flap", 11: "airbrake", 17: "spoiler", 18: "spoiler"}
# Flaps and spoilers may also deflect a surface of another type, by the factor CA_SV_CSn_FLAP or CA_SV_CSn_SPOIL.  By
# the end of that name: their name in messages, and the topic with their setpoint.
_ALSO_MOVE = {"FLAP": ("flaps", "flaps_setpoint"), "SPOIL": ("spoilers", "spoilers_setpoint")}
_AXES = ("P", "R", "Y")
# A flap moves in flight if its largest and its smallest output (-1..1) differ by more than this.
_FLAP_MOVE_TOLERANCE = 0.05
# vehicle_status.vehicle_type of a fixed wing.
_FIXED_WING = 2
# vehicle_status.arming_state of an armed vehicle.
_ARMED = 2
# Greatest number of servos in the topics.
_SERVOS = 8
# Greatest number of motors in the topics.
_MOTORS = 12
# ArduPlane's name of a parameter, and the factor to its unit, by PX4's name.
_PARAMETERS: Mapping[str, tuple[str, float]] = {
    "FW_AIRSPD_MIN": ("AIRSPEED_MIN", 1.0),
    "FW_AIRSPD_TRIM": ("AIRSPEED_CRUISE", 1.0),
    "FW_AIRSPD_MAX": ("AIRSPEED_MAX", 1.0),
    "FW_R_LIM": ("ROLL_LIMIT_DEG", 1.0),
    "FW_THR_TRIM": ("TRIM_THROTTLE", 100.0),
}


def read_px4_motion(path: Path, digest: str) -> MotionLog:
    """Read the motion of an aircraft from a PX4 log.

    Raises LogError for a file that cannot be read, and for control surfaces or motors that cannot be modelled.

    digest: SHA-256 of the file's bytes.
    """
    topics = open_topics(path, _TOPICS)
    with np.errstate(all="ignore"):
        parameters = topics.parameters()
        velocity = _read_samples(topics, "vehicle_local_position", ("vx", "vy", "vz"))
        place = _read_samples(
            topics, "vehicle_global_position", ("lat", "lon", "alt"), ("latitude", "longitude", "altitude")
        )
        attitude = topics.attitude()
        controls, elevons = _read_controls(topics, parameters)
        airspeed, ratio = _read_airspeed(topics)
        home, battery = topics.home(), topics.battery()
        height = NO_SAMPLES if not len(place.time) else Samples(place.time, place.values[:, 2:])
        winds = (_read_samples(topics, topic, ("windspeed_north", "windspeed_east")) for topic in WIND_TOPICS)
        # Periods in which a VTOL flew on lifting motors or in transition.
        kinds = topics.table("vehicle_status", ("vehicle_type", "in_transition_mode"), ("vehicle_type",))
        hover_periods: list[tuple[float, float]] = []
        if kinds is not None:
            is_plane = (kinds.values[:, 0] == _FIXED_WING) & (kinds.values[:, 1:] == 0.0).all(axis=1)
            ends = np.append(kinds.time[1:], np.inf)
            hover_periods = list(zip(kinds.time[~is_plane].tolist(), ends[~is_plane].tolist(), strict=True))
        return MotionLog(
            source=str(path),
            sha256=digest,
            program=topics.program(),
            vehicle=topics.vehicle(),
            inertial=_read_inertial(topics),
            outputs=NO_SAMPLES,
            attitude=NO_SAMPLES if attitude is None else sort_samples(attitude.time, attitude.values),
            velocity=velocity,
            wind=next((wind for wind in winds if len(wind.time)), NO_SAMPLES),
            airspeed=airspeed,
            ratio=ratio,
            height=height,
            battery=NO_SAMPLES if battery is None else sort_samples(battery.time, battery.values),
            parameters={
                name: parameters[px4_name] * factor
                for px4_name, (name, factor) in _PARAMETERS.items()
                if px4_name in parameters
            },
            home=find_first_ground_position(place, velocity)
            if home is None
            else (home.lat_deg, home.lon_deg, home.alt),
            program_kind="px4",
            controls=controls,
            elevons=elevons,
            hovering=tuple(hover_periods),
        )


def _read_samples(topics: Topics, topic: str, *choices: tuple[str, ...]) -> Samples:
    """Return fields of a topic, sorted by time; no rows if the log lacks the topic or the fields.

    choices: alternative groups of fields; the first group that the topic has in full is returned.
    """
    table = topics.table(topic, *choices)
    return NO_SAMPLES if table is None else sort_samples(table.time, table.values)


def _read_inertial(topics: Topics) -> Samples:
    """Read specific force (m/s²) and angular rates (rad/s) about the body axes, (n, 6).

    There are no rows if they are not logged.  They come from the inertial sensors, or else from the two topics with
    filtered values.
    """
    force = tuple(f"accelerometer_m_s2[{k}]" for k in range(3))
    rates = tuple(f"gyro_rad[{k}]" for k in range(3))
    samples = _read_samples(topics, "sensor_combined", force + rates)
    if len(samples.time):
        return samples
    axes = tuple(f"xyz[{k}]" for k in range(3))
    forces, angular_rates = (
        _read_samples(topics, name, axes) for name in ("vehicle_acceleration", "vehicle_angular_velocity")
    )
    if len(forces.time) < 2 or len(angular_rates.time) < 2:
        return NO_SAMPLES
    has_rates = (forces.time >= angular_rates.time[0]) & (forces.time <= angular_rates.time[-1])
    time = forces.time[has_rates]
    rate_columns = [np.interp(time, angular_rates.time, column) for column in angular_rates.values.T]
    return Samples(time, np.column_stack([forces.values[has_rates], *rate_columns]))


def _read_airspeed(topics: Topics) -> tuple[Samples, Samples]:
    """Read the calibrated airspeed, m/s, (n, 1), and the ratio of true to calibrated airspeed, (k, 1).

    Rows whose airspeed does not come from a sensor are left out.  The ratio has no rows at airspeeds up to 1 m/s.
    """
    # PX4 logs calibrated airspeed since 1.12, and equivalent airspeed before; both are equal at these speeds.
    choices = [(speed, "true_airspeed_m_s") for speed in ("calibrated_airspeed_m_s", "equivalent_airspeed_m_s")]
    validated = topics.table("airspeed_validated", *choices)
    if validated is None:
        return NO_SAMPLES, NO_SAMPLES
    # 1 to 3 are sensors; 0 and below, and 4 (synthetic), are not measurements.
    for name in ("airspeed_source", "selected_airspeed_index"):
        with_source = topics.table("airspeed_validated", *((*columns, name) for columns in choices))
        if with_source is not None:
            sensor_number = with_source.values[:, 2]
            is_measured = (sensor_number >= 1.0) & (sensor_number <= 3.0)
            break
    else:
        is_measured = np.ones(len(validated.time), np.bool_)
    time, values = validated.time[is_measured], validated.values[is_measured]
    is_moving = values[:, 0] > 1.0
    ratio = values[is_moving, 1:] / values[is_moving, :1]
    return sort_samples(time, values[:, :1]), sort_samples(time[is_moving], ratio)


def _read_controls(topics: Topics, parameters: Mapping[str, float]) -> tuple[Samples, bool]:
    """Read pitch, roll, yaw (fractions of full travel) and throttle, (n, 4), and the elevon flag.

    The flag is True if the aircraft has elevons.  Controls are positive for pitch up, roll right and yaw right.  The
    control about an axis is the mean deflection of all surfaces, weighted by their effects on that axis, which the
    parameters CA_SV_CSn_TRQ_* state.  The throttle is the mean output of the forward motors.  Logs of releases before
    1.14 contain the controls themselves, which are then returned.  There are no rows if the log has neither.

    Raises LogError for an airframe other than a plane, and for surfaces or motors that cannot be modelled.

    parameters: parameters of the log, keyed by name.
    """
    servos = _read_actuators(topics, "actuator_servos", _SERVOS)
    motors = _read_actuators(topics, "actuator_motors", _MOTORS)
    # An unused servo has NaN.
    is_known = np.isfinite(servos.values).any(axis=1)
    states = _read_samples(topics, "vehicle_status", ("arming_state",))
    if len(states.time):
        state_rows = np.clip(np.searchsorted(states.time, servos.time, side="right") - 1, 0, None)
        is_known &= states.values[state_rows, 0] == _ARMED
    servos = Samples(servos.time[is_known], servos.values[is_known])
    if len(servos.time) < 2 or len(motors.time) < 2:
        # Roll, pitch, yaw and throttle before the mixer, in logs of old releases.
        mixer_inputs = _read_samples(topics, "actuator_controls_0", tuple(f"control[{k}]" for k in range(4)))
        if not len(mixer_inputs.time):
            return NO_SAMPLES, False
        return Samples(mixer_inputs.time, mixer_inputs.values[:, [1, 0, 2, 3]]), False
    airframe = int(parameters.get("CA_AIRFRAME", _WING))
    if airframe not in (_WING, _STANDARD_VTOL):
        raise _make_parameter_error(
            topics, "CA_AIRFRAME", airframe, f"{_AIRFRAMES.get(airframe, 'unknown')}; expected a plane"
        )
    scales = np.zeros((3, _SERVOS))
    has_elevons = False
    for k in range(int(np.clip(parameters.get("CA_SV_CS_COUNT", 0.0), 0.0, _SERVOS))):
        kind = int(parameters.get(f"CA_SV_CS{k}_TYPE", 0.0))
        deflections = servos.values[np.isfinite(servos.values[:, k]), k]
        moves = len(deflections) > 0 and float(np.ptp(deflections)) > _FLAP_MOVE_TOLERANCE
        if kind in _MODELLED:
            for name, (title, topic) in _ALSO_MOVE.items():
                deflection_ratio = parameters.get(f"CA_SV_CS{k}_{name}", 0.0)
                setpoints = _read_samples(topics, topic, ("normalized_setpoint",)).values
                if len(setpoints) and abs(deflection_ratio) * float(np.ptp(setpoints)) > _FLAP_MOVE_TOLERANCE:
                    fault = f"{title} deflect this surface in flight, which the model does not represent"
                    raise _make_parameter_error(topics, f"CA_SV_CS{k}_{name}", deflection_ratio, fault)
            scales[:, k] = [parameters.get(f"CA_SV_CS{k}_TRQ_{axis}", 0.0) for axis in _AXES]
            has_elevons = has_elevons or kind in _ELEVONS
            servos.values[:, k] -= parameters.get(f"CA_SV_CS{k}_TRIM", 0.0)
        elif kind in _MIXED:
            raise _make_parameter_error(topics, f"CA_SV_CS{k}_TYPE", kind, f"{_MIXED[kind]}, whose mix is not modelled")
        elif kind in _FLAPS and moves:
            message = f"the {_FLAPS[kind]} moves in flight, which the model does not represent"
            raise _make_parameter_error(topics, f"CA_SV_CS{k}_TYPE", kind, message)
    for axis, row in zip(("elevator", "aileron"), scales, strict=False):
        if not row.any():
            allowed = "expected CA_SV_CSn_TYPE with CA_SV_CSn_TRQ_P and CA_SV_CSn_TRQ_R"
            raise LogError(f"{topics.source}: no surface acts as {axis}; {allowed}", file=topics.source)
    sums = np.abs(scales).sum(axis=1, keepdims=True)
    axis_deflections = np.nan_to_num(servos.values) @ (scales / np.where(sums > 0.0, sums, 1.0)).T
    # A motor below 2 % of its thrust is stopped, which is NaN (PX4's control allocator).
    thrusts = np.nan_to_num(motors.values[:, _find_forward_motors(topics, airframe, parameters, motors)])
    throttle = np.clip(thrusts.mean(axis=1), 0.0, 1.0) if thrusts.size else np.zeros(len(motors.time))
    rows = np.clip(np.searchsorted(motors.time, servos.time, side="right") - 1, 0, len(motors.time) - 1)
    return Samples(servos.time, np.column_stack([axis_deflections, throttle[rows]])), has_elevons


def _find_forward_motors(topics: Topics, airframe: int, parameters: Mapping[str, float], motors: Samples) -> list[int]:
    """Return the indices of the motors that push forward.

    On a VTOL, they are the rotors whose axis points more forward than up.  Any other aircraft has only forward motors:
    as many as CA_ROTOR_COUNT states or, if it is absent or 0, those with a recorded output.

    Raises LogError for a VTOL without a forward motor; the error names CA_ROTOR_COUNT, because no single rotor's axis
    is at fault.

    airframe: value of CA_AIRFRAME.
    motors: outputs of the motors, (n, `_MOTORS`).
    """
    count = int(np.clip(parameters.get("CA_ROTOR_COUNT", 0.0), 0.0, _MOTORS))
    if airframe == _STANDARD_VTOL:
        # The axis of a rotor is up by default.
        axes = [
            [abs(parameters.get(f"CA_ROTOR{k}_A{axis}", up)) for axis, up in (("X", 0.0), ("Z", 1.0))]
            for k in range(count)
        ]
        forward_rotors = [k for k, (x, z) in enumerate(axes) if x > z]
        if not forward_rotors:
            allowed = "expected a rotor with |CA_ROTORn_AX| above |CA_ROTORn_AZ|"
            raise _make_parameter_error(topics, "CA_ROTOR_COUNT", count, f"no rotor pushes forward; {allowed}")
        return forward_rotors
    return list(range(count)) or np.flatnonzero(np.isfinite(motors.values).any(axis=0)).tolist()


def _read_actuators(topics: Topics, topic: str, size: int) -> Samples:
    """Read the outputs of the first `size` actuators in a topic, sorted by time, (n, size).

    There are no rows if the log lacks the topic.  The output of an unused or stopped actuator is NaN.
    """
    table = topics.table(topic, tuple(f"control[{k}]" for k in range(size)))
    if table is None:
        return Samples(np.zeros(0), np.zeros((0, size)))
    # `sort_samples` leaves out rows with NaN: sort the row numbers instead of the values.
    row_numbers = sort_samples(table.time, np.arange(len(table.time), dtype=np.float64)[:, np.newaxis])
    return Samples(row_numbers.time, table.values[row_numbers.values[:, 0].astype(np.intp)])


def _make_parameter_error(topics: Topics, field: str, value: float, message: str) -> LogError:
    """Return the error for a parameter that describes surfaces or motors which cannot be modelled.

    field, value: name and value of the parameter.
    message: reason, which follows name and value.
    """
    return LogError(f"{topics.source}: {field} {value:g}: {message}", file=topics.source, field=field, value=value)
