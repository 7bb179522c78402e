"""Build an aircraft from the few numbers of a data sheet, by scaling a model of its class.

The model meets stated values exactly: mass, span, speeds, climb. Missing values are taken from published aircraft of
the class (`TAIL`, `WING`), drag and power from real aircraft (`aircraft.power_prior`), and have a standard deviation
(`aircraft.uncertainty`).
"""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.model_writer import FACTORS, POWER_FACTORS, AeroCoefficients, Layout, ModelNumbers
from aircraft.power_prior import POWER_PRIOR, PowerPrior
from aircraft.propulsion import BOOK_PROPELLER, ElectricMotor, FuelEngine, Propeller
from world.arrays import Floats
from world.errors import FlightError

# Air density at sea level, kg/m^3.
SEA_LEVEL = 1.225
# Kinematic viscosity of air at sea level, m^2/s.
VISCOSITY = 1.46e-5
# Air density at 500 m, where most aircraft fly, kg/m^3: the values of a sheet are taken to hold there.
SHEET_DENSITY = 1.1673


@dataclass(frozen=True, slots=True)
class DataSheet:
    """The stated values of an aircraft in SI units and radians; 0 for a value that is not stated.

    mass: kg.
    span: m.
    area: wing area, m^2.
    cruise, stall, top: airspeeds in level flight, m/s.
    bank: bank limit in turns.
    climb: maximum climb angle at cruise, at `climb_throttle`.
    sink: sink rate at cruise without power, with the idle propeller, m/s.
    trim_throttle: throttle in level flight at cruise, 0..1.
    volts: battery voltage.
    energy: energy of the battery, or heat of the fuel, J.
    motor: motor speed per volt, rpm/V.
    propeller: diameter and pitch, m.
    fuel: fuel mass, kg; an aircraft with fuel has no battery.
    layout: control surfaces.
    climb_throttle: throttle of the stated climb, 0..1.
    """

    mass: float
    span: float
    cruise: float
    stall: float
    area: float = 0.0
    top: float = 0.0
    bank: float = 0.0
    climb: float = 0.0
    sink: float = 0.0
    trim_throttle: float = 0.0
    volts: float = 0.0
    energy: float = 0.0
    motor: float = 0.0
    propeller: tuple[float, float] = (0.0, 0.0)
    fuel: float = 0.0
    layout: Layout = "tail"
    climb_throttle: float = 1.0

    @property
    def burns_fuel(self) -> bool:
        """True if the aircraft burns fuel."""
        return self.fuel > 0.0


# For each field of `DataSheet`: name of the option, unit, lowest and highest value, and factor from that unit to SI.
RANGES = {
    "mass": ("mass", "kg", 0.5, 25.0, 1.0),
    "span": ("span", "m", 0.5, 6.0, 1.0),
    "area": ("area", "m2", 0.05, 4.0, 1.0),
    "cruise": ("cruise", "m/s", 8.0, 45.0, 1.0),
    "stall": ("stall", "m/s", 5.0, 35.0, 1.0),
    "top": ("top", "m/s", 9.0, 70.0, 1.0),
    "bank": ("bank", "degrees", 15.0, 60.0, math.pi / 180.0),
    "climb": ("climb", "degrees", 2.0, 35.0, math.pi / 180.0),
    "motor": ("motor", "rpm per volt", 20.0, 5000.0, 1.0),
    "fuel": ("fuel", "kg", 0.05, 12.0, 1.0),
}
# Rounding tolerance for a conversion of units, as a ratio.
_EDGE_ROUNDING = 1e-12
# Range of the ratio of stall speed to cruise speed.
STALL_RATIO_RANGE = (0.35, 0.87)
# Range of the ratio of top speed to cruise speed.
TOP_RATIO_RANGE = (1.05, 2.5)
# Range of the lift coefficient at the stall without flaps.
LIFT_RANGE = (0.5, 2.4)
# Range of the aspect ratio, span^2 / area.
ASPECT_RANGE = (2.5, 25.0)
# Largest battery energy per aircraft mass, J/kg: no available cell stores more energy per mass of the cell.
MAX_BATTERY = 300.0 * 3600.0


@dataclass(frozen=True, slots=True)
class AircraftClass:
    """Dimensionless properties of the published aircraft of a class.

    Rates and angles are defined as in `AeroCoefficients`.

    lift_slope: ratio to the lift slope of an elliptic wing of the same aspect ratio.
    lift_max: largest lift coefficient, if the sheet states no area.
    oswald: span efficiency.
    scales_with_aspect_ratio: True if ``pitch_alpha`` and ``pitch_q`` are multiplied by the aspect ratio.
    gyration: radii of gyration about x, y, z as ratios to the span.
    product_share: product of inertia Jxz as a ratio to Jz.
    elevator_stall: elevator deflection at the stall, rad.
    throw: travel of elevator, aileron and rudder in either direction, rad.
    """

    lift_slope: float
    lift_max: float
    oswald: float
    scales_with_aspect_ratio: bool
    pitch_alpha: float
    pitch_q: float
    lift_q: float
    lift_elevator: float
    side_beta: float
    roll_beta: float
    roll_p: float
    roll_r: float
    roll_aileron: float
    yaw_beta: float
    yaw_p: float
    yaw_r: float
    yaw_aileron: float
    side_rudder: float
    roll_rudder: float
    yaw_rudder: float
    gyration: tuple[float, float, float]
    product_share: float
    elevator_stall: float
    throw: tuple[float, float, float]


