"""Open a plan, or a mission file with or without a scenario; and judge a flight log."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from flight.mission.fences import fence_zones, numbered, with_fences
from flight.mission.from_plan import plan_mission
from flight.mission.implied_scenario import implied_scenario
from flight.mission.items import OTHER_VEHICLES, Command, Mission, MissionItem, command_name
from flight.mission.placing import place_stops
from flight.mission_files.formats import read_fence, read_mission
from flight.simulation.setup import FlightSetup
from logs.recording.reader import FlightLog
from logs.verdict.judge_flight import judge_flight
from logs.verdict.rules.fence_rule import zone_test
from logs.verdict.verdict import Verdict
from planfly.airframe import Airframe, choose_seed, load_airframe
from planfly.file_autopilots import with_file_autopilot
from planfly.make_plan import make_setup
from planner.plan import Plan, parse_plan, plan_json, read_plan
from world.airspace.zone_files import FileZones, is_zone_file, read_zone_file
from world.errors import MissionError, PlanflyError
from world.files import did_you_mean
from world.frames import GeoOrigin
from world.scenario import Scenario, load_scenario, with_zones

# ----------------------------------------------------------------------
# Fences named beside a mission or log: files of fence items, and of zones.


FencePaths = str | Path | Sequence[str | Path]


@dataclass(frozen=True, slots=True)
class NamedFences:
    """What the files hold.

    items: of fences, which join the mission's own.
    zones: of files of zones, by the file that each comes from; they join the scenario's.
    """

    items: tuple[MissionItem, ...] = ()
    zones: tuple[tuple[str, FileZones], ...] = ()

    def on_mission(self, mission: Mission) -> Mission:
        """A mission with the fence items beside its own."""
        if not self.items:
            return mission
        warnings = mission.warnings
        if mission.fences:
            warnings = (*warnings, f"its own fence of {len(mission.fences)} items counts beside the one named")
        return replace(mission, fences=numbered([*mission.fences, *self.items]), warnings=warnings)

    def on_scenario(self, scenario: Scenario) -> Scenario:
        """A scenario with the zones beside its own.  Raises ScenarioError as `with_zones` does."""
        for source, found in self.zones:
            scenario = with_zones(scenario, found.zones, source, found.notes)
        return scenario


def read_named_fences(files: FencePaths) -> NamedFences:
    """Read one or more files of fences and zones, by the suffix of each.

    Raises MissionError or ScenarioError for a file that cannot be read, that holds no fence, or one whose shapes are
    none.

    >>> read_named_fences([])
    NamedFences(items=(), zones=())
    """
    items: list[MissionItem] = []
    zones = []
    for file in [files] if isinstance(files, str | Path) else files:
        path = Path(file)
        if is_zone_file(path):
            zones.append((str(file), read_zone_file(path, str(file))))
            continue
        found = read_fence(path)
        # Shapes are checked while it is known which file they are from.
        fence_zones(found, GeoOrigin(found[0].lat_deg, found[0].lon_deg), str(file))
        items += found
    return NamedFences(tuple(items), tuple(zones))


# ----------------------------------------------------------------------
# A plan's threats, area and zones as the fence of its mission: one that its judge finds kept.


def fence_of_plan(setup: FlightSetup) -> tuple[Mission, tuple[str, ...]]:
    """The setup's mission with its scenario as a fence beside its own, and notes on what the fence cannot hold.

    Each shape is asked for as the verdict's rule `fence` asks, of the planned path with its arcs: what the rule would
    find violated is left out, and named in the notes.

    >>> from logs.recording.example_log import example_log
    >>> mission, notes = fence_of_plan(example_log().setup)
    >>> [item.command for item in mission.fences]  # the area; the example has no missiles
    [5001, 5001, 5001, 5001]
    """
    is_entered = zone_test(setup)

    def passes(shape: tuple[MissionItem, ...]) -> bool:
        return any(is_entered(zone) for zone in fence_zones(shape, setup.scenario.origin))

    return with_fences(setup.mission, setup.scenario, passes)


MCAP_MAGIC = b"\x89MCAP"

ScenarioChange = Callable[[Scenario], Scenario]
_NO_FENCES = NamedFences()
# What the mission of a plan that is no file is said to be from.
_PLAN_FILE, _PLAN_STEM = "plan.json", "plan"


@dataclass(frozen=True, slots=True)
class OpenedMission:
    """A mission ready to be judged or flown; name is a stem for file names."""

    setup: FlightSetup
    airframe: Airframe
    name: str


@dataclass(frozen=True, slots=True)
class OpenedPlan:
    """A plan file, and the mission that it comes to.

    plan: as read.
    scenario: the plan's, with the changes asked for.
    airframe: of that scenario.
    mission: the plan's waypoints as items, without fences.
    """

    plan: Plan
    scenario: Scenario
    airframe: Airframe
    mission: Mission


def _unchanged(scenario: Scenario) -> Scenario:
    return scenario


def is_log(path: Path) -> bool:
    """Whether a file is a flight log, by its first bytes or, failing those, its name.

    Raises PlanflyError for a file that cannot be read.
    """
    if path.exists() and not path.is_file():
        return path.suffix.lower() == ".mcap"
    try:
        with path.open("rb") as file:
            head = file.read(len(MCAP_MAGIC))
    except OSError as error:
        raise PlanflyError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    return head == MCAP_MAGIC or path.suffix.lower() == ".mcap"


# How a flight ended whose log does not hold its end.
CUT_SHORT = "the log ends before the flight does"


def judge_log(log: FlightLog) -> Verdict:
    """The verdict on a log's flight, of the rows it holds."""
    return judge_flight(
        log.setup, log.track, log.ended or CUT_SHORT, log_complete=log.complete, reference=log.reference
    )


