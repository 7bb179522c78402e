"""Find remedies for surveys with photo lines that cannot be flown; each remedy is flown before it is suggested."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeGuard

from flight.autopilots.autopilot import Autopilot
from flight.mission.items import Command, Mission, MissionItem
from flight.mission.placing import place_stops
from flight.mission.survey_layout import SurveyLayout, kept_layout, turn_around_of, with_layout
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import surveys_of
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.trials import least_change
from logs.verdict.verdict import Verdict
from planfly.workflow.airframe import Airframe, load_airframe
from planfly.workflow.open_flight import make_setup
from planfly.workflow.reference_flights import deciding_parameter
from planfly.workflow.trial_flight import Trial
from world.errors import PlanflyError
from world.scenario import with_flight

RemedyKind = Literal["side", "turn-around", "every", "course", "parameter", "airspeed"]

# Turn-arounds that are tried, m.
TURN_AROUNDS = (25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 175.0, 200.0, 250.0, 300.0, 350.0, 400.0)
# Interleave strides n that are tried, with which every n-th line is flown first.
INTERLEAVE_STRIDES = (2, 3, 4)
# Fractions of the airspeed that are tried.
AIRSPEED_FACTORS = (0.95, 0.9, 0.85, 0.8, 0.7)
# Minimum airspeed that is tried, as a ratio to the minimum airspeed of the aircraft.
_MIN_AIRSPEED_RATIO = 1.1


@dataclass(frozen=True, slots=True)
class SurveyRemedy:
    """Change of a survey with which it was flown and passed.

    kind: what is changed.  name: the name of the parameter, if one is changed.
    current, value: turn-around in m, interleave stride (fly every n-th line), course in degrees, value of the
    parameter, or airspeed in m/s.
    unit: unit of both.
    verdict: verdict on the flight.
    mission: the mission as it was flown.
    length: length of its route, m.
    turn_around: turn-around of the layout, or flown in addition to a parameter or an airspeed, m; NaN if unchanged.
    lead_in: distance before the first line, if longer than the turn-around, m.
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


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Change that was flown and did not pass, with the most usable lines.

    what: the change, in words.
    usable, lines: usable photo lines and all photo lines.
    verdict: verdict on the flight.
    """

    what: str
    usable: int
    lines: int
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class TriedRemedies:
    """Result of the trials: the changes with which all lines can be used.

    nearest: the best change that did not pass, if none passed; None if none was better than the mission itself.
    kept: why no other layout was tried, in words; "" if layouts were tried.
    """

    remedies: tuple[SurveyRemedy, ...] = ()
    nearest: NearMiss | None = None
    kept: str = ""


def survey_remedies(
    setup: FlightSetup, airframe: Airframe, verdict: Verdict, on_trial: Callable[[str], None] = lambda _: None
) -> TriedRemedies:
    """Find single changes with which all photo lines can be flown, and return the smallest change of each kind.

    If no single change is enough, try turn-arounds with a parameter of the autopilot half way to its farthest value, or
    with a lower airspeed: at most four flights for each of about five changes.

    verdict: verdict on the flight of the setup.  on_trial: called before each flight with a description of the change.
    A change passes if no photo line fails, and no other rule fails that did not fail before.
    """
    if _all_lines_usable(verdict) or not surveys_of(setup):
        return TriedRemedies()
    tried = _Trials(setup, airframe, verdict, on_trial)
    longer = tried.turn_around()
    found = [
        tried.side(),
        longer,
        tried.every(math.inf if longer is None else longer.value),
        tried.course(),
        tried.parameter(),
        tried.airspeed() or tried.mission_airspeed(),
    ]
    if not any(found):
        found.append(tried.parameter_and_turn_around() or tried.airspeed_and_turn_around())
    remedies = tuple(one for one in found if one is not None)
    return TriedRemedies(remedies, None if remedies else tried.nearest, tried.kept)


def _worst_margins(verdict: Verdict) -> dict[str, float]:
    """Return the minimum margin of each rule that fails; -inf if a failure has no margin."""
    worst: dict[str, float] = {}
    for item in verdict.findings:
        if item.ok is False:
            margin = -math.inf if item.margin is None else item.margin
            worst[item.rule] = min(margin, worst.get(item.rule, math.inf))
    return worst


def _count_usable(verdict: Verdict) -> tuple[int, int]:
    """Return the number of photo lines that a verdict finds usable, and the number of all photo lines."""
    lines = [item.ok for item in verdict.findings if item.rule == "survey" and not item.check]
    return sum(ok is True for ok in lines), len(lines)


def _all_lines_usable(verdict: Verdict) -> bool:
    """Return True if all photo lines are usable and their photos overlap."""
    usable, lines = _count_usable(verdict)
    return 0 < lines == usable and not any(item.rule == "survey" and item.ok is False for item in verdict.findings)


# Verdict on a flight, the mission that was flown, and the length of its path, m.
_FlownMission = tuple[Verdict, Mission, float]


class _Trials:
    """Trial flights of one mission with one change at a time.

    Surveys that lost lines are laid out again, all with the same change.
    """

    def __init__(
        self, setup: FlightSetup, airframe: Airframe, verdict: Verdict, on_trial: Callable[[str], None]
    ) -> None:
        self._setup, self._airframe, self._on_trial = setup, airframe, on_trial
        self._worst, self._verdict, self._changed = _worst_margins(verdict), verdict, ""
        lost = {item.place.index for item in verdict.findings if item.rule == "survey" and item.ok is not True}
        found = surveys_of(setup)
        self._numbers = [n for n, one in enumerate(found) if not lost.isdisjoint(range(one.first, one.last))]
        self._surveys = [found[n] for n in self._numbers]
        self._now = min(turn_around_of(setup.route, one) for one in self._surveys)
        kept = (kept_layout(setup.mission, setup.route, one) for one in self._surveys)
        self.kept = next((why for why in kept if why), "")
        self.nearest: NearMiss | None = None

    # ------------------------------------------------------------------
    # One flight.

    def _changed_setup(self, mission: Mission, airframe: Airframe) -> FlightSetup:
        """Return the setup of a changed mission; vertical legs are accepted, as in the original mission."""
        scenario = self._setup.scenario
        placed = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)
        return make_setup(scenario, airframe, mission, self._setup.seed, placed=placed)

    def _fly(self, mission: Mission, airframe: Airframe, what: str) -> _FlownMission | None:
        """Fly a mission; return None if it has no valid route."""
        what = self._changed + what
        self._on_trial(what)
        try:
            trial = Trial(self._changed_setup(mission, airframe), airframe.aircraft)
        except PlanflyError:
            return None
        usable, lines = _count_usable(trial.flight_verdict)
        best, failed = self.nearest, len(trial.flight_verdict.failed)
        before = _count_usable(self._verdict)[0] if best is None else best.usable
        if usable > before or (best is not None and usable == before and failed < len(best.verdict.failed)):
            self.nearest = NearMiss(what, usable, lines, trial.flight_verdict)
        return trial.flight_verdict, mission, trial.setup.path.length

    def _fly_layout(self, layout: SurveyLayout, what: str) -> _FlownMission | None:
        """Fly the surveys in another layout; return None if that layout cannot be made."""
        mission, setup = self._setup.mission, self._setup
        # Start with the last survey, because a changed survey may be detected as two, which renumbers later surveys.
        for number in reversed(self._numbers):
            survey = surveys_of(setup)[number]
            made = with_layout(mission, setup.route, survey, layout, self._setup.scenario.origin)
            if made is None:
                return None
            mission = made
            try:
                setup = self._changed_setup(mission, self._airframe)
            except PlanflyError:
                return None
        return self._fly(mission, self._airframe, what)

    def _passes(self, flown: _FlownMission | None) -> TypeGuard[_FlownMission]:
        """Return True if all lines are usable, no other rule fails than before, and no failure is noticeably worse."""
        return (
            flown is not None
            and _all_lines_usable(flown[0])
            and all(
                rule in self._worst and worst >= self._worst[rule] - (RULE_WORDS[rule].scale or math.inf)
                for rule, worst in _worst_margins(flown[0]).items()
            )
        )

    # ------------------------------------------------------------------
    # The remedies, one change each.

    def turn_around(self) -> SurveyRemedy | None:
        """Find the shortest turn-around that passes, among those longer than the current one."""
        return self._shortest_turn_around(1, [one for one in TURN_AROUNDS if one > self._now + 1.0], 0.0)

    def side(self) -> SurveyRemedy | None:
        """Try to fly the lines from the other side, so that turns are into the wind."""
        if self._setup.scenario.wind.speed <= 0.0:
            return None
        flown = self._fly_layout(SurveyLayout(self._now, backwards=True), "the lines from the other side")
        return SurveyRemedy("side", "", 0.0, 1.0, "", *flown, self._now) if self._passes(flown) else None

    def every(self, at_most: float) -> SurveyRemedy | None:
        """Find the smallest interleave stride that passes, with turn-arounds shorter than `at_most`, m.

        The lead-in to the first line is `at_most`, the turn-around that passes without interleaving.
        """
        lead_in = at_most if math.isfinite(at_most) else 0.0
        tried = [self._now, *(one for one in TURN_AROUNDS if self._now + 1.0 < one < at_most)]
        most = max(len(survey.lines) for survey in self._surveys)
        found = (self._shortest_turn_around(every, tried, lead_in) for every in INTERLEAVE_STRIDES if 2 * every <= most)
        return next((one for one in found if one is not None), None)

    def _shortest_turn_around(self, every: int, tried: Sequence[float], lead_in: float) -> SurveyRemedy | None:
        """Bisect increasing turn-arounds, m, for the shortest that makes all lines usable; return it if it passes.

        A turn-around with which the flight runs out of energy before its end is too long.
        """
        order = "" if every == 1 else f"every {nth(every)} line, "
        flights: dict[float, _FlownMission | None] = {}

        def long_enough(metres: float) -> bool:
            layout = SurveyLayout(metres, every, lead_in=lead_in)
            flown = flights[metres] = self._fly_layout(layout, f"{order}turn-arounds of {metres:.0f} m")
            if flown is None:
                return False
            too_long = {"completion", "energy"} <= _worst_margins(flown[0]).keys() - self._worst.keys()
            return too_long or _all_lines_usable(flown[0])

        least = least_change(tried, long_enough)
        flown = None if least is None else flights[least]
        if least is None or not self._passes(flown):
            return None
        if every == 1:
            return SurveyRemedy("turn-around", "", self._now, least, "m", *flown, least)
        return SurveyRemedy("every", "", 1.0, float(every), "lines", *flown, least, lead_in)

    def course(self) -> SurveyRemedy | None:
        """Try lines along and across the wind; return the shortest route that passes."""
        wind = self._setup.scenario.wind
        if wind.speed <= 0.0:
            return None
        now, found = self._surveys[0].course, []
        for course in _other_courses(now, wind.from_course):
            was, degrees = (math.degrees(one) % 180.0 for one in (now, course))
            flown = self._fly_layout(SurveyLayout(self._now, 1, course), f"lines on course {degrees:.0f}°")
            if self._passes(flown):
                found.append(SurveyRemedy("course", "", was, degrees, "deg", *flown, self._now))
        return min(found, key=lambda one: one.length, default=None)

    def parameter(self) -> SurveyRemedy | None:
        """Find an autopilot parameter with which another value passes."""
        passed: list[_FlownMission] = []

        def passes(law: Autopilot) -> bool:
            airframe = replace(self._airframe, autopilot=law)
            flown = self._fly(self._setup.mission, airframe, "another parameter of the autopilot")
            if self._passes(flown):
                passed.append(flown)
            return self._passes(flown)

        found = deciding_parameter(self._airframe.autopilot, self._verdict.findings, passes)
        if found is None:
            return None
        return SurveyRemedy("parameter", found.name, found.current, found.passing, found.unit, *passed[-1])

    def airspeed(self) -> SurveyRemedy | None:
        """Find the highest reduced airspeed that passes, for a mission that sets no airspeed itself."""
        for speed, airframe in self._slower_airspeeds():
            flown = self._fly(self._setup.mission, airframe, f"{speed:g} m/s")
            if self._passes(flown):
                return SurveyRemedy("airspeed", "", self._airframe.airspeed, speed, "m/s", *flown)
        return None

    # ------------------------------------------------------------------
    # Two changes together.

    def _turn_around_with(
        self, changed: str, airframe: Airframe, mission: Mission | None = None
    ) -> SurveyRemedy | None:
        """Find the shortest turn-around that passes in combination with another change."""
        other = copy(self)
        other._airframe, other._changed = airframe, f"{changed}, "
        if mission is not None:
            other._setup = replace(self._setup, mission=mission)
        found = other.turn_around()
        self.nearest = other.nearest
        return found

    def parameter_and_turn_around(self) -> SurveyRemedy | None:
        """Try each parameter of the autopilot half way to its farthest value, with longer turn-arounds."""
        law = self._airframe.autopilot
        values = {} if law.parameters is None else {one.name: one.value for one in law.parameters.values}
        for name, step, far, unit, _ in law.side_candidates if values else ():
            current = values[name]
            value = round(current + math.copysign(step, far - current) * (abs(far - current) // (2.0 * step)), 6)
            if value == current:
                continue
            airframe = replace(self._airframe, autopilot=law.with_parameters(**{name: value}))
            found = self._turn_around_with(f"{name} {value:g}", airframe)
            if found is not None:
                return replace(found, kind="parameter", name=name, current=current, value=value, unit=unit)
        return None

    def airspeed_and_turn_around(self) -> SurveyRemedy | None:
        """Try the lowest of the slower airspeeds with longer turn-arounds."""
        for speed, airframe in [*self._slower_airspeeds()][-1:]:
            found = self._turn_around_with(f"{speed:g} m/s", airframe)
            if found is not None:
                return replace(found, kind="airspeed", current=self._airframe.airspeed, value=speed, unit="m/s")
        return None

    def mission_airspeed(self) -> SurveyRemedy | None:
        """Try the default airspeed with longer turn-arounds, if the mission sets less than the minimum."""
        mission, own = self._setup.mission, self._airframe.airspeed
        slow = [item for item in mission.items if 0.0 < _set_airspeed(item) < self._airframe.aircraft.airspeed_min]
        if not slow:
            return None
        items = tuple(
            replace(item, params=(item.params[0], own, *item.params[2:])) if item in slow else item
            for item in mission.items
        )
        found = self._turn_around_with(f"{own:g} m/s", self._airframe, replace(mission, items=items))
        if found is None:
            return None
        return replace(found, kind="airspeed", current=min(map(_set_airspeed, slow)), value=own, unit="m/s")

    def _slower_airspeeds(self) -> Iterator[tuple[float, Airframe]]:
        """Yield reduced airspeeds, m/s, and airframes, the fastest first; nothing if the mission sets an airspeed."""
        if any(item.command == Command.DO_CHANGE_SPEED for item in self._setup.mission.items):
            return
        slowest = _MIN_AIRSPEED_RATIO * self._airframe.aircraft.airspeed_min
        for speed in (round(2.0 * share * self._airframe.airspeed) / 2.0 for share in AIRSPEED_FACTORS):
            if speed < slowest:
                break
            with suppress(PlanflyError):
                yield speed, load_airframe(with_flight(self._setup.scenario, airspeed_mps=speed))


def nth(count: int) -> str:
    """Return the ordinal of a number as a word.

    >>> nth(2), nth(5)
    ('second', '5th')
    """
    return {2: "second", 3: "third", 4: "fourth"}.get(count, f"{count}th")


def _set_airspeed(item: MissionItem) -> float:
    """Return the airspeed that an item sets, m/s; 0 for other items, NaN or negative if the item sets no airspeed."""
    return item.params[1] if item.command == Command.DO_CHANGE_SPEED else 0.0


def _other_courses(course: float, wind: float) -> Iterator[float]:
    """Yield the courses along and across the wind that differ by more than 15 degrees from the current course."""
    for other in (wind, wind + 0.5 * math.pi):
        if abs(math.sin(other - course)) > math.sin(math.radians(15.0)):
            yield other
