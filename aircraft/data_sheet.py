"""An aircraft from the few numbers of a data sheet: a model of its class, scaled until it does what the sheet says.

What a sheet states is met exactly: mass, span, speeds, climb.  What it leaves open is taken from published aircraft of
the class (`TAIL`, `WING`) and has a standard deviation (`aircraft.uncertainty`).
"""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from aircraft.model_writer import AeroCoefficients, Layout, ModelNumbers
from aircraft.propulsion import BOOK_PROPELLER, ElectricMotor, FuelEngine, Propeller
from world.errors import FlightError

Floats = NDArray[np.float64]

# Air at sea level: density, kg/m^3, and kinematic viscosity, m^2/s.  Sheets are read as at 500 m, where most fly.
SEA_LEVEL, VISCOSITY = 1.225, 1.46e-5
SHEET_DENSITY = 1.1673


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What is known of an aircraft; 0 for what is not.  SI units and radians.

    mass: kg.  span: m.  area: m^2, of the wing.
    cruise, stall, top: airspeeds in level flight, m/s.  bank: steepest in turns.  climb: steepest at cruise.
    sink: at cruise without power, m/s.  trim_throttle: in level flight at cruise, 0..1.
    volts: of the battery; energy: J, of the battery, or heat of the fuel.
    motor: rpm a volt.  propeller: diameter and pitch, m.  fuel: kg; an aircraft with fuel has no battery.
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

    @property
    def fuelled(self) -> bool:
        """Whether it burns fuel."""
        return self.fuel > 0.0


# By the field of `DataSheet`: the option's name, its unit, what is allowed, and the factor from that unit to SI.
RANGES = {
    "mass": ("mass", "kg", 0.5, 25.0, 1.0),
    "span": ("span", "m", 0.5, 6.0, 1.0),
    "area": ("area", "m2", 0.05, 4.0, 1.0),
    "cruise": ("cruise", "m/s", 8.0, 45.0, 1.0),
    "stall": ("stall", "m/s", 5.0, 35.0, 1.0),
    "top": ("top", "m/s", 9.0, 70.0, 1.0),
    "bank": ("bank", "degrees", 15.0, 60.0, math.pi / 180.0),
    "climb": ("climb", "degrees", 2.0, 35.0, math.pi / 180.0),
    "motor": ("motor", "rpm a volt", 20.0, 5000.0, 1.0),
    "fuel": ("fuel", "kg", 0.05, 12.0, 1.0),
}
# Of two speeds, and of what follows from several numbers.
STALL_SHARE = (0.35, 0.87)  # stall by cruise
TOP_SHARE = (1.05, 2.5)  # top by cruise
LIFT_RANGE = (0.5, 2.4)  # lift coefficient at the stall
ASPECT_RANGE = (2.5, 25.0)  # span^2 / area
MAX_BATTERY = 300.0 * 3600.0  # J by the aircraft's mass, kg: no cell that is sold holds more by its own


@dataclass(frozen=True, slots=True)
class AircraftClass:
    """What published aircraft of a class have in common, without units; rates and angles as in `AeroCoefficients`.

    lift_slope: by that of the elliptic wing of the same aspect ratio.  lift_max: where the sheet has no area.
    drag: least drag at a Reynolds number of `DRAG_REYNOLDS` on the mean chord.  oswald: span efficiency.
    pitch_alpha, pitch_q: for each unit of aspect ratio where ``by_aspect``, else as they are.
    gyration: radii of gyration about x, y, z by the span.
    elevator_stall: elevator at the stall, rad; the sheet's stall is where it comes to its stop.
    """

    lift_slope: float
    lift_max: float
    drag: float
    oswald: float
    by_aspect: bool
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


