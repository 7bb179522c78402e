"""Measure mass, inertia, coefficients and motor of a base aircraft.

They are measured on its JSBSim model in level flight at cruise.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.identification.base_model import BaseModel, Coefficients
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.motor import Motor
from aircraft.identification.motor_table import MotorTable
from aircraft.identification.propeller_disc import PropellerDisc
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import steady_flight
from world.arrays import Floats
from world.errors import FlightError

# Altitude of the trim, m AMSL.
_AMSL = 500.0
# Step of flow angles for central differences, rad.
_ANGLE_STEP_RAD = 1e-3
# Step of angular rates, rad/s.
_RATE_STEP_RAD_S = 1e-3
# Step of surface deflections, rad.
_SURFACE_STEP_RAD = 1e-3
# Moment of inertia of 1 slug ft^2, kg m^2.
_SLUG_FT2 = 1.3558179483314004
# One pound of force, N.
_POUND_N = 4.4482216152605
# One pound-foot of torque, N m.
_POUND_FOOT_NM = 1.3558179483314004
# One slug per cubic foot, kg/m^3.
_SLUG_PER_FT3 = 515.3788183931961
# Smallest and largest airspeed of a motor's table, as ratios to the cruise airspeed.
_TABLE_SPEEDS = (0.3, 2.2)
# Number of airspeeds, and of throttles, of a motor's table.
_TABLE_ROWS = 15


def base_model(aircraft: Aircraft) -> BaseModel:
    """Return the mass, inertia, aerodynamic coefficients and motor of an aircraft's JSBSim model.

    An electric motor modelled as in the Aerosonde, or a propeller disc modelled as in the Zagi and the X8, keeps its
    formulas; any other motor is tabulated.

    Raises FlightError for an aircraft without steady flight at cruise.

    >>> from aircraft.catalog import load_aircraft
    >>> numbers = base_model(load_aircraft("aerosonde")).coefficients
    >>> round(numbers.lift_alpha, 2), round(numbers.pitch_elevator, 2), round(numbers.drag_zero, 3)
    (5.61, -0.99, 0.043)
    """
    probe, motor = _Probe(aircraft), read_motor(aircraft)
    # Models of flying wings leave out the reaction to propeller torque. It is assumed for a model that cannot be
    # parsed.
    root = _parse_model(aircraft)
    reactions = None if root is None else root.find("external_reactions")
    return probe.base_model(
        probe.motor_table() if motor is None else motor,
        has_torque_reaction=reactions is None or reactions.find("moment") is not None,
    )


def varied_model(aircraft: Aircraft, variation: Variation) -> BaseModel:
    """Return the `base_model` of an aircraft with varied properties, always with a tabulated motor.

    Raises FlightError for an aircraft without steady flight at cruise.
    """
    probe = _Probe(aircraft, variation)
    return probe.base_model(probe.motor_table(), has_torque_reaction=True)


class _Probe:
    """JSBSim model of an aircraft, evaluated at chosen flow angles, angular rates and surface deflections."""

    def __init__(self, aircraft: Aircraft, variation: Variation | None = None) -> None:
        """Load the model of an aircraft, and trim it for level flight at cruise.

        Raises FlightError if there is no such trim.
        """
        self._aircraft = aircraft
        self._fdm = fdm = Fdm(aircraft, variation=variation)
        read = fdm.properties.getter
        self.chord = read("metrics/cbarw-ft")() * 0.3048
        self._span, self._area = aircraft.wing_span, aircraft.wing_area
        trim = steady_flight(fdm, aircraft.airspeed, _AMSL)
        if trim is None:
            raise FlightError(
                f"{aircraft.name}: cannot be trimmed for level flight at its cruise speed", file=aircraft.name
            )
        self._airspeed = aircraft.airspeed
        self._trim = trim.vector()
        fdm.apply_trim(self._trim)
        # A slug has 14.59... kg, and a foot 0.3048 m.
        self.mass = read("inertia/mass-slugs")() * 14.593902937206364
        ixx, iyy, izz, ixz = (read(f"inertia/i{axes}-slugs_ft2")() * _SLUG_FT2 for axes in ("xx", "yy", "zz", "xz"))
        # JSBSim's product of inertia has the opposite sign.
        self.inertia = (ixx, iyy, izz, -ixz)
        self._pressure_force = read("aero/qbar-psf")() * 47.88025898033584 * self._area

    def base_model(self, motor: Motor, *, has_torque_reaction: bool) -> BaseModel:
        """Return mass, sizes, inertia and coefficients of the JSBSim model, with a motor.

        motor: motor of the result.
        has_torque_reaction: True if the propeller's torque rolls the aircraft.
        """
        return BaseModel(
            mass=self.mass,
            area=self._area,
            span=self._span,
            chord=self.chord,
            inertia=self.inertia,
            servo_lag=self._aircraft.surface_lag,
            motor_lag=self._aircraft.motor_lag,
            coefficients=self.coefficients(),
            motor=motor,
            has_torque_reaction=has_torque_reaction,
        )

    def motor_table(self) -> MotorTable:
        """Return a table of thrust, power and torque over airspeed and throttle at the trim's altitude."""
        fdm, aircraft = self._fdm, self._aircraft
        source = "prop" if aircraft.model.settles else "external"
        thrust, torque, density = (
            fdm.properties.getter(name)
            for name in (f"forces/fbx-{source}-lbs", f"moments/l-{source}-lbsft", "atmosphere/rho-slugs_ft3")
        )
        airspeeds = np.linspace(*_TABLE_SPEEDS, _TABLE_ROWS) * self._airspeed
        throttles = np.linspace(0.0, 1.0, _TABLE_ROWS)
        rows = []
        for airspeed in airspeeds.tolist():
            for throttle in throttles.tolist():
                values = self._trim.copy()
                values[0], values[-1] = airspeed, throttle
                fdm.apply_trim(values)
                rows.append((thrust() * _POUND_N, float(fdm.read().power), -torque() * _POUND_FOOT_NM))
        thrusts, powers, torques = np.array(rows).reshape(_TABLE_ROWS, _TABLE_ROWS, 3).transpose(2, 0, 1)
        volts = aircraft.battery_voltage
        return MotorTable(
            airspeeds, throttles, thrusts, powers, torques, density() * _SLUG_PER_FT3, volts, nominal=volts
        )

    def coefficients(self) -> Coefficients:
        """Return the aerodynamic coefficients from central differences about zero angle of attack.

        The throttle is closed, and the propeller may windmill.
        """
        at_zero = self._evaluate_coefficients(0.0)
        # Fit drag over lift on the straight part of the lift curve.
        angles = np.radians([-2.0, 0.0, 2.0, 4.0, 6.0])
        table = np.array([self._evaluate_coefficients(angle)[:2] for angle in angles])
        induced, linear, constant = np.polyfit(table[:, 1], table[:, 0], 2)
        min_drag_lift = -0.5 * linear / induced
        alpha = self._differentiate(self._evaluate_coefficients, _ANGLE_STEP_RAD)
        beta = self._differentiate(lambda step: self._evaluate_coefficients(0.0, beta=step), _ANGLE_STEP_RAD)
        elevator, aileron, rudder = (
            self._differentiate(partial(self._vary_axis, "surfaces", k), _SURFACE_STEP_RAD) for k in range(3)
        )
        half_span_time = self._span / (2.0 * self._airspeed)
        half_chord_time = self.chord / (2.0 * self._airspeed)
        roll, pitch, yaw = (
            self._differentiate(partial(self._vary_axis, "rates", k), _RATE_STEP_RAD_S) / size
            for k, size in enumerate((half_span_time, half_chord_time, half_span_time))
        )
        return Coefficients(
            drag_zero=float(constant - induced * min_drag_lift * min_drag_lift),
            drag_induced=float(induced),
            drag_elevator=float(elevator[0]),
            lift_zero=float(at_zero[1]),
            lift_alpha=float(alpha[1]),
            lift_rate=float(pitch[1]),
            lift_elevator=float(elevator[1]),
            side_beta=float(beta[2]),
            side_aileron=float(aileron[2]),
            side_rudder=float(rudder[2]),
            roll_beta=float(beta[3]),
            roll_roll=float(roll[3]),
            roll_yaw=float(yaw[3]),
            roll_aileron=float(aileron[3]),
            roll_rudder=float(rudder[3]),
            pitch_zero=float(at_zero[4]),
            pitch_alpha=float(alpha[4]),
            pitch_rate=float(pitch[4]),
            pitch_elevator=float(elevator[4]),
            yaw_beta=float(beta[5]),
            yaw_roll=float(roll[5]),
            yaw_yaw=float(yaw[5]),
            yaw_aileron=float(aileron[5]),
            yaw_rudder=float(rudder[5]),
            lift_least_drag=float(min_drag_lift),
            side_roll=float(roll[2]),
            side_yaw=float(yaw[2]),
        )

    def _vary_axis(self, quantity: Literal["surfaces", "rates"], axis: int, value: float) -> Floats:
        """Return the coefficients of `_evaluate_coefficients`, (6,), with one deflection or rate.

        All other deflections and rates are 0.

        axis: index of the surface (elevator, aileron, rudder) or rate (p, q, r).
        value: deflection, rad, or rate, rad/s.
        """
        vector = value * np.eye(3)[axis]
        if quantity == "surfaces":
            return self._evaluate_coefficients(0.0, surfaces=vector)
        return self._evaluate_coefficients(0.0, rates=vector)

    def _differentiate(self, function: Callable[[float], Floats], step: float) -> Floats:
        """Return the derivative at 0 of a function from a number to coefficients, (6,).

        It is a central difference.

        step: distance from 0 to either side.
        """
        return np.asarray((function(step) - function(-step)) / (2.0 * step))

    def _evaluate_coefficients(
        self, alpha: float, beta: float = 0.0, rates: Floats | None = None, surfaces: Floats | None = None
    ) -> Floats:
        """Return six coefficients with closed throttle, (6,).

        They are drag, lift, side force, and roll, pitch and yaw moment.

        alpha, beta: angles of attack and sideslip, rad.
        rates: angular rates p, q, r, rad/s, zero by default.
        surfaces: deflections of elevator, aileron and rudder, rad, zero by default.
        """
        angular_rates = np.zeros(3) if rates is None else rates
        deflections = np.zeros(3) if surfaces is None else surfaces
        speed = self._airspeed
        flow = speed * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])
        states = np.array([*flow, *angular_rates, 0.0, 0.0])
        self._fdm.derivatives(states, np.array([*deflections, 0.0]))
        read = self._fdm.properties.getter
        x, y, z = (read(f"forces/fb{axis}-aero-lbs")() * _POUND_N for axis in "xyz")
        moments = [read(f"moments/{axis}-aero-lbsft")() * _POUND_FOOT_NM for axis in "lmn"]
        sine, cosine = math.sin(alpha), math.cos(alpha)
        forces = np.array([-x * cosine - z * sine, x * sine - z * cosine, y])
        lengths = np.array([self._span, self.chord, self._span])
        return np.concatenate([forces, np.array(moments) / lengths]) / self._pressure_force


