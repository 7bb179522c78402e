"""Write the JSBSim model of an identified aircraft, which is its base with properties ``ident/NAME``.

The coefficients of the base are kept.  Each function of forces and moments is followed by another function with the
terms that the estimate adds.  Motor and propeller are rewritten in the form that they have in the base.  The default
values of the properties are the estimate; a draw of the aircraft sets them to other values.
"""

from xml.etree import ElementTree

from aircraft.catalog import Aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.draws import DRIVE_POWER
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.motor_table import MotorTable
from aircraft.identification.parameters import INDEX, PARAMETERS
from aircraft.identification.propeller_disc import PropellerDisc
from aircraft.xml_text import number
from world.arrays import Floats
from world.errors import FlightError

# Moment of inertia of 1 slug ft^2, kg m^2.
_SLUG_FT2 = 1.3558179483314004
# One pound, kg.
_POUND_KG = 0.45359237
# Maximum angle of attack seen in flight, rad; the estimated terms are constant beyond this angle.
_MAX_ALPHA_RAD = 0.25


def format_identified_model(base: Aircraft, name: str, numbers: BaseModel, values: Floats) -> str:
    """Return the JSBSim model of an identified aircraft, as the text of its XML file.

    base: the aircraft whose model is extended.
    name: name of the identified aircraft.
    numbers: model values of the base, scaled to the aircraft.
    values: values of `aircraft.identification.parameters.PARAMETERS`, (n,).
    """
    text = base.model_file.read_text(encoding="utf-8")
    # A base from a data sheet has properties with these names; keep them, with their values, under another name.
    text = text.replace("ident/", "base/")
    root = ElementTree.fromstring(text, parser=ElementTree.XMLParser(target=ElementTree.TreeBuilder()))
    root.set("name", name)
    ixx, iyy, izz, ixz = numbers.inertia
    sizes = {
        "metrics/wingarea": (numbers.area, "M2"),
        "metrics/wingspan": (numbers.span, "M"),
        "metrics/chord": (numbers.chord, "M"),
        "mass_balance/ixx": (ixx / _SLUG_FT2, "SLUG*FT2"),
        "mass_balance/iyy": (iyy / _SLUG_FT2, "SLUG*FT2"),
        "mass_balance/izz": (izz / _SLUG_FT2, "SLUG*FT2"),
        "mass_balance/ixz": (ixz / _SLUG_FT2, "SLUG*FT2"),
        "mass_balance/emptywt": (numbers.mass / _POUND_KG, "LBS"),
    }
    for path, (value, unit) in sizes.items():
        element = _find_part(root, path, base)
        element.text, element.attrib = f" {number(value)} ", {"unit": unit}
    _find_part(root, "mass_balance", base).set("negated_crossproduct_inertia", "false")
    base_properties = [
        property_element
        for property_element in root.iter("property")
        if (property_element.text or "").strip().startswith("base/")
    ]
    old_reactions = _find_part(root, "external_reactions", base)
    reactions = ElementTree.fromstring(_format_reactions(numbers, values, base_properties))
    root.remove(old_reactions)
    # Insert the properties before the elements that read them.
    root.insert(list(root).index(_find_part(root, "flight_control", base)), reactions)
    aerodynamics = _find_part(root, "aerodynamics", base)
    # The lift coefficients of the base and the estimate; the angle of attack is clipped to +-`_MAX_ALPHA_RAD`.
    lift_zero, lift_alpha = numbers.coefficients.lift_zero, numbers.coefficients.lift_alpha
    lift_functions = f"""<a>
    <function name="ident/alpha-rad"> <min> <v> {_MAX_ALPHA_RAD} </v>
      <max> <v> {-_MAX_ALPHA_RAD} </v> <p> aero/alpha-rad </p> </max> </min> </function>
    <function name="ident/lift-before">
      <sum> <v> {number(lift_zero)} </v> {_format_product(lift_alpha, "<p> ident/alpha-rad </p>")} </sum> </function>
    <function name="ident/lift-after">
      <sum> <v> {number(lift_zero)} </v> <p> ident/lift-offset </p>
        {_format_product(lift_alpha, "<p> ident/lift-slope </p>", "<p> ident/alpha-rad </p>")} </sum> </function></a>"""
    first_axis = list(aerodynamics).index(_find_part(root, "aerodynamics/axis", base))
    for k, function in enumerate(ElementTree.fromstring(lift_functions)):
        aerodynamics.insert(first_axis + k, function)
    drag = " <p> aero/drag-factor </p>" if "aero/drag-factor" in text else ""
    control = " <p> aero/control-factor </p>" if "aero/control-factor" in text else ""
    for axis in aerodynamics.iter("axis"):
        for function in ElementTree.fromstring(
            f"<a>{_format_added_function(base, numbers, axis.get('name', ''), drag, control)}</a>"
        ):
            axis.append(function)
    ElementTree.indent(root)
    note = f"{base.name}, identified from flight logs by planfly: posterior.toml says how."
    header = f'<?xml version="1.0"?>\n<!-- {note} -->\n'
    return header + ElementTree.tostring(root, encoding="unicode") + "\n"