# The Aerosonde (Beard and McLain, appendix E.2) and the Ultra Stick 25e (University of Minnesota): Cmq -38 and -13.6 at
# aspect ratios of 15.2 and 5.2, Cm_alpha -2.74 and -0.72; radii of gyration 0.095, 0.111, 0.138 and 0.150, 0.165, 0.220
# of the span; other values lie between the two.
TAIL = AircraftClass(
    lift_slope=1.05,
    lift_max=1.25,
    oswald=0.82,
    scales_with_aspect_ratio=True,
    pitch_alpha=-0.16,
    pitch_q=-2.55,
    lift_q=7.0,
    lift_elevator=0.11,
    side_beta=-0.7,
    roll_beta=-0.085,
    roll_p=-0.48,
    roll_r=0.17,
    roll_aileron=0.17,
    yaw_beta=0.073,
    yaw_p=0.02,
    yaw_r=-0.13,
    yaw_aileron=-0.011,
    side_rudder=0.19,
    roll_rudder=0.005,
    yaw_rudder=-0.11,
    gyration=(0.12, 0.14, 0.175),
    product_share=0.08,
    elevator_stall=-math.radians(22.0),
    throw=(math.radians(25.0), math.radians(25.0), math.radians(25.0)),
)
# The Skywalker X8 (Gryte et al. 2018) and the Zagi (Beard and McLain, first edition, appendix E.1): lift slopes 0.89
# and 0.72 of the elliptic wing's slope; lateral values of the X8 only, since the Zagi's table has no directional
# stability.
WING = AircraftClass(
    lift_slope=0.80,
    lift_max=1.05,
    oswald=0.86,
    scales_with_aspect_ratio=False,
    pitch_alpha=-0.51,
    pitch_q=-1.35,
    lift_q=3.4,
    lift_elevator=0.275,
    side_beta=-0.22,
    roll_beta=-0.085,
    roll_p=-0.40,
    roll_r=0.055,
    roll_aileron=0.13,
    yaw_beta=0.0283,
    yaw_p=0.0044,
    yaw_r=-0.072,
    yaw_aileron=-0.0034,
    side_rudder=0.0,
    roll_rudder=0.0,
    yaw_rudder=0.0,
    gyration=(0.16, 0.12, 0.2),
    product_share=0.0,
    elevator_stall=-math.radians(22.0),
    throw=(math.radians(25.0), math.radians(25.0), math.radians(25.0)),
)
# Class of each layout.
CLASSES: dict[Layout, AircraftClass] = {"tail": TAIL, "vtail": TAIL, "wing": WING}

# Climb angle if the sheet states none, rad.
DEFAULT_CLIMB = math.radians(12.0)
# Ratio of top speed to cruise speed if the sheet states no top speed.
DEFAULT_TOP_RATIO = 1.65
# Guesses of this ratio, in the order in which they are tried, if no propeller gives the default ratio with the sheet's
# climb.
_TOP_GUESSES = (DEFAULT_TOP_RATIO, 1.5, 1.8, 1.35, 2.0, 1.2, 2.3, 1.1)
# Guesses of the climb, degrees, if the top speed alone leads to a climb that is too flat; in reverse order, if it leads
# to a climb that is too steep.
_CLIMB_GUESSES_DEG = (2.0, 4.0, 6.0, 9.0, 12.0, 16.0, 20.0, 25.0, 30.0, 35.0)
# Number of values that are tried to find an allowed range.
_RANGE_STEP_COUNT = 34
# Maximum climb angle of a model, rad.
MAX_CLIMB = math.radians(35.0)
# Bank limit if the sheet states none, rad.
DEFAULT_BANK = math.radians(35.0)
# Battery energy per aircraft mass if the sheet states none, J/kg: 30 % of the mass at 150 Wh/kg.
BATTERY_PER_MASS = 45.0 * 3600.0
# Battery voltage if the sheet states none, by the upper limit of the mass, kg.
_DEFAULT_VOLTS = ((1.5, 11.1), (5.0, 14.8), (10.0, 22.2), (math.inf, 44.4))
# Heat of the fuel, J/kg.
FUEL_HEAT = 43.5e6
# Angle of attack at cruise, rad.
CRUISE_ALPHA = 0.05
# Minimum angle of attack at cruise, rad: a wing of low aspect ratio is set such that its stall is within
# `MAX_STALL_ALPHA`.
MIN_CRUISE_ALPHA = -0.05
# Maximum angle of attack at the stall, rad. Trims are searched up to 0.4, and with thrust flight is possible below the
# stall speed.
MAX_STALL_ALPHA = 0.33
# Maximum elevator at zero lift, which no level flight reaches, as a ratio to the elevator's travel.
MAX_ZERO_LIFT_ELEVATOR = 0.9
# Elevator at cruise, rad.
CRUISE_ELEVATOR = -0.035
# Sharpness of the stall, the M of Beard and McLain.
STALL_SHARPNESS = 80.0
# An idle propeller brakes with this fraction of the negative thrust that the propeller's formula gives.
WINDMILL_FRACTION = 0.5
# Resistance of the Aerosonde's motor at full throttle in cruise, dimensionless: R P / V^2.
_RESISTANCE_RATIO = 0.026
# Idle current of the Aerosonde's motor at full throttle in cruise, dimensionless: i0 V / P.
_IDLE_CURRENT_RATIO = 0.055
# Smallest diameter of a propeller, m.
_MIN_DIAMETER_M = 0.06
# Largest diameter of a propeller, as a ratio to the span.
_MAX_DIAMETER_RATIO = 0.6
# Largest diameter of an engine's propeller if none is stated, as a ratio to the span.
_ENGINE_DIAMETER_RATIO = 0.18
# Error of the climb at a stated throttle from which it is reported, rad.
_CLIMB_TOLERANCE_RAD = math.radians(0.1)
# Number of steps in which the drags of the wing and of the idle propeller are matched to a sink rate; each step reduces
# the error to about a tenth.
_SINK_STEP_COUNT = 5
# Ratio of an engine's shaft work to the fuel's heat. Small engines reach 0.2 at full throttle; the Penguin B's 0.231 kg
# of fuel per hour (`examples/real/aircraft.csv`) leaves 0.11 for cruise.
_ENGINE_EFFICIENCY = 0.15
# Friction torque of an engine, as a ratio to its largest torque.
_FRICTION_RATIO = 0.08


def _is_within(value: float, min_value: float, max_value: float) -> bool:
    """Return True if a value is within a range, except for the rounding of a unit conversion.

    >>> _is_within(math.radians(15.0) / (math.pi / 180.0), 15.0, 60.0), _is_within(14.9, 15.0, 60.0)
    (True, False)
    """
    return min_value * (1.0 - _EDGE_ROUNDING) <= value <= max_value * (1.0 + _EDGE_ROUNDING)


