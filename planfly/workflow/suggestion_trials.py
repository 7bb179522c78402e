"""Trial flights, and trials of the suggestions of a verdict.

A suggestion is offered only if its trial passes.

A suggestion is applied to the mission, judged by geometry, and flown if the verdict is on a flight that reached the
place of the finding.  It passes if its finding is then ok, and every finding that passed before still passes.  A step
that is too small, such as a change of height, is enlarged by the missing part.  If a part of its moves passes too,
this part is suggested.  A suggestion that passed states the moves of the items, and the findings that fail or are
undecided on a part of the mission that was not flown before.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, islice

import numpy as np

from aircraft.catalog import Aircraft
from flight.mission.items import Mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import BLOCK_DURATION_S, Flight
from flight.simulation.track import Track, TrackBuilder, join_tracks
from logs.verdict.findings import Finding, undecided_findings, worst_first_key
from logs.verdict.judge_flight import judge_flight
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    check_energy,
    route_requirements,
    true_airspeed_route,
)
from logs.verdict.places import (
    FAR_MOVE_DISTANCE_M,
    FLIGHT,
    Change,
    ItemMove,
    RemainingFinding,
    Suggestion,
    TriedSuggestions,
)
from logs.verdict.rules.registry import with_passing_suggestions
from logs.verdict.suggestions import RTL_ALTITUDE_STEP_M
from logs.verdict.tolerances import HEIGHT_ERROR_LIMIT_M
from logs.verdict.trials import first_that_passes, least_change
from logs.verdict.verdict import Verdict
from planfly.workflow.apply_suggestion import apply_suggestion, item_moves
from planfly.workflow.mission_context import JudgedMission, MissionContext
from world.errors import PlanflyError, StartError
from world.geometry import leg_runs

# ----------------------------------------------------------------------
# A trial: a setup that is judged by its geometry and by a flight, and the duration of a flight.

# Altitude error of a simulated autopilot against the real one, m.  The minimum clearances of 20 ArduPlane climbs are
# within this error.
ALTITUDE_ERROR_M = 1.2
# Longest predicted time of all flights that explain one verdict, reference flights and trial flights, s of flight.
MAX_EXPLAINING_TIME_S = 6 * 3600.0


class TrialAborted(Exception):
    """Raised when a trial flight is aborted because `should_abort` returned True."""


# Function that returns True if trial flights should be aborted.
AbortCheck = Callable[[], bool]


def never_abort() -> bool:
    """Return False, so that no trial is aborted."""
    return False


@dataclass(eq=False)
class Trial:
    """A setup that is judged, and flown if needed, only once: when a verdict is first requested.

    should_abort: called throughout the flight; once it returns True, the flight is aborted with TrialAborted.
    """

    setup: FlightSetup
    aircraft: Aircraft
    should_abort: AbortCheck = never_abort

    @cached_property
    def requirements(self) -> RouteRequirements:
        """Route requirements of the setup."""
        return route_requirements(self.setup)

    @cached_property
    def geometry_verdict(self) -> Verdict:
        """Verdict by geometry, without a flight."""
        return judge_geometry(self.setup, self.requirements)

    @cached_property
    def flight(self) -> tuple[Track, str]:
        """Track of the flight and the reason for its end; a flight that cannot start has no row."""
        builder, end_reason = TrackBuilder(), ""
        try:
            check_energy(self.requirements)
            flight = Flight(self.setup, self.aircraft)
            while not end_reason:
                rows, end_reason = flight.fly_block(round(BLOCK_DURATION_S / flight.dt))
                builder.add(rows)
                if self.should_abort():
                    raise TrialAborted
        except StartError as error:
            return join_tracks([]), f"not started: {error.reason}"
        return builder.track(), end_reason

    @cached_property
    def flight_verdict(self) -> Verdict:
        """Verdict on the flight, which is flown for it."""
        return judge_flight(self.setup, *self.flight, requirements=self.requirements)


def max_explaining_flights(setup: FlightSetup) -> int:
    """Return how many flights may be flown to explain a setup's verdict.

    Reference and trial flights are counted together.

    >>> from logs.recording.example_log import example_log
    >>> max_explaining_flights(example_log().setup) > 100
    True
    """
    return int(MAX_EXPLAINING_TIME_S / predicted_seconds(setup))


def predicted_seconds(setup: FlightSetup) -> float:
    """Predict the duration of a flight in still air, s.

    It is the path length divided by the mean of the legs' demanded true airspeeds, weighted by the time on each leg.

    >>> from logs.recording.example_log import example_log
    >>> flown = example_log()
    >>> bool(abs(predicted_seconds(flown.setup) - flown.track.time[-1]) < 5.0)
    True
    """
    leg_lengths = leg_runs(setup.route.positions)
    speed = leg_lengths.sum() / (leg_lengths / true_airspeed_route(setup).leg_airspeeds).sum()
    return float(setup.path.length / speed)


# ----------------------------------------------------------------------
# Trials of suggestions.

# Greatest number of findings whose suggestions are tried, the worst of each rule first.
MAX_TRIED_FINDINGS = 6
# Greatest number of trial flights for one verdict, if `max_explaining_flights` allows so many.
MAX_TRIAL_FLIGHTS = 4
# Greatest number of missions that are tried for one suggestion: the suggestion itself and larger steps.
_MAX_STEPS = 10
# Greatest number of parts of one suggestion's moves that are tried: all parts of four moves.
_MAX_TRIED_PARTS = 14
# Greatest number of failed findings with suggestions; if more fail, no single change is worth a trial.
_MAX_FAILED_FINDINGS = 40
# Greatest number of legs of a mission with trials and a reference flight: each judges all legs, 2 s for a thousand.
MAX_TRIED_LEGS = 5000
# Kinds of changes that are a step in m, or a parameter in m; the step is enlarged until the finding passes.
_STEP_KINDS = frozenset(("height", "descent", "inset", "distance", "north", "east", "south", "west", "parameter"))
# Changes of which a part of the moves may be enough.
_PART_KINDS = frozenset(("height", "descent", "north", "east", "south", "west"))
# Changes of the energy carried or needed, as a ratio or a percentage.
_ENERGY_KINDS = frozenset(("battery", "tank", "duration"))
# Greatest share of a leg's height error that may remain with a suggestion for its slope.
MAX_HEIGHT_ERROR_SHARE = 0.5
# Factor on the part that a step still lacks.
_GROWTH_FACTOR = 1.5
# Length added to the part that a step still lacks, m.
_GROWTH_M = 2.0


def finding_key(finding: Finding) -> tuple[str, str, int | None, str]:
    """Return a key that identifies a finding before and after a change of the mission.

    The key is the rule, and the kind, index and name of the place.

    Item numbers are not part of the key, because a change may shift them.
    """
    return finding.rule, finding.place.kind, finding.place.index, finding.place.name


def _worst_findings(verdict: Verdict) -> dict[tuple[str, str, int | None, str], Finding]:
    """Return the worst finding of each rule at each place of a verdict, by `finding_key`."""
    worst_by_key: dict[tuple[str, str, int | None, str], Finding] = {}
    for finding in sorted(verdict.findings, key=worst_first_key):
        worst_by_key.setdefault(finding_key(finding), finding)
    return worst_by_key


def _is_undecided(finding: Finding) -> bool:
    """Return True if a finding leaves a verdict undecided."""
    return bool(undecided_findings((finding,)))


def _newly_open_findings(old_verdict: Verdict, new_verdict: Verdict) -> list[tuple[Finding | None, Finding]]:
    """Return the findings that fail or are undecided after a change but not before.

    Each is a pair (old finding, finding).

    The old finding is None if there was none.  A finding that passed before and is not judged after the change is
    included.
    """
    old_findings = _worst_findings(old_verdict)
    pairs = []
    for key, finding in _worst_findings(new_verdict).items():
        old = old_findings.get(key)
        if finding.ok is False:
            is_new = old is None or old.ok is not False
        elif _is_undecided(finding):
            is_new = old is None or not _is_undecided(old)
        else:
            # The rule "mission" is skipped: a rejection by PX4 does not matter for another autopilot.
            is_judged_rule = finding.rule != "mission"
            is_new = is_judged_rule and finding.ok is None and old is not None and old.ok is True
        if is_new:
            pairs.append((old, finding))
    return pairs


def worsened_findings(old_verdict: Verdict, new_verdict: Verdict) -> list[Finding]:
    """Return the findings that a change makes worse: they newly fail, or are no longer decided or judged.

    old_verdict, new_verdict: verdicts before and after the change.
    A finding that was not judged before, because the flight ended early, is left out.
    """
    has_ended_early = old_verdict.level == "flown" and not old_verdict.complete
    worsened = []
    for old, finding in _newly_open_findings(old_verdict, new_verdict):
        was_unreached = has_ended_early and (old is None or old.ok is None or old.place == FLIGHT)
        if not was_unreached and (finding.ok is False or old is None or old.ok is not False):
            worsened.append(finding)
    return worsened


def remaining_findings(old_verdict: Verdict, new_verdict: Verdict) -> tuple[RemainingFinding, ...]:
    """Return the failed and undecided findings after a change that the change does not make worse.

    old_verdict, new_verdict: verdicts before and after the change.
    They fail or are undecided after the change.  Before it, they were not judged because the flight ended early, or
    they failed and are now only undecided.
    """
    added_keys = set(map(finding_key, worsened_findings(old_verdict, new_verdict)))
    return tuple(
        RemainingFinding(finding.rule, finding.place, finding.ok is False)
        for _, finding in _newly_open_findings(old_verdict, new_verdict)
        if finding_key(finding) not in added_keys
    )


def is_improved(old_verdict: Verdict, new_verdict: Verdict, finding: Finding) -> bool:
    """Return True if a finding does not fail after a change, and no finding newly fails.

    old_verdict, new_verdict: verdicts before and after the change.
    """
    has_new_failures = any(added.ok is False for added in worsened_findings(old_verdict, new_verdict))
    return not has_new_failures and finding_key(finding) not in map(finding_key, new_verdict.failed)


def is_passed(old_verdict: Verdict, new_verdict: Verdict, finding: Finding) -> bool:
    """Return True if a change makes a finding pass or disappear, and makes no other finding worse.

    old_verdict, new_verdict: verdicts before and after the change.
    A slope passes only if the altitude error on its leg becomes clearly smaller.
    """
    new_finding = _worst_findings(new_verdict).get(finding_key(finding))
    if new_finding is not None:
        old_error, new_error = (
            next((abs(fact.value) for fact in one.facts if fact.what == "height error"), 0.0)
            for one in (finding, new_finding)
        )
        keeps_height_error = new_error > max(HEIGHT_ERROR_LIMIT_M, MAX_HEIGHT_ERROR_SHARE * old_error)
        if new_finding.ok is not True or keeps_height_error:
            return False
    return not worsened_findings(old_verdict, new_verdict)


@dataclass(frozen=True)
class PassedTrial:
    """A suggestion of a finding that passed its trial, and the setup of this trial.

    The suggestion was enlarged if necessary.
    """

    finding: Finding
    suggestion: Suggestion
    setup: FlightSetup


def tried_suggestions(passed_trials: Sequence[PassedTrial]) -> tuple[TriedSuggestions, ...]:
    """Return the suggestions that passed, grouped by finding.

    Suggestions with the smallest moves of items come first.

    A move of `FAR_MOVE_DISTANCE_M` or more is left out if a smaller one passed, and is stated first otherwise.
    """
    trials_by_finding: dict[int, list[PassedTrial]] = {}
    for trial in passed_trials:
        trials_by_finding.setdefault(id(trial.finding), []).append(trial)
    tried = []
    for trials in trials_by_finding.values():
        # Sorted by the largest move of an item, m; 0 if the suggestion moves no item.
        suggestions = sorted(
            (trial.suggestion for trial in trials),
            key=lambda suggestion: max(
                (math.hypot(move.east, move.north, move.up) for move in _item_moves(suggestion)), default=0.0
            ),
        )
        near_moves = [
            suggestion
            for suggestion in suggestions
            if all(math.hypot(move.east, move.north) < FAR_MOVE_DISTANCE_M for move in _item_moves(suggestion))
        ]
        finding = trials[0].finding
        tried.append(TriedSuggestions(finding.rule, finding.place, tuple(near_moves or suggestions[:1])))
    return tuple(tried)


def _item_moves(suggestion: Suggestion) -> list[ItemMove]:
    """Return the moves of items of a suggestion that passed its trial."""
    return [move for change in suggestion for move in change.moves]


def judge_mission_geometry(setup: FlightSetup, requirements: RouteRequirements | None = None) -> Verdict:
    """Judge the geometry of a mission without a flight.

    The verdict has only those suggestions that pass a geometric trial.

    requirements: the setup's route requirements if already known.
    """
    requirements = requirements or route_requirements(setup)
    verdict = judge_geometry(setup, requirements)
    return with_tried_suggestions(JudgedMission(setup.mission, setup, requirements, verdict))


def has_geometric_suggestion(setup: FlightSetup) -> bool:
    """Return True if a suggested change makes a failed finding pass, judged without a flight."""
    return any(finding.suggestions for finding in judge_mission_geometry(setup).failed)


def with_tried_suggestions(judged_mission: JudgedMission) -> Verdict:
    """Return the verdict on a mission with only those suggestions that pass a trial."""
    if not judged_mission.verdict.failed:
        return judged_mission.verdict
    passed_trials = SuggestionTrials(MissionContext.from_setup(judged_mission.setup), judged_mission).find_passing()
    return replace(
        judged_mission.verdict,
        findings=with_passing_suggestions(judged_mission.verdict.findings, tried_suggestions(passed_trials)),
    )


@dataclass
class SuggestionTrials:
    """Trials of the suggestions of one verdict.

    judged: the mission with its verdict, geometric or flown.
    should_abort: called before each trial and throughout its flight, as for `Trial`.
    """

    context: MissionContext
    judged: JudgedMission
    should_abort: AbortCheck = never_abort
    _trials: dict[object, Trial] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Prepare the trial of the unchanged mission, and count the flights that are allowed."""
        self._current_trial = Trial(self.judged.setup, self.context.uav.aircraft)
        # One flight less: the reference flight with planfly's guidance.
        self._flights_left = min(MAX_TRIAL_FLIGHTS, max_explaining_flights(self.judged.setup) - 1)

    def find_passing(self) -> list[PassedTrial]:
        """Try the first suggestion of each finding, then the second and so on; return those that pass.

        A suggestion is left out if some of its changes pass without the others.  It has only as many moves as it needs.
        """
        # The failed findings with suggestions, the worst of each rule first, the most urgent rules first; none if the
        # mission has too many legs or too many such findings.
        findings_by_rule = [
            [finding for finding in rule.failed if finding.suggestions] for rule in self.judged.verdict.failed_rules
        ]
        ranked = [(rank, finding) for rule in findings_by_rule for rank, finding in enumerate(rule)]
        if self.judged.requirements.legs > MAX_TRIED_LEGS or len(ranked) > _MAX_FAILED_FINDINGS:
            ranked = []
        ranked = sorted(ranked, key=lambda ranked_finding: ranked_finding[0])[:MAX_TRIED_FINDINGS]
        requests = [
            (number, rank, finding)
            for rank, (_, finding) in enumerate(ranked)
            for number in range(len(finding.suggestions))
        ]
        passed_trials: list[PassedTrial] = []
        with suppress(TrialAborted):
            for number, _, finding in sorted(requests, key=lambda request: request[:2]):
                if _has_passing_part(passed_trials, finding, finding.suggestions[number]):
                    continue
                passed_trial = self.try_suggestion(finding, number)
                passed_trials += [] if passed_trial is None else [passed_trial]
            # The smallest part of a suggestion's moves that passes, or the whole; single moves are tried first, then
            # pairs and so on, with the flights that are left.
            for index, trial in enumerate(passed_trials):
                parts = self._parts(trial.finding, trial.suggestion)
                passed_trials[index] = self._first_passing(trial.finding, parts, _MAX_TRIED_PARTS) or trial
        return [
            trial for trial in passed_trials if not _has_passing_part(passed_trials, trial.finding, trial.suggestion)
        ]

    def try_suggestion(self, finding: Finding, number: int) -> PassedTrial | None:
        """Try a suggestion of a finding, enlarged if necessary; return the trial that passed, or None.

        number: index of the suggestion among those of the finding.
        """
        return self._first_passing(finding, self._growing_suggestions(finding, finding.suggestions[number]), _MAX_STEPS)

    def _first_passing(
        self, finding: Finding, candidates: Iterator[tuple[Suggestion, Trial]], max_count: int
    ) -> PassedTrial | None:
        """Return the first candidate whose trial passes, as a passed trial; None if none passes.

        candidates: suggestions with their trials, of which at most `max_count` are tried.
        """
        passed_candidate = first_that_passes(
            islice(candidates, max_count),
            lambda candidate: (
                _has_margin(finding, candidate[0], candidate[1].geometry_verdict)
                and self._passes_trial(finding, candidate[1])
                and _has_margin(finding, candidate[0], self._compared_verdicts(candidate[1], finding)[1])
            ),
        )
        if passed_candidate is None:
            return None
        (*first_changes, last_change), trial = passed_candidate
        last_change = replace(
            last_change,
            moves=item_moves(self.context, self.judged.mission, trial.setup.mission),
            remaining=remaining_findings(*self._compared_verdicts(trial, finding)),
            not_flown=self._is_unreached(finding),
        )
        return PassedTrial(finding, (*first_changes, last_change), trial.setup)

    def _parts(self, finding: Finding, suggestion: Suggestion) -> Iterator[tuple[Suggestion, Trial]]:
        """Yield suggestions with only a part of a suggestion's moves, the fewest moves first.

        Each has its trial.

        Nothing is yielded for fewer than two moves, and for changes of other kinds than `_PART_KINDS`.
        """
        moves, items = _item_moves(suggestion), self.judged.setup.route.items.tolist()
        if len(moves) < 2 or not {change.what for change in suggestion} <= _PART_KINDS:
            return
        for count in range(1, len(moves)):
            for part in combinations(moves, count):
                if all(change.place.kind in ("leg", "waypoint") for change in suggestion):
                    # A change of a waypoint's altitude for each item that the suggestion for legs moves.
                    smaller = tuple(
                        replace(
                            suggestion[-1],
                            place=self.judged.requirements.waypoint_place(items.index(move.item)),
                            wanted=round(abs(move.up), 2),
                            moves=(move,),
                        )
                        for move in part
                    )
                else:
                    smaller = (*suggestion[:-1], replace(suggestion[-1], moves=part))
                with suppress(PlanflyError):
                    yield smaller, self._trial(finding, smaller)

    def _passes_trial(self, finding: Finding, trial: Trial) -> bool:
        """Return True if a trial passes by geometry and by a flight.

        The flight is left out if the judged flight did not reach the finding's place.

        A trial fails if the allowed number of flights is used up.
        """
        if self._is_tried_by_flight(finding):
            if not is_improved(self._current_trial.geometry_verdict, trial.geometry_verdict, finding):
                return False
            if "flight_verdict" not in vars(trial):
                self._flights_left -= 1
            if self._flights_left < 0:
                return False
        return is_passed(*self._compared_verdicts(trial, finding), finding)

    def _is_tried_by_flight(self, finding: Finding) -> bool:
        """Return True if the suggestions of a finding are tried by flights.

        This is the case if the judged flight reached the place of the finding.
        """
        return self.judged.verdict.level == "flown" and not self._is_unreached(finding)

    def _is_unreached(self, finding: Finding) -> bool:
        """Return True if a finding fails by geometry at a place that the judged flight did not reach.

        The place is a leg or a waypoint.
        """
        verdict, place = self.judged.verdict, finding.place
        if verdict.level != "flown" or verdict.complete or place.kind not in ("leg", "waypoint"):
            return False
        is_beyond_end = place.index is not None and place.index > sum(map(math.isfinite, verdict.leg_ends))
        return is_beyond_end and finding_key(finding) in map(finding_key, self._current_trial.geometry_verdict.failed)

    def _compared_verdicts(self, trial: Trial, finding: Finding) -> tuple[Verdict, Verdict]:
        """Return the verdicts before and after a trial's change, both of the same level.

        Both are verdicts of flights if the finding is tried by flight, otherwise of the planned path.
        """
        if self._is_tried_by_flight(finding):
            return self.judged.verdict, trial.flight_verdict
        return self._current_trial.geometry_verdict, trial.geometry_verdict

    def _growing_suggestions(self, finding: Finding, suggestion: Suggestion) -> Iterator[tuple[Suggestion, Trial]]:
        """Yield a suggestion and then larger and larger suggestions, each with its trial.

        Each suggestion is applied to the unchanged mission in one step, as a user would apply it. The series ends when
        a suggestion cannot be enlarged or applied. Raises TrialAborted.
        """
        failed_value = max((change.current or 0.0 for change in suggestion if change.parameter), default=0.0)
        while True:
            try:
                suggestion = self._with_least_parameter(finding, suggestion, failed_value)
                trial = self._trial(finding, suggestion)
            except PlanflyError:
                return
            yield suggestion, trial
            failed_value = max(suggested_parameters(suggestion).values(), default=0.0)
            verdict = trial.flight_verdict if "flight_verdict" in vars(trial) else trial.geometry_verdict
            larger_suggestion = _larger_suggestion(finding, suggestion, verdict)
            if larger_suggestion is None:
                return
            # The current lengths of legs are those of the unchanged mission.
            suggestion = tuple(
                replace(change, current=float(self.judged.requirements.runs[change.place.index]))
                if change.what == "length" and change.place.index is not None
                else change
                for change in larger_suggestion
            )

    def _with_least_parameter(self, finding: Finding, suggestion: Suggestion, failed_value: float) -> Suggestion:
        """Return a suggestion with the smallest value of its parameters that passes by geometry.

        The suggestion is returned unchanged if it has no parameters, if it fails by geometry, or if the failed value
        passes by geometry and fails only in flight.

        failed_value: greatest value that was tried, all parameters being set to the same value.
        """

        def with_value(value: float) -> Suggestion:
            """Return the suggestion with another value of its parameters."""
            return tuple(replace(change, wanted=value) if change.parameter else change for change in suggestion)

        def passes(value: float) -> bool:
            """Return True if a value passes by geometry, with a margin."""
            candidate = with_value(value)
            verdict = self._trial(finding, candidate).geometry_verdict
            is_better = is_improved(self._current_trial.geometry_verdict, verdict, finding)
            return is_better and _has_margin(finding, candidate, verdict)

        largest_value = max(suggested_parameters(suggestion).values(), default=failed_value)
        if largest_value <= failed_value or passes(failed_value) or not passes(largest_value):
            return suggestion
        first_value = math.floor(failed_value / RTL_ALTITUDE_STEP_M + 1.0) * RTL_ALTITUDE_STEP_M
        values = np.arange(first_value, largest_value, RTL_ALTITUDE_STEP_M).tolist()
        return with_value(least_change([*values, largest_value], passes) or largest_value)

    def _trial(self, finding: Finding, suggestion: Suggestion) -> Trial:
        """Return the trial of a suggestion; suggestions that result in the same flight share a trial.

        Raises MissionError if the suggestion cannot be applied, and TrialAborted.
        """
        if self.should_abort():
            raise TrialAborted
        mission, setup = self._changed_flight(finding, suggestion)
        parameters = tuple(suggested_parameters(suggestion).items())
        key = mission.items, mission.home, setup.battery, setup.scenario.launch, parameters
        return self._trials.setdefault(key, Trial(setup, self.context.uav.aircraft, self.should_abort))

    def _changed_flight(self, finding: Finding, suggestion: Suggestion) -> tuple[Mission, FlightSetup]:
        """Apply a suggestion, and return the changed mission and setup.

        A shorter duration is tried as a larger battery.
        """
        setup = replace(self.judged.setup, autopilot=self.judged.setup.autopilot.model)
        match suggestion:
            case (Change(what="battery" | "tank") as change,):
                return self.judged.mission, replace(setup, battery=change.wanted * setup.battery)
            case (Change(what="duration") as change,):
                return self.judged.mission, replace(setup, battery=setup.battery / (1.0 - 0.01 * change.wanted))
            case (Change(what="launch course" | "launch speed") as change,) if setup.scenario.launch is not None:
                launch = replace(setup.scenario.launch, speed=change.wanted)
                if change.what == "launch course":
                    launch = replace(setup.scenario.launch, course=math.radians(change.wanted))
                return self.judged.mission, replace(setup, scenario=replace(setup.scenario, launch=launch))
        moves = tuple(change for change in suggestion if change.what != "parameter")
        mission = apply_suggestion(self.context, self.judged, finding, moves) if moves else self.judged.mission
        if parameters := suggested_parameters(suggestion):
            return mission, self.context.setup_with_parameters(mission, parameters)
        return mission, self.context.setup(mission)


