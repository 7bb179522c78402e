"""Find remedies for surveys with photo lines that cannot be used.

Each remedy is flown before it is suggested.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeGuard

from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import Candidate
from flight.mission.edits import movable_indices, raise_items, set_airspeed
from flight.mission.items import Command, Mission, MissionItem
from flight.mission.placing import place_stops
from flight.mission.survey_layout import SurveyLayout, fixed_layout_reason, min_turn_around, with_layout
from flight.mission.surveys import Survey, with_photo_spacing
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import GROUND_PATH, Finding
from logs.verdict.measures.photo_lines import OverlapMeasure, measure_overlap
from logs.verdict.measures.route_requirements import judged_surveys, route_requirements
from logs.verdict.rule_words import FRONT_OVERLAP, RULE_WORDS, SIDE_OVERLAP
from logs.verdict.tolerances import PHOTO_OVERLAP_TOLERANCE
from logs.verdict.trials import least_change
from logs.verdict.verdict import Verdict
from planfly.workflow.open_flight import make_setup
from planfly.workflow.reference_flights import find_passing_parameter
from planfly.workflow.suggestion_trials import Trial
from planfly.workflow.uav import Uav
from world.errors import PlanflyError

RemedyKind = Literal["trigger", "height", "side", "turn-around", "gates", "every", "course", "parameter", "airspeed"]

# Turn-around distances that are tried, m.
TURN_AROUNDS = (25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 175.0, 200.0, 250.0, 300.0, 350.0, 400.0)
# Interleave strides n that are tried, with which every n-th line is flown first.
INTERLEAVE_STRIDES = (2, 3, 4)
# Fractions of the airspeed that are tried.
AIRSPEED_FACTORS = (0.95, 0.9, 0.85, 0.8, 0.7)
# Minimum airspeed that is tried, as a ratio to the minimum airspeed of the aircraft.
_MIN_AIRSPEED_RATIO = 1.1
# Step of the airspeeds that are tried, m/s.
_AIRSPEED_STEP_MPS = 0.1
# Largest difference of the altitudes of a line and of the turn onto it, with which both are raised, m.
_SAME_ALTITUDE_M = 1.0
# Ratio of the intended to the highest allowed ground speed; the difference is a reserve for gusts.
_GROUND_SPEED_RATIO = 0.98


@dataclass(frozen=True, slots=True)
class SurveyRemedy:
    """Change with which a survey was flown and passed.

    kind: kind of the change.
    name: name of the changed parameter; "" for other kinds.
    current, value: value before and after the change.  By kind, it is the distance between photos, added height or
        turn-around distance, m, the interleave stride n (every n-th line is flown first), the course, degrees, the
        value of the parameter, or the airspeed, m/s.
    unit: unit of `current` and `value`.
    verdict: verdict on the flight.
    mission: the mission as it was flown.
    length: length of its route, m.
    turn_around: turn-around distance of the layout, also with gates or a changed parameter or airspeed, m; NaN if
        unchanged.
    lead_in: distance before the first line, if longer than the turn-around distance, m.
    has_gates: True for another airspeed together with gates at the ends of the lines.
    """

    kind: RemedyKind
    name: str
    current: float
    value: float
    unit: str
    verdict: Verdict
    mission: Mission
    length: float
    turn_around: float = math.nan
    lead_in: float = 0.0
    has_gates: bool = False


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Trial flight that did not pass, but came closest to passing.

    what: description of the flown change.
    usable, lines: usable photo lines and all photo lines.
    verdict: verdict on the flight.
    """

    what: str
    usable: int
    lines: int
    verdict: Verdict

    @property
    def worst(self) -> float:
        """Usable part of the worst photo line, %; 0 if the changed mission has no photo lines."""
        return min(_usable_parts(self.verdict), default=0.0)


@dataclass(frozen=True, slots=True)
class TriedRemedies:
    """Result of the trial flights of a survey.

    remedies: changes with which all lines can be used.
    nearest: the best change that did not pass, if none passed; None if none was better than the mission itself.
    kept: reason why no other layout was tried; "" if layouts were tried.
    """

    remedies: tuple[SurveyRemedy, ...] = ()
    nearest: NearMiss | None = None
    kept: str = ""