# Elements of a base model that are rewritten or extended.
_REQUIRED_PARTS = (
    *(f"metrics/{name}" for name in ("wingarea", "wingspan", "chord")),
    *(f"mass_balance/{name}" for name in ("ixx", "iyy", "izz", "ixz", "emptywt")),
    *("external_reactions", "flight_control", "aerodynamics/axis"),
)


def check_base(base: Aircraft) -> None:
    """Raise FlightError if the base's model lacks a part that `format_identified_model` needs."""
    try:
        root = ElementTree.parse(base.model_file).getroot()
    except (OSError, ElementTree.ParseError) as error:
        message = f"{base.model_file}: {' '.join(str(error).split())}: expected a JSBSim model"
        raise FlightError(message, file=base.model_file) from None
    for path in _REQUIRED_PARTS:
        _find_part(root, path, base)


def _find_part(root: ElementTree.Element, path: str, base: Aircraft) -> ElementTree.Element:
    """Return the element at a path of the base's model.

    path: path below the root, such as "metrics/chord".
    Raises FlightError if the model lacks the element.
    """
    element = root.find(path)
    if element is None:
        allowed = "the model of a base aircraft needs this element; for an example see aircraft/aerosonde/aerosonde.xml"
        raise FlightError(
            f"{base.model_file}: no <{path.replace('/', '><')}>: {allowed}",
            file=base.model_file,
            field=path,
            allowed=allowed,
        )
    return element


# ----------------------------------------------------------------------
# Write the aerodynamic terms that the estimate adds, from the coefficients of the base.


def _format_factor_minus_one(name: str) -> str:
    """Return the XML of the factor ``ident/NAME`` minus 1."""
    return f"<sum> <p> ident/{name} </p> <v> -1 </v> </sum>"


def _format_product(coefficient: float, *factors: str) -> str:
    """Return the XML product of a coefficient and of factors given as XML."""
    return f"<product> <v> {number(coefficient)} </v> {' '.join(factors)} </product>"


