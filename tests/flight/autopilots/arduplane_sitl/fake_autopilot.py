"""A small autopilot of ours, run as a program in ArduPlane's place: it flies waypoints, or fails as it is told.

``python fake_autopilot.py FAULT [ArduPlane's options]``; FAULT is one of `FAULTS`.  The fake of PX4 flies by it, too.
"""

import argparse
import json
import math
import os
import signal
import socket
import struct
import sys
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

FAULTS = (
    *("none", "32-outputs", "magic", "deaf", "silent", "crash", "signal", "panic", "no-ekf", "refuses", "no-space"),
    *("copter", "mute", "reboot", "dive", "crash-in-air", "will-not-arm", "dives-home"),
)
METRES = 111318.845
AUTO = 10
NEUTRAL, FULL = 1500, 400
EKF_GOOD = 0b111111
FLOWN = (
    *(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LOITER_UNLIM),
    *(mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH),
)
OVER_HOME = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
# It returns to a circle so wide over home, m, at RTL_ALTITUDE, and sinks at once; one that fails to this height, m.
HOME_CIRCLE, TOO_LOW = 150.0, 20.0
# It flares so high over the landing point, m.
FLARE = 4.0
# Seconds on the rail before it knows where it is, and in AUTO before what is to go wrong in the air does.
KNOWS, GOES_WRONG = 2.0, 30.0


