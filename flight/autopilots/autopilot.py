"""Define the interface through which the rest of planfly uses an autopilot.

An `Autopilot` contains its own settings. A `FlightSetup` contains an autopilot; planning, flights, verdicts and
recordings use its operations and parts, and do not depend on which autopilot it is. Each autopilot has a folder next
to this file; `flight.autopilots.catalog.AUTOPILOTS` lists all of them.

A subclass must define `name`, `title` and `control_law`. By default an autopilot has no parameters, and its parts
(`flight.autopilots.parts`) state that it flies the planned fly-by path at the commanded true airspeeds, and returns to
launch as ArduPlane does with its default parameters.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol, Self

from aircraft.catalog import Aircraft
from flight.autopilots.parts import (
    ControlLaw,
    Deviations,
    GroundRules,
    MissionChecks,
    ReturnBehaviour,
    SpeedRules,
    TurnRules,
)
from flight.mission.loiter_circles import DEFAULT_LOITER_RULES, LoiterRules
from flight.mission.route import RouteRules
from world.errors import ScenarioError
from world.json_schema import DocumentConfig
from world.scenario_tables import FlightTable, Guidance
from world.wording import count_text

# Question that a flight answers: whether the aircraft can fly the mission ("airframe"), or whether the aircraft with
# its autopilot can ("autopilot").
AnswerName = Literal["airframe", "autopilot"]

# ----------------------------------------------------------------------
# Parameters, from the user's file, the aircraft's folder or the autopilot's defaults.

# "assumed": chosen by planfly for a mission with a landing, because the autopilot would not arm, or not land, with the
# value of the aircraft or the default.
Origin = Literal["file", "assumed", "aircraft", "default"]


class ParameterValue(NamedTuple):
    """A parameter's value in the autopilot's unit, with its source."""

    name: str
    value: float
    origin: Origin


# Texts for the sources of a value.
_SOURCE_NAMES: dict[Origin, str] = {
    "file": "the file",
    "assumed": "the assumptions for the landing",
    "aircraft": "the aircraft",
    "default": "the defaults",
}


def find_contradictions(values: Iterable[ParameterValue], orders: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """Return a text for each pair of parameters whose values are in the wrong order.

    Only pairs of which the user's file states at least one parameter are checked.

    orders: groups of parameter names, each in the order of the values: ("THR_MIN", "TRIM_THROTTLE") says that THR_MIN
        must not exceed TRIM_THROTTLE.

    >>> values = [ParameterValue("THR_MIN", 74.0, "aircraft"), ParameterValue("TRIM_THROTTLE", 60.0, "file")]
    >>> find_contradictions(values, [("THR_MIN", "TRIM_THROTTLE")])
    ('TRIM_THROTTLE 60 of the file is below THR_MIN 74 of the aircraft',)
    """
    value_by_name = {value.name: value for value in values}
    contradictions = []
    for order in orders:
        for lower, higher in pairwise(value_by_name[name] for name in order if name in value_by_name):
            if lower.value <= higher.value or "file" not in (lower.origin, higher.origin):
                continue
            file_value, relation, other_value = (
                (higher, "below", lower) if higher.origin == "file" else (lower, "above", higher)
            )
            texts = (
                f"{parameter.name} {parameter.value:g} of {_SOURCE_NAMES[parameter.origin]}"
                for parameter in (file_value, other_value)
            )
            contradictions.append(f" is {relation} ".join(texts))
    return tuple(contradictions)


class Parameters(Protocol):
    """An autopilot's parameters by its own names and in its own units.

    values: every parameter that the control law uses.
    unused: names in the file that the control law does not use.
    source: the user's file, "" if there is no file.
    not_simulated: parameters that are read but have no effect on the simulated flight.
    outside_documented_ranges: texts on values of the file outside their documented ranges, which are used nevertheless.
    contradictions: texts on values of the file that contradict another parameter; they are used nevertheless.
    """

    not_simulated: ClassVar[tuple[str, ...]]

    @property
    def values(self) -> tuple[ParameterValue, ...]:
        """Value and source of every parameter that the control law uses."""

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of the parameters in the user's file that the control law does not use."""

    @property
    def source(self) -> str:
        """Path of the user's parameter file; "" without a file."""

    @property
    def outside_documented_ranges(self) -> tuple[str, ...]:
        """One text for each value in the user's file that is outside its documented range."""

    @property
    def contradictions(self) -> tuple[str, ...]:
        """One text for each pair of contradicting parameters, at least one of them from the user's file."""

    def changed(self, origin: Origin = "file", /, **values: float) -> Self:
        """Return a copy of the parameters in which some have other values.

        origin: source of the new values.
        """

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """Return the values that come from one source, by name and in the autopilot's units."""


@dataclass(frozen=True, slots=True)
class AutopilotProgram(DocumentConfig):
    """SITL program of a flight."""

    version: str
    """Version that the program reports."""
    sha256: str
    """SHA-256 of the program's file."""
    parameters: Mapping[str, float] = field(hash=False)
    """Values that replaced the program's own defaults, as the program stored them."""
    changed: Mapping[str, float] = field(hash=False)
    """Parameters for which the user's file states a different value from the aircraft's."""
    unused: tuple[str, ...] = ()
    """Names in the user's file that the program does not know, or that belong to other hardware."""


class StoredParameters(NamedTuple):
    """Parameters as a log stores them: the fields of `Parameters`."""

    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...]
    source: str


