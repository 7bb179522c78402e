"""Properties of a JSBSim model: those that take the four commands, and those that are read back."""

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
# Readings of a model.
_READINGS = (*_COMMANDS, "current", "power")


@dataclass(frozen=True, slots=True)
class CommandProperty:
    """One command: a property, and its change per radian (or full throttle) above and below zero.

    There are two factors because a normalized stick often has unequal travel.
    """

    name: str
    above: float
    below: float


@dataclass(frozen=True, slots=True)
class Reading:
    """One reading: a property and its factor to SI.

    An empty name reads as zero, for a quantity that does not exist.
    """

    name: str
    factor: float


@dataclass(frozen=True, slots=True)
class Model:
    """Properties of a JSBSim model, and its kind.

    shipped: name of the model among JSBSim's models; "" for a model file in the aircraft's folder.
    settles: True if the engine has a speed of its own, so that it runs from the start and must settle before
        measurements.
    commands: elevator, aileron, rudder, throttle.
    readings: the same four, then battery current (A) and power (W).
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
    """Return the model described by a metadata file's ``[model]`` table.

    aircraft: name of the aircraft, which is also the name of JSBSim's model unless the table states another.

    Raise FlightError with one line, which begins with the key, for an unknown, missing or invalid entry.
    """
    table = _table(table, "model", ("shipped_by_jsbsim", "engine_settles", "command", "reading"))
    commands = _table(table.get("command", {}), "model.command", _COMMANDS)
    readings = _table(table.get("reading", {}), "model.reading", _READINGS)
    made = []
    for name, ours in zip(_COMMANDS, DEFAULT_MODEL.commands, strict=True):
        if name not in commands:
            made.append(ours)
            continue
        prop, above, below = _entry(commands[name], f"model.command.{name}", 2)
        made.append(CommandProperty(prop, above, below))
    read = []
    for name, mine in zip(_READINGS, DEFAULT_MODEL.readings, strict=True):
        if name not in readings:
            read.append(mine)
        elif readings[name] == []:
            read.append(Reading("", 0.0))
        else:
            prop, factor = _entry(readings[name], f"model.reading.{name}", 1)
            read.append(Reading(prop, factor))
    return Model(_shipped(table, aircraft), _flag(table, "engine_settles"), tuple(made), tuple(read))


def _table(value: object, key: str, known: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FlightError(f"{key} = {value!r} is not a table", field=key, value=value)
    if unknown := sorted(value.keys() - set(known)):
        near = did_you_mean(unknown[0], sorted(set(known) - value.keys()))
        raise FlightError(f"{key}: unknown key {', '.join(unknown)}{near}", field=key, value=unknown[0])
    return value


def _shipped(table: dict[str, Any], aircraft: str) -> str:
    """Return the name of JSBSim's own model.

    It names a folder and must not lead outside JSBSim's folder.
    """
    value = table.get("shipped_by_jsbsim", False)
    if isinstance(value, bool):
        return aircraft if value else ""
    if not isinstance(value, str) or _MODEL_NAME.fullmatch(value) is None:
        field, allowed = "model.shipped_by_jsbsim", "true, false or the name of a model of JSBSim's"
        raise FlightError(f"{field} = {value!r} is not {allowed}", field=field, value=value, allowed=allowed)
    return value


def _flag(table: dict[str, Any], name: str) -> bool:
    value = table.get(name, False)
    if not isinstance(value, bool):
        raise FlightError(f"model.{name} = {value!r} is not true or false", field=f"model.{name}", value=value)
    return value


def _entry(value: object, key: str, numbers: int) -> tuple[Any, ...]:
    """Return a property and its factors, all different from zero."""
    good = isinstance(value, list) and len(value) == 1 + numbers and isinstance(value[0], str)
    # JSBSim aborts the process on a name with a space in it.
    if good and isinstance(value, list):
        good = bool(value[0]) and value[0].isascii() and not any(letter.isspace() for letter in value[0])
        good = good and all(
            isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number) and number != 0.0
            for number in value[1:]
        )
    if not good or not isinstance(value, list):
        allowed = f"a property and {numbers} number(s) other than 0"
        raise FlightError(f"{key} = {value!r} is not {allowed}", field=key, value=value, allowed=allowed)
    return (value[0], *(float(number) for number in value[1:]))
