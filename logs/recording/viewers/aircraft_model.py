"""A small aircraft of our own for 3-D viewers: triangles as binary glTF 2.0, its left wing red, its right one green."""

import json
import struct
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.ModelPrimitive_pb2 import ModelPrimitive
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from logs.recording.foxglove_scene import AIRCRAFT, timestamp

Singles = NDArray[np.float32]

# m, whatever the aircraft: at its true size it could not be seen among hills.
SPAN = 100.0
MEDIA_TYPE = "model/gltf-binary"

# Forward, left, up in spans.
_NOSE, _TAIL = (0.45, 0.0, 0.0), (-0.46, 0.0, 0.03)
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
_PARTS = ((_BODY, (0.92, 0.92, 0.88, 1.0)), (_LEFT, (0.85, 0.10, 0.10, 1.0)), (_RIGHT, (0.10, 0.60, 0.20, 1.0)))
# Chunk types of a .glb, and glTF's numbers for float32 and for what a buffer's view is used for.
_JSON, _BIN, _FLOAT, _VERTICES = b"JSON", b"BIN\0", 5126, 34962


def model_corners() -> Singles:
    """(t, 3, 3) corners of the triangles, m forward, left and up of the aircraft, `SPAN` wide."""
    return np.array([triangle for triangles, _ in _PARTS for triangle in triangles], dtype=np.float32) * SPAN


def model_colours() -> Singles:
    """(t, 4) colours of the triangles: red, green, blue, opacity, 0 to 1."""
    return np.array([colour for triangles, colour in _PARTS for _ in triangles], dtype=np.float32)


def aircraft_glb() -> bytes:
    """The model as a `.glb` file: one unit wide, in glTF's axes (right-handed, y up), each part with its colour."""
    pieces = b""
    views: list[dict[str, Any]] = []
    accessors, primitives, materials = [], [], []
    for triangles, colour in _PARTS:
        forward_left_up = np.array(triangles, dtype=np.float32).reshape(-1, 3)
        points = np.stack([forward_left_up[:, 0], forward_left_up[:, 2], -forward_left_up[:, 1]], axis=1)
        data = points.tobytes()
        number = len(views)
        views.append({"buffer": 0, "byteOffset": len(pieces), "byteLength": len(data), "target": _VERTICES})
        accessors.append(
            {
                "bufferView": number, "componentType": _FLOAT, "count": len(points), "type": "VEC3",
                "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist(),
            }
        )  # fmt: skip
        primitives.append({"attributes": {"POSITION": number}, "material": number, "mode": 4})
        surface = {"baseColorFactor": list(colour), "metallicFactor": 0.0, "roughnessFactor": 0.9}
        materials.append({"pbrMetallicRoughness": surface, "doubleSided": True})
        pieces += data
    about: dict[str, Any] = {
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
    text = json.dumps(about, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in ((_JSON, text), (_BIN, pieces)))
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def aircraft_scene(time_ns: int) -> bytes:
    """The model in the aircraft's own frame, so that its transforms move it: a SceneUpdate."""
    model = ModelPrimitive(
        pose=Pose(position=Vector3(), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
        scale=Vector3(x=SPAN, y=SPAN, z=SPAN),
        color=Color(r=1.0, g=1.0, b=1.0, a=1.0),
        media_type=MEDIA_TYPE,
        data=aircraft_glb(),
    )
    entity = SceneEntity(
        timestamp=timestamp(time_ns), frame_id=AIRCRAFT, id="aircraft", frame_locked=True, models=[model]
    )
    data: bytes = SceneUpdate(entities=[entity]).SerializeToString(deterministic=True)
    return data
