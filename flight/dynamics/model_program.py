"""Translate the XML of a JSBSim model to registers and instructions for the compiled step.

`flight.dynamics.compiled_frame` holds the computations that are the same for every model; this module translates the
functions, tables and actuators of one model. A model with any unsupported part is not translated, and JSBSim flies it.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from flight.dynamics.compiled_frame import FORCE_REGISTERS, FRAME, FRAME_NUMBERS
from flight.dynamics.ground_contact import MAX_CONTACTS
from flight.dynamics.instructions import LOWER_LIMIT, Operation

# Field of the frame, and element of that field, for each property of JSBSim that the frame holds.
FRAME_PROPERTIES = {
    "atmosphere/rho-slugs_ft3": ("density", 0),
    "atmosphere/P-psf": ("pressure", 0),
    "atmosphere/T-R": ("temperature", 0),
    "velocities/vt-fps": ("airspeed", 0),
    "velocities/p-aero-rad_sec": ("air_rates", 0),
    "velocities/q-aero-rad_sec": ("air_rates", 1),
    "velocities/r-aero-rad_sec": ("air_rates", 2),
    "velocities/p-rad_sec": ("rates", 0),
    "velocities/q-rad_sec": ("rates", 1),
    "velocities/r-rad_sec": ("rates", 2),
    "velocities/u-fps": ("body_velocity", 0),
    "velocities/v-fps": ("body_velocity", 1),
    "velocities/w-fps": ("body_velocity", 2),
    "aero/alpha-rad": ("alpha", 0),
    "aero/beta-rad": ("beta", 0),
    "aero/qbar-psf": ("dynamic_pressure", 0),
    "aero/qbar-area": ("pressure_area", 0),
    "aero/bi2vel": ("span_time", 0),
    "aero/ci2vel": ("chord_time", 0),
    "metrics/Sw-sqft": ("wing_area", 0),
    "metrics/bw-ft": ("wing_span", 0),
    "metrics/cbarw-ft": ("wing_chord", 0),
}
# Roots of the properties that JSBSim itself computes or reads, by version 1.3.3.
_JSBSIM_ROOTS = {
    *("accelerations", "atmosphere", "attitude", "buoyant_forces", "contact", "external_reactions", "flight-path"),
    *("forces", "gear", "ground", "ic", "inertia", "inertial", "metrics", "moments", "orbital", "position"),
    *("propulsion", "simulation", "systems", "velocities"),
}
# The same below the root of aerodynamics, which models use for their own properties too.
_JSBSIM_AERO_PROPERTIES = {
    *("alpha-rad", "beta-rad", "mag-beta-rad", "alpha-deg", "beta-deg", "mag-beta-deg", "Re", "qbar-psf"),
    *("qbarUW-psf", "qbarUV-psf", "alphadot-rad_sec", "betadot-rad_sec", "alphadot-deg_sec", "betadot-deg_sec"),
    *("h_b-cg-ft", "h_b-mac-ft", "cl-squared", "qbar-area", "alpha-max-rad", "alpha-min-rad", "bi2vel", "ci2vel"),
    *("alpha-wing-rad", "stall-hyst-norm"),
}
# Operations of functions with several operands, by XML element.
_SEVERAL_OPERANDS = {
    "product": Operation.PRODUCT,
    "sum": Operation.SUM,
    "difference": Operation.DIFFERENCE,
    "max": Operation.MAX,
    "min": Operation.MIN,
}
_TWO_OPERANDS = {"quotient": Operation.QUOTIENT, "pow": Operation.POW}
_ONE_OPERAND = {"abs": Operation.ABS, "sqrt": Operation.SQRT, "sin": Operation.SIN, "cos": Operation.COS}
# Axes of aerodynamic functions: field of the frame, its element, and the only supported frame of reference.
_AXES = {
    "X": ("aero_force", 0, "STABILITY"),
    "Y": ("aero_force", 1, "STABILITY"),
    "Z": ("aero_force", 2, "STABILITY"),
    "ROLL": ("aero_moment", 0, "BODY"),
    "PITCH": ("aero_moment", 1, "BODY"),
    "YAW": ("aero_moment", 2, "BODY"),
}
# Sections of a model without instructions: JSBSim evaluates them before the flight.
_DATA_SECTIONS = {"fileheader", "metrics", "mass_balance"}
# Elements that only declare a property or describe something.
_DECLARATIONS = {"property", "description"}


class UnsupportedModel(Exception):
    """A model has an unsupported part, which the text names."""


class ActuatorBlock(NamedTuple):
    """Registers of an actuator.

    first_register: see `flight.dynamics.instructions`.
    source: register of its input.
    lag: rate of its lag, 1/s; NaN without a lag.
    rate: rate limit, 1/s; infinite without one.
    """

    first_register: int
    source: int
    lag: float
    rate: float


class ExternalForce(NamedTuple):
    """External force or moment: its name, the register of its magnitude, and the first one of its axes."""

    name: str
    is_moment: bool
    magnitude: int
    axes: int


class ContactData(NamedTuple):
    """Properties of a ground contact.

    base: path of the contact's JSBSim properties.
    spring: lbf/ft.
    damping: lbf s/ft.
    """

    base: str
    is_wheel: bool
    spring: float
    damping: float
    static_friction: float
    dynamic_friction: float
    rolling_friction: float


@dataclass(frozen=True, slots=True)
class ModelProgram:
    """Registers and instructions of a model.

    numbers: initial values of all registers, the registers of the frame first; properties are 0.
    fcs, aero, external: instructions of the flight controls, the aerodynamics and the external reactions.
    properties: register of each property.
    """

    numbers: tuple[float, ...]
    fcs: tuple[int, ...]
    aero: tuple[int, ...]
    external: tuple[int, ...]
    properties: dict[str, int]
    actuators: tuple[ActuatorBlock, ...]
    forces: tuple[ExternalForce, ...]
    contacts: tuple[ContactData, ...]


def frame_register(name: str, element: int = 0) -> int:
    """Return the register of an element of a field of the frame.

    name: name of a field of `flight.dynamics.compiled_frame.FRAME`.
    element: index in the flattened field; 0 for a number.

    >>> frame_register("dt"), frame_register("attitude", 3)
    (0, 6)
    """
    fields: Any = FRAME.fields
    return int(fields[name][1]) // 8 + element


@lru_cache(maxsize=8)
def translate(model: bytes) -> ModelProgram:
    """Translate the XML of a JSBSim model to a program.

    JSBSim must accept the model. Raises UnsupportedModel with the reason if the model is not supported.
    """
    try:
        root = ElementTree.fromstring(model)
    except ElementTree.ParseError as error:
        raise UnsupportedModel(f"XML with an error: {error}") from None
    sections = {section.tag: section for section in root}
    known_sections = {*_DATA_SECTIONS, "ground_reactions", "propulsion", *_SECTIONS}
    if len(sections) != len(root) or not sections.keys() <= known_sections:
        raise UnsupportedModel(
            f"the section <{next((part.tag for part in root if part.tag not in known_sections), root[-1].tag)}>"
        )
    if any("file" in element.attrib for element in root.iter()):
        raise UnsupportedModel("a file that the model includes")
    if len(sections.get("propulsion", ())):
        raise UnsupportedModel(f"<{sections['propulsion'][0].tag}> in <propulsion>")
    if missing := [name for name in _SECTIONS if name not in sections]:
        raise UnsupportedModel(f"a model without <{missing[0]}>")
    # Properties of the contacts except their positions, which are read from JSBSim.
    contacts = []
    for index, element in enumerate(sections.get("ground_reactions", ())):
        kind = element.get("type", "")
        if element.tag != "contact" or kind not in ("BOGEY", "STRUCTURE"):
            raise UnsupportedModel(f"<{element.tag} type={kind!r}> in <ground_reactions>")
        known_tags = {"location", *_CONTACT_NUMBERS, *_REQUIRED_CONTACT_VALUES}
        _check_element(element, attributes={"type", "name"}, children=known_tags)
        values = []
        for name, (unit, factor) in _CONTACT_NUMBERS.items():
            child = element.find(name)
            if child is None or child.get("unit") != unit:
                raise UnsupportedModel(f"<contact> without <{name}> in the unit {unit}")
            values.append(_element_number(child, attributes={"unit"}) * factor)
        for name, value in _REQUIRED_CONTACT_VALUES.items():
            if element.findtext(name, value).strip() != value:
                raise UnsupportedModel(f"<{name}> {element.findtext(name)}")
        is_wheel = kind == "BOGEY"
        contacts.append(ContactData(f"{'gear' if is_wheel else 'contact'}/unit[{index}]", is_wheel, *values))
    if len(contacts) > MAX_CONTACTS:
        raise UnsupportedModel(f"{len(contacts)} contacts")
    return _Translator([sections[name] for name in _SECTIONS], contacts).make_program()


# Sections with instructions.
_SECTIONS = ("flight_control", "aerodynamics", "external_reactions")


@dataclass(slots=True)
class _Translator:
    """Collector of the registers and instructions of a model.

    sections: flight controls, aerodynamics and external reactions.
    """

    sections: Sequence[Element]
    contacts: Sequence[ContactData]
    numbers: list[float] = field(default_factory=lambda: [0.0] * FRAME_NUMBERS)
    properties: dict[str, int] = field(default_factory=dict)
    actuators: list[ActuatorBlock] = field(default_factory=list)
    forces: list[ExternalForce] = field(default_factory=list)
    _constants: dict[str, int] = field(default_factory=dict)
    _code: list[int] = field(default_factory=list)

    def make_program(self) -> ModelProgram:
        """Translate all sections, and return the program."""
        self.properties = {
            name: frame_register(*field_and_element) for name, field_and_element in FRAME_PROPERTIES.items()
        }
        # Each property that the model creates has a register, because it may be read before it is computed.
        for section in self.sections:
            for element in section.iter():
                if element.tag == "property" and "value" in element.attrib:
                    self._property_register(_element_text(element))
                elif element.tag in _COMPONENTS:
                    self._property_register(_check_model_property(_component_property(element)))
                elif element.tag == "function" and "name" in element.attrib:
                    self._property_register(_check_model_property(element.attrib["name"]))
        controls, aerodynamics, reactions = self.sections
        fcs = self._translate_section(self._translate_flight_control, controls)
        aero = self._translate_section(self._translate_aerodynamics, aerodynamics)
        external = self._translate_section(self._translate_external_reactions, reactions)
        numbers, actuators, forces = tuple(self.numbers), tuple(self.actuators), tuple(self.forces)
        return ModelProgram(numbers, fcs, aero, external, self.properties, actuators, forces, tuple(self.contacts))

    def _translate_section(self, translate_section: Callable[[Element], None], section: Element) -> tuple[int, ...]:
        """Translate a section, and return its instructions."""
        self._code = []
        translate_section(section)
        return tuple(self._code)

    # Registers and instructions.

    def _property_register(self, name: str) -> int:
        """Return the register of a property; assign a new register to a new property."""
        if name not in self.properties:
            self.properties[name] = self._append_registers(0.0)
        return self.properties[name]

    def _append_registers(self, *values: float) -> int:
        """Append registers with some values; return the index of the first new register."""
        self.numbers += values
        return len(self.numbers) - len(values)

    def _constant_register(self, value: float) -> int:
        """Return the register of a constant; equal constants share a register."""
        key = value.hex()
        if key not in self._constants:
            self._constants[key] = self._append_registers(value)
        return self._constants[key]

    def _emit(self, operation: Operation, operands: Sequence[int], target: int | None = None) -> int:
        """Append an instruction, and return its target register.

        operation: code of the operation.
        operands: registers of the numbers that the operation takes.
        target: register for the result; None for a new register.
        """
        target = self._append_registers(0.0) if target is None else target
        self._code += [operation, target, len(operands), *operands]
        return target

    # Functions.

    def _translate_value(self, element: Element, target: int | None = None) -> int:
        """Translate an operand or operation; return the register that holds its value.

        target: register to use; None for the register of the operand itself, or for a new register.
        """
        tag = element.tag
        if tag in ("p", "property", "v", "value"):
            _check_element(element)
            source = (
                self._read_property(_element_text(element))
                if tag[0] == "p"
                else self._constant_register(_element_number(element))
            )
            return source if target is None else self._emit(Operation.PRODUCT, [source], target)
        if tag == "table":
            # Only a table of one variable is supported.
            _check_element(element, children={"independentVar", "tableData"})
            variables, data = element.findall("independentVar"), element.findall("tableData")
            if len(variables) != 1 or len(data) != 1:
                raise UnsupportedModel("a table of more than one variable")
            _check_element(variables[0], attributes={"lookup"})
            _check_element(data[0])
            numbers = [_parse_number(data[0], number) for number in _element_text(data[0]).split()]
            keys, lookup = numbers[::2], variables[0].get("lookup", "row")
            if lookup != "row" or len(numbers) % 2 or len(keys) < 2 or keys != sorted(set(keys)):
                raise UnsupportedModel("a table whose rows are not pairs with growing keys")
            first_register = self._append_registers(*numbers)
            variable = self._read_property(_element_text(variables[0]))
            return self._emit(Operation.TABLE, [variable, first_register, len(keys)], target)
        if tag not in _OPERATIONS:
            raise UnsupportedModel(f"operation <{tag}>")
        _check_element(element, children=_VALUES)
        operands = [self._translate_value(child) for child in element if child.tag != "description"]
        min_count, max_count = (2, 2) if tag in _TWO_OPERANDS else (1, 1) if tag in _ONE_OPERAND else (1, math.inf)
        if not min_count <= len(operands) <= max_count:
            raise UnsupportedModel(f"<{tag}> of {len(operands)} operands")
        return self._emit(_OPERATIONS[tag], operands, target)

    def _read_property(self, name: str) -> int:
        """Return the register of a property, or of its negative for a name that begins with a minus sign."""
        if name.startswith("-"):
            return self._emit(Operation.PRODUCT, [self._read_property(name[1:].strip()), self._constant_register(-1.0)])
        if name not in self.properties:
            raise UnsupportedModel(f"property {name}")
        return self.properties[name]

    def _translate_function(self, element: Element, *, may_have_name: bool = True, target: int | None = None) -> int:
        """Translate a function; return the register of its value.

        may_have_name: True if the function may name a property, which is then its target.
        """
        _check_element(element, attributes={"name"} if may_have_name else (), children=_VALUES)
        if name := element.get("name"):
            target = self._property_register(name)
        content = [child for child in element if child.tag != "description"]
        if len(content) != 1:
            raise UnsupportedModel(f"<function> of {len(content)} values")
        return self._translate_value(content[0], target)

    # Flight controls.

    def _translate_flight_control(self, section: Element) -> None:
        """Translate the components of all channels, in order."""
        _check_element(section, attributes={"name"}, children={"channel", *_DECLARATIONS})
        for channel in section.findall("channel"):
            _check_element(channel, attributes={"name"}, children={*_COMPONENTS, *_DECLARATIONS})
            for component in channel:
                if component.tag == "actuator":
                    # One input, which may have a lag, a rate limit and position limits.
                    known_tags = {"input", "lag", "rate_limit", "clipto", "description"}
                    _check_element(component, attributes={"name"}, children=known_tags)
                    inputs = [self._read_property(_element_text(child)) for child in component.findall("input")]
                    if len(inputs) != 1:
                        raise UnsupportedModel(f"<actuator> of {len(inputs)} inputs")
                    lag_element, rate_element = component.find("lag"), component.find("rate_limit")
                    lag = math.nan if lag_element is None else _element_number(lag_element)
                    rate = math.inf if rate_element is None else _element_number(rate_element)
                    lower, upper = _clip_limits(component) or (-math.inf, math.inf)
                    # The factors depend on the time step, and the state on the start of the flight.
                    first_register = self._append_registers(*([math.nan] * LOWER_LIMIT), lower, upper)
                    self.actuators.append(ActuatorBlock(first_register, inputs[0], lag, rate))
                    output = self._property_register(_component_property(component))
                    self._emit(Operation.ACTUATOR, [inputs[0], first_register], output)
                elif component.tag == "fcs_function":
                    # One function, which may have limits.
                    _check_element(component, attributes={"name"}, children={"function", "clipto", "description"})
                    functions, limits = component.findall("function"), _clip_limits(component)
                    if len(functions) != 1:
                        raise UnsupportedModel(f"<fcs_function> of {len(functions)} functions")
                    output = self._property_register(_component_property(component))
                    if limits is None:
                        self._translate_function(functions[0], may_have_name=False, target=output)
                    else:
                        value = self._translate_function(functions[0], may_have_name=False)
                        self._emit(Operation.CLIP, [value, *map(self._constant_register, limits)], output)

    # Forces.

    def _translate_aerodynamics(self, section: Element) -> None:
        """Translate the aerodynamic functions, and the sum of the functions of each axis."""
        _check_element(section, children={"function", "axis", *_DECLARATIONS})
        for function in section.findall("function"):
            self._translate_function(function)
        axes = {}
        for axis in section.findall("axis"):
            name = axis.get("name", "")
            _check_element(axis, attributes={"name", "frame"}, children={"function", "description"})
            if name not in _AXES or name in axes or axis.get("frame", "BODY") != _AXES[name][2]:
                raise UnsupportedModel(f"<axis name={name!r}> in the frame {axis.get('frame', 'BODY')}")
            axes[name] = axis
        if not axes.keys() & {"X", "Y", "Z"}:
            raise UnsupportedModel("aerodynamics without forces")
        # JSBSim evaluates the axes in this order, whatever their order in the file.
        for name, (vector, element, _) in _AXES.items():
            values = (
                [self._translate_function(function) for function in axes[name].findall("function")]
                if name in axes
                else []
            )
            self._emit(Operation.SUM, values or [self._constant_register(0.0)], frame_register(vector, element))

    def _translate_external_reactions(self, section: Element) -> None:
        """Translate the functions of the external reactions, and the magnitudes of the forces and moments."""
        _check_element(section, children={"function", "force", "moment", *_DECLARATIONS})
        for element in section.findall("function"):
            self._translate_function(element)
        for element in [*section.findall("force"), *section.findall("moment")]:
            is_moment = element.tag == "moment"
            location_elements = () if is_moment else ("location",)
            _check_element(
                element, attributes={"name", "frame"}, children={"function", "direction", *location_elements}
            )
            functions = element.findall("function")
            if element.get("frame") != "BODY" or len(functions) != 1:
                raise UnsupportedModel(f"<{element.tag}> that is not a function in the frame BODY")
            magnitude = self._translate_function(functions[0], may_have_name=False)
            axes = self._append_registers(*([0.0] * FORCE_REGISTERS))
            self.forces.append(ExternalForce(element.get("name", ""), is_moment, magnitude, axes))


# Pounds per foot in a newton per meter, JSBSim's value.
_LBF_FT = 1.0 / 14.5939
# Numbers of a contact and their units.
_CONTACT_NUMBERS = {
    "spring_coeff": ("N/M", _LBF_FT),
    "damping_coeff": ("N/M/SEC", _LBF_FT),
    "static_friction": (None, 1.0),
    "dynamic_friction": (None, 1.0),
    "rolling_friction": (None, 1.0),
}
# Required values of elements that a contact may have: no contact steers, brakes or retracts.
_REQUIRED_CONTACT_VALUES = {"max_steer": "0", "brake_group": "NONE", "retractable": "0"}


# Components of a channel.
_COMPONENTS = {"actuator", "fcs_function"}
# All operations, and all elements with a value.
_OPERATIONS = _SEVERAL_OPERANDS | _TWO_OPERANDS | _ONE_OPERAND
_VALUES = {"p", "property", "v", "value", "table", "description", *_OPERATIONS}


def _check_element(element: Element, *, attributes: Iterable[str] = (), children: Iterable[str] = ()) -> None:
    """Raise UnsupportedModel if an element has an attribute or a child that is not allowed.

    attributes, children: allowed names.
    """
    for name in element.attrib:
        if name not in attributes:
            raise UnsupportedModel(f"<{element.tag} {name}=...>")
    for child in element:
        if child.tag not in children:
            raise UnsupportedModel(f"<{child.tag}> in <{element.tag}>")


def _element_text(element: Element) -> str:
    """Return the text of an element without surrounding blanks; "" without one."""
    return (element.text or "").strip()


def _element_number(element: Element, *, attributes: Iterable[str] = ()) -> float:
    """Return the number in an element. Raises UnsupportedModel for anything but a number.

    attributes: names of the attributes that the element may have.
    """
    _check_element(element, attributes=attributes)
    return _parse_number(element, _element_text(element))


def _parse_number(element: Element, text: str) -> float:
    """Parse the text of an element as a number. Raises UnsupportedModel for anything but a number."""
    try:
        return float(text)
    except ValueError:
        raise UnsupportedModel(f"{text!r} instead of a number in <{element.tag}>") from None


def _clip_limits(element: Element) -> tuple[float, float] | None:
    """Return the lower and upper limit of a component, or None if it has no limits.

    Raises UnsupportedModel if it has only one of them.
    """
    clip = element.find("clipto")
    if clip is None:
        return None
    _check_element(clip, children={"min", "max"})
    lower, upper = clip.find("min"), clip.find("max")
    if lower is None or upper is None:
        raise UnsupportedModel("<clipto> without one of its limits")
    return _element_number(lower), _element_number(upper)


def _component_property(element: Element) -> str:
    """Return the name of the property that holds the output of a component."""
    name = element.get("name", "")
    return name if "/" in name else "fcs/" + name.lower().replace(" ", "-")


def _check_model_property(name: str) -> str:
    """Return the name of a property that the model computes, after checking that JSBSim does not use it.

    Raises UnsupportedModel for a property that JSBSim itself computes or reads, such as a mass, a failure switch or the
    direction of a force. JSBSim would use the model's value for it, but the compiled program would not.
    """
    root, _, relative_name = name.partition("/")
    if (
        root in _JSBSIM_ROOTS
        or (root == "aero" and relative_name in _JSBSIM_AERO_PROPERTIES)
        or "/malfunction/" in name
    ):
        raise UnsupportedModel(f"a model that computes {name}, which JSBSim uses itself")
    return name
