"""Resample the logged motion on one time grid, and select the segments that an identification can use."""

import math
from collections.abc import Mapping

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from logs.importers.motion import MotionLog, Samples
from planfly.identification.base_numbers import is_flying_wing
from planfly.identification.servos import ServoOutput
from world.arrays import Flags, Floats
from world.errors import LogError

# Minimum rate of inertial sensors and servo outputs that allows an estimate of the moments, Hz; it is below 10 Hz,
# because a nominal 10 Hz varies slightly in a log.
MIN_HZ = 9.5
# Rate below which the report names the setting that records more rows, Hz.
AMPLE_HZ = 20.0
# Minimum usable flight time of a log, after unusable parts are cut, s.
MIN_SECONDS = 180.0
# Minimum usable flight time of a log that only checks an estimate, s; a minute of flight has as much after its cuts.
MIN_CHECK_SECONDS = 30.0
# Minimum duration of a segment, s.
MIN_STRETCH = 30.0
# Maximum pause between rows of the sensors within a segment, s.
_MAX_SENSOR_GAP_S = 0.5
# Maximum pause between rows of airspeed or wind, which are logged more slowly, s.
_MAX_AIR_GAP_S = 1.0
# Maximum pause between rows of the wind of PX4, which is logged about once a second, and of columns, s.
_MAX_SLOW_WIND_GAP_S = 2.5
# Time after take-off or release that is cut, s.
_SETTLING_TIME_S = 15.0
# Fraction of AIRSPEED_MIN above which the aircraft is flying.
_MIN_AIRSPEED_FRACTION = 0.8
# Duration of the windows over which airspeed and ground velocity are compared, s.
_COMPARED_WINDOW_S = 10.0
# Standard deviation of the airspeed in a window below which a sensor may be blocked, m/s; in real air it is above 0.3.
_BLOCKED_AIRSPEED_SD_MPS = 0.1
# Standard deviation, in the same window, of ground velocity minus wind along the heading that shows that it is, m/s.
_MOVING_AIRSPEED_SD_MPS = 1.0
# Largest part of the flight with a blocked airspeed sensor, as a fraction, for the rest to be used.
_MAX_BLOCKED_FRACTION = 0.25
# ArduPlane's quadplane modes (QSTABILIZE 17 to QACRO 23, QAUTOTUNE 22, LOITER_ALT_QLAND 25), and the mode that does not
# control the surfaces: INITIALISING 16.
_VTOL_MODES = frozenset({17, 18, 19, 20, 21, 22, 23, 25})
# SERVOn_FUNCTION (ArduPilot's parameter list).
_AILERON = 4
_ELEVATOR = 19
_RUDDER = 21
_THROTTLE = 70
_ELEVON_LEFT = 77
_ELEVON_RIGHT = 78
# Functions of mixed surfaces, which are refused.
_MIXED_FUNCTIONS = {79: "a V-tail", 80: "a V-tail"}
# Names of the two outputs of a flying wing, each a mix of elevator and aileron.
LEFT = "left elevon"
RIGHT = "right elevon"
# Functions of surfaces that must not move in flight.
_FLAPS = {
    2: "flap",
    3: "automatic flap",
    16: "spoiler",
    17: "spoiler",
    24: "flaperon",
    25: "flaperon",
    86: "spoiler",
    87: "spoiler",
}
# Functions of lifting motors.
_LIFT_MOTORS = frozenset(range(33, 41))
# ArduPlane's default LOG_BITMASK, which logs inertial sensors and servo outputs at a high rate.
_HIGH_RATE_BITMASK = 65535
# Settings that record more rows, for logs that no autopilot wrote.
_RECORDING_SETTINGS = {
    "columns": "a logger with 50 rows a second",
    "telemetry": "SRn_RAW_SENS 25, SRn_RC_CHAN 25 and SRn_EXTRA1 25",
}
# PX4's SDLOG_PROFILE: the default set (1) and the high-rate set (16).
_HIGH_RATE_PROFILE = 17


