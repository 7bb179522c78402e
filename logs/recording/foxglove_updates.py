"""Encode the moving parts of 3-D views: pose, track and events.

Point clouds are added for viewers without meshes.
"""

import math
from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from logs import theme
from logs.recording import foxglove_scene as scene
from logs.recording.foxglove_scene import (
    AIRCRAFT_FRAME,
    MAP_FRAME,
    log_message,
    model_corners,
    terrain_points,
    timestamp,
)
from logs.recording.mcap_writer import SECOND_NS, MessageRecords, single_record, stamped_records
from logs.recording.state_channel import (
    EPOCH_NS,
    Encoded,
    as_bytes,
    fill_doubles,
    fill_submessages,
    submessage_dtype,
    tagged_doubles,
)
from world.arrays import Floats, Ints
from world.frames import GeoOrigin, to_geo
from world.scenario import Scenario
from world.threats import Threats

# ----------------------------------------------------------------------
# The flown track as a growing line: every 2 s the whole track, in a bounded number of points.
# A viewer that seeks gets only the newest message, so each message contains the whole track.  To keep the file small,
# older parts lose the points that are nearest to the straight line between their neighbours.

# Time between messages, s.
TRACK_INTERVAL_S = 2
# Maximum number of points of one message.
MAX_POINTS = 96
# Number of points to which a message is thinned when it exceeds the maximum number.
THINNED_POINT_COUNT = 64


class GrowingTrack:
    """Points of the track flown so far, oldest first, thinned so that their number stays bounded."""

    def __init__(self) -> None:
        self._points = np.zeros((MAX_POINTS + 1, 3))
        self._count = 0

    def add(self, position: Floats) -> Floats:
        """Add the next position, m, (3,), and return the track so far, thinned to `MAX_POINTS` points.

        Call this every `TRACK_INTERVAL_S`.  The returned array is valid only until the next call.

        >>> track = GrowingTrack()
        >>> for k in range(500):
        ...     points = track.add(np.array([float(k), 0.0, 100.0]))
        >>> len(points) <= MAX_POINTS, points[0].tolist(), points[-1].tolist()
        (True, [0.0, 0.0, 100.0], [499.0, 0.0, 100.0])
        """
        self._points[self._count] = position
        self._count += 1
        if self._count > MAX_POINTS:
            self._points[:THINNED_POINT_COUNT] = thin_line(self._points, THINNED_POINT_COUNT)
            self._count = THINNED_POINT_COUNT
        return self._points[: self._count]


def thin_line(points: Floats, point_count: int) -> Floats:
    """Reduce the points of a line, (n, 3), to `point_count` points; the ends of the line are kept.

    Repeatedly drops the points that are nearest to the straight line between their neighbours.

    >>> corner = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 9.0, 0.0]])
    >>> thin_line(corner, 3)[:, :2].tolist()
    [[0.0, 0.0], [10.0, 0.0], [10.0, 9.0]]
    """
    while len(points) > point_count:
        previous, inner, following = points[:-2], points[1:-1], points[2:]
        chord = following - previous
        fraction = np.clip(
            ((inner - previous) * chord).sum(axis=1) / np.maximum((chord**2).sum(axis=1), 1e-9), 0.0, 1.0
        )
        distance_square = ((previous + fraction[:, None] * chord - inner) ** 2).sum(axis=1)
        is_dropped = np.zeros(len(points), dtype=bool)
        for k in np.argsort(distance_square, kind="stable")[: len(points) - point_count].tolist():
            # Drop only one of two neighbours, because its removal changes the distance of the other.
            is_dropped[k + 1] = not (is_dropped[k] or is_dropped[k + 2])
        points = points[~is_dropped]
    return points


# ----------------------------------------------------------------------
# Events in flight, recorded when they happen: starts of legs, entries into and exits from the ranges of threats.

# Name of the source of these events in the log.  The reader skips them, because a timeline computes them itself.
EVENT_SOURCE = "flight"
# Interval between checks of threats, ns.
_CHECK_INTERVAL_NS = 200_000_000


