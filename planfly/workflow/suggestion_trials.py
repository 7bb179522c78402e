"""Trials of the suggestions of a verdict: only those with which their finding passes are offered.

A suggestion is applied to the mission, judged by geometry, and flown if the verdict is on a flight.  It passes if its
finding is gone and no more findings fail than before.  A step that is too small, such as a height, is enlarged by what
is still missing.
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
from planfly.workflow.trial_flight import Hurry, Trial, TrialAborted, no_hurry
from world.errors import PlanflyError

# Greatest number of findings whose suggestions are tried, the worst of each rule first.
MAX_TRIED_FINDINGS = 6
# Greatest number of trial flights for one verdict.
MAX_TRIAL_FLIGHTS = 4
# Greatest number of missions that are tried for one suggestion: the suggestion itself and larger steps.
_MAX_STEPS = 10
# Greatest number of failed findings with suggestions: beyond it no single change is worth a trial.
_MAX_FAILED = 40
# Changes by a step, m, which are enlarged while the finding fails.
_STEPS = frozenset(("height", "descent", "inset", "distance", "north", "east", "south", "west"))
# Factor on what a step still lacks.
_GROWTH_FACTOR = 1.5
# Added to what a step still lacks, m.
_GROWTH_M = 2.0


def finding_key(item: Finding) -> tuple[str, str, int | None, str]:
    """Return what identifies a finding after a change: rule and place, without item numbers, which may shift."""
    return item.rule, item.place.kind, item.place.index, item.place.name


def leaves_no_more(before: Verdict, after: Verdict, item: Finding) -> bool:
    """Return True if a finding does not fail after a change, and no more findings fail than before."""
    return len(after.failed) <= len(before.failed) and finding_key(item) not in map(finding_key, after.failed)


@dataclass(frozen=True)
class PassedTrial:
    """A suggestion of a finding that passed its trial, enlarged if necessary, and the setup that it was tried with."""

    item: Finding
    suggestion: Suggestion
    setup: FlightSetup


def tried_suggestions(passed: Sequence[PassedTrial]) -> tuple[TriedSuggestions, ...]:
    """Return the suggestions that passed, by finding."""
    found: dict[int, list[PassedTrial]] = {}
    for one in passed:
        found.setdefault(id(one.item), []).append(one)
    return tuple(
        TriedSuggestions(same[0].item.rule, same[0].item.place, tuple(one.suggestion for one in same))
        for same in found.values()
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
    passed = SuggestionTrials(MissionContext.around_setup(judged.setup), judged).passing()
    return replace(
        judged.verdict, findings=with_passing_suggestions(judged.verdict.findings, tried_suggestions(passed))
    )


@dataclass
class SuggestionTrials:
    """Trials of the suggestions of one verdict.

    judged: the mission with its verdict, geometric or flown.
    hurry: called before each trial and throughout its flight, as for `Trial`.
    """

    context: MissionContext
    judged: JudgedMission
    hurry: Hurry = no_hurry
    _flights_left: int = MAX_TRIAL_FLIGHTS
    _trials: dict[object, Trial] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._now = Trial(self.judged.setup, self.context.airframe.aircraft)

    def passing(self) -> list[PassedTrial]:
        """Try the first suggestion of each finding, then the second of each, and return those that pass."""
        asked = [(which, k, item) for k, item in enumerate(self._chosen()) for which in range(len(item.suggestions))]
        passed = []
        with suppress(TrialAborted):
            for which, _, item in sorted(asked, key=lambda one: one[:2]):
                found = self.try_suggestion(item, which)
                passed += [] if found is None else [found]
        return passed

    def _chosen(self) -> list[Finding]:
        """Return the failed findings to try, the worst of each rule first, the most urgent rules first."""
        rules = [
            [item for item in rule.failed if item.suggestions] for rule in self.judged.verdict.present().failed_rules
        ]
        if sum(map(len, rules)) > _MAX_FAILED:
            return []
        ranked = [(rank, item) for rule in rules for rank, item in enumerate(rule)]
        return [item for _, item in sorted(ranked, key=lambda one: one[0])[:MAX_TRIED_FINDINGS]]

    def try_suggestion(self, item: Finding, which: int) -> PassedTrial | None:
        """Return a suggestion of a finding, enlarged if necessary, with which its trial passes, or None."""
        candidates = islice(self._candidates(item, item.suggestions[which]), _MAX_STEPS)
        found = first_that_passes(candidates, lambda candidate: self._passes(item, candidate[1]))
        return None if found is None else PassedTrial(item, found[0], found[1].setup)

    def _passes(self, item: Finding, trial: Trial) -> bool:
        if not leaves_no_more(self._now.geometric, trial.geometric, item):
            return False
        if self.judged.verdict.level != "flown":
            return True
        if "flown" not in vars(trial):
            self._flights_left -= 1
        return self._flights_left >= 0 and leaves_no_more(self.judged.verdict, trial.flown, item)

    def _candidates(self, item: Finding, suggestion: Suggestion) -> Iterator[tuple[Suggestion, Trial]]:
        """Yield a suggestion and then larger ones, each with its trial."""
        judged, asked, total = self.judged, item, suggestion
        while True:
            if self.hurry():
                raise TrialAborted
            try:
                mission, setup = self._changed(judged, asked, suggestion)
            except PlanflyError:
                return
            made = Trial(setup, self.context.airframe.aircraft, self.hurry)
            trial = self._trials.setdefault((mission.items, setup.battery), made)
            yield total, trial
            after = trial.flown if "flown" in vars(trial) else trial.geometric
            left = _still_needed(item, total, after)
            if left is None:
                return
            asked, suggestion = left
            judged, total = JudgedMission(mission, trial.setup, trial.requirements, after), _merged(total, suggestion)

    def _changed(self, judged: JudgedMission, item: Finding, suggestion: Suggestion) -> tuple[Mission, FlightSetup]:
        """Return mission and setup with a suggestion; a shorter flight is tried as a larger store of energy."""
        setup = replace(judged.setup, autopilot=judged.setup.autopilot.law)
        match suggestion:
            case (Change(what="battery" | "tank") as change,):
                return judged.mission, replace(setup, battery=change.wanted * setup.battery)
            case (Change(what="duration") as change,):
                return judged.mission, replace(setup, battery=setup.battery / (1.0 - 0.01 * change.wanted))
        mission = apply_suggestion(self.context, judged, item, suggestion)
        return mission, self.context.setup(mission)


def _still_needed(item: Finding, suggestion: Suggestion, after: Verdict) -> tuple[Finding, Suggestion] | None:
    """Return the finding that still fails after a suggestion by steps, and the steps that it needs, or None.

    If the finding itself is gone, another leg that fails by the same rule needs steps.
    """
    kinds = {change.what for change in suggestion}
    if not kinds <= _STEPS:
        return None
    own = [one for one in after.failed if finding_key(one) == finding_key(item)]
    legs = [one for one in after.failed if one.rule == item.rule and one.place.kind == "leg"]
    for one in (*own, *legs):
        for more in one.suggestions:
            if {change.what for change in more} == kinds:
                steps = (replace(change, wanted=_GROWTH_FACTOR * change.wanted + _GROWTH_M) for change in more)
                return one, tuple(steps)
    return None


def _merged(suggestion: Suggestion, more: Suggestion) -> Suggestion:
    """Return a suggestion with further steps, each added to the step of the same kind at the same place."""
    steps: dict[object, Change] = {}
    for change in (*suggestion, *more):
        key = change.what, change.place.kind, change.place.index
        before = steps[key].wanted if key in steps else 0.0
        steps[key] = replace(change, wanted=float(round(before + change.wanted)))
    return tuple(steps.values())