def flight_records(
    log: MotionLog,
    aircraft: Aircraft,
    servos: Mapping[str, ServoOutput] | None = None,
    min_seconds: float = MIN_SECONDS,
    until: float = math.inf,
) -> list[FlightRecord]:
    """Return the segments of a log for an identification: wing-borne flight without gaps in the data.

    aircraft: base aircraft, whose full deflections are used for the surfaces.
    servos: output of each control; None to derive the outputs from the SERVOn_* parameters of the log.
    min_seconds: minimum total duration of the segments, s.
    until: time in the log from which rows are not used, s.
    Raises LogError, with a one-line message, for a log that cannot be used.
    """
    _check_usable(log)
    if log.elevons:
        _check_flying_wing_base(log, aircraft)
    # The grid covers the period that all series cover.
    series = (log.inertial, log.surface_commands, log.attitude, log.velocity, log.height, log.airspeed, log.wind)
    start_time = max(samples.time[0] for samples in series)
    grid = np.arange(start_time, min(samples.time[-1] for samples in series), 1.0 / GRID_HZ)
    pulses = (
        _hold_samples(log.outputs, grid)
        if len(log.outputs.time)
        else np.zeros((len(grid), log.outputs.values.shape[1]))
    )
    stops = np.array([aircraft.max_elevator, aircraft.max_aileron, aircraft.max_rudder, 1.0])
    if len(log.controls.time):
        # Logged are angles (rad), or fractions of full travel, positive for nose up and yaw to the right; the model's
        # elevator and rudder have the opposite sign.
        travel = np.where((*log.angles, True), 1.0, stops)
        controls = _hold_samples(log.controls, grid) * (np.array([-1.0, 1.0, -1.0, 1.0]) * travel)
    else:
        servo_outputs = servos or log_outputs(log, aircraft)
        deflections = {name: output.control(pulses[:, output.output - 1]) for name, output in servo_outputs.items()}
        if LEFT in deflections:
            # With elevons, elevator and aileron are half the sum and half the difference of the elevons.
            left, right = deflections.pop(LEFT), deflections.pop(RIGHT)
            deflections |= {"elevator": 0.5 * (left + right), "aileron": 0.5 * (left - right)}
        names = ("elevator", "aileron", "rudder", "throttle")
        controls = np.column_stack([deflections.get(name, np.zeros(len(grid))) for name in names])
    # A surface that is commanded beyond its stop stays at the stop.
    controls = np.clip(controls, -stops, stops)
    height = _interpolate(log.height, grid)[:, 0]
    if len(log.ratio.time):
        ratio = _interpolate(log.ratio, grid)[:, 0]
    else:
        # True to equivalent airspeed: the air density of the standard atmosphere decreases with
        # (1 - 2.25577e-5 h)^4.25588, and the ratio is the inverse square root of the density relative to sea level.
        ratio = (1.0 - 2.25577e-5 * np.clip(height, -500.0, 9000.0)) ** -2.12794
    airspeed = _interpolate(log.airspeed, grid)[:, 0] * ratio
    inertial = _interpolate(log.inertial, grid)
    attitude = np.column_stack(
        [np.interp(grid, log.attitude.time, np.unwrap(angle)) for angle in log.attitude.values.T]
    )
    has_current = len(log.battery.time) > 10 and bool(np.any(log.battery.values[:, 1] > 0.5))
    battery = _interpolate(log.battery, grid) if has_current else np.full((len(grid), 2), np.nan)
    usable = _find_settled_flight(log, grid, airspeed / ratio, pulses) & (grid < until)
    velocity, wind = _interpolate(log.velocity, grid), _interpolate(log.wind, grid)
    usable = _cut_blocked_rows(log, usable, airspeed, velocity[:, :2] - wind, attitude[:, 2])
    flight = FlightRecord(
        time=grid,
        acceleration=inertial[:, :3],
        rates=inertial[:, 3:],
        attitude=attitude,
        velocity=velocity,
        wind=wind,
        airspeed=airspeed,
        density=1.225 / np.square(ratio),  # 1.225 kg/m^3 in the standard atmosphere at sea level
        height=height,
        controls=controls,
        current=battery[:, 1],
        voltage=battery[:, 0],
        source=log.source,
    )
    records = [flight.rows(slice(begin, end)) for begin, end in _find_segments(usable)]
    _check_duration(log, records, min_seconds, until, has_vtol_flight=bool(_find_vtol_rows(log, grid, pulses).any()))
    return records