class FlightEvents:
    """Detector of flight events, which encodes them as Log messages.

    It stores the last leg and the threats in range, so that the events do not depend on how the rows are split into
    blocks.
    """

    def __init__(self, setup: FlightSetup, channel: int) -> None:
        """Prepare for the flight of a setup.

        channel: number of the channel for events.
        """
        self._route, self._threats, self._channel = setup.route, setup.scenario.threats, channel
        self._leg, self._slot = -1, -1
        self._inside = {
            "missile range": np.zeros(len(self._threats.names), dtype=bool),
            "radar range": np.zeros(len(self._threats.names), dtype=bool),
        }

    def event_records(self, log_times: Ints, position: Floats, leg: Floats) -> Iterator[MessageRecords]:
        """Yield a message for each event in the next rows.

        An event is a new leg, or an entry into or exit from a threat's range.

        Ranges are checked once every `_CHECK_INTERVAL_NS`.

        log_times: log time of each row, ns, (n,).
        position: m, (n, 3).
        leg: active leg of each row, (n,).
        """
        if not len(log_times):
            return
        route = self._route
        for k in np.flatnonzero(np.diff(leg, prepend=self._leg) != 0).tolist():
            # The start of a leg: its number, and the waypoint and item to which it leads.
            text, waypoint = f"leg {int(leg[k])}", int(leg[k]) + 1
            if 0 <= waypoint < len(route.items):
                item_text = f" (item {route.items[waypoint]})" if route.items[waypoint] >= 0 else ""
                text = f"leg {route.leg_numbers[waypoint - 1]}, to waypoint {route.stops[waypoint]}{item_text}"
            yield self._event_record(int(log_times[k]), text, "info")
        self._leg = int(leg[-1])
        slots = log_times // _CHECK_INTERVAL_NS
        checked_rows = np.flatnonzero(np.diff(slots, prepend=self._slot) > 0)
        self._slot = int(slots[-1])
        if not len(self._threats.names) or not checked_rows.size:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            offsets = position[checked_rows, None, :] - self._threats.position
            distance = np.sqrt((offsets**2).sum(axis=2))
        reaches = (self._threats.kill_radius, self._threats.detection_radius)
        for (kind, was_inside), radius in zip(self._inside.items(), reaches, strict=True):
            is_inside = (distance < radius) & (radius > 0.0)
            has_changed = np.diff(is_inside, axis=0, prepend=was_inside[None, :])
            for row, threat in np.argwhere(has_changed).tolist():
                has_entered, name = bool(is_inside[row, threat]), self._threats.names[threat]
                text = f"inside the {kind} of {name}" if has_entered else f"out of the {kind} of {name}"
                level = "warning" if has_entered and kind == "missile range" else "info"
                yield self._event_record(int(log_times[checked_rows[row]]), text, level)
            self._inside[kind] = is_inside[-1]

    def _event_record(self, time: int, text: str, level: str) -> MessageRecords:
        """Encode one event as a message record.

        time: log time, ns.
        """
        message = log_message(time, text, level, EVENT_SOURCE).SerializeToString(deterministic=True)
        return single_record(self._channel, time, message)


# ----------------------------------------------------------------------
# Ground, plan, threats, track and aircraft as points, for viewers without triangles and lines, such as Rerun.
# Rerun's reader of MCAP knows foxglove.PointCloud, FrameTransform and LocationFix, and no foxglove.SceneUpdate.

Colour = tuple[int, int, int, int]

_POINT_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("alpha", "u1")]
)
_ELEMENT_TYPES = {"f": PackedElementField.FLOAT32, "u": PackedElementField.UINT8}


def _colour_bytes(role: str) -> Colour:
    """Return the colour of a role as red, green, blue and opacity, 0 to 255."""
    red, green, blue, opacity = (round(255.0 * part) for part in theme.rgba(role, dark=True))
    return red, green, blue, opacity


_PLAN_COLOUR = _colour_bytes("planned")
_TRACK_COLOUR = _colour_bytes("flown")
_AIRCRAFT_COLOUR = _colour_bytes("highlight")
_KILL_COLOUR = _colour_bytes("missile")
_DETECTION_COLOUR = _colour_bytes("radar")
# Distance between points of a line, m.
_POINT_SPACING_M = 30.0
# Maximum number of points of a line.
_MAX_SAMPLES = 4000
# Number of points of a sphere.
_SPHERE_POINTS = 150
# Number of intervals along each side of a triangle.
_SIDE_INTERVALS = 7


