"""Make an aircraft's folder from a data sheet: model, metadata, gains, parameters, uncertainty."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft, check_new_folder, read_aircraft, write_aircraft_folder
from aircraft.data_sheet import (
    FUEL_HEAT,
    MAX_CLIMB,
    RANGES,
    SEA_LEVEL,
    SHEET_DENSITY,
    DataSheet,
    SizedAircraft,
    check_sheet,
    size_aircraft,
)
from aircraft.envelope import GRAVITY, UNDECIDED_SIGMAS, turn_radius
from aircraft.model_writer import FACTORS, POWER_FACTORS, Layout, model_xml
from aircraft.power_prior import (
    AVIONICS_LOG_SD,
    EFFICIENCY_LOG_SD,
    INDUCED_DRAG_LOG_SD,
    MIN_DRAG_LOG_SD,
    power_log_sd,
)
from aircraft.propulsion import ElectricMotor
from aircraft.uncertainty import (
    DRAW_COUNT,
    DRAWS_FILE,
    SHEET_SOURCE,
    Draws,
    UncertainQuantity,
    Uncertainty,
    draw_quantities,
    draws_text,
    uncertainty_text,
)
from flight.autopilots.arduplane.parameters import DEFINITIONS
from flight.autopilots.parameter_files import Entry
from flight.autopilots.parameter_origin import (
    ARDUPILOT,
    PX4,
    read_origin,
    read_parameters_for,
    refuse_unknown_parameters,
)
from flight.autopilots.px4.parameters import FROM_ARDUPILOT
from flight.autopilots.px4.parameters import TABLE as PX4_TABLE
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import (
    Simulator,
    Trim,
    fastest_level_flight,
    full_throttle_climb,
    idle_descent,
    linearise,
    slowest_level_flight,
    steady_flight,
)
from flight.guidance.model_gains import AMSL, gains_from_model, gains_text, idle_throttle
from world.arrays import Floats
from world.errors import FlightError
from world.files import temporary_folder

# ----------------------------------------------------------------------
# Read the values of a parameter file that describe the aircraft: the bank limit, and what differs from the defaults.

# Parameters of ArduPlane that describe an aircraft.  Their equivalent airspeeds are used as the airspeeds of the sheet.
_USED_PARAMETERS = (
    *("AIRSPEED_CRUISE", "AIRSPEED_MIN", "AIRSPEED_MAX", "TRIM_THROTTLE"),
    *("TECS_CLMB_MAX", "THR_MAX", "TECS_SINK_MIN", "ROLL_LIMIT_DEG"),
)
# PX4's stall speed, and its default, m/s (`fw_pos_control_params.c`).
_PX4_STALL = ("FW_AIRSPD_STALL", 7.0)
# Ratio of AIRSPEED_MIN to the stall speed.
_MIN_AIRSPEED_STALL_RATIO = 1.2
# Value of the data sheet that each parameter corresponds to.  Limits of the autopilot that may be below the aircraft's
# limits, such as AIRSPEED_MAX, are not used for the sheet.
_SHEET_FIELDS = {
    "AIRSPEED_CRUISE": "cruise",
    "AIRSPEED_STALL": "stall",
    "AIRSPEED_MIN": "stall",
    "TECS_CLMB_MAX": "climb",
    "ROLL_LIMIT_DEG": "bank",
}
# Ratios of parameters to the values of the sheet, if not 1.
_SHEET_RATIOS = {"AIRSPEED_MIN": _MIN_AIRSPEED_STALL_RATIO}
_SETTINGS = ("AIRSPEED_CRUISE", "ROLL_LIMIT_DEG")


@dataclass(frozen=True, slots=True)
class AircraftParameters:
    """Parameters of an autopilot's file that describe the aircraft.

    values: value of each parameter in ArduPlane's unit, by its current ArduPlane name.  AIRSPEED_STALL is only read
        from PX4 files.
    texts: name and value as written in the file, by the same names.
    """

    values: Mapping[str, float]
    texts: Mapping[str, str]


def read_aircraft_parameters(file: Path) -> AircraftParameters:
    """Read the parameters of an ArduPlane or PX4 file that describe the aircraft.

    Parameters at their defaults are left out, except the bank limit.

    Raises ParameterError if the file cannot be read, is for another vehicle, or has only names that neither autopilot
    knows.
    """
    autopilot = read_origin(file).autopilot or ARDUPILOT
    entries = read_parameters_for(file, autopilot)
    values: dict[str, float] = {}
    texts: dict[str, str] = {}
    for name in (*_USED_PARAMETERS, "AIRSPEED_STALL"):
        # Value and default in ArduPlane's unit, and text of the parameter; None if it is not in the file.
        entry: tuple[float, float, str] | None = None
        if autopilot == PX4:
            px4_name, factor = (_PX4_STALL[0], 1.0) if name == "AIRSPEED_STALL" else FROM_ARDUPILOT[name]
            if px4_name in entries:
                default = _PX4_STALL[1] if px4_name == _PX4_STALL[0] else PX4_TABLE.by_name[px4_name].default
                value = entries[px4_name].value
                entry = (value / factor, default / factor, f"{px4_name} {value:g}")
        else:
            entry = _arduplane_value(entries, name)
        if entry is None:
            continue
        # A default describes no aircraft, but a stated bank limit is the limit with which the autopilot flies.
        if name == "ROLL_LIMIT_DEG" or abs(entry[0] - entry[1]) > 1e-6 * max(1.0, abs(entry[1])):
            values[name], texts[name] = entry[0], entry[2]
    refuse_unknown_parameters(file, autopilot, entries, values)
    return AircraftParameters(values, texts)


def _arduplane_value(entries: Mapping[str, Entry], name: str) -> tuple[float, float, str] | None:
    """Return value, default and text ("NAME value") of an ArduPlane parameter; None if not in the file.

    entries: entries of the parameter file, by name; it may state the parameter under its former name.
    """
    definition = next((candidate for candidate in DEFINITIONS.values() if candidate.name == name), None)
    if definition is None or name not in _USED_PARAMETERS:
        return None
    if name in entries:
        return entries[name].value, definition.default, f"{name} {entries[name].value:g}"
    if definition.old is None or definition.old[0] not in entries:
        return None
    old_name, unit_factor = definition.old
    return entries[old_name].value * unit_factor, definition.default, f"{old_name} {entries[old_name].value:g}"


def overridden_texts(numbers: Mapping[str, float | None], parameters: AircraftParameters) -> list[str]:
    """Return a text for each parameter of a file that is not used.

    The data sheet states another value.

    numbers: numbers of the data sheet by keyword, in the units of the options; None or 0 if not stated.

    >>> overridden_texts({"cruise": 18.0}, AircraftParameters({"AIRSPEED_CRUISE": 19.0}, {"AIRSPEED_CRUISE": "A 19"}))
    ['A 19 (cruise 18 m/s)']
    """
    return [
        f"{parameters.texts[name]} ({field} {numbers[field]:g} {RANGES[field][1]})"
        for name, field in _SHEET_FIELDS.items()
        if name in parameters.values
        and (number := numbers.get(field))
        and (field == "climb" or not math.isclose(number, parameters.values[name] / _SHEET_RATIOS.get(name, 1.0)))
    ]


def with_parameters(sheet: DataSheet, parameters: Mapping[str, float]) -> DataSheet:
    """Return a data sheet whose missing values are filled from parameters.

    parameters: values by ArduPlane's names, in ArduPlane's units.
    TECS_CLMB_MAX is the climb rate with the throttle at THR_MAX (libraries/AP_TECS/AP_TECS.cpp).

    >>> sheet = DataSheet(2.1, 1.6, 0.0, 0.0)
    >>> filled = with_parameters(sheet, {"AIRSPEED_CRUISE": 15.0, "AIRSPEED_MIN": 12.0, "TECS_CLMB_MAX": 3.0})
    >>> filled.cruise, filled.stall, round(math.degrees(filled.climb), 2)
    (15.0, 10.0, 11.54)
    """
    filled = replace(
        sheet,
        cruise=sheet.cruise or parameters.get("AIRSPEED_CRUISE", 0.0),
        stall=sheet.stall
        or parameters.get("AIRSPEED_STALL", parameters.get("AIRSPEED_MIN", 0.0) / _MIN_AIRSPEED_STALL_RATIO),
        bank=sheet.bank or math.radians(parameters.get("ROLL_LIMIT_DEG", 0.0)),
        trim_throttle=sheet.trim_throttle or 0.01 * parameters.get("TRIM_THROTTLE", 0.0),
        sink=sheet.sink or parameters.get("TECS_SINK_MIN", 0.0),
    )
    climb = parameters.get("TECS_CLMB_MAX", 0.0)
    if not filled.climb and climb and filled.cruise > climb:
        climb_throttle = 0.01 * parameters.get("THR_MAX", 100.0)
        filled = replace(filled, climb=math.asin(climb / filled.cruise), climb_throttle=climb_throttle)
    return filled


# ----------------------------------------------------------------------
# Make a data sheet from user input in degrees, inches, volts and ampere hours.

# Length of an inch, m.
_METERS_PER_INCH = 0.0254
# Voltage and capacity of a battery, such as 14.8V,5Ah.
_BATTERY_PATTERN = re.compile(r"([0-9.]+)\s*V\s*,\s*([0-9.]+)\s*(Ah|Wh|mAh)", re.IGNORECASE)
# Diameter and pitch of a propeller in inches, such as 12x6.
_PROPELLER_PATTERN = re.compile(r"([0-9.]+)\s*[xX]\s*([0-9.]+)")
# Accepted battery voltages, V.
_VOLTAGE_RANGE_V = (3.0, 60.0)
# Accepted battery capacities, Wh.
_ENERGY_RANGE_WH = (0.5, 5000.0)
# Least time in which level flight empties a battery, s: 60 times its capacity per hour, which no battery delivers.
_MIN_ENDURANCE_S = 60.0
# Accepted propeller diameters, inches.
_DIAMETER_IN = (3.0, 40.0)


def parse_sheet(
    numbers: Mapping[str, float | None], *, battery: str | None, prop: str | None, layout: str | None
) -> DataSheet:
    """Make a data sheet from command-line options.

    numbers: value by option, in the units of `RANGES` (angles in degrees); None if not given.
    battery, prop, layout: texts such as "14.8V,5Ah", "12x6" and "wing"; None if not given.
    Raises FlightError with a one-line message for input that cannot be read.

    >>> sheet = parse_sheet({"mass": 2.1, "climb": 10.0}, battery="14.8V,5Ah", prop="12x6", layout="wing")
    >>> round(sheet.climb, 4), sheet.volts, round(sheet.energy / 3600.0), round(sheet.propeller[0], 4)
    (0.1745, 14.8, 74, 0.3048)
    """
    values = {}
    for name, value in numbers.items():
        if value is None:
            continue
        _, unit, min_value, max_value, factor = RANGES[name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not min_value <= value <= max_value:
            allowed = f"allowed {min_value:g}..{max_value:g} {unit}"
            raise FlightError.of_argument(name, value, allowed, shown=f"{value} {unit}")
        values[name] = value * factor
    volts, watt_hours = 0.0, 0.0
    if battery is not None:
        match = _BATTERY_PATTERN.fullmatch(battery.strip())
        volts, capacity = (_parse_number(match[k]) for k in (1, 2)) if match else (math.nan, math.nan)
        unit = match[3].lower() if match else ""
        watt_hours = capacity if unit == "wh" else volts * capacity * (0.001 if unit == "mah" else 1.0)
        (min_volts, max_volts), (min_energy, max_energy) = _VOLTAGE_RANGE_V, _ENERGY_RANGE_WH
        if not (min_volts <= volts <= max_volts and min_energy <= watt_hours <= max_energy):
            allowed = (
                f"expected volts and capacity, such as 14.8V,5Ah; allowed {min_volts:g}..{max_volts:g}"
                f" V, {min_energy:g}..{max_energy:g} Wh"
            )
            raise FlightError.of_argument("battery", battery, allowed)
    diameter, pitch = 0.0, 0.0  # inches
    if prop is not None:
        match = _PROPELLER_PATTERN.fullmatch(prop.strip())
        diameter, pitch = (_parse_number(match[k]) for k in (1, 2)) if match else (math.nan, math.nan)
        if not (_DIAMETER_IN[0] <= diameter <= _DIAMETER_IN[1] and 0.25 * diameter <= pitch <= 1.5 * diameter):
            allowed = (
                "expected diameter and pitch in inches, such as 12x6; allowed: a diameter of"
                f" {_DIAMETER_IN[0]:g}..{_DIAMETER_IN[1]:g}, and a pitch of 0.25 to 1.5 times the diameter"
            )
            raise FlightError.of_argument("prop", prop, allowed)
    propeller = (diameter * _METERS_PER_INCH, pitch * _METERS_PER_INCH)
    layouts: dict[str, Layout] = {"tail": "tail", "wing": "wing", "vtail": "vtail"}
    if layout is not None and layout not in list(layouts):
        raise FlightError.of_argument("layout", layout, f"expected {', '.join(layouts)}")
    sheet_values = {"mass": 0.0, "span": 0.0, "cruise": 0.0, "stall": 0.0} | values
    return DataSheet(
        **sheet_values, volts=volts, energy=3600.0 * watt_hours, propeller=propeller, layout=layouts[layout or "tail"]
    )


def _parse_number(text: str) -> float:
    """Return a number, or NaN for text that is not a number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


