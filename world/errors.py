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
"""


class PlanflyError(Exception):
    """Bad input: the message names file, field, value and range in one line."""


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
        super().__init__(f"{source}: {reason}")
        self.reason = reason


class LogError(PlanflyError):
    """A flight log cannot be read."""
