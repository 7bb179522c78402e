"""Trials of the suggestions of a verdict: only those with which their finding passes are offered.

A suggestion is applied to the mission, judged by geometry, and flown if the verdict is on a flight.  It passes if its
finding is gone and no more findings fail than before.  A step that is too small, such as a height, is enlarged by the
missing part.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice

from flight.mission.items import Mission
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import judge_geometry, with_passing_suggestions
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import Change, Suggestion, TriedSuggestions
from logs.verdict.trials import first_that_passes
from logs.verdict.verdict import Verdict
from planfly.workflow.apply_suggestion import apply_suggestion
from planfly.workflow.mission_context import JudgedMission, MissionContext
from planfly.workflow.trial_flight import AbortCheck, Trial, TrialAborted, never_abort
from world.errors import PlanflyError

# Greatest number of findings whose suggestions are tried, the worst of each rule first.
MAX_TRIED_FINDINGS = 6
# Greatest number of trial flights for one verdict.
MAX_TRIAL_FLIGHTS = 4
# Greatest number of missions that are tried for one suggestion: the suggestion itself and larger steps.
_MAX_STEPS = 10
# Greatest number of failed findings with suggestions; if more fail, no single change is worth a trial.
_MAX_FAILED = 40
# Changes by a step, m, which are enlarged while the finding fails.
_STEPS = frozenset(("height", "descent", "inset", "distance", "north", "east", "south", "west"))
# Factor on the part that a step still lacks.
_GROWTH_FACTOR = 1.5
# Length added to the part that a step still lacks, m.
_GROWTH_M = 2.0


def finding_key(finding: Finding) -> tuple[str, str, int | None, str]:
    """Return the key of a finding that survives a change: rule and place, without item numbers, which may shift."""
    return finding.rule, finding.place.kind, finding.place.index, finding.place.name


def fails_no_more(before: Verdict, after: Verdict, finding: Finding) -> bool:
    """Return True if a finding does not fail after a change, and no more findings fail than before."""
    return len(after.failed) <= len(before.failed) and finding_key(finding) not in map(finding_key, after.failed)


@dataclass(frozen=True)
class PassedTrial:
    """A suggestion of a finding that passed its trial, enlarged if necessary, and the setup that it was tried with."""

    finding: Finding
    suggestion: Suggestion
    setup: FlightSetup


def tried_suggestions(passed_trials: Sequence[PassedTrial]) -> tuple[TriedSuggestions, ...]:
    """Return the suggestions that passed, by finding."""
    trials_by_finding: dict[int, list[PassedTrial]] = {}
    for trial in passed_trials:
        trials_by_finding.setdefault(id(trial.finding), []).append(trial)
    return tuple(
        TriedSuggestions(trials[0].finding.rule, trials[0].finding.place, tuple(trial.suggestion for trial in trials))
        for trials in trials_by_finding.values()
    )


def judge_mission(setup: FlightSetup) -> Verdict:
    """Judge the geometry of a mission without a flight, with suggestions that pass a trial by geometry."""
    requirements = route_requirements(setup)
    verdict = judge_geometry(setup, requirements)
    return with_tried_suggestions(JudgedMission(setup.mission, setup, requirements, verdict))


def with_tried_suggestions(judged: JudgedMission) -> Verdict:
    """Return the verdict on a mission with only those suggestions that pass a trial."""
    if not judged.verdict.failed:
        return judged.verdict
    passed_trials = SuggestionTrials(MissionContext.around_setup(judged.setup), judged).passing()
    return replace(
        judged.verdict, findings=with_passing_suggestions(judged.verdict.findings, tried_suggestions(passed_trials))
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
    _flights_left: int = MAX_TRIAL_FLIGHTS
    _trials: dict[object, Trial] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._current = Trial(self.judged.setup, self.context.airframe.aircraft)

    def passing(self) -> list[PassedTrial]:
        """Try the first suggestion of each finding, then the second of each, and return those that pass."""
        requests = [
            (number, rank, finding)
            for rank, finding in enumerate(self._findings_to_try())
            for number in range(len(finding.suggestions))
        ]
        passed_trials = []
        with suppress(TrialAborted):
            for number, _, finding in sorted(requests, key=lambda request: request[:2]):
                passed_trial = self.try_suggestion(finding, number)
                passed_trials += [] if passed_trial is None else [passed_trial]
        return passed_trials

    def _findings_to_try(self) -> list[Finding]:
        """Return the failed findings to try, the worst of each rule first, the most urgent rules first."""
        findings_by_rule = [
            [finding for finding in rule.failed if finding.suggestions]
            for rule in self.judged.verdict.present().failed_rules
        ]
        if sum(map(len, findings_by_rule)) > _MAX_FAILED:
            return []
        ranked = [(rank, finding) for rule in findings_by_rule for rank, finding in enumerate(rule)]
        return [
            finding for _, finding in sorted(ranked, key=lambda ranked_finding: ranked_finding[0])[:MAX_TRIED_FINDINGS]
        ]

    def try_suggestion(self, finding: Finding, number: int) -> PassedTrial | None:
        """Return a suggestion of a finding, enlarged if necessary, with which its trial passes, or None."""
        candidates = islice(self._growing_suggestions(finding, finding.suggestions[number]), _MAX_STEPS)
        passed_candidate = first_that_passes(candidates, lambda candidate: self._passes(finding, candidate[1]))
        return (
            None if passed_candidate is None else PassedTrial(finding, passed_candidate[0], passed_candidate[1].setup)
        )

    def _passes(self, finding: Finding, trial: Trial) -> bool:
        if not fails_no_more(self._current.geometry_verdict, trial.geometry_verdict, finding):
            return False
        if self.judged.verdict.level != "flown":
            return True
        if "flight_verdict" not in vars(trial):
            self._flights_left -= 1
        return self._flights_left >= 0 and fails_no_more(self.judged.verdict, trial.flight_verdict, finding)

    def _growing_suggestions(self, finding: Finding, suggestion: Suggestion) -> Iterator[tuple[Suggestion, Trial]]:
        """Yield a suggestion and then larger ones, each with its trial."""
        judged, grown_finding, total = self.judged, finding, suggestion
        while True:
            if self.should_abort():
                raise TrialAborted
            try:
                mission, setup = self._changed_flight(judged, grown_finding, suggestion)
            except PlanflyError:
                return
            new_trial = Trial(setup, self.context.airframe.aircraft, self.should_abort)
            trial = self._trials.setdefault((mission.items, setup.battery), new_trial)
            yield total, trial
            after = trial.flight_verdict if "flight_verdict" in vars(trial) else trial.geometry_verdict
            missing_steps = _missing_steps(finding, total, after)
            if missing_steps is None:
                return
            grown_finding, suggestion = missing_steps
            judged, total = (
                JudgedMission(mission, trial.setup, trial.requirements, after),
                _merge_steps(total, suggestion),
            )

    def _changed_flight(
        self, judged: JudgedMission, finding: Finding, suggestion: Suggestion
    ) -> tuple[Mission, FlightSetup]:
        """Return mission and setup with a suggestion; a shorter flight is tried as a larger store of energy."""
        setup = replace(judged.setup, autopilot=judged.setup.autopilot.law)
        match suggestion:
            case (Change(what="battery" | "tank") as change,):
                return judged.mission, replace(setup, battery=change.wanted * setup.battery)
            case (Change(what="duration") as change,):
                return judged.mission, replace(setup, battery=setup.battery / (1.0 - 0.01 * change.wanted))
        mission = apply_suggestion(self.context, judged, finding, suggestion)
        return mission, self.context.setup(mission)


def _missing_steps(finding: Finding, suggestion: Suggestion, after: Verdict) -> tuple[Finding, Suggestion] | None:
    """Return the finding that still fails after a suggestion by steps, and the steps that it needs, or None.

    If the finding itself is gone, another leg that fails by the same rule needs steps.
    """
    kinds = {change.what for change in suggestion}
    if not kinds <= _STEPS:
        return None
    same_finding = [failed for failed in after.failed if finding_key(failed) == finding_key(finding)]
    same_rule_legs = [failed for failed in after.failed if failed.rule == finding.rule and failed.place.kind == "leg"]
    for failed in (*same_finding, *same_rule_legs):
        for needed_suggestion in failed.suggestions:
            if {change.what for change in needed_suggestion} == kinds:
                steps = (
                    replace(change, wanted=_GROWTH_FACTOR * change.wanted + _GROWTH_M) for change in needed_suggestion
                )
                return failed, tuple(steps)
    return None


def _merge_steps(suggestion: Suggestion, further_steps: Suggestion) -> Suggestion:
    """Return a suggestion with further steps, each added to the step of the same kind at the same place."""
    steps: dict[object, Change] = {}
    for change in (*suggestion, *further_steps):
        key = change.what, change.place.kind, change.place.index
        before = steps[key].wanted if key in steps else 0.0
        steps[key] = replace(change, wanted=float(round(before + change.wanted)))
    return tuple(steps.values())
