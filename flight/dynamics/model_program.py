"""Translate the XML of a JSBSim model to registers and instructions for the compiled step.

What JSBSim computes the same way for every model is in `flight.dynamics.compiled_frame`; here are the functions, tables
and actuators of one model. A model with anything that is not covered is not translated, and JSBSim flies it.
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

# Properties of JSBSim that are numbers of the frame: field, and element of a field with several.
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
# Operations of functions by their element.
_SEVERAL_OPERANDS = {
    "product": Operation.PRODUCT,
    "sum": Operation.SUM,
    "difference": Operation.DIFFERENCE,
    "max": Operation.MAX,
    "min": Operation.MIN,
}
_TWO_OPERANDS = {"quotient": Operation.QUOTIENT, "pow": Operation.POW}
_ONE_OPERAND = {"abs": Operation.ABS, "sqrt": Operation.SQRT, "sin": Operation.SIN, "cos": Operation.COS}
# Axes of aerodynamic functions: field of the frame, its element, and the only frame of reference that is covered.
_AXES = {
    "X": ("aero_force", 0, "STABILITY"),
    "Y": ("aero_force", 1, "STABILITY"),
    "Z": ("aero_force", 2, "STABILITY"),
    "ROLL": ("aero_moment", 0, "BODY"),
    "PITCH": ("aero_moment", 1, "BODY"),
    "YAW": ("aero_moment", 2, "BODY"),
}
# Sections of a model without instructions: JSBSim computes what they state before the flight.
_DATA_SECTIONS = {"fileheader", "metrics", "mass_balance"}
# Elements that state a property or nothing at all.
_DECLARATIONS = {"property", "description"}


class UnsupportedModel(Exception):
    """A model has something that is not covered, which the text names."""


class ActuatorBlock(NamedTuple):
    """Registers of an actuator.

    begin: first register, see `flight.dynamics.instructions`.
    source: register of its input.
    lag: rate of its lag, 1/s; NaN without a lag.
    rate: rate limit, 1/s; infinite without one.
    """

    begin: int
    source: int
    lag: float
    rate: float


class ExternalForce(NamedTuple):
    """External force or moment: its name, the register of its magnitude, and the first register of its axes."""

    name: str
    is_moment: bool
    magnitude: int
    axes: int


class ContactData(NamedTuple):
    """Numbers of a contact.

    base: path of its properties.
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

    numbers: initial values of all registers, the frame first; properties are 0.
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
    """Return the register of a field of the frame.

    >>> frame_register("dt"), frame_register("attitude", 3)
    (0, 6)
    """
    fields: Any = FRAME.fields
    return int(fields[name][1]) // 8 + element


@lru_cache(maxsize=8)
def translate(model: bytes) -> ModelProgram:
    """Translate the XML of a model that JSBSim accepts.

    Raise UnsupportedModel with the reason for a model that is not covered.
    """
    try:
        root = ElementTree.fromstring(model)
    except ElementTree.ParseError as error:
        raise UnsupportedModel(f"XML with an error: {error}") from None
    sections = {one.tag: one for one in root}
    known = {*_DATA_SECTIONS, "ground_reactions", "propulsion", *_SECTIONS}
    if len(sections) != len(root) or not sections.keys() <= known:
        raise UnsupportedModel(f"the section <{next((one.tag for one in root if one.tag not in known), root[-1].tag)}>")
    if any("file" in one.attrib for one in root.iter()):
        raise UnsupportedModel("a file that the model includes")
    if len(sections.get("propulsion", ())):
        raise UnsupportedModel(f"<{sections['propulsion'][0].tag}> in <propulsion>")
    if missing := [name for name in _SECTIONS if name not in sections]:
        raise UnsupportedModel(f"a model without <{missing[0]}>")
    contacts = [_contact(one, number) for number, one in enumerate(sections.get("ground_reactions", ()))]
    if len(contacts) > MAX_CONTACTS:
        raise UnsupportedModel(f"{len(contacts)} contacts")
    return _Translator([sections[name] for name in _SECTIONS], contacts).program()