def check_sheet(sheet: DataSheet) -> DataSheet:
    """Return a data sheet unchanged if its values are possible for a small aircraft.

    Raises FlightError, with the allowed range, for a value out of range.

    >>> check_sheet(DataSheet(2.1, 1.6, 15.0, 10.0)).mass
    2.1
    >>> check_sheet(DataSheet(2.1, 1.6, 15.0, 14.0))
    Traceback (most recent call last):
    world.errors.FlightError: stall 14 m/s: allowed 5.25..13.05 m/s at a cruise speed of 15 m/s
    """
    for field, (option_name, unit, min_value, max_value, factor) in RANGES.items():
        value = getattr(sheet, field) / factor
        if field not in ("mass", "span", "cruise", "stall") and value == 0.0:
            continue
        if not _is_within(value, min_value, max_value):
            raise _range_error(option_name, value, f"allowed {min_value:g}..{max_value:g} {unit}", unit)
    min_value, max_value = (ratio * sheet.cruise for ratio in STALL_RATIO_RANGE)
    if not _is_within(sheet.stall, min_value, max_value):
        raise _range_error("stall", sheet.stall, f"allowed {_speed_range_text(min_value, max_value, sheet)}", "m/s")
    min_value, max_value = (ratio * sheet.cruise for ratio in TOP_RATIO_RANGE)
    if sheet.top and not _is_within(sheet.top, min_value, max_value):
        raise _range_error("top", sheet.top, f"allowed {_speed_range_text(min_value, max_value, sheet)}", "m/s")
    area = _wing_area(sheet)
    lift = _weight(sheet) / (0.5 * SEA_LEVEL * sheet.stall**2 * area)
    if not _is_within(lift, *LIFT_RANGE):
        min_stall, max_stall = (math.sqrt(lift / lift_limit) * sheet.stall for lift_limit in reversed(LIFT_RANGE))
        areas = f"{lift / LIFT_RANGE[1] * area:.3g}..{lift / LIFT_RANGE[0] * area:.3g} m2 at this stall speed"
        allowed = (
            f"allowed {min_stall:.3g}..{max_stall:.3g}"
            f" m/s without flaps for {sheet.mass:g} kg on {area:g} m2, or a wing area of {areas}"
        )
        raise _range_error("stall", sheet.stall, allowed, "m/s")
    aspect = sheet.span**2 / area
    if not _is_within(aspect, *ASPECT_RANGE):
        min_span, max_span = (math.sqrt(aspect_limit * area) for aspect_limit in ASPECT_RANGE)
        source = "as stated" if sheet.area else "the area for this mass and stall speed; state the area if you know it"
        allowed = f"allowed {min_span:.2f}..{max_span:.2f} m with a wing of {area:.3g} m2 ({source})"
        raise _range_error("span", sheet.span, allowed, "m")
    electric_options = [name for name, is_given in (("--battery", sheet.volts), ("--motor", sheet.motor)) if is_given]
    if sheet.burns_fuel and electric_options:
        raise _range_error("fuel", sheet.fuel, f"cannot be combined with {' and '.join(electric_options)}", "kg")
    if not _is_within(sheet.fuel, 0.0, 0.6 * sheet.mass):
        raise _range_error("fuel", sheet.fuel, f"allowed up to 60 % of the mass, {0.6 * sheet.mass:g} kg", "kg")
    if not sheet.burns_fuel and not _is_within(sheet.energy, 0.0, MAX_BATTERY * sheet.mass):
        max_energy = MAX_BATTERY / 3600.0
        capacity = f"{max_energy * sheet.mass:g} Wh for an aircraft of {sheet.mass:g} kg ({max_energy:g} Wh per kg)"
        allowed = f"allowed up to {capacity}"
        raise _range_error("battery", sheet.energy / 3600.0, allowed, "Wh")
    return sheet


def _range_error(option: str, value: float, allowed: str, unit: str) -> FlightError:
    """Return the FlightError for a value that is out of range.

    allowed: text on the allowed range.
    """
    return FlightError.of_argument(option, value, allowed, shown=f"{value:g} {unit}")


def _speed_range_text(min_speed: float, max_speed: float, sheet: DataSheet) -> str:
    """Return the text for a range of speeds (m/s) that depends on the cruise speed of the sheet."""
    return f"{min_speed:.4g}..{max_speed:.4g} m/s at a cruise speed of {sheet.cruise:g} m/s"


def _weight(sheet: DataSheet) -> float:
    """Return the weight of the aircraft, N."""
    return sheet.mass * GRAVITY


def _wing_area(sheet: DataSheet) -> float:
    """Return the wing area, m^2.

    The area is the stated area, or else the area that the stall speed requires at the maximum lift coefficient of the
    aircraft's class.
    """
    if sheet.area:
        return sheet.area
    return _weight(sheet) / (0.5 * SEA_LEVEL * sheet.stall**2 * CLASSES[sheet.layout].lift_max)


@dataclass(frozen=True, slots=True)
class SizedAircraft:
    """A model that matches a data sheet, and the names of its guessed values.

    numbers: numbers of the model.
    sheet: the sheet with all missing values filled in.
    guessed: fields that were filled in.
    partial_climb: stated climb at less than full throttle, rad; NaN if none was stated. `sheet.climb` is the climb at
        full throttle.
    climb_shortfall: stated climb minus the model's climb at the same throttle, rad; 0 if the model reaches the stated
        climb.
    """

    numbers: ModelNumbers
    sheet: DataSheet
    guessed: tuple[str, ...]
    partial_climb: float = math.nan
    climb_shortfall: float = 0.0


