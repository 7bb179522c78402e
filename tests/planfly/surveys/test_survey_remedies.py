"""What would help a survey, found among flights that pass or fail by a rule of the test's own."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flight.mission.items import Camera, Command, Mission
from flight.mission.survey_layout import min_turn_around
from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import corridor_line
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures import route_requirements
from logs.verdict.measures.photo_lines import OverlapMeasure
from logs.verdict.measures.route_requirements import judged_surveys
from logs.verdict.places import FLIGHT, Place
from logs.verdict.verdict import Verdict
from planfly.surveys import survey_remedies as remedies
from planfly.surveys.survey_remedies import TriedRemedies
from planfly.surveys.survey_text import near_miss_text, remedy_text
from planfly.terminal.survey_answers import survey_remedy_entry
from planfly.workflow.open_flight import open_flight
from planfly.workflow.uav import uav_of_setup
from tests.mission_lines import mission, wp

FIELD = Path(__file__).parents[1] / "commands" / "field.waypoints"
# Whether lines can be used, and what else fails with what margin, of a flight with these turn-arounds, m.
Answer = Callable[[float], tuple[bool, dict[str, float]]]


def verdict_of(setup: FlightSetup, answer: Answer) -> Verdict:
    [survey] = judged_surveys(setup)
    usable, failed = answer(min_turn_around(setup.route, survey))
    findings: list[Finding] = [
        make_finding("survey", Place("leg", line.first), ok=usable, reason="", flown=90.0, limit=95.0, margin=-5.0)
        for line in survey.lines
    ]
    findings += [make_finding(rule, FLIGHT, ok=False, reason="", margin=margin) for rule, margin in failed.items()]
    flyable = usable and not failed
    return Verdict(
        tuple(findings), flyable=flyable, complete=True, lines=(f"fails by {sorted(failed)}",), level="flown"
    )


@dataclass
class Flights:
    """Flies by a test, and keeps the turn-arounds that it flew."""

    answer: Answer
    flown: list[float] = field(default_factory=list)

    def __call__(self, setup: FlightSetup, *_: Any) -> Any:
        self.flown.append(round(min_turn_around(setup.route, judged_surveys(setup)[0])))
        return SimpleNamespace(setup=setup, flight_verdict=verdict_of(setup, self.answer))


def opened(path: Path) -> FlightSetup:
    return open_flight(path, {"aircraft": "x8", "autopilot": "ardupilot"})


def tried(monkeypatch: pytest.MonkeyPatch, answer: Answer, path: Path = FIELD) -> tuple[TriedRemedies, list[float]]:
    flights, mission = Flights(answer), opened(path)
    monkeypatch.setattr(remedies, "Trial", flights)
    found = remedies.find_survey_remedies(mission, uav_of_setup(mission), verdict_of(mission, answer))
    return found, flights.flown


def test_the_least_turn_around_that_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    found, flown = tried(monkeypatch, lambda metres: (metres >= 130.0, {}))
    [longer] = found.remedies
    assert (longer.kind, longer.current, longer.value, longer.turn_around) == ("turn-around", 0.0, 150.0, 150.0)
    # By halves of the twelve.
    assert flown[:4] == [150.0, 75.0, 100.0, 125.0]
    assert found.nearest is None


def test_every_second_line_is_come_to_as_all_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first line needs 130 m whatever the others need, which lie further from each other."""

    def answer(metres: float) -> tuple[bool, dict[str, float]]:
        return metres >= 130.0, {}

    flights, mission = Flights(answer), opened(FIELD)

    def fly(setup: FlightSetup, *rest: Any) -> Any:
        [survey] = judged_surveys(setup)
        first = survey.lines[0]
        lead_in = math.dist(setup.route.positions[first.begins], setup.route.positions[first.first])
        if abs(survey.offsets[1]) > 100.0 and lead_in >= 130.0:
            flights.answer = lambda metres: (metres >= 45.0, {})
        found = flights(setup, *rest)
        flights.answer = answer
        return found

    monkeypatch.setattr(remedies, "Trial", fly)
    found = remedies.find_survey_remedies(mission, uav_of_setup(mission), verdict_of(mission, answer))
    longer, second = found.remedies
    assert (longer.kind, longer.value, longer.lead_in) == ("turn-around", 150.0, 0.0)
    assert (second.kind, second.value, second.turn_around, second.lead_in) == ("every", 2.0, 50.0, 150.0)
    assert remedy_text(second, 5000.0).startswith(
        "every second line first, with turn-arounds of 50 m and 150 m onto the first; all lines could be used"
    )