# ----------------------------------------------------------------------
# Estimate the standard deviations of the model's factors.

# Standard deviation of the logarithm of each guessed factor, and the basis of the guess.
_SPREADS = {
    "zero-lift-drag": (MIN_DRAG_LOG_SD, "least drag by layout and aspect ratio, fitted to real aircraft"),
    "induced-drag": (INDUCED_DRAG_LOG_SD, "span efficiency from published aircraft of the class"),
    "drive-power": (EFFICIENCY_LOG_SD, "propulsive efficiency by mass, fitted to real aircraft"),
    "avionics-power": (AVIONICS_LOG_SD, "autopilot, radios and servos, fitted to real aircraft"),
    "thrust": (0.20, "propeller scaled to the climb; balances the other factors"),
    "motor-speed": (0.07, "motor scaled to the climb and the top speed"),
    "windmill-drag": (0.50, "drag of an idle propeller depends on hub and controller"),
    "lift-slope": (0.10, "lift curve slope from published aircraft of the class"),
    "pitch-stiffness": (0.25, "position of the centre of gravity"),
    "pitch-damping": (0.25, "pitch damping from published aircraft of the class"),
    "elevator-power": (0.15, "elevator scaled to the stall"),
    "roll-damping": (0.20, "roll damping from published aircraft of the class"),
    "aileron-power": (0.20, "ailerons from published aircraft of the class"),
}
# Standard deviation of a guessed steepest climb angle at cruise speed, rad.  Models of published aircraft climb at
# 13.6, 12.9, 16.4 and 7.2 degrees, and a real aircraft at 8.9 degrees (`examples/real/aircraft.csv`).  By Student's t
# distribution, 95 % of other aircraft are within 11.3 degrees of the mean.  The scaled models of three aircraft with
# known climb angles were wrong by 4.8 degrees on average (docs/measured.md), which is 0.8 of this deviation.
GUESSED_CLIMB_SD_RAD = math.radians(6.0)
# Standard deviation of a steepest climb angle that the sheet states, rad: 0.4 m/s at 15 m/s.
STATED_CLIMB_SD_RAD = math.radians(1.5)
# Standard deviation of the part of the climb between a stated throttle and full throttle, as a fraction of this part:
# that of the guessed thrust in `_SPREADS`.
EXTRAPOLATED_CLIMB_SD_FRACTION = 0.20
# Standard deviation of the logarithm of the least drag if the sheet states the power-off sink rate.
STATED_DRAG_LOG_SD = 0.15


