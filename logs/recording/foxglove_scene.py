"""Encode Foxglove messages for a 3-D viewer.

They show terrain, threats, zones, plan, track, returns and aircraft.

The frame `map` has the scenario's axes east, north and up (AMSL) in metres; `aircraft` has forward, left, up.
"""

import json
import math
import struct
from collections.abc import Iterable, Sequence
from importlib import resources
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.ModelPrimitive_pb2 import ModelPrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import ArrayLike, NDArray

from logs import theme
from logs.recording.state_channel import length_delimited, repeated_submessages
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.returns.glide_footprint import BAND_ROLES, Part
from world.airspace.zones_on_map import zone_walls
from world.arrays import Floats, Singles
from world.scenario import Scenario
from world.terrain import Terrain
from world.threats import Threats

# Name of the frame of the map.
MAP_FRAME = "map"
# Name of the frame of the aircraft.
AIRCRAFT_FRAME = "aircraft"
# Foxglove log level by name.
LOG_LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR, "fatal": Log.FATAL}
# Maximum number of vertices along a side of the terrain mesh.
MAX_VERTICES = 80


_XYZ = "xyz"
_RGBA = "rgba"
# Fields of SceneEntity, LinePrimitive and TriangleListPrimitive.
_ENTITY_LINES = SceneEntity.LINES_FIELD_NUMBER
_ENTITY_TRIANGLES = SceneEntity.TRIANGLES_FIELD_NUMBER
_LINE_POINTS = LinePrimitive.POINTS_FIELD_NUMBER
_MESH_POINTS = TriangleListPrimitive.POINTS_FIELD_NUMBER
_MESH_COLOURS = TriangleListPrimitive.COLORS_FIELD_NUMBER

# Colour of the lowest ground.
_LOWEST_COLOUR = np.array(theme.rgb(theme.GROUND[0]))
# Colour of the highest ground.
_HIGHEST_COLOUR = np.array(theme.rgb(theme.GROUND[-2]))
# Scenes have a black background: use the theme's colours for dark ground.
_KILL_COLOUR = theme.rgba("missile", 0.35, dark=True)
_DETECTION_COLOUR = theme.rgba("radar", 0.15, dark=True)
_PLAN_COLOUR = theme.rgba("planned", dark=True)
_TRACK_COLOUR = theme.rgba("flown", dark=True)
_EXCLUSION_COLOUR = theme.rgba("zone", dark=True)
_INCLUSION_COLOUR = theme.rgba("highlight", dark=True)
# Height of a name above the ground around it, m.
_LABEL_HEIGHT_M = 40.0
# Half the side of the square whose highest ground a name stays above, m.
_LABEL_GROUND_DISTANCE_M = 300.0
# Distance of the coloured path below the flight, m.
_PATH_OFFSET_M = 6.0
# Height of an outline above the ground, m.
_OUTLINE_HEIGHT_M = 4.0
# Approximate number of vertical lines of one outline of a zone.
MAX_POSTS = 24


def timestamp(time_ns: int) -> Timestamp:
    """Convert a log time, ns since 1970, to a protobuf timestamp."""
    return Timestamp(seconds=time_ns // 1_000_000_000, nanos=time_ns % 1_000_000_000)


def body_rotation(attitude: ArrayLike) -> Floats:
    """Convert roll, pitch and yaw to quaternions x, y, z, w, (..., 4).

    A quaternion rotates from forward, left, up to east, north, up.  After the change of axes from north-east-down, the
    angles are roll, -pitch and pi/2 - yaw about the axes forward, left and up.

    attitude: roll, pitch and yaw (clockwise from north), rad, (..., 3).
    """
    roll, pitch, yaw = np.moveaxis(np.asarray(attitude, dtype=np.float64), -1, 0)
    half_angles = (0.5 * roll, -0.5 * pitch, 0.5 * (0.5 * math.pi - yaw))
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in half_angles)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def log_message(time_ns: int, text: str, level: str, name: str = "planfly") -> Log:
    """Return one event as a Foxglove log message.

    time_ns: log time, ns since 1970.
    level: a key of `LOG_LEVELS`.
    name: source of the message.
    """
    return Log(timestamp=timestamp(time_ns), level=LOG_LEVELS[level], message=text, name=name)


