"""Read from a metadata file the JSBSim properties of a model's commands and readings."""

import math
import re
from dataclasses import dataclass
from typing import Any

from world.errors import FlightError
from world.files import did_you_mean

# Commands of a model.
_COMMANDS = ("elevator", "aileron", "rudder", "throttle")
# Valid name of one of JSBSim's models.
_MODEL_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
# Readings of a model: values that planfly reads in each step.
_READINGS = (*_COMMANDS, "current", "power")


@dataclass(frozen=True, slots=True)
class CommandProperty:
    """JSBSim property that receives a command, and its change per radian (or per full throttle).

    name: name of the property.
    above, below: change for positive and for negative commands; they differ if the travel is unequal.
    """

    name: str
    above: float
    below: float


@dataclass(frozen=True, slots=True)
class Reading:
    """JSBSim property from which planfly reads a quantity, and the factor from the property's unit to SI.

    An empty name means that the model lacks the quantity; its value is then 0.
    """

    name: str
    factor: float


@dataclass(frozen=True, slots=True)
class Model:
    """JSBSim properties through which planfly commands and reads an aircraft's model.

    shipped: name of the model among JSBSim's models; "" for a model file in the aircraft's folder.
    settles: True if the engine speed is a state of the model, which must settle before measurements.
    commands: elevator, aileron, rudder, throttle.
    readings: elevator, aileron, rudder and throttle, then battery current (A) and power (W).
    """

    shipped: str
    settles: bool
    commands: tuple[CommandProperty, ...]
    readings: tuple[Reading, ...]


# Properties of a model that planfly wrote.
DEFAULT_MODEL = Model(
    shipped="",
    settles=False,
    commands=(
        *(CommandProperty(f"command/{name}-rad", 1.0, 1.0) for name in _COMMANDS[:3]),
        CommandProperty("command/throttle-norm", 1.0, 1.0),
    ),
    readings=(
        *(Reading(f"surface/{name}-rad", 1.0) for name in _COMMANDS[:3]),
        Reading("motor/throttle-norm", 1.0),
        Reading("motor/battery-current-a", 1.0),
        Reading("motor/battery-power-w", 1.0),
    ),
)


def read_model(table: object, aircraft: str) -> Model:
    """Return the model that a metadata file's ``[model]`` table describes.

    aircraft: name of the aircraft, which is also the name of JSBSim's model unless the table states another name.

    Raises FlightError, whose message begins with the key, for an unknown, missing or invalid entry.
    """
    table = _check_table(table, "model", ("shipped_by_jsbsim", "engine_settles", "command", "reading"))
    commands = _check_table(table.get("command", {}), "model.command", _COMMANDS)
    readings = _check_table(table.get("reading", {}), "model.reading", _READINGS)
    command_properties = []
    for name, default in zip(_COMMANDS, DEFAULT_MODEL.commands, strict=True):
        if name not in commands:
            command_properties.append(default)
            continue
        property_name, above, below = _read_entry(commands[name], f"model.command.{name}", 2)
        command_properties.append(CommandProperty(property_name, above, below))
    reading_properties = []
    for name, default_reading in zip(_READINGS, DEFAULT_MODEL.readings, strict=True):
        if name not in readings:
            reading_properties.append(default_reading)
        elif readings[name] == []:
            reading_properties.append(Reading("", 0.0))
        else:
            property_name, factor = _read_entry(readings[name], f"model.reading.{name}", 1)
            reading_properties.append(Reading(property_name, factor))
    engine_settles = table.get("engine_settles", False)
    if not isinstance(engine_settles, bool):
        field = "model.engine_settles"
        raise FlightError(f"{field} = {engine_settles!r} is not true or false", field=field, value=engine_settles)
    # The name must not lead outside JSBSim's folder, because it is also the name of a folder.
    shipped_name = table.get("shipped_by_jsbsim", False)
    if isinstance(shipped_name, bool):
        shipped_name = aircraft if shipped_name else ""
    elif not isinstance(shipped_name, str) or _MODEL_NAME.fullmatch(shipped_name) is None:
        field, allowed = "model.shipped_by_jsbsim", "true, false or the name of a model that JSBSim ships"
        message = f"{field} = {shipped_name!r} is not {allowed}"
        raise FlightError(message, field=field, value=shipped_name, allowed=allowed)
    return Model(shipped_name, engine_settles, tuple(command_properties), tuple(reading_properties))


def _check_table(value: object, key: str, known_keys: tuple[str, ...]) -> dict[str, Any]:
    """Return a value if it is a table that has only known keys. Raises FlightError otherwise."""
    if not isinstance(value, dict):
        raise FlightError(f"{key} = {value!r} is not a table", field=key, value=value)
    if unknown := sorted(value.keys() - set(known_keys)):
        suggestion = did_you_mean(unknown[0], sorted(set(known_keys) - value.keys()))
        raise FlightError(f"{key}: unknown key {', '.join(unknown)}{suggestion}", field=key, value=unknown[0])
    return value


def _read_entry(value: object, key: str, factor_count: int) -> tuple[Any, ...]:
    """Return the property and the factors of an entry such as ``["fcs/elevator-pos-rad", 1.0]``.

    key: name of the entry, for error messages.
    factor_count: required number of factors after the property.

    Raises FlightError for a malformed entry, an invalid property name, or a factor of 0.
    """
    is_valid = isinstance(value, list) and len(value) == 1 + factor_count and isinstance(value[0], str)
    # JSBSim aborts the process on a name with a space in it.
    if is_valid and isinstance(value, list):
        is_valid = bool(value[0]) and value[0].isascii() and not any(letter.isspace() for letter in value[0])
        is_valid = is_valid and all(
            isinstance(factor, int | float) and not isinstance(factor, bool) and math.isfinite(factor) and factor != 0.0
            for factor in value[1:]
        )
    if not is_valid or not isinstance(value, list):
        allowed = f"a property name and {factor_count} number(s) other than 0"
        raise FlightError(f"{key} = {value!r} is not {allowed}", field=key, value=value, allowed=allowed)
    return (value[0], *(float(factor) for factor in value[1:]))
