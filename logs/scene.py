"""What a 3D viewer sees: Foxglove messages of the terrain, the threats, the plan, the track and the aircraft.

Frame `map` is the scenario's east, north and up (AMSL) in metres; `aircraft` is forward, left, up.
"""

import math
import struct
from collections.abc import Iterable

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import ArrayLike, NDArray

from world.scenario import Scenario
from world.terrain import Terrain
from world.threats import Threats

Floats = NDArray[np.float64]

MAP, AIRCRAFT = "map", "aircraft"
LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR, "fatal": Log.FATAL}
MOST_VERTICES = 80  # a side of the terrain mesh

# Fields of FrameTransform, written by hand: five a second through message objects cost as much as all of the state.
_FRAMES = FrameTransform(parent_frame_id=MAP, child_frame_id=AIRCRAFT).SerializeToString(deterministic=True)
_PLACE, _TURN = struct.Struct("<BBBdBdBd"), struct.Struct("<BBBdBdBdBd")

_LOW = np.array([0.36, 0.52, 0.30])
_HIGH = np.array([0.80, 0.74, 0.62])
_KILL = (0.85, 0.10, 0.10, 0.35)
_DETECTION = (0.95, 0.65, 0.10, 0.15)
_PLAN = (0.10, 0.35, 0.90, 1.0)
_TRACK = (0.95, 0.95, 0.95, 1.0)


