"""``planfly replay``: replay a flight from its log on the terminal, as a film, or to other programs."""

import argparse
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.terminal.arguments import number_parser, parse_time_or_stations
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser
from planfly.terminal.control_characters import escape_controls
from planfly.terminal.options import (
    add_log_argument,
    add_result_options,
    add_vehicle_link_options,
    given_options,
    print_and_flush,
    watch_stop_signals,
)
from planfly.terminal.output import plain_stream, warn_about_incomplete_log, write_json_if_requested
from world.errors import PlanflyError
from world.running_clock import RunningClock

if TYPE_CHECKING:
    from planfly import FlightLog

# Frame rate on a terminal, Hz.
_FRAME_RATE_HZ = 10.0
# Terminal sequence that switches to the alternate screen and hides the cursor.
_ENTER_SCREEN = "\x1b[?1049h\x1b[?25l"
# Terminal sequence that shows the cursor and leaves the alternate screen.
_LEAVE_SCREEN = "\x1b[?25h\x1b[?1049l"
# Terminal sequence that moves the cursor to the top left corner.
_HOME = "\x1b[H"
# Terminal sequence that erases to the end of the line.
_ERASE_LINE_END = "\x1b[K"
# Terminal sequence that erases to the end of the screen.
_ERASE_SCREEN_END = "\x1b[J"


def add_replay_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly replay``."""
    parser = command_line.add_command(
        "replay",
        "replay a flight from its log: as instruments on a terminal, as a timeline elsewhere",
        "planfly replay flight.mcap --speed 20 --from 60",
        "planfly replay flight.mcap --to 127.0.0.1:14550",
    )
    parser.alias_keyword("end", "--to")
    add_log_argument(parser)
    part_group = parser.add_group("part and speed")
    part_group.add_argument(
        "--from", dest="start", metavar="S", type=number_parser("start"), help="flight time at which to start, s"
    )
    part_group.add_argument(
        "--to",
        metavar="S|IP:PORT,...",
        type=parse_time_or_stations,
        help="flight time at which to stop, s; or addresses of ground stations to which the log is streamed (requires "
        "planfly[live])",
    )
    part_group.add_argument(
        "--speed",
        metavar="X",
        type=number_parser("speed"),
        help="play X times as fast as real time (default: 1 on a terminal and in Foxglove; for a film, the speed that"
        " makes it 20 s long; otherwise at once)",
    )
    part_group.add_argument("--at-once", action="store_true", help="print the whole timeline without playing it")
    output_group = parser.add_group("other outputs")
    output_group.add_argument(
        "--movie",
        metavar="FILE|DIR",
        help="write a film: FILE.gif, FILE.mp4 (requires ffmpeg or planfly[films]), or a folder DIR of PNG frames",
    )
    output_group.add_argument(
        "--foxglove",
        action="store_true",
        help="play the flight in Foxglove on this machine, over WebSocket; requires planfly[foxglove] and a viewer that"
        " supports the protocol foxglove.sdk.v1 (Foxglove since 2025, Lichtblick after 1.21)",
    )
    output_group.add_argument(
        "--port",
        metavar="N",
        type=number_parser("port"),
        default=8765,
        help="port for --foxglove (default: 8765); 0 stands for any free port",
    )
    output_group.add_argument(
        "--allow-origin", metavar="URL,URL", help="web pages (https://HOST) that may also connect to --foxglove"
    )
    output_group.add_argument(
        "--wait",
        metavar="S",
        type=number_parser("wait"),
        help="wait S seconds for a ground station (default: 10) or for Foxglove (default: forever)",
    )
    add_vehicle_link_options(parser, bind="127.0.0.1:0")
    add_result_options(parser)


def replay(args: argparse.Namespace) -> int:
    """Show the instruments or the timeline, or replay as the options request.

    Returns the exit code: 3 for an incomplete log, otherwise 0.
    """
    from logs.recording.reader import read_log
    from logs.views.replay.timeline import entry_lines
    from planfly.api import replaying

    to_station = isinstance(args.to, str)
    if bool(args.foxglove) + bool(args.movie) + to_station > 1:
        options = "--foxglove, --movie, --to IP:PORT"
        raise PlanflyError(f"{options}: expected only one of them", field=options, allowed="expected only one of them")
    log = read_log(Path(args.log))
    if not to_station:
        args.end = args.to
    if to_station or args.foxglove:
        play_log: Callable[..., None] = replaying.play_to_stations if to_station else replaying.play_to_foxglove
        with watch_stop_signals() as should_stop:
            play_log(**given_options(args, play_log, log=log, stop=should_stop, on_message=print_and_flush))
    elif args.movie:
        for file in replaying.movie(**given_options(args, replaying.movie, log=log, out=args.movie))[:3]:
            print(f"movie     {file}")
    elif sys.stdout.isatty() and not (args.at_once or args.quiet or args.json):
        # Show frames until the end or an interruption; the last frame stays on the terminal.
        speed, lines = args.speed or 1.0, list[str]()
        frames = replaying.replay(
            **given_options(args, replaying.replay, log=log, width=lambda: shutil.get_terminal_size().columns)
        )
        screen = plain_stream(sys.stdout)
        print(_ENTER_SCREEN, end="", file=screen)
        try:
            for _, lines in frames:
                visible_lines = [*lines[: max(1, shutil.get_terminal_size().lines - 2)], f"x {speed:g}, Ctrl-C stops"]
                text = "".join(escape_controls(line) + _ERASE_LINE_END + "\n" for line in visible_lines)
                print(_HOME + text + _ERASE_SCREEN_END, end="", flush=True, file=screen)
        finally:
            print(_LEAVE_SCREEN, end="", flush=True, file=screen)
        print("\n".join(lines))
    else:
        # The timeline is printed at `--speed` times real time, or at once without it.
        entries = replaying.timeline(**given_options(args, replaying.timeline, log=log))
        start, clock = args.start or float(log.track.time[0]), RunningClock()
        for entry in entries:
            while args.speed and (wait := (entry.time - start) / args.speed - clock()) > 0.0:
                time.sleep(min(wait, 1.0 / _FRAME_RATE_HZ))
            print("\n".join(entry_lines(entry)), flush=bool(args.speed))
    if not log.complete:
        warn_about_incomplete_log(log)
    code = FLYABLE if log.complete else INCOMPLETE
    write_json_if_requested(args, lambda: _json_answer(args, log, code))
    return code


def _json_answer(args: argparse.Namespace, log: "FlightLog", code: int) -> object:
    """Return the answer of ``planfly replay`` for --json, with the timeline of the replayed part.

    A replay to ground stations has the timeline of the whole flight.
    """
    from planfly.api import replaying
    from planfly.terminal.answers import ReplayAnswer, TimelineEvent

    entries = (
        replaying.timeline(log)
        if isinstance(args.to, str)
        else replaying.timeline(**given_options(args, replaying.timeline, log=log))
    )
    events = [TimelineEvent(time_s=entry.time, kind=entry.kind, text=entry.text) for entry in entries]
    return ReplayAnswer(exit_code=code, log=args.log, complete=log.complete, end_s=log.end_time, timeline=events)
