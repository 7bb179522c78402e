"""Errors of planfly.

    PlanflyError
    ├── ScenarioError   a scenario file or a planner option
    ├── TerrainError    an elevation file
    ├── ForecastError   a weather forecast
    ├── MissionError    a plan or mission file
    ├── FlightError     an aircraft model or a start condition
    │   ├── StartError  a flight that cannot start as its mission states: `fly` reports a verdict
    │   └── CrashError  a failure of the controlling program in flight: the command line ends with 1
    ├── ParameterError  a file of an autopilot's parameters
    ├── LogError        a flight log
    ├── ArgumentError   an argument of a call that is out of range, also a ValueError
    └── MissingExtraError  an extra that a feature needs is not installed, also an ImportError

Each message is one line: the file, the line or field, the value, and the allowed range.  The command
line prints it and ends with exit code 2.  "Not flyable" and "no feasible path" are results, not errors.
The attributes contain the known parts of the message, so that a program need not parse it.
"""

from pathlib import Path
from typing import Any, Self


class PlanflyError(Exception):
    """Error for bad input; the message names file, field, value and range in one line.

    file: source of the input: a file's path, a scenario's name, or another beginning of the message; "" if unknown.
    field: key, column or option; "" if unknown, or if the fault concerns the whole file.
    value: the invalid value; None if unknown or missing.
    allowed: the expected values, in words; "" if only the message states them.
    argument: keyword of the wrong argument of a call; "" for the content of a file.

    >>> error = PlanflyError("a.toml: wind.speed_mps: 41.0: allowed 0..40", file="a.toml", field="wind.speed_mps")
    >>> str(error), error.file, error.field, error.value, error.allowed
    ('a.toml: wind.speed_mps: 41.0: allowed 0..40', 'a.toml', 'wind.speed_mps', None, '')
    """

    def __init__(
        self, message: str, *, file: str | Path = "", field: str = "", value: Any = None, allowed: str = ""
    ) -> None:
        super().__init__(message)
        self.file = str(file)
        self.field = field
        self.value = value
        self.allowed = allowed
        self.argument = ""

    @classmethod
    def at(cls, file: str | Path, field: str, value: Any, allowed: str, *, shown: str | None = None) -> Self:
        """Make an error about one value in a file; its message is "file: field: value: allowed".

        shown: text of the value in the message; None for its str(), "" to omit it.

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
        """Make an error about an argument of a call; its message names the argument by its keyword.

        The command line replaces the keyword by the name of the option.

        shown: text of the value in the message; None for its str(), "" to omit it.
        file: file that the argument refers to, if any.

        >>> error = FlightError.of_argument("bind", "127.0.0.1:70000", "expected a port 0..65535")
        >>> print(error, "|", error.field, "|", error.value)
        bind 127.0.0.1:70000: expected a port 0..65535 | bind | 127.0.0.1:70000
        """
        prefix = f"{file}: " if str(file) else ""
        subject = argument if shown == "" else f"{argument} {value if shown is None else shown}"
        error = cls(f"{prefix}{subject}: {allowed}", file=file, field=argument, value=value, allowed=allowed)
        error.argument = argument
        return error

    @classmethod
    def from_error(cls, error: "PlanflyError", file: str | Path = "", field: str = "", value: Any = None) -> Self:
        """Convert an error to this class, with the location of the value that caused it.

        file, field, value: location of the value that caused the error.

        The message is "file: field: " and the message of the error; an empty file or field is left out. The attributes
        of the result are those of the error, if the error has a field. Otherwise file, field and value are the
        arguments. `allowed` is always copied from the error.

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
    """An elevation file cannot be read, or does not cover the required area."""


class ForecastError(PlanflyError):
    """A forecast of the wind cannot be read, or does not cover the mission."""


class MissionError(PlanflyError):
    """A plan or mission file cannot be read or flown."""


class FlightError(PlanflyError):
    """An aircraft model or a start condition is unusable."""


class CrashError(FlightError):
    """Error for a controlling program that failed in flight: a failure of the machine, not bad input."""


class ParameterError(PlanflyError):
    """A file of an autopilot's parameters cannot be used as it stands."""


class StartError(FlightError):
    """Error for a flight that cannot start as its mission states.

    source: mission or command that requires the flight.
    reason: why the flight cannot start.
    field, value, allowed: as in `PlanflyError`.

    The aircraft and the place are known, but no flight is possible there.

    >>> str(StartError("a.plan", "no progress"))
    'a.plan: no progress'
    """

    def __init__(self, source: str, reason: str, *, field: str = "", value: Any = None, allowed: str = "") -> None:
        super().__init__(f"{source}: {reason}", file=source, field=field, value=value, allowed=allowed)
        self.reason = reason

    def __reduce__(self) -> tuple[type["StartError"], tuple[str, str], dict[str, Any]]:
        """Pickle the error by the arguments of its constructor, so that it can be sent to another process."""
        return type(self), (self.file, self.reason), vars(self)


class LogError(PlanflyError):
    """A flight log cannot be read."""


class ArgumentError(PlanflyError, ValueError):
    """Error for an argument of a call that is out of range."""


class MissingExtraError(PlanflyError, ImportError):
    """Error for a feature whose extra of planfly is not installed.

    value: the extra's name.
    allowed: the command that installs it.
    name: the module that is missing.
    """
