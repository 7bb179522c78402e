"""A small autopilot of ours, run as a program in PX4's place: it speaks the simulator link, or fails as it is told.

``python fake_px4.py FAULT [PX4's options]``; FAULT is one of `FAULTS`.  It knows what PX4 would know: its start-up
files for ports and parameters, and its sensors for where it is.
"""

import argparse
import math
import re
import signal
import socket
import sys
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

sys.path.insert(0, str(Path(__file__).parents[4]))

from tests.flight.autopilots.arduplane_sitl.fake_autopilot import EKF_GOOD, GOES_WRONG, KNOWS, METRES, Fake

FAULTS = (
    *("none", "slow-start", "never-starts", "does-not-connect", "silent", "crash", "crash-in-air", "mute", "copter"),
    *("ardupilot", "no-ekf", "refuses", "will-not-arm", "stays-in-manual", "dive"),
)
MANUAL, MISSION = 1 << 16, 4 << 16 | 4 << 24
# As a PX4 that is not yet up, it answers every fifth step for so long, s.
WAKES = 0.3
GRAVITY = 9.80665
# m.  Of its circle about the mission's last item.
CIRCLE = 150.0


class FakePx4(Fake):
    """The program; the flying is `Fake`'s."""

    def __init__(self, fault: str, args: argparse.Namespace) -> None:
        self.fault = fault
        scripts = Path(args.w, "etc", "init.d-posix")
        assert (scripts / "rcS").is_file(), "the start-up files are copied"
        (uav,) = scripts.joinpath("airframes").glob("22000_*")
        lines = [line.split() for line in uav.read_text().splitlines() if line.startswith("param set ")]
        self.parameters = {name: float(value) for _, _, name, value in lines}
        self.port = int(re.search(r"simulator_mavlink start -c (\d+)", (scripts / "px4-rc.simulator").read_text())[1])
        ours, theirs = re.search(r"-u (\d+) -o (\d+) -t 127", (scripts / "px4-rc.mavlink").read_text()).groups()
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", int(ours)))
        self.link.setblocking(False)
        self.station = ("127.0.0.1", int(theirs))
        self.mav, self.hil = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 1, 1)
        self.items: list[Any] = []
        self.wanted = self.count = 0
        self.refused = False
        self.mode, self.armed, self.current = 0, False, 0
        self.auto_since = math.inf
        self.frame = 0
        self.home = (0.0, 0.0, 0.0)
        # What it makes of its sensors.
        self.before, self.fix = 0.0, None
        self.roll = self.pitch = 0.0
        # With its joystick.
        self.sticks = 0

    def run(self) -> None:
        """Fly until somebody ends it."""
        if self.fault == "does-not-connect":
            signal.pause()
        self.simulator = socket.create_connection(("127.0.0.1", self.port))
        while data := self.simulator.recv(65536):
            for message in self.hil.parse_buffer(data) or []:
                if message.get_type() == "HIL_GPS":
                    self.fix = message
                elif message.get_type() == "HIL_SENSOR":
                    self.step(message)

    def step(self, sensed: Any) -> None:
        """One HIL_SENSOR: a step, and its answer."""
        self.frame += 1
        if self.frame == (5 if self.fault == "slow-start" else 2) and self.fault != "never-starts":
            print("INFO  [px4] Startup script returned successfully", flush=True)
        if self.fault == "crash" and self.frame == 600:
            print("out of memory")
            sys.exit(3)
        if self.fault == "silent" and self.frame == 600:
            signal.pause()
        time = sensed.time_usec / 1e6
        self.sense(sensed, time)
        if self.frame % 24 == 0:
            self.talk(time)
        controls = [0.0] * 16
        if self.armed and self.mode == MISSION:
            self.circle_at_the_end()
            aileron, elevator, throttle = self.steer(self.state)
            controls[0], controls[1], controls[3] = aileron, elevator, throttle
            if time > self.auto_since + GOES_WRONG:
                if self.fault == "crash-in-air":
                    sys.exit(1)
                if self.fault == "dive":
                    controls[1], controls[3] = -1.0, 0.0
        if time > WAKES or self.frame % 5 == 0:
            answer = mavlink.MAVLink_hil_actuator_controls_message(sensed.time_usec, controls, 0, 0)
            self.simulator.sendall(answer.pack(self.hil))

    def circle_at_the_end(self) -> None:
        """Once at its mission's last item, say so, and fly around that to the right without end."""
        last = self.items[-1]
        if self.current < len(self.items) - 1 or last.command != mavlink.MAV_CMD_NAV_WAYPOINT:
            return
        north, east, _ = self.state["position"]
        to_north, to_east, _ = self.place(last)
        if math.hypot(to_north - north, to_east - east) < 10.0:
            self.send(mavlink.MAVLink_mission_item_reached_message(self.current))
            last.command, last.param3 = mavlink.MAV_CMD_NAV_LOITER_UNLIM, CIRCLE

    def sense(self, sensed: Any, time: float) -> None:
        """Attitude by the gyro from the accelerometer's at rest; everything else as it is told."""
        dt, self.before = time - self.before, time
        if not self.armed and self.auto_since == math.inf:
            self.roll = math.atan2(-sensed.yacc, -sensed.zacc)
            self.pitch = math.atan2(sensed.xacc, math.hypot(sensed.yacc, sensed.zacc))
            # At rest nobody flies level with an elevator: forces are gravity's alone.
            assert abs(math.hypot(sensed.xacc, sensed.yacc, sensed.zacc) - GRAVITY) < 0.05
        p, q, r = sensed.xgyro, sensed.ygyro, sensed.zgyro
        turning = q * math.sin(self.roll) + r * math.cos(self.roll)
        self.roll += dt * (p + math.tan(self.pitch) * turning)
        self.pitch += dt * (q * math.cos(self.roll) - r * math.sin(self.roll))
        if self.fix is None:
            return
        fix = self.fix
        # In gauss a field of the Earth; hPa at this height; the Pitot tube's, by the density of the sea.
        assert 0.2 < math.hypot(sensed.xmag, sensed.ymag, sensed.zmag) < 0.7
        assert abs(sensed.abs_pressure - 1013.25 * (1.0 - 2.25577e-5 * fix.alt / 1e3) ** 5.25588) < 3.0
        scale = math.cos(math.radians(self.home[0]))
        self.state = {
            "position": (
                (fix.lat / 1e7 - self.home[0]) * METRES,
                (fix.lon / 1e7 - self.home[1]) * METRES * scale,
                self.home[2] - fix.alt / 1e3,
            ),
            "velocity": (fix.vn / 100.0, fix.ve / 100.0, fix.vd / 100.0),
            "attitude": (self.roll, self.pitch, 0.0),
            "imu": {"gyro": (p, q, r)},
            "airspeed": math.sqrt(2.0 * max(0.0, sensed.diff_pressure) * 100.0 / 1.225),
        }

    def talk(self, time: float) -> None:
        """Say what is to be said, and answer what has been asked."""
        if self.fault == "mute":
            return
        kind = mavlink.MAV_TYPE_QUADROTOR if self.fault == "copter" else mavlink.MAV_TYPE_FIXED_WING
        program = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA if self.fault == "ardupilot" else mavlink.MAV_AUTOPILOT_PX4
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        self.send(mavlink.MAVLink_heartbeat_message(kind, program, 1 | armed, self.mode, 4, 3))
        # PX4 sets CONST_POS_MODE, too, where it has a place.
        flags = EKF_GOOD | 128 if time > KNOWS and self.fault != "no-ekf" else 0
        self.send(mavlink.MAVLink_estimator_status_message(0, flags, *[0.0] * 8))
        self.send(mavlink.MAVLink_mission_current_message(self.current))
        while True:
            try:
                data, sender = self.link.recvfrom(65536)
            except BlockingIOError:
                return
            assert sender == self.station
            for message in self.mav.parse_buffer(data) or []:
                answer = getattr(self, f"on_{message.get_type().lower()}", None)
                if answer is not None:
                    answer(message, time)

    def send(self, message: Any) -> None:
        self.link.sendto(message.pack(self.mav), self.station)

    def on_manual_control(self, message: Any, _time: float) -> None:
        assert (message.x, message.y, message.z, message.r) == (0, 0, 0, 0)
        self.sticks += 1

    def on_command_int(self, message: Any, time: float) -> None:
        self.home = (message.x / 1e7, message.y / 1e7, message.z)
        super().on_command_int(message, time)

    def on_command_long(self, message: Any, time: float) -> None:
        result = mavlink.MAV_RESULT_ACCEPTED
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 == 1.0:
            # In MANUAL, with a joystick.
            self.armed = self.fault != "will-not-arm" and self.mode == MANUAL and self.sticks > 0
            if not self.armed:
                result = mavlink.MAV_RESULT_FAILED
                self.send(mavlink.MAVLink_statustext_message(2, b"Arming denied: no will"))
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = False
            log = Path("log", "2026-01-01", "00_00_00.ulg")
            log.parent.mkdir(parents=True)
            log.write_bytes(b"ULogfake")
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            mode = int(message.param2) << 16 | int(message.param3) << 24
            if mode == MISSION and self.fault == "stays-in-manual":
                result = mavlink.MAV_RESULT_DENIED
            else:
                self.mode = mode
                self.auto_since = time if mode == MISSION else self.auto_since
        elif message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            version = [0] * 8
            self.send(
                mavlink.MAVLink_autopilot_version_message(0, 0x011000FF, 0, 0, 0, version, version, version, 0, 0, 0)
            )
        self.send(mavlink.MAVLink_command_ack_message(message.command, result))


def main() -> None:
    """Take PX4's options, and be it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("fault", choices=FAULTS)
    for option in ("-i", "-w"):
        parser.add_argument(option)
    parser.add_argument("-d", action="store_true")
    args = parser.parse_args()
    # As PX4 does, and leaves it.
    Path(f"/tmp/px4_lock-{args.i}").touch()
    FakePx4(args.fault, args).run()


if __name__ == "__main__":
    main()