def find_survey_remedies(
    setup: FlightSetup,
    uav: Uav,
    verdict: Verdict,
    on_trial: Callable[[str], None] = lambda _: None,
    overlaps: Sequence[OverlapMeasure | None] = (),
) -> TriedRemedies:
    """Find changes with which all photo lines of a survey can be used, by trial flights.

    For each kind of change, the smallest change that passes is returned.

    If neither longer turn-around distances nor gates are enough, both are combined.  If nothing else is enough, gates
    are combined with a lower airspeed, and longer turn-around distances with another parameter value or a lower
    airspeed.  There are at most four flights for each of about six changes.

    verdict: verdict on the flight of the setup.
    on_trial: called before each flight with a description of the change.
    overlaps: overlap of the photos of each survey on this flight, if measured.
    A change passes if no photo line fails, and no other rule fails that did not fail before.
    """
    if _all_lines_usable(verdict) or not judged_surveys(setup):
        return TriedRemedies()
    trials = _Trials(setup, uav, verdict, on_trial, overlaps)
    longer_turn_around = trials.find_turn_around()
    gates = trials.try_gates()
    candidates = [
        trials.try_photo_spacing(),
        trials.try_height(),
        trials.try_other_side(),
        longer_turn_around,
        gates or (None if longer_turn_around else trials.find_gates_and_turn_around()),
        trials.find_stride(math.inf if longer_turn_around is None else longer_turn_around.value),
        trials.find_course(),
        trials.find_parameter(),
        trials.find_airspeed() or trials.try_default_airspeed(),
    ]
    if not any(candidates):
        candidates.append(
            trials.find_gates_and_airspeed()
            or trials.find_parameter_and_turn_around()
            or trials.find_airspeed_and_turn_around()
        )
    remedies = tuple(remedy for remedy in candidates if remedy is not None)
    return TriedRemedies(remedies, None if remedies else trials.nearest, trials.kept)


def _worst_margins(verdict: Verdict) -> dict[str, float]:
    """Return the minimum margin of each failed rule of a verdict, by rule.

    The margin is -inf if a failure has none.
    """
    margins: dict[str, float] = {}
    for finding in verdict.findings:
        if finding.ok is False:
            margin = -math.inf if finding.margin is None else finding.margin
            margins[finding.rule] = min(margin, margins.get(finding.rule, math.inf))
    return margins


def _count_usable(verdict: Verdict) -> tuple[int, int]:
    """Return the number of usable photo lines and the number of all photo lines, according to a verdict."""
    lines = [finding.ok for finding in _line_findings(verdict)]
    return sum(is_usable is True for is_usable in lines), len(lines)


def _usable_parts(verdict: Verdict) -> list[float]:
    """Return the usable part of each photo line according to a verdict, %.

    It is 0 for a line that was not flown or not judged.
    """
    return [0.0 if finding.flown is None else finding.flown for finding in _line_findings(verdict)]


def _line_findings(verdict: Verdict) -> list[Finding]:
    """Return the findings on the photo lines of a flight.

    Findings on the overlap of their photos are left out.
    """
    return [finding for finding in verdict.findings if finding.rule == "survey" and finding.check in ("", GROUND_PATH)]


def _success_key(verdict: Verdict) -> tuple[int, float, int, float]:
    """Return a sort key of a flight's verdict, which is larger the closer the flight is to success.

    Its entries are the number of usable lines, the mean usable part of the lines in whole %, the negative number of
    failed findings, and the sum of the margins of photo overlaps that fail, %.
    """
    parts = _usable_parts(verdict)
    margins = [finding.margin or 0.0 for finding in verdict.failed if finding.check in (FRONT_OVERLAP, SIDE_OVERLAP)]
    return (
        _count_usable(verdict)[0],
        round(sum(parts) / max(1, len(parts))),
        -len(verdict.failed),
        round(sum(margins), 1),
    )


