"""Pose, fix and track messages show the recorded rows, at their own rates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.chunk_layout import SECOND_NS
from logs.recording.foxglove_scene import body_rotation
from logs.recording.state_channel import EPOCH_NS
from tests.logs.made_flight import make_setup, make_track, record
from tests.logs.mcap_messages import messages
from world.frames import to_geo


def test_viewers_get_poses_fixes_scenes_and_events_of_the_recorded_rows(
    log_file: Path, setup: FlightSetup, track: Track
) -> None:
    found = messages(log_file)
    assert sorted(found) == sorted(
        ["/state", "/tf", "/fix", "/log"]
        + [f"/scene/{part}" for part in ("terrain", "threats", "plan", "zones", "track", "aircraft")]
        + [f"/points/{part}" for part in ("terrain", "threats", "plan", "track", "aircraft")]
    )
    seconds = track.time[-1] - track.time[0]
    for topic, rate in (("/tf", 5), ("/fix", 1)):
        assert rate * seconds - 1 <= len(found[topic]) <= rate * seconds + 1
    for message, pose in found["/tf"]:
        row = round((message.log_time - EPOCH_NS) / 1e9 * 60)
        assert (pose.parent_frame_id, pose.child_frame_id) == ("map", "aircraft")
        assert pose.timestamp.seconds * SECOND_NS + pose.timestamp.nanos == message.log_time
        position = (pose.translation.x, pose.translation.y, pose.translation.z)
        np.testing.assert_allclose(position, track.position[row], atol=2**-11 + 1e-12)
        turn = (pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w)
        np.testing.assert_allclose(turn, body_rotation(track.attitude[row]), atol=2**-21 + 1e-12)
    message, fix = found["/fix"][5]
    row = round((message.log_time - EPOCH_NS) / 1e9 * 60)
    lat, lon = to_geo(setup.scenario.origin, track.position[row, 0], track.position[row, 1])
    assert (fix.latitude, fix.longitude, fix.altitude) == (float(lat), float(lon), track.position[row, 2])
    mesh = found["/scene/terrain"][0][1].entities[0].triangles[0]
    assert len(mesh.indices) % 3 == 0
    assert max(mesh.indices) < len(mesh.points) == len(mesh.colors)
    terrain = setup.scenario.terrain
    assert terrain is not None
    for point in list(mesh.points)[::501]:
        # Points are rounded to 1/16 m, along the ground too; the steepest of this one rises 0.3 m a metre.
        assert point.z == pytest.approx(float(terrain.height(point.x, point.y)), abs=0.05)
    threats = found["/scene/threats"][0][1].entities[0]
    assert [sphere.size.x for sphere in threats.spheres] == [800.0, 1600.0]
    line = found["/scene/track"][-1][1].entities[0].lines[0]
    assert (line.points[-1].x, line.points[-1].y) == tuple(track.position[-1, :2])
    said = [(item.level, item.message) for _, item in found["/log"] if item.name == "planfly"]
    assert said == [(3, "half way up"), (2, "arrived")]


def test_a_log_has_a_scene_of_the_scenarios_zones_and_the_missions_fence(tmp_path: Path, track: Track) -> None:
    zone = {"name": "town", "kind": "exclusion", "east_m": 0, "north_m": 0, "radius_m": 200}
    found = messages(record(tmp_path / "zones.mcap", make_setup(zones=[zone]), track))
    ((_, update),) = found["/scene/zones"]
    assert [text.text for text in update.entities[0].texts] == ["town", "fence item 0"]
    setup = make_setup()
    free = replace(setup, mission=replace(setup.mission, fences=()))
    assert "/scene/zones" not in messages(record(tmp_path / "none.mcap", free, track))


def test_the_track_keeps_up(tmp_path: Path) -> None:
    """A message at least every 2 s of flight, each the whole track so far, to where the aircraft is."""
    flown = make_track(31.0)
    found = messages(record(tmp_path / "long.mcap", make_setup(), flown))["/scene/track"]
    times = [(message.log_time - EPOCH_NS) / 1e9 for message, _ in found]
    assert times[0] == 0.0
    assert max(np.diff(times)) <= 2.0
    for time, (_, update) in zip(times, found, strict=True):
        (entity,) = update.entities
        line = entity.lines[0].points
        row = min(int(np.searchsorted(flown.time, time - 1e-6)), len(flown) - 1)
        assert (entity.id, len(line) <= 96) == ("track", True)
        np.testing.assert_allclose([line[0].x, line[0].y, line[0].z], flown.position[0], atol=0.04)
        np.testing.assert_allclose([line[-1].x, line[-1].y, line[-1].z], flown.position[row], atol=0.04)
