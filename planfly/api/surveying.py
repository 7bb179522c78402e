"""Judge which part of each photo line of a survey is usable, and suggest remedies for lost lines."""

from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, Unpack

from flight.autopilots.parameter_edits import px4_parameter_text, with_parameter
from flight.autopilots.parameter_files import MAX_BYTES, parameters_text
from flight.autopilots.parameter_origin import PX4
from flight.autopilots.parameter_set import ParameterSet
from flight.mission.items import Camera, Command, SurveyPlan
from flight.mission.itinerary import GATES_ARE_NO_WAYPOINTS
from flight.mission.surveys import Survey, camera_notes
from flight.mission_files.formats import FileKind, mission_text
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, read_log
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.photo_lines import (
    LineMeasure,
    OverlapMeasure,
    count_flight_photos,
    measure_line,
    measure_overlap,
)
from logs.verdict.measures.route_requirements import RouteRequirements, judged_surveys, route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.measures.waypoint_circles import circles_text, waypoint_circles
from logs.verdict.rules.survey_rule import crab_text
from logs.verdict.verdict import Verdict
from logs.views.surveys import survey_chart
from planfly.api.api_function import api_function
from planfly.api.flying import check_keywords_not_given
from planfly.arguments import CAMERA_FORMAT, is_valid_camera
from planfly.flight_logs import is_log
from planfly.flight_options import MissionOptions
from planfly.kernel_units.unit_kernels import FLYING
from planfly.runtime.stages import stage
from planfly.surveys.survey_remedies import NearMiss, SurveyRemedy, find_survey_remedies
from planfly.surveys.survey_text import (
    camera_off_text,
    count_line_photos,
    is_line_unknown,
    is_line_usable,
    line_text,
    lines_headline,
    near_miss_text,
    overlap_faults,
    overlap_lines,
    remedy_text,
    slow_camera_text,
    survey_text,
    usable_segments_text,
)
from planfly.workflow.open_flight import open_flight
from planfly.workflow.output_paths import SURVEY_FILES, check_output_folder, clean_folder
from planfly.workflow.pipeline import FlightTask, FlownMission, fly_and_judge, flying_stage
from planfly.workflow.uav import uav_of_setup
from world.errors import ArgumentError, LogError, MissionError, ParameterError
from world.files import read_small_file, utf8_text, write_atomically
from world.scenario import Scenario
from world.wording import count_text


