"""Check an estimate for impossible results.

Examples are reversed outputs, values at their bounds, and a changing mass.
"""

import math
from collections.abc import Sequence

import numpy as np

from aircraft.identification.base_model import BaseModel
from aircraft.identification.estimate import Estimate
from aircraft.identification.flight_record import FlightRecord
from aircraft.identification.parameters import INDEX, PARAMETERS
from world.errors import LogError

# Control of each parameter whose sign depends on the direction of a servo output.
_CONTROL_BY_PARAMETER = {"aileron-power": "aileron", "elevator-power": "elevator", "rudder-power": "rudder"}
# Minimum fraction of a parameter's information that the logs must contribute for its sign to be judged.
_MIN_LOG_FRACTION = 0.3
# Minimum and maximum plausible lift slope of a wing, per rad.
LIFT_SLOPE_RANGE = (3.0, 7.0)
# Maximum accepted change of mass within the logs, as a fraction.
MAX_MASS_CHANGE = 0.05
# Minimum change of mass that is reported, in standard deviations.
_MASS_CHANGE_SIGMAS = 4.0
# Minimum and maximum voltage of a battery in flight, as a ratio to its nominal voltage: 3.0 to 4.35 V of 3.7 V a cell.
_VOLTAGE_RATIO_RANGE = (0.75, 1.2)
# Least range of a throttle that moves.
_MIN_THROTTLE_RANGE = 0.01
# Least range of a surface's command in a flight with turns, rad; 60 degrees in the wrong unit are 1.05.
_MIN_SURFACE_RANGE_RAD = math.radians(1.2)
# Bank beyond which a flight has turns, rad.
_TURN_BANK_RAD = math.radians(15.0)
# Largest ratio of logged to identified battery power, in either direction; for 1 the fit is exact.
_MAX_POWER_RATIO = 1.5
# Duration of the blocks over which the trend of the mass is averaged, s.
_BLOCK_SECONDS = 30.0


def check_battery(records: Sequence[FlightRecord], volts: float) -> None:
    """Raise LogError if the median voltage of a record is impossible for a battery of the nominal voltage.

    volts: nominal voltage of the battery, V.
    """
    min_value, max_value = (ratio * volts for ratio in _VOLTAGE_RATIO_RANGE)
    for record in records:
        measured = float(np.median(record.voltage))
        if np.isfinite(measured) and not min_value <= measured <= max_value:
            allowed = (
                f"a battery of {volts:g} V has {min_value:.3g}..{max_value:.3g} V; state `battery`, or check the log"
            )
            raise LogError.at(record.source, "voltage", measured, allowed, shown=f"{measured:.3g} V in flight")


def check_commands(records: Sequence[FlightRecord]) -> None:
    """Raise LogError for a log whose controls hardly move.

    The throttle never moves, or elevator or aileron hardly move in turns.
    """
    for source in dict.fromkeys(record.source for record in records):
        parts = [record for record in records if record.source == source]
        controls = np.concatenate([part.controls for part in parts])
        max_bank = max(float(np.abs(part.attitude[:, 0]).max()) for part in parts)
        ranges = np.ptp(controls, axis=0)
        if ranges[3] < _MIN_THROTTLE_RANGE:
            throttle = float(controls[0, 3])
            reason = "the log holds no powered flight" if throttle < _MIN_THROTTLE_RANGE else "it never moves"
            raise LogError.at(source, "throttle", throttle, reason, shown=f"{throttle:.3g} in all rows of the flight")
        for name, surface_range in zip(("elevator", "aileron"), ranges.tolist(), strict=False):
            if surface_range < _MIN_SURFACE_RANGE_RAD and max_bank > _TURN_BANK_RAD:
                shown = f"moves by {math.degrees(surface_range):.2g} deg in all"
                bank_text = f"although the aircraft banks to {math.degrees(max_bank):.0f} deg"
                reason = f"{bank_text}: check unit (radians?) and scale of the {name}"
                raise LogError.at(source, name, surface_range, reason, shown=shown)


