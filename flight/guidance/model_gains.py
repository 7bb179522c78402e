"""Compute an aircraft's gains from its linear model and from typical values, within a second.

The gains of the airframe come from a linear model in level flight at cruise (500 m); the poles of the roll and pitch
loops are placed according to control power, as fast as servos and airspeed allow.
"""

import math
from dataclasses import fields, replace

import numpy as np

from aircraft.catalog import Aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import Trim, linearise, steady_flight
from flight.guidance.gains import Gains
from world.arrays import Floats
from world.errors import FlightError
from world.least_squares import least_squares

# Altitude of the linear model, m.
AMSL = 500.0
# Typical gains at an airspeed of 25 m/s, of the size that searches found for the Aerosonde
# (`benchmarks.tuning.tune_gains`): a slower aircraft reacts sooner, a faster aircraft later.
TYPICAL_GAINS = {
    "cross_track_frequency": 1.0,
    "cross_track_damping": 0.8,
    "cross_track_integral": 0.05,
    "turn_lead": 0.2,
    "turn_smoothing": 0.2,
    "aside_frequency": 1.0,
    "side_gain": 0.5,
    "side_lag": 0.1,
    "push_lead": 0.05,
    "push_smoothing": 0.1,
    "roll_frequency": 6.0,
    "roll_gain": 1.0,
    "roll_rate_gain": 0.1,
    "roll_disturbance_lag": 0.1,
    "aileron_lead": 0.03,
    "yaw_rate_gain": 0.2,
    "sideslip_gain": 0.5,
    "height_frequency": 1.0,
    "height_damping": 1.0,
    "height_integral": 0.1,
    "slope_lead": 0.2,
    "load_lead": 0.1,
    "pitch_rate_gain": 0.2,
    "speed_gain": 0.1,
    "speed_integral": 0.01,
    "throttle_per_slope": 2.0,
}
# Power of the airspeed ratio in the scale of a gain, by the suffix of its name.
_AIRSPEED_POWERS = {
    "frequency": -1,
    "lead": 1,
    "smoothing": 1,
    "lag": 1,
    "cross_track_integral": -3,
    "height_integral": -3,
}
# Phase of the servo lag at the bandwidth of the roll loop, rad.
_SERVO_PHASE_RAD = 0.4
# Damping ratio of the roll and pitch loops.
_DAMPING_RATIO = 0.8
# Throttle step in the search for the throttle at which the motor starts to draw current.
_THROTTLE_STEP = 0.02
# Limits that do not depend on the model.
_FIXED_GAINS = {
    "intercept": math.radians(35.0),
    "roll_rate_max": math.radians(80.0),
    "roll_acceleration_max": math.radians(400.0),
    "sideslip_max": 0.0,
    "arc_slowing_time": 5.0,
}


def gains_at_airspeed(airspeed: float) -> dict[str, float]:
    """Return `TYPICAL_GAINS` scaled from 25 m/s to another airspeed (m/s), by name.

    The gains of control surfaces are not changed here: the inner loops scale them with dynamic pressure in flight.
    """
    ratio = airspeed / 25.0
    gains: dict[str, float] = {}
    for name, value in TYPICAL_GAINS.items():
        power = next((power for suffix, power in _AIRSPEED_POWERS.items() if name.endswith(suffix)), 0)
        gains[name] = value * ratio**power
    return gains


def airframe_gains(aircraft: Aircraft, fdm: Fdm | None = None) -> dict[str, float]:
    """Compute the gains that follow from the airframe's linear model in level cruise, by name.

    fdm: the aircraft in JSBSim; None to load it.

    Raises FlightError if the aircraft cannot hold level flight at cruise.
    """
    fdm = Fdm(aircraft) if fdm is None else fdm
    return _gains_from_matrices(aircraft, *linearise(fdm, _level_cruise(aircraft, fdm)))


def _level_cruise(aircraft: Aircraft, fdm: Fdm) -> Trim:
    """Return the trim of level flight at cruise. Raises FlightError if no trim exists."""
    level = steady_flight(fdm, aircraft.airspeed, AMSL)
    if level is None:
        message = f"{aircraft.name} cannot hold level flight at {aircraft.airspeed:g} m/s and an altitude of {AMSL:g} m"
        raise FlightError(message, file=aircraft.model_file, field="airspeed", value=aircraft.airspeed)
    return level


def _gains_from_matrices(aircraft: Aircraft, a: Floats, b: Floats) -> dict[str, float]:
    """Return the gains that depend on the airframe, by name.

    a, b: matrices A and B of `flight.dynamics.trim.linearise`.
    """
    speed = aircraft.airspeed
    _, v, w, p, q, r = range(6)
    elevator, aileron, rudder = range(3)
    # Steady yaw rate without sideslip: ailerons and rudder balance the rolling and yawing moments of the yaw rate.
    has_rudder = abs(b[r, rudder]) > 1e-6
    rudder_per_yaw_rate = least_squares(b[np.ix_([p, r], [aileron, rudder])], -a[[p, r], r])[1] if has_rudder else 0.0
    return {
        "reference_airspeed": speed,
        "alpha_per_g": -9.80665 / (a[w, w] * speed),
        "elevator_per_alpha": -a[q, w] * speed / b[q, elevator],
        "elevator_per_pitch_rate": -a[q, q] / b[q, elevator],
        "aileron_per_roll_rate": -a[p, p] / b[p, aileron],
        "aileron_per_roll_acceleration": 1.0 / b[p, aileron],
        "rudder_per_yaw_rate": -float(rudder_per_yaw_rate),
        "side_per_sideslip": -a[v, v] * speed,
        "side_per_aileron": b[v, aileron],
    }