DRAG_REYNOLDS, DRAG_POWER = 3.2e5, -0.2
# The Aerosonde (Beard and McLain, appendix E.2) and the Ultra Stick 25e (University of Minnesota): least drag 0.043 and
# 0.0434 at Reynolds numbers of 3.2e5 and 2.9e5, Cmq -38 and -13.6 at aspect ratios of 15.2 and 5.2, Cm_alpha -2.74 and
# -0.72; radii of gyration 0.095, 0.111, 0.138 and 0.150, 0.165, 0.220 of the span; elsewhere between the two.
TAIL = AircraftClass(
    lift_slope=1.05, lift_max=1.25, drag=0.0425, oswald=0.82, by_aspect=True, pitch_alpha=-0.16, pitch_q=-2.55,
    lift_q=7.0, lift_elevator=0.11, side_beta=-0.7, roll_beta=-0.085, roll_p=-0.48, roll_r=0.17, roll_aileron=0.17,
    yaw_beta=0.073, yaw_p=0.02, yaw_r=-0.13, yaw_aileron=-0.011, side_rudder=0.19, roll_rudder=0.005,
    yaw_rudder=-0.11, gyration=(0.12, 0.14, 0.175), product_share=0.08, elevator_stall=-math.radians(22.0),
    throw=(math.radians(25.0), math.radians(25.0), math.radians(25.0)),
)  # fmt: skip
# The Skywalker X8 (Gryte et al. 2018) and the Zagi (Beard and McLain, first edition, appendix E.1): lift slopes 0.89
# and 0.72 of the elliptic wing's, least drag 0.0182 and 0.0254 at Reynolds numbers of 4.4e5 and 3.4e5; laterally the
# X8, for the Zagi's table has no directional stability.
WING = AircraftClass(
    lift_slope=0.80, lift_max=1.05, drag=0.0225, oswald=0.86, by_aspect=False, pitch_alpha=-0.51, pitch_q=-1.35,
    lift_q=3.4, lift_elevator=0.275, side_beta=-0.22, roll_beta=-0.085, roll_p=-0.40, roll_r=0.055, roll_aileron=0.13,
    yaw_beta=0.0283, yaw_p=0.0044, yaw_r=-0.072, yaw_aileron=-0.0034, side_rudder=0.0, roll_rudder=0.0,
    yaw_rudder=0.0, gyration=(0.16, 0.12, 0.2), product_share=0.0, elevator_stall=-math.radians(22.0),
    throw=(math.radians(25.0), math.radians(25.0), math.radians(25.0)),
)  # fmt: skip
CLASSES: dict[Layout, AircraftClass] = {"tail": TAIL, "vtail": TAIL, "wing": WING}

# Where a sheet says nothing.
USUAL_CLIMB = math.radians(12.0)
USUAL_TOP = 1.4  # by cruise
STEEPEST_CLIMB = math.radians(35.0)
USUAL_BANK = math.radians(35.0)
BATTERY_PER_MASS = 45.0 * 3600.0  # J/kg: 30 % of the mass at 150 Wh/kg
# Volts by the mass, kg.
_VOLTS = ((1.5, 11.1), (5.0, 14.8), (10.0, 22.2), (math.inf, 44.4))
FUEL_HEAT = 43.5e6  # J/kg
# At cruise the body stands this far up, and the elevator's servo is rigged this far down, rad.
CRUISE_ALPHA, CRUISE_ELEVATOR = 0.05, -0.035
STALL_SHARPNESS = 80.0
# An idle propeller brakes as much of what a stiff one would.
WINDMILL = 0.5
# The Aerosonde's motor by its power and volts at full throttle in cruise: R P / V^2 and i0 V / P.
_RESISTANCE_SHARE, _IDLE_SHARE = 0.026, 0.055
# Of a propeller: least diameter, m, and largest by the span.
_MIN_DIAMETER, _DIAMETER_SHARE = 0.06, 0.6
# An engine's propeller by the span, at most.
_USUAL_SHARE = 0.18
# An engine's friction by its largest torque.
_FRICTION_SHARE = 0.08