def terrain_scene(time_ns: int, scenario: Scenario) -> bytes:
    """Encode the ground of the area as a SceneUpdate: a coloured mesh.

    The mesh has up to `MAX_VERTICES` vertices per side.

    Without terrain, or without known heights, the scene is empty.
    """
    entity = _entity(time_ns, "terrain").SerializeToString(deterministic=True)
    if scenario.terrain is None:
        return length_delimited(2, entity)
    corner_points, colours, is_known = _terrain_mesh(scenario.terrain, scenario.bounds)
    if not is_known.any():
        return length_delimited(2, entity)
    up = corner_points[..., 2]
    vertex_numbers = np.arange(up.size).reshape(up.shape)
    sw = vertex_numbers[:-1, :-1]
    se = vertex_numbers[:-1, 1:]
    nw = vertex_numbers[1:, :-1]
    ne = vertex_numbers[1:, 1:]
    corners = np.stack([sw, se, ne, sw, ne, nw], axis=-1).reshape(-1, 6)
    has_known_corners = is_known.ravel()[corners].all(axis=1)
    mesh = TriangleListPrimitive(pose=_pose((0.0, 0.0, 0.0)), color=_colour(theme.rgba("terrain")))
    mesh.indices.extend(corners[has_known_corners].ravel().tolist())
    points = corner_points.reshape(-1, 3)
    # Round to 2^-4 m and 2^-7 of a colour.  The mesh is only displayed, and thus takes a quarter of the bytes.
    rgba = np.hstack([np.round(colours.reshape(-1, 3) * 128.0) / 128.0, np.ones((len(points), 1))])
    body = mesh.SerializeToString(deterministic=True)
    body += repeated_submessages(_MESH_POINTS, _XYZ, np.round(points * 16.0) / 16.0)
    body += repeated_submessages(_MESH_COLOURS, _RGBA, rgba)
    return length_delimited(2, entity + length_delimited(_ENTITY_TRIANGLES, body))


