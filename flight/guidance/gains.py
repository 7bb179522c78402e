"""The gains that fit the guidance to an aircraft, read from ``aircraft/<name>/gains.toml``."""

import math
from dataclasses import MISSING, asdict, dataclass, fields

import numpy as np

from aircraft.catalog import Aircraft
from world.errors import FlightError
from world.files import did_you_mean, read_toml
from world.kernels import Record, record_dtype

GAINS_FILE = "gains.toml"


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of the guidance core, in SI and radians.

    Of the airframe and of the height:

    reference_airspeed: the airspeed at which surface gains hold; they are scaled with dynamic pressure.
    height_frequency, height_damping, height_integral: of the second-order law on the height's error.
    slope_lead: how far ahead the path's slope is fed forward.
    load_lead: how far ahead the lift is asked for the bank.
    alpha_per_g: angle of attack for the weight.
    elevator_per_alpha, elevator_per_pitch_rate: what holds an angle of attack and a pitch rate.
    pitch_rate_gain: damping.

    Of the airspeed:

    speed_gain, speed_integral: throttle per m/s.
    throttle_per_slope: throttle per rad of climb.
    throttle_idle: at which the motor begins to give thrust at the reference airspeed; the integral is not led below it.
    slow_margin: below command less this, height gives way to speed.
    arc_slowing_time, arc_slowing_max: so long before an arc, and by so much, the airspeed gives way to a ground speed
    that the arc can be flown with.

    Across the path:

    cross_track_frequency, cross_track_damping, cross_track_integral: of the second-order cross-track law.
    intercept: steepest course to the path that it flies when far away.
    turn_lead, turn_smoothing: how far ahead the path's curvature is fed forward, and over how long it is averaged about
    there.
    aside_frequency: how fast the aircraft goes back to the path from where rolling into an arc took it.
    side_gain, side_lag: how much of the sideways acceleration that bank and ailerons do not explain is answered, and
    its lag.
    push_lead, push_smoothing: how far ahead a correction is asked for, as the bank comes late, by its rate of change,
    and over how long that is smoothed.
    side_per_sideslip, side_per_aileron: sideways acceleration, m/s^2 a rad.
    sideslip_max: skid where the bank ends.

    In roll and yaw:

    roll_frequency, roll_rate_max, roll_acceleration_max: of the model roll that the aircraft follows.
    roll_gain, roll_rate_gain: aileron per rad and rad/s that it differs from it.
    roll_disturbance_lag: of the estimate of what else rolls it.
    aileron_lead: the ailerons' own lag.
    aileron_per_roll_rate, aileron_per_roll_acceleration: what rolls the airframe.
    rudder_per_yaw_rate: what turns it without sideslip.
    yaw_rate_gain: damping.
    sideslip_gain: rudder per rad of sideslip.

    Of the reference laws, which have defaults, as have those that an aircraft can do without:

    l1_period, l1_damping, l1_integral: ArduPlane's NAVL1_PERIOD, NAVL1_DAMPING and NAVL1_XTRACK_I, and its defaults.
    field_approach: course to the path far from it.
    field_path, field_orbit: how the vector field closes in on a line and on an orbit.
    field_course, field_course_integral: bank per course error.
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
        """The gains for compiled code, as a record of `GAINS`."""
        record: Record = np.zeros(1, GAINS)[0]
        for name, value in asdict(self).items():
            setattr(record, name, value)
        return record


GAINS = record_dtype(*(item.name for item in fields(Gains)))

# Suffixes that a key may carry, the longer first, and what takes the value to SI and radians.
_DEG = math.radians(1.0)
_UNITS = {
    **{"_deg_s2": _DEG, "_deg_s": _DEG, "_deg": _DEG},
    **dict.fromkeys(("_rad_s", "_1_s3", "_1_s2", "_1_s", "_1_m", "_mps2", "_mps", "_s2", "_s"), 1.0),
}


def load_gains(aircraft: Aircraft) -> Gains:
    """Read the gains that stand beside an aircraft's model.  Raises FlightError for a missing, unknown or bad entry.

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
        unit = next((unit for unit in _UNITS if key.endswith(unit)), "")
        values[key.removesuffix(unit)] = float(value) * _UNITS.get(unit, 1.0)
    known = {item.name for item in fields(Gains)}
    wanted = {item.name for item in fields(Gains) if item.default is MISSING}
    missing, unknown = sorted(wanted - set(values)), sorted(set(values) - known)
    if missing or unknown:
        raise FlightError(
            f"{file}: missing {', '.join(missing) or 'nothing'}; unknown {', '.join(unknown) or 'nothing'}"
            f"{did_you_mean(unknown[0], sorted(known - set(values))) if unknown else ''}",
            file=file,
            field=(missing + unknown)[0],
        )
    return Gains(**values)