def check_sheet(sheet: DataSheet) -> DataSheet:
    """Refuse what is no small aircraft.  Raises FlightError, in one line with the allowed range.

    >>> check_sheet(DataSheet(2.1, 1.6, 15.0, 10.0)).mass
    2.1
    >>> check_sheet(DataSheet(2.1, 1.6, 15.0, 14.0))
    Traceback (most recent call last):
    world.errors.FlightError: stall 14 m/s: allowed 5.25..13.05 m/s at a cruise speed of 15 m/s
    """
    for field, (option, unit, low, high, factor) in RANGES.items():
        value = getattr(sheet, field) / factor
        if field not in ("mass", "span", "cruise", "stall") and value == 0.0:
            continue
        if not low <= value <= high:
            raise _refused(option, value, f"allowed {low:g}..{high:g} {unit}", unit)
    low, high = (share * sheet.cruise for share in STALL_SHARE)
    if not low <= sheet.stall <= high:
        raise _refused("stall", sheet.stall, f"allowed {_of_cruise(low, high, sheet)}", "m/s")
    low, high = (share * sheet.cruise for share in TOP_SHARE)
    if sheet.top and not low <= sheet.top <= high:
        raise _refused("top", sheet.top, f"allowed {_of_cruise(low, high, sheet)}", "m/s")
    area = _area(sheet)
    lift = _weight(sheet) / (0.5 * SEA_LEVEL * sheet.stall**2 * area)
    low, high = (_weight(sheet) / (0.5 * SEA_LEVEL * sheet.stall**2 * one) for one in reversed(LIFT_RANGE))
    if not LIFT_RANGE[0] <= lift <= LIFT_RANGE[1]:
        allowed = f"allowed {low:.3g}..{high:.3g} m2 for {sheet.mass:g} kg that stall at {sheet.stall:g} m/s"
        raise _refused("area", area, allowed, "m2")
    aspect = sheet.span**2 / area
    if not ASPECT_RANGE[0] <= aspect <= ASPECT_RANGE[1]:
        low, high = (math.sqrt(one * area) for one in ASPECT_RANGE)
        allowed = f"allowed {low:.2f}..{high:.2f} m with a wing of {area:.3g} m2 ({_area_source(sheet)})"
        raise _refused("span", sheet.span, allowed, "m")
    if sheet.fuelled and (sheet.motor or sheet.volts):
        raise _refused("fuel", sheet.fuel, "goes without --battery and --motor", "kg")
    if sheet.fuel > 0.6 * sheet.mass:
        raise _refused("fuel", sheet.fuel, f"allowed up to 60 % of the mass, {0.6 * sheet.mass:g} kg", "kg")
    if not sheet.fuelled and sheet.energy > MAX_BATTERY * sheet.mass:
        most = MAX_BATTERY / 3600.0
        allowed = f"allowed up to {most * sheet.mass:g} Wh with a mass of {sheet.mass:g} kg, {most:g} Wh/kg"
        raise _refused("battery", sheet.energy / 3600.0, allowed, "Wh")
    return sheet


def _refused(option: str, value: float, allowed: str, unit: str) -> FlightError:
    return FlightError.of_argument(option, value, allowed, shown=f"{value:g} {unit}")


def _of_cruise(low: float, high: float, sheet: DataSheet) -> str:
    return f"{low:.4g}..{high:.4g} m/s at a cruise speed of {sheet.cruise:g} m/s"


def _weight(sheet: DataSheet) -> float:
    return sheet.mass * GRAVITY


def _area(sheet: DataSheet) -> float:
    """The wing's area, m^2: the sheet's, or what carries the mass at the stall with the class's largest lift."""
    if sheet.area:
        return sheet.area
    return _weight(sheet) / (0.5 * SEA_LEVEL * sheet.stall**2 * CLASSES[sheet.layout].lift_max)


def _area_source(sheet: DataSheet) -> str:
    return "as stated" if sheet.area else "that carries this mass at this stall speed; state the area if you know it"


@dataclass(frozen=True, slots=True)
class SizedAircraft:
    """A model that does what the sheet says, and what was guessed for it.

    numbers: of the model.  sheet: with every number filled in.
    guessed: fields of the sheet that it did not state.
    """

    numbers: ModelNumbers
    sheet: DataSheet
    guessed: tuple[str, ...]


