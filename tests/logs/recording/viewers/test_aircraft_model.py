"""The aircraft's model, as another program's reader of glTF has it, in the frame that its transforms move."""

import io

import numpy as np
import pytest
import trimesh
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from logs.recording.foxglove_scene import AIRCRAFT
from logs.recording.state_channel import EPOCH_NS
from logs.recording.viewers.aircraft_model import SPAN, aircraft_glb, aircraft_scene, model_corners


def seen(data: bytes) -> trimesh.Scene:
    return trimesh.load_scene(io.BytesIO(data), file_type="glb")


def test_the_model_has_the_right_sides() -> None:
    """A viewer turns glTF's y up to its own z: its x, y, z are then forward, left, up."""
    scene = seen(aircraft_glb())
    assert len(scene.geometry) == 3
    points = {}
    for name, mesh in scene.geometry.items():
        x, y, z = np.asarray(mesh.vertices).T
        points[name] = np.stack([x, -z, y], axis=1)
    every = np.concatenate(list(points.values()))
    assert np.ptp(every[:, 1]) == pytest.approx(1.0)
    assert np.ptp(every[:, 0]) == pytest.approx(0.92, abs=0.02)
    # The fin stands up, at the tail.
    assert every[every[:, 2].argmax(), 0] < -0.4
    colours = {name: mesh.visual.material.baseColorFactor for name, mesh in scene.geometry.items()}
    for name, (red, green, _, _) in colours.items():
        side = points[name][:, 1].mean()
        assert (red > green) == (side > 0.1) or abs(side) < 0.1, "red on the left, green on the right"
    assert sum(len(mesh.faces) for mesh in scene.geometry.values()) == len(model_corners()) == 13


def test_the_scene_carries_it_in_the_aircrafts_frame() -> None:
    (entity,) = SceneUpdate.FromString(aircraft_scene(EPOCH_NS)).entities
    (model,) = entity.models
    assert (entity.frame_id, entity.frame_locked, model.media_type) == (AIRCRAFT, True, "model/gltf-binary")
    assert (model.scale.x, model.scale.y, model.scale.z) == (SPAN,) * 3
    assert np.ptp(seen(model.data).bounds[:, 2]) * model.scale.y == pytest.approx(100.0)
    assert model.pose.orientation.w == 1.0