def is_flying_wing(aircraft: Aircraft) -> bool:
    """Return True if a model has elevons, which it mixes from elevator and aileron.

    Returns False for a model that cannot be parsed.
    """
    root = _parse_model(aircraft)
    return root is not None and any(actuator.get("name") == "elevon/left-rad" for actuator in root.iter("actuator"))


def _parse_model(aircraft: Aircraft) -> ElementTree.Element | None:
    """Return the parsed model, or None if it cannot be parsed (JSBSim reports the fault later)."""
    try:
        return ElementTree.parse(aircraft.model_file).getroot()
    except (OSError, ElementTree.ParseError):
        return None


def read_motor(aircraft: Aircraft) -> Motor | None:
    """Read the constants of the electric motor or the propeller disc from an aircraft's JSBSim model.

    Returns None for a motor model of another form.
    """
    try:
        root = ElementTree.parse(aircraft.model_file).getroot()
        functions = {function.get("name", ""): function for function in root.iter("function")}
        if "motor/exit-mps" in functions:
            # A propeller disc.
            exit_function, thrust_function, power_function = (
                functions[f"motor/{name}"] for name in ("exit-mps", "thrust-n", "battery-power-w")
            )
            (exit_speed,) = _read_function_values(exit_function)
            (area,) = (value for value in _read_function_values(thrust_function) if value != 0.0)
            # The factor is half the power given to the air, divided by the efficiency.
            (half_factor,) = _read_function_values(power_function)
            is_ducted = any((element.text or "").strip() == "motor/airspeed-mps" for element in exit_function.iter("p"))
            losses, volts = 2.0 * half_factor - 1.0, aircraft.battery_voltage
            return PropellerDisc(area, exit_speed, is_ducted, losses=losses, voltage=volts, nominal=volts)
        return _read_electric_motor(functions, aircraft.battery_voltage)
    except (KeyError, ValueError, IndexError, StopIteration, OSError, ElementTree.ParseError):
        return None