def _has_margin(finding: Finding, suggestion: Suggestion, verdict: Verdict) -> bool:
    """Return True if a suggestion makes a finding pass with a margin for simulation and navigation errors.

    A changed parameter must leave a margin of `ALTITUDE_ERROR_M` in all findings of the same rule and place.  A finding
    on a zone requires that the path stays further from the zone than the navigation error.  Other suggestions need no
    margin.

    verdict: verdict on the mission with the suggestion applied.
    """
    place = finding.place
    if finding.rule == "fence":
        return _zone_shortfall(finding, verdict) == 0.0
    margins = [
        other.margin
        for other in verdict.findings
        if other.rule == finding.rule and (other.place.kind, other.place.number) == (place.kind, place.number)
    ]
    return not suggested_parameters(suggestion) or all(
        margin is None or margin >= ALTITUDE_ERROR_M for margin in margins
    )


def _zone_shortfall(finding: Finding, verdict: Verdict) -> float:
    """Return by how much a path is closer to the zone of a finding than the navigation error, m.

    Returns 0 if no other finding of the verdict names this zone as the nearest zone.
    """
    for other in verdict.findings:
        facts = {fact.what: fact.value for fact in other.facts if other.rule == "fence"}
        distance = facts.get(f"distance to zone {finding.place.index}")
        if distance is not None:
            return facts["navigation error"] - distance
    return 0.0


