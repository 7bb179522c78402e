"""Photos of a survey by their numbers: too far apart, too fast for the camera, their pixels, and their count."""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import planfly
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Camera, Command, Mission, SurveyPlan
from flight.mission.surveys import PhotoLine, camera_notes
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.photo_lines import (
    LineMeasure,
    OverlapMeasure,
    _count_photos,
    count_flight_photos,
    measure_line,
)
from logs.verdict.measures.route_requirements import judged_surveys, route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from planfly.api.surveying import SurveyResult
from planfly.surveys import survey_remedies as remedies
from planfly.surveys.survey_text import (
    camera_off_text,
    count_line_photos,
    overlap_lines,
    remedy_text,
    slow_camera_text,
)
from planfly.terminal.survey_answers import overlap_entry
from planfly.workflow.open_flight import open_flight
from planfly.workflow.uav import uav_of_setup
from tests.mission_lines import mission, setup_of, wp
from tests.synthetic import fly_path
from world.scenario_tables import Px4Version
from world.wind import Wind

# 23.5 mm by 15.6 mm behind 16 mm, 75 % and 65 % required, one photo per second, 6000 pixels across.
CAMERA = Camera(23.5 / 16.0, 15.6 / 16.0, 0.75, 0.65, 1.0, 6000.0)


def survey_of(metres: float, **plan: Any) -> Mission:
    """Three lines of 1 km, 50 m apart and 100 m above home, with a photo each so many metres."""
    items = []
    for k in range(3):
        north = [-300.0, 0.0, 1000.0, 1300.0][:: 1 if k % 2 == 0 else -1]
        points = [wp(50.0 * k, value, 100.0) for value in north]
        items += [*points[:2], f"2 206 {metres} 0 1 0 0 0 0", points[2], "2 206 0 0 1 0 0 0 0", points[3]]
    made = mission(*items)
    object.__setattr__(made, "survey_plans", (SurveyPlan(metres, 300.0, CAMERA, **plan),))
    return made


def setup_with(tmp_path: Path, made: Mission) -> FlightSetup:
    from flight.mission_files.formats import mission_text

    file = tmp_path / "a.waypoints"
    file.write_text(mission_text(made, "waypoints"), encoding="ascii")
    setup = open_flight(file, {"aircraft": "x8", "autopilot": "px4"})
    object.__setattr__(setup.mission, "survey_plans", made.survey_plans)
    return setup


