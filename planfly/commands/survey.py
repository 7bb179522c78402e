"""``planfly survey``: judge which part of each photo line is usable."""

import argparse
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from planfly.terminal.arguments import MISSION_SUFFIXES, file_completer, number_parser, parse_camera, with_completer
from planfly.terminal.command_parser import NOT_FLYABLE, LineParser, colour_text, verdict_code
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_result_options,
    add_steering_options,
    add_world_options,
)
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import SurveyResult


def add_survey_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly survey``."""
    parser = command_line.add_command(
        "survey",
        "fly a survey, state how much of each photo line can be used, and suggest changes for the lines that are lost",
        "planfly survey field.plan --terrain dem.tif --aircraft x8 --autopilot ardupilot --wind 5,250",
        "planfly survey field.waypoints --suggest --out better",
    )
    with_completer(
        parser.add_argument("what", metavar="MISSION|LOG", help=".waypoints or .plan, or a flight log (.mcap)"),
        file_completer(*MISSION_SUFFIXES, "mcap"),
    )
    group = parser.add_group("the survey")
    group.add_argument(
        "--camera",
        metavar="WxH,FOCAL",
        type=parse_camera,
        help=(
            "camera, which looks straight down: the size of its sensor across and along the track, and its focal "
            "length, all in mm. The required overlaps along and across the lines may follow, in percent. Examples: "
            "23.5x15.6,16 and 23.5x15.6,16,75,60 (default: the camera of a .plan)"
        ),
    )
    group.add_argument(
        "--suggest",
        action="store_true",
        help="look for a change that makes all lines usable. It tries the distance between photos, the height, "
        "turn-arounds, the order and course of the lines, parameters and the airspeed, each in a simulated flight",
    )
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_steering_options(parser).add_argument(
        "--seed", metavar="N", type=number_parser("seed"), help="seed of the turbulence (default: 1)"
    )
    add_result_options(
        parser, "folder for a picture of the lines, and for each mission that would help (default: none)"
    )


def survey(args: argparse.Namespace) -> int:
    """Judge every photo line of a survey; return the exit code.

    The exit code is 4 if too much of a photo line is lost or photos overlap too little, and otherwise the code of the
    verdict on the flight.
    """
    from logs.verdict.conditions import flown_condition_lines, judging_conditions
    from planfly.api import surveying

    result = surveying.survey(**args.options)
    code = verdict_code(result.verdict)
    if result.lost:
        code = NOT_FLYABLE
    print(f"survey    {colour_text(result.headline, 'bad' if result.lost else 'good' if result.usable else 'warning')}")
    print(f"flight    {result.verdict.headline}")
    for text in flown_condition_lines(judging_conditions(result.setup)):
        print(f"  {text}")
    for text in result.survey_lines:
        print(f"  {text}")
    for text in result.remedy_lines:
        print(colour_text("  would help: ", "hint") + text)
    if args.suggest and not result.usable and not result.remedies:
        for text in result.no_remedy_lines:
            print(f"  {text}")
    # A camera from --camera belongs to no survey of the file.
    has_survey_item = any(plan.photo is not None for plan in result.setup.mission.survey_plans)
    for path in result.files:
        note = " (the survey as plain items, without its camera)" if path.suffix == ".plan" and has_survey_item else ""
        print(f"  written {path}{note}")
    if missions := [path for path in result.files if path.suffix in (".waypoints", ".plan")]:
        # Other commands judge a mission without camera items as a path, not as a survey.
        settings = [f" --params {quote(str(path))}" for path in result.files if path.suffix in (".param", ".params")]
        params_option = settings[0] if missions[0].stem == "parameter" and settings else ""
        # The suggested missions consist of plain items, which hold no camera.
        camera = next((overlap.camera for overlap in result.overlaps if overlap is not None), None)
        camera_option = ""
        if args.camera is None and camera is not None:
            focal_length = camera.focal_length_mm
            camera_option = (
                f" --camera {focal_length * camera.across:.4g}x{focal_length * camera.along:.4g},{focal_length:g}"
            )
            if camera.front is not None and camera.side is not None:
                camera_option += f",{100.0 * camera.front:g},{100.0 * camera.side:g}"
        next_line = (
            f"next      planfly survey {quote(str(missions[0]))}{params_option}{camera_option} with the same options,"
            " as it was flown"
        )
        print(colour_text(next_line, "hint"))
    write_json_if_requested(args, lambda: _json_answer(str(args.what), result, code))
    return code


def _json_answer(source: str, result: "SurveyResult", code: int) -> object:
    """Return the answer of ``planfly survey`` for --json."""
    from logs.verdict.conditions import judging_conditions
    from planfly.terminal.survey_answers import (
        SurveyAnswer,
        near_miss_entry,
        overlap_entry,
        photo_line_entry,
        survey_remedy_entry,
    )

    return SurveyAnswer(
        exit_code=code,
        what=source,
        headline=result.headline,
        usable=result.usable,
        conditions=judging_conditions(result.setup),
        surveys=[
            [photo_line_entry(result.setup, line, measure) for line, measure in zip(survey.lines, lines, strict=True)]
            for survey, lines in zip(result.surveys, result.lines, strict=True)
        ],
        photos=result.photos,
        line_photos=result.line_photos,
        overlaps=[None if overlap is None else overlap_entry(overlap) for overlap in result.overlaps],
        remedies=[survey_remedy_entry(remedy) for remedy in result.remedies],
        nearest=None if result.nearest is None else near_miss_entry(result.nearest),
        files=[str(Path(path)) for path in result.files],
    )
