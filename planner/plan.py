"""Represent a plan, and read and write its file.

A plan has waypoints, scores, a certificate, a scenario and search settings.

The file format is ``plan.json`` (schema planfly.plan/1): `plan_json` writes it, `read_plan` and `parse_plan` read it
and check every field. `Certificate` is filled by `planner.evaluation.certify`.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from planner.procedures import DepartureAndApproach, DepartureAndApproachFile, departure_and_approach_json
from world.arrays import Floats
from world.errors import ArgumentError, MissionError
from world.files import json_value, read_small_file
from world.html_table import html_table
from world.scenario import Scenario, scenario_from_spec, with_amsl_endpoints
from world.scenario_file import JSON_OBJECT, first_fault
from world.terrain import Terrain

PLAN_SCHEMA = "planfly.plan/1"
# Algorithm of a plan whose waypoints were given instead of searched.
GIVEN_WAYPOINTS = "given"
# First words of a problem with a departure or an approach. Both are searched even if the waypoints are given.
GROUND_PROBLEMS = ("climb-out: ", "landing: ")
# Maximum size of a file, bytes; ten thousand waypoints with as many threats take 4 MB.
MAX_BYTES = 64 * 2**20


class Violation(IntEnum):
    """Columns of a path's violations (eq. 1-7 of Yang, Tang and Lozano, CEC 2014)."""

    TURN = 0
    SLOPE = 1
    TERRAIN = 2
    BOUNDS = 3


class Objective(IntEnum):
    """Columns of a path's objectives (eq. 8-11 of Yang, Tang and Lozano, CEC 2014)."""

    LENGTH_RATIO = 0
    KILL_EXPOSURE = 1
    DETECTION_EXPOSURE = 2
    HEIGHT_SUM = 3


class Violations(NamedTuple):
    """Numbers of violations of a path, in the order of `Violation`."""

    turn: int
    slope: int
    terrain: int
    bounds: int


class Objectives(NamedTuple):
    """Objectives of a path in the order of `Objective`: length ratio, and three sums over its points.

    length_ratio: length / straight line.
    kill_exposure, detection_exposure: sums of (scale / distance)^4 over the points inside the threats' spheres, without
    unit.  (The exposure of a verdict is the integral of the same ratio over the time inside, s.)
    height_sum: sum over the legs of their mean height above ground, m (eq. 11).
    """

    length_ratio: float
    kill_exposure: float
    detection_exposure: float
    height_sum: float


@dataclass(frozen=True, slots=True)
class Certificate:
    """Result of the continuous check along the whole path, not only at six points per leg.

    A margin is the smallest distance of the path from a limit; it is negative if, and only if, the path violates the
    limit. The limits include the safety margins that every plan keeps, as the lines of ``problems`` state them.

    With graded violations, which the default algorithm has, clearance, kill_distance, zone_distance and headroom are
    measured at the worst position that is predicted for the autopilot. To the side of a leg this position includes the
    lateral deviation, the navigation error and the excursion at corners; above or below the leg it includes the
    altitude lag on slopes. The vertical deviation on a level leg is part of the required margins. From bounds all
    deviations are subtracted. Algorithms that count violations, such as "umda" and "de-paper", subtract nothing: their
    margins are the margins of the legs and fly-by arcs. For given waypoints the algorithm of the scenario decides.

    turn: margin to the greatest course change, rad: the scenario's limit less 0.5 degrees, or 150 degrees for
        ``max_turn_deg = "aircraft"``, which limits turns by the lengths of their legs.
    available_length: smallest spare length of a leg, m: its length minus the length that its turns, the roll between
        them and settling need, or minus 5 m for a leg that need not contain its turns.
    slope: margin to the limits of climb and dive less 0.5 degrees, rad.
    clearance: smallest height above ground minus the required clearance and its margin, m; NaN off the terrain.
    bounds: margin to map, floor and ceiling, m.
    kill_distance: distance from the nearest missile sphere, m; negative inside, inf without missiles.
    zone_distance: distance outside exclusions and inside inclusions, minus the required distance, horizontal or
        vertical, m; inf without zones.
    headroom: maximum height above ground minus the greatest height and its margin, m; inf without a maximum.
    problems: one line per failure, empty if the path is certified.
    path_digest: `path_digest` of the certified path; "" if unknown.
    """

    turn: float
    available_length: float
    slope: float
    clearance: float
    bounds: float
    kill_distance: float
    problems: tuple[str, ...]
    zone_distance: float = np.inf
    headroom: float = np.inf
    path_digest: str = field(default="", compare=False, repr=False)

    @property
    def ok(self) -> bool:
        """True if the path violates no constraint at any point."""
        return not self.problems

    @property
    def margins(self) -> tuple[float, ...]:
        """The eight margins in the order of the fields, from `turn` to `headroom`, without `problems`."""
        return (
            self.turn,
            self.available_length,
            self.slope,
            self.clearance,
            self.bounds,
            self.kill_distance,
            self.zone_distance,
            self.headroom,
        )