@dataclass(frozen=True, slots=True, repr=False)
class SurveyResult:
    """Result of `planfly.survey`.

    setup, track, verdict: setup, track and verdict of the flight.
    surveys: surveys of the mission, in the order flown.
    lines: measures of each line of each survey; None for a line that was not flown.
    overlaps: overlap of the photos of each survey; None if it cannot be measured, for instance without a camera.
    photos: number of photos taken over the whole flight, also off the lines; 0 if no item states their distance.
    remedies: remedies that help, each tested by a flight; empty if none were requested or no line is lost.
    nearest: the trial that came closest to success, if remedies were requested and none helps.
    kept: reason why the layout was kept and no other layout was tried, for messages.
    circles: text on circles that the autopilot flew at waypoints of the surveys because of their altitudes; "" without.
    camera_off: text on the radius within which the camera is switched off before the end of a line; "" if no line loses
        photos by it.
    files: files written; empty if no folder was named.
    """

    setup: FlightSetup
    track: Track
    verdict: Verdict
    surveys: tuple[Survey, ...]
    lines: tuple[tuple[LineMeasure | None, ...], ...]
    overlaps: tuple[OverlapMeasure | None, ...] = ()
    photos: int = 0
    remedies: tuple[SurveyRemedy, ...] = ()
    nearest: NearMiss | None = None
    kept: str = ""
    circles: str = ""
    camera_off: str = ""
    files: tuple[Path, ...] = ()

    @property
    def usable(self) -> bool:
        """True if enough of every line is usable and the photos overlap as required."""
        is_overlap_unknown = any(overlap is not None and overlap.is_side_unknown for overlap in self.overlaps)
        return not (self.lost or self.unknown_lines or is_overlap_unknown)

    @property
    def unknown_lines(self) -> int:
        """Number of photo lines that cannot be judged because too much of them lies outside the terrain data."""
        return sum(is_line_unknown(line) for lines in self.lines for line in lines)

    @property
    def lost(self) -> bool:
        """True if too much of a line is lost, or photos overlap less than required; unknown lines are ignored."""
        lines = [line for lines in self.lines for line in lines if not is_line_unknown(line)]
        return not all(map(is_line_usable, lines)) or any(overlap_faults(overlap) for overlap in self.overlaps)

    @property
    def headline(self) -> str:
        """Summary of all photo lines and of overlaps that are too small, in one line."""
        faults = [fault for overlap in self.overlaps for fault in overlap_faults(overlap).values()]
        faults += [slow_camera_text(overlap) for overlap in self.overlaps if overlap and overlap.is_camera_limited]
        faults += [crab_text(overlap) for overlap in self.overlaps if overlap and overlap.is_side_unknown]
        return "; ".join([lines_headline([line for lines in self.lines for line in lines]), *dict.fromkeys(faults)])

    @property
    def line_photos(self) -> int:
        """Number of photos taken on all lines; 0 if no item states the distance between photos."""
        return sum(map(count_line_photos, self.lines))

    @property
    def survey_lines(self) -> tuple[str, ...]:
        """Lines that describe each survey and its photo lines."""
        texts = []
        if self.photos:
            on_lines = "all of them" if self.line_photos == self.photos else f"{self.line_photos:,}"
            texts.append(f"{count_text(self.photos, 'photo')} while the camera is on, {on_lines} on the lines")
        for survey, lines, overlap in zip(self.surveys, self.lines, self.overlaps, strict=True):
            photos = count_line_photos(lines)
            photos_text = f", {count_text(photos, 'photo')} on them" if photos and len(self.surveys) > 1 else ""
            is_flown = any(line is not None for line in lines)
            texts += [f"{survey_text(survey)}{photos_text}", *overlap_lines(overlap, is_flown=is_flown)]
            texts += [line_text(number, line) for number, line in enumerate(lines, 1)]
        factor = self.setup.autopilot.speeds.true_airspeed_factor
        notes = camera_notes(self.setup.mission, self.setup.demanded_route, self.setup.scenario.wind, factor)
        gate_notes = [note for note in self.setup.demanded_route.notes if note.endswith(GATES_ARE_NO_WAYPOINTS)]
        texts += [f"note: {note}" for note in (*notes, *gate_notes)]
        return (*texts, *filter(None, (self.camera_off, self.circles)))

    @property
    def remedy_lines(self) -> tuple[str, ...]:
        """Lines that describe the remedies."""
        return tuple(remedy_text(remedy, self.setup.path.length) for remedy in self.remedies)

    @property
    def no_remedy_lines(self) -> tuple[str, ...]:
        """Lines for a survey without a remedy: the changes that were tried, and the trial closest to success."""
        if self.unknown_lines:
            terrain = self.setup.scenario.terrain
            source = "the terrain data" if terrain is None else terrain.source
            return (
                f"nothing was tried: {count_text(self.unknown_lines, 'photo line')} outside the data of {source} cannot"
                " be judged; an elevation file of the whole survey is needed (--terrain)",
            )
        texts = [
            "no remedy was found: no other distance between photos, height, turn-around, gates, order, course,"
            " parameter or airspeed that was tried is enough alone, nor are longer turn-arounds with gates, a parameter"
            " or a lower airspeed; other distances between the lines were not tried"
        ]
        texts += [usable_segments_text(*pair) for pair in zip(self.surveys, self.lines, strict=True)]
        if self.kept:
            texts.append(f"no other layout was tried: {self.kept}")
        if self.nearest is not None:
            texts.append(f"closest to success: {near_miss_text(self.nearest)}")
        return tuple(texts)

    def __repr__(self) -> str:
        return f"<SurveyResult {self.setup.scenario.name}: {self.headline}>"


# Reason why a flown survey cannot be judged in another world, in messages.
_LINES_AS_FLOWN_TEXT = "not allowed with a log, whose photo lines are judged as they were flown"


