"""Build the folder of an identified aircraft, with its model and accompanying files."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft, read_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.drag import NUISANCES
from aircraft.identification.draws import DRIVE_POWER, draw_aircraft, sample_power_factors
from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import PARAMETERS
from aircraft.identification.performance import GRAVITY, Performance, level_controls, max_level_speeds, performance
from aircraft.power_prior import EFFICIENCY_LOG_SD
from aircraft.uncertainty import Draws, draws_text
from flight.autopilots.arduplane.parameters import DEFINITIONS, ArduPilotParameters
from flight.autopilots.parameter_set import AIRCRAFT_FILE
from flight.dynamics.envelope_tables import load_envelope
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from flight.guidance.model_gains import gains_from_model, gains_text
from flight.mission_files.formats import waypoints_text
from logs.importers.motion import MotionLog
from planfly.identification.manoeuvres import make_identification_mission
from planfly.identification.model_text import format_identified_model
from planfly.identification.propulsion_check import PowerConflict, power_conflict
from planfly.identification.servos import ServoOutput
from world.arrays import Floats
from world.errors import LogError
from world.files import temporary_folder

# Altitude at which performance is stated, m AMSL.
AMSL = 480.0
# Density of the standard atmosphere at that altitude, kg/m^3 (ISO 2533).
DENSITY = 1.1695
# Throttle above which level flight is beyond the motor; the search for it ends just below 1.
_FULL_THROTTLE = 0.999
# Prefixes of the parameters of servo outputs and radio channels, which describe hardware.
_HARDWARE_PREFIXES = ("SERVO", "RC")
# Prefixes of the parameters that determine flight behaviour; other parameters describe hardware.
_FLIGHT_PREFIXES = (
    "AIRSPEED_",
    "ARSPD_FBW_",
    "TECS_",
    "NAVL1_",
    "RLL_RATE_",
    "PTCH_RATE_",
    "RLL2SRV_",
    "PTCH2SRV_",
    "YAW2SRV_",
    "KFF_",
    "ROLL_LIMIT_DEG",
    "PTCH_LIM_",
    "PTCH_TRIM_DEG",
    "SCALING_SPEED",
    "TRIM_THROTTLE",
    "THR_MIN",
    "THR_MAX",
    "THR_SLEWRATE",
    "WP_RADIUS",
    "WP_LOITER_RAD",
    "RTL_",
    "LEVEL_ROLL_LIMIT",
)


@dataclass(frozen=True, slots=True)
class Identified:
    """Results of an identification.

    base: the aircraft from which the identification started.
    numbers: model values of the base, scaled to the aircraft.
    draws: parameter values of 512 aircraft drawn from the estimate, (512, n).
    logs: the logs from which the aircraft was identified.
    outputs: servo output of each control.
    cruise: cruise airspeed, m/s, true.
    until: time in each log from which rows were not used, s; None if all rows were used.
    """

    base: Aircraft
    numbers: BaseModel
    estimate: Estimate
    draws: Floats
    logs: Sequence[MotionLog]
    outputs: Mapping[str, ServoOutput]
    cruise: float
    until: float | None = None

    def performance(self) -> tuple[Performance, Performance]:
        """Return the performance of the estimate, in arrays (1,), and of the draws, in arrays (512,)."""
        best, samples = (
            performance(self.numbers, values, self.cruise, DENSITY) for values in (self.estimate.values, self.draws)
        )
        return best, replace(samples, power=samples.power * self.drive_power)

    @property
    def drive_power(self) -> Floats:
        """Factor on the battery's power in each draw, (512,)."""
        return sample_power_factors(self.estimate, len(self.draws))

    def aircraft_draws(self) -> Draws:
        """Return the draws as values of the model's properties.

        If no current was logged, they include the factor on battery power.
        """
        properties = tuple(parameter.property_name for parameter in PARAMETERS)
        if self.estimate.with_current:
            return Draws(properties, self.draws)
        return Draws((*properties, DRIVE_POWER), np.column_stack([self.draws, self.drive_power]))

    def power_conflict(self) -> PowerConflict | None:
        """Return the conflict between estimated drag and estimated power in level flight.

        Return None without a conflict.
        """
        best, _ = self.performance()
        return power_conflict(float(best.drag[0]) * self.cruise, float(best.power[0]), self.numbers.mass)