def size_aircraft(sheet: DataSheet, title: str = "", kind: AircraftClass | None = None) -> SizedAircraft:
    """Make the model of a data sheet.

    kind: of which class it is; None takes the layout's.
    Raises FlightError where no propeller gives the stated climb and top speed.

    >>> made = size_aircraft(check_sheet(DataSheet(2.1, 1.6, 15.0, 10.0)))
    >>> round(made.numbers.area, 3), made.guessed
    (0.269, ('area', 'top', 'bank', 'climb', 'volts', 'energy'))
    """
    kind = CLASSES[sheet.layout] if kind is None else kind
    filled, guessed = _filled(sheet)
    aero = _aerodynamics(filled, kind)
    drag = _drag_of(filled, aero)
    if sheet.sink:
        aero, drag = _with_sink(filled, aero, sheet.sink)
    propulsion: ElectricMotor | FuelEngine
    propulsion, filled = (_engine if sheet.fuelled else _motor)(sheet, filled, drag)
    chord = filled.area / filled.span
    jx, jy, jz = (filled.mass * (share * filled.span) ** 2 for share in kind.gyration)
    numbers = ModelNumbers(
        title=title or f"{_KIND[sheet.layout]} of {sheet.mass:g} kg, {sheet.span:g} m",
        source="From a data sheet, scaled from published aircraft of its class: README.md beside this file.",
        mass=filled.mass,
        area=filled.area,
        span=filled.span,
        chord=chord,
        inertia=(jx, jy, jz, kind.product_share * jz),
        aero=aero,
        propulsion=propulsion,
        layout=sheet.layout,
        throw=kind.throw,
        rate=math.radians(300.0),
        lag=(0.05, 0.1 if not sheet.fuelled else 0.3),
    )
    return SizedAircraft(numbers, filled, guessed)


_KIND = {"tail": "aircraft with a tail", "wing": "flying wing", "vtail": "aircraft with a V-tail"}


def _filled(sheet: DataSheet) -> tuple[DataSheet, tuple[str, ...]]:
    """The sheet with what it leaves open, and the names of that."""
    usual: dict[str, Any] = {
        "area": _area(sheet),
        "top": USUAL_TOP * sheet.cruise,
        "bank": USUAL_BANK,
        "climb": USUAL_CLIMB,
    }
    if sheet.fuelled:
        sheet = replace(sheet, energy=sheet.fuel * FUEL_HEAT)
    else:
        usual["volts"] = next(volts for mass, volts in _VOLTS if sheet.mass < mass)
        usual["energy"] = BATTERY_PER_MASS * sheet.mass
    guessed = tuple(name for name in usual if not getattr(sheet, name))
    known = {name: getattr(sheet, name) or usual[name] for name in usual}
    filled: DataSheet = replace(sheet, **known)
    return filled, guessed


def elliptic_slope(aspect: float) -> float:
    """Lift curve slope a radian of a straight wing of this aspect ratio (Helmbold; Raymer, section 12.4).

    >>> round(elliptic_slope(1e9), 4)  # 2 pi for an endless one
    6.2832
    """
    return 2.0 * math.pi * aspect / (2.0 + math.sqrt(4.0 + aspect**2))


def _aerodynamics(sheet: DataSheet, kind: AircraftClass) -> AeroCoefficients:
    area, chord = sheet.area, sheet.area / sheet.span
    aspect = sheet.span / chord
    slope = kind.lift_slope * elliptic_slope(aspect)
    per_aspect = aspect if kind.by_aspect else 1.0
    stiffness = kind.pitch_alpha * per_aspect
    weight = _weight(sheet)
    cruise_lift = weight / (0.5 * SHEET_DENSITY * sheet.cruise**2 * area)
    lift_max = weight / (0.5 * SEA_LEVEL * sheet.stall**2 * area)
    lift_0 = cruise_lift - slope * CRUISE_ALPHA - kind.lift_elevator * CRUISE_ELEVATOR
    stall = (lift_max - lift_0 - kind.lift_elevator * kind.elevator_stall) / slope
    # The elevator comes to its stop where the sheet has the stall.
    travel = kind.elevator_stall - CRUISE_ELEVATOR
    elevator = -stiffness * (stall - CRUISE_ALPHA) / travel
    reynolds = sheet.cruise * chord / VISCOSITY
    return AeroCoefficients(
        lift_0=lift_0,
        lift_alpha=slope,
        lift_q=kind.lift_q,
        lift_elevator=kind.lift_elevator,
        drag_min=kind.drag * (reynolds / DRAG_REYNOLDS) ** DRAG_POWER,
        drag_lift=1.0 / (math.pi * kind.oswald * aspect),
        pitch_0=-stiffness * CRUISE_ALPHA - elevator * CRUISE_ELEVATOR,
        pitch_alpha=stiffness,
        pitch_q=kind.pitch_q * per_aspect,
        pitch_elevator=elevator,
        side_beta=kind.side_beta,
        side_rudder=kind.side_rudder,
        roll_beta=kind.roll_beta,
        roll_p=kind.roll_p,
        roll_r=kind.roll_r,
        roll_aileron=kind.roll_aileron,
        roll_rudder=kind.roll_rudder,
        yaw_beta=kind.yaw_beta,
        yaw_p=kind.yaw_p,
        yaw_r=kind.yaw_r,
        yaw_aileron=kind.yaw_aileron,
        yaw_rudder=kind.yaw_rudder,
        stall_alpha=stall + 8.0 / STALL_SHARPNESS,
        stall_sharpness=STALL_SHARPNESS,
    )


