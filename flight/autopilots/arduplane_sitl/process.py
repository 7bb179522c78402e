"""An autopilot's program: started in a folder of its own on free ports of this machine, ended with the flight."""

import contextlib
import ctypes
import hashlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.parameters import AIRCRAFT_FILE, DEFINITIONS
from flight.autopilots.arduplane_sitl.physics import LOOPBACK, ServoMap
from flight.autopilots.guard import Guard
from flight.autopilots.parameter_files import read_parameter_file
from flight.mission.items import Home
from flight.simulation.setup import FlightSetup
from world.errors import FlightError
from world.files import temporary_folder
from world.interruption import uninterrupted

_DEFAULTS, _OUTPUT = "defaults.parm", "output.txt"
# How fast the program may run against the clock: as fast as the physics answers.
_SPEEDUP = 1000
# Given to end by itself (s), so that its log is whole, before it is killed.
_GRACE = 2.0
_PANIC = "PANIC:"
_PR_SET_PDEATHSIG = 1


def check_binary(binary: Path) -> str:
    """SHA-256, as hex, of an autopilot's program.  Raises FlightError, in one line, for what cannot be run.

    >>> try:
    ...     check_binary(Path("nobody/arduplane"))
    ... except FlightError as error:
    ...     print(error)
    nobody/arduplane: no such file; the program of an ArduPlane for software in the loop is expected
    """
    if not binary.exists():
        raise FlightError(
            f"{binary}: no such file; the program of an ArduPlane for software in the loop is expected", file=binary
        )
    if not binary.is_file():
        raise FlightError(f"{binary}: not a file; the program of an ArduPlane is expected", file=binary)
    if not os.access(binary, os.X_OK):
        raise FlightError(f"{binary}: not executable (chmod +x)", file=binary)
    try:
        return hashlib.sha256(binary.read_bytes()).hexdigest()
    except OSError as error:
        raise FlightError(f"{binary}: cannot be read: {error.strerror}", file=binary) from error


