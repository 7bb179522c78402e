"""Write a flight as the telemetry log (`.tlog`) that a ground station would have recorded.

Mission Planner, MAVProxy and pymavlink use this format: each MAVLink frame is preceded by its time of arrival in
microseconds since 1970, as eight bytes, big-endian.  The live vehicle sends the same frames at the same rates.  The
clock of the log starts at the beginning of the year 2000.
"""

import itertools
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mission_server import mission_lists, to_message
from flight.live.telemetry import (
    ACTIVE,
    AUTO,
    COMPLETE,
    CRITICAL,
    INFO,
    PERIODS,
    WARNING,
    SnapshotMaker,
    Status,
    status_texts,
    telemetry_message,
)
from flight.mission.items import Home
from flight.simulation.simulate import LocalMap
from flight.simulation.track import track_rows
from logs.recording.reader import FlightLog
from logs.recording.state_channel import EPOCH_NS
from logs.views.exports.log_files import battery_voltage

# Format of the time before each frame.
_STAMP = struct.Struct(">Q")
# Interval of heartbeats, s.
_HEARTBEAT_INTERVAL_S = 1.0
# MAVLink severity of each log level.
_SEVERITY = {"debug": INFO, "info": INFO, "warning": WARNING, "error": CRITICAL, "fatal": CRITICAL}
# System and component of the vehicle.
_VEHICLE = (1, mavlink.MAV_COMP_ID_AUTOPILOT1)
# System and component of the ground station.
_STATION = (255, mavlink.MAV_COMP_ID_MISSIONPLANNER)


def telemetry_bytes(log: FlightLog) -> bytes:
    """Encode a flight as a telemetry log file: mission upload, telemetry, reached items, and event texts.

    >>> from logs.recording.example_log import example_log
    >>> data = telemetry_bytes(example_log())
    >>> struct.unpack(">Q", data[:8])[0] == EPOCH_NS // 1000, data[8] == 0xFD  # the first frame is of MAVLink 2
    (True, True)
    """
    items, _, _ = mission_lists(log.setup.mission)
    upload_messages = [
        # No base mode, no custom mode, state ACTIVE (4), MAVLink version 3.
        mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3),
        # Target system and component 1, number of items, mission type 0 (the mission itself).
        mavlink.MAVLink_mission_count_message(1, 1, len(items), 0),
        *map(to_message, items),
    ]
    station, vehicle = mavlink.MAVLink(None, *_STATION), mavlink.MAVLink(None, *_VEHICLE)
    station_frames = ((0.0, station, message) for message in upload_messages)
    vehicle_frames = ((time, vehicle, message) for time, message in _make_flight_messages(log))
    data = bytearray()
    for time, sender, message in itertools.chain(station_frames, vehicle_frames):
        data += _STAMP.pack(EPOCH_NS // 1000 + round(time * 1e6)) + message.pack(sender)
        sender.seq = (sender.seq + 1) % 256
    return bytes(data)


def _make_flight_messages(log: FlightLog) -> Iterator[tuple[float, Any]]:
    """Yield each message that the vehicle sends during the flight, with its time, s.

    The times do not decrease.
    """
    setup, track = log.setup, log.track
    snapshots = SnapshotMaker(setup, LocalMap.around(setup))
    start = snapshots.start_snapshot(setup)
    home = setup.mission.home or Home(start.lat_deg, start.lon_deg, start.amsl)
    status = Status(start, home, battery=setup.battery, mode=AUTO, armed=True, flying=True, mission_state=ACTIVE)
    status.volts = battery_voltage(log)
    status.total, items = len(setup.mission.items), setup.route.items
    number_by_seq = {item.seq: k for k, item in enumerate(setup.mission.items, 1)}
    due_times = {"HEARTBEAT": 0.0, **dict.fromkeys(PERIODS, 0.0)}
    events, text_count, active_leg = list(log.events), 0, -1
    rows = track_rows(track)
    for row, time in zip(rows, track.time.tolist(), strict=True):
        while events and events[0].time <= time:
            text_count += 1
            event = events.pop(0)
            for message in status_texts(event.text, _SEVERITY.get(event.level, INFO), text_count):
                yield time, message
        due_names = [name for name, due_time in due_times.items() if time >= due_time - 1e-6]
        if not due_names and int(row.leg) == active_leg:
            continue
        snapshot = snapshots.snapshot(row)
        if not snapshot.is_finite:
            continue
        status.snapshot, status.boot, status.wall = snapshot, time, EPOCH_NS / 1e9 + time
        if int(row.leg) != active_leg:
            passed = items[max(0, active_leg + 1) : int(row.leg) + 1]
            active_leg = int(row.leg)
            for item in passed[passed >= 0].tolist():
                yield time, mavlink.MAVLink_mission_item_reached_message(number_by_seq[item])
            remaining_items = items[active_leg + 1 :]
            status.current = (
                number_by_seq[int(remaining_items[remaining_items >= 0][0])]
                if np.any(remaining_items >= 0)
                else status.current
            )
            yield time, telemetry_message("MISSION_CURRENT", status)
        for name in due_names:
            due_times[name] += max(PERIODS.get(name, _HEARTBEAT_INTERVAL_S), 1e-3)
            yield time, telemetry_message(name, status)
    end_time = float(track.time[-1]) if len(track) else 0.0
    for event in events:
        text_count += 1
        for message in status_texts(event.text, _SEVERITY.get(event.level, INFO), text_count):
            yield end_time, message
    status.armed = status.flying = False
    status.mission_state = COMPLETE if log.ended == "completed" else ACTIVE
    for name in ("HEARTBEAT", "MISSION_CURRENT"):
        yield end_time, telemetry_message(name, status)
