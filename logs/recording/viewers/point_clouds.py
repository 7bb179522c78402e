"""Ground, plan, threats, track and aircraft as points: what a viewer shows that has no triangles and lines, as Rerun.

Rerun's reader of MCAP knows foxglove.PointCloud, FrameTransform and LocationFix, and no foxglove.SceneUpdate.
"""

import math

import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from logs.recording.foxglove_scene import AIRCRAFT, MAP, terrain_points, timestamp
from logs.recording.viewers.aircraft_model import model_corners
from world.scenario import Scenario
from world.threats import Threats

Floats = NDArray[np.float64]
Colour = tuple[int, int, int, int]

_POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("alpha", "u1")]
)
_TYPES = {"f": PackedElementField.FLOAT32, "u": PackedElementField.UINT8}
_PLAN, _TRACK, _AIRCRAFT = (25, 90, 230, 255), (245, 245, 245, 255), (255, 200, 40, 255)
_KILL, _DETECTION = (217, 26, 26, 255), (242, 166, 26, 255)
# m between points of a line, at most so many of them; points of a sphere; points along each side of a triangle.
_STEP, _MOST, _SPHERE, _SIDE = 30.0, 4000, 150, 7


def cloud(time_ns: int, frame: str, points: Floats, colours: NDArray[np.uint8] | Colour) -> bytes:
    """A PointCloud of points (n, 3) m in a frame, rounded to 1/16 m.

    colours: (n, 4) red, green, blue, alpha, or one for all.
    """
    packed = np.zeros(len(points), dtype=_POINT)
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
        point_stride=_POINT.itemsize,
        fields=[
            PackedElementField(name=name, offset=_POINT.fields[name][1], type=_TYPES[_POINT.fields[name][0].kind])
            for name in _POINT.names or ()
            if _POINT.fields is not None
        ],
        data=packed.tobytes(),
    )
    data: bytes = message.SerializeToString(deterministic=True)
    return data


def ground_cloud(time_ns: int, scenario: Scenario) -> bytes:
    """The corners of the ground's mesh."""
    points, colours = terrain_points(scenario)
    shades = np.hstack([np.round(colours * 255.0), np.full((len(points), 1), 255.0)]).astype(np.uint8)
    return cloud(time_ns, MAP, points, shades)


def plan_cloud(time_ns: int, waypoints: Floats) -> bytes:
    """The legs between waypoints (w, 3)."""
    return cloud(time_ns, MAP, along(waypoints), _PLAN)


def track_cloud(time_ns: int, positions: Floats) -> bytes:
    """The flown positions (n, 3)."""
    return cloud(time_ns, MAP, positions, _TRACK)


def aircraft_cloud(time_ns: int) -> bytes:
    """The aircraft's model, in its own frame."""
    first, second, third = (corner[:, None, :] for corner in np.moveaxis(model_corners().astype(np.float64), 1, 0))
    shares = [(i / _SIDE, j / _SIDE) for i in range(_SIDE + 1) for j in range(_SIDE + 1 - i)]
    a, b = (np.array(column)[None, :, None] for column in zip(*shares, strict=True))
    points = (a * first + b * second + (1.0 - a - b) * third).reshape(-1, 3)
    return cloud(time_ns, AIRCRAFT, np.unique(np.round(points, 2), axis=0), _AIRCRAFT)


def threats_cloud(time_ns: int, threats: Threats) -> bytes:
    """The spheres that missiles and radars reach, evenly dotted."""
    k = np.arange(_SPHERE) + 0.5
    up, turn = 1.0 - 2.0 * k / _SPHERE, math.pi * (1.0 + math.sqrt(5.0)) * k
    sphere = np.stack([np.sqrt(1.0 - up**2) * np.cos(turn), np.sqrt(1.0 - up**2) * np.sin(turn), up], axis=1)
    points, shades = [np.zeros((0, 3))], [np.zeros((0, 4), dtype=np.uint8)]
    for radii, colour in ((threats.kill_radius, _KILL), (threats.detection_radius, _DETECTION)):
        for centre, radius in zip(threats.position, radii, strict=True):
            if radius > 0.0:
                points.append(centre + float(radius) * sphere)
                shades.append(np.tile(np.array(colour, dtype=np.uint8), (_SPHERE, 1)))
    return cloud(time_ns, MAP, np.concatenate(points), np.concatenate(shades))


def along(waypoints: Floats) -> Floats:
    """Points of the straight legs between waypoints (w, 3), the waypoints among them, evenly on each leg."""
    lengths = np.sqrt((np.diff(waypoints, axis=0) ** 2).sum(axis=1))
    step = max(_STEP, float(lengths.sum()) / _MOST)
    legs = [
        np.linspace(start, end, max(1, math.ceil(length / step)), endpoint=False)
        for start, end, length in zip(waypoints[:-1], waypoints[1:], lengths.tolist(), strict=True)
    ]
    return np.concatenate([*legs, waypoints[-1:]])