class StoredAutopilot(NamedTuple):
    """An autopilot's settings as a log stores them.

    guidance: control law of planfly's guidance; "path" for every other autopilot.
    version: release of an autopilot whose releases fly differently; "" for any other autopilot.
    """

    guidance: Guidance = "path"
    parameters: StoredParameters | None = None
    program: AutopilotProgram | None = None
    version: str = ""


# ----------------------------------------------------------------------


class Autopilot(ABC):
    """Autopilot of a flight, with its settings; subclasses are frozen dataclasses.

    name: name in `[flight] autopilot` of a scenario.
    title: name in texts.
    answer_name: name of the answer that a flight gives. "airframe": whether the aircraft can fly the mission.
        "autopilot": whether the aircraft with this autopilot can; the verdict is compared with a reference flight by
        planfly's guidance.
    parameters: None for an autopilot without parameters.
    program: program that flew; None for a simulated autopilot and before the flight.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    answer_name: ClassVar[AnswerName] = "autopilot"
    parameters: Parameters | None = None
    program: AutopilotProgram | None = None

    # Operation that every autopilot must define.

    @property
    @abstractmethod
    def control_law(self) -> ControlLaw:
        """Compiled control law, with the settings of the autopilot."""

    # Construction from a scenario or a log, and settings; the defaults suit an autopilot without settings.

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot of a scenario's [flight] table.

        scenario: name of the scenario in messages.

        Raises ScenarioError if the autopilot does not accept an entry, and ParameterError if the parameter file is
        invalid.
        """
        if table.params is not None:
            allowed = f'not allowed with autopilot = "{cls.name}", which has no parameters'
            raise ScenarioError.at(scenario, "flight.params", table.params, allowed)
        return cls()

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the settings that a log stores; the base class has no settings.

        Raises ParameterError if a value is not allowed.
        """
        return cls()

    def store(self) -> StoredAutopilot:
        """Return the settings of the autopilot for a log, from which `restore` makes the autopilot again."""
        return StoredAutopilot()

    @classmethod
    def from_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """Return the autopilot that wrote a flight log, and notes on logged parameters that cannot be used.

        Returns None for the log of another autopilot.

        program: name of the program in the log.
        parameters: logged values by name.
        source: file of the log.
        """
        return None

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return a sentence for each required file that is missing from an aircraft's folder.

        The base class requires no file. Raises PlanflyError if a file is invalid.
        """
        return []

    def with_parameters(self, origin: Origin = "file", /, **values: float) -> "Autopilot":
        """Return a copy in which some parameters have other values, by the autopilot's names and in its units.

        origin: source of the values.

        Raises ValueError for an autopilot without parameters, such as the base class.
        """
        raise ValueError(f"{self.title} has no parameters")

    def stated_value(self, name: str) -> float | None:
        """Return a parameter's value in the user's file, in the autopilot's unit; None if the file lacks it."""
        return None if self.parameters is None else self.parameters.by_origin("file").get(name)

    # Identity.

    @property
    def model(self) -> "Autopilot":
        """Simulated autopilot that models an external program; a simulated autopilot returns itself."""
        return self

    @property
    def version(self) -> str:
        """Release of the program or of the simulated autopilot; "" for planfly's guidance."""
        return ""

    def describe(self, aircraft: str) -> str:
        """Describe the autopilot for a flight report: its title, in most subclasses with important settings.

        aircraft: name of the aircraft that flew.
        """
        return self.title

    # Parts; by default the autopilot has no special behaviour in the part.

    @property
    def turns(self) -> TurnRules:
        """Rules of turns: acceptance radius and bank."""
        return TurnRules()

    @property
    def speeds(self) -> SpeedRules:
        """Rules of airspeeds: true or equivalent airspeeds, their limits, and the minimum ground speed."""
        return SpeedRules()

    @property
    def loiters(self) -> LoiterRules:
        """Rules of loiters: default radius, entry and exit."""
        return DEFAULT_LOITER_RULES

    @property
    def returns(self) -> ReturnBehaviour:
        """Behaviour in an RTL."""
        return ReturnBehaviour()

    @property
    def ground(self) -> GroundRules:
        """Rules of take-off, landing and go-around."""
        return GroundRules()

    @cached_property
    def checks(self) -> MissionChecks:
        """Rules by which the autopilot reads and checks missions, and the settings that these rules depend on."""
        return MissionChecks()

    @property
    def deviations(self) -> Deviations:
        """Deviations of a flight from its plan: tracking error, and altitude errors in gusts."""
        return Deviations()

    @property
    def route_rules(self) -> RouteRules:
        """Rules that convert a mission to the route that this autopilot flies."""
        turns = self.turns
        return RouteRules(
            self.returns.rules,
            self.loiters,
            self.checks.dialect == "px4",
            None if turns.follows_path else turns.distance,
            turns.acceptance_limit,
        )


def describe_program(program: AutopilotProgram, aircraft: str, max_named: int = 8) -> str:
    """Return a description of an autopilot program: its version, checksum and changed parameters.

    max_named: maximum number of changed parameters that the description names; the number of others is appended.
    """
    changed_texts = [f"{name} {value:g}" for name, value in program.changed.items()]
    remainder = f" and {len(changed_texts) - max_named} more" if len(changed_texts) > max_named else ""
    parameters_text = count_text(len(program.parameters), "parameter")
    return (
        f"{program.version} (sha256 {program.sha256[:8]}...), {parameters_text} set for"
        f" {Path(aircraft).name}, changed: {', '.join(changed_texts[:max_named]) or 'none'}{remainder}"
    )