def test_one_with_which_the_battery_does_not_last_is_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then lines are not flown at all: that says nothing against shorter ones."""

    def answer(metres: float) -> tuple[bool, dict[str, float]]:
        return 190.0 <= metres <= 225.0, {} if metres <= 225.0 else {"energy": -3.0, "completion": -9.0}

    found, flown = tried(monkeypatch, answer)
    assert [(one.kind, one.value) for one in found.remedies] == [("turn-around", 200.0)]
    assert flown[:4] == [150.0, 250.0, 175.0, 200.0]


def test_a_flight_that_ends_early_by_another_fault_says_nothing_of_longer_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that misses the end of its way with short turn-arounds has energy left for longer ones."""

    def answer(metres: float) -> tuple[bool, dict[str, float]]:
        return metres >= 290.0, {"completion": -9.0} if 20.0 < metres < 290.0 else {}

    found, flown = tried(monkeypatch, answer)
    assert [(one.kind, one.value) for one in found.remedies] == [("turn-around", 300.0)]
    assert flown[:4] == [150.0, 250.0, 350.0, 300.0]


def judged_by(
    monkeypatch: pytest.MonkeyPatch, passes: Callable[[FlightSetup, float], bool], path: Path = FIELD
) -> TriedRemedies:
    """What helps where a rule looks at all of a flight, and at its turn-arounds, m."""

    def fly(setup: FlightSetup, *_: Any) -> Any:
        return SimpleNamespace(
            setup=setup, flight_verdict=verdict_of(setup, lambda metres: (passes(setup, metres), {}))
        )

    mission = opened(path)
    monkeypatch.setattr(remedies, "Trial", fly)
    return remedies.find_survey_remedies(mission, uav_of_setup(mission), verdict_of(mission, lambda _: (False, {})))


