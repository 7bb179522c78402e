"""The aircraft's model, as another program's reader of glTF has it, in the frame that its transforms move."""

import importlib.util
import inspect
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader

from logs import theme
from logs.recording.foxglove_scene import (
    AIRCRAFT_FRAME,
    MODEL_SPAN_M,
    aircraft_glb,
    aircraft_scene,
    body_rotation,
    layout_text,
    model_corners,
    plan_scene,
    returns_scene,
    threats_scene,
    zones_scene,
)
from logs.recording.reader import read_log
from logs.recording.recorder import _CHANNELS, RETURNS_TOPIC, ZONES_TOPIC, Recorder
from logs.recording.state_channel import EPOCH_NS, FIELDS, STATE_TOPIC
from logs.verdict.returns.judge_glides import NO_GLIDES
from tests.clients import need
from tests.logs.made_flight import make_setup, make_track
from tests.logs.verdict.returns.hill import hill_drawn, hill_setup


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
    assert (entity.frame_id, entity.frame_locked, model.media_type) == (AIRCRAFT_FRAME, True, "model/gltf-binary")
    assert (model.scale.x, model.scale.y, model.scale.z) == (MODEL_SPAN_M,) * 3
    assert np.ptp(seen(model.data).bounds[:, 2]) * model.scale.y == pytest.approx(100.0)
    assert model.pose.orientation.w == 1.0


# ----------------------------------------------------------------------
# The layout speaks of topics, fields and settings that are there.


def test_the_layout_names_only_topics_and_fields_of_a_log() -> None:
    layout = json.loads(layout_text())
    fields = {field.name for field in FIELDS}
    topics = {*_CHANNELS, STATE_TOPIC, ZONES_TOPIC, RETURNS_TOPIC}
    assert set(layout["configById"]["3D!planfly"]["topics"]) <= topics
    for name, panel in layout["configById"].items():
        for path in panel.get("paths", ()):
            topic, _, field = path["value"].partition(".")
            field, _, function = field.partition(".@")
            assert topic == STATE_TOPIC, name
            assert field in fields, name
            # Angles are shown in degrees, and said to be.
            assert function == ("rad2deg" if field.endswith("_rad") else ""), name
            assert path["label"] == (field.removesuffix("_rad") + "_deg" if function else field)
        # A legend beside the curves covers none of them.
        assert panel.get("legendDisplay", "top") == "top", name
        named = [panel.get(key) for key in ("followTopic", "topicToRender", "topicPath") if key in panel]
        assert set(named) | set(panel.get("topics", ())) <= topics

    # A layout file as Foxglove exports one: these parts, and panels of these kinds.
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert {name.split("!")[0] for name in layout["configById"]} == {"3D", "map", "Plot", "RosOut", "RawMessages"}

    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_the_layouts_settings_are_those_that_foxglove_knows() -> None:
    """By the classes that Foxglove publishes for making layouts."""
    need(
        None if importlib.util.find_spec("foxglove") is None else Path("/"), "foxglove-sdk", "pip package foxglove-sdk"
    )
    from foxglove import layouts as known

    def names(kind: Any) -> set[str]:
        """Its settings as JSON spells them."""
        parts = [name.split("_") for name in inspect.signature(kind).parameters]
        return {first + "".join(word.capitalize() for word in rest) for first, *rest in parts}

    kinds = {
        "3D": known.ThreeDeeConfig,
        "map": known.MapConfig,
        "Plot": known.PlotConfig,
        "RosOut": known.LogConfig,
        "RawMessages": known.RawMessagesConfig,
    }
    for name, panel in json.loads(layout_text())["configById"].items():
        # A panel's title stands beside its settings there.
        assert set(panel) - {"title"} <= names(kinds[name.split("!")[0]]), name
        for path in panel.get("paths", ()):
            assert set(path) <= names(known.PlotSeries)
        assert set(panel.get("cameraState", ())) <= names(known.ThreeDeeCameraState)
        assert set(panel.get("scene", ())) <= names(known.BaseRendererSceneSettings)
        # The 3D panel itself reads `axisScale` (FrameAxes.ts); the class of the SDK calls it otherwise.
        assert set(panel.get("scene", {}).get("transforms", ())) <= {"axisScale", *names(known.BaseRendererTransforms)}


def test_the_start_is_in_view() -> None:
    """Wherever on the map that is: the camera keeps to the aircraft, some ten of its drawn spans away."""
    panel = json.loads(layout_text())["configById"]["3D!planfly"]
    assert (panel["followTf"], panel["followMode"], panel["cameraState"]["target"]) == (
        AIRCRAFT_FRAME,
        "follow-position",
        [0, 0, 0],
    )
    assert 8.0 < panel["cameraState"]["distance"] / MODEL_SPAN_M < 20.0
    assert panel["scene"]["transforms"]["axisScale"] < MODEL_SPAN_M
    assert panel["topics"]["/scene/aircraft"]["visible"]


# ----------------------------------------------------------------------
# The scene's messages are drawn in the frames that their docstring names.


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.3, -0.2, 1.9), (-1.1, 0.7, -2.8), (math.pi, 0.1, 0.4)])
def test_the_pose_turns_body_axes_into_the_world(attitude: tuple[float, float, float]) -> None:
    # The usual matrix from body (forward, right, down) to north, east, down; then both sides' axes are swapped.
    roll, pitch, yaw = attitude
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    ned = np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    wanted = to_enu @ ned @ np.diag([1.0, -1.0, -1.0])
    x, y, z, w = body_rotation(attitude)
    got = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    np.testing.assert_allclose(got, wanted, atol=1e-12)


