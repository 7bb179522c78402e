"""The commands that start from a log: replay, recover, report, compare."""

import argparse
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.terminal.exit_codes import BAD_INPUT, FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.progress import progress
from planfly.terminal.targets import COMPARE_FILES, LOG_FIGURES, prepare_folder, refuse_existing, refuse_folder
from world.atomic_files import write_whole
from world.errors import LogError, PlanflyError

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog
    from logs.replay.instruments import Instruments

# Frames a second on a terminal.
_RATE = 10.0
_ENTER, _LEAVE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
_HOME, _TO_LINE_END, _TO_END = "\x1b[H", "\x1b[K", "\x1b[J"


def replay(args: argparse.Namespace) -> int:
    """``planfly replay``: instruments on a terminal, the timeline elsewhere."""
    from logs.recording.reader import read_log

    if bool(args.foxglove) + bool(args.movie) + isinstance(args.to, str) > 1:
        raise PlanflyError("--foxglove, --movie, --to IP:PORT: one of them is expected")
    log = read_log(Path(args.log))
    if isinstance(args.to, str):
        from planfly.commands.play import play

        play(log, args)
        return _whole_or_loss(args, log)
    start = args.start if args.start is not None else float(log.track.time[0])
    end = log.end_time if args.to is None else min(args.to, log.end_time)
    if start > log.end_time:
        raise LogError(f"{args.log}: --from {start:g}: the log ends at {log.end_time:.1f} s")
    if end < start:
        raise LogError(f"{args.log}: --to {end:g}: at or after --from, {start:g} s, is expected")
    if args.movie:
        from planfly.commands.movie import write_movie

        for file in write_movie(log, args, start, end)[:3]:
            print(f"movie     {file}")
    elif args.foxglove:
        from planfly.commands.foxglove_server import serve_log

        serve_log(args, start, end)
    elif sys.stdout.isatty() and not args.at_once:
        from logs.replay.instruments import make_instruments

        _show_instruments(make_instruments(log), start, end, args.speed or 1.0)
    else:
        _tell(log, start, end, args.speed)
    return _whole_or_loss(args, log)


def _whole_or_loss(args: argparse.Namespace, log: "FlightLog") -> int:
    from planfly.terminal.results import print_warnings

    if not log.complete:
        print_warnings([f"{args.log}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
        return LOSS
    return FLYABLE


def _tell(log: "FlightLog", start: float, end: float, speed: float | None) -> None:
    """Print the timeline, at ``speed`` times real time or at once."""
    from logs.replay.timeline import entry_lines, timeline

    began = time.monotonic()
    for entry in timeline(log):
        if start <= entry.time <= end:
            if speed:
                time.sleep(max(0.0, (entry.time - start) / speed - (time.monotonic() - began)))
            print("\n".join(entry_lines(entry)), flush=bool(speed))


def _show_instruments(instruments: "Instruments", start: float, end: float, speed: float) -> None:
    """Show frames until the end or an interruption; the last one stays on the terminal."""
    began = time.monotonic()
    now = start
    print(_ENTER, end="")
    try:
        while now < end:
            now = min(end, start + speed * (time.monotonic() - began))
            size = shutil.get_terminal_size()
            lines = instruments.frame(now, width=size.columns)[: max(1, size.lines - 2)]
            lines.append(f"x {speed:g}, Ctrl-C stops")
            text = "".join(line + _TO_LINE_END + "\n" for line in lines)
            print(_HOME + text + _TO_END, end="", flush=True)
            time.sleep(1.0 / _RATE)
    finally:
        print(_LEAVE, end="", flush=True)
    print("\n".join(instruments.frame(now, width=shutil.get_terminal_size().columns)))


def recover(args: argparse.Namespace) -> int:
    """``planfly recover``."""
    from logs.recording.recover import recover_log
    from planfly.terminal.results import print_warnings

    source = Path(args.log)
    target = Path(args.out) if args.out else source.with_name(f"{source.stem}-recovered.mcap")
    if args.out is None and target.exists() and not args.overwrite:
        raise PlanflyError(f"{target}: exists; --overwrite replaces it, --out names another")
    refuse_existing(target, args.overwrite)
    recovered = recover_log(source)
    if recovered is None:
        print(f"{source}: complete: there is nothing to recover, and nothing was written")
        return FLYABLE
    write_whole(target, recovered.data)
    log = recovered.log
    print(f"log       {target} ({len(log.track)} rows, to {log.end_time:.1f} s)")
    print_warnings([f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
    return LOSS


def report(args: argparse.Namespace) -> int:
    """``planfly report``."""
    from logs.recording.reader import read_log
    from logs.verdict.judge_flight import judge_flight
    from planfly.terminal.results import print_warnings, write_pictures

    if args.layout:
        return _layout(Path(args.layout), args)
    if args.log is None:
        print("planfly report: a log, or --layout FILE, is expected (see planfly report --help)", file=sys.stderr)
        return BAD_INPUT
    source = Path(args.log)
    log = read_log(source)
    folder = Path(args.out) if args.out else source.with_name(f"{source.stem}-report")
    verdict = judge_flight(log.setup, log.track, log.ended or "the log ends before the flight does", whole=log.complete)
    if args.out:
        refuse_folder(folder, args.overwrite)
    prepare_folder(folder, LOG_FIGURES)
    with progress("drawing"):
        files = write_pictures(
            folder, log.setup, log.track, verdict, log.ended, f"planfly report {args.log}", log.versions, log.events,
            svg=args.svg,
        )  # fmt: skip
    for file in files:
        print(f"report    {file}")
    if not log.complete:
        print_warnings([f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def _layout(target: Path, args: argparse.Namespace) -> int:
    from logs.recording.foxglove_layout import layout_text

    if args.log is not None:
        raise PlanflyError(f"{args.log}: --layout writes the layout alone; name no log with it")
    refuse_existing(target, args.overwrite)
    write_whole(target, layout_text())
    print(f"layout    {target}")
    return FLYABLE


def compare(args: argparse.Namespace) -> int:
    """``planfly compare``."""
    from logs.recording.reader import read_log
    from logs.report.compare import compare_logs, difference_lines
    from planfly.terminal.results import print_warnings

    first, second = Path(args.first), Path(args.second)
    logs = [read_log(first), read_log(second)]
    comparison = compare_logs(*logs, names=(first.name, second.name))
    if args.out:
        from logs.report.compare_page import write_comparison

        folder = Path(args.out)
        refuse_folder(folder, args.overwrite)
        prepare_folder(folder, COMPARE_FILES)
        with progress("drawing"):
            files = write_comparison(folder, comparison, svg=args.svg)
    print("\n".join(difference_lines(comparison)))
    for file in files if args.out else ():
        print(f"compare   {file}")
    broken = [
        f"{log.source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s" for log in logs if not log.complete
    ]
    print_warnings(broken)
    return LOSS if broken else FLYABLE
