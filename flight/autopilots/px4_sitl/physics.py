"""Implement PX4's simulator link in lockstep, with sensor messages, socket and exchange.

PX4 connects to the simulator by TCP with MAVLink. Each HIL_SENSOR sets PX4's clock and triggers a step of PX4, which
answers each step with one HIL_ACTUATOR_CONTROLS once its outputs run. Follows PX4's
`src/modules/simulation/simulator_mavlink/SimulatorMavlink.cpp` and docs.px4.io, "Simulator MAVLink API".
"""

import math
import random
import socket
import struct
from collections.abc import Callable
from typing import Any

from pymavlink import mavextra
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.exchange import (
    FRAME_HZ,
    LOOPBACK,
    SILENCE_TIMEOUT_S,
    BodyMotion,
    Lockstep,
    RailEnd,
    position_on_sphere,
    to_body_axes,
)
from flight.autopilots.sitl.servos import ServoMap
from flight.dynamics.fdm import Fdm
from flight.dynamics.state import Commands
from flight.mission.items import Home
from flight.simulation.tick import Workspace
from world.errors import FlightError
from world.running_clock import RunningClock

# ----------------------------------------------------------------------
# Sensor messages.

# HIL_SENSOR.fields_updated for every sensor.
_ALL_FIELDS = 0x1FFF
# GNSS fix type: three-dimensional.
_FIX_3D = 3
# Number of satellites.
_SATELLITE_COUNT = 12
# Stated accuracy of the GNSS position, m; the position is exact except for the error of the flight's navigation.
_GNSS_ACCURACY_M = 0.9
# PX4 treats a sensor whose value never changes as broken, and on the rail no value changes. So noise of a little more
# than PX4's quantum is added, the same in each flight: to the magnetic field ...
_FIELD_NOISE_GAUSS = 2e-4
# ... the specific force ...
_FORCE_NOISE_MPS2 = 6e-3
# ... the angular rate ...
_RATE_NOISE_RADPS = 1.5e-3
# ... and the pressure.
_PRESSURE_NOISE_HPA = 5e-3


def earth_magnetic_field(lat_deg: float, lon_deg: float) -> tuple[float, float, float]:
    """Return the Earth's magnetic field (north, east, down) at a position, gauss, from pymavlink's tables.

    lat_deg, lon_deg: degrees.

    >>> north, east, down = earth_magnetic_field(47.4, 8.5)
    >>> round(north, 2), abs(east) < 0.03, round(down, 2)
    (0.22, True, 0.43)
    """
    declination, inclination, strength = mavextra.get_mag_field_ef(lat_deg, lon_deg)
    declination, inclination = math.radians(declination), math.radians(inclination)
    horizontal = strength * math.cos(inclination)
    return horizontal * math.cos(declination), horizontal * math.sin(declination), strength * math.sin(inclination)


def standard_atmosphere(amsl: float) -> tuple[float, float, float]:
    """Return pressure (Pa), temperature (K) and density (kg/m^3) of the standard atmosphere (ISO 2533).

    At sea level it has 288.15 K and 101325 Pa. The temperature falls by 6.5 K per km, and 287.05287 J/(kg K) is the gas
    constant of air; the formula is valid up to 11 km.

    amsl: m.

    >>> [round(value, 3) for value in standard_atmosphere(1000.0)]
    [89874.563, 281.65, 1.112]
    """
    temperature = 288.15 - 0.0065 * amsl
    pressure = 101325.0 * (temperature / 288.15) ** 5.255880
    return pressure, temperature, pressure / (287.05287 * temperature)