def _format_added_function(base: Aircraft, numbers: BaseModel, axis: str, drag: str, control: str) -> str:
    """Return the XML of the JSBSim function that adds the estimated terms to an axis.

    Returns "" for an axis without estimated terms.

    axis: name of the axis of forces or moments, such as "LIFT".
    drag, control: XML factors that the base applies to drag and to control deflections, or "".
    """
    c = numbers.coefficients
    surfaces = [
        f"<product> <p> {reading.name} </p> <v> {number(reading.factor)} </v> </product>{control}"
        for reading in base.model.readings[:3]
    ]
    elevator, aileron, rudder = surfaces
    roll, pitch, yaw = (f"<p> velocities/{letter}-aero-rad_sec </p>" for letter in "pqr")
    span_factor, chord_factor, beta = "<p> aero/bi2vel </p>", "<p> aero/ci2vel </p>", "<p> aero/beta-rad </p>"
    lift_above_min_drag = [
        f" <difference> <p> ident/lift-{state} </p> <v> {number(c.lift_least_drag)} </v> </difference>"
        for state in ("before", "after")
    ]
    before, after = (f"<product>{2 * lift} </product>" for lift in lift_above_min_drag)
    terms_by_axis = {
        "X": (
            f"{drag} ",
            _format_product(c.drag_zero, _format_factor_minus_one("zero-lift-drag")),
            _format_product(c.drag_induced, "<p> ident/induced-drag </p>", after),
            _format_product(-c.drag_induced / numbers.induced_factor, before),
        ),
        "Z": ("", "<difference> <p> ident/lift-after </p> <p> ident/lift-before </p> </difference>"),
        "ROLL": (
            "<p> metrics/bw-ft </p>",
            _format_product(c.roll_beta, _format_factor_minus_one("dihedral-effect"), beta),
            _format_product(c.roll_roll, _format_factor_minus_one("roll-damping"), span_factor, roll),
            _format_product(c.roll_yaw, _format_factor_minus_one("roll-from-yaw"), span_factor, yaw),
            _format_product(c.roll_aileron, _format_factor_minus_one("aileron-power"), aileron),
        ),
        "PITCH": (
            "<p> metrics/cbarw-ft </p>",
            "<p> ident/pitch-offset </p>",
            _format_product(c.pitch_alpha, _format_factor_minus_one("pitch-stiffness"), "<p> aero/alpha-rad </p>"),
            _format_product(c.pitch_rate, _format_factor_minus_one("pitch-damping"), chord_factor, pitch),
            _format_product(c.pitch_elevator, _format_factor_minus_one("elevator-power"), elevator),
        ),
        "YAW": (
            "<p> metrics/bw-ft </p>",
            _format_product(c.yaw_beta, _format_factor_minus_one("weathercock"), beta),
            _format_product(c.yaw_roll, _format_factor_minus_one("yaw-from-roll"), span_factor, roll),
            _format_product(c.yaw_yaw, _format_factor_minus_one("yaw-damping"), span_factor, yaw),
            _format_product(c.yaw_aileron, _format_factor_minus_one("adverse-yaw"), aileron),
            _format_product(c.yaw_rudder, _format_factor_minus_one("rudder-power"), rudder),
        ),
    }
    if axis not in terms_by_axis:
        return ""
    scale, *terms = terms_by_axis[axis]
    return f"""<function name="ident/added/{axis.lower()}">
      <product> <p> aero/qbar-area </p> {scale} <sum> <v> 0 </v> {" ".join(terms)} </sum> </product> </function>"""


# ----------------------------------------------------------------------
# Write motor and propeller.

_RHO = "<p> motor/rho-kg_m3 </p>"
_SPEED = "<p> motor/propeller-rad_sec </p>"
_AIR = "<p> motor/airspeed-mps </p>"


def _format_reactions(numbers: BaseModel, values: Floats, base_properties: list[ElementTree.Element]) -> str:
    """Return the text of ``<external_reactions>``: properties, and forces of motor and propeller.

    numbers: model values of the base, scaled to the aircraft.
    values: estimated values of `PARAMETERS`, (n,), which become properties.
    base_properties: properties of the base's model that are kept.
    """
    identified_text = "\n".join(
        f'<property value="{values[INDEX[parameter.name]]:.9g}"> {parameter.property_name} </property>'
        for parameter in PARAMETERS
    )
    base_text = "\n".join(ElementTree.tostring(element, encoding="unicode").strip() for element in base_properties)
    motor = numbers.motor
    # The functions ``motor/NAME`` by NAME, in order of computation.
    functions = {
        "rho-kg_m3": "<product> <p> atmosphere/rho-slugs_ft3 </p> <v> 515.3788183931961 </v> </product>",
        "airspeed-mps": "<product> <p> velocities/vt-fps </p> <v> 0.3048 </v> </product>",
    }
    match motor:
        case ElectricMotor():
            functions |= _format_electric_functions(motor)
        case PropellerDisc():
            functions |= _format_disc_functions(motor)
        case MotorTable():
            functions |= _format_table_functions(motor)
        case _:
            raise TypeError(type(motor).__name__)
    functions["battery-power-w"] = f"<product> <p> {DRIVE_POWER} </p> {functions['battery-power-w']} </product>"
    body = "\n".join(f'<function name="motor/{name}"> {text} </function>' for name, text in functions.items())
    # JSBSim wants the moment in lbf ft and the force in lbf: the factors convert from N m and N.
    torque = """<moment name="torque" frame="BODY">
  <function> <product> <p> motor/torque-n_m </p> <v> -0.7375621492772654 </v> </product> </function>
  <direction> <x> 1 </x> <y> 0 </y> <z> 0 </z> </direction>
</moment>"""
    return f"""<external_reactions>
{base_text}
{identified_text}
<property value="1"> {DRIVE_POWER} </property>
<property value="{number(motor.voltage)}"> motor/battery-v </property>
<property value="0"> motor/braking </property>
{body}
<force name="thrust" frame="BODY">
  <function> <product> <p> motor/thrust-n </p> <v> 0.2248089430997105 </v> </product> </function>
  <location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
  <direction> <x> 1 </x> <y> 0 </y> <z> 0 </z> </direction>
</force>
{torque if numbers.has_torque_reaction else ""}
</external_reactions>"""