def test_a_trigger_distance_for_the_required_overlap_is_tried(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A quarter of 100 m x 15.6 / 16 are 24.4 m: 24 m in the items and in the settings that name the camera."""
    setup = setup_with(tmp_path, survey_of(75.0))

    def verdict_of(flown: FlightSetup) -> Verdict:
        [survey] = judged_surveys(flown)
        ok = survey.lines[0].photo == 24.0 and flown.mission.survey_plans[0].photo == 24.0
        findings: list[Finding] = [
            make_finding("survey", Place("leg", line.first), ok=True, reason="", flown=99.0) for line in survey.lines
        ]
        place = Place("leg", survey.first)
        findings.append(make_finding("survey", place, ok=ok, reason="", margin=-30.0, check="front overlap"))
        return Verdict(tuple(findings), flyable=ok, complete=True, lines=("",), level="flown")

    def fly(flown: FlightSetup, *_: Any) -> Any:
        return SimpleNamespace(setup=flown, flight_verdict=verdict_of(flown))

    monkeypatch.setattr(remedies, "Trial", fly)
    [remedy] = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict_of(setup)).remedies
    assert (remedy.kind, remedy.current, remedy.value, remedy.unit) == ("trigger", 75.0, 24.0, "m")
    assert remedy_text(remedy, 5000.0).startswith("photos every 24 m instead of 75 m; ")
    distances = [item.params[0] for item in remedy.mission.items if item.command == Command.DO_SET_CAM_TRIGG_DIST]
    assert distances == [24.0, 0.0] * 3


def test_a_camera_that_cannot_follow_and_settings_that_contradict_the_items_are_noted(tmp_path: Path) -> None:
    """The cruise of an x8 is 18 m/s of equivalent airspeed, 18.35 m/s of true airspeed at 400 m by ISO 2533."""
    true_speed = 18.0 / math.sqrt((1.0 - 2.25577e-5 * 400.0) ** 4.25588)
    setup = setup_with(tmp_path, survey_of(10.0, stated_photo=29.25))
    factor = setup.autopilot.speeds.true_airspeed_factor
    for speed in (0.0, 5.0):
        # Every other line is flown with the wind from the south.
        ground_speed = true_speed + speed
        assert camera_notes(setup.mission, setup.route, Wind(speed, math.pi), factor) == (
            "a survey triggers the camera every 10 m, but the settings of its camera in the file state 29.25 m"
            " (AdjustedFootprintFrontal)",
            f"the camera takes one photo per 1 s; the trigger distance of 10 m requires one every"
            f" {10.0 / ground_speed:.2f} s at {ground_speed:.1f} m/s over the ground",
        )
    # One percent is rounding, and 20 m take more than a second in calm air, but not with the wind.
    setup = setup_with(tmp_path, survey_of(20.0, stated_photo=20.2))
    assert camera_notes(setup.mission, setup.route, Wind(0.0, 0.0), factor) == ()
    assert len(camera_notes(setup.mission, setup.route, Wind(5.0, math.pi), factor)) == 1


@pytest.mark.parametrize(
    ("height", "is_noted"), [(0.0, False), (99.0, False), (101.0, False), (97.0, True), (50.0, True)]
)
def test_a_height_of_the_camera_that_contradicts_the_items_is_noted(
    tmp_path: Path, height: float, is_noted: bool
) -> None:
    """All items are 100 m above home; 2 % are rounding."""
    setup = setup_with(tmp_path, survey_of(25.0, height=height))
    notes = camera_notes(setup.mission, setup.route, Wind(0.0, 0.0), setup.autopilot.speeds.true_airspeed_factor)
    text = (
        f"the camera's settings of a survey in the file state a height of {height:g} m (DistanceToSurface), but its"
        " items state 100 m"
    )
    assert notes == ((text,) if is_noted else ())


@pytest.mark.parametrize(
    ("changes", "height"),
    [
        ({"front": 0.2, "photo_spacing": 39.0, "height": 50.0}, 110.0),
        ({"side": 0.3, "line_spacing": 47.0, "side_height": 45.0}, 46.4),
        ({"front": 0.7 + 0.05, "photo_spacing": 39.0, "height": 160.0}, 0.0),
    ],
)
def test_the_height_that_overlaps_need_follows_from_the_width_of_a_photo(
    changes: dict[str, float], height: float
) -> None:
    """A photo is 15.6 / 16 of its height long: 39 m at 75 % overlap need 160 m; 23.5 / 16 wide: 47 m at 65 % 91.4 m."""
    measure = replace(OverlapMeasure(CAMERA), **changes)
    assert remedies.missing_height(measure) == pytest.approx(height, abs=0.05)


def test_higher_lines_are_tried_and_a_slow_camera_is_in_the_first_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """39 m between photos, by the camera's speed, need 160 m: 60 m more, with all waypoints of the lines."""
    setup = setup_with(tmp_path, survey_of(20.0))
    slow = replace(OverlapMeasure(CAMERA), front=0.6, line=0, photo_spacing=39.0, height=100.0, is_camera_limited=True)

    def fly(flown: FlightSetup, *_: Any) -> Any:
        [survey] = judged_surveys(flown)
        ok = flown.route.positions[survey.first, 2] == setup.route.positions[survey.first, 2] + 60.0
        lines = [make_finding("survey", Place("leg", line.first), ok=ok, reason="") for line in survey.lines]
        return SimpleNamespace(
            setup=flown, flight_verdict=Verdict((*lines,), flyable=ok, complete=True, lines=("",), level="flown")
        )

    monkeypatch.setattr(remedies, "Trial", fly)
    found = remedies.find_survey_remedies(
        setup, uav_of_setup(setup), fly(setup).flight_verdict, overlaps=[slow]
    ).remedies
    assert [(remedy.kind, remedy.value) for remedy in found] == [("height", 60.0)]
    length = found[0].length
    assert remedy_text(found[0], length) == (
        "lines 60 m higher; all lines could be used in a trial flight, and the path is as long as before"
    )
    assert remedy_text(found[0], length + 100.0).endswith(f" km long instead of {length / 1000.0 + 0.1:.1f} km")
    assert slow_camera_text(slow).endswith("one every 1 s, or 39 m")


def test_lines_that_cannot_be_as_high_as_required_are_tried_at_the_tolerance(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """39 m between photos of 15.6 / 16 of the height need 160 m for 75 %, and 114.3 m for 65 %: 60 m and 15 m more."""
    setup, climbs = setup_with(tmp_path, survey_of(20.0)), []
    low = replace(OverlapMeasure(CAMERA), front=0.6, line=0, photo_spacing=39.0, height=100.0)

    def fly(flown: FlightSetup, *_: Any) -> Any:
        [survey] = judged_surveys(flown)
        # All twelve waypoints have the same height, those of the turns onto the first line and off the last too.
        assert np.ptp(flown.route.positions[-12:, 2]) == 0.0
        climbs.append(flown.route.positions[survey.first, 2] - setup.route.positions[survey.first, 2])
        ok = 0.0 < climbs[-1] < 20.0
        lines = [make_finding("survey", Place("leg", line.first), ok=ok, reason="") for line in survey.lines]
        return SimpleNamespace(
            setup=flown, flight_verdict=Verdict((*lines,), flyable=ok, complete=True, lines=("",), level="flown")
        )

    monkeypatch.setattr(remedies, "Trial", fly)
    verdict = fly(setup).flight_verdict
    found = remedies.find_survey_remedies(setup, uav_of_setup(setup), verdict, overlaps=[low]).remedies
    assert [(remedy.kind, remedy.value) for remedy in found] == [("height", 15.0)]
    assert sorted({round(climb, 3) for climb in climbs if climb}) == [15.0, 60.0]


def test_what_an_overlap_needs_and_what_a_pixel_shows_are_stated() -> None:
    """A quarter of 120 m x 15.6 / 16 is 29.25 m, 35 % of 120 m x 23.5 / 16 are 61.7 m, and of its pixels one 2.9 cm."""
    photos = {"front": 0.35, "photo_spacing": 75.0, "height": 120.0, "min_height": 120.0, "max_height": 160.0}
    sides = {"side": 0.3, "line_pair": (0, 1), "line_spacing": 124.0, "side_height": 120.0}
    front, side, pixels, blur = overlap_lines(OverlapMeasure(CAMERA, **photos, **sides))  # type: ignore[arg-type]
    lowest = ", because the lowest photos are taken 120 m above ground"
    assert front.endswith(f"75 % is required. The photos must be at most 29 m apart{lowest}")
    assert side.endswith(f"65 % is required. The lines must be at most 61 m apart{lowest}")
    assert blur == "motion blur is not judged"
    assert pixels == "ground sampling distance 2.9 to 3.9 cm per pixel (120 m to 160 m above ground)"
    # The worst place is not the lowest: 35 % of 80 m x 23.5 / 16 are 41.1 m.
    elsewhere = OverlapMeasure(CAMERA, **(photos | sides | {"min_height": 80.0}))  # type: ignore[arg-type]
    assert "lines must be at most 41 m apart, because the lowest photos are taken 80 m" in overlap_lines(elsewhere)[1]
    lost = OverlapMeasure(CAMERA, **photos, **sides, unusable_fraction=0.042)  # type: ignore[arg-type]
    assert overlap_lines(lost)[2] == "overlap not judged on 4 % of the lines' length, where no photo can be used"
    # A camera that takes one photo per second takes none closer together, whatever the distance in the items.
    slow = overlap_lines(OverlapMeasure(CAMERA, **photos, is_camera_limited=True))[0]  # type: ignore[arg-type]
    assert slow.endswith("is required. The camera is too slow for the distance between photos: one every 1 s, or 75 m")
    unknown = Camera(CAMERA.across, CAMERA.along, 0.3, 0.2)
    assert not any("sampling" in text for text in overlap_lines(OverlapMeasure(unknown, **photos)))  # type: ignore[arg-type]


@pytest.mark.parametrize(("interval", "photos"), [(0.0, 21), (3.0, 14), (1.0, 21)])
def test_the_camera_takes_photos_while_it_is_on_and_no_faster_than_it_can(interval: float, photos: int) -> None:
    """One photo every 50 m of 1,010 m, the first at once; in 3 s at 25 m/s it flies 75 m, in 1 s only 25 m."""
    setup = setup_of(wp(0, 0), wp(0, 500), "2 206 50 0 1 0 0 0 0", wp(0, 1510), "2 206 0 0 1 0 0 0 0", wp(0, 2500))
    plan = SurveyPlan(50.0, 0.0, replace(CAMERA, interval=interval))
    setup = replace(setup, mission=replace(setup.mission, survey_plans=(plan,)))
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup))
    assert aligned is not None
    assert count_flight_photos(requirements, aligned) == photos