def make_identification(
    base: Aircraft,
    numbers: BaseModel,
    estimate: Estimate,
    logs: Sequence[MotionLog],
    outputs: Mapping[str, ServoOutput],
    until: float | None = None,
) -> Identified:
    """Return the results of an identification, with 512 draws from its estimate.

    Also return the cruise speed of the last log.

    numbers: model values of the base, scaled to the aircraft.
    outputs: servo output of each control.
    until: time in each log from which rows were not used, s; None if all rows were used.
    """
    cruise = _find_airspeeds(logs[-1], base)[0]
    return Identified(base, numbers, estimate, draw_aircraft(estimate), logs, outputs, cruise, until)


def make_folder_files(identified: Identified, name: str, battery: tuple[float, float]) -> dict[str, str]:
    """Return the text of each file of an identified aircraft's folder, except the HTML page, by file name.

    The mission of manoeuvres starts at the home position of the last log that has one; without a home position it is
    left out.

    battery: voltage, V, and energy, J.
    Raises LogError if the identified model has no level flight at cruise.
    """
    xml = format_identified_model(identified.base, name, identified.numbers, identified.estimate.values)
    with temporary_folder("planfly-identified-") as parent:
        folder = parent / name
        folder.mkdir()
        (folder / f"{name}.xml").write_text(xml, encoding="utf-8")
        toml = folder / f"{name}.toml"
        toml.write_text(_format_metadata(identified, battery, 0.0), encoding="utf-8")
        _check_level_flight_at_cruise(identified, read_aircraft(folder))
        envelope = load_envelope(read_aircraft(folder))
        min_speed, max_speed = envelope.level_speeds(0.0)
        toml.write_text(_format_metadata(identified, battery, min_speed, max_speed), encoding="utf-8")
        aircraft = read_aircraft(folder)
        home = next((log.home for log in reversed(identified.logs) if log.home is not None), None)
        files = {
            f"{name}.xml": xml,
            f"{name}.toml": toml.read_text(encoding="utf-8"),
            "gains.toml": gains_text(gains_from_model(aircraft)),
        }
        if home is not None:
            parameters = select_flown_parameters(identified.logs[-1])
            rates = parameters.get("TECS_CLMB_MAX", math.inf), parameters.get("TECS_SINK_MAX", math.inf)
            mission = make_identification_mission(aircraft, envelope, *home, max_rates=rates)
            files["identify.waypoints"] = waypoints_text(mission)
    log, base_file = identified.logs[-1], identified.base.folder / AIRCRAFT_FILE
    parameters = select_flown_parameters(log)
    if not parameters:
        parameter_file = {AIRCRAFT_FILE: base_file.read_text(encoding="utf-8")} if base_file.is_file() else {}
    else:
        lines = [f"# Parameters of {Path(log.source).name} that determine flight; hardware parameters are left out."]
        lines += [f"{name} {value:.9g}" for name, value in sorted(parameters.items())]
        parameter_file = {AIRCRAFT_FILE: "\n".join(lines) + "\n"}
    servo_lines = ["# Servo output of each control, and the value of the control at each pulse.", ""]
    for control, output in identified.outputs.items():
        values = output.value if control == "throttle" else [math.degrees(angle) for angle in output.value]
        unit = "value" if control == "throttle" else "value_deg"
        servo_lines += [
            f"[{control}]",
            f"output = {output.output}",
            f"pulse_us = [{', '.join(f'{pulse:g}' for pulse in output.pulse)}]",
            f"{unit} = [{', '.join(f'{value:.6g}' for value in values)}]",
            "",
        ]
    return files | {
        **parameter_file,
        "ardupilot.toml": "\n".join(servo_lines),
        "posterior.toml": format_posterior(identified),
        "draws.csv": draws_text(identified.aircraft_draws()),
    }


def _check_level_flight_at_cruise(identified: Identified, aircraft: Aircraft) -> None:
    """Raise LogError, with the reason, if the identified model has no level flight at cruise."""
    if steady_flight(Fdm(aircraft), identified.cruise, AMSL) is not None:
        return
    numbers, source = identified.numbers, identified.logs[-1].source
    elevator, throttle = level_controls(numbers, identified.estimate.values, identified.cruise, DENSITY)
    stop = math.degrees(aircraft.max_elevator)
    if throttle > _FULL_THROTTLE:
        reason = "full throttle gives less thrust than its drag"
    elif abs(math.degrees(elevator)) > stop:
        reason = f"it needs {math.degrees(elevator):.0f} deg of elevator, beyond the stop at {stop:.0f} deg"
    else:
        lift = numbers.mass * GRAVITY / (0.5 * DENSITY * identified.cruise**2 * numbers.area)
        reason = f"it needs a lift coefficient of {lift:.2f}"
    message = f"the identified aircraft cannot fly level at {identified.cruise:.1f} m/s: {reason}"
    allowed = "check the mass, span and area of these logs, and the base"
    raise LogError(f"{source}: {message}: {allowed}", file=source, field="mass", value=numbers.mass, allowed=allowed)