def _make_uncertainty(sized: SizedAircraft, aircraft: Aircraft) -> tuple[Uncertainty, Draws]:
    """Return the uncertainty of a data sheet's model, and a sample of aircraft drawn from it.

    The uncertainty has standard deviations of factors on model properties, and of the resulting climb, descent, top
    speed and power at cruise.  All factors are independent except the factor on thrust.  An aircraft with more drag has
    a stronger motor, so this factor compensates the effect of the other factors on the climb.  It also varies by the
    uncertainty of the climb itself.

    The effects of a factor have the four elements of `_performance_vector`: [0] is the climb, [3] the power.
    """
    estimated = _performance_vector(aircraft)
    spreads = {name: sd for name, (sd, _) in _SPREADS.items() if name in sized.numbers.factors}
    if sized.sheet.sink:
        spreads["zero-lift-drag"] = STATED_DRAG_LOG_SD
    climb_sd = climb_deviation(sized)
    # Changes for one standard deviation of each factor's logarithm.
    slopes = {}
    for name, sd in spreads.items():
        increased, decreased = (
            _performance_vector(aircraft, ((f"ident/{name}", math.exp(sign * sd)),)) for sign in (1.0, -1.0)
        )
        slopes[name] = factor_effect(increased, decreased, estimated) / sd
    thrust_slopes = slopes.pop("thrust")
    # Change of the logarithm of the thrust per factor that keeps the climb.
    balance = {name: -slope[0] / thrust_slopes[0] for name, slope in slopes.items()}
    effects = {name: spreads[name] * (slope + balance[name] * thrust_slopes) for name, slope in slopes.items()}
    effects["climb"] = climb_sd / thrust_slopes[0] * thrust_slopes
    # The propulsive efficiency gets the part of the calibrated deviation of the power that no other factor explains.
    other_power = math.hypot(*(effect[3] for name, effect in effects.items() if name != "drive-power"))
    # The deviation of the logarithm of the cruise power is calibrated on real aircraft.
    aero, sheet, propulsion = sized.numbers.aero, sized.sheet, sized.numbers.propulsion
    lift = sheet.mass * GRAVITY / (0.5 * SHEET_DENSITY * sheet.cruise**2 * sheet.area)
    min_drag_fraction = aero.drag_min / (aero.drag_min + aero.drag_lift * lift**2)
    avionics = propulsion.avionics if isinstance(propulsion, ElectricMotor) else 0.0
    avionics_fraction = avionics / math.exp(estimated[3])
    calibrated_power = power_log_sd(min_drag_fraction, avionics_fraction, spreads["zero-lift-drag"])
    drive_power = math.sqrt(max((0.3 * calibrated_power) ** 2, calibrated_power**2 - other_power**2))
    drive_scale = abs(drive_power / effects["drive-power"][3])
    spreads["drive-power"] *= drive_scale
    effects["drive-power"] *= drive_scale
    total_climb_sd, descent_sd, top_speed_sd, power_sd = np.linalg.norm(list(effects.values()), axis=0).tolist()
    # The aircraft flies level at the cruise speed of the sheet, which limits the deviation of the top speed.
    top_speed_sd = min(top_speed_sd, max(0.0, float(estimated[2]) - aircraft.airspeed) / UNDECIDED_SIGMAS)
    balance_sds = [balance[name] * spreads[name] for name in slopes]
    spreads["thrust"] = math.hypot(climb_sd / thrust_slopes[0], *balance_sds)
    quantities = tuple(
        UncertainQuantity(f"ident/{name}", "factor", 1.0, sd, _SPREADS[name][1]) for name, sd in spreads.items()
    )
    uncertainty = Uncertainty(
        SHEET_SOURCE,
        climb_sd=total_climb_sd,
        descent_sd=descent_sd,
        quantities=quantities,
        power_sd=power_sd,
        battery_guessed="energy" in sized.guessed,
        max_speed_sd=top_speed_sd,
        climb_guessed="climb" in sized.guessed,
        bank_guessed="bank" in sized.guessed,
        climb_shortfall=sized.climb_shortfall,
    )
    # In the drawn aircraft, too, the factor on thrust compensates the effect of the other factors on the climb.
    draws = draw_quantities(quantities)
    logarithms, names = np.log(draws.values), [name.removeprefix("ident/") for name in draws.names]
    thrust = names.index("thrust")
    logarithms[:, thrust] *= climb_sd / thrust_slopes[0] / spreads["thrust"]
    for k, name in enumerate(names):
        if k != thrust:
            logarithms[:, thrust] += balance[name] * logarithms[:, k]
    return uncertainty, replace(draws, values=np.exp(logarithms).round(6))