@pytest.mark.parametrize(("spacing", "missed"), [(10.0, 0), (12.5, 20), (40.0, 75)])
def test_a_line_misses_the_photos_for_which_its_camera_is_too_slow(spacing: float, missed: int) -> None:
    """Of 101 planned photos, one every 10 m of 1,000 m, a camera takes 81 every 12.5 m and 26 every 40 m."""
    line = PhotoLine(0, 1, 0, 1, 10.0)
    steps = np.ones(1000, dtype=np.bool_)
    assert _count_photos(line, steps, 1000.0, np.full(1000, spacing)) == (101, missed)


def test_the_missed_photos_and_those_on_the_line_add_up_to_the_planned_ones() -> None:
    """PX4 switches the camera 60 m before each end: photos at -60 m + 29.25 m k, up to 580 m, k from 3 to 21.

    22 are planned on 640 m, 19 are taken.  With a radius of 100 m they are taken up to 540 m, k from 4 to 21.
    """
    lines = [wp(0, -900)]
    for k, (south, north) in enumerate(((0, 640), (640, 0), (0, 640))):
        lines += [wp(400 * k, south), "2 206 29.25 0 1 0 0 0 0", wp(400 * k, north), "2 206 0 0 1 0 0 0 0"]
    for radius, taken, missed in ((60, 19, 3), (100, 18, 4)):
        px4 = Px4(Px4Parameters.from_text(f"NAV_ACC_RAD {radius}", "a.params"))
        setup = replace(setup_of(*lines, wp(800, 1500)), autopilot=px4)
        requirements, [survey] = route_requirements(setup), judged_surveys(setup)
        aligned = align_track(requirements, fly_path(setup))
        assert aligned is not None
        measure = measure_line(requirements, aligned, survey, survey.lines[0])
        assert measure is not None
        counts = (measure.planned_photo_count, measure.taken_photo_count, measure.missed_photo_count)
        assert counts == (22, taken, missed)


