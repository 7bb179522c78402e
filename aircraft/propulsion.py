"""Model the propulsion of small aircraft, as numbers and as JSBSim functions.

Each kind of propulsion provides the properties ``motor/thrust-n``, ``motor/torque-n_m``, ``motor/battery-current-a``
and ``motor/battery-power-w`` as functions of ``motor/throttle-norm`` (0..1), ``motor/rho-kg_m3`` and
``motor/airspeed-mps``. All of them are closed forms without states, so that a trim is exact. Factors of the model are
properties ``ident/NAME``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from aircraft.xml_text import add, multiply, number, scale

# Direction or position vector in body axes: forward, right, down.
Vector3 = tuple[float, float, float]


class Propulsion(Protocol):
    """Interface of a kind of propulsion for `aircraft.model_writer`.

    direction: direction of the thrust in body axes.
    position: point where the thrust acts, m forward, right and below the center of gravity.
    """

    @property
    def direction(self) -> Vector3:
        """Unit vector of the thrust: forward, right, down."""

    @property
    def position(self) -> Vector3:
        """Point where the thrust acts, m forward, right and below the center of gravity."""

    def functions_xml(self, factors: tuple[str, ...]) -> str:
        """Return the XML of the JSBSim functions.

        factors: names of the model's ``ident/`` properties.
        """


@dataclass(frozen=True, slots=True)
class Propeller:
    """A propeller: T = rho n^2 D^4 CT(J), Q = rho n^2 D^5 CQ(J), J = V / (n D).

    n: revolutions per second.

    diameter: m.
    thrust, torque: (c0, c1, c2) of CT = c0 + c1 J + c2 J^2, and of CQ.
    """

    diameter: float
    thrust: tuple[float, float, float]
    torque: tuple[float, float, float]

    def scale(self, *, diameter: float = 1.0, blades: float = 1.0, pitch: float = 1.0) -> "Propeller":
        """Return a propeller whose diameter, blade area and pitch are multiplied by factors.

        The coefficients scale with the blade area, and J scales with the pitch. A propeller with a steeper pitch gives
        thrust up to a higher J, and needs proportionally more torque.
        """
        ct, cq = self.thrust, self.torque
        return Propeller(
            self.diameter * diameter,
            (blades * ct[0], blades * ct[1] / pitch, blades * ct[2] / pitch**2),
            (blades * pitch * cq[0], blades * cq[1], blades * cq[2] / pitch),
        )

    def thrust_at(self, w: float, airspeed: float, rho: float) -> float:
        """Return the thrust (N) at a propeller speed (rad/s), an airspeed (m/s) and an air density (kg/m^3)."""
        n, d = w / (2.0 * math.pi), self.diameter
        c0, c1, c2 = self.thrust
        return rho * (c0 * n**2 * d**4 + c1 * n * airspeed * d**3 + c2 * airspeed**2 * d**2)

    def torque_parabola(self, airspeed: float, rho: float) -> tuple[float, float, float]:
        """Return the coefficients of the torque (N m) as a polynomial in the propeller speed (rad/s).

        The coefficient of the highest power comes first.

        airspeed: m/s.
        rho: air density, kg/m^3.
        """
        c0, c1, c2 = self.torque
        d, turn = self.diameter, 2.0 * math.pi
        return rho * d**5 * c0 / turn**2, rho * d**4 * airspeed * c1 / turn, rho * d**3 * airspeed**2 * c2

    @property
    def zero_thrust_ratio(self) -> float:
        """Advance ratio J at which the thrust is zero."""
        c0, c1, c2 = self.thrust
        return (-c1 - math.sqrt(c1**2 - 4.0 * c2 * c0)) / (2.0 * c2)


# Propeller of the Aerosonde, D 0.508 m (Beard and McLain, appendix E.2).
BOOK_PROPELLER = Propeller(0.508, (0.09357, -0.06044, -0.1079), (0.00523, 0.00497, -0.01664))
# Radians per revolution.
_RAD_PER_REVOLUTION = 2.0 * math.pi


def larger_root(square: float, linear: float, constant: float) -> float:
    """Return the larger root of ``square * x**2 + linear * x + constant``, for ``square`` > 0.

    Without a real root, return the abscissa of the minimum.
    """
    return (math.sqrt(max(0.0, linear**2 - 4.0 * square * constant)) - linear) / (2.0 * square)


@dataclass(frozen=True, slots=True)
class ElectricMotor:
    """A brushless motor on a battery.

    volts: battery voltage, V.
    emf: back-emf constant, V s/rad.
    resistance: ohm.
    idle_current: no-load current, A.
    windmill: an idle propeller brakes with this fraction of the negative thrust that its formula gives.
    power_ratio: ratio of the battery power used for propulsion to the computed power of motor and propeller.
    avionics: power of autopilot, radios and servos, W.

    The model follows Beard and McLain, section 4.3, but its current does not brake (`aircraft/aerosonde/README.md`).
    """

    propeller: Propeller
    volts: float
    emf: float
    resistance: float
    idle_current: float
    windmill: float = 1.0
    direction: Vector3 = (1.0, 0.0, 0.0)
    position: Vector3 = (0.0, 0.0, 0.0)
    power_ratio: float = 1.0
    avionics: float = 0.0

    def speed(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the propeller speed, rad/s, at which the torques of motor and propeller are equal.

        A propeller that the airflow turns faster takes only the idle torque: the motor then neither drives nor brakes.

        throttle: 0 to 1.
        airspeed: m/s.
        rho: air density, kg/m^3.
        """
        square, linear, constant = self.propeller.torque_parabola(airspeed, rho)
        k, r = self.emf, self.resistance
        driven_speed = larger_root(
            square, linear + k * k / r, constant + k * self.idle_current - k * self.volts * throttle / r
        )
        windmilling_speed = larger_root(square, linear, constant + k * self.idle_current)
        return max(0.0, driven_speed, windmilling_speed)

    def thrust(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the thrust, N, at a throttle (0 to 1), an airspeed (m/s) and an air density (kg/m^3)."""
        thrust = self.propeller.thrust_at(self.speed(throttle, airspeed, rho), airspeed, rho)
        return thrust if thrust > 0.0 else self.windmill * thrust

    def power(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the power from the battery, W, at a throttle, an airspeed (m/s) and an air density (kg/m^3)."""
        volts = self.volts * throttle
        current = max(0.0, (volts - self.emf * self.speed(throttle, airspeed, rho)) / self.resistance)
        return self.power_ratio * volts * current + self.avionics

    def functions_xml(self, factors: tuple[str, ...]) -> str:
        """Return the XML of the JSBSim functions of motor and propeller."""
        factor = _factor_element(factors)
        k, r, i0 = self.emf, self.resistance, self.idle_current
        speed_factor = factor("motor-speed")
        linear = f"<quotient> <v> {number(k * k / r)} </v> {multiply(speed_factor, speed_factor)} </quotient>"
        losses = f"<quotient> <v> {number(k * i0)} </v> {speed_factor} </quotient>"
        drive = f"<quotient> {scale(-k / r, 'motor/input-v')} {speed_factor} </quotient>"
        back_emf = f"<quotient> {scale(k, 'motor/propeller-rad_sec')} {speed_factor} </quotient>"
        drive_power = multiply(
            f"<v> {number(self.power_ratio)} </v>",
            factor("drive-power"),
            factor("thrust"),
            "<p> motor/input-v </p>",
            "<p> motor/current-a </p>",
        )
        avionics = multiply(f"<v> {number(self.avionics)} </v>", factor("avionics-power"))
        return f"""    <property value="{number(self.volts)}"> motor/battery-v </property>
    <function name="motor/input-v"> {multiply("<p> motor/battery-v </p>", "<p> motor/throttle-norm </p>")} </function>
{_torque_xml(self.propeller)}
    <!-- Propeller speed with current flowing, and at none: the root of Q = KQ ((V - w KV) / R - i0), and of Q = -KQ i0.
         The current does not brake: of the two speeds the larger. -->
    <function name="motor/loss-n_m"> {losses} </function>
    <function name="motor/b"> {add("<p> motor/q1 </p>", linear)} </function>
    <function name="motor/driven-rad_sec">
      {_root_xml("motor/b", add("<p> motor/q0 </p>", "<p> motor/loss-n_m </p>", drive))}
    </function>
    <function name="motor/windmill-rad_sec">
      {_root_xml("motor/q1", add("<p> motor/q0 </p>", "<p> motor/loss-n_m </p>"))}
    </function>
    <function name="motor/propeller-rad_sec">
      <max>
        <v> 0 </v> <p> motor/driven-rad_sec </p>
        <difference> <p> motor/windmill-rad_sec </p> {scale(1e9, "motor/braking")} </difference>
      </max>
    </function>
    <function name="motor/current-a">
      <max>
        {scale(-1e6, "motor/braking")}
        <quotient> <difference> <p> motor/input-v </p> {back_emf} </difference> <v> {number(r)} </v> </quotient>
      </max>
    </function>
    <!-- Power of the drive, for more thrust more, and of autopilot, radios and servos. -->
    <function name="motor/battery-power-w"> {add(drive_power, avionics)} </function>
    <function name="motor/battery-current-a">
      <quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>
    </function>
{_thrust_and_torque_xml(self.propeller, self.windmill, factor)}"""


@dataclass(frozen=True, slots=True)
class FuelEngine:
    """A piston engine on the propeller's shaft, with a torque proportional to the throttle.

    torque: largest torque at sea level, N m; it decreases with the air density.
    friction: friction torque of the idle engine, N m.
    efficiency: ratio of shaft work to the fuel's heat.
    windmill: as in `ElectricMotor`.
    """

    propeller: Propeller
    torque: float
    friction: float
    efficiency: float = 0.2
    windmill: float = 1.0
    direction: Vector3 = (1.0, 0.0, 0.0)
    position: Vector3 = (0.0, 0.0, 0.0)

    def speed(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the propeller speed, rad/s, at which the torques of engine and propeller are equal.

        throttle: 0 to 1.
        airspeed: m/s.
        rho: air density, kg/m^3.
        """
        square, linear, constant = self.propeller.torque_parabola(airspeed, rho)
        engine_torque = throttle * self.torque * rho / _SEA_LEVEL_DENSITY
        return max(0.0, larger_root(square, linear, constant + self.friction - engine_torque))

    def thrust(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the thrust, N, at a throttle (0 to 1), an airspeed (m/s) and an air density (kg/m^3)."""
        thrust = self.propeller.thrust_at(self.speed(throttle, airspeed, rho), airspeed, rho)
        return thrust if thrust > 0.0 else self.windmill * thrust

    def power(self, throttle: float, airspeed: float, rho: float) -> float:
        """Return the fuel's heat per second, W, at a throttle, an airspeed (m/s) and an air density (kg/m^3)."""
        work = throttle * self.torque * rho / _SEA_LEVEL_DENSITY * self.speed(throttle, airspeed, rho)
        return work / self.efficiency

    def functions_xml(self, factors: tuple[str, ...]) -> str:
        """Return the XML of the JSBSim functions of engine and propeller."""
        factor = _factor_element(factors)
        speed_factor = factor("motor-speed")
        factors_xml = (speed_factor, speed_factor, "<p> motor/throttle-norm </p>", "<p> motor/rho-kg_m3 </p>")
        constant = add("<p> motor/q0 </p>", f"<v> {number(self.friction)} </v>", scale(-1.0, "motor/drive-n_m"))
        heat = multiply(
            f"<v> {number(1.0 / self.efficiency)} </v>",
            factor("drive-power"),
            factor("thrust"),
            "<p> motor/drive-n_m </p>",
            "<p> motor/propeller-rad_sec </p>",
        )
        return f"""    <!-- The engine's torque at this throttle and density; the air turns an idle one. -->
    <function name="motor/drive-n_m">
      {multiply(f"<v> {number(self.torque / _SEA_LEVEL_DENSITY)} </v>", *factors_xml)}
    </function>
{_torque_xml(self.propeller)}
    <function name="motor/driven-rad_sec">
      {_root_xml("motor/q1", constant)}
    </function>
    <function name="motor/propeller-rad_sec"> <max> <v> 0 </v> <p> motor/driven-rad_sec </p> </max> </function>
    <!-- Heat of the fuel, not electric power: there is no battery. -->
    <function name="motor/battery-power-w"> {heat} </function>
    <function name="motor/battery-current-a"> <product> <v> 0 </v> <p> motor/throttle-norm </p> </product> </function>
{_thrust_and_torque_xml(self.propeller, self.windmill, factor)}"""


@dataclass(frozen=True, slots=True)
class ActuatorDisc:
    """Propeller as a disc that accelerates the air (Beard and McLain, first edition, 4.3).

    area: disc area, m^2.
    coefficient: C_prop.
    exit_speed: air speed behind the disc at full throttle, m/s.
    ducted: True if the exit speed rises from the airspeed (`krisgry/x8`, after Fitzpatrick), False if it rises from 0.
    efficiency: efficiency of motor and propeller beyond the disc's own loss, the power of the air over battery power.
    volts: V.

    The disc has no model of a motor. The thrust is 0.5 rho S C (v_e^2 - V^2), or 0.5 rho S C v_e (v_e - V) for a ducted
    disc; it is never negative.
    """

    area: float
    coefficient: float
    exit_speed: float
    volts: float
    efficiency: float
    ducted: bool = False
    direction: Vector3 = (1.0, 0.0, 0.0)
    position: Vector3 = (0.0, 0.0, 0.0)

    def functions_xml(self, factors: tuple[str, ...]) -> str:
        """Return the XML of JSBSim functions for exit speed, thrust, torque, power and current.

        factors: names of the factors by which an aircraft in a campaign may differ from its model.
        """
        factor = _factor_element(factors)
        speed = multiply(f"<v> {number(self.exit_speed)} </v>", factor("motor-speed"))
        air = "<p> motor/airspeed-mps </p>"
        exit_speed = (
            add(air, multiply("<p> motor/throttle-norm </p>", f"<difference> {speed} {air} </difference>"))
            if self.ducted
            else multiply(speed, "<p> motor/throttle-norm </p>")
        )
        exit_air = "<p> motor/exit-mps </p>"
        first_factor = exit_air if self.ducted else add(exit_air, air)
        coefficient = number(0.5 * self.area * self.coefficient)
        thrust = multiply(
            f"<v> {coefficient} </v>",
            factor("thrust"),
            "<p> motor/rho-kg_m3 </p>",
            first_factor,
            f"<difference> {exit_air} {air} </difference>",
        )
        power = multiply(f"<v> {number(0.5 / self.efficiency)} </v>", "<p> motor/thrust-n </p>", add(exit_air, air))
        return f"""    <property value="{number(self.volts)}"> motor/battery-v </property>
    <function name="motor/exit-mps"> {exit_speed} </function>
    <function name="motor/thrust-n"> <max> <v> 0 </v> {thrust} </max> </function>
    <function name="motor/torque-n_m"> <product> <v> 0 </v> <p> motor/throttle-norm </p> </product> </function>
    <!-- Power of the air, T (V + v_e) / 2, by the efficiency. -->
    <function name="motor/battery-power-w"> {power} </function>
    <function name="motor/battery-current-a">
      <quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>
    </function>"""


@dataclass(frozen=True, slots=True)
class ShaftPower:
    """A propeller whose shaft power is a function of the throttle.

    Its thrust and power coefficients are polynomials in J.

    diameter: m.
    thrust, power: coefficients of CT and CP, in the order of increasing power of J.
    shaft: coefficients of the shaft power, W, in the order of increasing power of the throttle; a negative shaft power
        is replaced by 0.
    efficiency: motor efficiency, shaft power over battery power.
    volts: V.
    """

    diameter: float
    thrust: tuple[float, ...]
    power: tuple[float, ...]
    shaft: tuple[float, ...]
    volts: float
    efficiency: float
    direction: Vector3 = (1.0, 0.0, 0.0)
    position: Vector3 = (0.0, 0.0, 0.0)

    def functions_xml(self, factors: tuple[str, ...]) -> str:
        """Return the XML of the JSBSim functions of motor and propeller.

        J follows from P / (rho D^2 V^3) = CP(J) / J^3, whose cube root is tabulated.
        """
        factor = _factor_element(factors)
        d = self.diameter
        # Rows of the cube root in increasing order, and J.  The first row has the J at which CP is 0; the last rows are
        # for an aircraft that is almost at rest.
        max_ratio = next(k / 1000.0 for k in range(50, 3000) if _evaluate(self.power, k / 1000.0) <= 0.0)
        rows = [(0.0, max_ratio)]
        # The root is steep where the power vanishes: use finer steps towards it.
        for k in range(1, 201):
            j = max_ratio * (1.0 - (k / 200.0) ** 2 * 0.99)
            loading = max(0.0, _evaluate(self.power, j)) ** (1.0 / 3.0) / j
            if loading > rows[-1][0]:
                rows.append((loading, j))
        advance_table = "\n".join(f"          {loading:.9f}  {j:.9f}" for loading, j in rows)
        speed_factor = factor("motor-speed")
        shaft = multiply(
            speed_factor,
            speed_factor,
            speed_factor,
            f"<max> <v> 0 </v> {_polynomial_xml(self.shaft, '<p> motor/throttle-norm </p>')} </max>",
        )
        thrust = multiply(
            f"<v> {number(d**4)} </v>",
            factor("thrust"),
            "<p> motor/rho-kg_m3 </p>",
            "<p> motor/turns-1_s </p>",
            "<p> motor/turns-1_s </p>",
            _polynomial_xml(self.thrust, "<p> motor/advance </p>"),
        )
        return f"""    <property value="{number(self.volts)}"> motor/battery-v </property>
    <function name="motor/shaft-power-w"> {shaft} </function>
    <function name="motor/flow-mps"> <max> <v> 1 </v> <p> motor/airspeed-mps </p> </max> </function>
    <function name="motor/loading">
      <pow>
        <quotient>
          <p> motor/shaft-power-w </p>
          {scale(d * d, "motor/rho-kg_m3", "motor/flow-mps", "motor/flow-mps", "motor/flow-mps")}
        </quotient>
        <v> 0.333333333333333 </v>
      </pow>
    </function>
    <!-- Advance ratio J; without power the propeller turns freely. -->
    <function name="motor/advance">
      <table>
        <independentVar lookup="row"> motor/loading </independentVar>
        <tableData>
{advance_table}
        </tableData>
      </table>
    </function>
    <function name="motor/turns-1_s">
      <quotient> <p> motor/flow-mps </p> {scale(d, "motor/advance")} </quotient>
    </function>
    <function name="motor/propeller-rad_sec"> {scale(_RAD_PER_REVOLUTION, "motor/turns-1_s")} </function>
    <function name="motor/thrust-n"> {thrust} </function>
    <function name="motor/torque-n_m">
      <quotient> <p> motor/shaft-power-w </p> <p> motor/propeller-rad_sec </p> </quotient>
    </function>
    <function name="motor/battery-power-w"> {scale(1.0 / self.efficiency, "motor/shaft-power-w")} </function>
    <function name="motor/battery-current-a">
      <quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>
    </function>"""


# Air density at sea level, kg/m^3.
_SEA_LEVEL_DENSITY = 1.225


def _factor_element(factors: tuple[str, ...]) -> Callable[[str], str]:
    """Return a function that returns the XML element of a factor, by the factor's name.

    The element is 1 for a factor that the model lacks.
    """
    return lambda name: f"<p> ident/{name} </p>" if name in factors else "<v> 1 </v>"


def _evaluate(coefficients: tuple[float, ...], x: float) -> float:
    """Return the value of a polynomial, whose coefficients are in the order of increasing power."""
    return sum(value * x**k for k, value in enumerate(coefficients))


def _polynomial_xml(coefficients: tuple[float, ...], x: str) -> str:
    """Return the JSBSim element of a polynomial, evaluated by Horner's method.

    coefficients: in the order of increasing power.
    x: element of the variable.
    """
    *lower_coefficients, leading_coefficient = coefficients
    text = f"<v> {number(leading_coefficient)} </v>"
    for coefficient in reversed(lower_coefficients):
        text = add(f"<v> {number(coefficient)} </v>", multiply(x, text))
    return text


def _torque_xml(propeller: Propeller) -> str:
    """Return the XML of q2, q1 and q0 of a propeller's torque q2 w^2 + q1 w + q0, with w in rad/s."""
    square, linear, constant = propeller.torque_parabola(1.0, 1.0)
    rho, air = "motor/rho-kg_m3", "motor/airspeed-mps"
    return f"""    <!-- Torque of the propeller of {number(propeller.diameter)} m, q2 w^2 + q1 w + q0 at w rad/s. -->
    <function name="motor/q2"> {scale(square, rho)} </function>
    <function name="motor/q1"> {scale(linear, rho, air)} </function>
    <function name="motor/q0"> {scale(constant, rho, air, air)} </function>"""


def _root_xml(linear: str, constant: str) -> str:
    """Return the XML of the larger root of ``motor/q2`` w^2 + linear w + constant.

    linear: property of the linear coefficient.
    constant: element of the constant.

    A negative discriminant is replaced by 0.
    """
    discriminant = f"""<difference>
              {multiply(f"<p> {linear} </p>", f"<p> {linear} </p>")}
              {multiply("<v> 4 </v>", "<p> motor/q2 </p>", constant)}
            </difference>"""
    return f"""<quotient>
        <difference>
          <sqrt> <max> <v> 0 </v>
            {discriminant}
          </max> </sqrt>
          <p> {linear} </p>
        </difference>
        {scale(2.0, "motor/q2")}
      </quotient>"""


def _thrust_and_torque_xml(propeller: Propeller, windmill: float, factor: Callable[[str], str]) -> str:
    """Return the XML of the propeller's thrust and torque.

    windmill: factor on a negative thrust.
    factor: function that `_factor_element` returned.
    """
    d, (c0, c1, c2) = propeller.diameter, propeller.thrust
    braking = "<min> <v> 0 </v> <p> motor/pull-n </p> </min>"
    w, air = "motor/propeller-rad_sec", "motor/airspeed-mps"
    thrust = add(
        scale(c0 * d**4 / _RAD_PER_REVOLUTION**2, w, w),
        scale(c1 * d**3 / _RAD_PER_REVOLUTION, air, w),
        scale(c2 * d**2, air, air),
    )
    return f"""    <!-- T = rho n^2 D^4 CT(V / n D); below zero the idle propeller's drag. -->
    <function name="motor/pull-n"> {multiply("<p> motor/rho-kg_m3 </p>", factor("thrust"), thrust)} </function>
    <function name="motor/thrust-n">
      <sum>
        <max> <v> 0 </v> <p> motor/pull-n </p> </max>
        {multiply(f"<v> {number(windmill)} </v>", factor("windmill-drag"), braking)}
      </sum>
    </function>
    <function name="motor/torque-n_m">
      <sum> {scale(1.0, "motor/q2", w, w)} {scale(1.0, "motor/q1", w)} <p> motor/q0 </p> </sum>
    </function>"""