def _find_airspeeds(log: MotionLog, base: Aircraft) -> tuple[float, float, float]:
    """Return cruise, minimum and maximum airspeed (m/s, true at `AMSL`) from a log's parameters.

    Airspeeds that the log does not state are those of the base.  ArduPlane's parameters are equivalent airspeeds.
    """
    parameters = select_flown_parameters(log)
    # Ratio of true to equivalent airspeed; 1.225 kg/m^3 is the density of the standard atmosphere at sea level.
    ratio = math.sqrt(1.225 / DENSITY)
    cruise, min_airspeed, max_airspeed = (
        parameters[name] * ratio if name in parameters else base_value
        for name, base_value in (
            ("AIRSPEED_CRUISE", base.airspeed),
            ("AIRSPEED_MIN", base.airspeed_min),
            ("AIRSPEED_MAX", base.airspeed_max),
        )
    )
    return cruise, min_airspeed, max_airspeed


def _format_metadata(
    identified: Identified, battery: tuple[float, float], min_level_speed: float, max_level_speed: float = math.inf
) -> str:
    """Return the text of the aircraft's TOML file with its metadata, which is named after the aircraft.

    battery: voltage, V, and energy, J.
    min_level_speed, max_level_speed: minimum and maximum airspeed of level flight, m/s.
    """
    base, get_parameter = identified.base, select_flown_parameters(identified.logs[-1]).get
    _, stated_min, stated_max = _find_airspeeds(identified.logs[-1], base)
    min_airspeed = max(min(stated_min, identified.cruise), min_level_speed + 0.1)
    cruise = max(identified.cruise, min_airspeed)
    max_airspeed = max(cruise, min(stated_max, max_level_speed))
    stall = min(min_level_speed if min_level_speed > 0.0 else base.stall_speed, min_airspeed)
    volts, energy = battery
    rows = {
        "mass_kg": identified.numbers.mass,
        "wing_area_m2": identified.numbers.area,
        "wing_span_m": identified.numbers.span,
        "airspeed_mps": cruise,
        "airspeed_min_mps": min_airspeed,
        "airspeed_max_mps": max_airspeed,
        "stall_speed_mps": stall,
        "max_bank_deg": get_parameter("ROLL_LIMIT_DEG", math.degrees(base.max_bank)),
        "max_pitch_deg": math.degrees(base.max_pitch),
        "max_elevator_deg": math.degrees(base.max_elevator),
        "max_aileron_deg": math.degrees(base.max_aileron),
        "max_rudder_deg": math.degrees(base.max_rudder),
        "surface_rate_deg_s": math.degrees(base.surface_rate),
        "surface_lag_s": base.surface_lag,
        "motor_lag_s": base.motor_lag,
        "battery_v": volts,
        "battery_wh": energy / 3600.0,
    }
    lines = [
        "# Data of the aircraft for planner, guidance and verdict; posterior.toml states what was estimated.",
        f'title = "aircraft of {identified.numbers.mass:.3g} kg, identified from flight logs"',
        *(f"{key} = {number:.6g}" for key, number in rows.items()),
    ]
    return "\n".join(lines) + "\n"


def select_flown_parameters(log: MotionLog) -> dict[str, float]:
    """Return the parameters of a log that determine flight behaviour.

    They have ArduPlane's current names and units.

    The log may use the names of ArduPlane 4.4 and earlier.  Values out of range are left out.
    """
    old_names = {definition.old[0] for definition in DEFINITIONS.values() if definition.old is not None}
    current_names = {definition.name for definition in DEFINITIONS.values()}
    law_parameters, _ = ArduPilotParameters.from_log(log.parameters, log.source)
    other_parameters = {
        name: value
        for name, value in log.parameters.items()
        if name.startswith(_FLIGHT_PREFIXES) and name not in old_names and name not in current_names
    }
    flight_parameters = other_parameters | law_parameters.by_origin("file")
    return {name: value for name, value in flight_parameters.items() if not name.startswith(_HARDWARE_PREFIXES)}