class AutopilotProcess:
    """The running program; a context manager, after which neither it, nor what it started, nor its folder is left.

    Where we are killed, a guard sees to the same.

    binary: its file, checked by `check_binary`.
    home: where it starts.  heading: degrees, that it starts with.
    parameters: by name, its defaults for this flight.
    physics_port, link_port: on this machine, where it finds the physics (UDP) and us (TCP).

    Raises FlightError where it cannot be started.
    """

    def __init__(
        self,
        binary: Path,
        home: Home,
        heading: float,
        parameters: Mapping[str, float],
        physics_port: int,
        link_port: int,
    ) -> None:
        self.binary = binary
        self._place = contextlib.ExitStack()
        self._ended = False
        guard = self._place.enter_context(Guard())
        try:
            self._folder = self._place.enter_context(temporary_folder("planfly-autopilot-"))
            guard.keep_folder(self._folder)
            text = "".join(f"{name} {value:.9g}\n" for name, value in parameters.items())
            (self._folder / _DEFAULTS).write_text(text, encoding="ascii")
            self._process = self._spawn(guard, home, heading, physics_port, link_port)
        except BaseException:
            self._place.close()
            raise

    def _spawn(
        self, guard: Guard, home: Home, heading: float, physics_port: int, link_port: int
    ) -> "subprocess.Popen[bytes]":
        place = f"{home.lat_deg:.9f},{home.lon_deg:.9f},{home.alt:.3f},{heading:.2f}"
        free = _free_ports(3)
        command = [
            str(self.binary.resolve()),
            *("--model", f"JSON:{LOOPBACK}"),
            *("--speedup", str(_SPEEDUP)),
            *("--home", place),
            *("--base-port", str(free[0]), "-I", "0"),
            *("--sim-port-out", str(physics_port), "--sim-port-in", str(free[1]), "--rc-in-port", str(free[2])),
            *("--serial0", f"tcpclient:{LOOPBACK}:{link_port}"),
            *("--wipe", "--defaults", str(self._folder / _DEFAULTS)),
        ]
        # By default the program stays after a panic, and turns in a loop.
        environment = os.environ | {"SITL_PANIC_EXIT": "1"}

        def begin() -> None:
            """Have the group guarded before the program runs: told afterwards, we may be killed in between."""
            # Before this Python gives the signal its default, by which a guard that is gone would end us here.
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)
            guard.keep_group(os.getpid())
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)
            if sys.platform == "linux":
                _die_with_parent()

        with (self._folder / _OUTPUT).open("wb") as output:
            try:
                return subprocess.Popen(
                    command,
                    cwd=self._folder,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env=environment,
                    # Ctrl-C is ours: we end it in order, and what it started: they are a group of their own.
                    start_new_session=True,
                    preexec_fn=begin,
                )
            except OSError as error:
                raise FlightError(
                    f"{self.binary}: not an executable program: {error.strerror}", file=self.binary
                ) from error

    def __enter__(self) -> "AutopilotProcess":
        """Return the process itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the program and remove its folder."""
        self._kill()
        self._place.close()

    def watch(self) -> None:
        """Raise FlightError where the program has panicked or ended, with its last words."""
        panic = self._panic()
        if panic:
            raise FlightError(f"panicked: {panic}", file=self.binary)
        code = self._process.poll()
        if code is None:
            return
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        words = self._lines()
        raise FlightError(how + (f": {words[-1]}" if words else ""), file=self.binary, field="exit code", value=code)

    def end(self, answer: Callable[[], bool]) -> None:
        """Ask the program to end, so that it closes its log; kill it where it does not.

        answer: serves it a frame of physics meanwhile; false where none was asked for.
        """
        if self._signal(signal.SIGTERM):
            until = time.monotonic() + _GRACE
            while self._lives() and time.monotonic() < until:
                if not answer():
                    time.sleep(0.001)
        self._kill()

    def keep_log(self, target: Path) -> bool:
        """Move the program's own log (.BIN) to a file; whether there was one."""
        logs = sorted((self._folder / "logs").glob("*.BIN"))
        if not logs:
            return False
        with uninterrupted():
            shutil.move(logs[-1], target)
        return True

    def _signal(self, number: int) -> bool:
        """Send the program and what it started a signal, 0 for none; whether any of them is there.

        A group that is gone is sent none again: its number may be another's by then.
        """
        if not self._ended:
            try:
                os.killpg(self._process.pid, number)
            except ProcessLookupError:
                self._ended = True
        return not self._ended

    def _lives(self) -> bool:
        """Whether the program, or what it started, goes on; one that has ended but was not waited for does not."""
        self._process.poll()
        return self._signal(0)

    def _kill(self) -> None:
        if self._lives():
            self._signal(signal.SIGKILL)
        self._process.wait()

    def _lines(self) -> list[str]:
        try:
            text = (self._folder / _OUTPUT).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return []
        return [" ".join(line.split()) for line in text.splitlines() if line.strip()]

    def _panic(self) -> str:
        return next((line.partition(_PANIC)[2].strip() for line in self._lines() if _PANIC in line), "")


def _free_ports(count: int) -> list[int]:
    """Ports that nobody has now, for what the program opens and nobody uses."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for opened in sockets:
            opened.bind((LOOPBACK, 0))
        return [int(opened.getsockname()[1]) for opened in sockets]
    finally:
        for opened in sockets:
            opened.close()


def _die_with_parent() -> None:
    """Have the kernel kill the program when we are killed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


# ----------------------------------------------------------------------
# The parameters that an autopilot gets for a flight: the simulation's, the aircraft's, and a person's on top.