def _format_disc_functions(disc: PropellerDisc) -> dict[str, str]:
    """Return the XML of the JSBSim functions of a propeller disc, by name.

    They are exit speed, thrust, torque, battery power and battery current.
    """
    exit_property = "<p> motor/exit-mps </p>"
    full_speed = f"<product> <v> {number(disc.exit_speed)} </v> <p> ident/motor-speed </p> </product>"
    exit_speed = f"<product> <p> motor/throttle-norm </p> {full_speed} </product>"
    flow_speed = f"<sum> {exit_property} {_AIR} </sum>"
    if disc.ducted:
        speed_gain = f"<product> <p> motor/throttle-norm </p> <difference> {full_speed} {_AIR} </difference> </product>"
        exit_speed, flow_speed = f"<sum> {_AIR} {speed_gain} </sum>", exit_property
    thrust = f"<v> {number(disc.thrust_area)} </v> <p> ident/thrust </p> {_RHO} {flow_speed}"
    # Power given to the air, T (V + v_e) / 2, plus losses.
    power = f"<v> {number(0.5 * disc.power * (1.0 + disc.losses))} </v> <p> ident/propeller-torque </p>"
    return {
        "exit-mps": exit_speed,
        "thrust-n": f"<max> <v> 0 </v> <product> {thrust} <difference> {exit_property} {_AIR} </difference> </product>"
        " </max>",
        "torque-n_m": "<product> <v> 0 </v> <p> motor/throttle-norm </p> </product>",
        "battery-power-w": f"<product> {power} <p> motor/thrust-n </p> <sum> {exit_property} {_AIR} </sum> </product>",
        "battery-current-a": "<quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>",
    }


def _format_table_functions(motor: MotorTable) -> dict[str, str]:
    """Return the XML of the JSBSim functions that look up the tables of a motor, by name.

    A factor s on motor speed keeps the advance ratio: the tables are read at 1/s of the airspeed, and thrust and torque
    are multiplied by s squared, the power by s cubed.
    """
    speed = "<p> ident/motor-speed </p>"
    density_ratio = f"<quotient> {_RHO} <v> {number(motor.density)} </v> </quotient>"

    def format_table(values: Floats) -> str:
        """Return a JSBSim table of values by scaled airspeed (rows) and throttle (columns)."""
        header = "  ".join(number(throttle) for throttle in motor.throttles.tolist())
        rows = "\n".join(
            "  ".join(number(value) for value in (airspeed, *row))
            for airspeed, row in zip(motor.airspeeds.tolist(), values.tolist(), strict=True)
        )
        return f"""<table> <independentVar lookup="row"> motor/scaled-airspeed-mps </independentVar>
          <independentVar lookup="column"> motor/throttle-norm </independentVar>
          <tableData>\n{header}\n{rows}\n</tableData> </table>"""

    def format_scaled(values: Floats, factor: str, power: int) -> str:
        """Return the XML product of a table, a factor, the density ratio and a power of the speed factor.

        values: values of the table.
        factor: XML of the factor.
        power: exponent of the speed factor.
        """
        return f"<product> {factor} {density_ratio} {power * speed} {format_table(values)} </product>"

    load = "<p> ident/propeller-torque </p>"
    return {
        "scaled-airspeed-mps": f"<quotient> {_AIR} {speed} </quotient>",
        "thrust-n": format_scaled(motor.thrust_factor * motor.thrusts, "<p> ident/thrust </p>", 2),
        "torque-n_m": format_scaled(motor.load * motor.torques, load, 2),
        "battery-power-w": format_scaled(motor.load * motor.powers, load, 3),
        "battery-current-a": "<quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>",
    }