def format_posterior(identified: Identified) -> str:
    """Return the text of ``posterior.toml``: the estimated quantities, their correlation, and the logs."""
    estimate = identified.estimate
    _, samples = identified.performance()
    # Standard deviation of the logarithm; if it exceeds 1, nothing is known of the value.
    power = min(1.0, float(np.std(np.log(np.maximum(samples.power, 1.0)))))
    if (conflict := identified.power_conflict()) is not None:
        # The interval of 95 % extends to 1.96 standard deviations, here to the largest power.
        power = min(1.0, max(power, math.log(conflict.largest_power / conflict.power) / 1.96))
    climb, sink = (float(np.degrees(np.std(angles))) for angles in (samples.climb, samples.sink))
    fastest = max_level_speeds(identified.numbers, identified.draws, DENSITY)
    log_fractions = estimate.log_fractions()
    lines = [
        "# Result of the identification of this aircraft from flight logs.  Each quantity is a property of the model:",
        "# a factor on a coefficient of the base, or an offset to it.  Its value in the model is the estimate.",
        "",
        'source = "flight logs"',
        f"climb_sd_deg = {climb:.3f}    # of the steepest climb at cruise, one standard deviation",
        f"descent_sd_deg = {sink:.3f}  # of the steepest descent",
        f"fastest_sd_mps = {np.std(fastest):.3f}  # of the fastest level flight",
        f"power_sd = {power:.4f}        # of the logarithm of the power in level flight",
        f'base = "{identified.base.name}"',
        f"mass_kg = {identified.numbers.mass:.6g}",
        f"seconds = {estimate.seconds:.0f}",
        f"battery_current = {'true' if estimate.with_current else 'false'}",
        f"airspeed_factor = {estimate.airspeed[0]:.4f}  # true by measured airspeed, from the wind triangle",
        f"airspeed_factor_sd = {estimate.airspeed[1]:.4f}",
        f"dynamics = {'true' if estimate.dynamics else 'false'}",
        "held_fixed = [",
        *(f'  "{name}",' for name in (*estimate.shifts, *NUISANCES)),
        "]",
    ]
    for log in identified.logs:
        # Without backslashes and double quotes, the name needs no escapes in a TOML string.
        file_name = Path(log.source).name.replace("\\", "/").replace('"', "'")
        lines += ["", "[[log]]", f'file = "{file_name}"', f'sha256 = "{log.sha256}"']
        end = log.span[1] if identified.until is None else min(identified.until, log.span[1])
        lines += [f"from_s = {log.span[0]:.9g}  # earlier rows were not used"] if math.isfinite(log.span[0]) else []
        lines += [f"until_s = {end:.9g}  # later rows were not used"] if math.isfinite(end) else []
    for k, parameter in enumerate(PARAMETERS):
        numbers = parameter.prior, parameter.sd, estimate.values[k], estimate.sds[k], log_fractions[k]
        unit = "factor" if parameter.kind == "factor" else "1"
        lines += _format_quantity(parameter.property_name, unit, numbers, parameter.title)
    correlation = estimate.covariance / np.outer(estimate.sds, estimate.sds)
    if not estimate.with_current:
        numbers = 1.0, EFFICIENCY_LOG_SD, 1.0, EFFICIENCY_LOG_SD, 0.0
        lines += _format_quantity(
            DRIVE_POWER, "factor", numbers, "battery power of the motor, which only a logged current shows"
        )
        correlation = np.block([[correlation, np.zeros((len(correlation), 1))], [np.zeros(len(correlation)), 1.0]])
    lines += ["", "[correlation]", "# Rows and columns in the order of the quantities.", "matrix = ["]
    lines += [f"  [{', '.join(f'{value:.4f}' for value in row)}]," for row in correlation]
    return "\n".join([*lines, "]", ""])


def _format_quantity(name: str, unit: str, numbers: tuple[float, float, float, float, float], reason: str) -> list[str]:
    """Return the lines of a ``[[quantity]]`` table.

    name: name of the quantity's property in the model.
    unit: unit of the numbers.
    numbers: prior, standard deviation of the prior, estimate, standard deviation of the estimate, and the fraction of
        the prior variance that the logs removed.
    reason: sentence that says what the quantity is.
    """
    prior, prior_sd, value, sd, log_share = numbers
    return [
        "",
        "[[quantity]]",
        f'property = "{name}"',
        f'unit = "{unit}"',
        f"prior = {prior:g}",
        f"prior_sd = {prior_sd:g}",
        f"estimate = {value:.6g}",
        f"sd = {sd:.4g}",
        f"of_log = {log_share:.3f}  # fraction of the prior variance that the logs removed",
        f'reason = "{reason}"',
    ]
