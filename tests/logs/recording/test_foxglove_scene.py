"""The scene's messages are drawn in the frames that their docstring names."""

import math

import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from logs.recording.foxglove_scene import body_rotation, plan_scene, threats_scene, zones_scene
from logs.recording.state_channel import EPOCH_NS
from tests.logs.made_flight import make_setup


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
    entity = SceneUpdate.FromString(zones_scene(EPOCH_NS, setup.scenario, setup.route.waypoints)).entities[0]
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
    update = plan_scene(EPOCH_NS, setup.route.waypoints, setup.route.items.tolist())
    entity = SceneUpdate.FromString(update).entities[0]
    assert [text.text for text in entity.texts] == ["0", "1 (item 2)", "2 (item 3)", "3 (item 4)"]
