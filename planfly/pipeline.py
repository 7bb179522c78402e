"""Plan, export, fly, record, judge: the chain, stage by stage, as functions of frozen data."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.autopilots.catalog import program_autopilot
from flight.autopilots.program import ProgramAutopilot
from flight.dynamics.fdm import Variation
from flight.mission.from_plan import plan_mission
from flight.mission.items import Mission
from flight.simulation.airborne import Airborne
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track, join_tracks
from logs.recording.reader import LogEvent
from logs.recording.recorder import thin_track
from logs.verdict.judge_flight import judge_flight, judge_plan_only
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.places import ReferenceFlights
from logs.verdict.rules.energy_rule import needed_energy
from logs.verdict.verdict import Verdict
from planfly.airframe import Airframe, choose_seed, load_airframe
from planfly.crash_safe_log import CrashSafeLog, FlightLimits
from planfly.make_plan import Advance, make_plan, make_setup, planned_for
from planfly.reference_flights import FlyReference, judge_with_reference_flights
from planfly.returns_beside import ReturnsBeside, returns_beside
from planner.plan import Plan
from world.errors import FlightError, StartError
from world.scenario import Scenario

# Seconds of flight that are written at a time: some thirty milliseconds of a simulated flight.
BATCH = 60
# A mission that by prediction takes this many times the energy carried is not flown: hours would show no more.
MAX_ENERGY_RATIO = 2.0
_USUAL_LIMITS = FlightLimits()


@dataclass(frozen=True, slots=True, repr=False)
class PlanThenFly:
    """What `plan_then_fly` returns.

    plan: the path, with its certificate.
    mission: the plan as mission items.
    track: the flight, a row a guidance tick; None where there was no feasible plan to fly.
    verdict: whether it flies, with a finding for every rule and place.

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
        """How a notebook shows it."""
        return self.plan._repr_html_() + self.verdict._repr_html_()


@dataclass(frozen=True, slots=True)
class OffNominal:
    """How the flight itself differs from what the plan and its guidance know.

    variation: of the aircraft from its model.
    start_offset: east, north and up from the first waypoint to where the flight begins, m.
    """

    variation: Variation
    start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class JudgedFlight:
    """A flight from its first tick to its verdict.

    setup: with the program that flew, if one did.  requirements: the route requirements that it was judged by.
    track: the rows that are recorded, all of them where there is no log; none of a flight that could not begin.
    ended: how it ended, "completed" or the reason why not.
    verdict: on these rows.
    events: what the log holds beside them.
    reference: the results of reference flights; None if none were flown.
    returns: from a few places of it; None where they were not asked for.
    """

    setup: FlightSetup
    requirements: RouteRequirements
    track: Track
    ended: str
    verdict: Verdict
    events: tuple[LogEvent, ...]
    reference: ReferenceFlights | None = None
    returns: ReturnsBeside | None = None


def plan_then_fly(scenario: Scenario, *, seed: int | None = None, log: Path | None = None) -> PlanThenFly:
    """Plan a path in a scenario, fly it and judge the flight.

    seed: of planner and turbulence; None takes the scenario's, or 1.  log: where to write the flight, None for nowhere.
    Raises a PlanflyError for bad input.  A plan that cannot be flown is a verdict, not an error.
    """
    number = choose_seed(scenario, seed)
    airframe = load_airframe(scenario)
    plan = make_plan(scenario, airframe, number)
    mission = plan_mission(plan, airframe.airspeed, airframe.max_bank, tracking=airframe.limits.tracking)
    mission = replace(mission, autopilot=airframe.autopilot.name)
    if not plan.feasible:
        return PlanThenFly(plan, mission, None, judge_plan_only(plan, planned_for(scenario, airframe)))
    setup = make_setup(scenario, airframe, mission, number, plan=plan)
    flown = fly_and_judge(setup, airframe, log)
    return PlanThenFly(plan, mission, flown.track, flown.verdict)