def _all_lines_usable(verdict: Verdict) -> bool:
    """Return True if all photo lines are usable, all findings on a survey pass, and there is a photo line."""
    usable, lines = _count_usable(verdict)
    return 0 < lines == usable and not any(
        finding.rule == "survey" and finding.ok is not True for finding in verdict.findings
    )


# Verdict on a flight, the mission that was flown, and the length of its path, m.
_TrialFlight = tuple[Verdict, Mission, float]


class _Trials:
    """Trial flights of one mission with one change at a time.

    Surveys that lost lines are laid out again, all with the same change.
    """

    def __init__(
        self,
        setup: FlightSetup,
        uav: Uav,
        verdict: Verdict,
        on_trial: Callable[[str], None],
        overlaps: Sequence[OverlapMeasure | None],
    ) -> None:
        self._setup, self._uav, self._on_trial = setup, uav, on_trial
        self._original_worst_margins, self._verdict, self._change_prefix = _worst_margins(verdict), verdict, ""
        self._has_gates, self._airspeed = False, 0.0
        lost_legs = {
            finding.place.index for finding in verdict.findings if finding.rule == "survey" and finding.ok is not True
        }
        all_surveys = judged_surveys(setup)
        self._numbers = [
            number
            for number, survey in enumerate(all_surveys)
            if not lost_legs.isdisjoint(range(survey.first, survey.last))
        ]
        self._surveys = [all_surveys[number] for number in self._numbers]
        self._overlaps = [measure for measure in overlaps if measure is not None]
        self._current_turn_around = min(min_turn_around(setup.route, survey) for survey in self._surveys)
        reasons = (fixed_layout_reason(setup.mission, setup.route, survey) for survey in self._surveys)
        self.kept = next((reason for reason in reasons if reason), "")
        self.nearest: NearMiss | None = None

    # ------------------------------------------------------------------
    # One flight.

    def _changed_setup(self, mission: Mission, uav: Uav) -> FlightSetup:
        """Return the setup of a changed mission with a UAV.

        Vertical legs are accepted, as in the original mission.
        """
        scenario = self._setup.scenario
        placed = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)
        return make_setup(scenario, uav, mission, self._setup.seed, placed=placed)

    def _fly_trial(self, mission: Mission, uav: Uav, description: str) -> _TrialFlight | None:
        """Fly a changed mission.

        Store it as `nearest` if it came closer to passing than all flights before.

        description: description of the change.
        Returns verdict, mission and path length (m), or None for a mission without a valid route.
        """
        description = self._change_prefix + description
        self._on_trial(description)
        try:
            trial = Trial(self._changed_setup(mission, uav), uav.aircraft)
        except PlanflyError:
            return None
        best_verdict = self._verdict if self.nearest is None else self.nearest.verdict
        if _success_key(trial.flight_verdict) > _success_key(best_verdict):
            self.nearest = NearMiss(description, *_count_usable(trial.flight_verdict), trial.flight_verdict)
        return trial.flight_verdict, mission, trial.setup.path.length

    def _fly_layout(self, layout: SurveyLayout, description: str) -> _TrialFlight | None:
        """Fly the mission with another layout of its surveys; return None if the layout cannot be made.

        description: description of the layout.
        """
        mission, setup = self._setup.mission, self._setup
        # Start with the last survey, because a changed survey may be detected as two, which renumbers later surveys.
        for number in reversed(self._numbers):
            survey = judged_surveys(setup)[number]
            changed_mission = with_layout(mission, setup.route, survey, layout, self._setup.scenario.origin)
            if changed_mission is None:
                return None
            mission = changed_mission
            try:
                setup = self._changed_setup(mission, self._uav)
            except PlanflyError:
                return None
        if self._has_gates:
            mission = _with_gates(setup, judged_surveys(setup))
        if self._airspeed > 0.0:
            mission = _with_airspeed(setup, judged_surveys(setup), self._airspeed, self._uav.airspeed)
        return self._fly_trial(mission, self._uav, description)

    def _is_remedy(self, flight: _TrialFlight | None) -> TypeGuard[_TrialFlight]:
        """Return True if all lines are usable in a flight.

        No other rule may fail newly or clearly worse than before.

        A failure may become larger by at most the `scale` of its rule, the smallest noticeable difference.
        """
        return (
            flight is not None
            and _all_lines_usable(flight[0])
            and all(
                rule in self._original_worst_margins
                and worst_margin >= self._original_worst_margins[rule] - (RULE_WORDS[rule].scale or math.inf)
                for rule, worst_margin in _worst_margins(flight[0]).items()
            )
        )

    # ------------------------------------------------------------------
    # The remedies, one change each.

    def try_photo_spacing(self) -> SurveyRemedy | None:
        """Try photos at shorter distances along the lines, so that the front overlap is as required.

        The distance is the longest one, in whole m, with the required overlap where the route is lowest above the
        ground.  Returns None if the front overlap does not fail, or if the flight does not pass.
        """
        if not any(finding.check == FRONT_OVERLAP for finding in self._verdict.failed):
            return None
        mission, requirements, distances = self._setup.mission, route_requirements(self._setup), []
        for survey in self._surveys:
            measure = measure_overlap(requirements, aligned=None, survey=survey)
            distance = math.floor((None if measure is None else measure.needed_photo_spacing) or 0.0)
            first_line, *_ = survey.lines
            if 1.0 <= distance < first_line.photo:
                mission = with_photo_spacing(mission, survey, float(distance))
                distances.append((first_line.photo, float(distance)))
        if not distances:
            return None
        current, shortest = min(distances, key=lambda pair: pair[1])
        flight = self._fly_trial(mission, self._uav, f"photos every {shortest:g} m")
        return SurveyRemedy("trigger", "", current, shortest, "m", *flight) if self._is_remedy(flight) else None

    def try_height(self) -> SurveyRemedy | None:
        """Try the lines higher, by the fewest whole metres that give the flown photos the required overlaps.

        If that does not pass, try the fewest whole metres with which the overlaps would be judged as large enough.
        Returns None if no overlap fails, or if neither flight passes.
        """
        mission, route = self._setup.mission, self._setup.route
        altitudes, survey_items = route.positions[:, 2], set[int]()
        for survey in self._surveys:
            first, last = survey.first, survey.last
            # The waypoints of the turns onto the first line and off the last line are as high as the line.
            first -= int(first > 0 and abs(altitudes[first - 1] - altitudes[first]) < _SAME_ALTITUDE_M)
            last += int(last + 1 < len(altitudes) and abs(altitudes[last + 1] - altitudes[last]) < _SAME_ALTITUDE_M)
            survey_items |= {int(route.items[i]) for i in range(first, last + 1)}
        indices = [index for index in movable_indices(mission) if mission.items[index].seq in survey_items]
        for tolerance in (0.0, PHOTO_OVERLAP_TOLERANCE):
            climb = max((math.ceil(missing_height(measure, tolerance)) for measure in self._overlaps), default=0)
            if climb <= 0:
                continue
            flight = self._fly_trial(raise_items(mission, indices, float(climb)), self._uav, f"lines {climb} m higher")
            if self._is_remedy(flight):
                return SurveyRemedy("height", "", 0.0, float(climb), "m", *flight)
        return None

    def find_turn_around(self) -> SurveyRemedy | None:
        """Find the shortest turn-around distance above the current one that passes.

        Return None if none passes.
        """
        return self._find_shortest_turn_around(1, self._longer_turn_arounds(), 0.0)

    def _longer_turn_arounds(self) -> list[float]:
        """Return the turn-around distances to try that are longer than the current distance, m."""
        return [length for length in TURN_AROUNDS if length > self._current_turn_around + 1.0]

    def try_other_side(self) -> SurveyRemedy | None:
        """Try the lines in the opposite order, which turns into the wind.

        Returns None in calm air, or if the flight does not pass.
        """
        if self._setup.scenario.wind.speed <= 0.0:
            return None
        flight = self._fly_layout(
            SurveyLayout(self._current_turn_around, backwards=True), "the lines in the opposite order"
        )
        return (
            SurveyRemedy("side", "", 0.0, 1.0, "", *flight, self._current_turn_around)
            if self._is_remedy(flight)
            else None
        )

    def try_gates(self) -> SurveyRemedy | None:
        """Try gates (CONDITION_GATE) instead of waypoints at the ends of lines with turn-arounds.

        PX4 flies past a gate, and switches the camera in the gate's plane instead of at its acceptance radius.  Returns
        None for an autopilot without gates, or if the flight does not pass.
        """
        mission = _with_gates(self._setup, self._surveys)
        if mission == self._setup.mission:
            return None
        flight = self._fly_trial(mission, self._uav, "gates at the ends of the lines")
        return SurveyRemedy("gates", "", 0.0, 1.0, "", *flight) if self._is_remedy(flight) else None

    def find_stride(self, max_turn_around: float) -> SurveyRemedy | None:
        """Find the smallest interleave stride n that passes: every n-th line is flown first, then the others.

        Only turn-around distances below `max_turn_around` are tried.

        max_turn_around: turn-around distance that passes without interleaving, which is also the lead-in to the first
        line, m; infinity if no distance passes.
        """
        lead_in = max_turn_around if math.isfinite(max_turn_around) else 0.0
        turn_arounds = [
            self._current_turn_around,
            *(length for length in self._longer_turn_arounds() if length < max_turn_around),
        ]
        max_line_count = max(len(survey.lines) for survey in self._surveys)
        remedies = (
            self._find_shortest_turn_around(stride, turn_arounds, lead_in)
            for stride in INTERLEAVE_STRIDES
            if 2 * stride <= max_line_count
        )
        return next((remedy for remedy in remedies if remedy is not None), None)

    def _find_shortest_turn_around(
        self, stride: int, turn_arounds: Sequence[float], lead_in: float
    ) -> SurveyRemedy | None:
        """Find the shortest turn-around distance with which all lines are usable.

        Returns None if the flight with this distance does not pass.

        The search is a bisection.  A distance is too long if the flight runs out of energy before its end.
        turn_arounds: distances to try, in increasing order, m.

        stride: interleave stride; 1 flies the lines in order.
        lead_in: distance before the first line if it is longer than the turn-around distance, m.
        """
        order_text = "" if stride == 1 else f"every {ordinal_text(stride)} line, "
        flights: dict[float, _TrialFlight | None] = {}

        def is_long_enough(length: float) -> bool:
            """Return True if all lines are usable with a turn-around distance, or if it exhausts the energy."""
            layout = SurveyLayout(length, stride, lead_in=lead_in)
            flight = flights[length] = self._fly_layout(layout, f"{order_text}turn-arounds of {length:.0f} m")
            if flight is None:
                return False
            runs_out = {"completion", "energy"} <= _worst_margins(
                flight[0]
            ).keys() - self._original_worst_margins.keys()
            return runs_out or _all_lines_usable(flight[0])

        shortest_length = least_change(turn_arounds, is_long_enough)
        flight = None if shortest_length is None else flights[shortest_length]
        if shortest_length is None or not self._is_remedy(flight):
            return None
        if stride == 1:
            return SurveyRemedy(
                "turn-around", "", self._current_turn_around, shortest_length, "m", *flight, shortest_length
            )
        return SurveyRemedy("every", "", 1.0, float(stride), "lines", *flight, shortest_length, lead_in)

    def find_course(self) -> SurveyRemedy | None:
        """Try lines along and across the wind; return the shortest route that passes, or None.

        Without wind nothing is tried.
        """
        wind = self._setup.scenario.wind
        if wind.speed <= 0.0:
            return None
        current_course, remedies = self._surveys[0].course, []
        for course in (wind.from_course, wind.from_course + 0.5 * math.pi):
            # Courses close to the current course, in either direction of flight, are left out.
            if abs(math.sin(course - current_course)) <= math.sin(math.radians(15.0)):
                continue
            current_degrees, degrees = (math.degrees(angle) % 180.0 for angle in (current_course, course))
            flight = self._fly_layout(
                SurveyLayout(self._current_turn_around, 1, course), f"lines on course {degrees:.0f}°"
            )
            if self._is_remedy(flight):
                remedies.append(
                    SurveyRemedy("course", "", current_degrees, degrees, "deg", *flight, self._current_turn_around)
                )
        return min(remedies, key=lambda remedy: remedy.length, default=None)

    def find_parameter(self) -> SurveyRemedy | None:
        """Find an autopilot parameter that makes the flight pass at another value; return None without one."""
        passed_flights: list[_TrialFlight] = []

        def passes_with(autopilot: Autopilot) -> bool:
            """Return True if the flight passes with an autopilot; store the flight in this case."""
            uav = replace(self._uav, autopilot=autopilot)
            flight = self._fly_trial(self._setup.mission, uav, "another parameter of the autopilot")
            if self._is_remedy(flight):
                passed_flights.append(flight)
            return self._is_remedy(flight)

        deciding = find_passing_parameter(self._uav.autopilot, self._verdict.findings, passes_with)
        if deciding is None:
            return None
        return SurveyRemedy(
            "parameter", deciding.name, deciding.current, deciding.passing, deciding.unit, *passed_flights[-1]
        )

    def find_airspeed(self, *, has_gates: bool = False) -> SurveyRemedy | None:
        """Find the highest of the reduced airspeeds that passes; return None if none passes.

        has_gates: True for gates at the ends of the lines in addition.

        Nothing is tried if the mission sets an airspeed.  The airspeed is set by items of the mission.
        """
        setup, prefix = self._setup, ""
        if has_gates:
            setup, prefix = replace(setup, mission=_with_gates(setup, self._surveys)), "gates, "
        for speed in self._slower_airspeeds():
            mission = _with_airspeed(setup, self._surveys, speed, self._uav.airspeed)
            flight = self._fly_trial(mission, self._uav, f"{prefix}{speed:g} m/s")
            if self._is_remedy(flight):
                return SurveyRemedy("airspeed", "", self._uav.airspeed, speed, "m/s", *flight, has_gates=has_gates)
        return None

    # ------------------------------------------------------------------
    # Two changes together.

    def _find_turn_around_with(
        self,
        change: str,
        uav: Uav,
        turn_arounds: Sequence[float],
        mission: Mission | None = None,
        *,
        has_gates: bool = False,
        airspeed: float = 0.0,
    ) -> SurveyRemedy | None:
        """Find the shortest turn-around distance that passes in combination with another change.

        change: description of the other change.
        uav: UAV with the change, or the unchanged UAV.
        mission: mission with the change; None for the unchanged mission.
        turn_arounds: distances to try, in increasing order, m.
        has_gates: True for gates at the ends of the lines.
        airspeed: airspeed on the surveys, m/s; 0 if it is not changed.
        """
        trials = copy(self)
        trials._uav, trials._change_prefix, trials._has_gates = uav, f"{change}, ", has_gates
        trials._airspeed = airspeed
        if mission is not None:
            trials._setup = replace(self._setup, mission=mission)
        remedy = trials._find_shortest_turn_around(1, turn_arounds, 0.0)
        self.nearest = trials.nearest
        return remedy

    def find_gates_and_turn_around(self) -> SurveyRemedy | None:
        """Try longer turn-around distances with gates; return None without gates, or if none passes."""
        if not self._setup.autopilot.route_rules.reads_as_px4:
            return None
        remedy = self._find_turn_around_with("gates", self._uav, self._longer_turn_arounds(), has_gates=True)
        return None if remedy is None else replace(remedy, kind="gates", current=0.0, value=1.0, unit="")

    def find_gates_and_airspeed(self) -> SurveyRemedy | None:
        """Try the reduced airspeeds with gates.

        Return None if the lines have no place for gates, or if none passes.
        """
        if _with_gates(self._setup, self._surveys) == self._setup.mission:
            return None
        return self.find_airspeed(has_gates=True)

    def find_parameter_and_turn_around(self) -> SurveyRemedy | None:
        """Try longer turn-around distances with another value of one autopilot parameter.

        Returns the first pair that passes, or None.
        """
        autopilot = self._uav.autopilot
        if autopilot.parameters is None:
            return None
        values = {parameter.name: parameter.value for parameter in autopilot.parameters.values}
        pairs = (
            self._find_turn_around_for_parameter(candidate, values[candidate.name])
            for candidate in autopilot.deviations.track_candidates
        )
        return next((remedy for remedy in pairs if remedy is not None), None)

    def _find_turn_around_for_parameter(self, candidate: Candidate, current: float) -> SurveyRemedy | None:
        """Find a turn-around distance and a parameter value that pass together.

        The shortest distance that passes with the parameter's farthest value is found first, then the passing value
        nearest to the current value with this distance.  Return None if no distance passes with the farthest value.

        candidate: the parameter and its values to try.
        current: current value of the parameter.
        """
        remedies = list[SurveyRemedy]()
        # Do not suggest values below the documented range.
        start = max(current, candidate.least - candidate.step)
        step = math.copysign(candidate.step, candidate.far - start)

        def passes_with(value: float, turn_arounds: Sequence[float]) -> bool:
            """Return True if a turn-around distance passes with a parameter value; store the remedy."""
            autopilot = self._uav.autopilot.with_parameters(**{candidate.name: value})
            uav = replace(self._uav, autopilot=autopilot)
            remedy = self._find_turn_around_with(f"{candidate.name} {value:g}", uav, turn_arounds)
            if remedy is None:
                return False
            remedies.append(
                replace(
                    remedy, kind="parameter", name=candidate.name, current=current, value=value, unit=candidate.unit
                )
            )
            return True

        step_count = int((candidate.far - start) / step + 1e-6)
        values = [round(start + step * count, 6) for count in range(1, step_count + 1)]
        if not values or not passes_with(values[-1], self._longer_turn_arounds()):
            return None
        turn_around = remedies[0].turn_around
        least_change(values[:-1], lambda value: passes_with(value, [turn_around]))
        return remedies[-1]

    def find_airspeed_and_turn_around(self) -> SurveyRemedy | None:
        """Try longer turn-around distances with the lowest of the reduced airspeeds.

        Return None if none of them passes.
        """
        for speed in [*self._slower_airspeeds()][-1:]:
            remedy = self._find_turn_around_with(
                f"{speed:g} m/s", self._uav, self._longer_turn_arounds(), airspeed=speed
            )
            if remedy is not None:
                return replace(remedy, kind="airspeed", current=self._uav.airspeed, value=speed, unit="m/s")
        return None

    def try_default_airspeed(self) -> SurveyRemedy | None:
        """Try longer turn-around distances with the default airspeed, if the mission sets a too low airspeed.

        Returns None if the mission sets none, or if no distance passes.

        An airspeed is too low if it is below the minimum airspeed of the aircraft.
        """
        mission, default_airspeed = self._setup.mission, self._uav.airspeed
        slow_items = [
            item for item in mission.items if 0.0 < _commanded_airspeed(item) < self._uav.aircraft.airspeed_min
        ]
        if not slow_items:
            return None
        items = tuple(
            replace(item, params=(item.params[0], default_airspeed, *item.params[2:])) if item in slow_items else item
            for item in mission.items
        )
        remedy = self._find_turn_around_with(
            f"{default_airspeed:g} m/s", self._uav, self._longer_turn_arounds(), replace(mission, items=items)
        )
        if remedy is None:
            return None
        return replace(
            remedy,
            kind="airspeed",
            current=min(map(_commanded_airspeed, slow_items)),
            value=default_airspeed,
            unit="m/s",
        )

    def _slower_airspeeds(self) -> Iterator[float]:
        """Yield each reduced airspeed (m/s), the fastest first, down to the lowest allowed.

        Yields nothing if the mission itself sets an airspeed.
        """
        if any(item.command == Command.DO_CHANGE_SPEED for item in self._setup.mission.items):
            return
        limits, steps = self._uav.autopilot.speeds.limits, 1.0 / _AIRSPEED_STEP_MPS
        min_speed = max(
            _MIN_AIRSPEED_RATIO * self._uav.aircraft.airspeed_min, -math.inf if limits is None else limits.min
        )
        lowest = math.ceil(min_speed * steps - 1e-6) / steps
        speeds = {lowest, *(round(2.0 * factor * self._uav.airspeed) / 2.0 for factor in AIRSPEED_FACTORS)}
        # Highest airspeed at which a slow camera takes photos with the required front overlap, from the ground speed
        # flown at the place with the minimum overlap.
        photo_speeds, autopilot = [math.inf], self._uav.autopilot
        altitude = float(self._setup.route.positions[self._surveys[0].first, 2])
        for measure in self._overlaps:
            if measure.is_camera_limited and measure.front is not None and measure.camera.front is not None:
                ground_speed = measure.photo_spacing / measure.camera.interval
                overlap = measure.camera.front - PHOTO_OVERLAP_TOLERANCE
                needed_speed = (1.0 - overlap) * measure.camera.along * measure.height / measure.camera.interval
                change = _GROUND_SPEED_RATIO * needed_speed - ground_speed
                photo_speeds.append(self._uav.airspeed + change / autopilot.speeds.true_airspeed_factor(altitude))
        max_speed = min(photo_speeds)
        if math.isfinite(max_speed):
            speeds.add(math.floor(max_speed * steps + 1e-6) / steps)
        for speed in sorted(speeds, reverse=True):
            if lowest <= speed <= max(lowest, max_speed) and speed < self._uav.airspeed:
                yield speed