def path_digest(waypoints: Floats) -> str:
    """Return a digest of a path (w, 3), by which a certificate names the path it belongs to.

    >>> path_digest(np.zeros((2, 3))) == path_digest(np.ones((2, 3)))
    False
    """
    return hashlib.sha256(np.ascontiguousarray(waypoints, dtype=np.float64).tobytes()).hexdigest()[:16]


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Plan:
    """Planned path.  Plans are equal if their files are (`plan_json`).

    scenario: the scenario of the plan.
    waypoints: (w, 3) east and north of the scenario's origin and altitude AMSL, m. They cannot be replaced without the
    certificate.
    violations, objectives: always at the paper's six points per leg.
    certificate: certificate of the whole path, or of the part after the flown legs.
    seed, algorithm, evaluations: seed, algorithm and number of evaluations of the search.
    history: (g, 3) length ratio, kill exposure and violations (for graded algorithms the number of kinds violated) of
    the best path in each generation.
    ended: "completed", or the reason why the search ended early: "budget" or "interrupted".
    flown_legs: number of first legs that were already flown under an earlier plan.
    procedures: departure from the ground to the first waypoint and approach from the last; None for a plan that stays
    in the air. If a departure or approach that the scenario requires is blocked, the certificate reports it.
    """

    scenario: Scenario
    waypoints: Floats
    violations: Violations
    objectives: Objectives
    certificate: Certificate
    seed: int
    algorithm: str
    evaluations: int
    history: Floats
    ended: str = "completed"
    flown_legs: int = 0
    procedures: DepartureAndApproach | None = None

    def __post_init__(self) -> None:
        """Make the arrays read-only, and convert the scores, which may be any four numbers, to named tuples.

        Raises ArgumentError if the certificate belongs to other waypoints.
        """
        for name in ("waypoints", "history"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "violations", Violations(*map(int, self.violations)))
        object.__setattr__(self, "objectives", Objectives(*map(float, self.objectives)))
        digest = self.certificate.path_digest
        if digest and digest != path_digest(self.waypoints[self.flown_legs :]):
            allowed = (
                "the plan's certificate is for other waypoints; planfly.plan(scenario, waypoints=...) certifies a path"
            )
            raise ArgumentError.of_argument("waypoints", self.waypoints, allowed, shown="")

    @property
    def feasible(self) -> bool:
        """True if the path meets all four constraints, at the paper's points and everywhere between them."""
        return self.certificate.ok and not any(self.violations)

    @property
    def safe(self) -> bool:
        """True if the path is feasible and outside every missile sphere.

        Flights of a safe plan may still fail; `planfly.what_may_fail` returns known causes.
        """
        return self.feasible and self.certificate.kill_distance > 0.0

    @property
    def margins(self) -> tuple[float, ...]:
        """Margins of the plan, (9,); the plan is safe if all of them are 0 or more, and only then.

        The first eight are the certificate's margins, from `Certificate.turn` to `Certificate.headroom`, rad and m. The
        last is 0, or minus the number of the certificate's problems and of the violations at the paper's points. It is
        needed because some problems, such as a blocked approach, have no margin.

        >>> from world.scenario import load_scenario
        >>> scenario = load_scenario("tight")
        >>> path = np.stack([scenario.start, scenario.destination])
        >>> low = Certificate(0.1, 9.0, 0.1, -2.0, 10.0, 50.0, ("leg 0: too low",))
        >>> Plan(scenario, path, np.zeros(4), np.ones(4), low, 7, "umda", 60, np.zeros((0, 3))).margins
        (0.1, 9.0, 0.1, -2.0, 10.0, 50.0, inf, inf, -1.0)
        """
        return (*self.certificate.margins, 0.0 - len(self.certificate.problems) - sum(self.violations))

    @property
    def state(self) -> str:
        """State of the plan in words: safe, feasible, or not feasible."""
        return "safe" if self.safe else "feasible, but inside a missile's reach" if self.feasible else "not feasible"

    @property
    def unmet_margins(self) -> tuple[str, ...]:
        """Margins of the planner that given waypoints do not keep, one line each; empty for a searched plan.

        They include the distance from missiles, but not the problems of a departure or an approach. A verdict on given
        waypoints judges the flight itself, which may be flyable without these margins.
        """
        if self.algorithm != GIVEN_WAYPOINTS:
            return ()
        margins = tuple(problem for problem in self._problems if not problem.startswith(GROUND_PROBLEMS))
        return margins if self.certificate.kill_distance > 0.0 else (*margins, nearest_missile_text(self))

    @property
    def failures(self) -> tuple[str, ...]:
        """Problems that make the plan not flyable.

        Given waypoints that do not keep the planner's margins may still be flyable; their unmet margins are left out.
        """
        unmet_margins = self.unmet_margins
        return tuple(problem for problem in self._problems if problem not in unmet_margins)

    @property
    def _problems(self) -> tuple[str, ...]:
        """Problems of the certificate; if it has none, a line on violations at the paper's points, if any."""
        if self.certificate.problems or not any(self.violations):
            return self.certificate.problems
        return ("the path violates constraints at its sampled points",)

    def __hash__(self) -> int:
        """Return the hash of the plan's file, so that equal plans have equal hashes."""
        return hash(plan_json(self))

    def __eq__(self, other: object) -> bool:
        """Return True if the other object is a plan with the same file."""
        return plan_json(self) == plan_json(other) if isinstance(other, Plan) else NotImplemented

    def __repr__(self) -> str:
        """Describe the plan in a line: scenario, number of waypoints, state and length.

        A safe plan under a number in [limits] is "safe by [limits]", because the number may be looser than the limit of
        the aircraft or its autopilot.
        """
        ratio, limits = self.objectives.length_ratio, self.scenario.limits
        has_numbers = {limits.max_turn_deg, limits.max_climb_deg, limits.max_dive_deg} != {"aircraft"}
        state = "safe by [limits]" if self.safe and has_numbers else self.state
        return f"<Plan {self.scenario.name}: {len(self.waypoints)} waypoints, {state}, {ratio:.4f} times straight>"

    def _repr_html_(self) -> str:
        """Return HTML for notebooks."""
        return plan_html(self)