Drag = Callable[[float], float]


def _drag_of(sheet: DataSheet, aero: AeroCoefficients) -> Drag:
    """Drag, N, of level flight at an airspeed, m/s."""

    def drag(airspeed: float) -> float:
        area_pressure = 0.5 * SHEET_DENSITY * airspeed**2 * sheet.area
        # Of the angle of attack alone, as in the model; the elevator's share of the lift is left out.
        lift = _weight(sheet) / area_pressure
        return area_pressure * (aero.drag_min + aero.drag_lift * lift**2)

    return drag


def _with_sink(sheet: DataSheet, aero: AeroCoefficients, sink: float) -> tuple[AeroCoefficients, Drag]:
    """Least drag such that the aircraft sinks as stated (m/s) without power at cruise, a folded propeller assumed."""
    angle = math.asin(min(0.5, sink / sheet.cruise))
    area_pressure = 0.5 * SHEET_DENSITY * sheet.cruise**2 * sheet.area
    lift = _weight(sheet) * math.cos(angle) / area_pressure
    least = _weight(sheet) * math.sin(angle) / area_pressure - aero.drag_lift * lift**2
    low, high = 0.4 * aero.drag_min, 2.5 * aero.drag_min
    if not low <= least <= high:
        slow, fast = (
            sheet.cruise * (one + aero.drag_lift * lift**2) * area_pressure / _weight(sheet) for one in (low, high)
        )
        allowed = f"allowed {slow:.2f}..{fast:.2f} m/s for this wing at {sheet.cruise:g} m/s"
        raise FlightError.at("TECS_SINK_MIN", "", sink, allowed, shown=f"{sink:g} m/s")
    changed = replace(aero, drag_min=least)
    return changed, _drag_of(sheet, changed)


# ----------------------------------------------------------------------
# Motor and propeller: what gives the stated climb at cruise, and the stated top speed.


def _motor(stated: DataSheet, sheet: DataSheet, drag: Drag) -> tuple[ElectricMotor, DataSheet]:
    """The motor and the propeller of a sheet, and the sheet with the climb and the top speed that they give.

    A stated propeller has its diameter and pitch, a stated motor its speed per volt; what is left free meets the climb,
    and the throttle of level flight or the top speed.  Where motor and propeller are both stated, what the sheet does
    not say of climb and top speed follows from them.
    """
    if stated.motor and stated.propeller[0]:
        wanted = [name for name in ("climb", "top") if getattr(stated, name)]
        motor, flown = _solved(stated, sheet, drag, wanted)
        if flown.climb <= STEEPEST_CLIMB:
            return motor, flown
        # What hangs on its propeller climbs as steeply as anybody asks for.
        return _solved(stated, replace(sheet, climb=STEEPEST_CLIMB), drag, ["climb"])
    if (stated.climb and stated.top) or not (stated.top or stated.trim_throttle):
        return _solved(stated, sheet, drag, ["climb", "top"])
    if stated.climb:
        with contextlib.suppress(FlightError):
            return _solved(stated, sheet, drag, ["climb", "trim_throttle"])
        # What the autopilot is told of its climb is often less than the motor gives.
        return _solved(stated, sheet, drag, ["climb", "top"])
    # A propeller of the usual size, and the speed per volt that the top speed or the throttle tells: either says more
    # of the climb than a guess.
    plain = replace(stated, top=0.0, trim_throttle=0.0)
    usual, _ = _solved(plain, replace(sheet, top=USUAL_TOP * sheet.cruise), drag, ["climb", "top"])
    size = stated.propeller if stated.propeller[0] else (usual.propeller.diameter, 0.0)
    wanted = ["top"] if stated.top else ["trim_throttle"]
    motor, flown = _solved(replace(stated, propeller=size), sheet, drag, wanted)
    if flown.climb <= STEEPEST_CLIMB:
        return motor, flown
    return _solved(replace(stated, trim_throttle=0.0), sheet, drag, ["climb", "top"])