def missing_height(measure: OverlapMeasure, tolerance: float = 0.0) -> float:
    """Return by how much photo lines must be raised for the required overlaps, m.

    The lowest photos decide.

    The distances between photos and between lines stay as flown.  Returns 0 if the overlaps are large enough.

    tolerance: fraction by which the overlaps may be less than required.
    """
    camera, missing = measure.camera, 0.0
    for overlap, required, distance, width, height in (
        (measure.front, camera.front, measure.photo_spacing, camera.along, measure.height),
        (measure.side, camera.side, measure.line_spacing, camera.across, measure.side_height),
    ):
        if overlap is not None and required is not None and overlap < required - PHOTO_OVERLAP_TOLERANCE:
            missing = max(missing, distance / (width * (1.0 - required + tolerance)) - height)
    return missing


def _with_gates(setup: FlightSetup, surveys: Sequence[Survey]) -> Mission:
    """Return a setup's mission with gates (CONDITION_GATE) at the ends of photo lines.

    Only lines with turn-around distances get gates.

    The mission is unchanged for an autopilot without gates.
    """
    mission, route = setup.mission, setup.route
    if not setup.autopilot.route_rules.reads_as_px4:
        return mission
    ends = {
        int(route.items[i])
        for survey in surveys
        for line in survey.lines
        for i in (line.first, line.last)
        if line.begins < i < line.ends
    }
    items = tuple(
        replace(item, command=int(Command.CONDITION_GATE), params=(0.0,) * 4)
        if item.seq in ends and item.command == Command.NAV_WAYPOINT
        else item
        for item in mission.items
    )
    return replace(mission, items=items)


