"""Write the JSBSim model of a small aircraft from its numbers: mass, coefficients and propulsion.

Equations and signs follow R. W. Beard and T. W. McLain, *Small Unmanned Aircraft*, chapters 3 and 4, as in
``aircraft/aerosonde/aerosonde.xml``: elevator trailing edge down, aileron rolling right and rudder yawing left are
positive. An uncertain value has a property ``ident/NAME`` in the model, a factor with the default 1: a draw of an
uncertain aircraft is thus a set of properties.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from aircraft.propulsion import Propulsion
from aircraft.xml_text import add, multiply, number, scale

# Control surfaces: a tail with elevator and rudder, a flying wing with elevons, a V-tail with ruddervators.
Layout = Literal["tail", "wing", "vtail"]

# Settable factors of the model, with the quantities that they multiply.
FACTORS = {
    "zero-lift-drag": "minimum drag coefficient",
    "induced-drag": "drag due to lift",
    "thrust": "thrust at a given propeller speed",
    "motor-speed": "motor speed per volt (for an engine: square root of its torque)",
    "windmill-drag": "drag of a windmilling propeller",
    "lift-slope": "lift curve slope",
    "pitch-stiffness": "pitching moment per angle of attack",
    "pitch-damping": "pitching moment per pitch rate",
    "elevator-power": "pitching moment per elevator",
    "roll-damping": "rolling moment per roll rate",
    "aileron-power": "rolling moment per aileron",
}
# Factors of a model with an electric motor or an engine whose power is guessed.
POWER_FACTORS = {
    "drive-power": "battery power, or heat of the fuel, for a given shaft power",
    "avionics-power": "power of autopilot, radios and servos",
}
# Ratio of the stops of elevons and ruddervators to the larger stop of the two commands that they mix.
MIXED_TRAVEL = 1.3
# kg m^2 in one slug ft^2.
_KG_M2_PER_SLUG_FT2 = 1.3558179483314004
# Kilograms in one pound.
_KG_PER_POUND = 0.45359237


@dataclass(frozen=True, slots=True)
class AeroCoefficients:
    """Aerodynamic coefficients of the textbook, per radian and per reduced rate.

    Reduced rates are p b/2V, q c/2V and r b/2V.

    lift_0, lift_alpha, lift_q, lift_elevator: lift.
    drag_min, drag_lift, lift_at_least_drag: CD = drag_min + drag_lift (CL - lift_at_least_drag)^2, where CL depends
        only on the angle of attack.
    drag_elevator, drag_elevator_2: drag per magnitude of the elevator, and per square of the elevator.
    drag_beta_2: drag per square of the sideslip.
    pitch_0 .. yaw_rudder: moments.
    side_beta .. side_rudder: side force.
    stall_alpha, stall_sharpness: angle of attack of the stall (rad), and the textbook's M.
    """

    lift_0: float
    lift_alpha: float
    drag_min: float
    drag_lift: float
    pitch_0: float
    pitch_alpha: float
    pitch_q: float
    pitch_elevator: float
    side_beta: float
    roll_beta: float
    roll_p: float
    roll_r: float
    roll_aileron: float
    yaw_beta: float
    yaw_p: float
    yaw_r: float
    yaw_aileron: float
    stall_alpha: float
    lift_q: float = 0.0
    lift_elevator: float = 0.0
    lift_at_least_drag: float = 0.0
    drag_elevator: float = 0.0
    drag_elevator_2: float = 0.0
    drag_beta_2: float = 0.0
    side_p: float = 0.0
    side_r: float = 0.0
    side_aileron: float = 0.0
    side_rudder: float = 0.0
    roll_rudder: float = 0.0
    yaw_rudder: float = 0.0
    stall_sharpness: float = 50.0


@dataclass(frozen=True, slots=True)
class ModelNumbers:
    """All numbers of a model, in SI units and radians.

    title: title of the model.
    source: sentence on the source of the numbers.
    inertia: Jx, Jy, Jz, Jxz about the center of gravity, kg m^2; Jxz is the integral of x z dm.
    throw: travel of elevator, aileron and rudder in either direction.
    rate: rate limit of the surfaces, rad/s.
    lag: time constants of the surfaces and of the motor, s.
    lift_behind: distance from the center of gravity back to the wing's forces, m.
    factors: names of the model's factors.
    """

    title: str
    source: str
    mass: float
    area: float
    span: float
    chord: float
    inertia: tuple[float, float, float, float]
    aero: AeroCoefficients
    propulsion: Propulsion
    layout: Layout = "tail"
    throw: tuple[float, float, float] = (0.5236, 0.5236, 0.5236)
    rate: float = 3.490658503988659
    lag: tuple[float, float] = (0.05, 0.1)
    lift_behind: float = 0.0
    factors: tuple[str, ...] = field(default=tuple(FACTORS))


def model_xml(name: str, numbers: ModelNumbers) -> str:
    """Return the text of an aircraft's ``NAME.xml``.

    The model has the properties of `aircraft.jsbsim_model.DEFAULT_MODEL`. It has no ``<input>`` and ``<output>``
    channels.
    """
    ixx, iyy, izz, ixz = (value / _KG_M2_PER_SLUG_FT2 for value in numbers.inertia)
    return f"""<?xml version="1.0"?>
