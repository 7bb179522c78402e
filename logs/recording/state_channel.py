"""Encode and decode the `/state` channel: rows of the track as protobuf messages.

The bytes are arranged by numpy arrays.

Every field is a fixed32 or fixed64 and every field is written, zero or not, so that a message has one layout and n
messages are one structured array. Any protobuf parser reads them. The schema is built here, so that no protoc is
needed.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from numpy.typing import NDArray

from flight.simulation.track import COLUMN_NAMES, COLUMNS, Track
from logs.recording.mcap_writer import MESSAGE_HEADER, MESSAGE_OPCODE
from world.arrays import Bytes, Floats
from world.kernels import compiled

Encoded = NDArray[np.void]
StateRecords = NDArray[np.void]


if TYPE_CHECKING:
    from google.protobuf.descriptor import Descriptor, FileDescriptor
    from google.protobuf.message import Message


# ----------------------------------------------------------------------
# Many protobuf messages of doubles at once, as numpy structured arrays of their encoding.
#
# Message objects of the protobuf library take some microseconds each.  Ten thousand of them take as long as the
# simulation of minutes of flight.

# Wire type of a 64-bit value.
_FIXED64 = 1
# Wire type of bytes with a length before them.
_LENGTH_DELIMITED = 2


def tagged_doubles(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return numpy fields for doubles, each after a one-byte field for its protobuf tag.

    The field of the tag is named `tag_<name>`.
    """
    return [field for name in names for field in ((f"tag_{name}", "u1"), (name, "<f8"))]


def submessage_dtype(names: Sequence[str]) -> np.dtype[np.void]:
    """Return the numpy type of a protobuf submessage: tag, size, and a tagged double for each name."""
    return np.dtype([("tag", "u1"), ("size", "u1"), *tagged_doubles(names)])


def fill_doubles(out: Encoded, names: Sequence[str], values: Floats) -> None:
    """Fill n records with m doubles each, every double after its protobuf tag.

    out: records to fill, (n,), with the fields of `tagged_doubles`.
    names: names of the m fields, whose protobuf field numbers are 1 to m.
    values: doubles of each record, (n, m).
    """
    for field_number, (name, column) in enumerate(zip(names, values.T, strict=True), 1):
        out[f"tag_{name}"], out[name] = field_number << 3 | _FIXED64, column


def fill_submessages(out: Encoded, field_number: int, names: Sequence[str], values: Floats) -> None:
    """Fill n records with a submessage of m doubles each.

    out: records to fill, (n,) of type `submessage_dtype`.
    field_number: field number of the submessage in its parent message.
    names, values: as in `fill_doubles`.
    """
    out["tag"], out["size"] = field_number << 3 | _LENGTH_DELIMITED, out.dtype.itemsize - 2
    fill_doubles(out, names, values)


def repeated_submessages(field_number: int, names: Sequence[str], values: Floats) -> bytes:
    """Encode n rows of m doubles, (n, m), as a repeated protobuf field with one submessage per row."""
    messages: Encoded = np.zeros(len(values), dtype=submessage_dtype(names))
    fill_submessages(messages, field_number, names, values)
    return messages.tobytes()


def length_delimited(field_number: int, data: bytes) -> bytes:
    """Encode the bytes of a submessage as the field `field_number` of its parent message."""
    # The size is a varint: seven bits in each byte, and the highest bit set in all bytes but the last.
    size, head = len(data), bytearray([field_number << 3 | _LENGTH_DELIMITED])
    while size > 127:
        head.append(size & 127 | 128)
        size >>= 7
    head.append(size)
    return bytes(head) + data


def as_bytes(messages: NDArray[Any]) -> NDArray[np.uint8]:
    """View a structured array (n,) as (n, size) bytes."""
    return np.ascontiguousarray(messages).view(np.uint8).reshape(len(messages), messages.dtype.itemsize)


# Log time at simulation time 0: 2000-01-01T00:00:00Z in ns since 1970.  It is not 0, which in MCAP means "no messages".
EPOCH_NS = 946_684_800_000_000_000

STATE_NAME = "planfly.State"
LOG_NAME = "foxglove.Log"
STATE_TOPIC = "/state"
EVENT_TOPIC = "/log"