def test_where_nothing_alone_helps_two_changes_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither ROLL_LIMIT_DEG, up to 60, nor turn-arounds alone pass; the least pair of the tried ones is found."""

    def passes(setup: FlightSetup, metres: float) -> bool:
        own = setup.autopilot.parameters
        assert own is not None
        return metres >= 130.0 and next(one.value for one in own.values if one.name == "ROLL_LIMIT_DEG") >= 45.0

    [both] = judged_by(monkeypatch, passes).remedies
    assert (both.kind, both.name, both.current, both.value) == ("parameter", "ROLL_LIMIT_DEG", 35.0, 45.0)
    assert both.turn_around == 150.0
    assert remedy_text(both, 3000.0).startswith(
        "ROLL_LIMIT_DEG 45 instead of 35 (--params), with turn-arounds of 150 m; "
    )


def test_a_slower_flight_with_longer_turn_arounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """The x8 cruises at 18 m/s; the lowest that is tried is a tenth above its slowest of 12 m/s, 13.2 m/s."""
    [both] = judged_by(monkeypatch, lambda setup, m: m >= 130.0 and setup.route.leg_airspeeds[0] < 17.0).remedies
    assert (both.kind, both.current, both.value, both.turn_around) == ("airspeed", 18.0, 13.2, 150.0)
    assert "13.2 m/s instead of 18 m/s (DO_CHANGE_SPEED), with turn-arounds of 150 m" in remedy_text(both, 3000.0)


@pytest.mark.parametrize("needed_turn_around", [0.0, 130.0])
def test_a_suggested_airspeed_is_written_into_the_mission(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, needed_turn_around: float
) -> None:
    """The written file, opened with the same options, is flown at the airspeeds of the trial that passed."""
    trials: list[FlightSetup] = []

    def passes(setup: FlightSetup, metres: float) -> bool:
        trials.append(setup)
        survey = judged_surveys(setup)[0]
        return metres >= needed_turn_around and max(setup.route.leg_airspeeds[survey.first : survey.last]) < 17.0

    remedy = judged_by(monkeypatch, passes).remedies[-1]
    assert remedy.kind == "airspeed"
    for kind in ("waypoints", "plan"):
        file = tmp_path / f"airspeed.{kind}"
        file.write_text(mission_text(remedy.mission, "plan" if kind == "plan" else "waypoints"), encoding="utf-8")
        again = opened(file)
        trial = next(each for each in trials if each.mission == remedy.mission)
        assert again.route.leg_airspeeds.tolist() == trial.route.leg_airspeeds.tolist()
        assert passes(again, min_turn_around(again.route, judged_surveys(again)[0]))


@pytest.mark.parametrize(
    ("flown_mps", "autopilot", "speed"), [(22.0, "planfly", 15.5), (22.0, "ardupilot", 15.5), (26.0, "planfly", 13.2)]
)
def test_the_airspeed_for_a_slow_camera_follows_from_its_ground_speed(
    monkeypatch: pytest.MonkeyPatch, flown_mps: float, autopilot: str, speed: float
) -> None:
    """At 100 m a photo of 100 m along that overlaps by 75 % - 10 % leaves 35 m: at one per 1.75 s, 20 m/s.

    Of 22 m/s over ground 2.4 m/s are too much, with 2 % in reserve, and of 26 m/s 6.4 m/s: the x8 cruises at 18 m/s,
    and the lowest that is tried is 13.2 m/s.  On the ground's 500 m ArduPlane's airspeeds are 3 % less than true.
    """
    camera = Camera(1.0, 1.0, 0.75, 0.65, 1.75)
    front = 1.0 - 1.75 * flown_mps / 100.0
    measure = OverlapMeasure(camera, front, 0, 1.75 * flown_mps, 100.0, True)
    setup = open_flight(FIELD, {"aircraft": "x8", "autopilot": autopilot})
    flown: list[float] = []

    def fly(setup: FlightSetup, *_: Any) -> Any:
        flown.append(float(setup.route.leg_airspeeds[0]))
        verdict = verdict_of(setup, lambda _: (True, {}))
        at = max(flown[-1], 13.2)
        margin = 65.0 - 10.0 * at
        place = Place("leg", judged_surveys(setup)[0].first)
        overlap = make_finding("survey", place, ok=False, reason="", margin=margin, check="front overlap")
        return SimpleNamespace(setup=setup, flight_verdict=replace(verdict, findings=(*verdict.findings, overlap)))

    monkeypatch.setattr(remedies, "Trial", fly)
    verdict = fly(setup).flight_verdict
    found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict, overlaps=(measure,))
    slower = [each for each in flown if each < 18.0]
    assert slower[0] == pytest.approx(speed, abs=0.11)
    assert min(slower) == 13.2
    # No airspeed passes: the lowest comes closest.
    assert found.remedies == ()
    assert found.nearest is not None
    assert found.nearest.what == "13.2 m/s"


def test_a_mission_slower_than_the_aircraft_flies_is_made_faster(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A multicopter's 2 m/s; the 16 m/s further on the aircraft can fly."""
    rows = FIELD.read_text(encoding="ascii").splitlines()
    rows.insert(2, "1\t0\t2\t178\t0\t2\t-1\t0\t0\t0\t0\t1")
    rows.append("20\t0\t2\t178\t0\t16\t-1\t0\t0\t0\t0\t1")
    path = tmp_path / "slow.waypoints"
    path.write_text(
        "\n".join("\t".join([str(k), *row.split("\t")[1:]]) if k >= 0 else row for k, row in enumerate(rows, -1))
        + "\n",
        encoding="ascii",
    )

    def speeds(mission: Mission) -> list[float]:
        return [item.params[1] for item in mission.items if item.command == Command.DO_CHANGE_SPEED]

    found = judged_by(monkeypatch, lambda setup, metres: metres >= 130.0 and speeds(setup.mission)[0] > 10.0, path)
    [faster] = found.remedies
    assert (faster.kind, faster.current, faster.value, faster.turn_around) == ("airspeed", 2.0, 18.0, 150.0)
    assert speeds(faster.mission) == [18.0, 16.0]
    assert "18 m/s instead of 2 m/s (DO_CHANGE_SPEED), with turn-arounds of 150 m" in remedy_text(faster, 3000.0)