<!-- {_comment_text(numbers.title)}
     {_comment_text(numbers.source)}
     Written by aircraft/model_writer.py; signs and equations as in aircraft/aerosonde/aerosonde.xml. -->
<fdm_config name="{name}" version="2.0" release="BETA">
  <fileheader>
    <author>planfly</author>
    <version>1.0</version>
    <description>{_comment_text(numbers.title)}</description>
  </fileheader>

  <metrics>
    <wingarea unit="M2"> {number(numbers.area)} </wingarea>
    <wingspan unit="M"> {number(numbers.span)} </wingspan>
    <chord unit="M"> {number(numbers.chord)} </chord>
    <location name="AERORP" unit="M"> <x> {number(numbers.lift_behind)} </x> <y> 0 </y> <z> 0 </z> </location>
    <location name="EYEPOINT" unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
    <location name="VRP" unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
  </metrics>

  <!-- Jxz is the integral of x z dm; slug ft2, because JSBSim's own conversion from kg m2 is off by 9e-5. -->
  <mass_balance negated_crossproduct_inertia="false">
    <ixx unit="SLUG*FT2"> {number(ixx)} </ixx>
    <iyy unit="SLUG*FT2"> {number(iyy)} </iyy>
    <izz unit="SLUG*FT2"> {number(izz)} </izz>
    <ixz unit="SLUG*FT2"> {number(ixz)} </ixz>
    <emptywt unit="LBS"> {number(numbers.mass / _KG_PER_POUND)} </emptywt>
    <location name="CG" unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
    <pointmass name="payload">
      <weight unit="LBS"> 0 </weight>
      <location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
    </pointmass>
  </mass_balance>

  <ground_reactions/>
  <propulsion/>

{_flight_control_xml(numbers)}

{_external_reactions_xml(numbers)}