class Sensors:
    """Sensor messages for an aircraft's motion.

    home: origin of the motion's positions.
    """

    def __init__(self, home: Home) -> None:
        self._home = (math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt)
        self._field = earth_magnetic_field(home.lat_deg, home.lon_deg)
        self._random = random.Random(1)

    def sensor_message(self, motion: BodyMotion) -> Any:
        """Return HIL_SENSOR: readings of the inertial sensors, magnetometer, barometer and Pitot tube."""
        dither = self._random.uniform
        field = to_body_axes((motion.roll, motion.pitch, motion.yaw), self._field)
        pressure, temperature, density = standard_atmosphere(self._home[2] - motion.down)
        return mavlink.MAVLink_hil_sensor_message(
            round(motion.time * 1e6),
            motion.force_x + dither(-_FORCE_NOISE_MPS2, _FORCE_NOISE_MPS2),
            motion.force_y + dither(-_FORCE_NOISE_MPS2, _FORCE_NOISE_MPS2),
            motion.force_z + dither(-_FORCE_NOISE_MPS2, _FORCE_NOISE_MPS2),
            motion.roll_rate + dither(-_RATE_NOISE_RADPS, _RATE_NOISE_RADPS),
            motion.pitch_rate + dither(-_RATE_NOISE_RADPS, _RATE_NOISE_RADPS),
            motion.yaw_rate + dither(-_RATE_NOISE_RADPS, _RATE_NOISE_RADPS),
            field[0] + dither(-_FIELD_NOISE_GAUSS, _FIELD_NOISE_GAUSS),
            field[1] + dither(-_FIELD_NOISE_GAUSS, _FIELD_NOISE_GAUSS),
            field[2] + dither(-_FIELD_NOISE_GAUSS, _FIELD_NOISE_GAUSS),
            pressure / 100.0 + dither(-_PRESSURE_NOISE_HPA, _PRESSURE_NOISE_HPA),
            0.5 * density * motion.airspeed**2 / 100.0,
            self._home[2] - motion.down,
            temperature - 273.15,
            _ALL_FIELDS,
            0,
        )

    def gnss_message(self, motion: BodyMotion) -> Any:
        """Return HIL_GPS: position and velocity."""
        lat, lon = position_on_sphere(motion.north, motion.east, self._home[0], self._home[1])
        north, east, down = motion.velocity_north, motion.velocity_east, motion.velocity_down
        return mavlink.MAVLink_hil_gps_message(
            round(motion.time * 1e6),
            _FIX_3D,
            round(math.degrees(lat) * 1e7),
            round(math.degrees(lon) * 1e7),
            round((self._home[2] - motion.down) * 1e3),
            round(_GNSS_ACCURACY_M * 100.0),
            round(_GNSS_ACCURACY_M * 100.0),
            round(math.hypot(north, east) * 100.0),
            round(north * 100.0),
            round(east * 100.0),
            round(down * 100.0),
            round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000,
            _SATELLITE_COUNT,
        )


def halfway_motion(before: BodyMotion, after: BodyMotion) -> BodyMotion:
    """Return the motion halfway between two motions; the yaw is halfway along the shorter turn."""
    values = [0.5 * (a + b) for a, b in zip(before, after, strict=True)]
    middle_motion = BodyMotion(*values)
    return middle_motion._replace(yaw=before.yaw + 0.5 * math.remainder(after.yaw - before.yaw, 2.0 * math.pi))


# ----------------------------------------------------------------------
# The socket.

# Size of the receive buffer.
_MAX_RECEIVE_BYTES = 65536
# Interval at which a wait checks whether the program still runs, s.
_CHECK_INTERVAL_S = 0.25