def nearest_missile_text(plan: Plan) -> str:
    """Return a line on the missile that a plan's legs approach most closely.

    The line names the missile and the leg. It states the distance from the leg to the kill sphere, and the distance
    from the flight to the sphere, which may be negative because the flight deviates from its legs.
    """
    threats, waypoints = plan.scenario.threats, plan.waypoints
    starts, legs = waypoints[:-1, None], np.diff(waypoints, axis=0)[:, None]
    squared_lengths = np.maximum((legs**2).sum(axis=2), 1e-9)
    fractions = np.clip(((threats.position - starts) * legs).sum(axis=2) / squared_lengths, 0.0, 1.0)
    closest_points = starts + fractions[..., None] * legs
    distances = np.sqrt(((threats.position - closest_points) ** 2).sum(axis=2)) - threats.kill_radius
    distances[:, threats.kill_radius <= 0.0] = math.inf
    leg, missile = np.unravel_index(int(np.argmin(distances)), distances.shape)
    distance = float(distances[leg, missile])
    return (
        f"leg {leg} passes {abs(distance):.1f} m {'inside' if distance < 0.0 else 'outside'} the kill radius of"
        f" {threats.names[missile]}; with its tracking error the flight may come"
        f" {-plan.certificate.kill_distance:.1f} m inside it"
    )


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


Coordinate = Annotated[float, Field(ge=-500_000.0, le=500_000.0)]


class _CertificateFile(_Model):
    turn_margin_rad: float
    turn_room_m: float | None
    slope_margin_rad: float
    clearance_margin_m: float | None
    bounds_margin_m: float
    kill_distance_m: float | None
    zone_distance_m: float | None = None
    headroom_m: float | None = None
    problems: list[str]

    def certificate(self, certified_path: Floats) -> Certificate:
        """Convert the entries of the file to the certificate of a path (w, 3), m."""
        return Certificate(
            turn=self.turn_margin_rad,
            available_length=_none_to_inf(self.turn_room_m),
            slope=self.slope_margin_rad,
            clearance=np.nan if self.clearance_margin_m is None else self.clearance_margin_m,
            bounds=self.bounds_margin_m,
            kill_distance=_none_to_inf(self.kill_distance_m),
            zone_distance=_none_to_inf(self.zone_distance_m),
            headroom=_none_to_inf(self.headroom_m),
            problems=tuple(self.problems),
            path_digest=path_digest(certified_path),
        )


