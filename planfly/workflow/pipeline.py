"""Plan, fly, record and judge a mission and its returns to launch, with one function for each stage."""

from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from aircraft.catalog import find_logged_aircraft
from flight.autopilots.catalog import find_program_class
from flight.dynamics.fdm import Variation
from flight.mission.items import Mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import BLOCK_DURATION_S, LONG_BLOCK_DURATION_S, Flight, RunningFlight
from flight.simulation.track import Track, TrackBuilder, join_tracks
from logs.recording.reader import LogEvent
from logs.recording.recorder import Recorder, thin_track
from logs.verdict.judge_flight import judge_flight, judge_plan_only
from logs.verdict.measures.route_requirements import RouteRequirements, check_energy, route_requirements
from logs.verdict.places import ReferenceFlights
from logs.verdict.returns.drawn_returns import DrawnReturns, collect_drawn_returns, collect_drawn_returns_without_glides
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import Returns, ReturnWorld, judge_returns, make_return_world
from logs.verdict.returns.return_starts import ReturnStarts, flown_starts, planned_starts
from logs.verdict.returns.returns_text import returns_headline
from logs.verdict.verdict import Verdict
from planfly.flight_options import MAX_HOURS, MAX_MEGABYTES
from planfly.runtime.stages import Advance, stage
from planfly.workflow.make_plan import make_plan, planning_conditions
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.open_flight import make_setup, mission_of_plan
from planfly.workflow.reference_flights import FlyReference, explain_verdict
from planfly.workflow.suggestion_trials import predicted_seconds, with_tried_suggestions
from planfly.workflow.uav import choose_seed, load_uav
from planner.plan import Plan
from world.errors import FlightError, PlanflyError, StartError
from world.scenario import Scenario