class SimulatorPort:
    """Socket to which PX4 connects.

    port: number of the port.
    check_program: function that is called while nothing arrives; it raises FlightError if the program has ended.
    """

    def __init__(self) -> None:
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.bind((LOOPBACK, 0))
        self._listener.listen(1)
        self.port = int(self._listener.getsockname()[1])
        self.check_program: Callable[[], None] = lambda: None
        self._stream: socket.socket | None = None
        self._mav = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._mav.robust_parsing = True
        self._answers: list[tuple[float, ...]] = []
        self._wait = 0.0
        # A sleeping laptop is not a silent program.
        self._clock = RunningClock()

    def close(self) -> None:
        """Close the socket."""
        self._listener.close()
        if self._stream is not None:
            self._stream.close()

    def connect(self, timeout: float) -> None:
        """Wait until PX4 has connected.

        timeout: s.

        Raises FlightError if the program ends, or does not connect within that time.
        """
        self._listener.settimeout(_CHECK_INTERVAL_S)
        start = self._clock()
        while self._stream is None:
            try:
                self._stream, _ = self._listener.accept()
            except TimeoutError:
                self.check_program()
                if self._clock() - start > timeout:
                    message = f"did not connect to the simulator within {timeout:.0f} s"
                    raise FlightError(message, field="simulator") from None
        self._stream.setblocking(True)
        self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def pack(self, *messages: Any) -> bytes:
        """Return the bytes of some messages, which `send` accepts."""
        return b"".join(message.pack(self._mav) for message in messages)

    def send(self, data: bytes) -> None:
        """Send packed messages to PX4; do nothing if PX4 has ended.

        Raises ValueError before PX4 has connected.
        """
        if self._stream is None:
            raise ValueError("PX4 has not connected")
        try:
            self._stream.sendall(data)
        except OSError:
            # The program is gone: the next wait finds out why.
            return

    def receive_answer(self, timeout: float) -> tuple[float, ...] | None:
        """Return the 16 controls of HIL_ACTUATOR_CONTROLS, or None after a timeout.

        timeout: s, in real time.

        Raises FlightError if the program ends.
        """
        if not self._answers and not (self._receive_data(timeout) and self._answers):
            start = self._clock()
            while not self._answers:
                if not self._receive_data(timeout):
                    self.check_program()
                    if timeout <= _CHECK_INTERVAL_S or self._clock() - start > timeout:
                        return None
        return self._answers.pop(0)

    def require_answer(self) -> tuple[float, ...]:
        """Return PX4's answer to the last step; PX4 must already run its outputs.

        Raises FlightError if no answer arrives within `SILENCE_TIMEOUT_S`.
        """
        answer = self.receive_answer(SILENCE_TIMEOUT_S)
        if answer is None:
            raise FlightError(f"sent no outputs for {SILENCE_TIMEOUT_S:.0f} s; the flight is ended", field="simulator")
        return answer

    def _receive_data(self, timeout: float) -> bool:
        """Read data for up to ``timeout`` s; return True if any data arrived.

        The actuator outputs in the data are appended to `_answers`.

        A single call waits at most `_CHECK_INTERVAL_S`. Raises ValueError before PX4 has connected.
        """
        if self._stream is None:
            raise ValueError("PX4 has not connected")
        wait = min(timeout, _CHECK_INTERVAL_S)
        if wait != self._wait:
            # The kernel's own timeout: one system call per answer.
            self._wait = wait
            self._stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("@ll", 0, round(wait * 1e6)))
        try:
            data = self._stream.recv(_MAX_RECEIVE_BYTES)
        except (BlockingIOError, ConnectionResetError):
            return False
        if not data:
            # The other side closed it: the program is ending.
            return False
        try:
            messages = self._mav.parse_buffer(data) or []
        except (mavlink.MAVError, struct.error):
            return True
        self._answers += [
            tuple(message.controls) for message in messages if message.get_type() == "HIL_ACTUATOR_CONTROLS"
        ]
        return True


# ----------------------------------------------------------------------
# The exchange.

# Frames between two GNSS fixes: a tenth of a second.
_FIX_FRAMES = 12
# Channels of the outputs, in the order of PWM_MAIN_FUNC1..4.
AILERON = 0
ELEVATOR = 1
RUDDER = 2
THROTTLE = 3
# Until its estimator runs, PX4 answers about every fifth step; after this many answers in a row it answers every step.
_RUNNING_ANSWER_COUNT = 50
# Before that, the next step follows if no answer arrives within this time, s by the clock.
_EARLY_ANSWER_TIMEOUT_S = 0.01