def climb_deviation(sized: SizedAircraft) -> float:
    """Return the standard deviation of the climb at full throttle, rad.

    It is small for a climb that the sheet states at full throttle, and large for a guessed climb.  A climb that is
    stated at less throttle is extrapolated to full throttle; this increases the deviation, at most to that of a guess.
    """
    if "climb" in sized.guessed:
        return GUESSED_CLIMB_SD_RAD
    if math.isnan(sized.partial_climb):
        return STATED_CLIMB_SD_RAD
    extrapolated_sd = EXTRAPOLATED_CLIMB_SD_FRACTION * (sized.sheet.climb - sized.partial_climb)
    return min(GUESSED_CLIMB_SD_RAD, math.hypot(STATED_CLIMB_SD_RAD, extrapolated_sd))


def _performance_vector(aircraft: Aircraft, properties: tuple[tuple[str, float], ...] = ()) -> Floats:
    """Return four numbers of performance, (4,).

    They are climb angle (rad), descent angle (rad), top speed (m/s) and logarithm of the cruise power (W).

    The angles are the steepest flight path angles at cruise speed, negative in descent.  The cruise power is the power
    in level flight at cruise speed.  A value is NaN if the aircraft cannot be trimmed there.

    properties: values of the model's properties by name.
    """
    fdm = Fdm(aircraft, is_tested=True, variation=Variation(properties=properties))
    angles = [trim_function(fdm, aircraft.airspeed, AMSL) for trim_function in (full_throttle_climb, idle_descent)]
    max_speed_trim = fastest_level_flight(fdm, AMSL)
    level = steady_flight(fdm, aircraft.airspeed, AMSL)
    if level is not None:
        fdm.apply_trim(level.vector())
    return np.array(
        [
            *(math.nan if trim is None else trim.climb for trim in angles),
            math.nan if max_speed_trim is None else max_speed_trim.airspeed,
            math.nan if level is None else math.log(float(fdm.read().power)),
        ]
    )


def factor_effect(increased: Floats, decreased: Floats, estimated: Floats) -> Floats:
    """Return the signed effect of a factor on each performance value: (increased - decreased) / 2, (n,).

    If one of the two is NaN, because the aircraft cannot be trimmed, the effect is the difference between the other one
    and `estimated`.  If both are NaN, it is the magnitude of `estimated`.

    increased, decreased: performance values (n,) with the factor increased and decreased.
    estimated: performance values (n,) with the factor as estimated.

    >>> more, less = np.array([0.3, math.nan, math.nan]), np.array([0.1, 0.05, math.nan])
    >>> factor_effect(more, less, np.array([0.2, 0.2, -0.2])).round(2).tolist()
    [0.1, 0.15, 0.2]
    """
    one_sided_change = np.where(np.isnan(increased), estimated - decreased, increased - estimated)
    one_sided_change = np.where(np.isnan(one_sided_change), np.abs(estimated), one_sided_change)
    two_sided_change: Floats = 0.5 * (increased - decreased)
    return np.where(np.isnan(two_sided_change), one_sided_change, two_sided_change)