class Fake:
    """The program: a socket for the physics, one for MAVLink, and what it has been told."""

    # Of the elevator, in level flight.
    trim = 0.15

    def __init__(self, fault: str, args: argparse.Namespace) -> None:
        self.fault = fault
        self.home = [float(part) for part in args.home.split(",")]
        lines = Path(args.defaults).read_text(encoding="ascii").splitlines()
        self.parameters = {name: float(value) for name, value in (line.split() for line in lines)}
        self.physics = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.physics.settimeout(0.2)
        self.physics.connect((args.model.partition(":")[2], args.sim_port_out))
        _, host, port = args.serial0.split(":")
        self.link = socket.create_connection((host, int(port)))
        # Otherwise each message waits for the one before it to be acknowledged, some thousand frames.
        self.link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.link.setblocking(False)
        self.mav = mavlink.MAVLink(None, 1, 1)
        self.items: list[Any] = []
        self.wanted = self.count = 0
        self.refused = False
        self.mode, self.armed, self.current = 0, False, 0
        self.auto_since = math.inf
        self.frame = 0

    def run(self) -> None:
        """Fly until somebody ends it."""
        pulses = [NEUTRAL] * 16
        while True:
            if self.fault == "crash" and self.frame == 300:
                print("out of memory")
                sys.exit(3)
            if self.fault == "signal" and self.frame == 300:
                os.kill(os.getpid(), signal.SIGSEGV)
            if self.fault == "silent" and self.frame == 300:
                signal.pause()
            state = self.exchange(pulses)
            time = state["timestamp"]
            if self.frame % 12 == 0:
                self.talk(time)
            pulses = pulses_of(*self.steer(state)) if self.mode == AUTO else [NEUTRAL] * 16
            if time > self.auto_since + GOES_WRONG:
                if self.fault == "dive":
                    pulses[1], pulses[2] = NEUTRAL - FULL, 1000
                if self.fault == "crash-in-air":
                    sys.exit(1)
                if self.fault == "reboot":
                    self.frame, self.fault = 0, "none"

    def exchange(self, pulses: list[int]) -> dict[str, Any]:
        """Send the servo outputs, and wait for the aircraft's motion; ask again where it does not come."""
        self.frame += 1
        magic, count = (29569, 32) if self.fault == "32-outputs" else (18458, 16)
        if self.fault == "magic":
            magic = 4711
        outputs = (pulses + [0] * count)[:count]
        while True:
            self.physics.send(struct.pack(f"<HHI{count}H", magic, 120, self.frame, *outputs))
            try:
                data = self.physics.recv(4096)
            except TimeoutError:
                continue
            if self.fault == "deaf" and self.frame == 300:
                continue
            state: dict[str, Any] = json.loads(data)
            return state

    def talk(self, time: float) -> None:
        """Say what is to be said, and answer what has been asked."""
        if self.fault == "mute":
            return
        if self.frame % 120 == 0:
            kind = mavlink.MAV_TYPE_QUADROTOR if self.fault == "copter" else mavlink.MAV_TYPE_FIXED_WING
            armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            self.send(mavlink.MAVLink_heartbeat_message(kind, 3, 1 | armed, self.mode, 4, 3))
        flags = EKF_GOOD if time > KNOWS and self.fault != "no-ekf" else 0
        self.send(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))
        self.send(mavlink.MAVLink_mission_current_message(self.current))
        try:
            data = self.link.recv(65536)
        except BlockingIOError:
            return
        for message in self.mav.parse_buffer(data) or []:
            answer = getattr(self, f"on_{message.get_type().lower()}", None)
            if answer is not None:
                answer(message, time)

    def send(self, message: Any) -> None:
        self.link.sendall(message.pack(self.mav))

    def on_param_request_read(self, message: Any, _time: float) -> None:
        name = message.param_id
        if name in self.parameters and not name.endswith("UNKNOWN"):
            value = self.parameters[name]
            self.send(mavlink.MAVLink_param_value_message(name.encode(), value, 9, len(self.parameters), 0))

    def on_command_long(self, message: Any, time: float) -> None:
        result = mavlink.MAV_RESULT_ACCEPTED
        if message.command == mavlink.MAV_CMD_DO_SEND_BANNER:
            self.send(mavlink.MAVLink_statustext_message(6, b"ArduPlane V0.0-fake (0badc0de)"))
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = self.fault != "will-not-arm"
            if not self.armed:
                result = mavlink.MAV_RESULT_FAILED
                self.send(mavlink.MAVLink_statustext_message(2, b"Arm: no will"))
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            self.mode, self.current, self.auto_since = int(message.param2), 1, time
        self.send(mavlink.MAVLink_command_ack_message(message.command, result))

    def on_command_int(self, message: Any, _time: float) -> None:
        self.send(mavlink.MAVLink_command_ack_message(message.command, mavlink.MAV_RESULT_ACCEPTED))

    def on_mission_count(self, message: Any, _time: float) -> None:
        if self.fault == "no-space" and not self.refused:
            self.refused = True
            self.send(mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_NO_SPACE))
            return
        self.items, self.count = [], message.count
        self.send(mavlink.MAVLink_mission_request_message(255, 190, 0))

    def on_mission_item_int(self, message: Any, _time: float) -> None:
        if message.seq != len(self.items):
            return
        self.items.append(message)
        if self.fault == "refuses" and message.seq == 2:
            self.send(mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_UNSUPPORTED))
        elif len(self.items) < self.count:
            self.send(mavlink.MAVLink_mission_request_message(255, 190, len(self.items)))
        else:
            self.send(mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_ACCEPTED))

    def place(self, item: Any) -> tuple[float, float, float]:
        """North, east and down of an item from home, m."""
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return 0.0, 0.0, -TOO_LOW if self.fault == "dives-home" else -self.parameters.get("RTL_ALTITUDE", 100.0)
        lat, lon = item.x / 1e7, item.y / 1e7
        scale = math.cos(math.radians(0.5 * (lat + self.home[0])))
        down = -item.z if item.frame in OVER_HOME else self.home[2] - item.z
        return (lat - self.home[0]) * METRES, (lon - self.home[1]) * METRES * scale, down

    def take_off(self, state: dict[str, Any]) -> tuple[float, float, float]:
        """Wings level, nose up, and the motor from where it has been pushed at all; on above the item's height."""
        roll, pitch, _ = state["attitude"]
        p, q, _ = state["imu"]["gyro"]
        moves = math.hypot(*state["velocity"]) > 5.0
        if -state["position"][2] > -self.place(self.items[self.current])[2]:
            self.current += 1
        return -0.6 * roll - 0.1 * p, 0.15 + 0.8 * (0.17 - pitch) - 0.15 * q, 1.0 if moves else 0.0

    def glide(self, state: dict[str, Any], item: Any) -> tuple[float, float]:
        """Down that the glide from the place before has here, m, and its sink at this speed, m/s."""
        (north, east, down), before = self.place(item), self.place(self.items[self.current - 1])
        run = math.hypot(north - before[0], east - before[1])
        left = math.hypot(north - state["position"][0], east - state["position"][1])
        slope = (down - before[2]) / run
        return down - slope * min(run, left), slope * math.hypot(*state["velocity"][:2])

    def steer(self, state: dict[str, Any]) -> tuple[float, float, float]:
        """Fly to the current waypoint: bank for the course to it, pitch for its height, throttle for the speed.

        Aileron, elevator (positive for nose up) and throttle, as shares of their throw.
        """
        north, east, down = state["position"]
        v_north, v_east, v_down = state["velocity"]
        roll, pitch, _ = state["attitude"]
        p, q, _ = state["imu"]["gyro"]
        while self.items[self.current].command not in FLOWN:
            self.current += 1
        item = self.items[self.current]
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self.take_off(state)
        to_north, to_east, to_down = self.place(item)
        lands = item.command == mavlink.MAV_CMD_NAV_LAND
        if lands and to_down - down < FLARE:
            # Wings level, the motor off, the nose level.
            return -0.6 * roll - 0.1 * p, self.trim - 0.8 * pitch - 0.15 * q, 0.0
        sink = 0.0
        if lands:
            to_down, sink = self.glide(state, item)
        distance = math.hypot(to_north - north, to_east - east)
        ahead = (to_north - north) * v_north + (to_east - east) * v_east
        if (distance < 10.0 or (distance < 60.0 and ahead < 0.0)) and self.current + 1 < len(self.items):
            self.current += 1
        wanted, level = math.atan2(to_east - east, to_north - north), 0.0
        home = item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        circle = HOME_CIRCLE if home else item.param3 if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM else 0.0
        if distance < 2.0 * abs(circle):
            # Around its middle: square to the way there on the rim, towards it outside, and banked for the circle.
            side, radius = math.copysign(1.0, circle), abs(circle)
            wanted += side * (math.atan(4.0 * (distance - radius) / radius) - 0.5 * math.pi)
            level = side * math.atan((v_north**2 + v_east**2) / (9.80665 * radius))
        turn = math.remainder(wanted - math.atan2(v_east, v_north), math.tau)
        bank = max(-0.5, min(0.5, level + 1.5 * turn))
        # One that dives home takes seconds, where 3 m/s would take it minutes in its circle.
        most_sink = 8.0 if home and self.fault == "dives-home" else 3.0
        climb = max(-most_sink, min(3.0, (0.9 if lands else 0.3) * (down - to_down))) - sink
        aim = 0.06 + 0.05 * (climb + v_down)
        aileron = 0.6 * (bank - roll) - 0.1 * p
        if self.items[1].command == mavlink.MAV_CMD_NAV_TAKEOFF:
            # To a height that is good enough to land from.
            self.trim += 0.002 * (aim - pitch)
        elevator = self.trim + 0.8 * (aim - pitch) - 0.15 * q + 0.1 * roll * roll
        throttle = 0.77 + 0.05 * ((21.0 if lands else 25.0) - state["airspeed"]) + 0.03 * climb
        return max(-1.0, min(1.0, aileron)), max(-1.0, min(1.0, elevator)), max(0.0, min(1.0, throttle))


def pulses_of(aileron: float, elevator: float, throttle: float) -> list[int]:
    """The pulses of ArduPlane's outputs; nose up is more microseconds."""
    surfaces = [NEUTRAL + round(FULL * share) for share in (aileron, elevator)]
    return [*surfaces, 1000 + round(1000 * throttle), NEUTRAL, *[0] * 12]


def main() -> None:
    """Take ArduPlane's options, and be it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("fault", choices=FAULTS)
    for option in ("--model", "--speedup", "--home", "--serial0", "--defaults", "--base-port", "--rc-in-port", "-I"):
        parser.add_argument(option)
    for option in ("--sim-port-out", "--sim-port-in"):
        parser.add_argument(option, type=int)
    parser.add_argument("--wipe", action="store_true")
    args = parser.parse_args()
    if args.fault == "panic":
        print("PANIC: Failed to load defaults")
        sys.exit(1)
    Path("logs").mkdir()
    Path("logs", "00000001.BIN").write_bytes(b"\xa3\x95fake")
    Fake(args.fault, args).run()


if __name__ == "__main__":
    main()