def _check_duration(
    log: MotionLog, records: list[FlightRecord], min_seconds: float, until: float, *, has_vtol_flight: bool
) -> None:
    """Raise LogError if the segments are shorter in total than `min_seconds`.

    until: time in the log from which rows are not used, s.
    has_vtol_flight: True if the log contains flight on lifting motors, which was cut.
    """
    seconds = sum(record.seconds for record in records)
    if seconds < min_seconds:
        vtol_note = "; flight on lifting motors is not used" if has_vtol_flight else ""
        until_note = f" before {until:g} s" if math.isfinite(until) else ""
        message = f"only {seconds:.0f} s of usable wing-borne flight{until_note}{vtol_note}"
        allowed = f"at least {min_seconds:g} s are needed"
        if min_seconds == MIN_SECONDS:
            allowed += f" to identify an aircraft, and {MIN_CHECK_SECONDS:g} s to check one"
        allowed += f", in segments of at least {MIN_STRETCH:g} s without gaps"
        raise LogError(f"{log.source}: {message}: {allowed}", file=log.source, value=seconds, allowed=allowed)


# Message and quantity of each series, by autopilot.
_SERIES = {
    "ardupilot": {
        "inertial": "IMU, the inertial sensors",
        "outputs": "RCOU, the servo outputs",
        "attitude": "ATT, the attitude",
        "velocity": "XKF1, the velocity",
        "height": "POS, the height",
        "airspeed": "ARSP of a sensor in use (U = 1), the airspeed",
        "wind": "XKF2, the wind",
    },
    "px4": {
        "inertial": "sensor_combined, the inertial sensors",
        "outputs": "actuator_servos and actuator_motors, nor actuator_controls_0: actuator_outputs do not state"
        " which control an output moves",
        "attitude": "vehicle_attitude, the attitude",
        "velocity": "vehicle_local_position, the velocity",
        "height": "vehicle_global_position, the height",
        "airspeed": "airspeed_validated from a sensor in use, the airspeed",
        "wind": "wind, the wind",
    },
    "telemetry": {
        "inertial": "RAW_IMU, the inertial sensors",
        "outputs": "SERVO_OUTPUT_RAW, the servo outputs",
        "attitude": "ATTITUDE, the attitude",
        "velocity": "GLOBAL_POSITION_INT, the velocity",
        "height": "GLOBAL_POSITION_INT, the height",
        "airspeed": "VFR_HUD with the airspeed of a sensor, the airspeed",
        "wind": "WIND, the wind",
    },
    "columns": {
        "inertial": "acceleration_forward, _right, _down with roll_rate, pitch_rate, yaw_rate, the inertial sensors",
        "outputs": "elevator, aileron and throttle, the commands",
        "attitude": "roll, pitch and yaw, the attitude",
        "velocity": "velocity_north and velocity_east, the velocity",
        "height": "altitude, the height",
        "airspeed": "airspeed",
        "wind": "wind_north and wind_east, and no flight long enough to estimate the wind",
    },
}