def test_nearest_trial_is_the_one_that_makes_more_of_each_line_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    """No line is usable in any trial, and 350 m leave 92 % of each line instead of 90 %: the closest attempt."""

    def fly(setup: FlightSetup, *_: Any) -> Any:
        verdict = verdict_of(setup, lambda _: (False, {}))
        if round(min_turn_around(setup.route, judged_surveys(setup)[0])) == 350:
            verdict = replace(verdict, findings=tuple(replace(finding, flown=92.0) for finding in verdict.findings))
        return SimpleNamespace(setup=setup, flight_verdict=verdict)

    mission = opened(FIELD)
    monkeypatch.setattr(remedies, "Trial", fly)
    found = remedies.find_survey_remedies(mission, uav_of_setup(mission), verdict_of(mission, lambda _: (False, {})))
    assert found.nearest is not None
    assert "0 of 4 photo lines can be used, the worst one to 92 % of its length" in near_miss_text(found.nearest)
    assert found.nearest.what == "turn-arounds of 350 m"


def test_a_trial_in_which_no_survey_is_found_has_no_usable_line() -> None:
    verdict = Verdict((), flyable=False, complete=True, lines=("not flyable",), level="flown")
    near_miss = remedies.NearMiss("lines on course 90°", 0, 0, verdict)
    assert "0 of 0 photo lines can be used, the worst one to 0 % of its length" in near_miss_text(near_miss)


def test_what_comes_nearest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = tried(monkeypatch, lambda metres: (metres >= 180.0, {"energy": -3.0} if metres > 20.0 else {}))
    assert found.remedies == ()
    assert found.nearest is not None
    assert (found.nearest.usable, found.nearest.lines) == (4, 4)
    assert (found.nearest.what, found.nearest.verdict.headline) == ("turn-arounds of 250 m", "fails by ['energy']")


@pytest.mark.parametrize(("margin", "passes"), [(-31.0, True), (-33.0, False)])
def test_what_failed_before_may_fail_as_much(monkeypatch: pytest.MonkeyPatch, margin: float, passes: bool) -> None:
    """By 22 m before; ten metres of a corridor are what a person would notice."""
    found, _ = tried(monkeypatch, lambda metres: (metres > 0.0, {"corridor": margin if metres > 0.0 else -22.0}))
    assert bool(found.remedies) is passes
    # What did not fail before may not at all.
    found, _ = tried(monkeypatch, lambda metres: (metres > 0.0, {"corridor": -0.1} if metres > 0.0 else {}))
    assert found.remedies == ()


