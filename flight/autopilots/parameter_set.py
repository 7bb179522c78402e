"""Build an autopilot's set of parameter values from files, aircraft, logs and defaults.

A parameter is taken from the first source that states it: the user's file, the aircraft, the autopilot's default.
`flight.autopilots.arduplane.parameters` and `flight.autopilots.px4.parameters` define which parameters an
autopilot's simulation reads.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self, get_args

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Origin, ParameterValue, StoredParameters, find_contradictions
from flight.autopilots.parameter_files import Entry, parse_parameters, read_parameter_file
from flight.autopilots.parameter_origin import read_parameters_for, refuse_unknown_parameters
from world.errors import ParameterError
from world.files import TextLine

# File in an aircraft's folder with ArduPlane's parameters of the aircraft.
AIRCRAFT_FILE = "ardupilot.parm"

# Relative tolerance within which two values are one value, because autopilots store values in single precision.
_SAME_VALUE_TOLERANCE = 1e-6

# Values by name, and the source that states them.
Stated = tuple[Origin, Mapping[str, float]]


class Definition(NamedTuple):
    """Name, default, accepted range and unit of one parameter.

    name: the autopilot's name for the parameter.
    default: the autopilot's default, in its unit.
    low, high: range of accepted values, in that unit.
    to_si: factor to SI and radians.
    old: an older name, and the factor from the older parameter's unit to the present unit.
    documented: range in the autopilot's parameter reference, if narrower than the accepted range.
    """

    name: str
    default: float
    low: float
    high: float
    to_si: float = 1.0
    old: tuple[str, float] | None = None
    documented: tuple[float, float] | None = None


class ParameterTable:
    """The parameters that an autopilot's simulation reads.

    autopilot: name of the autopilot in a scenario.
    title: name of the autopilot in texts.
    definitions: definitions by the field of the control law's record, in the order of the values.
    when_stated: definitions of parameters that have no part in the control law, by name; a set holds them only if a
        file states them.
    pairs: names of a minimum and of its maximum, such as ("THR_MIN", "THR_MAX"); the minimum must be lower.
    orders: names of parameters whose values should not decrease from one parameter to the next.
    log_digits: significant digits of the values in a log.
    """

    def __init__(
        self,
        autopilot: str,
        title: str,
        definitions: Mapping[str, Definition],
        *,
        pairs: Iterable[tuple[str, str]],
        orders: Iterable[tuple[str, ...]],
        when_stated: Iterable[Definition] = (),
        log_digits: int = 17,
    ) -> None:
        self.autopilot, self.title, self.log_digits = autopilot, title, log_digits
        self.definitions = tuple(definitions.values())
        self.when_stated = {definition.name: definition for definition in when_stated}
        self.pairs, self.orders = tuple(pairs), tuple(orders)
        self.by_name = {definition.name: definition for definition in self.definitions} | self.when_stated
        # Definition and factor to its unit, by each name that a file may use.
        self.by_any_name = {name: (definition, 1.0) for name, definition in self.by_name.items()} | {
            definition.old[0]: (definition, definition.old[1]) for definition in self.by_name.values() if definition.old
        }

    def read(self, entries: Mapping[str, Entry]) -> tuple[dict[str, float], tuple[str, ...]]:
        """Return the values of a file by present name and in present units, and the names that are unknown.

        A name is unknown if the table lacks it. Raises ParameterError if a value is not accepted, or if a parameter has
        two values.
        """
        values: dict[str, float] = {}
        entry_by_present_name: dict[str, Entry] = {}
        unused = []
        for name, entry in entries.items():
            if name not in self.by_any_name:
                unused.append(name)
                continue
            definition, unit_factor = self.by_any_name[name]
            value = entry.value * unit_factor
            if not definition.low <= value <= definition.high:
                allowed = f"allowed {definition.low / unit_factor:g}..{definition.high / unit_factor:g}"
                raise _value_error(entry.where, name, entry.value, allowed)
            first_entry = entry_by_present_name.setdefault(definition.name, entry)
            if not math.isclose(values.setdefault(definition.name, value), value, rel_tol=_SAME_VALUE_TOLERANCE):
                first_text = f"{first_entry.name} {first_entry.value:g} on line {first_entry.where.number}"
                expected = values[definition.name] / unit_factor
                allowed = f"expected {expected:g}, because {first_text} is the same parameter under its other name"
                raise _value_error(entry.where, name, entry.value, allowed)
        return values, tuple(unused)

    def read_log(self, logged: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
        """Return the accepted values of a log by present name, and a sentence for each rejected value.

        A minimum that is not below its maximum is rejected together with the maximum. A log without any accepted value
        also gets a sentence.

        logged: values by present or older name.
        """
        values: dict[str, float] = {}
        notes = []
        for name, definition in self.by_name.items():
            old_name = definition.old
            if name in logged:
                value = logged[name]
            elif old_name is not None and old_name[0] in logged:
                value = logged[old_name[0]] * old_name[1]
            else:
                continue
            value = float(f"{value:.{self.log_digits}g}")
            if definition.low <= value <= definition.high:
                values[name] = value
            else:
                allowed = f"{definition.low:g}..{definition.high:g}"
                notes.append(f"{name} {value:g} in the log is outside {allowed}: the default is used")
        for minimum, maximum in self.pairs:
            if minimum in values and maximum in values and values[minimum] >= values[maximum]:
                notes.append(
                    f"{minimum} {values[minimum]:g} is not below {maximum} {values[maximum]:g} in the log:"
                    " the defaults of both are used"
                )
                del values[minimum], values[maximum]
        if not values:
            notes.append(f"the log contains no parameters: {self.title}'s defaults are used")
        return values, notes


@dataclass(frozen=True)
class ParameterSet:
    """The parameters of an autopilot; each autopilot has a subclass with its own `table`.

    values: every parameter that the control law uses, in the order of the table's definitions, and after these the
        stated parameters of the table's ``when_stated``.
    unused: names in the file that the control law does not use.
    source: the user's file, "" if there is no file.
    """

    table: ClassVar[ParameterTable]
    # Names of parameters that are read, but have no effect on the simulated flight.
    not_simulated: ClassVar[tuple[str, ...]]
    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...] = ()
    source: str = ""

    @classmethod
    def defaults(cls, *fields: Any) -> Self:
        """Return the parameters at the autopilot's default values.

        fields: additional fields of the subclass, such as PX4's version.
        """
        return cls._build([], "", (), *fields)

    @classmethod
    def load(cls, aircraft: Aircraft, path: Path | str | None = None, *fields: Any) -> Self:
        """Return an aircraft's parameters from the user's file, the aircraft's own file, and the defaults.

        path: the user's file; None for no file.
        fields: additional fields of the subclass, such as PX4's version.

        Raises ParameterError, in one line, if a file cannot be read or contains a value that is not allowed.
        """
        sources: list[Stated] = []
        unused: tuple[str, ...] = ()
        if path is not None:
            entries = read_parameters_for(Path(path), cls.table.autopilot)
            values, unused = cls.table.read(entries)
            refuse_unknown_parameters(Path(path), cls.table.autopilot, entries, values)
            sources.append(("file", values))
        aircraft_file = aircraft.folder / AIRCRAFT_FILE
        if aircraft_file.exists():
            sources.append(("aircraft", cls._read_aircraft_values(read_parameter_file(aircraft_file))))
        return cls._build(sources, "" if path is None else str(path), unused, *fields)

    @classmethod
    def from_text(cls, text: str, source: str, *fields: Any) -> Self:
        """Return the parameters in a file's text; missing parameters have their defaults.

        Raises ParameterError if the text is invalid or contains a value that is not allowed.
        """
        values, unused = cls.table.read(parse_parameters(text, source))
        return cls._build([("file", values)], source, unused, *fields)

    @classmethod
    def restore(cls, stored: StoredParameters, *fields: Any) -> Self:
        """Return the parameters that a recording stores, under present or older names.

        Missing parameters have their defaults. Names that the table of parameters does not contain are left out.

        Raises ParameterError if a value is not allowed.
        """
        origins: dict[Origin, dict[str, float]] = {origin: {} for origin in get_args(Origin)}
        for name, recorded, origin in stored.values:
            if name in cls.table.by_any_name:
                definition, factor = cls.table.by_any_name[name]
                value = recorded * factor
                if not definition.low <= value <= definition.high:
                    allowed = f"allowed {definition.low:g}..{definition.high:g}"
                    raise _value_error(stored.source, name, value, allowed)
                origins[origin][definition.name] = value
        return cls._build(list(origins.items()), stored.source, stored.unused, *fields)

    @classmethod
    def from_log(cls, logged: Mapping[str, float], source: str, *fields: Any) -> tuple[Self, tuple[str, ...]]:
        """Return the parameters of a flight log, and a sentence for each value that could not be used.

        For a log without parameters, return the autopilot's defaults and a sentence about this.

        logged: values by the names of any release.
        source: file of the log.
        """
        values, notes = cls.table.read_log(logged)
        try:
            return cls._build([("file", values)], source, (), *fields), tuple(notes)
        except ParameterError as error:
            return cls.defaults(*fields), (*notes, f"{error}: {cls.table.title}'s defaults are used")

    @classmethod
    def _read_aircraft_values(cls, entries: Mapping[str, Entry]) -> dict[str, float]:
        """Return the values in the aircraft's file that the control law uses, by name."""
        return cls.table.read(entries)[0]

    @classmethod
    def _is_relevant(cls, definition: Definition, value: float) -> bool:
        """Return True if a value that a file states is used; in this base class every value is.

        A subclass may return False for a value that equals the default, which is then treated as not stated.
        """
        return True

    @classmethod
    def _without_unknown_parameters(cls, sources: list[Stated], *fields: Any) -> tuple[list[Stated], tuple[str, ...]]:
        """Remove parameters that the release lacks.

        Return the sources, and the names removed from the user's file.

        In this base class the release lacks no parameter, so all sources and no names are returned.
        """
        return sources, ()

    @classmethod
    def _build(cls, sources: list[Stated], source: str, unused: tuple[str, ...], *fields: Any) -> Self:
        """Return a parameter set; each value is from the first source that states it, or is the default.

        sources: sources in order of priority, each with its values by name.
        source: the user's file, "" if there is no file.
        unused: names in the file that the table does not contain.
        fields: additional fields of the subclass, such as PX4's version.

        Raises ParameterError if a minimum is not below its maximum.
        """
        known_sources, unknown_names = cls._without_unknown_parameters(sources, *fields)
        # A subclass may treat a value of the file as unset if it equals the default.
        unset_names = [
            name
            for origin, values in known_sources
            for name, value in values.items()
            if origin == "file" and not cls._is_relevant(cls.table.by_name[name], value)
        ]
        unused = (*unused, *unknown_names, *unset_names)

        def find_value(definition: Definition) -> ParameterValue:
            """Return the value from the first source that states a relevant one, or the default."""
            for origin, values in known_sources:
                value = values.get(definition.name)
                if value is not None and cls._is_relevant(definition, value):
                    return ParameterValue(definition.name, value, origin)
            return ParameterValue(definition.name, definition.default, "default")

        stated_extras = [
            parameter for parameter in map(find_value, cls.table.when_stated.values()) if parameter.origin != "default"
        ]
        parameter_set = cls((*map(find_value, cls.table.definitions), *stated_extras), unused, source, *fields)
        value_by_name = parameter_set._value_by_name
        for minimum, maximum in cls.table.pairs:
            if value_by_name[minimum] >= value_by_name[maximum]:
                value, allowed = value_by_name[minimum], f"must be below {maximum} {value_by_name[maximum]:g}"
                source_name = source or AIRCRAFT_FILE
                message = f"{source_name}: {minimum} {value:g}: {allowed}"
                raise ParameterError(message, file=source_name, field=minimum, value=value, allowed=allowed)
        return parameter_set

    def __getitem__(self, name: str) -> float:
        """Return the value of a parameter in SI units and radians, by the autopilot's name for it.

        A parameter that the set lacks has its default.
        """
        definition = self.table.by_name[name]
        return definition.to_si * self._value_by_name.get(name, definition.default)

    @cached_property
    def _value_by_name(self) -> dict[str, float]:
        """Value of each parameter by name, in the autopilot's units."""
        return {name: value for name, value, _ in self.values}

    def changed(self, origin: Origin = "file", /, **values: float) -> Self:
        """Return a copy in which some parameters have other values, by the autopilot's names and in its units.

        origin: source of the new values.

        Raises ValueError for a name that the table does not contain.
        """
        if unknown := sorted(set(values) - self.table.by_name.keys()):
            raise ValueError(f"{unknown[0]}: not a parameter of the simulated autopilot")
        by_name = {parameter.name: parameter for parameter in self.values}
        by_name |= {name: ParameterValue(name, value, origin) for name, value in values.items()}
        return replace(self, values=tuple(by_name.values()))

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """Return the values from one source, by name and in the autopilot's units."""
        return {name: value for name, value, value_origin in self.values if value_origin == origin}

    @property
    def outside_documented_ranges(self) -> tuple[str, ...]:
        """One text for each value in the user's file outside its documented range; the value is used anyway."""
        texts = []
        for name, value in self.by_origin("file").items():
            minimum, maximum = self.table.by_name[name].documented or (-math.inf, math.inf)
            if not minimum <= value <= maximum:
                texts.append(f"{name} {value:g} ({minimum:g}..{maximum:g})")
        return tuple(texts)

    @property
    def contradictions(self) -> tuple[str, ...]:
        """One text for each contradicting pair of parameters; the values are used anyway."""
        return find_contradictions(self.values, self.table.orders)


def _value_error(location: TextLine | str, name: str, value: float, allowed: str) -> ParameterError:
    """Return the error for a value that is not allowed.

    location: line of the value, which the message names, or source of a recording, which it does not name.
    """
    prefix, file = (f"{location}: ", location.file) if isinstance(location, TextLine) else ("", location)
    return ParameterError(f"{prefix}{name}: {value:g}: {allowed}", file=file, field=name, value=value, allowed=allowed)
