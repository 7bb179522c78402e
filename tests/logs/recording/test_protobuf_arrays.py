"""Arrays of messages have the bytes that the protobuf library gives to each message."""

import numpy as np
import pytest
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from google.protobuf.wrappers_pb2 import BytesValue

from logs.recording.protobuf_arrays import length_delimited, repeated_submessages


def test_repeated_messages_read_as_those_of_the_library() -> None:
    values = np.random.default_rng(3).normal(size=(50, 3))
    data = repeated_submessages(LinePrimitive.POINTS_FIELD_NUMBER, "xyz", values)
    points = [Point3(x=x, y=y, z=z) for x, y, z in values.tolist()]
    assert data == LinePrimitive(points=points).SerializeToString()


@pytest.mark.parametrize("size", [1, 127, 128, 16_384, 3_000_000])
def test_a_field_of_bytes_has_the_librarys_length(size: int) -> None:
    assert length_delimited(1, bytes(size)) == BytesValue(value=bytes(size)).SerializeToString()