def test_zones_are_lines_from_the_ground_to_the_ceiling() -> None:
    square = [[-300, -200], [200, -200], [200, 400], [-300, 400]]
    zones = [
        {"name": "town", "kind": "exclusion", "polygon_m": square, "ceiling_amsl_m": 700},
        {"name": "fence", "kind": "inclusion", "east_m": 0, "north_m": 0, "radius_m": 1400},
    ]
    setup = make_setup(zones=zones, terrain={"kind": "flat", "amsl_m": 40})
    entity = SceneUpdate.FromString(zones_scene(EPOCH_NS, setup.scenario, setup.route.positions)).entities[0]
    assert (entity.id, [text.text for text in entity.texts]) == ("zones", ["town", "fence"])
    town = [line for line in entity.lines if len(line.points) in (5, 2)][:6]
    assert {(point.x, point.y) for point in town[0].points} == {tuple(map(float, corner)) for corner in square}
    assert [{point.z for point in line.points} for line in town] == [{40.0}, {700.0}, *[{40.0, 700.0}] * 4]
    fence = [point for line in entity.lines[6:] for point in line.points]
    assert all(math.hypot(point.x, point.y) == pytest.approx(1400.0) for point in fence)


def test_names_stand_above_the_ground() -> None:
    """Of a threat on a hill's flank, at the hill's foot, and without any ground known."""
    hill = [{"east_m": 100.0, "north_m": 200.0, "height_m": 333.3, "sigma_m": 150.0}]
    setup = make_setup(terrain={"kind": "peaks", "peak": hill})
    terrain, threats = setup.scenario.terrain, setup.scenario.threats
    entity = SceneUpdate.FromString(threats_scene(EPOCH_NS, threats, terrain)).entities[0]
    assert [text.text for text in entity.texts] == list(threats.names)
    for text in entity.texts:
        place = text.pose.position
        east, north = np.meshgrid(place.x + np.arange(-200.0, 201.0, 50.0), place.y + np.arange(-200.0, 201.0, 50.0))
        assert place.z > terrain.height(east, north).max()
    free = SceneUpdate.FromString(threats_scene(EPOCH_NS, threats, None)).entities[0]
    assert [text.pose.position.z for text in free.texts] == [pytest.approx(up + 40.0) for up in threats.position[:, 2]]


def test_waypoints_are_named_as_in_a_verdict() -> None:
    setup = make_setup()
    update = plan_scene(EPOCH_NS, setup.route.positions, setup.route.items.tolist())
    entity = SceneUpdate.FromString(update).entities[0]
    assert [text.text for text in entity.texts] == ["0", "1 (item 2)", "2 (item 3)", "3 (item 4)"]


def test_returns_are_lines_in_the_colours_of_what_they_come_to(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    drawn = hill_drawn(setup)
    update = SceneUpdate()
    update.ParseFromString(returns_scene(0, drawn, setup.scenario.terrain))
    (entity,) = update.entities
    ways = list(entity.lines)[: len(drawn.segments_by_outcome)]
    for line, (kind, ones) in zip(ways, drawn.segments_by_outcome, strict=True):
        colour = (line.color.r, line.color.g, line.color.b, line.color.a)
        assert colour == pytest.approx(theme.rgba(f"return-{kind}", dark=True))
        assert len(line.points) == len(ones)
        point = line.points[0]
        assert (point.x, point.y) == pytest.approx(ones[0].start[:2])
        # Just below the way, so that the plan stays visible.
        assert 0.0 < ones[0].start[2] - point.z < 20.0
    assert [text.text for text in entity.texts] == [f"return {k}" for k in range(1, len(drawn.worst) + 1)]
    terrain = setup.scenario.terrain
    assert terrain is not None
    ground = list(entity.lines)[len(drawn.segments_by_outcome) + len(drawn.worst) :]
    assert ground
    for point in (line.points[0] for line in ground):
        assert 0.0 < point.z - float(terrain.height(point.x, point.y)) < 10.0
    plain = SceneUpdate()
    plain.ParseFromString(returns_scene(0, replace(drawn, glides=NO_GLIDES), terrain))
    assert len(plain.entities[0].lines) == len(drawn.segments_by_outcome) + len(drawn.worst)


def test_a_log_shows_returns_from_its_start_though_they_were_judged_at_its_end(tmp_path: Path) -> None:
    setup = make_setup()
    drawn = hill_drawn(hill_setup(tmp_path))
    paths = [tmp_path / "with.mcap", tmp_path / "without.mcap"]
    for path, returns in zip(paths, (drawn, None), strict=True):
        with Recorder(path, setup) as recorder:
            recorder.write(make_track(seconds=4.0))
            recorder.finish("completed", returns=returns)
    with paths[0].open("rb") as file:
        found = [message.log_time for _, _, message in make_reader(file).iter_messages(topics=[RETURNS_TOPIC])]
    assert found == [EPOCH_NS]
    assert read_log(paths[0]).ended == "completed"
    assert len(read_log(paths[0]).track) == len(read_log(paths[1]).track)
    with paths[1].open("rb") as file:
        assert RETURNS_TOPIC not in {channel.topic for channel in make_reader(file).get_summary().channels.values()}
