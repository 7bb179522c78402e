"""What would let a survey's photo lines be flown: each remedy laid out, flown and judged before it is named."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from flight.autopilots.autopilot import Autopilot
from flight.mission.items import Command, Mission
from flight.mission.survey_layout import SurveyLayout, turn_around_of, with_layout
from flight.mission.surveys import Survey
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding, Verdict
from logs.verdict.measures.route_requirements import surveys_of
from planfly.airframe import Airframe, load_airframe
from planfly.pipeline import fly_and_judge, make_setup
from planfly.reference_flights import deciding_parameter
from world.errors import PlanflyError
from world.scenario import with_flight

RemedyKind = Literal["side", "turn-around", "every", "course", "parameter", "airspeed"]

# Turn-arounds that are tried, m; lines that are left out; shares of the airspeed.
TURN_AROUNDS = (25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 400.0)
EVERY = (2, 3, 4)
SLOWER = (0.95, 0.9, 0.85, 0.8, 0.7)
# An airspeed keeps so far above the slowest that the aircraft flies.
_ABOVE_SLOWEST = 1.1


@dataclass(frozen=True, slots=True)
class SurveyRemedy:
    """A change with which a survey was flown and passed.

    kind: what is changed.  name: of the parameter, where one is.
    current, value: m of turn-around, every so-manieth line, course in degrees, the parameter's value, or m/s.
    unit: of both.
    verdict: of the flight.
    mission: as it was flown.
    length: of its route, m.
    turn_around: m, of a layout; NaN where it stays as it is.
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


def survey_remedies(
    setup: FlightSetup, airframe: Airframe, verdict: Verdict, on_trial: Callable[[str], None] = lambda _: None
) -> tuple[SurveyRemedy, ...]:
    """What alone would let all photo lines be flown, by kind; of each kind the least change that was found.

    verdict: on the flight of the setup.  on_trial: called before each flight with what is tried.
    A change passes where no photo line fails, and nothing else that did not fail before.
    """
    lost = [item for item in verdict.findings if item.rule == "survey" and item.ok is False]
    surveys = surveys_of(setup)
    if not lost or not surveys:
        return ()
    worst = max(surveys, key=lambda one: sum(_of(one, item) for item in lost))
    tried = _Trials(setup, airframe, verdict, on_trial)
    longer = tried.turn_around(worst)
    found = [
        tried.side(worst),
        longer,
        tried.every(worst, math.inf if longer is None else longer.value),
        tried.course(worst),
        tried.parameter(),
        tried.airspeed(),
    ]
    return tuple(one for one in found if one is not None)


def _worst_margins(verdict: Verdict) -> dict[str, float]:
    """The least margin of each rule that fails; -inf where a failure has none."""
    worst: dict[str, float] = {}
    for item in verdict.findings:
        if item.ok is False:
            margin = -math.inf if item.margin is None else item.margin
            worst[item.rule] = min(margin, worst.get(item.rule, math.inf))
    return worst


def _of(survey: Survey, item: Finding) -> bool:
    return item.place.index is not None and survey.first <= item.place.index < survey.last