def fly_and_judge(
    setup: FlightSetup,
    airframe: Airframe,
    log: Path | None,
    advance: Advance | None = None,
    *,
    every: int = 1,
    autopilot: Path | None = None,
    off_nominal: OffNominal | None = None,
    reference: FlyReference = "failed",
    returns: bool = False,
    limits: FlightLimits = _USUAL_LIMITS,
) -> JudgedFlight:
    """Fly a setup, record it if a log is named, and judge it.

    every: one row in so many is recorded; the verdict is then that of the recorded rows, so that a check repeats it.
    autopilot: the program of ArduPlane or PX4, which then flies; its own log is kept beside ours.
    off_nominal: how the flight differs from what guidance knows; none of a program's.
    reference: when reference flights are flown, as of `planfly.reference_flights.judge_with_reference_flights`.
    returns: whether returns from a few places are judged and drawn in the log, if one is named.
    limits: how long it may fly, and how large its log may grow.

    A flight that cannot begin, or that needs more than `MAX_ENERGY_RATIO` times the energy carried, has no row and no
    log: its verdict is its route's, and that it did not begin.  Raises FlightError for a program that does not fly it
    to its end; no log is left then.
    """
    stores = _stores_needed(setup)
    if stores > MAX_ENERGY_RATIO:
        return _unflown(setup, log, f"not started: it takes {stores:.0f} times the energy carried")
    try:
        if autopilot is not None:
            program = program_autopilot(autopilot).flying(setup.autopilot, autopilot)
            return _fly_program(
                setup, program, airframe, log, advance, every, limits, reference=reference, returns=returns
            )
        how = off_nominal or OffNominal(Variation())
        flight = Flight(setup, airframe.aircraft, how.variation, start_offset=how.start_offset)
        return _record_and_judge(
            setup, airframe, flight, log, advance, every, limits, reference=reference, returns=returns
        )
    except StartError as error:
        return _unflown(setup, log, f"not started: {error.reason}")


def _stores_needed(setup: FlightSetup) -> float:
    """How many times the energy carried a route takes by prediction; 0 where not even full power all the way would."""
    seconds, full = setup.path.length / float(setup.route.airspeed.min()), setup.envelope.power_full
    full_energy = float(np.nanmax(full, initial=0.0)) * seconds / 3600.0
    return needed_energy(setup) / setup.battery if full_energy > MAX_ENERGY_RATIO * setup.battery else 0.0


def _fly_program(
    setup: FlightSetup,
    program: ProgramAutopilot,
    airframe: Airframe,
    log: Path | None,
    advance: Advance | None,
    every: int,
    limits: FlightLimits,
    *,
    reference: FlyReference,
    returns: bool,
) -> JudgedFlight:
    with program.start(setup, airframe.aircraft) as flight:
        flight.prepare()
        try:
            judged = _record_and_judge(
                flight.setup, airframe, flight, log, advance, every, limits, reference=reference, returns=returns
            )
        except FlightError:
            if log is not None:
                log.unlink(missing_ok=True)
            raise
        if log is not None:
            flight.keep_log(log.with_suffix(program.log_suffix))
    return judged


def autopilot_log(log: Path, program: Path) -> Path:
    """Where the log that an autopilot's program writes is kept, beside ours.

    >>> autopilot_log(Path("runs/flight.mcap"), Path("arduplane")).name
    'flight.BIN'
    """
    return log.with_suffix(program_autopilot(program).log_suffix)


def _record_and_judge(
    setup: FlightSetup,
    airframe: Airframe,
    flight: Airborne,
    log: Path | None,
    advance: Advance | None,
    every: int,
    limits: FlightLimits,
    *,
    reference: FlyReference = "failed",
    returns: bool = False,
) -> JudgedFlight:
    flight.max_ticks = min(flight.max_ticks, limits.max_ticks(flight.dt))

    def report(done: float, total: float) -> None:
        if advance is not None:
            advance(done, total, f"{done / 1000:.1f} of {total / 1000:.1f} km")

    if log is None:
        flown = fly_to_end(flight, progress=report)
        return _judged(setup, airframe, flown.track, flown.ended, reference=reference)
    with CrashSafeLog(log, setup, every=every, batch=BATCH) as recorder:
        flown = fly_to_end(flight, recorder.write, report, lambda: limits.log_full(recorder.size))
        recorder.ended = flown.ended
        judged = _judged(setup, airframe, thin_track(flown.track, every), flown.ended, reference=reference)
        for event in judged.events:
            recorder.event(event.time, event.text, event.level)
        beside = returns_beside(setup, judged.track) if returns else None
        drawn = None if beside is None else beside.plainly_drawn()
        recorder.finish(judged.ended, judged.verdict, judged.reference, drawn)
    return replace(judged, returns=beside)


def _unflown(setup: FlightSetup, log: Path | None, ended: str) -> JudgedFlight:
    """A flight without a row, and without a log: none of a flight before it stays there."""
    if log is not None:
        log.unlink(missing_ok=True)
    requirements, track = route_requirements(setup), join_tracks([])
    verdict = judge_flight(setup, track, ended, requirements=requirements)
    return JudgedFlight(setup, requirements, track, ended, verdict, ())


def _judged(
    setup: FlightSetup, airframe: Airframe, track: Track, ended: str, *, reference: FlyReference
) -> JudgedFlight:
    end = float(track.time[-1]) if len(track) else 0.0
    event = LogEvent(end, f"flight ended: {ended}", "info" if ended == "completed" else "error")
    requirements = route_requirements(setup)
    verdict, others = judge_with_reference_flights(requirements, airframe.aircraft, track, ended, fly=reference)
    return JudgedFlight(setup, requirements, track, ended, verdict, (event,), others)