@pytest.mark.parametrize(
    ("text", "release", "end"),
    [
        ("NAV_ACC_RAD 60", "1.17", "60 m before the end of a line (NAV_ACC_RAD 60 m)"),
        # The switch distance is 0.32 * 10 s * 0.7 = 2.24 s of flight. FW_AIRSPD_MAX is 20 m/s, or 20.4 m/s at 400 m.
        ("NAV_ACC_RAD 60", "1.16", "60 m before the end of a line (NAV_ACC_RAD 60 m)"),
        (
            "NAV_ACC_RAD 10",
            "1.16",
            "46 m before the end of a line (the switch distance of the guidance, more than NAV_ACC_RAD 10 m)",
        ),
    ],
)
def test_the_parameter_that_switches_the_camera_off_is_named(text: str, release: Px4Version, end: str) -> None:
    lines = [wp(0, -900)]
    for k, (south, north) in enumerate(((0, 640), (640, 0), (0, 640))):
        lines += [wp(400 * k, south), "2 206 29.25 0 1 0 0 0 0", wp(400 * k, north), "2 206 0 0 1 0 0 0 0"]
    px4 = Px4(Px4Parameters.from_text(text, "a.params", release))
    setup = replace(setup_of(*lines, wp(800, 1500)), autopilot=px4)
    requirements, [survey] = route_requirements(setup), judged_surveys(setup)
    aligned = align_track(requirements, fly_path(setup))
    assert aligned is not None
    measures = [measure_line(requirements, aligned, survey, line) for line in survey.lines]
    assert camera_off_text(requirements, [measures]) == f"PX4 switches the camera off up to {end}"
    assert camera_off_text(requirements, [[None] * len(measures)]) == ""


def test_the_photos_on_the_lines_are_those_taken_there() -> None:
    line: Any = SimpleNamespace(planned_photo_count=101, missed_photo_count=1, taken_photo_count=100)
    assert count_line_photos([line, None, line]) == 200


def test_a_flight_without_lines_does_not_deny_the_camera() -> None:
    assert overlap_lines(None, is_flown=False) == ("photos not judged: no line was flown",)