# What our physics and a start in the air need, whatever the aircraft.
SIMULATION = {
    # As often as JSBSim steps.
    "SIM_RATE_HZ": 120.0,
    # No radio, no terrain data, and no other serial ports: nothing of these fails.
    "FLTMODE_CH": 0.0,
    "THR_FAILSAFE": 0.0,
    "FS_SHORT_ACTN": 3.0,
    "FS_LONG_ACTN": 0.0,
    "TERRAIN_ENABLE": 0.0,
    "SERIAL1_PROTOCOL": -1.0,
    "SERIAL2_PROTOCOL": -1.0,
    # The simulated airspeed sensor, as it is wired and set to zero.
    "ARSPD_TYPE": 2.0,
    "ARSPD_USE": 1.0,
    "ARSPD_PIN": 1.0,
    "ARSPD_SKIP_CAL": 1.0,
    "ARSPD_OFFSET": 2013.0,
    # It is armed in the air.
    "ARMING_CHECK": 0.0,
    "LOG_FILE_DSRMROT": 0.0,
    # It tells what it is asked for, and no more.
    **dict.fromkeys(
        [f"SR0_{name}" for name in ("RAW_SENS", "EXT_STAT", "RC_CHAN", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3")], 0.0
    ),
}
# The battery's volts and amperes are measured, so that its log has them (BAT); how empty it is ends no flight: the
# verdict judges energy.
_MEASURED = {"BATT_MONITOR": 4.0, "BATT_FS_LOW_ACT": 0.0, "BATT_FS_CRT_ACT": 0.0, "BATT_LOW_VOLT": 0.0}
_UNMEASURED = {"BATT_MONITOR": 0.0}
# A person's parameters that say how an aircraft flies begin so; others belong to the hardware that they were read from.
FLYING = (
    *("NAVL1_", "WP_", "TECS_", "AIRSPEED_", "ROLL_LIMIT_DEG", "PTCH_", "RLL_", "YAW_", "YAW2SRV_", "KFF_", "THR_"),
    *("TRIM_THROTTLE", "SCALING_SPEED", "STALL_PREVENTION", "GLIDE_SLOPE_", "RTL_", "STAB_PITCH_DOWN", "LEVEL_ROLL_"),
    *("RALLY_LIMIT_KM", "RALLY_INCL_HOME"),
    *("FLIGHT_OPTIONS", "TKOFF_", "LAND_", "USE_REV_THRUST", "ACRO_", "GUIDED_", "MIN_GROUNDSPEED", "AHRS_WIND_MAX"),
)


@dataclass(frozen=True, slots=True)
class AutopilotParameters:
    """Parameters by name.

    given: all that the autopilot gets over its own defaults.
    changed: of those the person's, where they differ from the aircraft's or are not among them.
    unused: the person's that belong to other hardware.
    """

    given: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...] = ()


def autopilot_parameters(
    setup: FlightSetup, aircraft: Aircraft, servos: ServoMap, own: Mapping[str, float]
) -> AutopilotParameters:
    """Put the parameters of a flight together; own: the person's.  Raises ParameterError for a bad file.

    The mission's speed is the cruise speed, unless the person has one.
    """
    battery = _MEASURED if aircraft.battery_voltage else _UNMEASURED
    base = SIMULATION | battery | servos.parameters() | load_aircraft_parameters(aircraft)
    base["AIRSPEED_CRUISE"] = setup.airspeed
    flying = {name: value for name, value in own.items() if name.startswith(FLYING)}
    changed = {name: value for name, value in flying.items() if base.get(name) != value}
    return AutopilotParameters(base | flying, changed, tuple(sorted(own.keys() - flying.keys())))


def load_aircraft_parameters(aircraft: Aircraft) -> dict[str, float]:
    """ArduPlane's parameters for an aircraft, from its folder.  Raises ParameterError, in one line."""
    return {name: entry.value for name, entry in read_parameter_file(aircraft.folder / AIRCRAFT_FILE).items()}


def person_parameters(setup: FlightSetup) -> dict[str, float]:
    """What the scenario's file of parameters states, by present names and in their units.

    Raises ParameterError, in one line, for a file that cannot be read or states what is not allowed.
    """
    file = setup.scenario.flight.params
    if file is None:
        return {}
    old = {definition.old[0] for definition in DEFINITIONS.values() if definition.old is not None}
    stated = {name: entry.value for name, entry in read_parameter_file(Path(file)).items() if name not in old}
    parameters = setup.autopilot.parameters
    return stated | ({} if parameters is None else parameters.by_origin("file"))
