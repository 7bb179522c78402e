"""Fly the worst returns to launch again by the ArduPlane program.

This checks planfly's simulated ArduPlane.

Each return is a separate flight, with the same mission as in `planfly.rtl.jsbsim_returns`.  The program's result
replaces the simulated result only if it is worse; it never improves a judgement.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.catalog import find_program_class
from flight.autopilots.simulated_returns import (
    RETURN_ARRIVED,
    RETURN_GROUND_IMPACT,
    RETURN_OFF_TERRAIN,
    RETURN_RESULT,
    RETURN_TIMEOUT,
)
from flight.mission.return_path import ReturnTarget
from flight.simulation.track import Track
from logs.verdict.returns.judge_returns import (
    KINDS,
    Returns,
    ReturnWorld,
    SimulatedReturn,
    can_start_in_jsbsim,
    classify_return,
    deepest_violation,
    limit_ratio,
    worst_first_key,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.returns.returns_text import measured_text
from planfly.rtl.jsbsim_returns import LEAD_IN_LENGTH_M, find_nearest_approaches, positions_from_start, return_setup
from planfly.runtime.stages import stage
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from world.arrays import Floats
from world.errors import ArgumentError, MissionError
from world.kernels import Record
from world.scenario import Scenario

# Minimum height above ground of the lead-in to the start of a return, m; a return with a lower lead-in is not flown.
_MIN_LEAD_IN_HEIGHT_M = 20.0
# Maximum distance between the end of a return and its target at which the return has arrived, m.
_ARRIVAL_DISTANCE_M = 500.0
# Maximum angle between course and bearing at which a return heads for a target, rad.
_ARRIVAL_HEADING_TOLERANCE_RAD = math.radians(10.0)
# Number of rows of a track per second.
_ROWS_PER_SECOND = 60


@dataclass(frozen=True, slots=True)
class ProgramReturn:
    """One return to launch, by the simulated ArduPlane and by the program.

    simulated: the return by the simulated ArduPlane, as judged.
    flown: the return by the program; None if the program could not fly it.
    reason: reason why the program could not fly the return; "" if it flew.
    log: the log of the flight, or None if it was not kept.
    """

    simulated: SimulatedReturn
    flown: SimulatedReturn | None = None
    reason: str = ""
    log: Path | None = None

    @property
    def agrees(self) -> bool:
        """True if both returns have the same target and the same kind of outcome."""
        return self.flown is not None and (self.flown.kind, self.flown.target.name) == (
            self.simulated.kind,
            self.simulated.target.name,
        )

    @property
    def worse(self) -> bool:
        """True if the program's outcome is worse than the simulated outcome."""
        return self.flown is not None and KINDS.index(self.flown.kind) < KINDS.index(self.simulated.kind)


@dataclass(frozen=True, slots=True)
class ProgramReturns:
    """Returns to launch that the program was to fly.

    program: name and version of the program; "" if the program flew none of the returns.
    pairs: each return, simulated and flown, the worst first.
    """

    program: str
    pairs: tuple[ProgramReturn, ...]

    @property
    def flown_pairs(self) -> tuple[ProgramReturn, ...]:
        """Pairs whose return the program flew."""
        return tuple(pair for pair in self.pairs if pair.flown is not None)

    def headline(self) -> str:
        """Return a one-line summary.

        >>> ProgramReturns("", ()).headline()
        'the program could not fly any of the returns'
        """
        if not self.flown_pairs:
            return "the program could not fly any of the returns"
        agreeing_count = sum(pair.agrees for pair in self.flown_pairs)
        worse_count = sum(pair.worse for pair in self.flown_pairs)
        comparison = (
            "all of them agree with the simulation"
            if agreeing_count == len(self.flown_pairs)
            else f"{agreeing_count} of them agree with the simulation"
        )
        comparison += f"; {worse_count} ended worse than in the simulation" if worse_count else ""
        return f"{len(self.flown_pairs)} of the worst returns also flown by {self.program} itself: {comparison}"

    def lines(self, returns: Returns, scenario: Scenario) -> list[str]:
        """Return a line for each return.

        It names the start, the simulated outcome, the program's outcome, and which of them applies.
        """
        texts = []
        for pair in self.pairs:
            east, north, _ = pair.simulated.start
            start_text = f"{pair.simulated.time:.0f} s, from {east:.0f} m east, {north:.0f} m north"
            simulated_text = measured_text(pair.simulated, returns.limit, scenario)
            if pair.flown is None:
                texts.append(f"{start_text}: simulated {simulated_text}; not flown by the program: {pair.reason}")
                continue
            agreement = (
                "they agree"
                if pair.agrees
                else "the program's outcome applies, because it is worse"
                if pair.worse
                else "the simulated outcome applies, because it is worse"
            )
            program_text = measured_text(pair.flown, returns.limit, scenario)
            texts.append(f"{start_text}: simulated {simulated_text}; by the program {program_text}: {agreement}")
        return texts

    def with_worse_results(self, returns: Returns) -> Returns:
        """Return a copy of the simulated returns with the program's result wherever it is worse."""
        worse_result_by_id = {id(pair.simulated): pair.flown for pair in self.pairs if pair.worse}
        return replace(
            returns,
            each=tuple(
                worse_result_by_id.get(id(simulated_return)) or simulated_return for simulated_return in returns.each
            ),
        )


