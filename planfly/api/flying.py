"""Fly a mission, and judge a mission or a flight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

from flight.autopilots.catalog import find_program_class
from flight.autopilots.sitl.process import check_binary
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.importers.open_log import is_imported_log
from logs.recording.reader import FlightLog, read_log
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.verdict import Verdict
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_logs import is_log, judge_log, loss_text
from planfly.flight_options import (
    LOG_OPTIONS,
    FlightOptions,
    FlyOptions,
    LogOptions,
    MissionOptions,
    load_scenario_with_options,
    read_named_fences,
    select_log_options,
    select_mission_options,
)
from planfly.kernel_units.unit_kernels import FLYING, PLANNING_AND_FLYING
from planfly.runtime.stages import report_replaced
from planfly.workflow import pipeline
from planfly.workflow.open_flight import open_flight
from planfly.workflow.output_paths import (
    FLY_LOG,
    LOG_FIGURES,
    check_output_file,
    expand_path_pattern,
    prepare_folder,
)
from planfly.workflow.pipeline import (
    FlightLimits,
    FlightTask,
    FlownMission,
    PlanThenFly,
    ReturnSummary,
    autopilot_log_path,
    fly_and_judge,
    flying_stage,
    return_summary,
)
from planfly.workflow.suggestion_trials import judge_mission_geometry
from planner.plan import Plan
from world.errors import ArgumentError, ScenarioError
from world.extras import require_extra
from world.scenario import Scenario, with_terrain

# ----------------------------------------------------------------------
# Results of the functions, except those of `planfly.workflow.pipeline`.


@dataclass(frozen=True, slots=True)
class Judged:
    """Result of `planfly.judge`.

    setup: mission, scenario, aircraft and autopilot of the flight.
    verdict: verdict on the mission, with a finding for every rule and place.
    loss: description of the part of a flight log that could not be read, in one line; "" if nothing is missing.
    lossy: True if part of a log could not be read.
    track: rows of the flight; None if nothing was flown.
    is_log: True for a flight read from a log or returned by an earlier call.
    requirements: requirements of the route that was judged by its geometry; None for a flight.
    """

    setup: FlightSetup
    verdict: Verdict
    loss: str = ""
    lossy: bool = False
    track: Track | None = None
    is_log: bool = False
    requirements: RouteRequirements | None = field(default=None, repr=False)

    @property
    def returns_line(self) -> str:
        """One line on returns to launch from a few points of the flight or the planned path.

        It is "" without a home.
        """
        return self.return_summary.line

    @property
    def return_summary(self) -> ReturnSummary:
        """Simulated returns to launch from a few points of the flight or planned path.

        They are computed at each access.
        """
        return return_summary(self.setup, self.track, self.requirements)


# ----------------------------------------------------------------------
# Fly a mission.


@api_function(*PLANNING_AND_FLYING)
def plan_then_fly(
    scenario: Scenario | str | Path,
    *,
    seed: int | None = None,
    log: Path | str | None = None,
    **options: Unpack[FlightOptions],
) -> PlanThenFly:
    """Plan a path, fly it in JSBSim and judge the flight.

    scenario: a built-in scenario's name, a TOML file's path, or a `Scenario`.
    seed: seed of planner and turbulence; None takes the seed of the scenario, or 1.
    log: MCAP file for the flight, replaced if it exists; None writes no log.
    options: see `planfly.fly`.
    Raises a `planfly.PlanflyError` for bad input.  A plan that cannot be flown gives a verdict, not an error.

    >>> import planfly
    >>> result = planfly.plan_then_fly("tight", seed=1, wind=(0, 0))
    >>> result.plan.safe, result.verdict.flyable
    (True, False)
    """
    check_arguments(seed=seed)
    if log is not None:
        check_output_file(Path(log), overwrite=True)
    world = load_scenario_with_options(scenario, options)
    return pipeline.plan_then_fly(world, seed=seed, log=None if log is None else Path(log))


@api_function(*FLYING)
def fly(
    mission: Plan | str | Path,
    *,
    log: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[FlyOptions],
) -> FlownMission:
    """Fly a plan or a mission file, and judge the flight.

    mission: a `Plan`, or the path of a plan.json, .waypoints or .plan file.
    log: MCAP file for the flight; {name} and {seed} in it stand for the mission's name and the seed; None writes none.
    overwrite: True replaces an existing file.

    The world of the flight (None keeps the value of the plan or the scenario):
    scenario: a name, a TOML file or a `Scenario`; None for the plan's own, or one made around the mission.
    terrain: an elevation file that replaces the terrain of the scenario.
    fence: files of fences and zones in addition to those of the mission.
    seed: seed of the turbulence; None takes the seed of the plan or of the scenario, or 1.
    wind: speed, m/s, and the direction it blows from, degrees.  turbulence: "none", "light" or "moderate".
    at: time of the flight, "START" or "START/END", in ISO 8601 with offsets from UTC; zones inactive then are ignored.

    The aircraft and its control:
    aircraft: a name, or a folder.  airspeed: m/s.  params: a file of the autopilot's parameters.
    autopilot: the simulated autopilot: "ardupilot" (in the release that saved the parameter file, or else the newest),
    "ardupilot-4.6", "ardupilot-4.7", "px4" (its release likewise), "px4-1.16", "px4-1.17" or "planfly".
    guidance: planfly's own guidance ("path", "l1", "vector-field") instead of the simulated ArduPlane.
    nav: "perfect", "rtk" or "gnss".
    sitl: the program of ArduPlane or PX4 built for software in the loop (SITL), which then flies the mission.
    engine: "auto" flies the compiled flight model if it equals JSBSim in every bit, "jsbsim" flies JSBSim.

    log_hz: rows per second in the log.
    max_hours, max_log: limits of flight time, h, and log size, MB, at which a flight is stopped.
    levels: True compares with a flight by planfly's guidance even if the mission passes, not only if it fails.

    A plan that cannot be flown gives a verdict, not an error; bad input raises a `planfly.PlanflyError`.

    >>> import planfly
    >>> flown = planfly.fly(planfly.plan("paper-07", seed=1), wind=(4, 270))
    >>> flown.ended, flown.verdict.flyable, flown.setup.scenario.wind.speed
    ('completed', True, 4.0)
    """
    limits = FlightLimits(options["max_hours"], options["max_log"])
    program = None if options["sitl"] is None else check_program(options["sitl"])
    setup = open_flight(mission, options, program, options["engine"])
    target = None if log is None else expand_path_pattern(log, setup.name, setup.seed)
    if target is not None:
        source = None if isinstance(mission, Plan) else Path(mission)
        folder_must_exist = log is not None and target == Path(log)
        check_output_file(target, overwrite, source, suffix=".mcap", folder_must_exist=folder_must_exist)
        program_logs = [] if program is None else [autopilot_log_path(target, program)]
        for program_log in program_logs:
            check_output_file(program_log, overwrite, source, folder_must_exist=folder_must_exist)
        target.parent.mkdir(parents=True, exist_ok=True)
        if log == FLY_LOG:
            # Remove the report and the pictures of the previous flight.
            prepare_folder(target.parent, LOG_FIGURES)
        report_replaced(target, *program_logs)
    with flying_stage(setup) as advance:
        task = FlightTask(
            target,
            advance,
            every=60 // options["log_hz"],
            autopilot=program,
            limits=limits,
            reference="always" if options["levels"] else "failed",
            returns=target is not None,
        )
        return fly_and_judge(setup, task)


@api_function(*FLYING)
def fly_by_each(
    mission: Plan | str | Path, autopilots: Sequence[str], **options: Unpack[MissionOptions]
) -> dict[str, FlownMission]:
    """Fly a mission by several simulated autopilots with default parameters, and judge each flight.

    autopilots: names that `autopilot` of `planfly.fly` accepts.
    options: see `planfly.fly`; `autopilot`, `params` and `guidance` are not allowed.
    Returns the flights, keyed by the name of the autopilot.  Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> flown = planfly.fly_by_each(planfly.plan("paper-07", seed=1), ["planfly", "px4"])
    >>> list(flown), flown["planfly"].flyable
    (['planfly', 'px4'], True)
    """
    names = list(dict.fromkeys(autopilots))
    if not names:
        raise ArgumentError.of_argument("autopilots", "", "expected at least one autopilot")
    check_arguments(autopilot=tuple(names))
    per_autopilot_options = {
        name: value for name, value in options.items() if name in ("params", "guidance", "autopilot")
    }
    check_keywords_not_given(
        _source_name(mission), per_autopilot_options, "can only be given for a single autopilot, but several are named"
    )
    flights = {}
    for name in names:
        options["autopilot"] = name
        flights[name] = fly(mission, **options)
    return flights


# ----------------------------------------------------------------------
# Judge a flight log or a mission.


@api_function()
def judge(
    what: FlightLog | FlownMission | Plan | str | Path, *, geometry: bool = False, **options: Unpack[LogOptions]
) -> Judged:
    """Judge a flight, or fly and judge a plan or a mission; return the verdict and the flight.

    what: a flight log or its path, an autopilot's log, a result of `planfly.fly`, a `Plan`, or the path of a plan.json,
    .waypoints or .plan.
    geometry: True judges a plan or a mission by its geometry only, without a flight.
    options: for a plan or mission, see `planfly.fly`.  A flight is judged as it was flown; of these options, only
    `terrain`, which replaces its terrain, and `fence`, which adds fences, are allowed.
    plan, flight, datum: for an autopilot's log, see `planfly.import_log`.
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> plan = planfly.plan("paper-07", seed=1)
    >>> [planfly.judge(plan, geometry=geometry).verdict.level for geometry in (False, True)]
    ['flown', 'geometric']
    """
    if isinstance(what, str | Path) and is_imported_log(Path(what)):
        # Imported here: only this branch needs the libraries that read the logs of other programs.
        from planfly.api.imported import read_imported

        imported = read_imported(what, **options)
        return Judged(imported.setup, imported.verdict, lossy=imported.lossy, track=imported.track, is_log=True)
    source = _source_name(what)
    check_keywords_not_given(
        source, select_log_options(options), "allowed only with the log of another program, such as .BIN"
    )
    if isinstance(what, FlightLog | FlownMission) or (isinstance(what, str | Path) and is_log(Path(what))):
        check_judging_options(source, options)
        check_keywords_not_given(
            source, {"geometry": geometry or None}, "allowed only with a mission; a log is judged by its flight"
        )
        what = read_log(Path(what)) if isinstance(what, str | Path) else what
        setup, fences = what.setup, read_named_fences(options["fence"])
        if (terrain := options["terrain"]) is not None:
            setup = setup.in_scenario(with_terrain(setup.scenario, str(terrain)))
        if fences.items or fences.zones or fences.rally:
            setup = setup.in_scenario(fences.add_to_scenario(setup.scenario))
            setup = replace(setup, mission=fences.add_to_mission(setup.mission))
        if isinstance(what, FlightLog):
            verdict = judge_log(replace(what, setup=setup))
            return Judged(setup, verdict, loss_text(what), not what.complete, what.track, is_log=True)
        # A flown mission without another terrain or fences keeps its verdict.
        verdict = what.verdict if setup is what.setup else judge_flight(setup, what.track, what.ended)
        return Judged(setup, verdict, track=what.track, is_log=True)
    flight_options = select_mission_options(options)
    if not geometry:
        flight = fly(what, **flight_options)
        return Judged(flight.setup, flight.verdict, track=flight.track if len(flight.track) else None)
    setup = open_flight(what, flight_options)
    requirements = route_requirements(setup)
    return Judged(setup, judge_mission_geometry(setup, requirements), requirements=requirements)


@api_function()
def check(
    what: FlightLog | FlownMission | Plan | str | Path, *, geometry: bool = False, **options: Unpack[LogOptions]
) -> Verdict:
    """Judge a flight by its log, or a plan or a mission by flying it.

    For the arguments, see `planfly.judge`, which returns the flight in addition to the verdict.

    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> plan = planfly.plan("tight", seed=1)
    >>> planfly.check(plan).flyable, planfly.check(plan, geometry=True).level
    (False, 'geometric')
    """
    return judge(what, geometry=geometry, **options).verdict


def _source_name(what: FlightLog | FlownMission | Plan | str | Path) -> str:
    """Return the name of a flight, plan or mission, for messages."""
    if isinstance(what, FlightLog):
        return what.source
    if isinstance(what, FlownMission):
        return what.setup.mission.source
    return what.scenario.name if isinstance(what, Plan) else str(what)


def check_keywords_not_given(source: str, keywords: Mapping[str, Any], reason: str) -> None:
    """Raise ScenarioError if one of the keywords was given, because it does not apply to the source.

    source: name of the source, for the message.
    keywords: value of each keyword; None if it was not given.
    reason: end of the message: the reason why they do not apply.
    """
    for name, value in keywords.items():
        if value is not None:
            raise ScenarioError.of_argument(name, value, reason, shown="", file=source)


# Reason why a log cannot be judged in another world, in messages.
_FIXED_OPTIONS_TEXT = (
    "not allowed with a log, which is judged with the aircraft, speeds, wind and autopilot of its flight"
)
# Reason why a log cannot be judged in another scenario, in messages.
_FIXED_SCENARIO_TEXT = (
    "not allowed with a log, which is judged in its own scenario; only `terrain` can replace its ground"
)


def check_judging_options(source: str, options: MissionOptions) -> None:
    """Raise ScenarioError for a given option that would change the flight that a log recorded.

    source: name of the log, for the message.
    """
    allowed_options = (*LOG_OPTIONS, "terrain", "fence", "scenario")
    check_keywords_not_given(
        source, {name: value for name, value in options.items() if name not in allowed_options}, _FIXED_OPTIONS_TEXT
    )
    check_keywords_not_given(source, {"scenario": options["scenario"]}, _FIXED_SCENARIO_TEXT)


def check_program(sitl: str | Path) -> Path:
    """Check that an autopilot program (SITL) can be run, and return its path.

    sitl: path of the executable.

    Raises FlightError for a file that cannot be run, and MissingExtraError if a package for programs is missing.
    """
    require_extra("live", "--sitl needs")
    program = Path(sitl)
    check_binary(program, find_program_class(program).title)
    return program