def suggested_parameters(suggestion: Suggestion) -> dict[str, float]:
    """Return the autopilot parameters that a suggestion changes, with their values."""
    return {change.parameter: change.wanted for change in suggestion if change.what == "parameter"}


def _has_passing_part(passed_trials: Sequence[PassedTrial], finding: Finding, suggestion: Suggestion) -> bool:
    """Return True if some changes of a finding's suggestion pass without the others."""

    def change_keys(changes: Suggestion) -> set[object]:
        """Return what identifies changes, except their sizes."""
        return {(change.what, change.place, change.parameter) for change in changes}

    passing_parts = [change_keys(trial.suggestion) for trial in passed_trials if trial.finding is finding]
    return any(part < change_keys(suggestion) for part in passing_parts)


def _larger_suggestion(finding: Finding, suggestion: Suggestion, verdict: Verdict) -> Suggestion | None:
    """Return a suggestion enlarged by what the mission still needs after it.

    Return None if no enlargement is known.

    If the finding still does not pass, the enlargement is what this finding needs. Otherwise it is what the other legs
    need for the same rule.

    verdict: verdict on the mission with the suggestion applied.
    """
    same_finding = [
        open_finding
        for open_finding in verdict.findings
        if open_finding.ok is not True and finding_key(open_finding) == finding_key(finding)
    ]
    same_rule_legs = [
        failed_finding
        for failed_finding in verdict.failed
        if failed_finding.rule == finding.rule and failed_finding.place.kind == "leg"
    ]
    larger_suggestion = None
    for open_finding in same_finding or same_rule_legs:
        larger_suggestion = _add_needed_change(larger_suggestion or suggestion, open_finding) or larger_suggestion
    shortfall = 0.0 if same_finding or finding.rule != "fence" else _zone_shortfall(finding, verdict)
    if shortfall > 0.0:
        further_step = math.ceil(_GROWTH_FACTOR * shortfall + _GROWTH_M)
        return tuple(replace(change, wanted=change.wanted + further_step) for change in suggestion)
    if not (same_finding or same_rule_legs) and suggested_parameters(suggestion):
        # The finding passes without the margin of a parameter.
        return tuple(
            replace(change, wanted=change.wanted + _GROWTH_M) if change.what == "parameter" else change
            for change in suggestion
        )
    return larger_suggestion