class _Trials:
    """Flights of one mission, changed in one thing at a time."""

    def __init__(
        self, setup: FlightSetup, airframe: Airframe, verdict: Verdict, on_trial: Callable[[str], None]
    ) -> None:
        self._setup, self._airframe, self._on_trial = setup, airframe, on_trial
        self._worst, self._verdict = _worst_margins(verdict), verdict

    def _fly(self, mission: Mission, airframe: Airframe, what: str) -> tuple[Verdict, float] | None:
        """The verdict of a flight, and its length; None where it cannot be laid out."""
        self._on_trial(what)
        scenario = self._setup.scenario
        try:
            setup = make_setup(scenario, airframe, mission, self._setup.seed)
        except PlanflyError:
            return None
        flown = fly_and_judge(setup, airframe, None, reference=False)
        return flown.verdict, setup.path.length

    def _passes(self, verdict: Verdict) -> bool:
        """Whether all lines of a flight can be used, and nothing else is worse than it was."""
        lines = [item.ok for item in verdict.findings if item.rule == "survey"]
        if not lines or not all(ok is True for ok in lines):
            return False
        return all(worst >= self._worst.get(rule, math.inf) for rule, worst in _worst_margins(verdict).items())

    def _laid(self, survey: Survey, layout: SurveyLayout, what: str) -> tuple[Verdict, Mission, float] | None:
        """A layout that passes; None where it does not."""
        mission = with_layout(self._setup.mission, self._setup.route, survey, layout, self._setup.scenario.origin)
        flown = None if mission is None else self._fly(mission, self._airframe, what)
        return None if mission is None or flown is None or not self._passes(flown[0]) else (flown[0], mission, flown[1])

    def turn_around(self, survey: Survey) -> SurveyRemedy | None:
        """The least turn-around that passes, of those longer than the survey's."""
        now = turn_around_of(self._setup.route, survey)
        found = self._least(survey, 1, [one for one in TURN_AROUNDS if one > now + 1.0])
        return None if found is None else SurveyRemedy("turn-around", "", now, found[0], "m", *found[1], found[0])

    def side(self, survey: Survey) -> SurveyRemedy | None:
        """The lines from the other side, which turns into the wind where it was turned with it."""
        if self._setup.scenario.wind.speed <= 0.0:
            return None
        now = turn_around_of(self._setup.route, survey)
        passed = self._laid(survey, SurveyLayout(now, backwards=True), "the lines from the other side")
        return None if passed is None else SurveyRemedy("side", "", 0.0, 1.0, "", *passed, now)

    def every(self, survey: Survey, at_most: float) -> SurveyRemedy | None:
        """The least number of lines to go on by, with turn-arounds shorter than these (m) that pass with it."""
        now = turn_around_of(self._setup.route, survey)
        tried = [now, *(one for one in TURN_AROUNDS if now + 1.0 < one < at_most)]
        for every in EVERY:
            if 2 * every > len(survey.lines):
                break
            found = self._least(survey, every, tried)
            if found is not None:
                return SurveyRemedy("every", "", 1.0, float(every), "lines", *found[1], found[0])
        return None

    def _least(
        self, survey: Survey, every: int, tried: Sequence[float]
    ) -> tuple[float, tuple[Verdict, Mission, float]] | None:
        """The least of some rising turn-arounds (m) that passes, found by halves; None where the longest fails."""
        if not tried:
            return None

        def laid(metres: float) -> tuple[Verdict, Mission, float] | None:
            order = "" if every == 1 else f"every {nth(every)} line, "
            return self._laid(survey, SurveyLayout(metres, every), f"{order}turn-arounds of {metres:.0f} m")

        low, high = -1, len(tried) - 1
        best = laid(tried[high])
        if best is None:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            passed = laid(tried[middle])
            if passed is None:
                low = middle
            else:
                high, best = middle, passed
        return tried[high], best

    def course(self, survey: Survey) -> SurveyRemedy | None:
        """Lines along the wind, or across it, whichever they are not; the shorter way of those that pass."""
        wind = self._setup.scenario.wind
        if wind.speed <= 0.0:
            return None
        now, found = turn_around_of(self._setup.route, survey), []
        for course in _other_courses(survey.course, wind.from_course):
            degrees = math.degrees(course) % 180.0
            passed = self._laid(survey, SurveyLayout(now, 1, course), f"lines on course {degrees:.0f}°")
            if passed is not None:
                was = math.degrees(survey.course) % 180.0
                found.append(SurveyRemedy("course", "", was, degrees, "deg", *passed, now))
        return min(found, key=lambda one: one.length, default=None)

    def parameter(self) -> SurveyRemedy | None:
        """The autopilot's parameter of which another value passes."""
        mission, flown = self._setup.mission, {}

        def passes(law: Autopilot) -> bool:
            airframe = replace(self._airframe, autopilot=law)
            one = self._fly(mission, airframe, "another parameter of the autopilot")
            if one is None or not self._passes(one[0]):
                return False
            flown["last"] = one
            return True

        found = deciding_parameter(self._airframe.autopilot, self._verdict.findings, passes)
        if found is None:
            return None
        verdict, length = flown["last"]
        return SurveyRemedy("parameter", found.name, found.current, found.passing, found.unit, verdict, mission, length)

    def airspeed(self) -> SurveyRemedy | None:
        """The fastest slower airspeed that passes, of a mission that sets none itself."""
        mission, now = self._setup.mission, self._airframe.airspeed
        if any(item.command == Command.DO_CHANGE_SPEED for item in mission.items):
            return None
        slowest = _ABOVE_SLOWEST * self._airframe.aircraft.airspeed_min
        for speed in (round(2.0 * share * now) / 2.0 for share in SLOWER):
            if speed < slowest:
                break
            try:
                airframe = load_airframe(with_flight(self._setup.scenario, airspeed_mps=speed))
            except PlanflyError:
                continue
            flown = self._fly(mission, airframe, f"{speed:g} m/s")
            if flown is not None and self._passes(flown[0]):
                return SurveyRemedy("airspeed", "", now, speed, "m/s", flown[0], mission, flown[1])
        return None


def nth(count: int) -> str:
    """A number's ordinal, in words.

    >>> nth(2), nth(5)
    ('second', '5th')
    """
    return {2: "second", 3: "third", 4: "fourth"}.get(count, f"{count}th")


def _other_courses(course: float, wind: float) -> Iterator[float]:
    """Along the wind and across it, but for what the lines are within 15 degrees of."""
    for other in (wind, wind + 0.5 * math.pi):
        if abs(math.sin(other - course)) > math.sin(math.radians(15.0)):
            yield other
