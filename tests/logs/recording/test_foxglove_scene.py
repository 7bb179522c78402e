"""The scene's messages are drawn in the frames that their docstring names."""

import math

import numpy as np
import pytest

from logs.recording.foxglove_scene import body_rotation


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