@api_function(*FLYING)
def survey(
    what: FlightLog | FlownMission | str | Path,
    *,
    camera: tuple[float, ...] | None = None,
    suggest: bool = False,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[MissionOptions],
) -> SurveyResult:
    """Fly a survey, and report the usable part of each photo line and the overlap of the photos.

    what: the path of a .waypoints or .plan, which is flown; or a result of `planfly.fly`, or a flight log or its path.
    camera: sensor size across and along the track, and focal length, mm; optionally also the required overlaps along
    and across lines, percent; None takes the values of a .plan.
    suggest: True looks for remedies that make all lines of a mission usable.  Remedies are longer turn-arounds, gates
    (for PX4), an interleave stride (fly every n-th line), another course, an autopilot parameter, and a slower flight;
    each is tested by a flight before it is suggested.
    out: folder for a picture of the lines, and for the remedies as a .plan (for a .plan) or a .waypoints, and a .param
    (for PX4 a .params); None writes no files.
    overwrite: True replaces results in the folder.
    options: options of a mission, see `planfly.fly`.
    Raises a `planfly.PlanflyError` for bad input, and for a mission without a survey.
    """
    user_camera = None
    if camera is not None:
        try:
            camera_numbers = tuple(float(number) for number in camera)
        except (TypeError, ValueError):
            camera_numbers = ()
        if isinstance(camera, str | bytes) or not is_valid_camera(camera_numbers):
            allowed = f"expected {CAMERA_FORMAT}, such as (23.5, 15.6, 16)"
            raise ArgumentError.of_argument("camera", camera, allowed, shown=repr(camera))
        width, height, focal_length, *overlaps = camera_numbers
        front_overlap, side_overlap = (percent / 100.0 for percent in overlaps) if overlaps else (None, None)
        user_camera = Camera(
            width / focal_length,
            height / focal_length,
            front_overlap,
            side_overlap,
            focal_length_mm=focal_length,
        )
    fixed_options: dict[str, Any] = {**options, "fence": options["fence"] or None, "suggest": suggest or None}
    if out is not None:
        check_output_folder(Path(out), overwrite)
    if isinstance(what, str | Path) and is_log(Path(what)):
        check_keywords_not_given(str(what), fixed_options, _LINES_AS_FLOWN_TEXT)
        what = read_log(Path(what))
    if isinstance(what, FlightLog | FlownMission):
        check_keywords_not_given("flight", fixed_options, _LINES_AS_FLOWN_TEXT)
        source = what.setup.imported_log
        if source is not None and "attitude" not in source.holds:
            raise LogError(f"{source.file}: no attitude, so the bank at the photos is unknown", file=source.file)
        setup = _with_camera(what.setup.in_scenario(_with_parallel_lines_as_survey(what.setup.scenario)), user_camera)
        _check_has_survey(setup)
        requirements = route_requirements(setup)
        verdict = judge_flight(setup, what.track, what.ended or "", requirements=requirements)
        return _write_results(_measure_survey(requirements, what.track, verdict), out, overwrite)

    planned_setup = open_flight(what, options)
    setup = _with_camera(planned_setup.in_scenario(_with_parallel_lines_as_survey(planned_setup.scenario)), user_camera)
    _check_has_survey(setup)
    with flying_stage(setup, "flying a survey") as advance:
        flight = fly_and_judge(setup, FlightTask(advance=advance, reference="never"))
    result = _measure_survey(route_requirements(flight.setup), flight.track, flight.verdict)
    if suggest and not result.usable and not result.unknown_lines:
        with stage("looking for what would help") as advance:
            step_counter = count(1)
            trials = find_survey_remedies(
                flight.setup,
                uav_of_setup(setup),
                flight.verdict,
                lambda text: advance(next(step_counter), 0.0, text),
                result.overlaps,
            )
        result = replace(result, remedies=trials.remedies, nearest=trials.nearest, kept=trials.kept)
    return _write_results(result, out, overwrite)


def _with_camera(setup: FlightSetup, camera: Camera | None) -> FlightSetup:
    """Return a setup with a camera for all its surveys; unchanged if the camera is None.

    Overlaps that the camera does not state, and the interval between photos, are taken from the mission's camera.
    """
    if camera is None:
        return setup
    plans = []
    for plan in setup.mission.survey_plans:
        plan_camera = plan.camera or camera
        front_overlap, side_overlap = (
            (camera.front, camera.side) if camera.front is not None else (plan_camera.front, plan_camera.side)
        )
        plans.append(
            replace(plan, camera=replace(camera, front=front_overlap, side=side_overlap, interval=plan_camera.interval))
        )
    return replace(
        setup,
        mission=replace(setup.mission, survey_plans=(*plans, SurveyPlan(photo=None, turn_around=0.0, camera=camera))),
    )