# ----------------------------------------------------------------------
# Write the folder.

# Minimum airspeed that guidance may use, as a ratio to the stall speed.
MIN_GUIDANCE_SPEED_RATIO = 1.12
# Maximum airspeed that guidance may use, as a ratio to the maximum level airspeed.
MAX_GUIDANCE_SPEED_RATIO = 0.95
# Maximum pitch angle of a new aircraft, degrees.
_MAX_PITCH_DEG = 25.0


@dataclass(frozen=True, slots=True)
class Performance:
    """Trim points of the model at the altitude `flight.guidance.model_gains.AMSL`.

    level, climb, idle: level flight, steepest climb at full throttle and descent at idle, all at cruise speed.
    slowest, fastest: slowest and fastest level flight.
    """

    level: Trim
    climb: Trim
    idle: Trim
    slowest: Trim
    fastest: Trim


def make_data_sheet_folder(
    folder: Path,
    sheet: DataSheet,
    parameters: Path | None = None,
    sized: SizedAircraft | None = None,
    *,
    overwrite: bool = False,
) -> Aircraft:
    """Write the folder of an aircraft made from its data sheet, and return the aircraft.

    The folder is written completely or not at all.

    parameters: file of ArduPlane's or PX4's parameters, which replace missing values of the sheet.
    sized: aircraft sized from the sheet as another class of aircraft; None for the default class of the layout.
    overwrite: True replaces the folder of an aircraft.
    Raises FlightError for a sheet outside the range of small aircraft, a folder that exists, and an aircraft that
    cannot fly; ParameterError for a parameter file that cannot be read; OSError.
    """
    target = check_new_folder(folder, overwrite=overwrite)
    parameter_values = AircraftParameters({}, {}) if parameters is None else read_aircraft_parameters(parameters)
    numbers = {field: getattr(sheet, field) / RANGES[field][4] for field in _SHEET_FIELDS.values()}
    readme_lines = _parameter_lines(parameter_values, overridden_texts(numbers, parameter_values))
    # A value that the sheet states replaces the autopilot's parameter.
    is_overridden = {name: bool(getattr(sheet, _SHEET_FIELDS[name])) for name in _SETTINGS}
    file_parameters = {name: value for name, value in parameter_values.values.items() if not is_overridden.get(name)}
    if sized is None:
        sheet = with_parameters(sheet, file_parameters)
        for name in ("mass", "span", "cruise", "stall"):
            if not getattr(sheet, name):
                min_value, max_value, unit = RANGES[name][2], RANGES[name][3], RANGES[name][1]
                allowed = f"missing; a data sheet needs it ({min_value:g}..{max_value:g} {unit})"
                raise FlightError.of_argument(name, None, allowed, shown="")
        try:
            sized = size_aircraft(check_sheet(sheet))
        except FlightError as error:
            raise FlightError.from_error(error, parameters or "") if error.field == "TECS_SINK_MIN" else error from None
    with temporary_folder("planfly-sheet-") as draft_folder:
        climb_names = " and ".join(_climb_names(parameter_values))
        files = _file_texts(sized, target.name, draft_folder, file_parameters, readme_lines, climb_names)
    write_aircraft_folder(target, {name: text.encode() for name, text in files.items()})
    return read_aircraft(target)


def _parameter_lines(stated: AircraftParameters, overridden: Sequence[str]) -> list[str]:
    """Return lines of ``README.md`` on the values of a parameter file; [] without such values.

    stated: values of the parameter file.
    overridden: texts on the parameters that the data sheet overrides, as from `overridden_texts`.
    """

    def is_used(text: str) -> bool:
        """Return True if the data sheet does not override the parameter with this text."""
        return not any(overridden_text.startswith(f"{text} (") for overridden_text in overridden)

    used_texts = list(filter(is_used, stated.texts.values()))
    lines = []
    if used_texts:
        lines = [f"From the parameter file: {', '.join(used_texts)}."]
        if names := _climb_names(stated):
            climb_text = f"{names[0]} is the climb rate with the throttle at {names[1]}"
            lines.append(f"{climb_text}; the table has the climb at full throttle.")
    if overridden:
        lines.append(
            f"Not used from the parameter file, because the data sheet states these values: {', '.join(overridden)}."
        )
    return ["", *lines] if lines else []


