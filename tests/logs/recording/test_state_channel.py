"""Arrays of messages have the bytes that the protobuf library gives to each message."""

from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from google.protobuf.wrappers_pb2 import BytesValue

from flight.simulation.track import Track
from logs.recording.state_channel import EPOCH_NS, length_delimited, repeated_submessages
from tests.logs.mcap_messages import messages


def test_repeated_messages_read_as_those_of_the_library() -> None:
    values = np.random.default_rng(3).normal(size=(50, 3))
    data = repeated_submessages(LinePrimitive.POINTS_FIELD_NUMBER, "xyz", values)
    points = [Point3(x=x, y=y, z=z) for x, y, z in values.tolist()]
    assert data == LinePrimitive(points=points).SerializeToString()


@pytest.mark.parametrize("size", [1, 127, 128, 16_384, 3_000_000])
def test_a_field_of_bytes_has_the_librarys_length(size: int) -> None:
    assert length_delimited(1, bytes(size)) == BytesValue(value=bytes(size)).SerializeToString()


# ----------------------------------------------------------------------
# State messages are whole rows of the track to readers that know only the schema in the file.


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