_DOUBLES = ("time", "position")
_TYPE = descriptor_pb2.FieldDescriptorProto
_KINDS = {
    "<f8": (_TYPE.TYPE_DOUBLE, 1),
    "<f4": (_TYPE.TYPE_FLOAT, 5),
    "<i4": (_TYPE.TYPE_SFIXED32, 5),
    "<u4": (_TYPE.TYPE_FIXED32, 5),
}


class StateField(NamedTuple):
    """Field of the state message.

    name: name with its unit.
    kind: numpy type.
    source: field of `Track` with the values.
    component: column of that field; None for a field of one column.
    """

    name: str
    kind: str
    source: str
    component: int | None

    def select(self, values: NDArray[Any]) -> NDArray[Any]:
        """Select this field's column, (t,), from the values of the track's field, (t,) or (t, n)."""
        return values if self.component is None else values[:, self.component]


# The fields of the state message in order, without its first field `row`.
FIELDS = tuple(
    StateField(
        name=name,
        kind="<f8" if source in _DOUBLES else "<i4" if source == "leg" else "<f4",
        source=source,
        component=None if len(names) == 1 else k,
    )
    for source, names in COLUMN_NAMES.items()
    for k, name in enumerate(names)
)
_MESSAGE_FIELDS = [("row", "<u4"), *((field.name, field.kind) for field in FIELDS)]

# The protobuf description of the file that declares the state message.
STATE_FILE = descriptor_pb2.FileDescriptorProto(
    name="planfly/State.proto",
    package="planfly",
    syntax="proto3",
    message_type=[
        descriptor_pb2.DescriptorProto(
            name="State",
            field=[
                _TYPE(name=name, number=number, type=_KINDS[kind][0], label=_TYPE.LABEL_OPTIONAL)
                for number, (name, kind) in enumerate(_MESSAGE_FIELDS, 1)
            ],
        )
    ],
)
# The tag before each value.  From field 16 on, the tag is a varint of two bytes, low seven bits first.
_TAGS = {
    f"tag_{name}": tag if tag < 128 else (tag & 127 | 128) | (tag >> 7) << 8
    for number, (name, kind) in enumerate(_MESSAGE_FIELDS, 1)
    for tag in (number << 3 | _KINDS[kind][1],)
}
STATE_BODY = np.dtype(
    [
        part
        for (tag_name, tag), message_field in zip(_TAGS.items(), _MESSAGE_FIELDS, strict=True)
        for part in ((tag_name, "u1" if tag < 256 else "<u2"), message_field)
    ]
)
# One MCAP message record of this channel, including its header.
RECORD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
        ("state", STATE_BODY),
    ]
)


def state_class() -> "type[Message]":
    """Build the protobuf class of a state message in a separate descriptor pool."""
    pool = descriptor_pool.DescriptorPool()
    pool.Add(STATE_FILE)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(STATE_NAME))


def state_schema() -> bytes:
    """Return the serialized FileDescriptorSet of the state message, which MCAP embeds as the schema."""
    return descriptor_pb2.FileDescriptorSet(file=[STATE_FILE]).SerializeToString(deterministic=True)


def file_descriptor_set(descriptor: "Descriptor") -> bytes:
    """Return the serialized FileDescriptorSet of a message type, imported files first."""
    files: dict[str, FileDescriptor] = {}

    def visit(file: "FileDescriptor") -> None:
        """Add a file after the files that it depends on."""
        if file.name not in files:
            for dependency in file.dependencies:
                visit(dependency)
            files[file.name] = file

    visit(descriptor.file)
    file_set = descriptor_pb2.FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(file_set.file.add())
    return file_set.SerializeToString(deterministic=True)