def _file_texts(
    sized: SizedAircraft,
    name: str,
    draft_folder: Path,
    file_parameters: Mapping[str, float],
    readme_lines: Sequence[str],
    climb_names: str,
) -> dict[str, str]:
    """Return the text of each file of the aircraft's folder, by file name.

    name: name of the aircraft.
    draft_folder: temporary folder for a draft of the aircraft, from which trims and gains are computed.
    file_parameters: values of the parameter file by ArduPlane's names, without overridden values.
    readme_lines: lines of ``README.md`` on the parameter file.
    climb_names: names of the parameters from which the climb is derived, as text.
    """
    folder = draft_folder / name
    folder.mkdir()
    model = model_xml(name, sized.numbers)
    (folder / f"{name}.xml").write_text(model, encoding="utf-8")
    sheet = sized.sheet
    (folder / f"{name}.toml").write_text(_metadata_text(sized, sheet.stall, sheet.stall, sheet.top), encoding="utf-8")
    aircraft = read_aircraft(folder)
    draft_fdm = Fdm(aircraft, is_tested=True)
    performance = measure_performance(draft_fdm, aircraft)
    draft_fdm.apply_trim(performance.level.vector())
    power, volts = float(draft_fdm.read().power), aircraft.battery_voltage
    if volts and aircraft.battery_energy < _MIN_ENDURANCE_S * power:
        allowed = (
            f"level flight at {aircraft.airspeed:g} m/s draws {power / volts:.0f} A and empties the battery"
            f" in {aircraft.battery_energy / power:.0f} s; expected at least {_MIN_ENDURANCE_S:g} s"
        )
        watt_hours = aircraft.battery_energy / 3600.0
        raise FlightError.of_argument("battery", watt_hours, allowed, shown=f"{volts:g} V, {watt_hours:.3g} Wh")
    # With the thrust of its propeller, the model may fly slower than the stall speed of the sheet.  The higher of the
    # two speeds is used.
    stall_speed = max(
        sheet.stall, math.ceil(10.0 * performance.slowest.airspeed * math.sqrt(SHEET_DENSITY / SEA_LEVEL)) / 10.0
    )
    min_airspeed = min(MIN_GUIDANCE_SPEED_RATIO * stall_speed, sheet.cruise)
    max_airspeed = max(sheet.cruise, MAX_GUIDANCE_SPEED_RATIO * performance.fastest.airspeed)
    metadata = _metadata_text(sized, stall_speed, round(min_airspeed, 1), math.floor(10.0 * max_airspeed) / 10.0)
    (folder / f"{name}.toml").write_text(metadata, encoding="utf-8")
    aircraft = read_aircraft(folder)
    fdm = Fdm(aircraft, is_tested=True)
    uncertainty, draws = _make_uncertainty(sized, aircraft)
    return {
        f"{name}.xml": model,
        f"{name}.toml": metadata,
        "gains.toml": gains_text(gains_from_model(aircraft, fdm)),
        "ardupilot.parm": arduplane_parameters_text(aircraft, performance, fdm, file_parameters),
        "ardupilot.toml": servo_text(aircraft, performance),
        "uncertainty.toml": uncertainty_text(uncertainty),
        DRAWS_FILE: draws_text(draws),
        "README.md": _readme_text(
            aircraft,
            sized,
            performance,
            uncertainty,
            readme_lines,
            missed_value_lines(file_parameters, sheet.cruise, performance, sized.climb_shortfall),
            climb_names,
        ),
    }


def measure_performance(fdm: Simulator, aircraft: Aircraft) -> Performance:
    """Trim an aircraft in all flight conditions of `Performance`.

    Raises FlightError if a condition has no trim point; the message names the value of the data sheet to change.
    """
    cruise = aircraft.airspeed
    level = steady_flight(fdm, cruise, AMSL)
    if level is None:
        raise FlightError.of_argument(
            "cruise", cruise, "the model has no level flight at this airspeed", shown=f"{cruise:g} m/s"
        )
    trims = {
        "climb": full_throttle_climb(fdm, cruise, AMSL, level),
        "idle": idle_descent(fdm, cruise, AMSL, level),
        "slowest": slowest_level_flight(fdm, AMSL, level),
        "fastest": fastest_level_flight(fdm, AMSL, level),
    }
    for name, trim in trims.items():
        if trim is None:
            argument, condition = {
                "climb": ("climb", "a climb at full throttle"),
                "idle": ("cruise", "a descent at idle"),
                "slowest": ("stall", "the slowest level flight"),
                "fastest": ("top", "the fastest level flight"),
            }[name]
            option, unit, low, high, _ = RANGES[argument]
            allowed = (
                f"the model of this data sheet cannot be trimmed for {condition}; state another value,"
                f" {low:g}..{high:g} {unit}"
            )
            raise FlightError.of_argument(option, None, allowed, shown="")
    return Performance(level, **{name: trim for name, trim in trims.items() if trim is not None})


def _metadata_text(sized: SizedAircraft, stall: float, min_airspeed: float, max_airspeed: float) -> str:
    """Return the text of the aircraft's TOML file, named after the aircraft.

    stall: stall speed, m/s.
    min_airspeed, max_airspeed: airspeeds that guidance may use, m/s.
    """
    numbers, sheet = sized.numbers, sized.sheet
    elevator, aileron, rudder = (math.degrees(value) for value in numbers.throw)
    energy = (
        f"fuel_kg = {sheet.fuel:.6g}\nfuel_mj_per_kg = {FUEL_HEAT / 1e6:g}"
        if sheet.burns_fuel
        else f"battery_v = {sheet.volts:.6g}\nbattery_wh = {sheet.energy / 3600.0:.6g}"
    )
    return f"""# Values of the aircraft for planner, guidance and verdict; README.md lists the guessed values.

title = "{numbers.title.replace(chr(34), "'")}, from a data sheet"

mass_kg = {numbers.mass:.6g}
wing_area_m2 = {numbers.area:.6g}
wing_span_m = {numbers.span:.6g}

airspeed_mps = {sheet.cruise:.6g}
airspeed_min_mps = {min_airspeed:.6g}
airspeed_max_mps = {max_airspeed:.6g}
stall_speed_mps = {stall:.6g}

max_bank_deg = {math.degrees(sheet.bank):.6g}
max_pitch_deg = {_MAX_PITCH_DEG:.6g}

max_elevator_deg = {elevator:.6g}
max_aileron_deg = {aileron:.6g}
max_rudder_deg = {rudder:.6g}
surface_rate_deg_s = {math.degrees(numbers.rate):.6g}
surface_lag_s = {numbers.lag[0]:.6g}
motor_lag_s = {numbers.lag[1]:.6g}

{energy}
"""


# ----------------------------------------------------------------------
# Write ArduPlane parameters and servos.


