"""The error tree.

    PlanflyError
    ├── ScenarioError   a scenario file or a planner option
    ├── TerrainError    an elevation file
    ├── MissionError    a plan or mission file
    ├── FlightError     an aircraft model or a start condition
    │   ├── StartError  a flight that cannot begin as its mission has it: `fly` makes a verdict of it
    │   └── CrashError  a program that steered and failed in flight: the command line ends with 1
    ├── ParameterError  a file of an autopilot's parameters
    ├── LogError        a flight log
    ├── ArgumentError   an argument of a call that is out of its range: a ValueError, too
    └── MissingExtraError  what a feature needs is not installed: an ImportError, too

Each message is one line: the file, the line or field, the value, and the allowed range.  The command
line prints it and ends with exit code 2.  "Not flyable" and "no feasible path" are results, not errors.
What of these is known apart stands in the attributes, too, so that a program need not take the line apart.
"""

from pathlib import Path
from typing import Any, Self


class PlanflyError(Exception):
    """Bad input: the message names file, field, value and range in one line.

    file: what holds it: a file's path, a scenario's name, or what else the message begins with; "" where not known.
    field: the key, column or option in it; "" where not known, or where it is the file as a whole.
    value: what is there; None where not known, or where nothing is.
    allowed: what is expected instead, in words; "" where the message alone says so.
    argument: the keyword of the call that is wrong; "" where it is a file's content.

    >>> error = PlanflyError("a.toml: wind.speed_mps: 41.0: allowed 0..40", file="a.toml", field="wind.speed_mps")
    >>> str(error), error.file, error.field, error.value, error.allowed
    ('a.toml: wind.speed_mps: 41.0: allowed 0..40', 'a.toml', 'wind.speed_mps', None, '')
    """

    def __init__(
        self, message: str, *, file: str | Path = "", field: str = "", value: Any = None, allowed: str = ""
    ) -> None:
        super().__init__(message)
        self.file, self.field, self.value, self.allowed = str(file), field, value, allowed
        self.argument = ""

    @classmethod
    def at(cls, file: str | Path, field: str, value: Any, allowed: str, *, shown: str | None = None) -> Self:
        """An error of one value in one place, its message made of the four.

        shown: the value as the message has it; None for as it prints, "" for not at all.

        >>> error = ScenarioError.at("a.toml", "wind.speed_mps", 41.0, "allowed 0..40", shown="41")
        >>> print(error, "|", error.value)
        a.toml: wind.speed_mps: 41: allowed 0..40 | 41.0
        >>> print(ScenarioError.at("a.toml", "name", None, "missing", shown=""))
        a.toml: name: missing
        """
        parts = (file, field, value if shown is None else shown, allowed)
        text = ": ".join(str(part) for part in (parts if shown != "" else (file, field, allowed)))
        return cls(text, file=file, field=field, value=value, allowed=allowed)

    @classmethod
    def of_argument(
        cls, argument: str, value: Any, allowed: str, *, shown: str | None = None, file: str | Path = ""
    ) -> Self:
        """An error of an argument of a call, by its keyword; the command line names its option instead.

        shown: the value as the message has it; None for as it prints, "" for not at all.
        file: that the argument is about, if any.

        >>> error = FlightError.of_argument("bind", "127.0.0.1:70000", "a port 0..65535 is expected")
        >>> print(error, "|", error.field, "|", error.value)
        bind 127.0.0.1:70000: a port 0..65535 is expected | bind | 127.0.0.1:70000
        """
        begin = f"{file}: " if str(file) else ""
        what = argument if shown == "" else f"{argument} {value if shown is None else shown}"
        error = cls(f"{begin}{what}: {allowed}", file=file, field=argument, value=value, allowed=allowed)
        error.argument = argument
        return error

    @classmethod
    def from_error(cls, error: "PlanflyError", file: str | Path = "", field: str = "", value: Any = None) -> Self:
        """The same error as one of this kind, told of another place: what is known apart goes with it.

        file, field, value: the place that led to it, which the message begins with; none leaves the message as it is.
        They stand where the error itself names no field; else its own do, and its file if it has one.

        >>> inner = FlightError("mine.toml: mass_kg = -1", file="mine.toml", field="mass_kg", value=-1)
        >>> found = ScenarioError.from_error(inner, "tight", "flight.aircraft", "./mine")
        >>> print(found, "|", found.file, found.field, found.value)
        tight: flight.aircraft: mine.toml: mass_kg = -1 | mine.toml mass_kg -1
        """
        text = ": ".join(part for part in (str(file), field, str(error)) if part)
        if field and not error.field:
            return cls(text, file=file, field=field, value=value, allowed=error.allowed)
        return cls(text, file=error.file or file, field=error.field, value=error.value, allowed=error.allowed)


class ScenarioError(PlanflyError):
    """A scenario cannot be used as it stands."""


class TerrainError(PlanflyError):
    """An elevation file cannot be read, or does not cover what it should."""


class MissionError(PlanflyError):
    """A plan or mission file cannot be read or flown."""


class FlightError(PlanflyError):
    """An aircraft model or a start condition is unusable."""


class CrashError(FlightError):
    """A program that steered failed in flight: the machine's failure, and no bad input."""


class ParameterError(PlanflyError):
    """A file of an autopilot's parameters cannot be used as it stands."""


class StartError(FlightError):
    """A flight cannot begin as its mission has it: the aircraft and the place are known, and no flight begins there.

    source: what asks for it.  reason: why not.  field, value, allowed: as of `PlanflyError`.

    >>> str(StartError("a.plan", "no way made"))
    'a.plan: no way made'
    """

    def __init__(self, source: str, reason: str, *, field: str = "", value: Any = None, allowed: str = "") -> None:
        super().__init__(f"{source}: {reason}", file=source, field=field, value=value, allowed=allowed)
        self.reason = reason

    def __reduce__(self) -> tuple[type["StartError"], tuple[str, str], dict[str, Any]]:
        """What makes it again, in another process."""
        return type(self), (self.file, self.reason), vars(self)


class LogError(PlanflyError):
    """A flight log cannot be read."""


class ArgumentError(PlanflyError, ValueError):
    """An argument of a call is out of its range."""


class MissingExtraError(PlanflyError, ImportError):
    """A feature needs an extra of planfly that is not installed.

    value: the extra's name.  allowed: the command that installs it.  name: the module that is missing.
    """