def check_is_arduplane(program: Path) -> None:
    """Raise ArgumentError if a program is not an ArduPlane executable.

    planfly flies returns only with ArduPlane.
    """
    autopilot_class = find_program_class(program)
    if not issubclass(autopilot_class, ArduPlaneSitl):
        allowed = f"expected an ArduPlane executable; returns by a real {autopilot_class.title} are not supported"
        raise ArgumentError.of_argument("autopilot", str(program), allowed)


def check_returns_as_arduplane(world: ReturnWorld, program: Path) -> None:
    """Raise ArgumentError if the returns to launch are not simulated with ArduPlane.

    Its program can only check such returns.
    """
    if not isinstance(world.autopilot, ArduPlane):
        allowed = f"the program of ArduPlane cannot check the returns of {world.autopilot.title}"
        raise ArgumentError.of_argument("sitl", str(program), allowed)


def choose_worst_returns(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, points: int
) -> list[tuple[SimulatedReturn, int]]:
    """Choose at most `points` returns for the program to fly, the worst first.

    Each has the index of its start.

    Starts that the program cannot reach safely are skipped.  Returns from neighbouring starts are similar, so starts
    closer to a chosen start than half the path length divided by `points` are skipped, too.
    """
    start_rows = starts.rows
    positions = np.column_stack([start_rows["east"], start_rows["north"]])
    min_distance = 0.5 * float(np.hypot(*np.diff(positions, axis=0).T).sum()) / points if len(starts) > 1 else 0.0
    start_index_by_time = {float(time): start_index for start_index, time in enumerate(starts.time)}
    chosen_returns: list[tuple[SimulatedReturn, int]] = []
    # Safe returns come last, the closest to a limit first.
    unsafe_returns = sorted((one for one in returns.each if not one.safe), key=worst_first_key)
    safe_returns = sorted((one for one in returns.each if one.safe), key=limit_ratio)
    for candidate in (*unsafe_returns, *safe_returns):
        start_index = start_index_by_time[candidate.time]
        is_near = any(
            np.hypot(*(positions[start_index] - positions[chosen_index])) < min_distance
            for _, chosen_index in chosen_returns
        )
        row, terrain = start_rows[start_index], world.scenario.terrain
        if is_near or starts.is_low[start_index] or not can_start_in_jsbsim(world, row):
            continue
        if terrain is not None:
            # 26 points on the straight lead-in, from the start backwards.
            velocity = np.array([float(row[f"velocity_{name}"]) for name in ("east", "north", "up")])
            start_position = np.array([float(row[name]) for name in ("east", "north", "up")])
            seconds_before = np.linspace(0.0, LEAD_IN_LENGTH_M / max(1.0, math.hypot(*velocity[:2])), 26)
            path = start_position - seconds_before[:, None] * velocity
            # An unknown height above the ground, NaN, must fail this comparison.
            if not (path[:, 2] - terrain.height(path[:, 0], path[:, 1])).min() > _MIN_LEAD_IN_HEIGHT_M:
                continue
        chosen_returns.append((candidate, start_index))
        if len(chosen_returns) == points:
            break
    return chosen_returns


def fly_with_autopilot(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, program: Path, max_returns: int, folder: Path | None
) -> ProgramReturns:
    """Fly at most `max_returns` of the worst returns to launch with the real ArduPlane.

    The returns are then judged.

    The wind is the mean wind, and the navigation is exact.

    program: ArduPlane's SITL program.
    folder: folder for the flight logs of planfly and of the program; None writes no logs.

    Raises FlightError if the program does not start or stops during the flight.
    """
    program_returns, version = [], ""
    for number, (simulated_return, start_index) in enumerate(
        choose_worst_returns(world, starts, returns, max_returns), 1
    ):
        log = None if folder is None else folder / f"worst-return-{number}.mcap"
        with stage(
            f"flying return {number} of {max_returns} with ArduPlane", "flying a return with ArduPlane"
        ) as advance:
            try:
                setup, _ = return_setup(world, starts.rows[start_index], simulated_return.target.landing)
            except MissionError as error:
                program_returns.append(ProgramReturn(simulated_return, reason=str(error)))
                continue
            flight = fly_and_judge(setup, FlightTask(log, advance, autopilot=program, reference="never"))
        version = flight.setup.autopilot.version
        program_return = _judge_flown_return(
            world, simulated_return, starts.rows[start_index], flight.track, flight.ended
        )
        reason = "" if program_return else f"the flight does not reach the start of the return ({flight.ended})"
        program_returns.append(ProgramReturn(simulated_return, program_return, reason, log))
    return ProgramReturns(version, tuple(program_returns))