def idle_throttle(aircraft: Aircraft, fdm: Fdm, level: Trim) -> float:
    """Return the throttle (0..1) below which an electric motor gives no thrust in level flight.

    Below this throttle the motor draws no current. The throttle is found in steps of 0.02. The result is 0 for an
    aircraft without an electric motor.
    """
    fdm.move_to(level.amsl)
    for throttle in np.arange(0.0, level.throttle, _THROTTLE_STEP).tolist():
        fdm.apply_trim(replace(level, throttle=throttle).vector())
        if float(fdm.read().power) > 0.0 and aircraft.battery_voltage:
            return float(max(0.0, throttle - _THROTTLE_STEP))
    return 0.0


def gains_from_model(aircraft: Aircraft, fdm: Fdm | None = None) -> Gains:
    """Compute the gains of planfly's guidance for an aircraft from its linearised flight model.

    fdm: the aircraft in JSBSim; None to load it.

    Raises FlightError as `airframe_gains` does.
    """
    fdm = Fdm(aircraft) if fdm is None else fdm
    level = _level_cruise(aircraft, fdm)
    a, b = linearise(fdm, level)
    airframe = _gains_from_matrices(aircraft, a, b)
    gains = (
        gains_at_airspeed(aircraft.airspeed)
        | airframe
        | _FIXED_GAINS
        | {"throttle_idle": idle_throttle(aircraft, fdm, level)}
    )
    _, _, _, p, q, r = range(6)
    elevator, aileron, rudder = range(3)
    # Roll: two poles as fast as the servo allows.
    max_frequency = _SERVO_PHASE_RAD / aircraft.surface_lag
    frequency = min(max_frequency, gains["roll_frequency"])
    control_power, roll_damping = b[p, aileron], -a[p, p]
    gains["roll_frequency"] = frequency
    gains["roll_gain"] = frequency**2 / control_power
    gains["roll_rate_gain"] = max(0.2 * frequency, 2.0 * _DAMPING_RATIO * frequency - roll_damping) / control_power
    gains["roll_rate_max"] = min(gains["roll_rate_max"], 0.6 * aircraft.max_aileron * control_power / roll_damping)
    gains["roll_acceleration_max"] = min(gains["roll_acceleration_max"], 0.5 * aircraft.max_aileron * control_power)
    # Pitch: damping of the short period, up to the damping that the servo lag allows.
    stiffness = max(1.0, -a[q, 2] * aircraft.airspeed)
    missing_damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness) + a[q, q] + a[2, 2]
    gains["pitch_rate_gain"] = min(max(0.0, missing_damping), max_frequency) / -b[q, elevator]
    yaw_control_power = -b[r, rudder]
    if yaw_control_power > 1e-6:
        gains["yaw_rate_gain"] = 1.5 * gains["cross_track_frequency"] / yaw_control_power
        gains["sideslip_gain"] = 0.5
        gains["sideslip_max"] = math.radians(3.0)
    else:
        gains["yaw_rate_gain"] = gains["sideslip_gain"] = gains["side_gain"] = 0.0
    gains["slow_margin"] = 0.16 * aircraft.airspeed
    gains["arc_slowing_max"] = 0.08 * aircraft.airspeed
    return Gains(**gains)


# Unit suffixes of the keys in a file, by gain; gains without a suffix have no unit.
_UNIT_SUFFIXES = {
    "reference_airspeed": "_mps",
    "cross_track_frequency": "_rad_s",
    "cross_track_integral": "_1_s3",
    "turn_lead": "_s",
    "turn_smoothing": "_s",
    "aside_frequency": "_rad_s",
    "side_lag": "_s",
    "push_lead": "_s",
    "push_smoothing": "_s",
    "height_frequency": "_rad_s",
    "height_integral": "_1_s3",
    "slope_lead": "_s",
    "load_lead": "_s",
    "speed_gain": "_1_s",
    "speed_integral": "_1_s2",
    "roll_frequency": "_rad_s",
    "roll_rate_gain": "_s",
    "roll_disturbance_lag": "_s",
    "aileron_lead": "_s",
    "pitch_rate_gain": "_s",
    "yaw_rate_gain": "_s",
    "elevator_per_pitch_rate": "_s",
    "aileron_per_roll_rate": "_s",
    "aileron_per_roll_acceleration": "_s2",
    "rudder_per_yaw_rate": "_s",
    "side_per_sideslip": "_mps2",
    "side_per_aileron": "_mps2",
    "intercept": "_deg",
    "slow_margin": "_mps",
    "roll_rate_max": "_deg_s",
    "roll_acceleration_max": "_deg_s2",
    "sideslip_max": "_deg",
    "arc_slowing_time": "_s",
    "arc_slowing_max": "_mps",
}


def gains_text(gains: Gains) -> str:
    """Return gains as the text of a ``gains.toml``; gains with default values are left out."""
    defaults = {gain.name: gain.default for gain in fields(Gains)}
    lines = [
        "# Gains of the guidance and inner loops; flight/guidance/gains.py says what each means.",
        "# They follow from the linear model in level cruise by the rule of flight/guidance/model_gains.py.",
        "",
    ]
    for gain in fields(Gains):
        value, unit = getattr(gains, gain.name), _UNIT_SUFFIXES.get(gain.name, "")
        if value != defaults[gain.name]:
            shown_value = math.degrees(value) if "_deg" in unit else value
            lines.append(f"{gain.name}{unit} = {float(f'{shown_value:.4g}')!r}")
    return "\n".join(lines) + "\n"