def _with_airspeed(setup: FlightSetup, surveys: Sequence[Survey], airspeed: float, next_airspeed: float) -> Mission:
    """Return a setup's mission with another airspeed, m/s, from the start to the end of each survey.

    next_airspeed: airspeed after each survey, m/s.
    """
    mission, items = setup.mission, setup.route.items
    # Start with the last survey, because inserted items renumber later ones.
    for survey in reversed(surveys):
        photo_lines = survey.lines
        ends = items[photo_lines[0].begins], items[photo_lines[-1].ends]
        first, last = (next(k for k, item in enumerate(mission.items) if item.seq == end) for end in ends)
        mission = set_airspeed(mission, first, airspeed, next_airspeed, last)
    return mission


def ordinal_text(number: int) -> str:
    """Return the ordinal of a number as text.

    >>> ordinal_text(2), ordinal_text(5)
    ('second', '5th')
    """
    return {2: "second", 3: "third", 4: "fourth"}.get(number, f"{number}th")


def _commanded_airspeed(item: MissionItem) -> float:
    """Return the airspeed that a DO_CHANGE_SPEED item sets, m/s.

    It is NaN or negative if the item sets none, and 0 for other items.
    """
    return item.params[1] if item.command == Command.DO_CHANGE_SPEED else 0.0