{_aerodynamics_xml(numbers)}
</fdm_config>
"""


def _comment_text(text: str) -> str:
    """Return a text without the characters that XML and its comments do not allow."""
    return text.replace("&", "and").replace("<", "").replace(">", "").replace("--", "-")


# ----------------------------------------------------------------------
# Servos: each moves one control, or a mix of two controls.


def _flight_control_xml(numbers: ModelNumbers) -> str:
    """Return the XML section with the servos and the lag of the motor.

    Elevons and ruddervators mix two commands.
    """
    elevator, aileron, rudder = numbers.throw
    travels = {"elevator": elevator, "aileron": aileron, "rudder": rudder}
    mixed_controls = {"tail": (), "wing": ("elevator", "aileron"), "vtail": ("elevator", "rudder")}[numbers.layout]
    channels = [
        _servo_xml(f"surface/{name}-rad", f"command/{name}-rad", travel, numbers)
        for name, travel in travels.items()
        if name not in mixed_controls
    ]
    if mixed_controls:
        first_control, second_control = mixed_controls
        name = "elevon" if numbers.layout == "wing" else "ruddervator"
        travel = MIXED_TRAVEL * max(travels[first_control], travels[second_control])
        sides = {"left": 1.0, "right": -1.0}
        # The outer functions only convert between commands and surfaces; the servos between them have lag and stops.
        for side, sign in sides.items():
            command = add(f"<p> command/{first_control}-rad </p>", scale(sign, f"command/{second_control}-rad"))
            channels.append(_fcs_function_xml(f"{name}/{side}-command-rad", command))
            channels.append(_servo_xml(f"{name}/{side}-rad", f"{name}/{side}-command-rad", travel, numbers))
        for control, signs in ((first_control, (0.5, 0.5)), (second_control, (0.5, -0.5))):
            servo_terms = (scale(sign, f"{name}/{side}-rad") for side, sign in zip(sides, signs, strict=True))
            channels.append(_fcs_function_xml(f"surface/{control}-rad", add(*servo_terms)))
    inverse_lag = 1.0 / numbers.lag[1]
    return f"""  <flight_control name="servos">
    <property value="0"> command/elevator-rad </property>
    <property value="0"> command/aileron-rad </property>
    <property value="0"> command/rudder-rad </property>
    <property value="0"> command/throttle-norm </property>
    <channel name="surfaces">
{chr(10).join(channels)}
    </channel>
    <channel name="motor">
      <actuator name="motor/throttle-norm">
        <input> command/throttle-norm </input>
        <lag> {number(inverse_lag)} </lag>
        <clipto> <min> 0 </min> <max> 1 </max> </clipto>
      </actuator>
    </channel>
  </flight_control>"""


def _servo_xml(name: str, command: str, travel: float, numbers: ModelNumbers) -> str:
    """Return the XML of a surface's actuator, which has a lag, a rate limit and stops.

    name, command: properties of the surface and of its command.
    travel: travel in either direction, rad.
    """
    return f"""      <actuator name="{name}">
        <input> {command} </input>
        <lag> {number(1.0 / numbers.lag[0])} </lag>
        <rate_limit> {number(numbers.rate)} </rate_limit>
        <clipto> <min> {number(-travel)} </min> <max> {number(travel)} </max> </clipto>
      </actuator>"""


def _fcs_function_xml(name: str, content: str) -> str:
    """Return the XML of a function of the flight controls that sets a property.

    content: XML element of the property's value.
    """
    return f"""      <fcs_function name="{name}">
        <function> {content} </function>
      </fcs_function>"""


# ----------------------------------------------------------------------
# Propeller and motor.


# Moment of the propeller's torque on the aircraft.
_TORQUE_XML = """    <!-- The reaction to the propeller's torque rolls the aircraft left. -->
    <moment name="torque" frame="BODY">
      <function> <product> <p> motor/torque-n_m </p> <v> -0.7375621492772654 </v> </product> </function>
      <direction> <x> 1 </x> <y> 0 </y> <z> 0 </z> </direction>
    </moment>"""


def _external_reactions_xml(numbers: ModelNumbers) -> str:
    """Return the XML section of the propulsion: its factors, functions, thrust and propeller torque."""
    factor_properties = "\n".join(f'    <property value="1"> ident/{name} </property>' for name in numbers.factors)
    x, y, z = numbers.propulsion.direction
    # JSBSim's structural axes point aft, right and up; the body's forward, right and down.
    forward, right, down = numbers.propulsion.position
    # Without a rudder only sideslip could balance torque and ailerons, and trims have no sideslip.
    torque = "    <!-- No torque of the propeller: its elevons are rigged against it. -->"
    if numbers.layout != "wing":
        torque = _TORQUE_XML
    return f"""  <external_reactions>
    <!-- What is not known for certain: factors, 1 for the model as published or as guessed. -->
{factor_properties}
    <property value="0"> motor/braking </property>

    <!-- SI throughout; slug/ft3 to kg/m3 and ft/s to m/s here, N to lbf and N m to lbf ft at the end. -->
    <function name="motor/rho-kg_m3">
      <product> <p> atmosphere/rho-slugs_ft3 </p> <v> 515.3788183931961 </v> </product>
    </function>
    <function name="motor/airspeed-mps">
      <product> <p> velocities/vt-fps </p> <v> 0.3048 </v> </product>
    </function>
{numbers.propulsion.functions_xml(numbers.factors)}
    <force name="thrust" frame="BODY">
      <function> <product> <p> motor/thrust-n </p> <v> 0.2248089430997105 </v> </product> </function>
      <location unit="M"> <x> {number(-forward)} </x> <y> {number(right)} </y> <z> {number(-down)} </z> </location>
      <direction> <x> {number(x)} </x> <y> {number(y)} </y> <z> {number(z)} </z> </direction>
    </force>
{torque}
  </external_reactions>"""


# ----------------------------------------------------------------------
# Forces and moments. In the stability frame JSBSim takes X aft and Z up as positive: drag and lift.

# Element of dynamic pressure times wing area.
_DYNAMIC_FORCE = "<p> aero/qbar-area </p>"
# Property of the angle of attack.
_ALPHA = "aero/alpha-rad"
# Property of the sideslip.
_BETA = "aero/beta-rad"
# Properties of the rotation rates.
_RATE_P = "velocities/p-aero-rad_sec"
_RATE_Q = "velocities/q-aero-rad_sec"
_RATE_R = "velocities/r-aero-rad_sec"
# Properties of the control surfaces.
_ELEVATOR = "surface/elevator-rad"
_AILERON = "surface/aileron-rad"
_RUDDER = "surface/rudder-rad"
# Property of the factor on the control surfaces' moments.
_CONTROL = "aero/control-factor"


def _aerodynamics_xml(numbers: ModelNumbers) -> str:
    """Return the XML section of the aerodynamic forces and moments."""
    aero, factors = numbers.aero, numbers.factors
    span, chord = "<p> metrics/bw-ft </p>", "<p> metrics/cbarw-ft </p>"
    linear_lift = "<product> <p> aero/lift-linear </p> <p> aero/flow-direction </p> </product>"
    lift_difference = f"<difference> {linear_lift} <v> {number(aero.lift_at_least_drag)} </v> </difference>"
    induced = (f"<p> {name} </p>" for name in _factor_property("induced-drag", factors))
    drag = add(
        scale(aero.drag_min, *_factor_property("zero-lift-drag", factors)),
        multiply(f"<v> {number(aero.drag_lift)} </v>", *induced, lift_difference, lift_difference),
        multiply(f"<v> {number(aero.drag_elevator)} </v>", f"<abs> <p> {_ELEVATOR} </p> </abs>"),
        scale(aero.drag_elevator_2, _ELEVATOR, _ELEVATOR),
        scale(aero.drag_beta_2, _BETA, _BETA),
    )
    lift = add(
        "<p> aero/lift-alpha </p>",
        scale(aero.lift_q, "aero/ci2vel", _RATE_Q),
        scale(aero.lift_elevator, _ELEVATOR),
    )
    side = add(
        scale(aero.side_beta, _BETA),
        scale(aero.side_p, "aero/bi2vel", _RATE_P),
        scale(aero.side_r, "aero/bi2vel", _RATE_R),
        scale(aero.side_aileron, _AILERON),
        scale(aero.side_rudder, _RUDDER),
    )
    roll = add(
        scale(aero.roll_beta, _BETA),
        scale(aero.roll_p, "aero/bi2vel", _RATE_P, *_factor_property("roll-damping", factors)),
        scale(aero.roll_r, "aero/bi2vel", _RATE_R),
        scale(aero.roll_aileron, _CONTROL, _AILERON, *_factor_property("aileron-power", factors)),
        scale(aero.roll_rudder, _CONTROL, _RUDDER),
    )
    pitch = add(
        f"<v> {number(aero.pitch_0)} </v>",
        scale(aero.pitch_alpha, _ALPHA, *_factor_property("pitch-stiffness", factors)),
        scale(aero.pitch_q, "aero/ci2vel", _RATE_Q, *_factor_property("pitch-damping", factors)),
        scale(aero.pitch_elevator, _CONTROL, _ELEVATOR, *_factor_property("elevator-power", factors)),
    )
    yaw = add(
        scale(aero.yaw_beta, _BETA),
        scale(aero.yaw_p, "aero/bi2vel", _RATE_P),
        scale(aero.yaw_r, "aero/bi2vel", _RATE_R),
        scale(aero.yaw_aileron, _CONTROL, _AILERON),
        scale(aero.yaw_rudder, _CONTROL, _RUDDER),
    )
    drag_factor = "<p> aero/drag-factor </p>"
    axes = "\n".join(
        [
            _axis_xml("X", "force/drag", multiply(_DYNAMIC_FORCE, drag_factor, drag), ' frame="STABILITY"'),
            _axis_xml("Z", "force/lift", multiply(_DYNAMIC_FORCE, lift), ' frame="STABILITY"'),
            _axis_xml("Y", "force/side", multiply(_DYNAMIC_FORCE, side), ' frame="STABILITY"'),
            _axis_xml("ROLL", "moment/roll", multiply(_DYNAMIC_FORCE, span, roll)),
            _axis_xml("PITCH", "moment/pitch", multiply(_DYNAMIC_FORCE, chord, pitch)),
            _axis_xml("YAW", "moment/yaw", multiply(_DYNAMIC_FORCE, span, yaw)),
        ]
    )
    return f"""  <aerodynamics>
    <!-- For robustness studies: factors on all drag and on the control surfaces' moments. -->
    <property value="1"> aero/drag-factor </property>
    <property value="1"> aero/control-factor </property>