def point_cloud(time_ns: int, frame: str, points: Floats, colours: NDArray[np.uint8] | Colour) -> bytes:
    """Encode points as a PointCloud in a frame, rounded to 1/16 m.

    points: m, (n, 3).
    colours: red, green, blue and opacity, 0 to 255, (n, 4), or one colour for all points.
    """
    packed = np.zeros(len(points), dtype=_POINT_DTYPE)
    with np.errstate(over="ignore", invalid="ignore"):
        for column, name in enumerate("xyz"):
            packed[name] = np.round(points[:, column] * 16.0) / 16.0
    shades = np.broadcast_to(np.asarray(colours, dtype=np.uint8), (len(points), 4))
    for column, name in enumerate(("red", "green", "blue", "alpha")):
        packed[name] = shades[:, column]
    message = PointCloud(
        timestamp=timestamp(time_ns),
        frame_id=frame,
        pose=Pose(position=Vector3(), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
        point_stride=_POINT_DTYPE.itemsize,
        fields=[
            PackedElementField(
                name=name, offset=_POINT_DTYPE.fields[name][1], type=_ELEMENT_TYPES[_POINT_DTYPE.fields[name][0].kind]
            )
            for name in _POINT_DTYPE.names or ()
            if _POINT_DTYPE.fields is not None
        ],
        data=packed.tobytes(),
    )
    return message.SerializeToString(deterministic=True)


def ground_cloud(time_ns: int, scenario: Scenario) -> bytes:
    """Encode the ground as a point cloud of the mesh vertices with known height."""
    points, colours = terrain_points(scenario)
    shades = np.hstack([np.round(colours * 255.0), np.full((len(points), 1), 255.0)]).astype(np.uint8)
    return point_cloud(time_ns, MAP_FRAME, points, shades)


def plan_cloud(time_ns: int, waypoints: Floats) -> bytes:
    """Encode the legs between waypoints (m, (w, 3)) as a point cloud."""
    return point_cloud(time_ns, MAP_FRAME, points_along_legs(waypoints), _PLAN_COLOUR)


def track_cloud(time_ns: int, positions: Floats) -> bytes:
    """Encode the flown positions (m, (n, 3)) as a point cloud."""
    return point_cloud(time_ns, MAP_FRAME, positions, _TRACK_COLOUR)


def aircraft_cloud(time_ns: int) -> bytes:
    """Encode the aircraft model as a point cloud in the aircraft's frame.

    The points form a grid on each triangle of the model, with `_SIDE_INTERVALS` intervals on each side.
    """
    first, second, third = (corner[:, None, :] for corner in np.moveaxis(model_corners().astype(np.float64), 1, 0))
    weights = [
        (i / _SIDE_INTERVALS, j / _SIDE_INTERVALS)
        for i in range(_SIDE_INTERVALS + 1)
        for j in range(_SIDE_INTERVALS + 1 - i)
    ]
    first_weight, second_weight = (np.array(column)[None, :, None] for column in zip(*weights, strict=True))
    points = (first_weight * first + second_weight * second + (1.0 - first_weight - second_weight) * third).reshape(
        -1, 3
    )
    return point_cloud(time_ns, AIRCRAFT_FRAME, np.unique(np.round(points, 2), axis=0), _AIRCRAFT_COLOUR)


def threats_cloud(time_ns: int, threats: Threats) -> bytes:
    """Encode the spheres of missiles and radars as a point cloud, with evenly distributed points."""
    # A Fibonacci lattice: equal steps in height, each turned by the golden angle.
    k = np.arange(_SPHERE_POINTS) + 0.5
    height, angle = 1.0 - 2.0 * k / _SPHERE_POINTS, math.pi * (1.0 + math.sqrt(5.0)) * k
    sphere = np.stack(
        [np.sqrt(1.0 - height**2) * np.cos(angle), np.sqrt(1.0 - height**2) * np.sin(angle), height], axis=1
    )
    points, shades = [np.zeros((0, 3))], [np.zeros((0, 4), dtype=np.uint8)]
    for radii, colour in ((threats.kill_radius, _KILL_COLOUR), (threats.detection_radius, _DETECTION_COLOUR)):
        for center, radius in zip(threats.position, radii, strict=True):
            if radius > 0.0:
                points.append(center + float(radius) * sphere)
                shades.append(np.tile(np.array(colour, dtype=np.uint8), (_SPHERE_POINTS, 1)))
    return point_cloud(time_ns, MAP_FRAME, np.concatenate(points), np.concatenate(shades))


def points_along_legs(waypoints: Floats) -> Floats:
    """Sample the legs between waypoints (w, 3), m, at even spacing along each leg.

    Return the points, m, (n, 3), including the waypoints.
    """
    lengths = np.sqrt((np.diff(waypoints, axis=0) ** 2).sum(axis=1))
    spacing = max(_POINT_SPACING_M, float(lengths.sum()) / _MAX_SAMPLES)
    legs = [
        np.linspace(start, end, max(1, math.ceil(length / spacing)), endpoint=False)
        for start, end, length in zip(waypoints[:-1], waypoints[1:], lengths.tolist(), strict=True)
    ]
    return np.concatenate([*legs, waypoints[-1:]])


# ----------------------------------------------------------------------
# The moving parts of views: a transform five times a second, a position fix each second, and the track.

TF_TOPIC = "/tf"
FIX_TOPIC = "/fix"
TRACK_TOPIC = "/scene/track"
TRACK_POINTS = "/points/track"

# Interval of transforms, ns (5 Hz); the interval of fixes is one second.
_SLOT_NS = 200_000_000
_XYZ = "xyz"
_XYZW = "xyzw"
_GEO = ("latitude", "longitude", "altitude")
# Minimum time between messages with the points of the track, s.
_MIN_CLOUD_INTERVAL_S = 10.0
# Minimum ratio of the times of successive messages with these points.  It limits their number.
_CLOUD_RATIO = 1.05
# Constant parts of the messages after their timestamps, in protobuf's encoding.
_TRANSFORM_NAMES = FrameTransform(
    parent_frame_id=scene.MAP_FRAME, child_frame_id=scene.AIRCRAFT_FRAME
).SerializeToString(deterministic=True)
_TRANSFORM_DTYPE = np.dtype(
    [
        ("names", np.uint8, (len(_TRANSFORM_NAMES),)),
        ("translation", submessage_dtype(_XYZ)),
        ("rotation", submessage_dtype(_XYZW)),
    ]
)
_FIX_NAMES = LocationFix(frame_id=scene.AIRCRAFT_FRAME).SerializeToString(deterministic=True)
_FIX_DTYPE = np.dtype([("names", np.uint8, (len(_FIX_NAMES),)), *tagged_doubles(_GEO)])


def transform_messages(channel: int, log_times: Ints, position: Floats, attitude: Floats) -> MessageRecords:
    """Encode position and attitude of the aircraft as a FrameTransform for each of n rows.

    Positions are rounded to 2^-10 m and quaternions to 2^-20, which is invisible and halves their size in the log.  The
    state message is exact.

    log_times: ns, (n,).
    position: m, (n, 3).
    attitude: roll, pitch and yaw, rad, (n, 3).
    """
    with np.errstate(over="ignore", invalid="ignore"):
        translation = np.round(position * 1024.0) / 1024.0
    rotation = np.round(scene.body_rotation(attitude) * 2.0**20) / 2.0**20
    messages: Encoded = np.zeros(len(log_times), dtype=_TRANSFORM_DTYPE)
    messages["names"] = np.frombuffer(_TRANSFORM_NAMES, np.uint8)
    fill_submessages(messages["translation"], FrameTransform.TRANSLATION_FIELD_NUMBER, _XYZ, translation)
    fill_submessages(messages["rotation"], FrameTransform.ROTATION_FIELD_NUMBER, _XYZW, rotation)
    return stamped_records(log_times, channel, FrameTransform.TIMESTAMP_FIELD_NUMBER, as_bytes(messages))


def fix_messages(channel: int, log_times: Ints, origin: GeoOrigin, position: Floats) -> MessageRecords:
    """Encode latitude, longitude and altitude AMSL as a LocationFix for each of n rows.

    log_times: ns, (n,).
    position: m, (n, 3).
    """
    east, north, up = position.T
    lat, lon = to_geo(origin, east, north)
    messages: Encoded = np.zeros(len(log_times), dtype=_FIX_DTYPE)
    messages["names"] = np.frombuffer(_FIX_NAMES, np.uint8)
    fill_doubles(messages, _GEO, np.stack([lat, lon, up], axis=1))
    return stamped_records(log_times, channel, LocationFix.TIMESTAMP_FIELD_NUMBER, as_bytes(messages))


class ViewerMessages:
    """Encoder of the track's rows as messages for viewers: transforms, position fixes, and the track."""

    def __init__(self, origin: GeoOrigin, channels: dict[str, int]) -> None:
        """Prepare for a flight on the map with this origin.

        channels: number of the channel of each topic.
        """
        self._origin, self._channels = origin, channels
        self._slot = self._second = -1
        self._path: list[Floats] = []  # positions, one a second
        self._newest_position = np.zeros((0, 3))  # (0 or 1, 3)
        self._growing_track = GrowingTrack()
        self._next_cloud = 0.0  # s

    def pose_records(self, log_times: Ints, position: Floats, attitude: Floats) -> Iterator[MessageRecords]:
        """Yield the messages of the next rows: transforms, position fixes and the track.

        A transform is written every 0.2 s, and a position fix each second.

        The track is encoded as a line every `TRACK_INTERVAL_S`, and as points at growing intervals.  Rows with
        non-finite numbers are skipped.

        log_times: log time of each row, ns, (n,).
        position: m, (n, 3).
        attitude: roll, pitch and yaw, rad, (n, 3).
        """
        good_rows = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(attitude).all(axis=1))
        slots = log_times[good_rows] // _SLOT_NS
        slot_rows = good_rows[_change_indices(slots, self._slot)]
        if good_rows.size:
            self._newest_position = position[good_rows[-1:]]
        if not slot_rows.size:
            return
        self._slot = int(slots[-1])
        slot_times = log_times[slot_rows]
        yield transform_messages(self._channels[TF_TOPIC], slot_times, position[slot_rows], attitude[slot_rows])
        seconds = slot_times // SECOND_NS
        second_rows = slot_rows[_change_indices(seconds, self._second)]
        if not second_rows.size:
            return
        self._second = int(seconds[-1])
        start_positions = position[second_rows]
        yield fix_messages(self._channels[FIX_TOPIC], log_times[second_rows], self._origin, start_positions)
        self._path.append(start_positions)
        for k in np.flatnonzero((log_times[second_rows] - EPOCH_NS) // SECOND_NS % TRACK_INTERVAL_S == 0).tolist():
            log_time = int(log_times[second_rows[k]])
            with np.errstate(over="ignore", invalid="ignore"):
                line = np.round(self._growing_track.add(start_positions[k]) * 16.0) / 16.0
            yield single_record(self._channels[TRACK_TOPIC], log_time, scene.track_scene(log_time, line))
            time = (log_time - EPOCH_NS) / SECOND_NS
            if time >= self._next_cloud:
                self._next_cloud = max(time + _MIN_CLOUD_INTERVAL_S, time * _CLOUD_RATIO)
                yield self._track_cloud_record(log_time, [*self._path[:-1], start_positions[: k + 1]])

    def whole_track_records(self, log_time: int) -> Iterator[MessageRecords]:
        """Yield two messages with the track up to the newest row: as a line and as points.

        The track has one point per second.

        log_time: log time of the messages, ns.
        """
        parts = [*self._path, self._newest_position]
        path = scene.track_scene(log_time, np.concatenate([np.zeros((0, 3)), *parts]))
        yield single_record(self._channels[TRACK_TOPIC], log_time, path)
        yield self._track_cloud_record(log_time, parts)

    def _track_cloud_record(self, log_time: int, parts: list[Floats]) -> MessageRecords:
        """Encode the track as points in a message record.

        parts: positions of successive parts of the track, m, (n, 3) each.
        """
        points = track_cloud(log_time, np.concatenate([np.zeros((0, 3)), *parts]))
        return single_record(self._channels[TRACK_POINTS], log_time, points)


def _change_indices(values: Ints, previous: int) -> Ints:
    """Return the indices of the values that are larger than the value before them.

    values: values that never decrease.
    previous: value before the first one.
    """
    return np.flatnonzero(np.diff(values, prepend=previous) > 0)
