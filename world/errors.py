"""The error tree.

    PlanflyError
    ├── ScenarioError   a scenario file or a planner option
    ├── TerrainError    an elevation file
    ├── MissionError    a plan or mission file
    ├── FlightError     an aircraft model or a start condition
    │   └── StartError  a flight that cannot begin as its mission has it: `fly` makes a verdict of it
    ├── ParameterError  a file of an autopilot's parameters
    └── LogError        a flight log

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

    >>> error = PlanflyError("a.toml: wind.speed_mps: 41.0: allowed 0..40", file="a.toml", field="wind.speed_mps")
    >>> str(error), error.file, error.field, error.value, error.allowed
    ('a.toml: wind.speed_mps: 41.0: allowed 0..40', 'a.toml', 'wind.speed_mps', None, '')
    """

    def __init__(
        self, message: str, *, file: str | Path = "", field: str = "", value: Any = None, allowed: str = ""
    ) -> None:
        super().__init__(message)
        self.file, self.field, self.value, self.allowed = str(file), field, value, allowed

    @classmethod
    def at(cls, file: str | Path, field: str, value: Any, allowed: str, *, shown: str | None = None) -> Self:
        """An error of one value in one place, its message made of the four.

        shown: the value as the message has it; None for as it prints.

        >>> error = ScenarioError.at("a.toml", "wind.speed_mps", 41.0, "allowed 0..40", shown="41")
        >>> print(error, "|", error.value)
        a.toml: wind.speed_mps: 41: allowed 0..40 | 41.0
        """
        text = f"{file}: {field}: {value if shown is None else shown}: {allowed}"
        return cls(text, file=file, field=field, value=value, allowed=allowed)


class ScenarioError(PlanflyError):
    """A scenario cannot be used as it stands."""


class TerrainError(PlanflyError):
    """An elevation file cannot be read, or does not cover what it should."""


class MissionError(PlanflyError):
    """A plan or mission file cannot be read or flown."""


class FlightError(PlanflyError):
    """An aircraft model or a start condition is unusable."""


class ParameterError(PlanflyError):
    """A file of an autopilot's parameters cannot be used as it stands."""


class StartError(FlightError):
    """A flight cannot begin as its mission has it: the aircraft and the place are known, and no flight begins there.

    source: what asks for it.  reason: why not.

    >>> str(StartError("a.plan", "no way made"))
    'a.plan: no way made'
    """

    def __init__(self, source: str, reason: str) -> None:
        super().__init__(f"{source}: {reason}", file=source)
        self.reason = reason

    def __reduce__(self) -> tuple[type["StartError"], tuple[str, str]]:
        """What makes it again, in another process."""
        return type(self), (self.file, self.reason)


class LogError(PlanflyError):
    """A flight log cannot be read."""