def size_aircraft(
    sheet: DataSheet, title: str = "", aircraft_class: AircraftClass | None = None, prior: PowerPrior = POWER_PRIOR
) -> SizedAircraft:
    """Build the model of an aircraft from its data sheet.

    title: title of the model; "" for a title from layout, mass and span.
    aircraft_class: class of the aircraft; None for the class of the layout.
    prior: drag, efficiency and avionics power as functions of the size.

    Raises FlightError for a stall speed or a sink rate out of range, and if no propeller gives the stated climb and top
    speed.

    >>> aircraft = size_aircraft(check_sheet(DataSheet(2.1, 1.6, 15.0, 10.0)))
    >>> round(aircraft.numbers.area, 3), aircraft.guessed
    (0.269, ('area', 'top', 'bank', 'climb', 'volts', 'energy'))
    """
    aircraft_class = CLASSES[sheet.layout] if aircraft_class is None else aircraft_class
    filled_sheet, guessed_fields = _fill_sheet(sheet)
    estimated_aero = aero = _estimate_coefficients(filled_sheet, aircraft_class, prior)
    drag = _drag_function(filled_sheet, aero)
    if sheet.sink:
        aero, drag = _match_sink(filled_sheet, estimated_aero, sheet.sink)
    # The performance of motor or engine and propeller is the climb and the top speed in the sheet.
    try:
        propulsion, full_sheet = _size_any_motor(sheet, filled_sheet, drag)
    except _NoPropellerError:
        raise _no_propeller_error(sheet, filled_sheet, drag) from None
    for _ in range(_SINK_STEP_COUNT if sheet.sink else 0):
        # A pilot measures the sink rate with the idle propeller, whose drag follows from the motor.
        with contextlib.suppress(_NoPropellerError):
            idle_drag = -propulsion.thrust(0.0, sheet.cruise, SHEET_DENSITY)
            matched_aero, drag = _match_sink(filled_sheet, estimated_aero, sheet.sink, idle_drag)
            propulsion, full_sheet = _size_any_motor(sheet, filled_sheet, drag)
            aero = matched_aero
    if isinstance(propulsion, ElectricMotor):
        # In level flight at cruise the battery power without avionics equals drag times airspeed divided by the
        # propulsive efficiency of the prior.
        speed, min_throttle, max_throttle = sheet.cruise, 0.0, 1.0
        for _ in range(60):
            throttle = 0.5 * (min_throttle + max_throttle)
            has_excess = propulsion.thrust(throttle, speed, SHEET_DENSITY) > drag(speed)
            min_throttle, max_throttle = (min_throttle, throttle) if has_excess else (throttle, max_throttle)
        motor_power = drag(speed) * speed / prior.propulsive_efficiency(sheet.mass)
        power_ratio = motor_power / propulsion.power(max_throttle, speed, SHEET_DENSITY)
        propulsion = replace(propulsion, power_ratio=power_ratio, avionics=prior.avionics)
    chord = full_sheet.area / full_sheet.span
    jx, jy, jz = (full_sheet.mass * (ratio * full_sheet.span) ** 2 for ratio in aircraft_class.gyration)
    numbers = ModelNumbers(
        title=title or f"{_LAYOUT_TEXTS[sheet.layout]} of {sheet.mass:g} kg, {sheet.span:g} m",
        source="From a data sheet, scaled from published aircraft of its class: see README.md in this folder.",
        mass=full_sheet.mass,
        area=full_sheet.area,
        span=full_sheet.span,
        chord=chord,
        inertia=(jx, jy, jz, aircraft_class.product_share * jz),
        aero=aero,
        propulsion=propulsion,
        layout=sheet.layout,
        throw=aircraft_class.throw,
        rate=math.radians(300.0),
        lag=(0.05, 0.1 if not sheet.burns_fuel else 0.3),
        # A fuel engine drives its own generator.
        factors=(*FACTORS, *(name for name in POWER_FACTORS if name != "avionics-power" or not sheet.burns_fuel)),
    )
    partial_climb = sheet.climb if sheet.climb and sheet.climb_throttle < 1.0 else math.nan
    excess_thrust = propulsion.thrust(sheet.climb_throttle, sheet.cruise, SHEET_DENSITY) - drag(sheet.cruise)
    shortfall = sheet.climb - math.asin(max(-1.0, min(1.0, excess_thrust / _weight(sheet))))
    shortfall = shortfall if math.isfinite(partial_climb) and shortfall > _CLIMB_TOLERANCE_RAD else 0.0
    return SizedAircraft(numbers, full_sheet, guessed_fields, partial_climb, shortfall)


# Words for each layout.
_LAYOUT_TEXTS = {"tail": "aircraft with a tail", "wing": "flying wing", "vtail": "aircraft with a V-tail"}


def _fill_sheet(sheet: DataSheet) -> tuple[DataSheet, tuple[str, ...]]:
    """Return the sheet with missing values filled in, and the names of the fields that were missing."""
    defaults: dict[str, Any] = {
        "area": _wing_area(sheet),
        "top": DEFAULT_TOP_RATIO * sheet.cruise,
        "bank": DEFAULT_BANK,
        "climb": DEFAULT_CLIMB,
    }
    if sheet.burns_fuel:
        sheet = replace(sheet, energy=sheet.fuel * FUEL_HEAT)
    else:
        defaults["volts"] = next(volts for mass, volts in _DEFAULT_VOLTS if sheet.mass < mass)
        defaults["energy"] = BATTERY_PER_MASS * sheet.mass
    guessed_fields = tuple(name for name in defaults if not getattr(sheet, name))
    values = {name: getattr(sheet, name) or defaults[name] for name in defaults}
    full_sheet: DataSheet = replace(sheet, **values)
    return full_sheet, guessed_fields


def elliptic_slope(aspect: float) -> float:
    """Return the lift slope of a straight wing with an aspect ratio, per radian (Helmbold; Raymer 12.4).

    >>> round(elliptic_slope(1e9), 4)  # 2 pi for an infinite aspect ratio
    6.2832
    """
    return 2.0 * math.pi * aspect / (2.0 + math.sqrt(4.0 + aspect**2))