def test_why_no_other_layout_was_tried(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A change of speed between two lines would be lost."""
    rows = FIELD.read_text(encoding="ascii").splitlines()
    speed = "6\t0\t2\t178\t0\t17\t-1\t0\t0\t0\t0\t1"
    at = next(k for k, row in enumerate(rows) if row.startswith("6\t"))
    # Behind a waypoint it goes with the line: between the two of a turn-around it is its own.
    lead = rows[at].replace("6\t", "5\t", 1).replace("47.30449915415902", "47.3054")
    path = tmp_path / "a.waypoints"
    path.write_text("\n".join([*rows[:at], lead, speed, *rows[at:]]) + "\n", encoding="ascii")
    found, flown = tried(monkeypatch, lambda metres: (False, {}), path)
    assert found.kept == "item 7, DO_CHANGE_SPEED, lies between two lines"
    assert set(flown) <= {0.0}


def test_the_surveys_of_a_setup_are_searched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Requirements, summary and remedies ask for them; another setup has its own."""
    searches = []
    search = route_requirements.find_surveys
    monkeypatch.setattr(route_requirements, "find_surveys", lambda *args: searches.append(args) or search(*args))
    setup = opened(FIELD)
    found = route_requirements.route_requirements(setup).surveys
    assert corridor_line(setup, ()) == ""
    assert judged_surveys(setup) is found
    assert len(searches) == 1
    assert judged_surveys(opened(FIELD)) == found
    assert len(searches) == 2


def survey_file(folder: Path, lead: float) -> Path:
    """Write a survey of three lines of 1 km, 100 m apart, with leads of a length (m) and photos every 50 m."""
    lines = []
    for k in range(3):
        north = [-lead, 0.0, 1000.0, 1000.0 + lead][:: 1 if k % 2 == 0 else -1]
        points = [wp(100.0 * k, value, 100.0) for value in north]
        lines += [*points[:2], "2 206 50 0 1 0 0 0 0", points[2], "2 206 0 0 1 0 0 0 0", points[3]]
    file = folder / "gated.waypoints"
    file.write_text(mission_text(mission(*lines), "waypoints"), encoding="ascii")
    return file


def test_gates_at_the_ends_of_lines_that_lose_their_photos_to_the_acceptance_radius(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Three lines of 1 km with leads of 300 m: PX4 flies past gates, and ArduPlane knows none."""
    file = survey_file(tmp_path, lead=300.0)
    flown: list[Mission] = []

    def fly(setup: FlightSetup, *_: Any) -> Any:
        flown.append(setup.mission)
        gates = [item.seq for item in setup.mission.items if item.command == Command.CONDITION_GATE]
        return SimpleNamespace(setup=setup, flight_verdict=verdict_of(setup, lambda _: (len(gates) == 6, {})))

    monkeypatch.setattr(remedies, "Trial", fly)
    for autopilot, kinds in (("px4", ["gates"]), ("ardupilot", [])):
        setup = open_flight(file, {"aircraft": "x8", "autopilot": autopilot})
        verdict = verdict_of(setup, lambda _: (False, {}))
        found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict)
        assert [one.kind for one in found.remedies] == kinds
    setup = open_flight(file, {"aircraft": "x8", "autopilot": "px4"})
    found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict_of(setup, lambda _: (False, {})))
    [gated] = found.remedies
    assert [item.seq for item in gated.mission.items if item.command == Command.CONDITION_GATE] == [
        *(2, 4, 8, 10, 14, 16)
    ]
    assert remedy_text(gated, 5000.0).startswith("gates (CONDITION_GATE, a setting of QGroundControl) instead of ")


def test_gates_with_a_lower_airspeed_are_tried_together(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Three lines of 1 km with leads of 300 m: six gates pass, if the airspeed is at most 15.5 m/s of the x8's 18."""
    file = survey_file(tmp_path, lead=300.0)

    def fly(setup: FlightSetup, *_: Any) -> Any:
        gates = [item for item in setup.mission.items if item.command == Command.CONDITION_GATE]
        speeds = [item.params[1] for item in setup.mission.items if item.command == Command.DO_CHANGE_SPEED]
        passes = len(gates) == 6 and bool(speeds) and speeds[0] <= 15.5
        return SimpleNamespace(setup=setup, flight_verdict=verdict_of(setup, lambda _: (passes, {})))

    monkeypatch.setattr(remedies, "Trial", fly)
    setup = open_flight(file, {"aircraft": "x8", "autopilot": "px4"})
    found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict_of(setup, lambda _: (False, {})))
    [both] = found.remedies
    # 0.85 of 18 m/s in steps of 0.5 m/s.
    assert (both.kind, both.value, both.has_gates) == ("airspeed", 15.5, True)
    assert "15.5 m/s instead of 18 m/s (DO_CHANGE_SPEED) and gates (CONDITION_GATE) where" in remedy_text(both, 5e3)
    assert survey_remedy_entry(both).has_gates


def test_gates_with_longer_turn_arounds_are_tried_together(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Three lines of 1 km with leads of 60 m: six gates pass, if the turn-arounds are at least 110 m."""
    file = survey_file(tmp_path, lead=60.0)

    def fly(setup: FlightSetup, *_: Any) -> Any:
        gates = [item for item in setup.mission.items if item.command == Command.CONDITION_GATE]
        verdict = verdict_of(setup, lambda metres: (len(gates) == 6 and metres >= 110.0, {}))
        return SimpleNamespace(setup=setup, flight_verdict=verdict)

    monkeypatch.setattr(remedies, "Trial", fly)
    setup = open_flight(file, {"aircraft": "x8", "autopilot": "px4"})
    found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict_of(setup, lambda _: (False, {})))
    [both] = found.remedies
    assert (both.kind, both.turn_around) == ("gates", 125.0)
    assert "instead of waypoints where the camera is switched, with turn-arounds of 125 m; " in remedy_text(both, 5e3)