# Sections with instructions.
_SECTIONS = ("flight_control", "aerodynamics", "external_reactions")


@dataclass(slots=True)
class _Translator:
    """Registers and instructions in the making.

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

    def program(self) -> ModelProgram:
        self.properties = {name: frame_register(*place) for name, place in FRAME_PROPERTIES.items()}
        self._declare_properties()
        controls, aerodynamics, reactions = self.sections
        fcs = self._instructions(self._flight_control, controls)
        aero = self._instructions(self._aerodynamics, aerodynamics)
        external = self._instructions(self._external_reactions, reactions)
        numbers, actuators, forces = tuple(self.numbers), tuple(self.actuators), tuple(self.forces)
        return ModelProgram(numbers, fcs, aero, external, self.properties, actuators, forces, tuple(self.contacts))

    def _instructions(self, translate_section: Callable[[Element], None], section: Element) -> tuple[int, ...]:
        """Return the instructions of a section."""
        self._code = []
        translate_section(section)
        return tuple(self._code)

    # Registers and instructions.

    def _declare_properties(self) -> None:
        """Give a register to each property that the model makes, since one may be read before it is computed."""
        for section in self.sections:
            for one in section.iter():
                if one.tag == "property" and "value" in one.attrib:
                    self._property(_text(one))
                elif one.tag in _COMPONENTS:
                    self._property(_component_property(one))
                elif one.tag == "function" and "name" in one.attrib:
                    self._property(one.attrib["name"])

    def _property(self, name: str) -> int:
        if name not in self.properties:
            self.properties[name] = self._new_register(0.0)
        return self.properties[name]

    def _new_register(self, *values: float) -> int:
        """Append registers with these values, and return the first of them."""
        self.numbers += values
        return len(self.numbers) - len(values)

    def _constant(self, value: float) -> int:
        key = value.hex()
        if key not in self._constants:
            self._constants[key] = self._new_register(value)
        return self._constants[key]

    def _emit(self, operation: Operation, operands: Sequence[int], target: int | None = None) -> int:
        """Append an instruction, and return its target, a new register if none is given."""
        target = self._new_register(0.0) if target is None else target
        self._code += [operation, target, len(operands), *operands]
        return target

    # Functions.

    def _value(self, element: Element, target: int | None = None) -> int:
        """Translate an operand or operation, and return the register of its value, the target if one is given."""
        tag = element.tag
        if tag in ("p", "property", "v", "value"):
            _check(element)
            source = self._read(_text(element)) if tag[0] == "p" else self._constant(_number(element))
            return source if target is None else self._emit(Operation.PRODUCT, [source], target)
        if tag == "table":
            return self._table(element, target)
        if tag not in _OPERATIONS:
            raise UnsupportedModel(f"operation <{tag}>")
        _check(element, children=_VALUES)
        operands = [self._value(one) for one in element if one.tag != "description"]
        least, most = (2, 2) if tag in _TWO_OPERANDS else (1, 1) if tag in _ONE_OPERAND else (1, math.inf)
        if not least <= len(operands) <= most:
            raise UnsupportedModel(f"<{tag}> of {len(operands)} operands")
        return self._emit(_OPERATIONS[tag], operands, target)

    def _read(self, name: str) -> int:
        """Return the register of a property, or of its negative for a name that begins with a minus sign."""
        if name.startswith("-"):
            return self._emit(Operation.PRODUCT, [self._read(name[1:].strip()), self._constant(-1.0)])
        if name not in self.properties:
            raise UnsupportedModel(f"property {name}")
        return self.properties[name]

    def _table(self, element: Element, target: int | None) -> int:
        _check(element, children={"independentVar", "tableData"})
        variables, data = element.findall("independentVar"), element.findall("tableData")
        if len(variables) != 1 or len(data) != 1:
            raise UnsupportedModel("a table of more than one variable")
        _check(variables[0], attributes={"lookup"})
        _check(data[0])
        numbers = [_float(data[0], one) for one in _text(data[0]).split()]
        keys = numbers[::2]
        if variables[0].get("lookup", "row") != "row" or len(numbers) % 2 or len(keys) < 2 or keys != sorted(set(keys)):
            raise UnsupportedModel("a table whose rows are not pairs with growing keys")
        begin = self._new_register(*numbers)
        return self._emit(Operation.TABLE, [self._read(_text(variables[0])), begin, len(keys)], target)

    def _function(self, element: Element, *, named: bool = True, target: int | None = None) -> int:
        """Translate a function, and return the register of its value."""
        _check(element, attributes={"name"} if named else (), children=_VALUES)
        if name := element.get("name"):
            target = self._property(name)
        content = [one for one in element if one.tag != "description"]
        if len(content) != 1:
            raise UnsupportedModel(f"<function> of {len(content)} values")
        return self._value(content[0], target)

    # Flight controls.

    def _flight_control(self, section: Element) -> None:
        _check(section, attributes={"name"}, children={"channel", *_DECLARATIONS})
        for channel in section.findall("channel"):
            _check(channel, attributes={"name"}, children={*_COMPONENTS, *_DECLARATIONS})
            for one in channel:
                if one.tag == "actuator":
                    self._actuator(one)
                elif one.tag == "fcs_function":
                    self._fcs_function(one)

    def _actuator(self, element: Element) -> None:
        _check(element, attributes={"name"}, children={"input", "lag", "rate_limit", "clipto", "description"})
        inputs = [self._read(_text(one)) for one in element.findall("input")]
        if len(inputs) != 1:
            raise UnsupportedModel(f"<actuator> of {len(inputs)} inputs")
        lag, rate = element.find("lag"), element.find("rate_limit")
        low, high = _clip_limits(element) or (-math.inf, math.inf)
        # The factors depend on the time step, and the memory on the start of the flight.
        begin = self._new_register(*([math.nan] * LOWER_LIMIT), low, high)
        self.actuators.append(
            ActuatorBlock(
                begin,
                inputs[0],
                math.nan if lag is None else _number(lag),
                math.inf if rate is None else _number(rate),
            )
        )
        self._emit(Operation.ACTUATOR, [inputs[0], begin], self._property(_component_property(element)))

    def _fcs_function(self, element: Element) -> None:
        _check(element, attributes={"name"}, children={"function", "clipto", "description"})
        functions, limits = element.findall("function"), _clip_limits(element)
        if len(functions) != 1:
            raise UnsupportedModel(f"<fcs_function> of {len(functions)} functions")
        output = self._property(_component_property(element))
        if limits is None:
            self._function(functions[0], named=False, target=output)
        else:
            value = self._function(functions[0], named=False)
            self._emit(Operation.CLIP, [value, *map(self._constant, limits)], output)

    # Forces.

    def _aerodynamics(self, section: Element) -> None:
        _check(section, children={"function", "axis", *_DECLARATIONS})
        for one in section.findall("function"):
            self._function(one)
        axes = {}
        for axis in section.findall("axis"):
            name = axis.get("name", "")
            _check(axis, attributes={"name", "frame"}, children={"function", "description"})
            if name not in _AXES or name in axes or axis.get("frame", "BODY") != _AXES[name][2]:
                raise UnsupportedModel(f"<axis name={name!r}> in the frame {axis.get('frame', 'BODY')}")
            axes[name] = axis
        if not axes.keys() & {"X", "Y", "Z"}:
            raise UnsupportedModel("aerodynamics without forces")
        # JSBSim evaluates the axes in this order, whatever their order in the file.
        for name, (vector, element, _) in _AXES.items():
            values = [self._function(one) for one in axes[name].findall("function")] if name in axes else []
            self._emit(Operation.SUM, values or [self._constant(0.0)], frame_register(vector, element))

    def _external_reactions(self, section: Element) -> None:
        _check(section, children={"function", "force", "moment", *_DECLARATIONS})
        for one in section.findall("function"):
            self._function(one)
        for one in [*section.findall("force"), *section.findall("moment")]:
            is_moment = one.tag == "moment"
            places = () if is_moment else ("location",)
            _check(one, attributes={"name", "frame"}, children={"function", "direction", *places})
            functions = one.findall("function")
            if one.get("frame") != "BODY" or len(functions) != 1:
                raise UnsupportedModel(f"<{one.tag}> that is not a function in the frame BODY")
            magnitude = self._function(functions[0], named=False)
            axes = self._new_register(*([0.0] * FORCE_REGISTERS))
            self.forces.append(ExternalForce(one.get("name", ""), is_moment, magnitude, axes))


# Pounds per foot in a newton per meter, as JSBSim has them.
_LBF_FT = 1.0 / 14.5939
# Numbers of a contact and their units.
_CONTACT_NUMBERS = {
    "spring_coeff": ("N/M", _LBF_FT),
    "damping_coeff": ("N/M/SEC", _LBF_FT),
    "static_friction": (None, 1.0),
    "dynamic_friction": (None, 1.0),
    "rolling_friction": (None, 1.0),
}
# What a contact does not have: it neither steers, nor brakes, nor retracts.
_CONTACT_LACKS = {"max_steer": "0", "brake_group": "NONE", "retractable": "0"}


def _contact(element: Element, number: int) -> ContactData:
    """Return the numbers of a contact, whose place is read from its properties."""
    kind = element.get("type", "")
    if element.tag != "contact" or kind not in ("BOGEY", "STRUCTURE"):
        raise UnsupportedModel(f"<{element.tag} type={kind!r}> in <ground_reactions>")
    _check(element, attributes={"type", "name"}, children={"location", *_CONTACT_NUMBERS, *_CONTACT_LACKS})
    values = []
    for name, (unit, factor) in _CONTACT_NUMBERS.items():
        one = element.find(name)
        if one is None or one.get("unit") != unit:
            raise UnsupportedModel(f"<contact> without <{name}> in the unit {unit}")
        values.append(_number(one, attributes={"unit"}) * factor)
    for name, value in _CONTACT_LACKS.items():
        if element.findtext(name, value).strip() != value:
            raise UnsupportedModel(f"<{name}> {element.findtext(name)}")
    wheel = kind == "BOGEY"
    return ContactData(f"{'gear' if wheel else 'contact'}/unit[{number}]", wheel, *values)


# Components of a channel.
_COMPONENTS = {"actuator", "fcs_function"}
# All operations, and all elements with a value.
_OPERATIONS = _SEVERAL_OPERANDS | _TWO_OPERANDS | _ONE_OPERAND
_VALUES = {"p", "property", "v", "value", "table", "description", *_OPERATIONS}


def _check(element: Element, *, attributes: Iterable[str] = (), children: Iterable[str] = ()) -> None:
    """Raise UnsupportedModel for an element with other attributes or children."""
    for name in element.attrib:
        if name not in attributes:
            raise UnsupportedModel(f"<{element.tag} {name}=...>")
    for child in element:
        if child.tag not in children:
            raise UnsupportedModel(f"<{child.tag}> in <{element.tag}>")


def _text(element: Element) -> str:
    return (element.text or "").strip()


def _number(element: Element, *, attributes: Iterable[str] = ()) -> float:
    """Return an element's number. Raise UnsupportedModel for a property or anything else."""
    _check(element, attributes=attributes)
    return _float(element, _text(element))


def _float(element: Element, text: str) -> float:
    """Return a number in an element. Raise UnsupportedModel for anything else."""
    try:
        return float(text)
    except ValueError:
        raise UnsupportedModel(f"{text!r} instead of a number in <{element.tag}>") from None


def _clip_limits(element: Element) -> tuple[float, float] | None:
    """Return the limits of a component, or None if it has none."""
    clip = element.find("clipto")
    if clip is None:
        return None
    _check(clip, children={"min", "max"})
    low, high = clip.find("min"), clip.find("max")
    if low is None or high is None:
        raise UnsupportedModel("<clipto> without one of its limits")
    return _number(low), _number(high)


def _component_property(element: Element) -> str:
    """Return the property of a component's output."""
    name = element.get("name", "")
    return name if "/" in name else "fcs/" + name.lower().replace(" ", "-")