def _check_usable(log: MotionLog) -> None:
    """Raise LogError for a log that no identification can use.

    Unusable are logs of other vehicles, logs without a required series, and logs in which a flap moves in flight.
    """
    if log.vehicle not in ("plane", "unknown"):
        raise LogError(f"{log.source}: flown by a {log.vehicle} ({log.program}): expected a plane", file=log.source)
    series_names = _SERIES[log.program_kind]
    for samples, name in ((log.inertial, "inertial"), (log.surface_commands, "outputs")):
        if len(samples.time) < 2:
            series = " and no ".join(log.missing.get(name, ())) or series_names[name]
            # The setting that records the missing series.
            if log.program_kind == "columns":
                hint = "expected in [columns] of its table"
            elif log.program_kind == "telemetry":
                hint = f"{describe_recording_setting(log)} send them"
            elif log.program_kind == "px4":
                setting = describe_recording_setting(log)
                hint = f"{setting}, the default set at a high rate, records them (PX4 1.14 or later)"
            else:
                mask = log.parameters.get("LOG_BITMASK")
                mask_text = "" if mask is None else f" (the log has {mask:.0f})"
                hint = f"{describe_recording_setting(log)} records them{mask_text}"
            raise LogError(f"{log.source}: no {series}: {hint}", file=log.source)
    for samples, name in ((log.attitude, "attitude"), (log.velocity, "velocity"), (log.height, "height")):
        if len(samples.time) < 2:
            raise LogError(f"{log.source}: no {series_names[name]}", file=log.source)
    air_series = ((log.airspeed, "airspeed"), (log.wind, "wind"))
    if missing := [series_names[name] for samples, name in air_series if len(samples.time) < 2]:
        raise LogError(f"{log.source}: no {'; no '.join(missing)}", file=log.source)
    if np.ptp(log.airspeed.values) == 0.0:
        message = (
            f"{log.source}: the airspeed stays at {log.airspeed.values[0, 0]:.3g} m/s: expected a sensor's airspeed"
        )
        raise LogError(message, file=log.source, field="airspeed")
    for number, function in _read_servo_functions(log).items():
        if function in _FLAPS:
            pulses = log.outputs.values[:, number - 1]
            pulses = pulses[pulses > 0.0]
            min_pulse, max_pulse = (float(pulses.min()), float(pulses.max())) if len(pulses) else (0.0, 0.0)
            # A flap moves if its pulses differ by more than 20 us.
            if max_pulse - min_pulse > 20.0:
                message = f"output {number} (SERVO{number}_FUNCTION {function}, {_FLAPS[function]}) moves in flight"
                raise LogError(f"{log.source}: {message}, but its effect is not modelled", file=log.source)


def find_slowest_log_rate(log: MotionLog) -> float:
    """Return the log rate of the inertial sensors or of the surface commands, whichever is lower, Hz."""
    return min(log.inertial.rate, log.surface_commands.rate)


def describe_recording_setting(log: MotionLog) -> str:
    """Return the setting that records sensors and outputs at a high rate, such as "LOG_BITMASK 65535"."""
    if log.program_kind in _RECORDING_SETTINGS:
        return _RECORDING_SETTINGS[log.program_kind]
    return f"SDLOG_PROFILE {_HIGH_RATE_PROFILE}" if log.program_kind == "px4" else f"LOG_BITMASK {_HIGH_RATE_BITMASK}"


def _read_servo_functions(log: MotionLog) -> dict[int, int]:
    """Return the function number of each servo output (SERVOn_FUNCTION), by output number.

    A log without these parameters has ArduPlane's defaults.
    """
    functions = {
        k: int(log.parameters[f"SERVO{k}_FUNCTION"])
        for k in range(1, log.outputs.values.shape[1] + 1)
        if f"SERVO{k}_FUNCTION" in log.parameters
    }
    return functions or {1: _AILERON, 2: _ELEVATOR, 3: _THROTTLE, 4: _RUDDER}


def _find_first_output(log: MotionLog, function: int) -> int:
    """Return the number of the first output whose SERVOn_FUNCTION is `function`.

    Returns 0 if there is no such output.
    """
    return next(
        (number for number, output_function in _read_servo_functions(log).items() if output_function == function), 0
    )


