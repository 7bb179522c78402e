"""Write a flight log that survives an interruption: the file is complete up to the interruption, or is removed."""

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
from world.files import lock_path
from world.geometry import leg_runs
from world.interruption import delay_signals

# ----------------------------------------------------------------------
# Limit the duration of a simulated flight and the size of its log, and predict the duration.


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Limits of simulated time and log size, at which a flight is ended.

    hours: maximum simulated time, h.
    megabytes: maximum size of the log, 10^6 bytes.

    >>> FlightLimits(megabytes=20.0).log_limit_reason(20_000_001)
    'log limit: 20 MB are written; --max-log raises it'
    """

    hours: float = MAX_HOURS
    megabytes: float = MAX_MEGABYTES

    def max_ticks(self, dt: float) -> int:
        """Return the maximum number of guidance ticks of dt seconds each."""
        return round(3600.0 * self.hours / dt)

    def log_limit_reason(self, size: int) -> str:
        """Return the reason to end a flight with a log of `size` bytes, or "" if the flight may continue."""
        if size <= 1e6 * self.megabytes:
            return ""
        return f"log limit: {self.megabytes:g} MB are written; --max-log raises it"


def predicted_seconds(setup: FlightSetup) -> float:
    """Return the predicted duration of a flight in still air, s.

    This is the path length divided by the mean demanded airspeed.

    The mean of the legs' airspeeds is weighted by time.

    >>> from logs.recording.example_log import example_log
    >>> flown = example_log()
    >>> bool(abs(predicted_seconds(flown.setup) - flown.track.time[-1]) < 5.0)
    True
    """
    leg_lengths = leg_runs(setup.route.positions)
    speed = leg_lengths.sum() / (leg_lengths / setup.demanded_route.leg_airspeeds).sum()
    return float(setup.path.length / speed)


def length_and_duration_text(setup: FlightSetup) -> str:
    """Return the length and the predicted duration of a flight as text.

    An example is "12.3 km, about 500 s in the air".
    """
    seconds = predicted_seconds(setup)
    time = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
    if seconds >= 2.0 * 3600.0:
        time = f"{seconds / 3600.0:.1f} h"
    return f"{setup.path.length / 1000.0:.1f} km, about {time} in the air"


def computing_time_key(setup: FlightSetup) -> str:
    """Return the key under which the computing time of a flight is stored.

    Simulations of flights with the same key take similar times per km.
    """
    return f"flying by {setup.autopilot.name}"


# Reason for the end of a flight that was interrupted.
INTERRUPTED = "interrupted"


class CrashSafeLog:
    """Context manager around `Recorder` that leaves a valid log if Ctrl-C interrupts the flight.

    The log of an interrupted flight ends with the last row flown and has no verdict; `planfly check` can judge it.  A
    log without a row is removed.  After an error the log stays unfinished, as with `Recorder`.

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
        self.end_reason = INTERRUPTED
        self._path = path
        self._rows = 0
        self._is_open = False
        self._locks = contextlib.ExitStack()
        # Do not remove a symbolic link, even if its target does not exist.
        file_existed = path.exists() or path.is_symlink()
        try:
            with delay_signals(), self._errors_with_file_name():
                path.touch()
                # Take the lock before the file is emptied, so that a log locked by another process is not changed.
                self._locks.enter_context(lock_path(path))
                self._recorder = Recorder(path, setup, every=every, batch=batch)
                self._is_open = True
        except BaseException as error:
            # A signal may have arrived while the log was opened.
            self.__exit__(type(error), error, None)
            if not file_existed and not self._rows:
                path.unlink(missing_ok=True)
            raise

    def __enter__(self) -> "CrashSafeLog":
        """Return the log itself."""
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the log if it is still open."""
        with self._locks:
            if self._is_open:
                self._is_open = False
                self._close_unfinished(error_type)

    def _close_unfinished(self, error_type: type[BaseException] | None) -> None:
        """Close a log whose flight has not been judged.

        After an interruption, a log with rows is finished and an empty log is deleted.  After any other error, the log
        is closed without its end; `planfly recover` can then read the rows.
        """
        with delay_signals():
            if error_type is None or not issubclass(error_type, KeyboardInterrupt):
                self._recorder.abandon()
            elif self._rows:
                self._recorder.finish(self.end_reason)
            else:
                self._recorder.abandon()
                Path(os.path.realpath(self._path)).unlink(missing_ok=True)

    def write(self, rows: Rows) -> None:
        """Record rows of the flight."""
        with delay_signals(), self._errors_with_file_name():
            self._recorder.write_rows(rows)
            self._rows += len(rows)

    @property
    def size(self) -> int:
        """Current size of the file, bytes."""
        return self._recorder.size

    def event(self, time: float, text: str, level: str) -> None:
        """Record an event, with the arguments of `Recorder.event`."""
        self._recorder.event(time, text, level)

    def finish(
        self, end_reason: str, verdict: Verdict, reference: ReferenceFlights | None, returns: DrawnReturns | None = None
    ) -> None:
        """Write the results of a judged flight, and close the log."""
        with delay_signals(), self._errors_with_file_name():
            self._recorder.finish(end_reason, verdict, reference, returns)
            self._is_open = False

    @contextlib.contextmanager
    def _errors_with_file_name(self) -> Iterator[None]:
        """Add the file name to an OSError without one, such as the error of a full disk."""
        try:
            yield
        except OSError as error:
            if error.filename is not None or error.errno is None:
                raise
            raise OSError(error.errno, error.strerror, str(self._path)) from error
