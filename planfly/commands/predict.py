"""``planfly predict``: predict a logged flight, which the model has not seen, as bands of 95 %."""

import argparse
import math
from typing import TYPE_CHECKING

from planfly.commands.check import LOGS
from planfly.terminal.arguments import IMPORTED_LOG_SUFFIXES, file_completer, number_parser, with_completer
from planfly.terminal.command_parser import FLYABLE, LineParser
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_imported_log_options,
    add_result_options,
    add_world_options,
)
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import Predicted


def add_predict_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly predict``."""
    parser = command_line.add_command(
        "predict",
        "predict a logged flight, which the model has not seen, as bands of 95 %, and state how often the flight is"
        " inside them",
        "planfly predict flight.columns.toml --aircraft ./mine --out predicted",
    )
    with_completer(
        parser.add_argument(
            "log", metavar=LOGS, help="a log of an autopilot, or a flight log written by 'planfly import'"
        ),
        file_completer("mcap", *IMPORTED_LOG_SUFFIXES),
    )
    group = parser.add_group("prediction: --aircraft is required")
    group.add_argument(
        "--by",
        choices=("controls", "mission"),
        help="what the predicted flight follows: the logged controls, in windows of 2 s (controls), or the mission,"
        " with the simulated autopilot in the logged wind (mission) (default: controls, if the log has them)",
    )
    group.add_argument(
        "--from",
        dest="start",
        metavar="S",
        type=number_parser("start"),
        help="with --by controls: time at which the prediction starts, in seconds from the start of the log. The log"
        " before this time only sets the width of the bands (default: the end of the part from which the aircraft was"
        " identified, or the middle of the log)",
    )
    add_imported_log_options(parser)
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_result_options(parser, "folder for predict.html and predict.png (default: none)")


def predict(args: argparse.Namespace) -> int:
    """Predict a log, and print how much of the flight is inside each band."""
    from planfly.api import predicting

    result = predicting.predict(**args.options)
    print("\n".join(result.lines))
    for file in result.files:
        print(f"predicted {file}")
    write_json_if_requested(args, lambda: _prediction_answer(result))
    return FLYABLE


def _prediction_answer(result: "Predicted") -> object:
    """Return the answer of ``planfly predict`` for --json."""
    from planfly.terminal.answers import PredictAnswer, PredictedQuantity

    def none_if_nan(value: float) -> float | None:
        """Return None for NaN, and any other number unchanged."""
        return None if math.isnan(value) else value

    quantities = [
        PredictedQuantity(
            name=band.name,
            unit=band.unit,
            inside=none_if_nan(band.inside),
            half_width=none_if_nan(band.half_width),
            unchanged_half_width=none_if_nan(band.unchanged),
        )
        for band in result.bands
    ]
    return PredictAnswer(
        exit_code=FLYABLE,
        by=result.by,
        aircraft=result.aircraft,
        start_s=result.start,
        end_s=result.end,
        draws=result.draws,
        windows=result.windows,
        quantities=quantities,
        files=[str(file) for file in result.files],
    )