def _terrain_mesh(terrain: Terrain, bounds: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return the vertices of the ground's mesh, their colours, and a mask of vertices with known height.

    Vertices (m) and colours (0 to 1) have shape (n, m, 3), the mask has shape (n, m).  Vertices of unknown height are
    placed at the lowest known height.

    bounds: range of the area to the east and to the north, m, (2, 2).
    """

    def axis(min_value: float, max_value: float) -> Floats:
        """Return evenly spaced coordinates of the mesh's vertices between two limits, m."""
        return np.linspace(
            min_value, max_value, int(np.clip((max_value - min_value) / terrain.spacing, 2, MAX_VERTICES))
        )

    east, north = axis(*bounds[0]), axis(*bounds[1])
    mesh_east, mesh_north = np.meshgrid(east, north)
    up = terrain.height(mesh_east, mesh_north)
    is_known = np.isfinite(up)
    min_value = float(np.min(up, where=is_known, initial=np.inf))
    max_value = float(np.max(up, where=is_known, initial=-np.inf))
    fraction = np.where(is_known, (up - min_value) / max(max_value - min_value, 1.0), 0.0)
    points = np.stack([mesh_east, mesh_north, np.where(is_known, up, min_value)], axis=-1)
    return points, _LOWEST_COLOUR + fraction[..., None] * (_HIGHEST_COLOUR - _LOWEST_COLOUR), is_known


def terrain_points(scenario: Scenario) -> tuple[Floats, Floats]:
    """Return the ground's mesh as points: positions (m) and colours (0 to 1), (n, 3) each.

    Vertices of unknown height are left out.
    """
    if scenario.terrain is None:
        return np.zeros((0, 3)), np.zeros((0, 3))
    points, colours, is_known = _terrain_mesh(scenario.terrain, scenario.bounds)
    return points[is_known], colours[is_known]


def threats_scene(time_ns: int, threats: Threats, terrain: Terrain | None) -> bytes:
    """Encode the spheres of missiles and radars as a SceneUpdate, each with a label of its name.

    terrain: ground that the labels must not touch; None without terrain.
    """
    entity = _entity(time_ns, "threats")
    for k, name in enumerate(threats.names):
        center = threats.position[k]
        for radius, colour in (
            (threats.kill_radius[k], _KILL_COLOUR),
            (threats.detection_radius[k], _DETECTION_COLOUR),
        ):
            if radius > 0.0:
                diameter = 2.0 * float(radius)
                entity.spheres.add(
                    pose=_pose(center), size=Vector3(x=diameter, y=diameter, z=diameter), color=_colour(colour)
                )
        entity.texts.append(_make_label(_label_position(center, terrain), name))
    return _encode_update(entity)


def _label_position(position: Floats, terrain: Terrain | None) -> Floats:
    """Return the position of a point's label, m, (3,): above the point and all known ground near it."""
    east, north, up = (float(value) for value in position)
    top_altitude = up
    if terrain is not None:
        steps = np.linspace(-_LABEL_GROUND_DISTANCE_M, _LABEL_GROUND_DISTANCE_M, 9)
        nearby_heights = terrain.height(*np.meshgrid(east + steps, north + steps))
        top_altitude = float(np.max(nearby_heights, where=np.isfinite(nearby_heights), initial=up))
    return np.array([east, north, top_altitude + _LABEL_HEIGHT_M])


def _make_label(position: Floats, name: str) -> TextPrimitive:
    """Make a text label that always faces the viewer."""
    return TextPrimitive(
        pose=_pose(position),
        billboard=True,
        font_size=14.0,
        scale_invariant=True,
        color=_colour(_TRACK_COLOUR),
        text=name,
    )


def plan_scene(time_ns: int, waypoints: Floats, items: Sequence[int]) -> bytes:
    """Encode the plan as a SceneUpdate: legs as a line, waypoints as dots.

    The dots have the numbers of their waypoints and mission items.

    waypoints: (w, 3), m.
    items: number of each waypoint's mission item, negative for none, (w,).
    """
    entity = _entity(time_ns, "plan")
    legs = _empty_line(_PLAN_COLOUR)
    legs.points.extend(_points(waypoints))
    entity.lines.append(legs)
    for point in waypoints:
        entity.spheres.add(pose=_pose(point), size=Vector3(x=40.0, y=40.0, z=40.0), color=_colour(_PLAN_COLOUR))
    for number, (point, item) in enumerate(zip(waypoints, items, strict=True)):
        text = f"{number} (item {item})" if item >= 0 else str(number)
        entity.texts.append(_make_label(point + np.array([0.0, 0.0, _LABEL_HEIGHT_M]), text))
    return _encode_update(entity)


def track_scene(time_ns: int, positions: Floats) -> bytes:
    """Encode the track flown so far as a SceneUpdate with a line.

    positions: m, (n, 3).
    """
    line = _TRACK_LINE + repeated_submessages(_LINE_POINTS, _XYZ, positions)
    entity = _entity(time_ns, "track").SerializeToString(deterministic=True)
    return length_delimited(2, entity + length_delimited(_ENTITY_LINES, line))


def _encode_update(entity: SceneEntity) -> bytes:
    """Encode one entity as a SceneUpdate message."""
    return SceneUpdate(entities=[entity]).SerializeToString(deterministic=True)


def _entity(time_ns: int, name: str) -> SceneEntity:
    """Make an empty entity in the frame of the map."""
    return SceneEntity(timestamp=timestamp(time_ns), frame_id=MAP_FRAME, id=name, frame_locked=True)


def _colour(rgba: tuple[float, float, float, float]) -> Color:
    """Convert red, green, blue and opacity, 0 to 1, to a Foxglove colour."""
    r, g, b, a = rgba
    return Color(r=r, g=g, b=b, a=a)


def _pose(position: ArrayLike) -> Pose:
    """Make the pose of an object at a position, without rotation."""
    x, y, z = (float(value) for value in np.asarray(position))
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def _empty_line(colour: tuple[float, float, float, float]) -> LinePrimitive:
    """Return a Foxglove line without points, 3 pixels wide."""
    return LinePrimitive(
        type=LinePrimitive.LINE_STRIP,
        pose=_pose((0.0, 0.0, 0.0)),
        thickness=3.0,
        scale_invariant=True,
        color=_colour(colour),
    )


_TRACK_LINE = _empty_line(_TRACK_COLOUR).SerializeToString(deterministic=True)


def _points(points: Floats) -> Iterable[Point3]:
    """Convert points (n, 3) to Foxglove points."""
    return (Point3(x=x, y=y, z=z) for x, y, z in points.tolist())


def zones_scene(time_ns: int, scenario: Scenario, waypoints: Floats) -> bytes:
    """Encode the zones of a scenario as a SceneUpdate: their edges and names.

    A zone is drawn from its floor, or from the ground, up to its ceiling, or to 50 m above the path if it has none.

    waypoints: waypoints of the path, m, (w, 3).
    """
    entity = _entity(time_ns, "zones")
    min_altitude = float(waypoints[:, 2].min())
    # Zones without a ceiling end 50 m above the path.
    max_altitude = float(waypoints[:, 2].max()) + 50.0
    for zone in scenario.zones:
        walls = zone_walls(zone, scenario.terrain, min_altitude, max_altitude)
        for wall in walls:
            step = max(1, (len(wall) - 1) // MAX_POSTS)
            for path in (wall[:, 0], wall[:, 1], *wall[:-1:step]):
                edge = _empty_line(_EXCLUSION_COLOUR if zone.kind == "exclusion" else _INCLUSION_COLOUR)
                edge.points.extend(_points(path))
                entity.lines.append(edge)
        entity.texts.append(_make_label(_label_position(walls[0][0, 1], scenario.terrain), zone.name))
    return _encode_update(entity)


def returns_scene(time_ns: int, drawn_returns: DrawnReturns, terrain: Terrain | None) -> bytes:
    """Encode judged returns to launch as a SceneUpdate.

    It shows the path, coloured by the outcome of the returns from it, the worst returns, and the glide footprint.  The
    coloured line is drawn below the path, so that plan and track stay visible.
    """
    entity = _entity(time_ns, "returns")
    for kind, segment in drawn_returns.segments_by_outcome:
        points = np.array([flown_return.start for flown_return in segment]) - np.array([0.0, 0.0, _PATH_OFFSET_M])
        _add_line(entity, f"return-{kind}", points, 6.0)
    for number, worst_return in enumerate(drawn_returns.worst, 1):
        _add_line(entity, "return-way", worst_return.path)
        entity.texts.append(
            _make_label(worst_return.marked_position + np.array([0.0, 0.0, _LABEL_HEIGHT_M]), f"return {number}")
        )
    footprint = drawn_returns.glides.footprint
    if footprint is not None and terrain is not None:
        for band in footprint.bands():
            _add_outlines(entity, BAND_ROLES[band.max_height], band.parts, terrain)
        _add_outlines(entity, "landable", footprint.landings(), terrain)
    return _encode_update(entity)


def _add_outlines(entity: SceneEntity, role: str, parts: Sequence[Part], terrain: Terrain) -> None:
    """Add the outlines of areas to an entity, `_OUTLINE_HEIGHT_M` above the ground.

    role: role of the colour.
    """
    for part in parts:
        for ring in part:
            up = terrain.height(ring[:, 0], ring[:, 1])
            is_known = np.isfinite(up)
            _add_line(entity, role, np.column_stack([ring, up + _OUTLINE_HEIGHT_M])[is_known])


def _add_line(entity: SceneEntity, role: str, points: Floats, thickness: float = 3.0) -> None:
    """Add a line in the colour of a role to an entity.

    thickness: width of the line, pixels.
    """
    line = _empty_line(theme.rgba(role, dark=True))
    line.thickness = thickness
    line.points.extend(_points(points))
    entity.lines.append(line)


# ----------------------------------------------------------------------
# A small aircraft model for 3-D viewers: triangles as binary glTF 2.0, with a red left wing and a green right wing.
#
# trimesh would save 15 lines of glTF, but it rounds colours to 8 bits, makes three nodes, and takes 0.5 s to import.

# Wing span of the model, m, for every aircraft.  At its true size it would be invisible among hills.
MODEL_SPAN_M = 100.0
MEDIA_TYPE = "model/gltf-binary"

# Points of the model: forward, left, up in spans.
_NOSE = (0.45, 0.0, 0.0)
_TAIL = (-0.46, 0.0, 0.03)
_RING = ((0.12, 0.05, 0.0), (0.12, 0.0, 0.06), (0.12, -0.05, 0.0), (0.12, 0.0, -0.05))
_BODY = [
    *([_NOSE, _RING[k], _RING[(k + 1) % 4]] for k in range(4)),
    *([_TAIL, _RING[(k + 1) % 4], _RING[k]] for k in range(4)),
    [(-0.34, 0.0, 0.03), (-0.47, 0.0, 0.03), (-0.47, 0.0, 0.20)],
]
_LEFT = [
    [(0.16, 0.0, 0.03), (0.02, 0.5, 0.05), (-0.08, 0.0, 0.03)],
    [(-0.32, 0.0, 0.03), (-0.42, 0.18, 0.03), (-0.46, 0.0, 0.03)],
]
_RIGHT = [[(x, -y, z) for x, y, z in reversed(triangle)] for triangle in _LEFT]
_MODEL_PARTS = tuple(
    (triangles, (*theme.rgb(text), 1.0))
    for triangles, text in zip((_BODY, _LEFT, _RIGHT), theme.AIRCRAFT_PARTS, strict=True)
)
# Type of the JSON chunk of a .glb.
_JSON = b"JSON"
# Type of the binary chunk of a .glb.
_BIN = b"BIN\0"
# glTF's number for float32.
_FLOAT = 5126
# glTF's number for a buffer view of vertices.
_VERTICES = 34962


def model_corners() -> Singles:
    """Return the corners of the aircraft model's triangles, forward, left and up, m, (t, 3, 3).

    The model is `MODEL_SPAN_M` wide.
    """
    return (
        np.array([triangle for triangles, _ in _MODEL_PARTS for triangle in triangles], dtype=np.float32) * MODEL_SPAN_M
    )


def model_colours() -> Singles:
    """Return the colours of the aircraft model's triangles: red, green, blue, opacity, 0 to 1, (t, 4)."""
    return np.array([colour for triangles, colour in _MODEL_PARTS for _ in triangles], dtype=np.float32)


def aircraft_glb() -> bytes:
    """Encode the aircraft model as the bytes of a `.glb` file.

    The model is one unit wide, in glTF's axes (right-handed, y up).
    """
    pieces = b""
    views: list[dict[str, Any]] = []
    accessors, primitives, materials = [], [], []
    for triangles, colour in _MODEL_PARTS:
        forward_left_up = np.array(triangles, dtype=np.float32).reshape(-1, 3)
        points = np.stack([forward_left_up[:, 0], forward_left_up[:, 2], -forward_left_up[:, 1]], axis=1)
        data = points.tobytes()
        number = len(views)
        views.append({"buffer": 0, "byteOffset": len(pieces), "byteLength": len(data), "target": _VERTICES})
        accessors.append(
            {
                "bufferView": number,
                "componentType": _FLOAT,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            }
        )
        primitives.append({"attributes": {"POSITION": number}, "material": number, "mode": 4})
        surface = {"baseColorFactor": list(colour), "metallicFactor": 0.0, "roughnessFactor": 0.9}
        materials.append({"pbrMetallicRoughness": surface, "doubleSided": True})
        pieces += data
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "planfly"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "aircraft"}],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(pieces)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in ((_JSON, text), (_BIN, pieces)))
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def aircraft_scene(time_ns: int) -> bytes:
    """Encode the aircraft model as a SceneUpdate in the aircraft's frame.

    The log's transform messages move this frame with the aircraft.
    """
    model = ModelPrimitive(
        pose=Pose(position=Vector3(), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
        scale=Vector3(x=MODEL_SPAN_M, y=MODEL_SPAN_M, z=MODEL_SPAN_M),
        color=_colour(theme.rgba("paper")),
        media_type=MEDIA_TYPE,
        data=aircraft_glb(),
    )
    entity = SceneEntity(
        timestamp=timestamp(time_ns), frame_id=AIRCRAFT_FRAME, id="aircraft", frame_locked=True, models=[model]
    )
    return SceneUpdate(entities=[entity]).SerializeToString(deterministic=True)


# ----------------------------------------------------------------------
# The Foxglove layout for all parts of a flight log: 3-D, map, plots, events and the state.


def layout_text() -> str:
    """Return the JSON text of the package's layout file for Foxglove.

    >>> import json
    >>> sorted(json.loads(layout_text()))
    ['configById', 'globalVariables', 'layout', 'playbackConfig', 'userNodes']
    """
    return resources.files("logs.recording").joinpath("templates", "foxglove-layout.json").read_text(encoding="utf-8")
