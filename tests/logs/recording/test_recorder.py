"""The recorded file, read by mcap's own readers and by protobuf classes made from the schemas inside it."""

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.foxglove_scene import body_rotation
from logs.recording.reader import read_log
from logs.recording.recorder import CHUNK_SIZE, Recorder
from logs.recording.state_channel import EPOCH_NS, SECOND_NS
from tests.logs.made_flight import make_setup, make_track, record
from world.frames import to_geo


def message_class(schema: Schema) -> Any:
    """From the embedded FileDescriptorSet alone."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))


def messages(path: Path) -> dict[str, list[tuple[Message, Any]]]:
    found: dict[str, list[tuple[Message, Any]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        classes: dict[int, Any] = {}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            kind = classes.setdefault(schema.id, message_class(schema))
            found.setdefault(channel.topic, []).append((message, kind.FromString(message.data)))
    return found


def chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        return [
            item for item in StreamReader(file, emit_chunks=True, validate_crcs=True).records if isinstance(item, Chunk)
        ]


def test_an_independent_reader_finds_every_row_with_its_values(log_file: Path, track: Track) -> None:
    rows = messages(log_file)["/state"]
    assert len(rows) == len(track)
    state = [row for _, row in rows]
    assert [row.row for row in state] == list(range(len(track)))
    assert [row.time_s for row in state] == track.time.tolist()
    assert [row.up_amsl_m for row in state] == track.position[:, 2].tolist()
    assert [row.north_m for row in state] == track.position[:, 1].tolist()
    assert [row.velocity_up_mps for row in state] == track.velocity[:, 2].tolist()
    assert [row.yaw_rate_rad_per_s for row in state] == track.rates[:, 2].tolist()
    assert [row.beta_rad for row in state] == track.flow[:, 1].tolist()
    assert [row.rudder_rad for row in state] == track.controls[:, 2].tolist()
    assert [row.throttle_command_fraction for row in state] == track.commands[:, 3].tolist()
    assert [row.leg_index for row in state] == track.leg.tolist()
    assert [row.clearance_seen_m for row in state] == track.clearance.tolist()
    for message, row in rows:
        assert message.log_time == EPOCH_NS + round(row.time_s * 1e9)


def test_every_state_field_is_filled_and_none_is_left_over(log_file: Path) -> None:
    _, row = messages(log_file)["/state"][100]
    names = {field.name for field, _ in row.ListFields()}
    # The first leg's number is 0.
    assert {field.name for field in row.DESCRIPTOR.fields} - names == {"leg_index"}
    assert len(row.SerializeToString()) <= len(messages(log_file)["/state"][100][0].data)


def test_the_viewer_topics(log_file: Path, setup: FlightSetup, track: Track) -> None:
    found = messages(log_file)
    assert sorted(found) == sorted(
        ["/state", "/tf", "/fix", "/log", "/scene/terrain", "/scene/threats", "/scene/plan", "/scene/track"]
    )
    seconds = track.time[-1] - track.time[0]
    for topic, rate in (("/tf", 5), ("/fix", 1)):
        assert rate * seconds - 1 <= len(found[topic]) <= rate * seconds + 1
    for message, pose in found["/tf"]:
        row = round((message.log_time - EPOCH_NS) / 1e9 * 60)
        assert (pose.parent_frame_id, pose.child_frame_id) == ("map", "aircraft")
        assert pose.timestamp.seconds * SECOND_NS + pose.timestamp.nanos == message.log_time
        place = (pose.translation.x, pose.translation.y, pose.translation.z)
        np.testing.assert_allclose(place, track.position[row], atol=2**-11 + 1e-12)
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
    assert [(item.level, item.message) for _, item in found["/log"]] == [(3, "half way up"), (2, "arrived")]


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


def test_the_summary_agrees_with_the_data(log_file: Path, track: Track) -> None:
    with log_file.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        names = [item.name for item in reader.iter_attachments()]
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(len(items) for items in messages(log_file).values())
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == len(chunks(log_file))
    assert summary.statistics.attachment_count == len(names) == len(summary.attachment_indexes)
    assert summary.statistics.message_start_time == EPOCH_NS
    assert summary.statistics.message_end_time == EPOCH_NS + round(track.time[-1] * 1e9)
    assert names[0] == "setup.json"
    assert {"scenario.json", "plan.json", "mission.waypoints", "terrain.json"} < set(names)
    assert names[-2:] == ["verdict.json", "result.json"]


@pytest.mark.filterwarnings("ignore:(start|end)_time is deprecated:DeprecationWarning")
def test_a_message_index_points_at_its_messages(log_file: Path) -> None:
    # A reader that seeks by log time uses the index alone.
    with log_file.open("rb") as file:
        reader = make_reader(file)
        start, end = EPOCH_NS + 3 * SECOND_NS // 2, EPOCH_NS + 2 * SECOND_NS
        found = [message for _, _, message in reader.iter_messages(topics=["/state"], start_time=start, end_time=end)]
    assert [message.sequence for message in found] == list(range(90, 120))
    data = log_file.read_bytes()
    with log_file.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    for index in summary.chunk_indexes:
        stream = StreamReader(io.BytesIO(data[index.chunk_start_offset :]), skip_magic=True, emit_chunks=True)
        records = stream.records
        chunk = next(records)
        assert isinstance(chunk, Chunk)
        count = sum(isinstance(item, Message) for item in breakup_chunk(chunk))
        assert count == sum(len(next(records).records) for _ in index.message_index_offsets)  # type: ignore[attr-defined]  # MessageIndex


@pytest.mark.parametrize("rate_hz", [1.0, 60.0, 700.0])
def test_a_chunk_holds_at_most_a_second_and_64_kib(tmp_path: Path, setup: FlightSetup, rate_hz: float) -> None:
    path = record(tmp_path / "a.mcap", setup, make_track(3.0, rate_hz))
    for chunk in chunks(path)[1:]:  # the first holds the scene
        assert chunk.message_start_time // SECOND_NS == chunk.message_end_time // SECOND_NS
        assert chunk.uncompressed_size <= CHUNK_SIZE + 4096
    np.testing.assert_array_equal(read_log(path).track.time, make_track(3.0, rate_hz).time)


@pytest.mark.parametrize("rows_a_block", [1, 7, 59, 100_000])
def test_the_bytes_do_not_depend_on_the_blocks(tmp_path: Path, log_file: Path, rows_a_block: int) -> None:
    again = record(tmp_path / "again.mcap", make_setup(), make_track(), rows_a_block=rows_a_block)
    assert again.read_bytes() == log_file.read_bytes()


def test_an_exception_leaves_a_readable_unfinished_file(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    path = tmp_path / "cut.mcap"

    def fly() -> None:
        with Recorder(path, setup) as recorder:
            recorder.write(track.rows(0, 130))
            raise RuntimeError("engine")

    with pytest.raises(RuntimeError, match="engine"):
        fly()
    log = read_log(path)
    assert (log.complete, log.ended, len(log.track)) == (False, None, 130)
    assert "before the flight had ended" in log.problem
    with path.open("rb") as file:
        assert make_reader(file, validate_crcs=True).get_summary() is not None


def test_a_killed_process_loses_at_most_the_last_second(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    path, seen = tmp_path / "live.mcap", tmp_path / "seen.mcap"
    with Recorder(path, setup) as recorder:
        for first in range(0, 400, 13):
            recorder.write(track.rows(first, first + 13))
            # What another process sees of the file now is what a kill would leave.
            seen.write_bytes(path.read_bytes())
            whole = int(track.time[first + 12]) * 60
            if whole:
                log = read_log(seen)
                assert (len(log.track), log.complete) == (whole, False)


def test_what_cannot_be_recorded_is_refused(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    with Recorder(tmp_path / "a.mcap", setup) as recorder:
        recorder.write(track.rows(0, 0))
        recorder.write(track.rows(0, 10))
        with pytest.raises(ValueError, match="must increase"):
            recorder.write(track.rows(9, 20))
        with pytest.raises(ValueError, match="level 'loud'"):
            recorder.event(1.0, "x", "loud")
        with pytest.raises(ValueError, match="time nan"):
            recorder.event(math.nan, "x")
    with pytest.raises(FileNotFoundError):
        Recorder(tmp_path / "none" / "a.mcap", setup)


def test_the_setup_names_every_piece_and_every_package(log_file: Path) -> None:
    with log_file.open("rb") as file:
        pieces = {item.name: item.data for item in StreamReader(file).records if isinstance(item, Attachment)}
    setup = json.loads(pieces["setup.json"])
    assert set(setup["sha256"]) == set(pieces) - {"setup.json", "result.json", "verdict.json"}
    assert {"python", "numpy", "jsbsim", "mcap", "protobuf"} < set(setup["versions"])
    assert json.loads(pieces["result.json"]) == {
        "schema": "planfly.result/1",
        "ended": "completed",
        "rows": 480,
        "end_time_s": 7.983333333,
    }


@pytest.mark.parametrize("every", [2, 3, 7])
@pytest.mark.parametrize("rows_a_block", [1, 60, 100_000])
def test_one_row_in_so_many_and_the_last(tmp_path: Path, setup: FlightSetup, every: int, rows_a_block: int) -> None:
    whole = make_track(3.0)
    with Recorder(tmp_path / "thin.mcap", setup, every=every) as recorder:
        for first in range(0, len(whole), rows_a_block):
            recorder.write(whole.rows(first, min(len(whole), first + rows_a_block)))
        recorder.finish("completed")
    log = read_log(tmp_path / "thin.mcap")
    assert log.complete
    kept = sorted({*range(0, len(whole), every), len(whole) - 1})
    np.testing.assert_array_equal(log.track.time, whole.time[kept])
    np.testing.assert_array_equal(log.track.commands, whole.commands[kept])