def _estimate_coefficients(sheet: DataSheet, aircraft_class: AircraftClass, prior: PowerPrior) -> AeroCoefficients:
    """Estimate the aerodynamic coefficients of an aircraft from its data sheet and its class.

    prior: gives the minimum drag.

    Raises FlightError if the stall speed is too low for the wing.
    """
    area, chord = sheet.area, sheet.area / sheet.span
    aspect = sheet.span / chord
    slope = aircraft_class.lift_slope * elliptic_slope(aspect)
    aspect_factor = aspect if aircraft_class.scales_with_aspect_ratio else 1.0
    pitch_stiffness = aircraft_class.pitch_alpha * aspect_factor
    weight = _weight(sheet)
    cruise_lift = weight / (0.5 * SHEET_DENSITY * sheet.cruise**2 * area)
    lift_max = weight / (0.5 * SEA_LEVEL * sheet.stall**2 * area)
    # The elevator that the sheet's stall speed needs is short of its stop, so that it can pull in turns and gusts.
    elevator_travel = aircraft_class.elevator_stall - CRUISE_ELEVATOR
    alpha_range = (lift_max - cruise_lift - aircraft_class.lift_elevator * elevator_travel) / slope
    cruise_alpha = min(CRUISE_ALPHA, MAX_STALL_ALPHA - alpha_range)
    if cruise_alpha < MIN_CRUISE_ALPHA:
        lift_limit = lift_max - slope * (MIN_CRUISE_ALPHA - cruise_alpha)
        min_stall = sheet.stall * math.sqrt(lift_max / lift_limit)
        allowed = (
            f"allowed {min_stall:.3g}..{STALL_RATIO_RANGE[1] * sheet.cruise:.4g}"
            f" m/s for a wing of aspect ratio {aspect:.1f}"
        )
        raise _range_error("stall", sheet.stall, allowed, "m/s")
    # An elevator just strong enough to reach the stall may be too weak for the fastest level flight.
    max_elevator_travel = MAX_ZERO_LIFT_ELEVATOR * aircraft_class.throw[0] - CRUISE_ELEVATOR
    elevator_moment = pitch_stiffness * max(alpha_range / -elevator_travel, cruise_lift / slope / max_elevator_travel)
    lift_0 = cruise_lift - slope * cruise_alpha - aircraft_class.lift_elevator * CRUISE_ELEVATOR
    # The lift curve is straight up to the elevator's stop, so that the slowest level flight has a trim.
    stall_alpha = cruise_alpha - elevator_travel * elevator_moment / pitch_stiffness
    reynolds = sheet.cruise * chord / VISCOSITY
    return AeroCoefficients(
        lift_0=lift_0,
        lift_alpha=slope,
        lift_q=aircraft_class.lift_q,
        lift_elevator=aircraft_class.lift_elevator,
        drag_min=prior.min_drag_coefficient(sheet.layout, aspect, reynolds),
        drag_lift=1.0 / (math.pi * aircraft_class.oswald * aspect),
        pitch_0=-pitch_stiffness * cruise_alpha - elevator_moment * CRUISE_ELEVATOR,
        pitch_alpha=pitch_stiffness,
        pitch_q=aircraft_class.pitch_q * aspect_factor,
        pitch_elevator=elevator_moment,
        side_beta=aircraft_class.side_beta,
        side_rudder=aircraft_class.side_rudder,
        roll_beta=aircraft_class.roll_beta,
        roll_p=aircraft_class.roll_p,
        roll_r=aircraft_class.roll_r,
        roll_aileron=aircraft_class.roll_aileron,
        roll_rudder=aircraft_class.roll_rudder,
        yaw_beta=aircraft_class.yaw_beta,
        yaw_p=aircraft_class.yaw_p,
        yaw_r=aircraft_class.yaw_r,
        yaw_aileron=aircraft_class.yaw_aileron,
        yaw_rudder=aircraft_class.yaw_rudder,
        stall_alpha=stall_alpha + 8.0 / STALL_SHARPNESS,
        stall_sharpness=STALL_SHARPNESS,
    )


# Motors that a data sheet can describe, each with its propeller.
Motor = ElectricMotor | FuelEngine
# Drag, N, by airspeed, m/s.
Drag = Callable[[float], float]


def _drag_function(sheet: DataSheet, aero: AeroCoefficients) -> Drag:
    """Return a function that computes the drag (N) in level flight at an airspeed (m/s)."""

    def drag(airspeed: float) -> float:
        """Return the drag in level flight at an airspeed (m/s), N."""
        area_times_pressure = 0.5 * SHEET_DENSITY * airspeed**2 * sheet.area
        # The drag depends only on the angle of attack, as in the model; the elevator's lift is neglected.
        lift_coefficient = _weight(sheet) / area_times_pressure
        return area_times_pressure * (aero.drag_min + aero.drag_lift * lift_coefficient**2)

    return drag


def _match_sink(
    sheet: DataSheet, aero: AeroCoefficients, sink: float, idle_drag: float = 0.0
) -> tuple[AeroCoefficients, Drag]:
    """Adjust the minimum drag to a sink rate; return the new coefficients and their drag function.

    sink: sink rate at cruise with the power off, m/s.
    idle_drag: drag of the idle propeller, N; 0 for a folded propeller. If the drag that remains for the wing is too
        small, the wing has its smallest drag, and the aircraft sinks faster.

    Raises FlightError if the sink rate with a folded propeller is out of range for the wing.
    """
    angle = math.asin(min(0.5, sink / sheet.cruise))
    area_times_pressure = 0.5 * SHEET_DENSITY * sheet.cruise**2 * sheet.area
    lift = _weight(sheet) * math.cos(angle) / area_times_pressure
    drag_min = _weight(sheet) * math.sin(angle) / area_times_pressure - aero.drag_lift * lift**2
    lowest_drag_min, highest_drag_min = 0.4 * aero.drag_min, 2.5 * aero.drag_min
    if not lowest_drag_min <= drag_min <= highest_drag_min:
        min_sink, max_sink = (
            sheet.cruise * (limit + aero.drag_lift * lift**2) * area_times_pressure / _weight(sheet)
            for limit in (lowest_drag_min, highest_drag_min)
        )
        allowed = (
            f"allowed {min_sink:.2f}..{max_sink:.2f} m/s for this wing at {sheet.cruise:g} m/s; without this line of"
            " the parameter file, the drag is estimated"
        )
        message = f"TECS_SINK_MIN {sink:g} m/s: {allowed}"
        raise FlightError(message, field="TECS_SINK_MIN", value=sink, allowed=allowed)
    new_aero = replace(aero, drag_min=max(lowest_drag_min, drag_min - idle_drag / area_times_pressure))
    return new_aero, _drag_function(sheet, new_aero)


# ----------------------------------------------------------------------
# Motor and propeller with the stated climb at cruise and the stated top speed.