def _read_function_values(function: ElementTree.Element) -> list[float]:
    """Return the numbers in a JSBSim function, in the order of the file; NaN for an empty element."""
    return [float(value.text or "nan") for value in function.iter("v")]


def _read_electric_motor(functions: dict[str, ElementTree.Element], volts: float) -> ElectricMotor:
    """Return the electric motor of a model, from its JSBSim functions by name.

    Raises KeyError, ValueError, IndexError or StopIteration for functions of another form.

    volts: nominal voltage of the battery, V.
    """

    def read_numbers(name: str) -> list[float]:
        """Return the numbers in the JSBSim function with this name."""
        return _read_function_values(functions[name])

    # Propeller torque: q2 times speed squared, q1 times speed times airspeed, and q0 times airspeed squared.
    (q2,), (q1,), (q0,) = (read_numbers(f"motor/q{k}") for k in (2, 1, 0))
    (damping,) = read_numbers("motor/b")
    speed_constants = read_numbers("motor/driven-rad_sec")
    torque_per_volt = -next(value for value in speed_constants if value < 0.0)
    # The no-load torque is in this function or in a separate function.
    loss_function = functions.get("motor/loss-n_m")
    no_load_torque = (
        read_numbers("motor/loss-n_m")[0]
        if loss_function is not None
        else next(value for value in speed_constants if 0.0 < value < 2.0)
    )
    # A data sheet's model has the ratio of battery power to these formulas, and the power of the avionics.
    power_numbers = read_numbers("motor/battery-power-w")
    power_ratio, avionics = power_numbers if len(power_numbers) == 2 else (1.0, 0.0)
    back_voltage = damping / torque_per_volt
    thrust_name = "motor/pull-n" if "motor/pull-n" in functions else "motor/thrust-n"
    thrust = read_numbers(thrust_name)
    return ElectricMotor(
        torque=(q2, q1, q0),
        thrust=(thrust[0], thrust[1], thrust[2]),
        back_voltage=back_voltage,
        resistance=back_voltage / torque_per_volt,
        idle_current=no_load_torque / back_voltage,
        voltage=volts,
        windmill=read_numbers("motor/thrust-n")[1] if thrust_name == "motor/pull-n" else 1.0,
        power_ratio=power_ratio,
        avionics=avionics,
    )