class _PlanFile(_Model):
    file_schema: Literal["planfly.plan/1"] = Field(alias="schema")
    scenario: dict[str, Any]
    algorithm: str
    seed: Annotated[int, Field(ge=0)]
    evaluations: Annotated[int, Field(ge=0)]
    ended: Literal["completed", "budget", "interrupted"] = "completed"
    flown_legs: Annotated[int, Field(ge=0)] = 0
    ground_ways: DepartureAndApproachFile | None = None
    feasible: bool
    safe: bool
    waypoints_east_north_amsl_m: Annotated[
        list[Annotated[list[Coordinate], Field(min_length=3, max_length=3)]], Field(min_length=2, max_length=10_000)
    ]
    violations: dict[str, Annotated[int, Field(ge=0)]]
    objectives: dict[str, float]
    certificate: _CertificateFile
    history: list[list[float | None]]


def _finite_or_none(value: float) -> float | None:
    """Return a finite number unchanged, and None (null in JSON) for inf and NaN."""
    return float(value) if np.isfinite(value) else None


def plan_json(plan: Plan) -> str:
    """Return the plan as the text of a ``plan.json``; equal plans give equal bytes.

    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> path = np.stack([scenario.start, scenario.destination])
    >>> certificate = Certificate(0.1, np.inf, 0.1, 9.0, 10.0, 50.0, ())
    >>> plan = Plan(scenario, path, np.zeros(4), np.array([1, 0, 0, 0]), certificate, 7, "umda", 60, np.zeros((0, 3)))
    >>> [line.strip() for line in plan_json(plan).splitlines()[1:4]]
    ['"schema": "planfly.plan/1",', '"algorithm": "umda",', '"seed": 7,']
    >>> parse_plan(plan_json(plan), "plan.json").certificate == certificate
    True
    """
    certificate = plan.certificate
    # Zones and maximum height have entries if the scenario has them.
    margins = {"zone_distance_m": certificate.zone_distance, "headroom_m": certificate.headroom}
    data = {
        "schema": PLAN_SCHEMA,
        "algorithm": plan.algorithm,
        "seed": plan.seed,
        "evaluations": plan.evaluations,
        "ended": plan.ended,
        "flown_legs": plan.flown_legs,
        "feasible": plan.feasible,
        "safe": plan.safe,
        "waypoints_east_north_amsl_m": plan.waypoints.tolist(),
        **({} if plan.procedures is None else {"ground_ways": departure_and_approach_json(plan.procedures)}),
        "violations": plan.violations._asdict(),
        "objectives": plan.objectives._asdict(),
        "certificate": {
            "turn_margin_rad": certificate.turn,
            "turn_room_m": _finite_or_none(certificate.available_length),
            "slope_margin_rad": certificate.slope,
            "clearance_margin_m": _finite_or_none(certificate.clearance),
            "bounds_margin_m": certificate.bounds,
            "kill_distance_m": _finite_or_none(certificate.kill_distance),
            **{key: float(value) for key, value in margins.items() if np.isfinite(value)},
            "problems": list(certificate.problems),
        },
        "history": [[_finite_or_none(value) for value in row] for row in plan.history.tolist()],
        "scenario": plan.scenario.to_json(),
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def parse_plan(
    text: str,
    source: str,
    *,
    base: Path | None = None,
    terrain: str | None = None,
    ground: Terrain | None = None,
    is_stored: bool = False,
) -> Plan:
    """Parse the plan in the text of a ``plan.json``.

    source: where the text comes from, for error messages, such as the path of the file.
    base: folder to which the scenario's paths are relative.
    terrain: file that replaces the scenario's terrain.
    ground: terrain that is already loaded, for example from a log; no elevation file is then opened.
    is_stored: True for the plan of a log, for which no forecast is opened.

    Raises MissionError (or the scenario's own errors) with one line: file, field, value, allowed values.

    >>> parse_plan('{"schema": "planfly.plan/2"}', "plan.json")
    Traceback (most recent call last):
    world.errors.MissionError: plan.json: schema: "planfly.plan/2": expected "planfly.plan/1" (and 11 more errors)
    """
    try:
        data = json_value(text, parse_constant=_reject_constant)
    except ValueError as error:
        raise MissionError(f"{source}: not valid JSON: {error}", file=source) from error
    try:
        plan_file = _PlanFile.model_validate(data)
    except ValidationError as error:
        raise MissionError(**first_fault(error, data, container=JSON_OBJECT).at(source)) from None
    _check_names(source, "violations", plan_file.violations, Violations._fields)
    _check_names(source, "objectives", plan_file.objectives, Objectives._fields)
    waypoints = np.array(plan_file.waypoints_east_north_amsl_m)
    # With another terrain the ends keep their planned altitudes.
    scenario_spec = (
        plan_file.scenario if terrain is None else with_amsl_endpoints(plan_file.scenario, waypoints[0], waypoints[-1])
    )
    scenario = scenario_from_spec(scenario_spec, source, base=base, terrain=terrain, ground=ground, is_stored=is_stored)
    history = np.array([[np.nan if value is None else value for value in row] for row in plan_file.history]).reshape(
        -1, 3
    )
    return Plan(
        scenario=scenario,
        waypoints=waypoints,
        violations=Violations(**plan_file.violations),
        objectives=Objectives(**plan_file.objectives),
        certificate=plan_file.certificate.certificate(waypoints[plan_file.flown_legs :]),
        seed=plan_file.seed,
        algorithm=plan_file.algorithm,
        evaluations=plan_file.evaluations,
        history=history,
        ended=plan_file.ended,
        flown_legs=plan_file.flown_legs,
        procedures=None if plan_file.ground_ways is None else plan_file.ground_ways.to_procedures(),
    )


def read_plan(path: Path, *, terrain: str | None = None) -> Plan:
    """Read the plan of a ``plan.json`` file.

    terrain: file that replaces the scenario's terrain.

    Raises MissionError or the scenario's errors, also for a file that is missing, too large or not UTF-8.

    >>> read_plan(Path("missing.json"))
    Traceback (most recent call last):
    world.errors.MissionError: missing.json: cannot be read: No such file or directory
    """
    try:
        text = read_small_file(path, MAX_BYTES, "plan", MissionError).decode("utf-8")
    except UnicodeDecodeError as error:
        raise MissionError(f"{path}: not a text file in UTF-8 (byte {error.start})", file=path) from error
    return parse_plan(text, str(path), base=path.parent, terrain=terrain)


def _none_to_inf(value: float | None) -> float:
    """Return a number, or inf for None."""
    return np.inf if value is None else value


def _reject_constant(name: str) -> float:
    """Raise ValueError for NaN, Infinity and -Infinity, which Python's JSON reader would otherwise accept."""
    raise ValueError(f"{name} is not a number")


def _check_names(source: str, field: str, found_names: dict[str, Any], expected_names: Sequence[str]) -> None:
    """Raise MissionError if a JSON object does not have exactly the expected keys.

    source: name of the file.
    field: name of the object in the file.
    found_names: the object, whose keys are checked.
    expected_names: the expected keys.
    """
    if sorted(found_names) != sorted(expected_names):
        raise MissionError.at(source, field, sorted(found_names), f"expected keys {sorted(expected_names)}")


def plan_html(plan: Plan) -> str:
    """Return an HTML table with the state, the margins and the failures of a plan, for notebooks."""
    certificate = plan.certificate
    rows = [
        ("waypoints", len(plan.waypoints)),
        ("length / straight line", f"{plan.objectives.length_ratio:.4f}"),
        ("smallest margin of the clearance", f"{certificate.clearance:.1f} m"),
        (
            "smallest distance from a kill zone",
            f"{certificate.kill_distance:.0f} m" if math.isfinite(certificate.kill_distance) else "none",
        ),
        (
            "smallest margin of a leg's length",
            f"{certificate.available_length:.0f} m" if math.isfinite(certificate.available_length) else "none",
        ),
        (
            "margins of turns and slopes",
            f"{math.degrees(certificate.turn):.1f}°, {math.degrees(certificate.slope):.2f}°",
        ),
        ("algorithm, seed", f"{plan.algorithm}, {plan.seed}"),
        *(("fails", problem) for problem in certificate.problems),
    ]
    return html_table(f"Plan {plan.scenario.name}: {plan.state}", rows)