# Flight time whose rows are written at once, s; its simulation takes about 30 ms.
BATCH_S = 60
# Number of returns in a flight's summary of returns and in its pictures.
_SUMMARY_RETURN_COUNT = 50


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Limits of simulated time and log size, at which a flight is ended.

    hours: maximum simulated time, h.
    megabytes: maximum size of the log, 10^6 bytes.
    """

    hours: float = MAX_HOURS
    megabytes: float = MAX_MEGABYTES


@dataclass(frozen=True, slots=True, repr=False)
class PlanThenFly:
    """Result of `plan_then_fly`.

    plan: the path, with its certificate.
    mission: the plan as mission items.
    track: the flight, one row for each guidance tick; None if there was no feasible plan to fly.
    verdict: the verdict on the mission, with a finding for every rule and place.

    >>> from world.scenario import load_scenario
    >>> result = plan_then_fly(load_scenario("paper-07"), seed=1)
    >>> len(result.plan.waypoints), len(result.mission.items), round(float(result.track.time[-1]))
    (10, 11, 524)
    """

    plan: Plan
    mission: Mission
    track: Track | None
    verdict: Verdict

    def __repr__(self) -> str:
        return f"<PlanThenFly {self.plan!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return self.plan._repr_html_() + self.verdict._repr_html_()


@dataclass(frozen=True, slots=True)
class OffNominal:
    """Differences between the flight and the assumptions of the plan and its guidance.

    variation: deviation of the aircraft from its model.
    start_offset: east, north and up from the first waypoint to the start of the flight, m.
    """

    variation: Variation
    start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class FlightTask:
    """Settings with which `fly_and_judge` flies, records and judges a setup.

    log: file for the flight log; None writes no log.
    advance: called with the progress of the flight; None to report none.
    every: one row out of this many is recorded and judged, so that a check of the log gives the same verdict.
    autopilot: the program of ArduPlane or PX4 that flies instead of planfly's simulated autopilot; its own log is kept
        next to the flight log.
    off_nominal: differences between the flight and the assumptions of plan and guidance; ignored if a program flies.
    reference: cases in which reference flights are flown, see `planfly.workflow.reference_flights.explain_verdict`.
    returns: True judges returns from a few points, and draws them in the log.  Without a log no returns are judged.
    findings_only: True for a verdict with only its findings and answer, see `logs.verdict.judge_flight.judge_flight`.
    limits: limits of the flight time and of the size of the log.
    """

    log: Path | None = None
    advance: Advance | None = None
    every: int = 1
    autopilot: Path | None = None
    off_nominal: OffNominal = OffNominal(Variation())
    reference: FlyReference = "failed"
    returns: bool = False
    findings_only: bool = False
    limits: FlightLimits = FlightLimits()


# Task of a flight that is neither recorded nor shown.
_DEFAULT_TASK = FlightTask()


@dataclass(frozen=True, slots=True)
class ReturnSummary:
    """Returns to launch from a few points of a flight, to accompany its verdict.

    They are simulated with a point mass.

    line: summary of all returns in a line; "" if no return can be judged.
    world, starts, returns: environment, start points and results of the returns; None if no return is judged.
    """

    line: str = ""
    world: ReturnWorld | None = None
    starts: ReturnStarts | None = None
    returns: Returns | None = None

    @property
    def has_failures(self) -> bool:
        """True if a return is unsafe; False if none is judged."""
        returns = self.returns
        return returns is not None and bool(returns.each) and not (returns.safe or returns.undecided)

    def data_for_pictures(self, *, glides: bool = True) -> DrawnReturns | None:
        """Return the data for pictures of returns and glides, or None without judged returns.

        glides: False to leave out the glides, whose computation takes a few seconds.
        """
        if self.world is None or self.starts is None or self.returns is None or not self.returns.each:
            return None
        if not glides:
            return collect_drawn_returns_without_glides(self.world, self.starts, self.returns)
        return collect_drawn_returns(self.world, self.starts, self.returns, judge_glides(self.world, self.starts))


@dataclass(frozen=True, slots=True, repr=False)
class FlownMission:
    """Result of `planfly.fly`: a flight from its first tick to its verdict.

    setup: all inputs of the flight, with the program that flew, if any.
    track: the recorded rows, or all rows if there is no log; empty if the flight could not start.
    verdict: verdict on the rows of `track`, with a finding for every rule and place.
    ended: "completed", or the reason for an early end.
    events: entries of the log in addition to the rows.
    log: the file of the flight log; None if no log was requested or nothing was flown.
    autopilot_log: the autopilot program's own log, next to the flight log, if such a program flew.
    returns: returns to launch from a few points of the flight, as recorded in the log; None without a log.
    engine: flight model that flew, and the reason; "" if nothing was flown.
    reference: the results of reference flights; None if none were flown.
    """

    setup: FlightSetup
    track: Track
    verdict: Verdict
    ended: str
    events: tuple[LogEvent, ...] = ()
    log: Path | None = None
    autopilot_log: Path | None = None
    returns: ReturnSummary | None = None
    engine: str = ""
    reference: ReferenceFlights | None = None

    @property
    def mission(self) -> Mission:
        """Mission that was flown, read from a file or made from a plan."""
        return self.setup.mission

    @property
    def plan(self) -> Plan | None:
        """Plan that was flown; None for a mission file."""
        return self.setup.plan

    @property
    def flyable(self) -> bool:
        """True if the verdict is flyable."""
        return self.verdict.flyable

    @property
    def returns_line(self) -> str:
        """One line on returns to launch from a few points of the flight.

        It is "" for a mission without home or terrain.
        """
        return self.return_summary.line

    @property
    def return_summary(self) -> ReturnSummary:
        """Returns to launch from a few points of the flight; without a log they are simulated at each call."""
        return return_summary(self.setup, self.track) if self.returns is None else self.returns

    def __repr__(self) -> str:
        return f"<FlownMission {self.setup.scenario.name}: {self.ended}; {self.track!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return self.verdict._repr_html_() + self.track._repr_html_()


def plan_then_fly(scenario: Scenario, *, seed: int | None = None, log: Path | None = None) -> PlanThenFly:
    """Plan a path in a scenario, fly it and judge the flight.

    seed: seed of planner and turbulence; None takes the seed of the scenario, or 1.
    log: file for the flight log; None writes no log.
    Raises a PlanflyError for bad input.  A plan that cannot be flown gives a verdict, not an error.
    """
    chosen_seed = choose_seed(scenario, seed)
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, chosen_seed)
    mission = replace(mission_of_plan(plan, uav, "plan"), autopilot=uav.autopilot.name)
    if not plan.feasible:
        return PlanThenFly(plan, mission, track=None, verdict=judge_plan_only(plan, planning_conditions(scenario, uav)))
    setup = make_setup(scenario, uav, mission, chosen_seed, plan=plan)
    flight = fly_and_judge(setup, FlightTask(log))
    return PlanThenFly(plan, mission, flight.track, flight.verdict)


def flying_stage(setup: FlightSetup, kind: str = "") -> AbstractContextManager[Advance]:
    """Return the context of the stage in which a setup is flown.

    It yields a function to report the stage's progress.

    The stage's title states the length and the predicted duration, such as "flying 12.3 km, about 500 s in the air".

    kind: common name of stages that take a similar time per km; "" for flights by the setup's autopilot.
    """
    seconds = predicted_seconds(setup)
    time = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
    if seconds >= 2.0 * 3600.0:
        time = f"{seconds / 3600.0:.1f} h"
    title = f"flying {setup.path.length / 1000.0:.1f} km, about {time} in the air"
    return stage(title, kind or f"flying by {setup.autopilot.name}")


def fly_and_judge(
    setup: FlightSetup, task: FlightTask = _DEFAULT_TASK, flight: RunningFlight | None = None
) -> FlownMission:
    """Fly a setup to its end or to a limit, and judge the recorded rows.

    The flight is recorded if the task names a log.

    flight: the started flight of a program; None to start a flight as the task states.
    If the task asks for it, the verdict is explained by reference flights, and the log also gets returns.  A flight
    that cannot start, or that `check_energy` refuses, has no row and no log; its verdict covers the route.

    Raises FlightError if the catalog does not contain the setup's aircraft, or if a program does not fly the mission to
    its end; then no log is left.
    """
    aircraft = find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)
    requirements, limits = route_requirements(setup), task.limits
    try:
        if flight is None:
            check_energy(requirements)
            if task.autopilot is not None:
                return _fly_with_program(setup, task, task.autopilot)
            flight = Flight(setup, aircraft, task.off_nominal.variation, start_offset=task.off_nominal.start_offset)
    except StartError as error:
        return _unstarted_flight(requirements, task, f"not started: {error.reason}")
    flight.max_ticks = min(flight.max_ticks, round(3600.0 * limits.hours / flight.dt))
    builder, end_reason, length = TrackBuilder(), "", flight.path.length
    with ExitStack() as open_logs:
        recorder = None
        if task.log is not None:
            recorder = open_logs.enter_context(Recorder(task.log, setup, every=task.every, batch=BATCH_S))
        # A recorded flight is written second by second, so that a crash of the process loses no more.
        block_ticks = round((LONG_BLOCK_DURATION_S if recorder is None else BLOCK_DURATION_S) / flight.dt)
        while not end_reason:
            rows, end_reason = flight.fly_block(block_ticks)
            builder.add(rows)
            if recorder is not None and len(rows):
                recorder.write_rows(rows)
                if not end_reason and recorder.size > 1e6 * limits.megabytes:
                    size_text = f"{limits.megabytes:g} MB"
                    end_reason = f"log limit: the log has reached {size_text}; --max-log raises the limit"
            if task.advance is not None:
                task.advance(flight.distance, length, f"{flight.distance / 1000:.1f} of {length / 1000:.1f} km")
        track, reference, summary = builder.track(), None, None
        if recorder is not None:
            recorder.end_reason = end_reason
            track = thin_track(track, task.every) if task.every > 1 else track
        verdict = judge_flight(setup, track, end_reason, requirements=requirements, findings_only=task.findings_only)
        is_requested = task.reference == "always"
        if is_requested or (task.reference == "failed" and verdict.failed):
            verdict, reference = explain_verdict(requirements, aircraft, verdict, is_requested=is_requested)
        end_time = float(track.time[-1]) if len(track) else 0.0
        events = (
            LogEvent(0.0, f"flight model: {flight.engine}", "info"),
            LogEvent(end_time, f"flight ended: {end_reason}", "info" if end_reason == "completed" else "error"),
        )
        if recorder is not None:
            for event in events:
                recorder.event(event.time, event.text, event.level)
            summary = return_summary(setup, track) if task.returns else None
            drawn_returns = None if summary is None else summary.data_for_pictures(glides=False)
            recorder.finish(end_reason, verdict, reference, drawn_returns)
    log, engine = (task.log, flight.engine) if len(track) else (None, "")
    return FlownMission(
        setup, track, verdict, end_reason, events, log, returns=summary, engine=engine, reference=reference
    )


def _unstarted_flight(requirements: RouteRequirements, task: FlightTask, end_reason: str) -> FlownMission:
    """Remove the log of an earlier flight, and judge the route of a flight that did not start."""
    setup, track = requirements.setup, join_tracks([])
    if task.log is not None:
        task.log.unlink(missing_ok=True)
    verdict = judge_flight(setup, track, end_reason, requirements=requirements)
    if task.reference != "never":
        verdict = with_tried_suggestions(JudgedMission(setup.mission, setup, requirements, verdict))
    return FlownMission(setup, track, verdict, end_reason)


def _fly_with_program(setup: FlightSetup, task: FlightTask, program_file: Path) -> FlownMission:
    """Fly a setup with an autopilot program, keep the program's own log, and judge the flight.

    Raises FlightError, after removing the flight log, if the program does not fly the mission to its end.
    """
    program = find_program_class(program_file).with_model(setup.autopilot, program_file)
    with program.start(setup, find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)) as flight:
        flight.prepare()
        try:
            judged_flight = fly_and_judge(flight.setup, task, flight)
        except FlightError:
            if task.log is not None:
                task.log.unlink(missing_ok=True)
            raise
        if task.log is not None:
            program_log = task.log.with_suffix(program.log_suffix)
            flight.save_log(program_log)
            judged_flight = replace(judged_flight, autopilot_log=program_log if judged_flight.log else None)
    return judged_flight


def autopilot_log_path(log: Path, program: Path) -> Path:
    """Return the path of the autopilot program's own log, next to the flight log of planfly.

    >>> autopilot_log_path(Path("runs/flight.mcap"), Path("arduplane")).name
    'flight.BIN'
    """
    return log.with_suffix(find_program_class(program).log_suffix)


def return_summary(
    setup: FlightSetup, track: Track | None, requirements: RouteRequirements | None = None
) -> ReturnSummary:
    """Judge simulated returns to launch from a few points of a flight.

    Without a track they are those of the planned path.

    The summary is empty without home or terrain.  If an error prevents the judgement, its line states the error.

    requirements: the setup's route requirements if already known.
    """
    if setup.mission.home is None or setup.scenario.terrain is None:
        return ReturnSummary()
    try:
        world = make_return_world(setup)
        if track is not None and len(track):
            interval = max(1.0, float(track.time[-1] - track.time[0]) / _SUMMARY_RETURN_COUNT)
            starts = flown_starts(setup, track, interval)
        else:
            duration = setup.path.length / max(1.0, setup.airspeed)
            interval = max(1.0, duration / _SUMMARY_RETURN_COUNT)
            starts = planned_starts(setup, interval, requirements)
        returns = judge_returns(world, starts, interval)
    except PlanflyError as error:
        return ReturnSummary(f"not judged: {error}")
    is_replaced = world.stands_in and not world.uses_other_autopilot
    replacement_text = f" (simulated with ArduPlane in place of {setup.autopilot.title})" if is_replaced else ""
    return ReturnSummary(returns_headline(returns) + replacement_text, world, starts, returns)