def scale_base_model(base: BaseModel, mass: float, span: float, area: float, volts: float | None = None) -> BaseModel:
    """Return a model scaled to another mass (kg), span (m) and wing area (m^2).

    Inertia scales with mass and span squared.  The chord keeps its ratio to area / span.  Induced drag is CL^2 divided
    by pi, span efficiency and aspect ratio (Anderson, Fundamentals of Aerodynamics, section 5.3.2); the efficiency, all
    other coefficients and the motor are kept.

    volts: battery voltage, V; if it differs, the motor is replaced by a motor with the same speed at full throttle.
    """
    mass_ratio, span_ratio = mass / base.mass, span / base.span
    chord = base.chord * (area / span) / (base.area / base.span)
    ixx, iyy, izz, ixz = base.inertia
    inertia_ratio = mass_ratio * span_ratio * span_ratio
    aspect_ratio_ratio = (span * span / area) / (base.span * base.span / base.area)
    induced = base.coefficients.drag_induced / aspect_ratio_ratio
    return replace(
        base,
        coefficients=replace(base.coefficients, drag_induced=induced),
        induced_factor=base.induced_factor / aspect_ratio_ratio,
        mass=mass,
        span=span,
        area=area,
        chord=chord,
        inertia=(ixx * inertia_ratio, iyy * inertia_ratio, izz * inertia_ratio, ixz * inertia_ratio),
        motor=base.motor if volts is None else base.motor.for_voltage(volts),
    )