def log_outputs(log: MotionLog, aircraft: Aircraft) -> dict[str, ServoOutput]:
    """Return the servo output of each control, by the control's name.

    It follows from the log's SERVOn_* parameters.

    Full travel is the maximum deflection of the base aircraft.  In ArduPlane a longer pulse means roll to the right,
    nose up and yaw to the right; the model's elevator and rudder have the opposite sign.  Elevons are returned as
    `LEFT` and `RIGHT`, positive trailing edge down, in place of elevator and aileron.  Raises LogError for mixes that
    are not modelled, and for elevons if the base has a tail.
    """
    functions = _read_servo_functions(log)
    for number, kind in functions.items():
        if kind in _MIXED_FUNCTIONS:
            message = f"output {number} (SERVO{number}_FUNCTION {kind}) is one half of {_MIXED_FUNCTIONS[kind]}"
            raise LogError(f"{log.source}: {message}: this mix is not modelled", file=log.source)
    has_elevons = [kind in functions.values() for kind in (_ELEVON_LEFT, _ELEVON_RIGHT)]
    if any(has_elevons):
        _check_flying_wing_base(log, aircraft)
    if any(has_elevons) and not all(has_elevons):
        raise LogError(f"{log.source}: only one elevon; expected SERVOn_FUNCTION 77 and 78", file=log.source)
    outputs = {}
    for name, function, max_deflection in (
        ("elevator", _ELEVATOR, -aircraft.max_elevator),
        ("aileron", _AILERON, aircraft.max_aileron),
        ("rudder", _RUDDER, -aircraft.max_rudder),
        (LEFT, _ELEVON_LEFT, -aircraft.max_elevator),
        (RIGHT, _ELEVON_RIGHT, -aircraft.max_elevator),
    ):
        number = _find_first_output(log, function)
        if number:
            min_pulse, trim_pulse, max_pulse, sign = _read_pulse_travel(log, number)
            outputs[name] = ServoOutput(
                number, (min_pulse, trim_pulse, max_pulse), (-max_deflection * sign, 0.0, max_deflection * sign)
            )
    number = _find_first_output(log, _THROTTLE)
    if number:
        min_pulse, _, max_pulse, _ = _read_pulse_travel(log, number)
        outputs["throttle"] = ServoOutput(number, (min_pulse, max_pulse), (0.0, 1.0))
    for name in ("throttle",) if LEFT in outputs else ("elevator", "aileron", "throttle"):
        if name not in outputs:
            raise LogError(f"{log.source}: no output has the SERVOn_FUNCTION of the {name}", file=log.source)
    return outputs


def _check_flying_wing_base(log: MotionLog, aircraft: Aircraft) -> None:
    """Raise LogError if the base of an aircraft with elevons is not a flying wing."""
    if not is_flying_wing(aircraft):
        advice = "choose a flying wing as base: x8, zagi, or one made by planfly aircraft --new FOLDER --layout wing"
        message = f"flown with elevons, but the base {aircraft.name} has a tail: {advice}"
        raise LogError(f"{log.source}: {message}", file=log.source)


def _read_pulse_travel(log: MotionLog, number: int) -> tuple[float, float, float, float]:
    """Return the minimum, trim and maximum pulse, us, and the sign of a servo output.

    They are from the log's SERVOn parameters.

    The sign is -1 if the output is reversed, otherwise 1.

    number: number of the output, from 1.
    """
    get_parameter = log.parameters.get
    min_pulse = get_parameter(f"SERVO{number}_MIN", 1100.0)
    max_pulse = get_parameter(f"SERVO{number}_MAX", 1900.0)
    trim_pulse = min(max(get_parameter(f"SERVO{number}_TRIM", 1500.0), min_pulse + 1.0), max_pulse - 1.0)
    return min_pulse, trim_pulse, max_pulse, -1.0 if get_parameter(f"SERVO{number}_REVERSED", 0.0) > 0.0 else 1.0


def _interpolate(samples: Samples, grid: Floats) -> Floats:
    """Interpolate each column of the samples linearly at the times of the grid; return (n, columns)."""
    return np.column_stack([np.interp(grid, samples.time, column) for column in samples.values.T])


def _hold_samples(samples: Samples, grid: Floats) -> Floats:
    """Resample at the times of the grid, (n, columns): each sample holds until the next sample."""
    rows = np.clip(np.searchsorted(samples.time, grid, side="right") - 1, 0, len(samples.time) - 1)
    return np.asarray(samples.values[rows])


def _find_vtol_rows(log: MotionLog, grid: Floats, pulses: Floats) -> Flags:
    """Return a boolean mask (n,): True where lifting motors run or a VTOL mode is set.

    grid: times, (n,), s.
    pulses: pulses of the m servo outputs, (n, m), us.
    """
    rows = np.zeros(len(grid), np.bool_)
    for (start, number), (end, _) in zip(log.modes, (*log.modes[1:], (np.inf, 0)), strict=False):
        if number in _VTOL_MODES:
            rows |= (grid >= start) & (grid < end)
    for start, end in log.hovering:
        rows |= (grid >= start) & (grid < end)
    if not len(log.outputs.time) or log.parameters.get("Q_ENABLE", 0.0) <= 0.0:
        return rows
    for number, function in _read_servo_functions(log).items():
        if function in _LIFT_MOTORS:
            # A lifting motor runs at pulses above 1100 us.
            rows |= pulses[:, number - 1] > 1100.0
    return rows


