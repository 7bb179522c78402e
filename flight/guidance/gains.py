"""Read the gains of guidance and inner loops for an aircraft from ``aircraft/<name>/gains.toml``."""

import math
from dataclasses import MISSING, asdict, dataclass, fields

import numpy as np

from aircraft.catalog import Aircraft
from world.errors import FlightError
from world.files import did_you_mean, read_toml
from world.kernels import Record, record_dtype

# Name of the file of gains in an aircraft's folder.
GAINS_FILE = "gains.toml"


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of guidance and inner loops, in SI units and radians.

    Altitude:

    reference_airspeed: airspeed at which surface gains apply; they are scaled with dynamic pressure.
    height_frequency, height_damping, height_integral: second-order altitude law.
    slope_lead: lead time of the path's slope in the feedforward.
    load_lead: lead time of the predicted bank for which the elevator provides lift.
    alpha_per_g: angle of attack that carries the aircraft's weight.
    elevator_per_alpha, elevator_per_pitch_rate: elevator that holds an angle of attack and a pitch rate.
    pitch_rate_gain: pitch damping.

    Airspeed:

    speed_gain, speed_integral: throttle per m/s of airspeed error, and per m of its integral.
    throttle_per_slope: throttle per rad of climb.
    throttle_idle: throttle at which the motor starts to give thrust at the reference airspeed; lower limit of the
        integrator.
    slow_margin: airspeed below the command at which guidance gives up altitude to regain airspeed.
    arc_slowing_time, arc_slowing_max: time before an arc at which the airspeed is reduced to a ground speed at which
        the arc can be flown, and maximum reduction.

    Cross-track:

    cross_track_frequency, cross_track_damping, cross_track_integral: second-order cross-track law.
    intercept: maximum angle between course and path, far from the path.
    turn_lead, turn_smoothing: lead time of the path's curvature in the feedforward, and averaging time about that
        point.
    aside_frequency: frequency of the return to the path from the offset that rolling into an arc causes.
    side_gain, side_lag: gain and lag of the compensation of lateral acceleration that bank and ailerons do not explain.
    push_lead, push_smoothing: lead time of the lateral correction, which compensates the lag of the bank, and smoothing
        time of the correction's rate of change.
    side_per_sideslip, side_per_aileron: lateral acceleration, m/s^2 per rad.
    sideslip_max: skid at the bank limit.

    Roll and yaw:

    roll_frequency, roll_rate_max, roll_acceleration_max: model roll that the aircraft follows.
    roll_gain, roll_rate_gain: aileron per rad and rad/s of error from the model roll.
    roll_disturbance_lag: lag of the estimate of other roll disturbances.
    aileron_lead: lag of the ailerons.
    aileron_per_roll_rate, aileron_per_roll_acceleration: ailerons that hold a roll rate and a roll acceleration.
    rudder_per_yaw_rate: rudder for a yaw rate without sideslip.
    yaw_rate_gain: yaw damping.
    sideslip_gain: rudder per rad of sideslip.

    Reference laws; their gains have defaults, like other gains that an aircraft may omit:

    l1_period, l1_damping, l1_integral: ArduPlane's NAVL1_PERIOD, NAVL1_DAMPING and NAVL1_XTRACK_I, and its defaults.
    field_approach: angle of approach to the path from far away.
    field_path, field_orbit: convergence of the vector field on a line and on an orbit.
    field_course, field_course_integral: bank per course error, and per integral of the course error.
    """

    reference_airspeed: float
    cross_track_frequency: float
    cross_track_damping: float
    cross_track_integral: float
    intercept: float
    turn_lead: float
    turn_smoothing: float
    height_frequency: float
    height_damping: float
    height_integral: float
    slope_lead: float
    speed_gain: float
    speed_integral: float
    throttle_per_slope: float
    slow_margin: float
    roll_gain: float
    roll_rate_gain: float
    aileron_per_roll_rate: float
    aileron_per_roll_acceleration: float
    alpha_per_g: float
    elevator_per_alpha: float
    elevator_per_pitch_rate: float
    pitch_rate_gain: float
    yaw_rate_gain: float
    l1_period: float = 17.0
    l1_damping: float = 0.75
    l1_integral: float = 0.02
    field_approach: float = math.radians(60.0)
    field_path: float = 0.05
    field_orbit: float = 4.0
    field_course: float = 2.0
    field_course_integral: float = 0.2
    side_gain: float = 0.0
    side_lag: float = 0.3
    roll_frequency: float = 5.0
    roll_rate_max: float = math.radians(40.0)
    roll_acceleration_max: float = math.radians(150.0)
    roll_disturbance_lag: float = 0.3
    aileron_lead: float = 0.0
    load_lead: float = 0.0
    side_per_aileron: float = 0.0
    rudder_per_yaw_rate: float = 0.0
    sideslip_gain: float = 0.0
    side_per_sideslip: float = 0.0
    sideslip_max: float = 0.0
    arc_slowing_time: float = 4.0
    arc_slowing_max: float = 0.0
    aside_frequency: float = 1.0
    push_lead: float = 0.0
    push_smoothing: float = 0.1
    throttle_idle: float = 0.0

    def record(self) -> Record:
        """Return the gains for compiled code, as a record of `GAINS`."""
        record: Record = np.zeros(1, GAINS)[0]
        for name, value in asdict(self).items():
            setattr(record, name, value)
        return record


# Record of the fields of `Gains`, for compiled code.
GAINS = record_dtype(*(gain.name for gain in fields(Gains)))

# Factor of an angle in degrees.
_DEG_TO_RAD = math.radians(1.0)
# Suffixes that a key may carry, longer ones first, and the factor to SI units and radians.
_UNIT_FACTORS = {
    **{"_deg_s2": _DEG_TO_RAD, "_deg_s": _DEG_TO_RAD, "_deg": _DEG_TO_RAD},
    **dict.fromkeys(("_rad_s", "_1_s3", "_1_s2", "_1_s", "_1_m", "_mps2", "_mps", "_s2", "_s"), 1.0),
}


def load_gains(aircraft: Aircraft) -> Gains:
    """Read the gains of an aircraft from its folder. Raises FlightError for a missing or invalid entry.

    An unknown entry is invalid.

    >>> from aircraft.catalog import load_aircraft
    >>> load_gains(load_aircraft("aerosonde")).reference_airspeed
    25.0
    """
    file = aircraft.folder / GAINS_FILE
    try:
        table = read_toml(file, "gains")
    except OSError as error:
        raise FlightError(f"{file}: {error.strerror}: guidance needs gains for {aircraft.name}", file=file) from error
    except ValueError as error:
        raise FlightError(f"{file}: {' '.join(str(error).split())}", file=file) from error
    values: dict[str, float] = {}
    for key, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise FlightError(f"{file}: {key} = {value!r} is not a finite number", file=file, field=key, value=value)
        unit = next((unit for unit in _UNIT_FACTORS if key.endswith(unit)), "")
        values[key.removesuffix(unit)] = float(value) * _UNIT_FACTORS.get(unit, 1.0)
    gain_names = {gain.name for gain in fields(Gains)}
    required_names = {gain.name for gain in fields(Gains) if gain.default is MISSING}
    missing, unknown = sorted(required_names - set(values)), sorted(set(values) - gain_names)
    if missing or unknown:
        faults = [f"{kind} {', '.join(names)}" for kind, names in (("missing", missing), ("unknown", unknown)) if names]
        hint = did_you_mean(unknown[0], sorted(gain_names - set(values))) if unknown else ""
        raise FlightError(
            f"{file}: {'; '.join(faults)}{hint}",
            file=file,
            field=(missing + unknown)[0],
        )
    return Gains(**values)