def _solved(stated: DataSheet, sheet: DataSheet, drag: Drag, wanted: list[str]) -> tuple[ElectricMotor, DataSheet]:
    """The motor that meets these fields of the sheet; as many numbers are free, the last the speed or the pitch."""
    volts, (diameter, pitch) = sheet.volts, stated.propeller
    # With the Aerosonde's shape a pitch by the diameter of as much as its zero-thrust ratio.
    steep = pitch / diameter / BOOK_PROPELLER.zero_thrust_ratio if pitch else 1.0
    base = BOOK_PROPELLER.scaled(diameter=diameter / BOOK_PROPELLER.diameter if diameter else 1.0, pitch=steep)
    emf = 60.0 / (2.0 * math.pi * stated.motor) if stated.motor else 0.0
    first_size = 1.0 if diameter else math.sqrt(sheet.mass / 11.0)
    # A guess to start from: unloaded a little beyond the top speed, rad/s.
    first_turns = 1.2 * sheet.top / base.zero_thrust_ratio / (base.diameter * first_size) * 2.0 * math.pi
    single = len(wanted) == 1 and wanted != ["climb"]

    def made(free: Sequence[float]) -> ElectricMotor:
        size, speed = (1.0, free[0]) if single else (*free, 1.0, 1.0)[:2]
        propeller = base.scaled(blades=size * first_size) if diameter else base.scaled(diameter=size * first_size)
        if emf:
            return _on_battery(propeller.scaled(pitch=speed), volts, emf, sheet.cruise)
        return _on_battery(propeller, volts, volts / (speed * first_turns), sheet.cruise)

    def amiss(free: Sequence[float]) -> list[float]:
        motor = made(free)
        return [_amiss(motor, sheet, drag, name) for name in wanted]

    motor = made(_meet(amiss, len(wanted), sheet))
    if not _MIN_DIAMETER <= motor.propeller.diameter <= _DIAMETER_SHARE * sheet.span:
        raise _no_propeller(sheet)
    return motor, _flown(sheet, motor, drag)


def _on_battery(propeller: Propeller, volts: float, emf: float, cruise: float) -> ElectricMotor:
    """A motor of this speed per volt that loses what the Aerosonde's does, by its own power in cruise."""
    power = 0.3 * volts**2 * emf
    motor = ElectricMotor(propeller, volts, emf, 0.1, 0.5, WINDMILL)
    for _ in range(12):
        motor = replace(
            motor, resistance=_RESISTANCE_SHARE * volts**2 / power, idle_current=_IDLE_SHARE * power / volts
        )
        power = math.sqrt(power * max(1.0, motor.power(1.0, cruise, SHEET_DENSITY)))
    return motor


def _engine(stated: DataSheet, sheet: DataSheet, drag: Drag) -> tuple[FuelEngine, DataSheet]:
    """An engine whose torque meets the climb or the top speed; where both are stated, a propeller's pitch, too."""
    pull = drag(sheet.cruise) + _weight(sheet) * math.sin(sheet.climb)
    diameter, pitch = sheet.propeller
    steep = pitch / diameter / BOOK_PROPELLER.zero_thrust_ratio if diameter else 1.0
    usual = min(math.sqrt(sheet.mass / 11.0), _USUAL_SHARE * sheet.span / BOOK_PROPELLER.diameter)
    base = BOOK_PROPELLER.scaled(diameter=diameter / BOOK_PROPELLER.diameter if diameter else usual, pitch=steep)
    first_torque = 0.12 * pull * base.diameter
    # A top speed says more of the climb than a guess.
    wanted = [name for name in ("climb", "top") if getattr(stated, name)] or ["climb"]

    def made(free: Sequence[float]) -> FuelEngine:
        torque, steeper = (*free, 1.0)[:2]
        torque *= first_torque
        return FuelEngine(base.scaled(pitch=steeper), torque, _FRICTION_SHARE * torque, windmill=WINDMILL)

    def amiss(free: Sequence[float]) -> list[float]:
        engine = made(free)
        return [_amiss(engine, sheet, drag, name) for name in wanted]

    engine = made(_meet(amiss, len(wanted), sheet))
    return engine, _flown(sheet, engine, drag)