def _find_settled_flight(log: MotionLog, grid: Floats, equivalent_airspeed: Floats, pulses: Floats) -> Flags:
    """Return a boolean mask (n,): True in settled wing-borne flight without gaps in the data.

    Gaps are pauses in sensors, surface commands, airspeed or wind.  The first `_SETTLING_TIME_S` of each segment are
    False.

    grid: times, (n,), s.
    equivalent_airspeed: airspeed at each time, (n,), m/s.
    pulses: pulses of the m servo outputs, (n, m), us.
    """
    # ARSPD_FBW_MIN is the name until ArduPlane 4.4, and 9 m/s its default.
    min_airspeed = log.parameters.get("AIRSPEED_MIN", log.parameters.get("ARSPD_FBW_MIN", 9.0))
    is_flying = (equivalent_airspeed > _MIN_AIRSPEED_FRACTION * min_airspeed) & ~_find_vtol_rows(log, grid, pulses)
    sensors = [
        (samples, _MAX_SENSOR_GAP_S) for samples in (log.inertial, log.surface_commands, log.attitude, log.velocity)
    ]
    wind_gap = _MAX_AIR_GAP_S if log.program_kind == "ardupilot" else _MAX_SLOW_WIND_GAP_S
    for samples, max_gap in (*sensors, (log.airspeed, _MAX_AIR_GAP_S), (log.wind, wind_gap)):
        steps = np.diff(samples.time)
        for k in np.flatnonzero(steps > max_gap):
            is_flying &= ~((grid > samples.time[k]) & (grid < samples.time[k + 1]))
    is_usable = is_flying.copy()
    for begin, end in _find_segments(is_flying, 0.0):
        is_usable[begin : min(end, begin + round(_SETTLING_TIME_S * GRID_HZ))] = False
    return is_usable


def _cut_blocked_rows(log: MotionLog, usable: Flags, airspeed: Floats, air_velocity: Floats, heading: Floats) -> Flags:
    """Return a mask (n,): the usable rows except those in which the airspeed sensor is blocked.

    In a window with a blocked sensor the airspeed hardly varies, although the ground velocity minus wind along the
    heading varies.  Raises LogError if too many usable rows are blocked.

    usable: True for each usable row, (n,).
    airspeed: measured airspeed, (n,), m/s.
    air_velocity: ground velocity minus wind, to north and east, (n, 2), m/s.
    heading: (n,), rad.
    """
    air_speed_ahead = air_velocity[:, 0] * np.cos(heading) + air_velocity[:, 1] * np.sin(heading)
    window_rows = round(_COMPARED_WINDOW_S * GRID_HZ)
    is_blocked = np.zeros(len(airspeed), np.bool_)
    # Windows overlap by nine tenths.
    for begin in range(0, len(airspeed) - window_rows + 1, window_rows // 10):
        rows = slice(begin, begin + window_rows)
        if airspeed[rows].std() < _BLOCKED_AIRSPEED_SD_MPS and air_speed_ahead[rows].std() > _MOVING_AIRSPEED_SD_MPS:
            is_blocked[rows] = True
    blocked_seconds = float((usable & is_blocked).sum()) / GRID_HZ
    seconds = float(usable.sum()) / GRID_HZ
    if blocked_seconds > _MAX_BLOCKED_FRACTION * seconds:
        shown = f"hardly varies for {blocked_seconds:.0f} s of {seconds:.0f} s of flight"
        allowed = "the ground velocity minus wind varies: check the sensor"
        raise LogError.at(log.source, "airspeed", blocked_seconds, allowed, shown=shown)
    return usable & ~is_blocked


def _find_segments(flags: Flags, min_duration: float = MIN_STRETCH) -> list[tuple[int, int]]:
    """Return (first row, end row) of each sequence of True rows that lasts at least `min_duration`, s.

    The end row is the first row after the sequence.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    runs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in runs if end - begin >= min_duration * GRID_HZ]
