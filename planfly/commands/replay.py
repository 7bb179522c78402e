"""``planfly replay``: a flight from its log, on the terminal, as a film, or to other programs."""

import argparse
import math
import shutil
import sys
import time
from pathlib import Path

from logs.recording.reader import FlightLog, read_log
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.results import warn_of_loss
from world.errors import LogError, PlanflyError

# Numbers that may be meant as ports that ground stations listen at.
_PORTS = range(1024, 65536)
# Frames a second on a terminal.
_RATE = 10.0
_ENTER, _LEAVE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
_HOME, _TO_LINE_END, _TO_END = "\x1b[H", "\x1b[K", "\x1b[J"


def replay(args: argparse.Namespace) -> int:
    """Instruments on a terminal, the timeline elsewhere, or what the options name; 3 for a log that is cut short."""
    if bool(args.foxglove) + bool(args.movie) + isinstance(args.to, str) > 1:
        options = "--foxglove, --movie, --to IP:PORT"
        raise PlanflyError(f"{options}: one of them is expected", field=options, allowed="one of them is expected")
    log = read_log(Path(args.log))
    # Each target loads what it alone needs.
    if isinstance(args.to, str):
        from planfly.replays.live import play

        play(log, args)
    else:
        start, end = _part(log, args)
        if args.movie:
            from planfly.replays.movie import write_movie

            for file in write_movie(log, args, start, end)[:3]:
                print(f"movie     {file}")
        elif args.foxglove:
            from planfly.replays.live import serve_log

            serve_log(args, start, end)
        elif sys.stdout.isatty() and not (args.at_once or args.quiet or args.json):
            _show_instruments(log, start, end, args.speed or 1.0)
        else:
            _print_timeline(log, start, end, args.speed)
    if not log.complete:
        warn_of_loss(log)
    code = FLYABLE if log.complete else LOSS
    give_answer(args, lambda: _answer(args, log, code))
    return code


def _answer(args: argparse.Namespace, log: FlightLog, code: int) -> object:
    """The timeline of the part that is replayed, all of it where it goes to ground stations."""
    from logs.views.replay.timeline import timeline
    from planfly.terminal.answers.answer_data import ReplayAnswer, TimelineEvent

    start, end = (-math.inf, math.inf) if isinstance(args.to, str) else _part(log, args)
    events = [TimelineEvent(time_s=one.time, kind=one.kind, text=one.text) for one in timeline(log)]
    part = [event for event in events if start <= event.time_s <= end]
    return ReplayAnswer(exit_code=code, log=args.log, complete=log.complete, end_s=log.end_time, timeline=part)


def _part(log: FlightLog, args: argparse.Namespace) -> tuple[float, float]:
    """Start and end of what is replayed, s of the flight.  Raises LogError where there is nothing between them."""
    start = args.start if args.start is not None else float(log.track.time[0])
    end = log.end_time if args.to is None else min(args.to, log.end_time)
    ends = f"the log ends at {log.end_time:.1f} s"
    if args.to is not None and args.to > log.end_time and args.to in _PORTS:
        allowed = f"{ends}; if a port is meant, name its address, too: --to 127.0.0.1:{args.to:g}"
        raise LogError.of_option("--to", args.to, allowed, shown=f"{args.to:g}", file=args.log)
    if start > log.end_time:
        raise LogError.of_option("--from", start, ends, shown=f"{start:g}", file=args.log)
    if end < start:
        allowed = f"at or after --from, {start:g} s, is expected"
        raise LogError.of_option("--to", end, allowed, shown=f"{end:g}", file=args.log)
    return start, end


def _print_timeline(log: FlightLog, start: float, end: float, speed: float | None) -> None:
    """Print the timeline, at ``speed`` times real time or at once."""
    from flight.live.link import RunningClock
    from logs.views.replay.timeline import entry_lines, timeline

    played = RunningClock()
    for entry in timeline(log):
        if start <= entry.time <= end:
            while speed and (ahead := (entry.time - start) / speed - played()) > 0.0:
                time.sleep(min(ahead, 1.0 / _RATE))
            print("\n".join(entry_lines(entry)), flush=bool(speed))


def _show_instruments(log: FlightLog, start: float, end: float, speed: float) -> None:
    """Show frames until the end or an interruption; the last one stays on the terminal."""
    from flight.live.link import RunningClock
    from logs.views.replay.instruments import make_instruments

    instruments = make_instruments(log)
    played = RunningClock()
    now = start
    print(_ENTER, end="")
    try:
        while now < end:
            now = min(end, start + speed * played())
            size = shutil.get_terminal_size()
            lines = instruments.frame(now, width=size.columns)[: max(1, size.lines - 2)]
            lines.append(f"x {speed:g}, Ctrl-C stops")
            text = "".join(line + _TO_LINE_END + "\n" for line in lines)
            print(_HOME + text + _TO_END, end="", flush=True)
            time.sleep(1.0 / _RATE)
    finally:
        print(_LEAVE, end="", flush=True)
    print("\n".join(instruments.frame(now, width=shutil.get_terminal_size().columns)))