def _format_electric_functions(motor: ElectricMotor) -> dict[str, str]:
    """Return the XML of the JSBSim functions of an electric motor with its propeller, by name.

    The speed of the propeller is the positive root of the balance of motor and propeller torque.
    """
    q2, q1, q0 = (number(value) for value in motor.torque)
    kv, resistance = motor.back_voltage, motor.resistance
    # The factor on motor speed divides the torques at a given voltage, and its square divides the damping.
    speed = "<p> ident/motor-speed </p>"
    loss_torque = f"<quotient> <v> {number(kv * motor.idle_current)} </v> {speed} </quotient>"
    drive_torque = (
        f"<quotient> <product> <v> {number(-kv / resistance)} </v> <p> motor/input-v </p> </product>"
        f" {speed} </quotient>"
    )
    back_voltage_damping = (
        f"<quotient> <v> {number(kv * kv / resistance)} </v> <product> {speed} {speed} </product> </quotient>"
    )

    def format_positive_root(b: str, c: str) -> str:
        """Return the XML of the positive root w of q2 w^2 + b w + (q0 + c) = 0, for XML terms `b` and `c`."""
        discriminant = f"""<difference> <product> {b} {b} </product>
          <product> <v> 4 </v> <p> motor/q2 </p> <sum> <p> motor/q0 </p> {c} </sum> </product> </difference>"""
        return f"""<quotient> <difference> <sqrt> <max> <v> 0 </v> {discriminant} </max> </sqrt> {b} </difference>
          <product> <v> 2 </v> <p> motor/q2 </p> </product> </quotient>"""

    thrust_terms = [
        f"<product> <v> {number(motor.thrust[0])} </v> {_SPEED} {_SPEED} </product>",
        f"<product> <v> {number(motor.thrust[1])} </v> {_AIR} {_SPEED} </product>",
        f"<product> <v> {number(motor.thrust[2])} </v> {_AIR} {_AIR} </product>",
    ]
    torque = "<p> ident/propeller-torque </p>"
    back_voltage = f"<quotient> <product> <v> {number(kv)} </v> {_SPEED} </product> {speed} </quotient>"
    return {
        "input-v": "<product> <p> motor/battery-v </p> <p> motor/throttle-norm </p> </product>",
        "q2": f"<product> <v> {q2} </v> {torque} {_RHO} </product>",
        "q1": f"<product> <v> {q1} </v> {torque} {_RHO} {_AIR} </product>",
        "q0": f"<product> <v> {q0} </v> {torque} {_RHO} {_AIR} {_AIR} </product>",
        "b": f"<sum> <p> motor/q1 </p> {back_voltage_damping} </sum>",
        "driven-rad_sec": format_positive_root("<p> motor/b </p>", f"{loss_torque} {drive_torque}"),
        "windmill-rad_sec": format_positive_root("<p> motor/q1 </p>", loss_torque),
        "propeller-rad_sec": "<max> <v> 0 </v> <p> motor/driven-rad_sec </p>"
        " <difference> <p> motor/windmill-rad_sec </p>"
        " <product> <v> 1000000000 </v> <p> motor/braking </p> </product> </difference> </max>",
        "current-a": "<max> <product> <v> -1000000 </v> <p> motor/braking </p> </product>"
        f" <quotient> <difference> <p> motor/input-v </p> {back_voltage} </difference> <v> {number(resistance)} </v>"
        " </quotient> </max>",
        "battery-power-w": f"<sum> <v> {number(motor.avionics)} </v> <product> <v> {number(motor.power_ratio)} </v>"
        " <p> motor/input-v </p> <p> motor/current-a </p> </product> </sum>",
        "battery-current-a": "<quotient> <p> motor/battery-power-w </p> <p> motor/battery-v </p> </quotient>",
        "pull-n": f"<product> {_RHO} <p> ident/thrust </p> <sum> {' '.join(thrust_terms)} </sum> </product>",
        "thrust-n": "<sum> <max> <v> 0 </v> <p> motor/pull-n </p> </max>"
        f" <product> <v> {number(motor.windmill)} </v> <min> <v> 0 </v> <p> motor/pull-n </p> </min> </product> </sum>",
        "torque-n_m": f"<sum> <product> <p> motor/q2 </p> {_SPEED} {_SPEED} </product>"
        f" <product> <p> motor/q1 </p> {_SPEED} </product> <p> motor/q0 </p> </sum>",
    }