def _judge_flown_return(
    world: ReturnWorld, simulated_return: SimulatedReturn, start: Record, track: Track, end_reason: str
) -> SimulatedReturn | None:
    """Judge a return to launch that the autopilot program flew, by the same rules as a simulated one.

    simulated_return: simulation of the same return; its required height and its energy at the start are used.
    start: position and velocity at the start of the return.
    track: flown track, which begins before the start.
    end_reason: reason why the flight ended, such as "ground contact".
    Returns None if the flight did not reach the start.
    """
    path = positions_from_start(track, start)
    if path is None:
        return None
    start_row = len(track) - len(path)
    position, target = path, simulated_return.target
    if target.landing is not None:
        # The path to a landing sequence ends at the last waypoint before the landing.
        position = _cut_at_nearest_point(_end_position(target), position)
    target = _flown_target(world, target, position)
    approach = find_nearest_approaches(world, position)
    hits_ground = end_reason == "ground contact" and len(position) == len(path)
    has_arrived = hits_ground or bool(
        np.hypot(*(position[-1, :2] - np.array(_end_position(target)[:2]))) < _ARRIVAL_DISTANCE_M
    )
    record: Record = np.zeros(1, RETURN_RESULT)[0]
    clearance, lowest_position = approach.clearance, approach.lowest_position
    if hits_ground:
        clearance = min(0.0, clearance)
    elif 0.0 < clearance < simulated_return.required_height and target.landing and target.landing.next_stops:
        # As in `judge_returns`, the required height applies up to the first item of the landing sequence.
        clearance, lowest_position, *_ = find_nearest_approaches(
            world, _cut_at_nearest_point(target.landing.position, position)
        )
    if math.isnan(clearance):
        record["outcome"] = RETURN_OFF_TERRAIN
    elif hits_ground or clearance <= 0.0:
        record["outcome"] = RETURN_GROUND_IMPACT
    else:
        record["outcome"] = RETURN_ARRIVED if has_arrived else RETURN_TIMEOUT
    record["clearance"], record["sphere_distance"], record["threat"] = clearance, approach.outside, approach.threat
    used_energy = float(track.energy[start_row + len(position) - 1] - track.energy[start_row])
    remaining_energy = simulated_return.energy_left + simulated_return.energy - used_energy
    violation = deepest_violation(world, position[::_ROWS_PER_SECOND]) if world.airspace.zones else None
    zone = -1 if violation is None else violation.zone
    return replace(
        simulated_return,
        target=target,
        kind=classify_return(world, record, zone, remaining_energy, simulated_return.required_height),
        clearance=clearance,
        lowest_position=lowest_position,
        sphere_distance=approach.outside,
        threat=approach.threat,
        zone=zone,
        violation=violation,
        energy=used_energy,
        energy_left=remaining_energy,
    )


def _end_position(target: ReturnTarget) -> tuple[float, float, float]:
    """Return the position up to which a return to launch is judged.

    It is the loiter centre, or the last waypoint before the landing.
    """
    if target.landing is None:
        return target.position
    return (target.landing, *target.landing.next_stops)[-1].position


def _cut_at_nearest_point(point: tuple[float, float, float], position: Floats) -> Floats:
    """Return the part of a path up to the path point nearest to `point`.

    position: path points, (t, 3), m.
    """
    return position[: int(np.argmin(np.linalg.norm(position - np.array(point), axis=1))) + 1]


def _flown_target(world: ReturnWorld, simulated_target: ReturnTarget, position: Floats) -> ReturnTarget:
    """Return the target of a flown return to launch.

    The path ends at this target, or heads for it at its end.

    All possible targets are tried.  If none fits, the target of the simulated ArduPlane is returned.

    position: path points, (t, 3), m.
    """
    end_point = position[-1, :2]
    # The last course is the course over the last five seconds.
    earlier_point = position[max(0, len(position) - 5 * _ROWS_PER_SECOND), :2]
    course = math.atan2(*(end_point - earlier_point))
    home_altitude = world.autopilot.returns.rules.height + world.home.up
    targets = [
        simulated_target,
        ReturnTarget((world.home.east, world.home.north, home_altitude), "home", "", math.nan),
        *(
            ReturnTarget((rally.east, rally.north, rally.up), f"rally point {rally.number or number}", "", math.nan)
            for number, rally in enumerate(world.rally, 1)
        ),
    ]
    best_target, best_rank = simulated_target, math.inf
    for target in targets:
        if target is not simulated_target and target.name == simulated_target.name:
            continue
        offset = np.array(_end_position(target)[:2]) - end_point
        distance = math.hypot(*offset)
        course_difference = abs(math.remainder(math.atan2(*offset) - course, math.tau))
        # A target at which the path ends ranks before a target for which the path heads.
        rank = (
            distance / _ARRIVAL_DISTANCE_M
            if distance < _ARRIVAL_DISTANCE_M
            else 1.0 + course_difference / _ARRIVAL_HEADING_TOLERANCE_RAD
        )
        if rank < min(best_rank, 2.0):
            best_target, best_rank = target, rank
    return best_target