def times_ns(time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Convert simulation times, s, to log times, ns since 1970; time 0 becomes `EPOCH_NS`."""
    return np.rint(time * 1e9).astype(np.int64) + EPOCH_NS


# A message record of one state message with all tags and lengths set, and values of 0.
_TEMPLATE: StateRecords = np.zeros(1, dtype=RECORD)
_TEMPLATE["opcode"] = MESSAGE_OPCODE
_TEMPLATE["length"] = MESSAGE_HEADER + STATE_BODY.itemsize
_TEMPLATE["state"][list(_TAGS)] = tuple(_TAGS.values())


def encode_rows(rows: NDArray[np.record], first_row: int, channel: int) -> StateRecords:
    """Encode rows of a flight as MCAP message records, (t,) of `RECORD`.

    rows: (t,) of `flight.simulation.track.TRACK_ROW`.
    first_row: number of the first row in the whole flight.
    channel: number of the MCAP channel.
    """
    log_times = times_ns(rows["time"])
    records: StateRecords = np.repeat(_TEMPLATE, len(rows))
    numbers = np.arange(first_row, first_row + len(rows)).astype(np.uint32)
    records["channel"] = channel
    records["sequence"] = numbers
    records["log_time"] = log_times
    records["publish_time"] = log_times
    state = records["state"]
    state["row"] = numbers
    with np.errstate(over="ignore", invalid="ignore"):
        for field in FIELDS:
            state[field.name] = field.select(rows[field.source])
    return records


def join_records(arrays: list[StateRecords], kind: np.dtype[np.void]) -> StateRecords:
    """Join structured arrays that all have the type `kind`.

    They are joined as bytes, because numpy would compare the structured types name by name, which takes longer.
    """
    if not arrays:
        return np.zeros(0, dtype=kind)
    return np.concatenate([np.ascontiguousarray(records).view(np.uint8) for records in arrays]).view(kind)


def decode_rows(records: StateRecords) -> Track:
    """Decode message records, (t,) of `RECORD`, to a track."""
    rows = records["state"]
    columns: dict[str, list[NDArray[np.generic]]] = {name: [] for name in COLUMNS}
    for field in FIELDS:
        columns[field.source].append(rows[field.name])
    return Track(*(parts[0] if len(parts) == 1 else np.stack(parts, axis=1) for parts in columns.values()))  # type: ignore[arg-type]  # one array a field, typed by Track


def parse_row(data: bytes, parser: "type[Message]") -> StateRecords:
    """Parse a state message in any layout that protobuf allows to an array (1,) of `RECORD`.

    Raises google.protobuf.message.DecodeError for an invalid message.

    parser: class from `state_class`.
    """
    message = parser.FromString(data)
    record = _TEMPLATE.copy()
    for name, _ in _MESSAGE_FIELDS:
        record["state"][name] = getattr(message, name)
    return record


@compiled
def _count_matching(raw: Bytes, columns: NDArray[np.int64], expected: Bytes) -> int:
    """Return the number of leading records that have the expected bytes.

    raw: bytes of the records, (n, size).
    columns: positions of the compared bytes in a record, (k,).
    expected: expected bytes at these positions, (k,).
    """
    for row in range(len(raw)):
        for k in range(len(columns)):
            if raw[row, columns[k]] != expected[k]:
                return row
    return len(raw)


class RowMatcher:
    """Finder of state messages in the layout of `RECORD`, which numpy can read without parsing each one."""

    def __init__(self, channel: int) -> None:
        """Store the bytes that all state messages of a file have in common: opcode, length, channel and tags.

        channel: MCAP channel of the file's state messages.
        """
        sample = _TEMPLATE.copy()
        sample["channel"] = channel
        fixed_mask: StateRecords = np.zeros(1, dtype=RECORD)
        fixed_mask["opcode"], fixed_mask["length"], fixed_mask["channel"] = 0xFF, 0xFFFF_FFFF_FFFF_FFFF, 0xFFFF
        for name, tag in _TAGS.items():
            fixed_mask["state"][name] = 0xFF if tag < 256 else 0xFFFF
        self._columns = np.flatnonzero(fixed_mask.view(np.uint8))
        self._expected = sample.view(np.uint8)[self._columns]

    def match(self, data: bytes, offset: int) -> StateRecords:
        """Return the consecutive records from byte `offset` on that have the expected layout.

        The result is an array (n,) of `RECORD`.
        """
        count = (len(data) - offset) // RECORD.itemsize
        raw = np.frombuffer(data, np.uint8, count * RECORD.itemsize, offset).reshape(count, RECORD.itemsize)
        matching_count = _count_matching(raw, self._columns, self._expected)
        return raw[:matching_count].reshape(-1).view(RECORD)
