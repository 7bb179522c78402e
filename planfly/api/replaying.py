"""Replay a recorded flight as a timeline, instruments or a film, in Foxglove or in ground stations."""

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from logs.recording.reader import FlightLog, read_log
from logs.views.replay.instruments import Instruments, make_instruments
from logs.views.replay.timeline import TimelineEntry
from logs.views.replay.timeline import timeline as list_timeline
from planfly.api.api_function import api_function
from planfly.api.serving import link_access
from planfly.arguments import check_arguments
from world.argument_types import checks_types
from world.errors import LogError
from world.extras import requires_extra
from world.running_clock import RunningClock

# Numbers that may be meant as the port of a ground station.
_PORTS = range(1024, 65536)
# Origin of web pages with a scheme, a lower-case host name, as browsers write it, and a port.
_ORIGIN = re.compile(r"[a-z][a-z0-9+.-]*://[a-z0-9._\[\]:-]+")
# Frame rate of the instruments, Hz.
_FRAME_RATE_HZ = 10.0
# Default time to wait for a ground station, s.
_STATION_TIMEOUT_S = 10.0


def _read_log_if_path(log: FlightLog | str | Path) -> FlightLog:
    """Return the flight log; read it from its file if a path is given."""
    return log if isinstance(log, FlightLog) else read_log(log)


def replay_interval(log: FlightLog, start: float | None, end: float | None) -> tuple[float, float]:
    """Return start and end of a replay in flight time, s; None stands for the start or end of the log.

    An end after the end of the log becomes the end of the log. Raises LogError for an empty interval.
    """
    check_arguments(start=start, end=end)
    start_time = start if start is not None else float(log.track.time[0])
    end_time = log.end_time if end is None else min(end, log.end_time)
    end_text = f"after the end of the log at {log.end_time:.1f} s"
    # The user may have meant the port of a ground station.
    if end is not None and end > log.end_time and end in _PORTS:
        allowed = f"{end_text}; to name a port, add its address: `end` 127.0.0.1:{end:g}"
        raise LogError.of_argument("end", end, allowed, shown=f"{end:g}", file=log.source)
    if start_time > log.end_time:
        raise LogError.of_argument("start", start_time, end_text, shown=f"{start_time:g}", file=log.source)
    if end_time < start_time:
        allowed = f"expected `start`, {start_time:g} s, or later"
        raise LogError.of_argument("end", end_time, allowed, shown=f"{end_time:g}", file=log.source)
    return start_time, end_time


@api_function()
def timeline(
    log: FlightLog | str | Path, *, start: float | None = None, end: float | None = None
) -> tuple[TimelineEntry, ...]:
    """Return the timeline of a flight: legs, turns, clearances, threats and events in order of time.

    log: a flight log, or its path.
    start, end: start and end of the listed part in flight time, s; None for the start or end of the flight.
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> from logs.recording.example_log import example_log
    >>> planfly.timeline(example_log(), start=20.0)[0].text
    'turn left 14.0° at waypoint 1 (item 2), peak bank 0.0°'
    """
    flight_log = _read_log_if_path(log)
    start_time, end_time = (
        (-math.inf, math.inf) if start is None and end is None else replay_interval(flight_log, start, end)
    )
    return tuple(entry for entry in list_timeline(flight_log) if start_time <= entry.time <= end_time)


@api_function()
def instruments(log: FlightLog | str | Path) -> Instruments:
    """Return the instruments of a recorded flight, which `Instruments.frame` formats as text lines.

    >>> import planfly
    >>> from logs.recording.example_log import example_log
    >>> len(planfly.instruments(example_log()).frame(12.0)) > 10
    True
    """
    return make_instruments(_read_log_if_path(log))


@checks_types
def replay(
    log: FlightLog | str | Path,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    width: int | Callable[[], int] = 80,
) -> Iterator[tuple[float, list[str]]]:
    """Play a flight in real time: yield the instruments ten times a second, and once at the end.

    start, end: start and end of the played part in flight time, s; None for the start or end of the flight.
    speed: multiple of real time, 1 if None.
    width: width of the lines in characters, at least 60, or a function that returns the width for each frame.
    Yields the flight time, s, and the instruments as lines of text.  The replay pauses while the machine sleeps.
    Raises a `planfly.PlanflyError` for bad input when it is called, not at the first frame.

    >>> import planfly
    >>> from logs.recording.example_log import example_log
    >>> [round(time, 1) for time, lines in planfly.replay(example_log(), start=20.0, end=20.1, speed=10.0)][-1]
    20.1
    """
    check_arguments(speed=speed, width=None if callable(width) else width)
    flight_log = _read_log_if_path(log)
    start_time, end_time = replay_interval(flight_log, start, end)
    return _play_frames(instruments(flight_log), start_time, end_time, speed or 1.0, width)