class HilLockstep(Lockstep):
    """Exchange over a `SimulatorPort` that runs two steps of PX4 in each frame.

    PX4 samples its sensors at 250 Hz, about twice the frame rate.

    port: socket to which PX4 connects.
    servos: servos of the controls; PX4's outputs of -1..1 (throttle 0..1) are fractions of their throw.
    fdm, workspace, home, poll: see `Lockstep`.
    """

    def __init__(
        self,
        port: SimulatorPort,
        servos: ServoMap,
        fdm: Fdm,
        workspace: Workspace,
        home: Home,
        poll: Callable[[], None],
    ) -> None:
        super().__init__(fdm, workspace, home, poll)
        self._port, self._servos = port, servos
        self._sensors = Sensors(home)
        self._last_motion: BodyMotion | None = None
        self._answer_count = 0
        # The last answer, and True while a step has no answer yet.
        self._last_answer: tuple[float, ...] = (0.0,) * 4
        self._flown_outputs: tuple[float, ...] = self._last_answer
        self._awaits_answer = False

    def _next_outputs(self) -> tuple[float, ...]:
        """Return PX4's outputs after the last step; without an answer, the previous outputs.

        Before the first answer the outputs are zeros. Once PX4 answers every step, wait for the answer. Before that,
        wait at most `_EARLY_ANSWER_TIMEOUT_S`.
        """
        if self._awaits_answer:
            # A running PX4 answers every step.
            answer = (
                self._port.require_answer()
                if self._answer_count >= _RUNNING_ANSWER_COUNT
                else self._port.receive_answer(_EARLY_ANSWER_TIMEOUT_S)
            )
            self._answer_count = 0 if answer is None else self._answer_count + 1
            self._last_answer, self._awaits_answer = answer or self._last_answer, False
        return self._last_answer

    def _send(self, data: bytes) -> None:
        """Send packed sensor messages, which make PX4 run a step."""
        self._port.send(data)
        self._awaits_answer = True

    def boot(self, rail: RailEnd, has_started: Callable[[], bool], stall_time: float, startup_timeout: float) -> None:
        """Run PX4 with the aircraft at rest until PX4's start-up script has ended.

        Meanwhile PX4 gets a step only when it waits for one.

        rail: rail at whose start the aircraft stands.
        has_started: function that returns True once the script has ended.
        stall_time: time without an answer after which PX4 waits for a step, s by the clock.
        startup_timeout: s by the clock.

        Raises FlightError if the script does not end within ``startup_timeout``.
        """
        clock = RunningClock()
        start = clock()
        while not has_started():
            if clock() - start > startup_timeout:
                raise FlightError(f"did not start up within {startup_timeout:.0f} s", field="start-up")
            if self._port.receive_answer(stall_time) is None:
                self.step_on_rail(rail)

    def _next_commands(self) -> Commands:
        """Return the commands that PX4 sent after the first step of the last frame, without waiting."""
        outputs, servos = self._flown_outputs, self._servos
        return Commands(
            servos.elevator.value_at_fraction(outputs[ELEVATOR]),
            servos.aileron.value_at_fraction(outputs[AILERON]),
            servos.rudder.value_at_fraction(outputs[RUDDER]),
            servos.throttle.value_at_fraction(2.0 * outputs[THROTTLE] - 1.0),
        )

    def _send_motion(self, motion: tuple[float, ...], battery: tuple[float, float] | None) -> None:
        """Run two steps of PX4: with the motion halfway from the last frame to this one, and with this motion.

        motion: numbers of a `BodyMotion`.
        battery: not used.
        """
        current = BodyMotion(*motion)
        previous = self._last_motion or current._replace(time=current.time - 1.0 / FRAME_HZ)
        self._last_motion = current
        data = self._port.pack(self._sensors.sensor_message(halfway_motion(previous, current)))
        # PX4's second step of the previous frame, which it has computed while JSBSim made this frame.
        self._next_outputs()
        self._send(data)
        # Packed while PX4 computes that step.
        messages = [self._sensors.sensor_message(current)]
        if self._frame % _FIX_FRAMES == 0:
            messages.append(self._sensors.gnss_message(current))
        data = self._port.pack(*messages)
        self._flown_outputs = self._next_outputs()
        self._send(data)