def loss_text(log: FlightLog) -> str:
    """What is missing in a log, in a line; "" for one that is complete."""
    return "" if log.complete else f"{log.source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"


def open_mission(
    path: Path,
    scenario_name: str | None,
    terrain: str | None,
    *,
    seed: int | None = None,
    change: ScenarioChange = _unchanged,
    fences: NamedFences = _NO_FENCES,
) -> OpenedMission:
    """Read a plan.json, .waypoints or .plan, in its own, a named or a made scenario.

    terrain: replaces the scenario's.  seed: of the turbulence; None takes the plan's, the scenario's, or 1.
    change: makes another scenario of it, in other wind or with another aircraft.  fences: to be kept to beside its
    own.  Raises MissionError, ScenarioError or TerrainError.
    """

    def changed(scenario: Scenario) -> Scenario:
        return fences.on_scenario(change(scenario))

    if not path.is_file():
        near = did_you_mean(path.name, _mission_names(path.parent))
        raise MissionError(f"{path}: no such file; a plan.json, .waypoints or .plan file is expected{near}", file=path)
    if path.suffix.lower() == ".json":
        opened = open_plan(path, terrain, changed)
        return _placed(opened, path.stem, scenario_name, terrain, seed, changed, fences)
    mission = fences.on_mission(for_fixed_wing(read_mission(path)))
    if scenario_name is not None:
        scenario = changed(load_scenario(scenario_name, terrain))
        placed = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)
    else:
        implied = implied_scenario(mission, terrain, vertical_legs=True)
        scenario, placed = changed(implied.scenario), implied.placed
    scenario = with_file_autopilot(scenario, mission)
    airframe = load_airframe(scenario)
    number = choose_seed(scenario, seed)
    return OpenedMission(make_setup(scenario, airframe, mission, number, placed=placed), airframe, path.stem)


def for_fixed_wing(mission: Mission) -> Mission:
    """The mission, if a fixed wing can fly it.  Raises MissionError for a step that only other vehicles take.

    >>> spline = MissionItem(3, 82, 3, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> for_fixed_wing(Mission(None, (spline,), source="a.waypoints"))
    Traceback (most recent call last):
        ...
    world.errors.MissionError: a.waypoints: item 3: NAV_SPLINE_WAYPOINT: for a multicopter: planfly flies fixed-wing ...
    """
    for item in mission.items:
        if item.command in OTHER_VEHICLES:
            name = command_name(item.command)
            allowed = f"for {OTHER_VEHICLES[Command(item.command)]}: planfly flies fixed-wing aircraft"
            raise MissionError.at(mission.source, f"item {item.seq}", name, allowed, shown=name)
    return mission


def _mission_names(folder: Path) -> list[str]:
    """Names of the files in a folder that may hold missions."""
    try:
        return sorted(file.name for file in folder.iterdir() if file.suffix in (".json", ".waypoints", ".plan", ".txt"))
    except OSError:
        return []


def open_plan(path: Path, terrain: str | None = None, change: ScenarioChange = _unchanged) -> OpenedPlan:
    """Read a plan.json, and make its mission with the aircraft of its own scenario.

    terrain, change: as of `open_mission`.  Raises MissionError, ScenarioError or TerrainError.
    """
    return _with_mission(read_plan(path, terrain=terrain), str(path), change)


def open_planned(
    plan: Plan,
    scenario_name: str | None = None,
    terrain: str | None = None,
    *,
    seed: int | None = None,
    change: ScenarioChange = _unchanged,
    fences: NamedFences = _NO_FENCES,
) -> OpenedMission:
    """A plan that is at hand, opened as `open_mission` opens the file of one; its mission's source is plan.json.

    >>> from planfly.make_plan import make_plan
    >>> scenario = load_scenario("paper-07")
    >>> opened = open_planned(make_plan(scenario, load_airframe(scenario), 1))
    >>> opened.name, opened.setup.mission.source
    ('paper-07', 'plan.json')
    """
    if terrain is not None:
        plan = parse_plan(plan_json(plan), _PLAN_FILE, terrain=terrain)

    def changed(scenario: Scenario) -> Scenario:
        return fences.on_scenario(change(scenario))

    return _placed(_with_mission(plan, _PLAN_FILE, changed), _PLAN_STEM, scenario_name, terrain, seed, changed, fences)


def _with_mission(plan: Plan, source: str, change: ScenarioChange) -> OpenedPlan:
    scenario = with_file_autopilot(change(plan.scenario))
    airframe = load_airframe(scenario)
    tracking = airframe.limits.tracking
    mission = plan_mission(plan, airframe.airspeed, airframe.max_bank, source=source, tracking=tracking)
    return OpenedPlan(plan, scenario, airframe, mission)


def _placed(
    opened: OpenedPlan,
    stem: str,
    scenario_name: str | None,
    terrain: str | None,
    seed: int | None,
    change: ScenarioChange,
    fences: NamedFences,
) -> OpenedMission:
    """A plan in the scenario it was made for, or its mission in another."""
    number, mission = seed if seed is not None else opened.plan.seed, fences.on_mission(opened.mission)
    if scenario_name is not None:
        # The plan's waypoints are in the map of its own scenario: another judges the mission, as a file.
        other = with_file_autopilot(change(load_scenario(scenario_name, terrain)))
        airframe = load_airframe(other)
        return OpenedMission(make_setup(other, airframe, mission, number), airframe, stem)
    setup = make_setup(opened.scenario, opened.airframe, mission, number, plan=opened.plan)
    return OpenedMission(setup, opened.airframe, opened.scenario.name)