Drive = ElectricMotor | FuelEngine


def _amiss(motor: Drive, sheet: DataSheet, drag: Drag, name: str) -> float:
    """How far the thrust is from what a field of the sheet takes, as a share of it."""
    speed = sheet.top if name == "top" else sheet.cruise
    throttle = sheet.trim_throttle if name == "trim_throttle" else 1.0
    needed = drag(speed) + (_weight(sheet) * math.sin(sheet.climb) if name == "climb" else 0.0)
    return motor.thrust(throttle, speed, SHEET_DENSITY) / needed - 1.0


def _meet(amiss: Callable[[Sequence[float]], list[float]], count: int, sheet: DataSheet) -> list[float]:
    """Positive numbers near 1 at which nothing is amiss.  Raises FlightError where there are none."""
    if not count:
        return []
    for size in (1.0, 0.6, 1.7):
        x = _newton(lambda x: np.array(amiss(np.exp(x).tolist())), np.log([size, 1.0 / size][:count]))
        if x is not None:
            free: list[float] = np.exp(x).tolist()
            return free
    raise _no_propeller(sheet)


# A step for the slopes, the longest of the search, which is to find the nearest solution, and where it ends, as
# logarithms of factors; amiss of what counts as met.
_STEP, _LONGEST, _BOUND, _MET = 1e-6, 0.2, 2.5, 1e-7


def _newton(amiss: Callable[[Floats], Floats], x: Floats) -> Floats | None:
    """Numbers within the bound at which nothing is amiss, by Newton's method; None where it finds none.

    A step that does not help is halved.
    """
    off = amiss(x)
    for _ in range(100):
        slopes = np.array([(amiss(x + step) - amiss(x - step)) / (2.0 * _STEP) for step in _STEP * np.eye(x.size)]).T
        whole = np.linalg.lstsq(slopes, -off, rcond=None)[0]
        size = min(1.0, _LONGEST / max(float(np.abs(whole).max()), 1e-12))
        while size > 1e-6:
            there = np.clip(x + size * whole, -_BOUND, _BOUND)
            if np.linalg.norm(left := amiss(there)) < np.linalg.norm(off):
                break
            size *= 0.5
        else:
            break
        x, off = there, left
    return x if np.abs(off).max() < _MET else None


def _no_propeller(sheet: DataSheet) -> FlightError:
    climb = math.degrees(sheet.climb)
    allowed = "a steeper climb goes with a higher top speed, a flatter one with a lower"
    no = f"no propeller gives it at {sheet.cruise:g} m/s with a top speed of {sheet.top:.3g} m/s"
    return FlightError.of_argument("climb", climb, f"{no}: {allowed}", shown=f"{climb:.3g} degrees")


def _flown(sheet: DataSheet, motor: Drive, drag: Drag) -> DataSheet:
    """The sheet with the climb and the top speed that a motor gives.  Raises FlightError where it cannot climb."""
    spare = motor.thrust(1.0, sheet.cruise, SHEET_DENSITY) - drag(sheet.cruise)
    climb = math.asin(max(-1.0, min(0.95, spare / _weight(sheet))))
    least = RANGES["climb"][2]
    if climb < math.radians(least):
        gives = f"with this propeller and {sheet.volts:g} V it climbs {math.degrees(climb):.1f} degrees at cruise"
        raise _refused("motor", sheet.motor, f"{gives}: allowed {least:g} degrees and more", "rpm a volt")
    low, high = sheet.cruise, 4.0 * sheet.cruise
    for _ in range(60):
        middle = 0.5 * (low + high)
        faster = motor.thrust(1.0, middle, SHEET_DENSITY) > drag(middle)
        low, high = (middle, high) if faster else (low, middle)
    return replace(sheet, climb=climb, top=low)