def _write_results(result: SurveyResult, out: str | Path | None, overwrite: bool) -> SurveyResult:
    """Write the picture of the photo lines and the files of the remedies.

    Return the result with these files.

    out: folder; None to write nothing.
    """
    if out is None:
        return result
    folder, chart = clean_folder(out, SURVEY_FILES, overwrite=overwrite), survey_chart(result.setup, result.track)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    if chart is not None:
        # Imported here: matplotlib takes most of a second.
        from logs.views.drawing import draw_chart, png_bytes

        write_atomically(folder / "survey.png", png_bytes(draw_chart(chart)))
        files.append(folder / "survey.png")
    # A .plan also holds the fence, the rally points and the autopilot.
    kind: FileKind = "plan" if Path(result.setup.mission.source).suffix.lower() == ".plan" else "waypoints"
    for remedy in result.remedies:
        if remedy.mission is not result.setup.mission:
            path = folder / f"{remedy.kind}.{kind}"
            mission = replace(remedy.mission, autopilot=result.setup.autopilot.name)
            write_atomically(path, mission_text(mission, kind))
            files.append(path)
        if remedy.kind == "parameter":
            # The user's parameter file with the remedy's value; without such a file, only this parameter.
            params, parameter_set = result.setup.scenario.flight.params, result.setup.autopilot.parameters
            if params is not None and isinstance(parameter_set, ParameterSet):
                file, definition = Path(params), parameter_set.table.by_name[remedy.name]
                text = utf8_text(read_small_file(file, MAX_BYTES, "parameter", ParameterError), file, ParameterError)
                names = parameter_set.table.by_any_name.items()
                values = {name: remedy.value / factor for name, (known, factor) in names if known == definition}
                text = with_parameter(text, params, values)
            elif result.setup.autopilot.name == PX4:
                text = px4_parameter_text(remedy.name, remedy.value, result.setup.autopilot.version)
            else:
                text = parameters_text({remedy.name: remedy.value}, "suggested by planfly survey")
            # QGroundControl's files of PX4's parameters end in .params.
            path = folder / f"parameter.{'params' if result.setup.autopilot.name == PX4 else 'param'}"
            write_atomically(path, text)
            files.append(path)
    return replace(result, files=tuple(files))


def _with_parallel_lines_as_survey(scenario: Scenario) -> Scenario:
    """Return a scenario whose limits make the verdict judge all parallel lines as survey lines."""
    limits = scenario.limits.model_copy(update={"surveys": "lines"})
    return replace(scenario, limits=limits, spec=scenario.spec.model_copy(update={"limits": limits}))


def _check_has_survey(setup: FlightSetup) -> None:
    """Raise MissionError for a mission without a survey."""
    if not judged_surveys(setup):
        source = setup.mission.source
        has_gates = any(item.command == Command.CONDITION_GATE for item in setup.mission.items)
        reason = f"; {GATES_ARE_NO_WAYPOINTS}" if has_gates else ""
        raise MissionError(
            f"{source}: no survey found; expected at least three parallel lines, or two with photos along them{reason}",
            file=source,
        )


def _measure_survey(requirements: RouteRequirements, track: Track, verdict: Verdict) -> SurveyResult:
    """Measure the photo lines of a flight and the overlap of its photos.

    requirements: requirements of the route, with its surveys.
    track: rows of the flight; without rows, each measure is None.
    """
    setup, surveys = requirements.setup, requirements.surveys
    aligned = align_track(requirements, track) if len(track) else None
    lines = tuple(
        tuple(None if aligned is None else measure_line(requirements, aligned, survey, line) for line in survey.lines)
        for survey in surveys
    )
    circles = {} if aligned is None else waypoint_circles(requirements, aligned)
    survey_circles = {
        waypoint: height_error
        for waypoint, height_error in circles.items()
        if any(survey.has_leg(waypoint - 1) for survey in surveys)
    }
    overlaps = tuple(None if aligned is None else measure_overlap(requirements, aligned, survey) for survey in surveys)
    photos = 0 if aligned is None else count_flight_photos(requirements, aligned)
    circles_note = circles_text(requirements, survey_circles)
    camera_note = camera_off_text(requirements, lines)
    return SurveyResult(
        setup, track, verdict, surveys, lines, overlaps, photos, circles=circles_note, camera_off=camera_note
    )