def _add_needed_change(suggestion: Suggestion, open_finding: Finding) -> Suggestion | None:
    """Return a suggestion enlarged by what an open finding still needs.

    Return None if it needs another kind of change.
    """
    kinds = {change.what for change in suggestion}
    for needed_suggestion in open_finding.suggestions:
        if {change.what for change in needed_suggestion} == kinds:
            if kinds == {"length"}:
                lengths = {change.place: change for change in (*suggestion, *needed_suggestion)}
                return tuple(sorted(lengths.values(), key=lambda change: change.place.index or 0))
            if kinds <= _STEP_KINDS:
                return _merge_steps(suggestion, needed_suggestion)
            if kinds <= _ENERGY_KINDS:
                merged_change = _merge_energy_changes(suggestion[0], needed_suggestion[0])
                is_whole_flight = merged_change.what == "duration" and merged_change.wanted >= 100.0
                return None if is_whole_flight else (merged_change,)
    return None


def _merge_steps(suggestion: Suggestion, needed_steps: Suggestion) -> Suggestion:
    """Return the steps of a suggestion, merged with the steps that are still needed.

    If a place already has a step of the same kind, the needed step is enlarged and added to it.
    """
    steps = {(change.what, change.place.kind, change.place.index, change.parameter): change for change in suggestion}
    for change in needed_steps:
        key = change.what, change.place.kind, change.place.index, change.parameter
        if change.what == "parameter" and key in steps:
            further_step = (_GROWTH_FACTOR - 1.0) * (change.wanted - (change.current or 0.0))
            wanted = RTL_ALTITUDE_STEP_M * math.ceil((change.wanted + further_step) / RTL_ALTITUDE_STEP_M)
            steps[key] = replace(steps[key], wanted=wanted)
            continue
        merged_step = change.wanted
        if key in steps:
            merged_step = steps[key].wanted + _GROWTH_FACTOR * change.wanted + _GROWTH_M
        steps[key] = replace(change, wanted=float(round(merged_step)))
    return tuple(steps.values())


def _merge_energy_changes(change: Change, needed_change: Change) -> Change:
    """Return one change that equals two successive changes of the energy carried, or of the duration.

    >>> from logs.verdict.places import FLIGHT
    >>> battery, duration = Change("battery", FLIGHT, None, 1.5, "1"), Change("duration", FLIGHT, None, 40.0, "%")
    >>> _merge_energy_changes(battery, replace(battery, wanted=1.01)).wanted
    1.52
    >>> _merge_energy_changes(duration, replace(duration, wanted=2.0)).wanted
    42.0
    """
    if change.what == "duration":
        remaining = (1.0 - 0.01 * change.wanted) * (1.0 - 0.01 * needed_change.wanted)
        return replace(change, wanted=float(math.ceil(100.0 * (1.0 - remaining))))
    return replace(change, wanted=math.ceil(100.0 * change.wanted * needed_change.wanted) / 100.0)
