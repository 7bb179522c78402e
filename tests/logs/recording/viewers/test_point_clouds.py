"""Points for viewers without triangles and lines, as Rerun's own reader decodes a whole log."""

import importlib.util
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.viewers.point_clouds import along
from tests.clients import need

SECOND = 1e9
BEGAN = 946_684_800 * SECOND


@pytest.fixture(scope="module")
def shown(log_file: Path) -> dict[str, list[dict[str, Any]]]:
    """What Rerun makes of a log: by entity, its rows of components."""
    spec = importlib.util.find_spec("rerun")
    need(spec.origin if spec else None, "rerun", "pip package rerun-sdk")
    from rerun.chunk import McapReader

    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for chunk in McapReader(log_file).stream():
        for row in chunk.to_record_batch().to_pylist():
            if not any(name.startswith("McapChannel") for name in row):
                found[str(chunk.entity_path)].append(row)
    return found


def points(row: dict[str, Any]) -> np.ndarray:
    return np.array(row["Points3D:positions"])


def frame(row: dict[str, Any]) -> str:
    return row["CoordinateFrame:frame"][0]


def test_rerun_has_something_to_open_a_3d_view_with(shown: dict[str, list[dict[str, Any]]]) -> None:
    """Points of everything that stands, in the map's frame, and of the aircraft in its own, which a transform moves."""
    for part in ("terrain", "threats", "plan"):
        (row,) = shown[f"/points/{part}"]
        assert len(points(row)) > 50, part
        assert frame(row) == "map"
    (aircraft,) = shown["/points/aircraft"]
    assert frame(aircraft) == "aircraft"
    assert np.ptp(points(aircraft)[:, 1]) == pytest.approx(100.0, abs=0.2)
    assert "half way up" in [text for row in shown["/log"] for text in row["TextLog:text"]]
    poses = shown["/tf"]
    assert len(poses) > 30
    assert (poses[0]["Transform3D:parent_frame"], poses[0]["Transform3D:child_frame"]) == (["map"], ["aircraft"])


def test_the_points_are_those_of_the_scenario(
    shown: dict[str, list[dict[str, Any]]], setup: FlightSetup, track: Track
) -> None:
    (row,) = shown["/points/terrain"]
    terrain = setup.scenario.terrain
    for east, north, up in points(row)[::101]:
        assert up == pytest.approx(float(terrain.height(east, north)), abs=0.1)
    (row,) = shown["/points/threats"]
    missile, radar = np.split(points(row), 2)
    for sphere, index, radius in ((missile, 0, 400.0), (radar, 1, 800.0)):
        off = np.sqrt(((sphere - setup.scenario.threats.position[index]) ** 2).sum(axis=1))
        assert off == pytest.approx(radius, abs=0.2)
        assert np.abs(sphere.mean(axis=0) - setup.scenario.threats.position[index]).max() < 0.05 * radius
    colours = [int(value) for value in row["Points3D:colors"]]
    red = [value >> 24 for value in colours]
    assert set(red) == {217, 242}
    (row,) = shown["/points/plan"]
    assert points(row)[-1] == pytest.approx(setup.route.waypoints[-1], abs=0.05)


def test_the_track_of_points_grows_to_the_whole(shown: dict[str, list[dict[str, Any]]], track: Track) -> None:
    rows = shown["/points/track"]
    counts = [len(points(row)) for row in rows]
    assert counts == sorted(counts)
    last = points(rows[-1])
    wanted = track.position[[*(round(60 * k) for k in range(int(track.time[-1]) + 1)), -1]]
    assert last == pytest.approx(wanted, abs=0.05)


def test_the_legs_points_are_close_and_even() -> None:
    corners = np.array([[0.0, 0.0, 100.0], [1000.0, 0.0, 150.0], [1000.0, 400.0, 150.0]])
    found = along(corners)
    gaps = np.sqrt((np.diff(found, axis=0) ** 2).sum(axis=1))
    assert gaps.max() <= 30.0
    assert gaps.sum() == pytest.approx(math.hypot(1000.0, 50.0) + 400.0)
    for corner in corners:
        assert np.abs(found - corner).sum(axis=1).min() == 0.0
    far = along(np.array([[0.0, 0.0, 0.0], [1e6, 0.0, 0.0]]))
    assert len(far) <= 4002