def timestamp(time_ns: int) -> Timestamp:
    """Return a log_time as protobuf's timestamp."""
    return Timestamp(seconds=time_ns // 1_000_000_000, nanos=time_ns % 1_000_000_000)


def body_rotation(attitude: ArrayLike) -> Floats:
    """(..., 4) x, y, z, w of the rotation from forward-left-up to east-north-up.

    attitude: (..., 3) roll, pitch, yaw in rad, yaw clockwise from north.  Turning the axes from north-east-down makes
    the angles roll, -pitch and pi/2 - yaw about forward, left and up.
    """
    roll, pitch, yaw = np.moveaxis(np.asarray(attitude, dtype=np.float64), -1, 0)
    half = (0.5 * roll, -0.5 * pitch, 0.5 * (0.5 * math.pi - yaw))
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in half)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def transform_messages(times_ns: NDArray[np.int64], position: Floats, attitude: ArrayLike) -> list[bytes]:
    """Where the aircraft is and how it points: a serialised FrameTransform for each of n rows.

    position, attitude: (n, 3).  Rounded to 2^-10 m and 2^-20 of the quaternion, which no viewer shows and which halves
    their room in the log; the state's own message is exact.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        places = np.round(position * 1024.0) / 1024.0
    turns = np.round(body_rotation(attitude) * 2.0**20) / 2.0**20
    found = []
    last, head = -1, b""
    for stamp, place, turn in zip(times_ns.tolist(), places.tolist(), turns.tolist(), strict=True):
        seconds, nanos = divmod(stamp, 1_000_000_000)
        if seconds != last:
            last, head = seconds, b"\x08" + _varint(seconds) + b"\x10"
        when = head + _varint(nanos)
        moved = _PLACE.pack(0x22, 27, 0x09, place[0], 0x11, place[1], 0x19, place[2])
        turned = _TURN.pack(0x2A, 36, 0x09, turn[0], 0x11, turn[1], 0x19, turn[2], 0x21, turn[3])
        found.append(b"\x0a" + bytes([len(when)]) + when + _FRAMES + moved + turned)
    return found


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def fix_message(time_ns: int, lat_deg: float, lon_deg: float, amsl: float) -> LocationFix:
    """Return the position on the earth; altitude is above mean sea level."""
    return LocationFix(
        timestamp=timestamp(time_ns), frame_id=AIRCRAFT, latitude=lat_deg, longitude=lon_deg, altitude=amsl
    )


def log_message(time_ns: int, text: str, level: str) -> Log:
    """One event; level: a key of `LEVELS`."""
    return Log(timestamp=timestamp(time_ns), level=LEVELS[level], message=text, name="planfly")


def terrain_scene(time_ns: int, scenario: Scenario) -> SceneUpdate:
    """Draw the ground of the area as a coloured mesh of at most `MOST_VERTICES` a side."""
    entity = _entity(time_ns, "terrain")
    if scenario.terrain is not None:
        _add_mesh(entity, scenario.terrain, scenario.bounds)
    return SceneUpdate(entities=[entity])


def _add_mesh(entity: SceneEntity, terrain: Terrain, bounds: Floats) -> None:
    def axis(low: float, high: float) -> Floats:
        return np.linspace(low, high, int(np.clip((high - low) / terrain.spacing, 2, MOST_VERTICES)))

    east, north = axis(*bounds[0]), axis(*bounds[1])
    ground_e, ground_n = np.meshgrid(east, north)
    up = terrain.height(ground_e, ground_n)
    known = np.isfinite(up)
    if not known.any():
        return
    low, high = float(up[known].min()), float(up[known].max())
    share = np.where(known, (up - low) / max(high - low, 1.0), 0.0)
    colours = _LOW + share[..., None] * (_HIGH - _LOW)
    number = np.arange(up.size).reshape(up.shape)
    sw, se, nw, ne = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    corners = np.stack([sw, se, ne, sw, ne, nw], axis=-1).reshape(-1, 6)
    whole = known.ravel()[corners].all(axis=1)
    mesh = entity.triangles.add(pose=_pose((0.0, 0.0, 0.0)), color=Color(r=0.5, g=0.5, b=0.4, a=1.0))
    points = np.stack([ground_e, ground_n, np.where(known, up, low)], axis=-1).reshape(-1, 3)
    mesh.points.extend(_points(points))
    mesh.colors.extend(Color(r=r, g=g, b=b, a=1.0) for r, g, b in colours.reshape(-1, 3).tolist())
    mesh.indices.extend(corners[whole].ravel().tolist())


def threats_scene(time_ns: int, threats: Threats) -> SceneUpdate:
    """Missile spheres in red, radar spheres in orange, and their names."""
    entity = _entity(time_ns, "threats")
    for k, name in enumerate(threats.names):
        place = threats.position[k]
        for radius, colour in ((threats.kill_radius[k], _KILL), (threats.detection_radius[k], _DETECTION)):
            if radius > 0.0:
                side = 2.0 * float(radius)
                entity.spheres.add(pose=_pose(place), size=Vector3(x=side, y=side, z=side), color=_colour(colour))
        entity.texts.add(
            pose=_pose(place), billboard=True, font_size=14.0, scale_invariant=True, color=_colour(_TRACK), text=name
        )
    return SceneUpdate(entities=[entity])


def plan_scene(time_ns: int, waypoints: Floats) -> SceneUpdate:
    """Draw the legs between waypoints (w, 3) as a line, the waypoints as dots."""
    entity = _entity(time_ns, "plan")
    _add_line(entity, waypoints, _PLAN)
    for point in waypoints:
        entity.spheres.add(pose=_pose(point), size=Vector3(x=40.0, y=40.0, z=40.0), color=_colour(_PLAN))
    return SceneUpdate(entities=[entity])


def track_scene(time_ns: int, positions: Floats) -> SceneUpdate:
    """Draw the flown track so far, (n, 3)."""
    entity = _entity(time_ns, "track")
    _add_line(entity, positions, _TRACK)
    return SceneUpdate(entities=[entity])


def _entity(time_ns: int, name: str) -> SceneEntity:
    return SceneEntity(timestamp=timestamp(time_ns), frame_id=MAP, id=name, frame_locked=True)


def _add_line(entity: SceneEntity, points: Floats, colour: tuple[float, float, float, float]) -> None:
    entity.lines.add(
        type=LinePrimitive.LINE_STRIP,
        pose=_pose((0.0, 0.0, 0.0)),
        thickness=3.0,
        scale_invariant=True,
        points=_points(points),
        color=_colour(colour),
    )


def _points(points: Floats) -> Iterable[Point3]:
    return (Point3(x=x, y=y, z=z) for x, y, z in points.tolist())


def _pose(place: ArrayLike) -> Pose:
    x, y, z = (float(value) for value in np.asarray(place))
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def _colour(rgba: tuple[float, float, float, float]) -> Color:
    r, g, b, a = rgba
    return Color(r=r, g=g, b=b, a=a)