def check_power(estimate: Estimate, records: Sequence[FlightRecord], base: BaseModel) -> None:
    """Raise LogError if a log's mean battery power differs too much from the aircraft's power.

    The aircraft is the identified one.

    Without a logged current nothing is checked.
    """
    if not estimate.with_current:
        return
    factors = (float(estimate.values[INDEX[name]]) for name in ("thrust", "motor-speed", "propeller-torque"))
    motor = base.motor.with_factors(*factors)
    for source in dict.fromkeys(record.source for record in records):
        parts = [record for record in records if record.source == source]
        airspeed, throttle, density, voltage, current = (
            np.concatenate(columns)
            for columns in zip(
                *((part.airspeed, part.controls[:, 3], part.density, part.voltage, part.current) for part in parts),
                strict=True,
            )
        )
        _, model_current = motor.thrust_and_current(estimate.airspeed[0] * airspeed, throttle, density, voltage)
        ratio = float((voltage * current).mean() / (voltage * model_current).mean())
        if not 1.0 / _MAX_POWER_RATIO <= ratio <= _MAX_POWER_RATIO:
            shown = f"{current.mean():.3g} A on average, {ratio:.2g} times the current of the identified aircraft"
            raise LogError.at(source, "current", float(current.mean()), "check its unit and scale", shown=shown)


def check_estimate(estimate: Estimate, base: BaseModel, outputs: dict[str, int], source: str) -> None:
    """Raise LogError for an estimate with an implausible value.

    Implausible are a reversed control, a lift slope or a parameter outside its limits, and a changing mass.

    outputs: servo output number of each control that has its own output.
    source: name of the logs, for the one-line message.
    """
    log_fractions = estimate.log_fractions()
    for name, control in _CONTROL_BY_PARAMETER.items():
        k = INDEX[name]
        if estimate.values[k] < 0.0 and (
            log_fractions[k] > _MIN_LOG_FRACTION or estimate.values[k] < -2.0 * estimate.sds[k]
        ):
            output = outputs.get(control)
            if output is None:
                message = f"the {control} seems reversed: it moves the aircraft in the opposite direction"
                raise LogError(f"{source}: {message}", file=source, field=control)
            message = f"output {output} seems reversed: {control} moves the aircraft in the opposite direction"
            raise LogError(
                f"{source}: {message} (SERVO{output}_REVERSED)", file=source, field=f"SERVO{output}_REVERSED"
            )
    slope = base.coefficients.lift_alpha * estimate.values[INDEX["lift-slope"]]
    min_value, max_value = LIFT_SLOPE_RANGE
    if not min_value <= slope <= max_value:
        allowed = f"expected {min_value:g}..{max_value:g}; check the mass and wing area of these logs"
        raise LogError(
            f"{source}: lift slope {slope:.2f} per rad: {allowed}", file=source, value=slope, allowed=allowed
        )
    for parameter, value in zip(PARAMETERS, estimate.values.tolist(), strict=True):
        min_value, max_value = parameter.bounds
        if not min_value < value < max_value:
            allowed = f"allowed {min_value:g}..{max_value:g}"
            message = f"{parameter.title} ({parameter.name}) = {value:.2f} is at its bound: {allowed}"
            raise LogError(f"{source}: {message}", file=source, field=parameter.name, value=value, allowed=allowed)
    change, sd = estimate_mass_change(estimate, base)
    if abs(change) > MAX_MASS_CHANGE and abs(change) > _MASS_CHANGE_SIGMAS * sd:
        message = f"the mass seems to change by {100.0 * change:+.0f} % within the logs; it must stay the same"
        raise LogError(f"{source}: {message}", file=source, value=change)


def estimate_mass_change(estimate: Estimate, base: BaseModel) -> tuple[float, float]:
    """Return the estimated change of mass within the logs, as a fraction, and its standard deviation.

    An aircraft that burns fuel or drops a load needs less and less angle of attack than its assumed mass requires.  The
    change is the trend of the measured minus the predicted angle of attack, divided by the predicted angle above zero
    lift.  Returns 0 and infinity if the logs are too short.
    """
    equation = estimate.equations[0]
    c = base.coefficients
    slope = c.lift_alpha * estimate.values[INDEX["lift-slope"]]
    zero_lift_angle = -(c.lift_zero + estimate.values[INDEX["lift-offset"]]) / slope
    length = round(_BLOCK_SECONDS * equation.hertz)
    count = len(equation.measured) // length
    # Fewer than six blocks are too few for a trend.
    if count < 6:
        return 0.0, np.inf
    # The divisor is at least 0.02 rad, because near zero lift the relative error would grow without limit.
    relative_error = (equation.measured - equation.predicted) / np.maximum(0.02, equation.predicted - zero_lift_angle)
    means = relative_error[: count * length].reshape(count, length).mean(axis=1)
    time = (np.arange(count) + 0.5) / count - 0.5
    trend = float(time @ means / (time @ time))
    residuals = means - means.mean() - trend * time
    sd = float(np.sqrt(residuals @ residuals / (count - 2) / (time @ time)))
    return trend, sd