class _NoPropellerError(Exception):
    """No propeller gives the climb and the top speed of a sheet; `size_aircraft` adds the reason."""


def _size_any_motor(stated_sheet: DataSheet, sheet: DataSheet, drag: Drag) -> tuple[Motor, DataSheet]:
    """Size the engine or the electric motor of an aircraft, and its propeller.

    stated_sheet: sheet with only the stated values.
    sheet: the sheet with missing values filled in.
    drag: function that returns the drag in level flight (N) at an airspeed (m/s).

    Returns the motor or engine, and the sheet with the climb and top speed that it gives. Raises _NoPropellerError if
    no propeller meets the sheet.

    A stated climb at reduced throttle may imply a climb at full throttle above `MAX_CLIMB`. Higher top speeds are then
    tried if the top speed is only guessed, to keep the stated climb; otherwise the climb at full throttle is set to
    `MAX_CLIMB`.
    """
    size_function = _size_engine if sheet.burns_fuel else _size_motor
    propulsion, result = size_function(stated_sheet, sheet, drag)
    if not stated_sheet.climb or result.climb <= MAX_CLIMB * (1.0 + _EDGE_ROUNDING):
        return propulsion, result
    has_stated_pitch = stated_sheet.propeller[0] and (stated_sheet.motor or sheet.burns_fuel)
    for ratio in () if stated_sheet.top or has_stated_pitch else sorted(_TOP_GUESSES):
        faster_stated, faster = (replace(given, top=ratio * sheet.cruise) for given in (stated_sheet, sheet))
        with contextlib.suppress(_NoPropellerError):
            propulsion, result = size_function(faster_stated, faster, drag)
            if result.climb <= MAX_CLIMB:
                return propulsion, result
    stated_sheet, sheet = (replace(given, climb=MAX_CLIMB, climb_throttle=1.0) for given in (stated_sheet, sheet))
    return size_function(stated_sheet, sheet, drag)


def _size_motor(stated_sheet: DataSheet, sheet: DataSheet, drag: Drag) -> tuple[ElectricMotor, DataSheet]:
    """Size an electric motor and its propeller; return the motor and the sheet with its performance.

    A stated propeller determines diameter and pitch, a stated motor determines the speed per volt. The other values are
    chosen to meet the climb, and the throttle of level flight or the top speed. If motor and propeller are both stated,
    they determine the climb and the top speed that the sheet does not state.
    """
    if stated_sheet.motor and stated_sheet.propeller[0]:
        target_fields = [name for name in ("climb", "top") if getattr(stated_sheet, name)]
        motor, result = _solve_motor(stated_sheet, sheet, drag, target_fields)
        if result.climb <= MAX_CLIMB:
            return motor, result
        # With more thrust than that, the climb is limited.
        return _solve_motor(stated_sheet, replace(sheet, climb=MAX_CLIMB, climb_throttle=1.0), drag, ["climb"])
    if stated_sheet.climb and stated_sheet.trim_throttle and not stated_sheet.top:
        # The climb that an autopilot is configured with is often less than the motor gives.
        with contextlib.suppress(_NoPropellerError):
            return _solve_motor(stated_sheet, sheet, drag, ["climb", "trim_throttle"])
    if stated_sheet.climb or not (stated_sheet.top or stated_sheet.trim_throttle):
        tops = [sheet.top] if stated_sheet.top else [ratio * sheet.cruise for ratio in _TOP_GUESSES]
        return _solve_first_feasible(stated_sheet, [replace(sheet, top=top) for top in tops], drag)
    # Use a propeller of the usual size, and derive the speed per volt from the top speed or the throttle: both
    # determine the climb better than a guess.
    unstated = replace(stated_sheet, top=0.0, trim_throttle=0.0)
    usual_motor, _ = _solve_first_feasible(
        unstated, [replace(sheet, top=ratio * sheet.cruise) for ratio in _TOP_GUESSES], drag
    )
    propeller = stated_sheet.propeller if stated_sheet.propeller[0] else (usual_motor.propeller.diameter, 0.0)
    target_fields = ["top"] if stated_sheet.top else ["trim_throttle"]
    sized_sheet = replace(stated_sheet, propeller=propeller)
    free_sheet = replace(stated_sheet, trim_throttle=0.0)
    return _solve_with_climb_limit(
        lambda: _solve_motor(sized_sheet, sheet, drag, target_fields),
        lambda climb: _solve_motor(free_sheet, replace(sheet, climb=climb), drag, ["climb", "top"]),
    )


_D = TypeVar("_D", ElectricMotor, FuelEngine)


def _solve_with_climb_limit(
    solve: Callable[[], tuple[_D, DataSheet]], solve_for_climb: Callable[[float], tuple[_D, DataSheet]]
) -> tuple[_D, DataSheet]:
    """Solve for a motor; if the climb is then too steep or there is no solution, try guessed climbs.

    solve: function that solves without a required climb.
    solve_for_climb: function that solves for a required climb, rad.

    The limit is `MAX_CLIMB`. Returns the motor and the sheet with its performance. Raises _NoPropellerError if no
    guessed climb has a solution.
    """
    climbs = _CLIMB_GUESSES_DEG
    with contextlib.suppress(_NoPropellerError):
        motor, result = solve()
        if result.climb <= MAX_CLIMB:
            return motor, result
        climbs = climbs[::-1]
    for climb in climbs:
        with contextlib.suppress(_NoPropellerError):
            return solve_for_climb(math.radians(climb))
    raise _NoPropellerError


def _solve_first_feasible(
    stated_sheet: DataSheet, sheets: Sequence[DataSheet], drag: Drag
) -> tuple[ElectricMotor, DataSheet]:
    """Solve for a motor with climb and top speed of the first sheet for which a solution exists.

    Returns the motor and the sheet with its performance. Raises _NoPropellerError if no sheet has a solution.
    """
    for sheet in sheets:
        with contextlib.suppress(_NoPropellerError):
            return _solve_motor(stated_sheet, sheet, drag, ["climb", "top"])
    raise _NoPropellerError