def _play_frames(
    instruments_shown: Instruments, start_time: float, end_time: float, speed: float, width: int | Callable[[], int]
) -> Iterator[tuple[float, list[str]]]:
    """Yield flight time and instrument lines at `_FRAME_RATE_HZ` until the end.

    speed: multiple of real time.
    start_time, end_time: flight times, s.
    width: characters in a line, or a function that returns them for each frame.
    """
    clock, flight_time = RunningClock(), start_time
    while True:
        yield flight_time, instruments_shown.frame(flight_time, width=width() if callable(width) else width)
        if flight_time >= end_time:
            return
        time.sleep(1.0 / _FRAME_RATE_HZ)
        flight_time = min(end_time, start_time + speed * clock())


@api_function()
def movie(
    log: FlightLog | str | Path,
    out: str | Path,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Draw a flight as a film.

    out: a .gif, an .mp4 (which needs ffmpeg), or a folder for PNG frames.
    start, end: start and end of the drawn part in flight time, s; None for the start or end of the flight.
    speed: multiple of real time; None for a film of 20 s.
    overwrite: True replaces an existing target.
    Returns the files written.  Raises a `planfly.PlanflyError` for bad input.
    """
    # Imported here: only films need matplotlib.
    from planfly.replays.movie import write_movie

    check_arguments(speed=speed)
    flight_log = _read_log_if_path(log)
    start_time, end_time = replay_interval(flight_log, start, end)
    return tuple(write_movie(flight_log, Path(out), start_time, end_time, speed=speed, overwrite=overwrite))


def _never_stop() -> bool:
    """Return False; default condition of a replay that runs to its end."""
    return False


def _ignore_message(_text: str) -> None:
    """Ignore a message of a replay."""
    pass


@requires_extra("foxglove", "--foxglove needs")
@api_function()
def play_to_foxglove(
    log: FlightLog | str | Path,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    port: int = 8765,
    allow_origin: str | Sequence[str] = (),
    wait: float | None = None,
    stop: Callable[[], bool] = _never_stop,
    on_message: Callable[[str], None] = _ignore_message,
) -> None:
    """Play a flight to Foxglove on this machine over WebSocket; requires ``planfly[foxglove]``.

    start, end: start and end of the played part in flight time, s; None for the start or end of the flight.
    speed: multiple of real time, 1 if None.
    port: port of the server, or 0 for any free port.
    wait: maximum time to wait for the first viewer, s; None waits without limit.
    allow_origin: origins of web pages that may connect in addition to Foxglove's own, such as "https://HOST", as a
    sequence or separated by commas.
    stop: polled continuously; once it returns True the call returns.
    on_message: called with the address.
    Raises a `planfly.PlanflyError` for bad input, and if no client subscribes in time.
    """
    # Imported here: only this function needs foxglove-sdk.
    from planfly.replays import foxglove_server

    check_arguments(speed=speed, port=port, wait=wait)
    origins = allow_origin.split(",") if isinstance(allow_origin, str) else allow_origin
    allowed_origins = [origin.strip() for origin in origins if origin.strip()]
    for origin in allowed_origins:
        if not _ORIGIN.fullmatch(origin):
            allowed = "expected the origin of a web page, such as https://example.com or http://localhost:8080"
            raise LogError.of_argument("allow_origin", origin, allowed)
    flight_log = _read_log_if_path(log)
    start_time, end_time = replay_interval(flight_log, start, end)
    foxglove_server.play_to_foxglove(
        flight_log,
        start_time,
        end_time,
        speed=speed or 1.0,
        port=port,
        allowed=allowed_origins,
        wait=wait,
        should_stop=stop,
        on_message=on_message,
    )


@requires_extra("live", "playing to ground stations needs")
@api_function()
def play_to_stations(
    log: FlightLog | str | Path,
    to: str | Sequence[str],
    *,
    bind: str = "127.0.0.1:0",
    allow: str | Sequence[str] = (),
    sign_key: str | Path | None = None,
    speed: float | None = None,
    wait: float | None = None,
    stop: Callable[[], bool] = _never_stop,
    on_message: Callable[[str], None] = _ignore_message,
) -> None:
    """Play a flight to MAVLink ground stations as if it were flown now; requires ``planfly[live]``.

    to: addresses of the stations, IP:PORT, one or several.
    bind, allow, sign_key: see `planfly.serve`.
    speed: multiple of real time, 1 if None.
    wait: maximum time to wait for the first station, s; 10 if None.
    stop: polled continuously; once it returns True the call returns.
    on_message: called with one line for each event.
    Raises a `planfly.PlanflyError` for bad input, and if no station answers in time.
    """
    # Imported here: only this function needs MAVLink.
    from planfly.replays import stations

    check_arguments(speed=speed, wait=wait)
    access = link_access(to, bind, allow, sign_key)
    stations.play_to_stations(
        _read_log_if_path(log),
        access,
        speed=speed or 1.0,
        wait=_STATION_TIMEOUT_S if wait is None else wait,
        should_stop=stop,
        on_message=on_message,
    )