{_lift_curve_xml(numbers.aero, numbers.factors)}

{axes}
  </aerodynamics>"""


def _axis_xml(axis: str, name: str, content: str, frame: str = "") -> str:
    """Return the XML of an axis with one function, ``aero/NAME``.

    content: XML element of the function.
    frame: attribute of the axis, such as `` frame="STABILITY"``.
    """
    return f"""    <axis name="{axis}"{frame}>
      <function name="aero/{name}">
        {content}
      </function>
    </axis>"""


def _factor_property(name: str, factors: tuple[str, ...]) -> tuple[str, ...]:
    """Return the property of a factor as a tuple for `scale`; () if the model does not have the factor."""
    return (f"ident/{name}",) if name in factors else ()


def _lift_curve_xml(aero: AeroCoefficients, factors: tuple[str, ...]) -> str:
    """Return the XML of the lift by angle of attack.

    The lift is a straight line up to the stall. Beyond the stall it is the lift of a flat plate.
    """
    straight_line = add(
        f"<v> {number(aero.lift_0)} </v>",
        scale(aero.lift_alpha, _ALPHA, *_factor_property("lift-slope", factors)),
    )
    # Rows of the separated fraction of the flow by angle of attack (rad), which follows Beard and McLain, eq. 4.10, and
    # is exactly 0 in attached flow.
    stall_alpha, sharpness = aero.stall_alpha, aero.stall_sharpness
    width = 10.0 / sharpness
    steps = [stall_alpha - width + 0.02 * k for k in range(math.ceil(2.0 * width / 0.02) + 1)]
    separation_rows = []
    for alpha in sorted({-math.pi, *(-step for step in steps), *steps, math.pi}):
        upper_blend = math.exp(-sharpness * (alpha - stall_alpha))
        lower_blend = math.exp(sharpness * (alpha + stall_alpha))
        fraction = (1.0 + upper_blend + lower_blend) / ((1.0 + upper_blend) * (1.0 + lower_blend))
        fraction = 0.0 if abs(alpha) <= stall_alpha - width + 1e-9 else min(1.0, fraction)
        separation_rows.append(f"          {alpha:.6f}  {fraction:.8f}")
    sine = f"<sin> <p> {_ALPHA} </p> </sin>"
    flat_plate = multiply("<v> 2 </v>", sine, f"<abs> {sine} </abs>", f"<cos> <p> {_ALPHA} </p> </cos>")
    difference = f"<difference> {flat_plate} <p> aero/lift-linear </p> </difference>"
    return f"""    <function name="aero/lift-linear">
      {straight_line}
    </function>
    <!-- Factor of the lift in the induced drag: 0 in flow from behind, where the straight line has no meaning. -->
    <function name="aero/flow-direction">
      <table>
        <independentVar lookup="row"> {_ALPHA} </independentVar>
        <tableData>
          -3.141593  0.0
          -1.400000  1.0
          1.400000  1.0
          3.141593  0.0
        </tableData>
      </table>
    </function>
    <!-- Share of separated flow: the book's blend of the straight line and of a flat plate. -->
    <function name="aero/separated">
      <table>
        <independentVar lookup="row"> {_ALPHA} </independentVar>
        <tableData>
{chr(10).join(separation_rows)}
        </tableData>
      </table>
    </function>
    <function name="aero/lift-alpha">
      {add("<p> aero/lift-linear </p>", multiply("<p> aero/separated </p>", difference))}
    </function>"""
