"""Run an autopilot's program as a process in its own folder, and end it with the flight."""

import contextlib
import ctypes
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from flight.autopilots.guard import Guard
from world.errors import FlightError
from world.files import missing_text, temporary_folder
from world.interruption import delay_signals

_OUTPUT_FILE = "output.txt"
# Time for the program to end by itself, so that its log is complete, before it is killed, s.
_GRACE_S = 2.0
_PANIC_MARK = "PANIC:"
_PR_SET_PDEATHSIG = 1


def check_binary(binary: Path, title: str) -> str:
    """Check that an autopilot's program can be run, and return its SHA-256 as hex.

    Raises FlightError, in one line, if the program cannot be run.

    title: name of the expected autopilot.

    >>> try:
    ...     check_binary(Path("missing/arduplane"), "ArduPlane")
    ... except FlightError as error:
    ...     print(error)
    missing/arduplane: no such file; expected the SITL program of ArduPlane
    """
    if not binary.is_file():
        raise FlightError(f"{binary}: {missing_text(binary)}; expected the SITL program of {title}", file=binary)
    if not os.access(binary, os.X_OK):
        raise FlightError(f"{binary}: not executable (chmod +x)", file=binary)
    try:
        return hashlib.sha256(binary.read_bytes()).hexdigest()
    except OSError as error:
        raise FlightError(f"{binary}: cannot be read: {error.strerror}", file=binary) from error


@dataclass(frozen=True, slots=True)
class Launch:
    """Command line and environment of a program.

    arguments: arguments after the program's name.
    environment: variables in addition to this process's environment.
    logs: pattern of the program's own logs, relative to its folder.
    leftover_files: files that the program leaves behind outside its folder.
    """

    arguments: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    logs: str = "logs/*.BIN"
    leftover_files: tuple[Path, ...] = ()


class AutopilotProcess:
    """Running program of an autopilot, as a context manager.

    Leaving the context kills the program and its children, and removes the program's folder. A guard process does the
    same if planfly is killed.

    binary: file of the program, checked by `check_binary`.
    prepare: function that prepares the program's folder, and returns the command line.

    Raises FlightError if the program cannot be started.
    """

    def __init__(self, binary: Path, prepare: Callable[[Path], Launch]) -> None:
        self.binary = binary
        self._resources = contextlib.ExitStack()
        self._ended = False
        guard = self._resources.enter_context(Guard())
        try:
            self._folder = self._resources.enter_context(temporary_folder("planfly-autopilot-"))
            guard.register_folder(self._folder)
            self._launch = prepare(self._folder)
            for file in self._launch.leftover_files:
                guard.register_file(file)
                self._resources.callback(file.unlink, missing_ok=True)
            self._process = self._spawn(guard)
        except BaseException:
            self._resources.close()
            raise

    def _spawn(self, guard: Guard) -> "subprocess.Popen[bytes]":
        """Start the program in its own process group, which the guard kills if planfly is killed."""

        def register_before_start() -> None:
            """Register the process group with the guard before the program runs.

            If it were registered later, the program would survive if planfly were killed in between.
            """
            # Ignore SIGPIPE while writing to the guard: by the default action, a dead guard would end this process.
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)
            guard.register_group(os.getpid())
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)
            if sys.platform == "linux":
                # The operating system kills the program if planfly is killed.
                ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)

        with (self._folder / _OUTPUT_FILE).open("wb") as output:
            try:
                return subprocess.Popen(
                    [str(self.binary.resolve()), *self._launch.arguments],
                    cwd=self._folder,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env=os.environ | self._launch.environment,
                    # Its own session: Ctrl-C reaches only planfly, which ends the program and its children in order.
                    start_new_session=True,
                    preexec_fn=register_before_start,
                )
            except OSError as error:
                raise FlightError(
                    f"{self.binary}: not an executable program: {error.strerror}", file=self.binary
                ) from error

    def __enter__(self) -> Self:
        """Return the process itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the program and remove its folder."""
        self._kill()
        self._resources.close()

    def check_running(self) -> None:
        """Raise FlightError, with the last line of the program's output, if the program has panicked or ended."""
        panic = next(
            (line.partition(_PANIC_MARK)[2].strip() for line in self.output_lines() if _PANIC_MARK in line), ""
        )
        if panic:
            raise FlightError(f"panicked: {panic}", file=self.binary)
        code = self._process.poll()
        if code is None:
            return
        reason = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        output_lines = self.output_lines()
        raise FlightError(
            reason + (f": {output_lines[-1]}" if output_lines else ""), file=self.binary, field="exit code", value=code
        )

    def end(self, answer_request: Callable[[], bool]) -> None:
        """Ask the program to end, so that it closes its log; kill it if it has not ended after `_GRACE_S`.

        answer_request: function that answers one physics request of the program; returns False without one.
        """
        if self._signal(signal.SIGTERM):
            deadline = time.monotonic() + _GRACE_S
            while self._is_alive() and time.monotonic() < deadline:
                if not answer_request():
                    time.sleep(0.001)
        self._kill()

    def save_log(self, target: Path) -> bool:
        """Move the program's last log to the file ``target``; return True if there was a log."""
        logs = sorted(self._folder.glob(self._launch.logs))
        if not logs:
            return False
        with delay_signals():
            shutil.move(logs[-1], target)
        return True

    def _signal(self, number: int) -> bool:
        """Send a signal to the program and its children; return True if any of these processes exists.

        number: number of the signal; 0 only checks for processes. No signal is sent after the process group has ended,
            because its number may then belong to another group.
        """
        if not self._ended:
            try:
                os.killpg(self._process.pid, number)
            except ProcessLookupError:
                self._ended = True
        return not self._ended

    def _is_alive(self) -> bool:
        """Return True if the program or one of its children is still running."""
        self._process.poll()
        return self._signal(0)

    def _kill(self) -> None:
        """Kill the program if it is alive, and wait for its end."""
        if self._is_alive():
            self._signal(signal.SIGKILL)
        self._process.wait()

    def output_lines(self) -> list[str]:
        """Return the lines of the program's output without blank lines; an empty list if there is no output."""
        try:
            text = (self._folder / _OUTPUT_FILE).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return []
        return [" ".join(line.split()) for line in text.splitlines() if line.strip()]
