"""A flight's log that an interruption leaves whole, with the rows so far, or not at all."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Rows
from logs.recording.recorder import Recorder
from logs.verdict.places import ReferenceFlights
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.verdict import Verdict
from planfly.flight_options import MAX_HOURS, MAX_MEGABYTES
from world.files import hold
from world.geometry import leg_runs
from world.interruption import uninterrupted

# ----------------------------------------------------------------------
# How long a simulated flight may take, how large its log may grow, and what both come to by prediction.


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Where a flight ends that would go on.

    hours: simulated.  megabytes: of its log, 10^6 bytes.

    >>> FlightLimits(megabytes=20.0).log_full(20_000_001)
    'log limit: 20 MB are written; --max-log raises it'
    """

    hours: float = MAX_HOURS
    megabytes: float = MAX_MEGABYTES

    def max_ticks(self, dt: float) -> int:
        """Guidance ticks of dt s that are flown at most."""
        return round(3600.0 * self.hours / dt)

    def log_full(self, size: int) -> str:
        """How a flight ends whose log has so many bytes, "" where it goes on."""
        if size <= 1e6 * self.megabytes:
            return ""
        return f"log limit: {self.megabytes:g} MB are written; --max-log raises it"


def predicted_seconds(setup: FlightSetup) -> float:
    """Time that a setup's path takes at its legs' airspeeds in still air, s.

    >>> from logs.recording.example_log import example_log
    >>> flown = example_log()
    >>> bool(abs(predicted_seconds(flown.setup) - flown.track.time[-1]) < 5.0)
    True
    """
    runs = leg_runs(setup.route.waypoints)
    speed = runs.sum() / (runs / setup.route.airspeed).sum()
    return float(setup.path.length / speed)


def flight_text(setup: FlightSetup) -> str:
    """What is about to be flown: its length and, by prediction, its time."""
    seconds = predicted_seconds(setup)
    time = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
    if seconds >= 2.0 * 3600.0:
        time = f"{seconds / 3600.0:.1f} h"
    return f"{setup.path.length / 1000.0:.1f} km, about {time} in the air"


def flight_kind(setup: FlightSetup) -> str:
    """What flights that take about as long a kilometre have in common: their autopilot."""
    return f"flying by {setup.autopilot.name}"


# How a flight ended that was still under way.
INTERRUPTED = "interrupted"


class CrashSafeLog:
    """A `Recorder` as a context manager that Ctrl-C may end anywhere: what is written is written whole.

    An interrupted flight's log ends with how far it had got and holds no verdict, which `planfly check` gives; one
    without a row is removed.  An error leaves the log unfinished, as `Recorder` does.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.recording.reader import read_log
    >>> from flight.simulation.track import track_rows
    >>> flown = example_log()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "flight.mcap"
    ...     try:
    ...         with CrashSafeLog(path, flown.setup) as log:
    ...             log.write(track_rows(flown.track)[:100])
    ...             raise KeyboardInterrupt
    ...     except KeyboardInterrupt:
    ...         left = read_log(path)
    >>> left.complete, left.ended, len(left.track)
    (True, 'interrupted', 100)
    """

    def __init__(self, path: Path, setup: FlightSetup, *, every: int = 1, batch: int = 1) -> None:
        self.ended = INTERRUPTED
        self._path = path
        self._rows = 0
        self._open = False
        self._held = contextlib.ExitStack()
        # Of a link that leads nowhere too nothing is removed.
        existed = path.exists() or path.is_symlink()
        try:
            with uninterrupted(), self._named_errors():
                path.touch()
                # Before it is emptied: another's log stays as it is.
                self._held.enter_context(hold(path))
                self._recorder = Recorder(path, setup, every=every, batch=batch)
                self._open = True
        except BaseException as error:
            # A signal may have come while the log was opened.
            self.__exit__(type(error), error, None)
            if not existed and not self._rows:
                path.unlink(missing_ok=True)
            raise

    def __enter__(self) -> "CrashSafeLog":
        """Return the log itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close what is still open."""
        with self._held:
            if self._open:
                self._open = False
                self._leave(kind)

    def _leave(self, kind: type[BaseException] | None) -> None:
        with uninterrupted():
            if kind is None or not issubclass(kind, KeyboardInterrupt):
                self._recorder.abandon()
            elif self._rows:
                self._recorder.finish(self.ended)
            else:
                self._recorder.abandon()
                Path(os.path.realpath(self._path)).unlink(missing_ok=True)

    def write(self, rows: Rows) -> None:
        """Record rows as a flight hands them on."""
        with uninterrupted(), self._named_errors():
            self._recorder.write_rows(rows)
            self._rows += len(rows)

    @property
    def size(self) -> int:
        """Bytes of the file so far."""
        return self._recorder.size

    def event(self, time: float, text: str, level: str) -> None:
        """Record what happened; arguments as of `Recorder.event`."""
        self._recorder.event(time, text, level)

    def finish(
        self, ended: str, verdict: Verdict, reference: ReferenceFlights | None, returns: DrawnReturns | None = None
    ) -> None:
        """Close the log of a flight that has been judged."""
        with uninterrupted(), self._named_errors():
            self._recorder.finish(ended, verdict, reference, returns)
            self._open = False

    @contextlib.contextmanager
    def _named_errors(self) -> Iterator[None]:
        """The error of a full disk names the file."""
        try:
            yield
        except OSError as error:
            if error.filename is not None or error.errno is None:
                raise
            raise OSError(error.errno, error.strerror, str(self._path)) from error