def test_the_first_line_names_an_overlap_that_is_too_small(tmp_path: Path) -> None:
    setup = setup_with(tmp_path, survey_of(75.0))
    [survey] = judged_surveys(setup)
    usable: Any = SimpleNamespace(
        ok=True, usable=1.0, planned_photo_count=14, missed_photo_count=0, taken_photo_count=14
    )
    lines = tuple(itertools.repeat(usable, len(survey.lines)))
    overlap = OverlapMeasure(CAMERA, 0.348, photo_spacing=75.0)
    verdict: Any = None
    track: Any = None
    result = planfly.SurveyResult(setup, track, verdict, (survey,), (lines,), (overlap,))
    assert result.headline == "3 of 3 photo lines can be used; front overlap 34.8 % < 65 %"
    assert not result.usable
    assert result.line_photos == 42


def test_lines_over_unknown_ground_are_neither_usable_nor_lost_and_nothing_is_tried(tmp_path: Path) -> None:
    setup = setup_with(tmp_path, survey_of(75.0))
    usable, unknown, lost = (
        LineMeasure(1000.0, part, 0.0, 0.0, 0.9 - part, 0.0, 0.0, 0.0, 0.0, 0.0, 14, 0, 25.0, 10.0, unknown=0.1)
        for part in (0.96, 0.9, 0.8)
    )
    [survey] = judged_surveys(setup)
    nothing: Any = None

    def result_of(*lines: LineMeasure) -> planfly.SurveyResult:
        return planfly.SurveyResult(setup, nothing, nothing, (survey,), (lines,), (None,))

    open_, failed = result_of(usable, unknown, unknown), result_of(usable, unknown, lost)
    assert (open_.lost, open_.usable, failed.lost) == (False, False, True)
    assert open_.headline == "1 of 3 photo lines can be used; 2 lie outside the terrain data and cannot be judged"
    assert failed.headline.endswith(
        "1 lies outside the terrain data and cannot be judged; line 3 is the worst: 80 % usable"
    )
    [text] = open_.no_remedy_lines
    assert text.startswith("nothing was tried: 2 photo lines outside the data of ")
    assert text.endswith(" an elevation file of the whole survey is needed (--terrain)")
    assert open_.survey_lines[-2].endswith("1000 m  not judged: 10 % over unknown ground")


def test_a_survey_states_gates_that_no_autopilot_flies_to(tmp_path: Path) -> None:
    """A gate 15 m beside the line switches the camera where the line passes it, not where it was drawn."""
    items = []
    for k in range(3):
        north = [-300.0, 0.0, 1000.0, 1300.0][:: 1 if k % 2 == 0 else -1]
        on = [wp(50.0 * k + 15.0, north[1], 100.0, command=4501), "2 206 25 0 1 0 0 0 0"]
        off = [wp(50.0 * k, north[2], 100.0, command=4501), "2 206 0 0 1 0 0 0 0"]
        items += [wp(50.0 * k, north[0], 100.0), *on, *off, wp(50.0 * k, north[3], 100.0)]
    setup = setup_with(tmp_path, mission(*items))
    reason = "no autopilot flies to a gate (CONDITION_GATE): a survey with gates needs turn-arounds"
    result = SurveyResult(setup, cast(Any, None), cast(Any, None), (), ())
    assert f"note: items 2, 8, 14: passed at more than 10 m, because {reason}" in result.survey_lines


@pytest.mark.parametrize(("crabs", "judged"), [((0.0, 0.0), True), ((0.5236, 0.5236), False)])
def test_the_crab_angle_is_part_of_the_answer(crabs: tuple[float, float], judged: bool) -> None:
    """Photos of 200 m by 100 m, 50 m apart: 1 - 50 / 200; turned alike (1 - 50 cos 30 / 200) (1 - 50 sin 30 / 100).

    The common area of 0.588 at 30 degrees is below the required 0.7, although the side overlap is not.
    """
    camera = Camera(2.0, 1.0, 0.7, 0.7)
    measure = OverlapMeasure(camera, side=0.75, line_pair=(1, 0), line_spacing=50.0, side_height=100.0)
    measure = replace(measure, side_crabs=crabs, max_crab=crabs[0])
    entry = overlap_entry(measure)
    assert (entry.side_judged, entry.side_lines) == (judged, (1, 2))
    assert entry.crab_angle_deg == pytest.approx(math.degrees(crabs[0]), abs=0.05)
    expected = (1.0 - 50.0 * math.cos(crabs[0]) / 200.0) * (1.0 - 50.0 * math.sin(crabs[0]) / 100.0)
    assert entry.side_common_area == pytest.approx(expected, abs=0.002)
    result = SurveyResult(cast(Any, None), cast(Any, None), cast(Any, None), (), (), (measure,))
    assert ("crab angle up to 30°" in result.headline) is not judged