def arduplane_parameters_text(
    aircraft: Aircraft, performance: Performance, fdm: Fdm, file_parameters: Mapping[str, float]
) -> str:
    """Return the text of ``ardupilot.parm``: ArduPlane parameters computed from the model's trim points.

    file_parameters: values of a parameter file, which replace the computed values.
    """
    a, b = linearise(fdm, performance.level)
    cruise, bank = aircraft.airspeed, aircraft.max_bank
    p, q, elevator, aileron = 3, 4, 0, 1
    # Feed-forward of a rate: 45 degrees divided by the rate that full deflection gives.
    roll_rate = abs(b[p, aileron] / a[p, p]) * aircraft.max_aileron
    pitch_rate = abs(b[q, elevator] / a[q, q]) * aircraft.max_elevator
    roll_gain, pitch_gain = (min(3.0, max(0.05, math.radians(45.0) / rate)) for rate in (roll_rate, pitch_rate))
    climb = cruise * math.sin(performance.climb.climb)
    sink = -cruise * math.sin(performance.idle.climb)
    radius = turn_radius(cruise, bank)
    values = {
        "AIRSPEED_CRUISE": round(cruise, 1),
        "AIRSPEED_MIN": round(aircraft.airspeed_min, 1),
        "AIRSPEED_MAX": round(aircraft.airspeed_max, 1),
        "SCALING_SPEED": round(cruise, 1),
        "ROLL_LIMIT_DEG": round(math.degrees(bank)),
        "PTCH_LIM_MAX_DEG": round(_MAX_PITCH_DEG),
        "PTCH_LIM_MIN_DEG": -20,
        "PTCH_TRIM_DEG": round(math.degrees(performance.level.alpha), 1),
        "WP_RADIUS": max(15, 5 * round(0.8 * radius / 5.0)),
        "WP_LOITER_RAD": max(40, 5 * round(1.3 * radius / 5.0)),
        "TRIM_THROTTLE": round(100.0 * performance.level.throttle),
        "THR_MIN": math.floor(100.0 * idle_throttle(aircraft, fdm, performance.level)),
        "THR_MAX": 100,
        "TECS_CLMB_MAX": round(max(0.5, 0.95 * climb), 1),
        "TECS_SINK_MIN": round(max(0.3, sink), 1),
        "TECS_SINK_MAX": round(max(1.0, 1.5 * sink), 1),
        "RLL_RATE_FF": round(roll_gain, 3),
        "RLL_RATE_P": round(0.4 * roll_gain, 3),
        "RLL_RATE_I": round(0.8 * roll_gain, 3),
        "RLL_RATE_D": 0,
        "PTCH_RATE_FF": round(pitch_gain, 3),
        "PTCH_RATE_P": round(0.15 * pitch_gain, 3),
        "PTCH_RATE_I": round(0.4 * pitch_gain, 3),
        "PTCH_RATE_D": 0,
    }
    used_file_parameters = {name: value for name, value in file_parameters.items() if name in values}
    lines = [
        "# ArduPlane's parameters for this aircraft, where they differ from ArduPlane's own defaults.",
        "# Speeds are equivalent airspeeds, m/s; angles in degrees.  A file given with --params comes on top.",
        *(f"{name} {value:g}" for name, value in (values | used_file_parameters).items()),
    ]
    return "\n".join(lines) + "\n"


def servo_text(aircraft: Aircraft, performance: Performance) -> str:
    """Return the text of ``ardupilot.toml``.

    It has the servo output and pulses of each surface and of the throttle.

    Elevons and V-tails are mixed within the model.
    """
    elevator, aileron, rudder = (
        math.degrees(value) for value in (aircraft.max_elevator, aircraft.max_aileron, aircraft.max_rudder)
    )
    elevator_trim = math.degrees(performance.level.elevator)
    return f"""# The servo outputs of an ArduPlane that flies this aircraft, and the control at these pulses.
# Positive is a trailing edge down (elevator), a roll to the right (ailerons), a yaw to the left (rudder).  Elevons and
# V-tails are mixed within the model: ArduPlane gives it elevator, aileron and rudder.

[aileron]
output = 1
pulse_us = [1100, 1500, 1900]
value_deg = [{-aileron:.1f}, 0.0, {aileron:.1f}]

# Rigged as a trimmed aircraft: the middle pulse gives the deflection of level flight at cruise.
[elevator]
output = 2
pulse_us = [1100, 1500, 1900]
value_deg = [{elevator_trim + elevator:.1f}, {elevator_trim:.1f}, {elevator_trim - elevator:.1f}]

[throttle]
output = 3
pulse_us = [1000, 2000]
value = [0.0, 1.0]

[rudder]
output = 4
pulse_us = [1100, 1500, 1900]
value_deg = [{rudder:.1f}, 0.0, {-rudder:.1f}]
"""


# ----------------------------------------------------------------------
# Write the README.

# Rows of the table in the README: field, title, unit, and the factor to this unit.
_README_ROWS = (
    ("mass", "mass", "kg", 1.0),
    ("span", "wing span", "m", 1.0),
    ("area", "wing area", "m2", 1.0),
    ("cruise", "cruise", "m/s", 1.0),
    ("stall", "stall", "m/s", 1.0),
    ("top", "fastest level flight", "m/s", 1.0),
    ("bank", "bank in turns", "degrees", 180.0 / math.pi),
    ("climb", "steepest climb at cruise", "degrees", 180.0 / math.pi),
    ("volts", "battery", "V", 1.0),
    ("energy", "energy", "Wh", 1.0 / 3600.0),
    ("fuel", "fuel", "kg", 1.0),
)


# Error of the model's sink rate, as a ratio, from which it is reported.
_RATE_TOLERANCE_RATIO = 0.05