def _solve_motor(
    stated_sheet: DataSheet, sheet: DataSheet, drag: Drag, target_fields: list[str]
) -> tuple[ElectricMotor, DataSheet]:
    """Solve for the motor and propeller that meet some fields of a sheet.

    stated_sheet: sheet with only the stated motor and propeller, which stay unchanged.
    sheet: sheet with the values to meet.
    target_fields: fields of `DataSheet` whose values are met. One number is free for each field: the size of the
        propeller, and the motor's speed per volt or the propeller's pitch.

    Returns the motor, and the sheet with the resulting climb and top speed. Raises _NoPropellerError if there is no
    solution, or only one with a propeller of unusual size.
    """
    volts, (diameter, pitch) = sheet.volts, stated_sheet.propeller
    # With the Aerosonde's blade shape the ratio of pitch to diameter is the zero-thrust ratio.
    pitch_ratio = pitch / diameter / BOOK_PROPELLER.zero_thrust_ratio if pitch else 1.0
    base = BOOK_PROPELLER.scale(diameter=diameter / BOOK_PROPELLER.diameter if diameter else 1.0, pitch=pitch_ratio)
    emf = 60.0 / (2.0 * math.pi * stated_sheet.motor) if stated_sheet.motor else 0.0
    initial_size = 1.0 if diameter else math.sqrt(sheet.mass / 11.0)
    # Initial guess: unloaded propeller speed slightly above the speed for the top airspeed, rad/s.
    initial_speed = 1.2 * sheet.top / base.zero_thrust_ratio / (base.diameter * initial_size) * 2.0 * math.pi
    has_one_unknown = len(target_fields) == 1 and target_fields != ["climb"]

    def make_motor(free_factors: Sequence[float]) -> ElectricMotor:
        """Return the motor in which the free numbers are their initial values times some factors."""
        size_factor, speed_factor = (1.0, free_factors[0]) if has_one_unknown else (*free_factors, 1.0, 1.0)[:2]
        propeller = (
            base.scale(blades=size_factor * initial_size)
            if diameter
            else base.scale(diameter=size_factor * initial_size)
        )
        if emf:
            return _motor_with_typical_losses(propeller.scale(pitch=speed_factor), volts, emf, sheet.cruise)
        return _motor_with_typical_losses(propeller, volts, volts / (speed_factor * initial_speed), sheet.cruise)

    def errors(free_factors: Sequence[float]) -> list[float]:
        """Return the relative thrust error of each target field."""
        motor = make_motor(free_factors)
        return [_thrust_error(motor, sheet, drag, name) for name in target_fields]

    motor = make_motor(_solve_for_factors(errors, len(target_fields)))
    if not _MIN_DIAMETER_M <= motor.propeller.diameter <= _MAX_DIAMETER_RATIO * sheet.span:
        raise _NoPropellerError
    return motor, _with_performance(sheet, motor, drag)


def _motor_with_typical_losses(propeller: Propeller, volts: float, emf: float, cruise: float) -> ElectricMotor:
    """Return a motor with the relative losses of the Aerosonde's motor at full throttle in cruise.

    volts: battery voltage, V.
    emf: back-emf constant, V s/rad.
    cruise: cruise airspeed, m/s.
    """
    power = 0.3 * volts**2 * emf
    motor = ElectricMotor(propeller, volts, emf, 0.1, 0.5, WINDMILL_FRACTION)
    for _ in range(12):
        motor = replace(
            motor, resistance=_RESISTANCE_RATIO * volts**2 / power, idle_current=_IDLE_CURRENT_RATIO * power / volts
        )
        power = math.sqrt(power * max(1.0, motor.power(1.0, cruise, SHEET_DENSITY)))
    return motor


def _size_engine(stated_sheet: DataSheet, sheet: DataSheet, drag: Drag) -> tuple[FuelEngine, DataSheet]:
    """Size an engine and its propeller; return the engine and the sheet with its performance.

    The engine is sized for the stated climb or top speed. If both are stated, the pitch of the propeller is chosen as
    well.
    """
    # A stated top speed determines the climb better than a guess.
    target_fields = [name for name in ("climb", "top") if getattr(stated_sheet, name)] or ["climb"]
    if target_fields != ["top"]:
        return _solve_engine(sheet, drag, target_fields)
    return _solve_with_climb_limit(
        lambda: _solve_engine(sheet, drag, target_fields),
        lambda climb: _solve_engine(replace(sheet, climb=climb), drag, ["climb", "top"]),
    )


def _solve_engine(sheet: DataSheet, drag: Drag, target_fields: list[str]) -> tuple[FuelEngine, DataSheet]:
    """Solve for the engine torque that meets one field of a sheet; for two fields also for the pitch.

    Returns the engine and the sheet with its performance. Raises _NoPropellerError if there is no solution.
    """
    needed_thrust = drag(sheet.cruise) + _weight(sheet) * math.sin(sheet.climb)
    diameter, pitch = sheet.propeller
    pitch_ratio = pitch / diameter / BOOK_PROPELLER.zero_thrust_ratio if diameter else 1.0
    usual_size = min(math.sqrt(sheet.mass / 11.0), _ENGINE_DIAMETER_RATIO * sheet.span / BOOK_PROPELLER.diameter)
    base_propeller = BOOK_PROPELLER.scale(
        diameter=diameter / BOOK_PROPELLER.diameter if diameter else usual_size, pitch=pitch_ratio
    )
    initial_torque = 0.12 * needed_thrust * base_propeller.diameter

    def make_engine(free_factors: Sequence[float]) -> FuelEngine:
        """Return the engine whose torque and pitch are their initial values times some factors."""
        torque_factor, pitch_factor = (*free_factors, 1.0)[:2]
        torque = torque_factor * initial_torque
        return FuelEngine(
            base_propeller.scale(pitch=pitch_factor),
            torque,
            _FRICTION_RATIO * torque,
            _ENGINE_EFFICIENCY,
            WINDMILL_FRACTION,
        )

    def errors(free_factors: Sequence[float]) -> list[float]:
        """Return the relative thrust error of each target field."""
        engine = make_engine(free_factors)
        return [_thrust_error(engine, sheet, drag, name) for name in target_fields]

    engine = make_engine(_solve_for_factors(errors, len(target_fields)))
    return engine, _with_performance(sheet, engine, drag)


