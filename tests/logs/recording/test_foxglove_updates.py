"""The track so far stays small, begins and ends where it does, and keeps to what was flown."""

import importlib.util
import itertools
import math
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import LineString, Point

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs import theme
from logs.recording.foxglove_scene import body_rotation
from logs.recording.foxglove_updates import (
    MAX_POINTS,
    THINNED_POINT_COUNT,
    TRACK_INTERVAL_S,
    GrowingTrack,
    points_along_legs,
    thin_line,
)
from logs.recording.mcap_writer import SECOND_NS
from logs.recording.reader import read_log
from logs.recording.state_channel import EPOCH_NS
from tests.clients import need
from tests.logs.made_flight import make_setup, make_track, record
from tests.logs.mcap_messages import messages
from world.frames import to_geo


def test_a_long_winding_flight_keeps_its_shape() -> None:
    """Two hours along a wide zigzag of 40 corners: within 60 m of every corner, in at most 96 points."""
    corners = np.array([[3000.0 * k, 4000.0 * (k % 2), 100.0] for k in range(41)])
    along = np.linspace(0.0, 40.0, 7200 // TRACK_INTERVAL_S)
    flown = np.stack([np.interp(along, range(41), corners[:, k]) for k in range(3)], axis=1)
    track, longest = GrowingTrack(), 0
    for k, position in enumerate(flown):
        points = track.add(position)
        longest = max(longest, len(points))
        assert len(points) <= min(k + 1, MAX_POINTS)
        assert (points[0] == flown[0]).all()
        assert (points[-1] == position).all()
    line = LineString(points[:, :2])
    assert max(line.distance(Point(*corner[:2])) for corner in corners) < 60.0
    assert (longest, THINNED_POINT_COUNT) == (96, 64)


@pytest.mark.parametrize("wanted", [2, 5, 30])
def test_thinning_keeps_ends_and_the_count(wanted: int) -> None:
    points = np.random.default_rng(wanted).normal(size=(60, 3))
    left = thin_line(points, wanted)
    assert len(left) == wanted
    assert (left[[0, -1]] == points[[0, -1]]).all()


def test_points_on_straight_ways_go_first() -> None:
    square = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])
    way = np.concatenate([np.linspace(a, b, 10, endpoint=False) for a, b in itertools.pairwise(square)])
    points = np.column_stack([np.vstack([way, square[-1:]]), np.zeros(31)])
    assert thin_line(points, 4)[:, :2].tolist() == square.tolist()


# ----------------------------------------------------------------------
# What happens in flight stands in the log when it happens.


def noted(path: Path) -> list[tuple[float, int, str]]:
    found = messages(path)["/log"]
    return [((m.log_time - EPOCH_NS) / 1e9, said.level, said.message) for m, said in found if said.name == "flight"]


def test_legs_are_noted_at_the_row_that_begins_them(log_file: Path, track: Track) -> None:
    starts = [k for k in range(len(track)) if k == 0 or track.leg[k] != track.leg[k - 1]]
    legs = [(time, text) for time, _, text in noted(log_file) if text.startswith("leg ")]
    items = make_setup().route.items
    wanted = [
        (track.time[k], f"leg {leg}, to waypoint {leg + 1} (item {items[leg + 1]})")
        for k in starts
        for leg in [int(track.leg[k])]
    ]
    assert [text for _, text in legs] == [text for _, text in wanted]
    np.testing.assert_allclose([time for time, _ in legs], [time for time, _ in wanted], atol=1e-9)


def by_text(event: tuple[float, int, str]) -> str:
    return event[2]


def test_a_threat_is_noted_where_its_sphere_is_entered_and_left(
    log_file: Path, setup: FlightSetup, track: Track
) -> None:
    """To a fifth of a second, by the distance of each row."""
    threats = setup.scenario.threats
    told = [(time, level, text) for time, level, text in noted(log_file) if "range of" in text]
    wanted = []
    for radii, kind, level in ((threats.kill_radius, "missile", 3), (threats.detection_radius, "radar", 2)):
        for name, centre, radius in zip(threats.names, threats.position, radii, strict=True):
            inside = np.sqrt(((track.position - centre) ** 2).sum(axis=1)) < radius
            for k in np.flatnonzero(np.diff(inside.astype(int), prepend=0)).tolist():
                entered = bool(inside[k])
                text = f"{'inside' if entered else 'out of'} the {kind} range of {name}"
                wanted.append((float(track.time[k]), level if entered else 2, text))
    assert wanted
    told.sort(key=by_text)
    wanted.sort(key=by_text)
    assert [event[1:] for event in told] == [event[1:] for event in wanted]
    for (time, *_), (at, *_) in zip(told, wanted, strict=True):
        assert 0.0 <= time - at < 0.2


def test_they_do_not_hang_on_the_blocks_and_are_not_read_as_events(tmp_path: Path, setup: FlightSetup) -> None:
    track = make_track()
    one = record(tmp_path / "one.mcap", setup, track, rows_a_block=len(track))
    many = record(tmp_path / "many.mcap", setup, track, rows_a_block=7)
    assert one.read_bytes() == many.read_bytes()
    assert [event.text for event in read_log(one).events] == ["half way up", "arrived"]


def test_messages_stand_in_order_of_time(log_file: Path) -> None:
    times = [message.log_time for message, _ in messages(log_file)["/log"]]
    assert times == sorted(times)


# ----------------------------------------------------------------------
# Points for viewers without triangles and lines, as Rerun's own reader decodes a whole log.

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
    assert set(red) == {round(255 * theme.rgba(role, dark=True)[0]) for role in ("missile", "radar")}
    (row,) = shown["/points/plan"]
    assert points(row)[-1] == pytest.approx(setup.route.positions[-1], abs=0.05)


def test_the_track_of_points_grows_to_the_whole(shown: dict[str, list[dict[str, Any]]], track: Track) -> None:
    rows = shown["/points/track"]
    counts = [len(points(row)) for row in rows]
    assert counts == sorted(counts)
    last = points(rows[-1])
    wanted = track.position[[*(round(60 * k) for k in range(int(track.time[-1]) + 1)), -1]]
    assert last == pytest.approx(wanted, abs=0.05)


def test_the_legs_points_are_close_and_even() -> None:
    corners = np.array([[0.0, 0.0, 100.0], [1000.0, 0.0, 150.0], [1000.0, 400.0, 150.0]])
    found = points_along_legs(corners)
    gaps = np.sqrt((np.diff(found, axis=0) ** 2).sum(axis=1))
    assert gaps.max() <= 30.0
    assert gaps.sum() == pytest.approx(math.hypot(1000.0, 50.0) + 400.0)
    for corner in corners:
        assert np.abs(found - corner).sum(axis=1).min() == 0.0
    far = points_along_legs(np.array([[0.0, 0.0, 0.0], [1e6, 0.0, 0.0]]))
    assert len(far) <= 4002


# ----------------------------------------------------------------------
# Pose, fix and track messages show the recorded rows, at their own rates.


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