def missed_value_lines(
    file_parameters: Mapping[str, float], cruise: float, performance: Performance, climb_shortfall: float
) -> list[str]:
    """Return lines of ``README.md`` on the values of a parameter file that the model does not meet.

    cruise: cruise airspeed, m/s.
    climb_shortfall: as in `SizedAircraft`.
    """
    throttle = 100.0 * performance.level.throttle
    sink = -cruise * math.sin(performance.idle.climb)
    trim_throttle, stated_sink = file_parameters.get("TRIM_THROTTLE"), file_parameters.get("TECS_SINK_MIN")
    texts = []
    if trim_throttle is not None and round(throttle) != round(trim_throttle):
        texts.append(f"TRIM_THROTTLE {trim_throttle:g}: it needs {throttle:.0f} % in level flight")
    if stated_sink is not None and abs(sink / stated_sink - 1.0) > _RATE_TOLERANCE_RATIO:
        texts.append(f"TECS_SINK_MIN {stated_sink:g} m/s: it sinks {sink:.2f} m/s without power")
    if climb_shortfall:
        climb = file_parameters["TECS_CLMB_MAX"]
        model_climb = cruise * math.sin(math.asin(climb / cruise) - climb_shortfall)
        limit_text = f"THR_MAX {file_parameters['THR_MAX']:g}"
        texts.append(f"TECS_CLMB_MAX {climb:g} m/s: it climbs {model_climb:.1f} m/s at {limit_text}")
    return [f"The model does not meet the file's {text}. `ardupilot.parm` keeps the file's value." for text in texts]


def _climb_names(stated: AircraftParameters) -> list[str]:
    """Return the names that a file uses for TECS_CLMB_MAX and THR_MAX.

    They are returned if the climb rate is not at full throttle.

    Returns [] unless both parameters differ from their defaults; the default of THR_MAX is full throttle.
    """
    names = ("TECS_CLMB_MAX", "THR_MAX")
    return [stated.texts[name].split()[0] for name in names] if stated.values.keys() >= set(names) else []


def _value_lines(sized: SizedAircraft, climb_names: str) -> list[str]:
    """Return the rows of the table in ``README.md``: each value of the sheet with its source.

    climb_names: names of the parameters from which the climb is derived, as text.
    """
    lines = []
    for field, title, unit, factor in _README_ROWS:
        if value := factor * getattr(sized.sheet, field):
            source = "guessed" if field in sized.guessed else "stated"
            if field == "climb" and math.isfinite(sized.partial_climb):
                is_limited = math.isclose(sized.sheet.climb, MAX_CLIMB, rel_tol=1e-3)
                limit_text = ", limited to the greatest climb of a model" if is_limited else ""
                source = f"derived from {climb_names}{limit_text}"
            lines.append(f"| {title} | {value:.4g} {unit} | {source} |")
    return lines


def _readme_text(
    aircraft: Aircraft,
    sized: SizedAircraft,
    performance: Performance,
    uncertainty: Uncertainty,
    parameter_lines: Sequence[str],
    missed_lines: Sequence[str],
    climb_names: str,
) -> str:
    """Return the text of ``README.md``: stated and guessed values, performance, uncertainties and files.

    parameter_lines: lines on the values of the parameter file.
    missed_lines: lines on the values of the parameter file that the model does not meet.
    climb_names: parameters from which the climb is derived.
    """
    sheet, name = sized.sheet, aircraft.name
    propulsion = "burns fuel; its mass stays the same" if sheet.burns_fuel else "is electric"
    lines = [
        f"# {name}",
        "",
        f"{sized.numbers.title}, made by `planfly aircraft --new` from a data sheet. It {propulsion}.",
        "Values that the sheet does not state are scaled from aircraft of its class; see `aircraft/data_sheet.py` of",
        "planfly. A slope close to the model's limit is left undecided, and so is a turn that only a guessed bank",
        "limit forbids.",
        "",
        "| | | |",
        "|---|---|---|",
    ]
    lines += [
        *_value_lines(sized, climb_names),
        *parameter_lines,
        "",
        f"The model weighs {aircraft.mass * GRAVITY:.1f} N, flies level at {aircraft.airspeed:g} m/s with"
        f" {100.0 * performance.level.throttle:.0f} % throttle, climbs"
        f" {math.degrees(performance.climb.climb):.1f} degrees at",
        f"full throttle and sinks {-math.degrees(performance.idle.climb):.1f} degrees without (at {AMSL:g} m). Its"
        f" elevator reaches its stop at {performance.slowest.airspeed:.1f} m/s.",
        f"Guidance flies at {aircraft.airspeed_min:g} to {aircraft.airspeed_max:g} m/s:"
        f" up to {100.0 * MAX_GUIDANCE_SPEED_RATIO:.0f} % of the fastest level flight.",
        *missed_lines,
        "",
        "## Uncertainties",
        "",
        f"The standard deviation of the steepest climb is {math.degrees(uncertainty.climb_sd):.1f} degrees, of the"
        f" steepest descent {math.degrees(uncertainty.descent_sd):.1f} degrees, and of the fastest level flight"
        f" {uncertainty.max_speed_sd:.1f} m/s. The model's properties have these standard deviations:",
        "",
        "| property of the model | factor on | deviation | because |",
        "|---|---|---|---|",
    ]
    for quantity in uncertainty.quantities:
        factor_text = (FACTORS | POWER_FACTORS)[quantity.name.removeprefix("ident/")]
        lines.append(f"| `{quantity.name}` | {factor_text} | {100.0 * quantity.sd:.0f} % | {quantity.reason} |")
    lines += [
        "",
        f"`{DRAWS_FILE}` has {DRAW_COUNT} aircraft drawn from these uncertainties; a campaign uses one per flight.",
        "",
        "| file | content |",
        "|---|---|",
        f"| `{name}.xml` | the JSBSim model |",
        f"| `{name}.toml` | mass, speeds, limits, energy |",
        "| `gains.toml` | guidance gains, from the model's linearisation |",
        "| `ardupilot.parm`, `ardupilot.toml` | ArduPlane's parameters, and its servos |",
        f"| `uncertainty.toml`, `{DRAWS_FILE}` | uncertainties, and aircraft drawn from them |",
    ]
    return "\n".join(lines) + "\n"