def _thrust_error(motor: Motor, sheet: DataSheet, drag: Drag, field: str) -> float:
    """Return the relative error of a motor's thrust against the thrust that a field of the sheet requires.

    field: "top" requires a thrust at top speed and full throttle, "climb" at cruise and `DataSheet.climb_throttle`, and
        "trim_throttle" requires the drag of level flight at that throttle.
    """
    speed = sheet.top if field == "top" else sheet.cruise
    throttle = {"trim_throttle": sheet.trim_throttle, "climb": sheet.climb_throttle}.get(field, 1.0)
    needed_thrust = drag(speed) + (_weight(sheet) * math.sin(sheet.climb) if field == "climb" else 0.0)
    return motor.thrust(throttle, speed, SHEET_DENSITY) / needed_thrust - 1.0


def _solve_for_factors(errors: Callable[[Sequence[float]], list[float]], count: int) -> list[float]:
    """Find positive factors near 1 for which all errors are 0.

    errors: function that returns `count` errors for `count` factors.

    Raises _NoPropellerError if no such factors are found.
    """
    if not count:
        return []
    for size in (1.0, 0.6, 1.7):
        solution = _solve_by_newton(
            lambda logarithms: np.array(errors(np.exp(logarithms).tolist())), np.log([size, 1.0 / size][:count])
        )
        if solution is not None:
            return np.exp(solution).tolist()
    raise _NoPropellerError


# Step of the difference quotients, as a logarithm of a factor.
_DIFFERENCE_STEP = 1e-6
# Largest step of the search, which is to find the nearest solution, as a logarithm of a factor.
_MAX_STEP = 0.2
# Bound of the search, as a logarithm of a factor.
_SEARCH_BOUND = 2.5
# Relative thrust error of a solution.
_THRUST_TOLERANCE_RATIO = 1e-7


def _solve_by_newton(errors: Callable[[Floats], Floats], x: Floats) -> Floats | None:
    """Find a zero of the errors by Newton's method; return None if it does not converge.

    errors: function that returns n errors for n numbers.
    x: first guess, (n,). The numbers stay between -`_SEARCH_BOUND` and `_SEARCH_BOUND`.

    A step that does not reduce the errors is halved.
    """
    residual = errors(x)
    for _ in range(100):
        slopes = np.array(
            [
                (errors(x + step) - errors(x - step)) / (2.0 * _DIFFERENCE_STEP)
                for step in _DIFFERENCE_STEP * np.eye(x.size)
            ]
        ).T
        full_step = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        fraction = min(1.0, _MAX_STEP / max(float(np.abs(full_step).max()), 1e-12))
        while fraction > 1e-6:
            candidate = np.clip(x + fraction * full_step, -_SEARCH_BOUND, _SEARCH_BOUND)
            if np.linalg.norm(candidate_residual := errors(candidate)) < np.linalg.norm(residual):
                break
            fraction *= 0.5
        else:
            break
        x, residual = candidate, candidate_residual
    return x if np.abs(residual).max() < _THRUST_TOLERANCE_RATIO else None


def _no_propeller_error(stated_sheet: DataSheet, sheet: DataSheet, drag: Drag) -> FlightError:
    """Return the error for a sheet that no propeller meets.

    If the sheet states a climb angle, a top speed or a motor, the error names the values for which a propeller exists.

    sheet: the sheet with missing values filled in.
    """
    field = next((name for name in ("climb", "top", "motor") if getattr(stated_sheet, name)), "")
    if not field:
        reason = "no propeller of this size and pitch" if stated_sheet.propeller[0] else "no propeller"
        allowed = f"{reason} can fly {sheet.mass:g} kg at {sheet.cruise:g} m/s; state the climb, the top speed or both"
        return FlightError.of_argument("prop" if stated_sheet.propeller[0] else "cruise", None, allowed, shown="")
    option, unit, min_value, max_value, factor = RANGES[field]
    if field == "top":
        min_value, max_value = (ratio * sheet.cruise for ratio in TOP_RATIO_RANGE)
    feasible_values = []
    for value in np.geomspace(min_value, max_value, _RANGE_STEP_COUNT).tolist():
        changed_field = {field: value * factor}
        with contextlib.suppress(_NoPropellerError):
            _size_any_motor(replace(stated_sheet, **changed_field), replace(sheet, **changed_field), drag)
            feasible_values.append(value)
    other_conditions = [
        f"{title} of {getattr(stated_sheet, name) / RANGES[name][4]:.3g} {RANGES[name][1]}"
        for name, title in (("top", "a top speed"), ("motor", "a motor"))
        if name != field and getattr(stated_sheet, name)
    ]
    condition = " and ".join([f"at {sheet.cruise:g} m/s", *other_conditions])
    allowed = (
        f"allowed about {min(feasible_values):.3g}..{max(feasible_values):.3g} {unit} {condition}"
        if feasible_values
        else f"no propeller reaches this value {condition}"
    )
    value = getattr(stated_sheet, field) / factor
    return FlightError.of_argument(option, value, allowed, shown=f"{value:.3g} {unit}")


def _with_performance(sheet: DataSheet, motor: Motor, drag: Drag) -> DataSheet:
    """Return the sheet with the climb angle and the top speed that a motor gives the aircraft.

    Raises _NoPropellerError if the climb angle is below the minimum in `RANGES`.
    """
    excess_thrust = motor.thrust(1.0, sheet.cruise, SHEET_DENSITY) - drag(sheet.cruise)
    climb = math.asin(max(-1.0, min(0.95, excess_thrust / _weight(sheet))))
    if not climb >= math.radians(RANGES["climb"][2]) * (1.0 - _EDGE_ROUNDING):
        raise _NoPropellerError
    min_speed, max_speed = sheet.cruise, 4.0 * sheet.cruise
    for _ in range(60):
        airspeed = 0.5 * (min_speed + max_speed)
        has_excess = motor.thrust(1.0, airspeed, SHEET_DENSITY) > drag(airspeed)
        min_speed, max_speed = (airspeed, max_speed) if has_excess else (min_speed, airspeed)
    return replace(sheet, climb=climb, top=min_speed, climb_throttle=1.0)
