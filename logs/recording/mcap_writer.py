"""Write an MCAP container from front to back, from prepared chunks.

The `Writer` of mcap takes one message at a time, at 5 us each, which is two to three times the time of this writer.
Its `Chunk` and `ChunkIndex` copy their fields through a record builder, which takes as long as the compression.  Here,
the records of a chunk and the index of its messages are passed as bytes.  Records that are written once use the classes
of mcap.  Every CRC of the format is written.
"""

import struct
import zlib
from collections import Counter
from dataclasses import dataclass
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from logs.recording.mcap_reader import FRAME, MAGIC, chunk_records, record_stream
from world.arrays import Bytes, Floats, Ints
from world.kernels import compiled, copy_into, inner

Index = NDArray[np.uint64]
Entries = NDArray[np.void]  # of ENTRY
Chunks = NDArray[np.void]  # of CHUNK
ChannelIndexes = NDArray[np.void]  # of CHANNEL_INDEX

_MESSAGE = struct.Struct("<HIQ")
# Head of a chunk: times, size and CRC before compression.
_CHUNK_HEADER = struct.Struct("<QQQI")
# Head of a chunk index: times, offset and length of the chunk, and length of its table of message indexes.
_CHUNK_INDEX_HEADER = struct.Struct("<QQQQI")
# Entry of the table of message indexes: channel and offset.
_INDEX_OFFSET = struct.Struct("<HQ")
# End of a chunk index: sizes of the chunk.
_CHUNK_SIZES = struct.Struct("<QQ")
# Name of the compression, with its length.
_COMPRESSION = b"\x04\x00\x00\x00zstd"
# Size of channel and length before the pairs of a message index, bytes.
_PAIRS_HEAD = 6


class ChannelIndex(NamedTuple):
    """Message index of one channel in a chunk.

    channel: number of the channel.
    offset: start of the index record in `ChunkContent.index`.
    messages: number of messages.
    """

    channel: int
    offset: int
    messages: int


@dataclass(frozen=True, slots=True)
class ChunkContent:
    """Content of a chunk: message records, and the message index records that follow the chunk.

    records: records of schemas, channels and messages, in this order.
    index: message index records.
    channels: channels with messages in the chunk, each with the start of its record in ``index``.
    start, end: log time of the oldest and the newest message, ns.
    """

    records: bytes | memoryview
    index: bytes
    channels: tuple[ChannelIndex, ...]
    start: int
    end: int


class _ChunkIndex(NamedTuple):
    """Entry of a chunk in the chunk index.

    content_start, content_end: log time of the oldest and the newest message, ns.
    position, length: position and length of the chunk record in the file, bytes.
    offsets: channel and file position of each message index of the chunk.
    index_length: total length of these message indexes, bytes.
    compressed, size: size of the records with and without compression, bytes.

    A frozen dataclass would take six times as long to create.
    """

    content_start: int
    content_end: int
    position: int
    length: int
    offsets: tuple[tuple[int, int], ...]
    index_length: int
    compressed: int
    size: int

    def record(self) -> bytes:
        """Encode the chunk index record of the chunk."""
        offsets = b"".join(_INDEX_OFFSET.pack(channel, position) for channel, position in self.offsets)
        header = _CHUNK_INDEX_HEADER.pack(
            self.content_start, self.content_end, self.position, self.length, len(offsets)
        )
        sizes = _CHUNK_SIZES.pack(self.compressed, self.size)
        content = header + offsets + self.index_length.to_bytes(8, "little") + _COMPRESSION + sizes
        return FRAME.pack(Opcode.CHUNK_INDEX, len(content)) + content


class ContainerWriter:
    """Writer of a container: header, attachments and chunks, then the summary by `write_end`."""

    def __init__(self, file: BinaryIO, profile: str, level: int = 3) -> None:
        """Begin a container in an empty file open for writing.

        profile: name of profile and library for the header.
        level: compression level of zstd.
        """
        self._file = file
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._crc = 0
        self._offset = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._unwritten_records: list[McapRecord] = []
        self._attachments: list[AttachmentIndex] = []
        self._chunks: list[_ChunkIndex] = []
        self._counts: Counter[int] = Counter()
        self._write_bytes(MAGIC + _record_bytes(Header(profile=profile, library=profile)))

    def write_attachment(self, name: str, media_type: str, data: bytes, log_time: int) -> None:
        """Write an attachment, and store its entry for the summary.

        log_time: ns since 1970.
        """
        record = _record_bytes(
            Attachment(create_time=0, log_time=log_time, name=name, media_type=media_type, data=data)
        )
        index = AttachmentIndex(self._offset, len(record), log_time, 0, len(data), name, media_type)
        self._attachments.append(index)
        self._write_bytes(record)

    def add_channel(self, topic: str, schema: str, data: bytes) -> int:
        """Add a protobuf channel, and its schema if it is new, to the next chunk; return the channel's number.

        schema: full name of the channel's message type.
        data: serialized FileDescriptorSet of this type.
        """
        if schema not in self._schemas:
            self._schemas[schema] = Schema(id=len(self._schemas) + 1, data=data, encoding="protobuf", name=schema)
            self._unwritten_records.append(self._schemas[schema])
        channel = Channel(len(self._channels) + 1, topic, "protobuf", {}, self._schemas[schema].id)
        self._channels.append(channel)
        self._unwritten_records.append(channel)
        return channel.id

    def pop_new_records(self) -> bytes:
        """Return the records of schemas and channels added since the last call, which begin the next chunk."""
        new_records = b"".join(_record_bytes(record) for record in self._unwritten_records)
        self._unwritten_records.clear()
        return new_records

    def copy_chunk(self, data: bytes) -> None:
        """Copy a chunk of another file to this file.

        The chunk's schemas and channels are added to this file.  Raises one of
        `logs.recording.mcap_reader.PARSE_ERRORS` for records that cannot be read.
        """
        index: dict[int, list[tuple[int, int]]] = {}
        for opcode, position, content in chunk_records(data):
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(record_stream(content))
                self._schemas.setdefault(f"{schema.id}", schema)
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(record_stream(content))
                if all(channel.id != known_channel.id for known_channel in self._channels):
                    self._channels.append(channel)
            elif opcode == Opcode.MESSAGE:
                number, _, log_time = _MESSAGE.unpack_from(content)
                index.setdefault(number, []).append((log_time, position))
        parts, channels, position = [], [], 0
        for number, pairs in sorted(index.items()):
            encoded_pairs = np.array(pairs, dtype="<u8").tobytes()
            header = number.to_bytes(2, "little") + len(encoded_pairs).to_bytes(4, "little")
            parts.append(FRAME.pack(Opcode.MESSAGE_INDEX, _PAIRS_HEAD + len(encoded_pairs)) + header + encoded_pairs)
            channels.append(ChannelIndex(number, position, len(pairs)))
            position += len(parts[-1])
        times = [log_time for pairs in index.values() for log_time, _ in pairs]
        start, end = (min(times), max(times)) if times else (0, 0)
        self.write_chunk(ChunkContent(data, b"".join(parts), tuple(channels), start, end))

    def write_chunk(self, content: ChunkContent) -> None:
        """Compress and write a chunk, and the message indexes that follow it."""
        data = self._compressor.compress(content.records)
        size = len(content.records)
        header = _CHUNK_HEADER.pack(content.start, content.end, size, zlib.crc32(content.records)) + _COMPRESSION
        header += len(data).to_bytes(8, "little")
        length = FRAME.size + len(header) + len(data)
        index_start = self._offset + length
        offsets = tuple(
            (channel_index.channel, index_start + channel_index.offset) for channel_index in content.channels
        )
        for channel_index in content.channels:
            self._counts[channel_index.channel] += channel_index.messages
        self._chunks.append(
            _ChunkIndex(content.start, content.end, self._offset, length, offsets, len(content.index), len(data), size)
        )
        frame = FRAME.pack(Opcode.CHUNK, length - FRAME.size)
        self._write_bytes(b"".join((frame, header, data, content.index)))

    @property
    def last_time(self) -> int:
        """Log time of the newest message, ns; 0 before the first chunk."""
        return max((chunk.content_end for chunk in self._chunks), default=0)

    def write_end(self) -> None:
        """Write the end of the data section and the summary; the file stays open."""
        self._write_bytes(_record_bytes(DataEnd(self._crc)))
        start = self._offset
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(sorted(self._counts.items())),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((chunk.content_end for chunk in self._chunks), default=0),
            message_start_time=min((chunk.content_start for chunk in self._chunks), default=0),
            metadata_count=0,
            schema_count=len(self._schemas),
        )
        groups = [
            (Opcode.SCHEMA, [_record_bytes(schema) for schema in self._schemas.values()]),
            (Opcode.CHANNEL, [_record_bytes(channel) for channel in self._channels]),
            (Opcode.STATISTICS, [_record_bytes(statistics)]),
            (Opcode.CHUNK_INDEX, [chunk.record() for chunk in self._chunks]),
            (Opcode.ATTACHMENT_INDEX, [_record_bytes(index) for index in self._attachments]),
        ]
        summary = b""
        offsets = b""
        for opcode, group_records in groups:
            group = b"".join(group_records)
            if group:
                offsets += _record_bytes(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        footer = _record_bytes(Footer(start, start + len(summary), 0))
        # The CRC covers the summary and the footer up to the CRC itself.
        crc = zlib.crc32(summary + offsets + footer[:-4])
        self._write_bytes(summary + offsets + footer[:-4] + crc.to_bytes(4, "little") + MAGIC)

    def flush(self) -> None:
        """Flush the file's buffer; an OSError names the file."""
        try:
            self._file.flush()
        except OSError as error:
            raise _with_file_name(error, self._file) from error

    def _write_bytes(self, data: bytes) -> None:
        """Write bytes to the file, and update the CRC and the offset; an OSError names the file."""
        try:
            self._file.write(data)
        except OSError as error:
            raise _with_file_name(error, self._file) from error
        self._crc = zlib.crc32(data, self._crc)
        self._offset += len(data)


def _with_file_name(error: OSError, file: BinaryIO) -> OSError:
    """Return a copy of a write error that names the file; some errors, such as a full disk, name none."""
    return OSError(error.errno, error.strerror, getattr(file, "name", None))


def _record_bytes(record: McapRecord) -> bytes:
    """Encode a record as bytes, with its opcode and length."""
    builder: Any = RecordBuilder()  # mcap leaves some of its methods without annotations
    record.write(builder)
    return bytes(builder.end())


# ----------------------------------------------------------------------
# The bytes inside chunks, for many seconds of flight at once, in compiled code.
#
# Handling one message at a time in Python costs more than simulating it.  Here messages are ordered by time, cut into
# chunks, and indexed in compiled code; Python only compresses each chunk.

# Size of the frame of a record (opcode, length), bytes.
FRAME_SIZE: Final = 9
# Size of the header of a message (channel, sequence, log time, publish time), bytes.
MESSAGE_HEADER: Final = 22
# Opcode of a message record.
MESSAGE_OPCODE: Final = 5
# Opcode of a message index record.
_INDEX_OPCODE: Final = 7
# Size of frame, channel and length of a message index, bytes.
_INDEX_HEAD: Final = 15
# Size of an entry of a message index, bytes.
_INDEX_ENTRY: Final = 16
# One second, ns.
SECOND_NS: Final = 1_000_000_000

# A message to be put into a chunk: source (its first byte in the blob of messages, or `FROM_ROWS` for the next state
# row), length in bytes, channel, log time (ns), and its start in the chunk.
ENTRY: Final = np.dtype([(name, np.int64) for name in ("source", "length", "channel", "log_time", "offset")])
# Source of a message that is the next state row.
FROM_ROWS: Final = -1
# Result of `last_log_time` for a time outside the recordable range.
OUT_OF_RANGE: Final = -1
# Result of `last_log_time` for a time not later than the time before it.
NOT_INCREASING: Final = -2
# A chunk: range of its bytes in `Layout.records`, log times of its first and last message (ns), and range of its
# message indexes in `Layout.index`.
CHUNK: Final = np.dtype(
    [(name, np.int64) for name in ("start", "stop", "first_ns", "last_ns", "index_start", "index_stop")]
)
# A channel in a chunk: offset of its index from the first index of the chunk, and number of messages; without messages
# there is no index.
CHANNEL_INDEX: Final = np.dtype([("offset", np.int64), ("messages", np.int64)])


@dataclass(frozen=True, slots=True)
class MessageRecords:
    """Message records of one channel, in order of time, one after the other in ``blob``.

    log_times: (n,) ns.  offsets: (n + 1,) start of each record in ``blob``, and end of the last.
    """

    channel: int
    log_times: Ints
    offsets: Ints
    blob: Bytes


@dataclass(frozen=True, slots=True)
class Layout:
    """Chunks of message records, and the message indexes of each.

    records: records of all chunks, one chunk after the other.
    index: message index records of all chunks.
    chunks: (c,) of `CHUNK`.
    channels: (c, channels + 1) of `CHANNEL_INDEX`, by chunk and channel number.
    """

    records: Bytes
    index: Bytes
    chunks: Chunks
    channels: ChannelIndexes


@inner
def _write_integer(buffer: Bytes, position: int, value: int, size: int) -> int:
    """Write a little-endian number of `size` bytes, and return the position after it."""
    for k in range(size):
        buffer[position + k] = (value >> (8 * k)) & 0xFF
    return position + size


@inner
def _write_varint(buffer: Bytes, position: int, value: int) -> int:
    """Write a value as a protobuf varint, seven bits in each byte, and return the position after it."""
    while value > 127:
        buffer[position] = (value & 127) | 128
        value >>= 7
        position += 1
    buffer[position] = value
    return position + 1


@compiled
def _write_message_header(buffer: Bytes, position: int, size: int, channel: int, log_time: int) -> int:
    """Write the frame and the header of a message record, and return the position after them.

    size: size of the message, bytes.
    log_time: ns since 1970; it is also the publish time.
    """
    # The opcode, the length of the record, its channel, sequence number 0, log time and publish time.
    buffer[position] = MESSAGE_OPCODE
    position = _write_integer(buffer, position + 1, MESSAGE_HEADER + size, 8)
    position = _write_integer(buffer, position, channel, 2)
    position = _write_integer(buffer, position, 0, 4)
    position = _write_integer(buffer, position, log_time, 8)
    return _write_integer(buffer, position, log_time, 8)


@compiled
def _stamp_messages(log_times: Ints, channel: int, tag: int, bodies: Bytes) -> tuple[Bytes, Ints]:
    """Encode n message records, each with a timestamp before a body of constant size.

    Return the bytes of all records, and the offset of each record, (n + 1,); the last offset is the end of the bytes.

    log_times: ns since 1970, (n,).
    tag: protobuf tag of the timestamp.
    bodies: bytes of the messages after their timestamps, (n, size).
    """
    count, body_size = bodies.shape
    # The timestamp takes at most 2 + 12 bytes: tag and length, then two tags and two varints of five bytes.
    buffer = np.empty(count * (FRAME_SIZE + MESSAGE_HEADER + 14 + body_size), dtype=np.uint8)
    offsets = np.zeros(count + 1, dtype=np.int64)
    timestamp = np.empty(16, dtype=np.uint8)
    position = 0
    for k in range(count):
        log_time = log_times[k]
        timestamp[0] = 0x08
        size = _write_varint(timestamp, 1, log_time // SECOND_NS)
        timestamp[size] = 0x10
        size = _write_varint(timestamp, size + 1, log_time % SECOND_NS)
        position = _write_message_header(buffer, position, 2 + size + body_size, channel, log_time)
        buffer[position], buffer[position + 1] = tag, size
        position += 2
        copy_into(buffer[position : position + size], timestamp[:size])
        position += size
        copy_into(buffer[position : position + body_size], bodies[k])
        position += body_size
        offsets[k + 1] = position
    return buffer[:position], offsets


def stamped_records(log_times: Ints, channel: int, timestamp_field: int, bodies: Bytes) -> MessageRecords:
    """Encode messages with a timestamp and a body of constant size as message records.

    log_times: ns since 1970, (n,).
    timestamp_field: field number of the timestamp.
    bodies: bytes of the messages after their timestamps, in protobuf's encoding, (n, size).
    """
    tag = timestamp_field << 3 | 2  # length-delimited
    blob, offsets = _stamp_messages(np.ascontiguousarray(log_times), channel, tag, bodies)
    return MessageRecords(channel, log_times, offsets, blob)


def single_record(channel: int, log_time: int, data: bytes) -> MessageRecords:
    """Encode one message with the bytes `data` as a message record.

    log_time: ns since 1970.
    """
    record = np.empty(FRAME_SIZE + MESSAGE_HEADER + len(data), dtype=np.uint8)
    position = _write_message_header(record, 0, len(data), channel, log_time)
    record[position:] = np.frombuffer(data, np.uint8)
    return MessageRecords(channel, np.array([log_time]), np.array([0, len(record)]), record)


@compiled
def _merge_by_time(
    row_times: Ints, row_length: int, row_channel: int, other_messages: Entries, prefix_size: int, limit: int
) -> tuple[Entries, Ints]:
    """Merge rows and other messages by time, and divide them into chunks of at most one second.

    Return all messages, (n,) of `ENTRY`, and the index of each chunk's first message, followed by n.  At equal times, a
    row comes last.

    row_times: log times of the rows, ns.
    row_length, row_channel: size in bytes and channel of each row's message.
    other_messages: messages in order of time, (m,) of `ENTRY`.
    prefix_size: size of the bytes before the first message of the first chunk.
    limit: maximum size of a chunk with more than one message, bytes.
    """
    count = len(row_times) + len(other_messages)
    merged = np.empty(count, dtype=ENTRY)
    firsts = np.empty(count + 1, dtype=np.int64)
    chunks, size, i, j = 0, prefix_size, 0, 0
    for k in range(count):
        message = merged[k]
        if i < len(row_times) and (j >= len(other_messages) or row_times[i] < other_messages[j].log_time):
            message.source, message.length, message.channel = FROM_ROWS, row_length, row_channel
            message.log_time = row_times[i]
            i += 1
        else:
            other_message = other_messages[j]
            message.source, message.length, message.channel = (
                other_message.source,
                other_message.length,
                other_message.channel,
            )
            message.log_time = other_message.log_time
            j += 1
        second = message.log_time // SECOND_NS
        if k == 0 or (
            k > firsts[chunks - 1] and (size + message.length > limit or second != merged[k - 1].log_time // SECOND_NS)
        ):
            firsts[chunks] = k
            chunks += 1
            size = prefix_size if k == 0 else 0
        message.offset = size
        size += message.length
    firsts[chunks] = count
    return merged, firsts[: chunks + 1]


@compiled
def _copy_messages(entries: Entries, rows: Bytes, blob: Bytes, prefix: Bytes) -> Bytes:
    """Return the bytes of all chunks: `prefix` and all messages, one after the other.

    entries: messages, (n,) of `ENTRY`.
    rows: messages of the rows, (r, size) bytes.
    blob: bytes of the other messages.
    """
    total_size = len(prefix)
    for k in range(len(entries)):
        total_size += entries[k].length
    chunk_bytes = np.empty(total_size, dtype=np.uint8)
    copy_into(chunk_bytes[: len(prefix)], prefix)
    position, row = len(prefix), 0
    for k in range(len(entries)):
        length, source = entries[k].length, entries[k].source
        if source == FROM_ROWS:
            copy_into(chunk_bytes[position : position + length], rows[row])
            row += 1
        else:
            copy_into(chunk_bytes[position : position + length], blob[source : source + length])
        position += length
    return chunk_bytes


@compiled
def _index_messages(
    entries: Entries, firsts: Ints, prefix_size: int, max_channel: int
) -> tuple[Bytes, Chunks, ChannelIndexes]:
    """Encode the message index records: one per chunk, for each channel with messages in this chunk.

    Return the bytes of these records, and the arrays `chunks` and `channels` of `Layout`.

    entries: messages, (n,) of `ENTRY`.
    firsts: index of each chunk's first message, followed by n.
    prefix_size: size of the bytes before the first message.
    max_channel: highest channel number.
    """
    count = len(firsts) - 1
    index_records = np.empty(len(entries) * _INDEX_ENTRY + count * (max_channel + 1) * _INDEX_HEAD, dtype=np.uint8)
    chunks = np.zeros(count, dtype=CHUNK)
    channels = np.zeros((count, max_channel + 1), dtype=CHANNEL_INDEX)
    position, start = 0, 0
    for c in range(count):
        chunk, first, stop = chunks[c], firsts[c], firsts[c + 1]
        size = prefix_size if c == 0 else 0
        for k in range(first, stop):
            channels[c, entries[k].channel].messages += 1
            size += entries[k].length
        chunk.start, chunk.stop = start, start + size
        chunk.first_ns, chunk.last_ns = entries[first].log_time, entries[stop - 1].log_time
        start += size
        chunk.index_start = position
        for channel in range(max_channel + 1):
            index = channels[c, channel]
            if index.messages == 0:
                continue
            index.offset = position - chunk.index_start
            length = index.messages * _INDEX_ENTRY
            # The last argument of `_write_integer` is the size of the integer, bytes.
            index_records[position] = _INDEX_OPCODE
            position = _write_integer(index_records, position + 1, 6 + length, 8)
            position = _write_integer(index_records, position, channel, 2)
            position = _write_integer(index_records, position, length, 4)
            for k in range(first, stop):
                if entries[k].channel == channel:
                    position = _write_integer(index_records, position, entries[k].log_time, 8)
                    position = _write_integer(index_records, position, entries[k].offset, 8)
        chunk.index_stop = position
    return index_records[:position], chunks, channels


def lay_out_chunks(
    rows: Bytes, row_times: Ints, row_channel: int, other_messages: list[MessageRecords], prefix: bytes, limit: int
) -> Layout:
    """Order message records by time, divide them into chunks, and index them.

    A chunk covers at most one second and has at most `limit` bytes.

    A message of more than `limit` bytes gets a chunk of its own.  At equal times, a row comes after other messages.

    rows: message records of the rows, (n, size) bytes.
    row_times: log times of the rows, ns, (n,).
    row_channel: channel of the rows.
    prefix: bytes before the first message.
    """
    max_channel = max([row_channel, *(messages.channel for messages in other_messages)])
    blob = np.concatenate([np.zeros(0, np.uint8), *(messages.blob for messages in other_messages)])
    # The entries of the messages by time, with their starts in the joined blobs; `offset`, the start in the chunk, is
    # set later.
    entries: Entries = np.zeros(sum(len(messages.log_times) for messages in other_messages), dtype=ENTRY)
    first, start = 0, 0
    for messages in other_messages:
        added_entries = entries[first : first + len(messages.log_times)]
        added_entries["source"] = messages.offsets[:-1] + start
        added_entries["length"] = np.diff(messages.offsets)
        added_entries["channel"] = messages.channel
        added_entries["log_time"] = messages.log_times
        first += len(added_entries)
        start += len(messages.blob)
    entries = entries[np.argsort(entries["log_time"], kind="stable")]
    merged, firsts = _merge_by_time(row_times, rows.shape[1], row_channel, entries, len(prefix), limit)
    if not len(merged):
        no_bytes = np.zeros(0, np.uint8)
        return Layout(no_bytes, no_bytes, np.zeros(0, CHUNK), np.zeros((0, max_channel + 1), CHANNEL_INDEX))
    records = _copy_messages(merged, rows, blob, np.frombuffer(prefix, np.uint8))
    index, chunks, channels = _index_messages(merged, firsts, len(prefix), max_channel)
    return Layout(records, index, chunks, channels)


@compiled
def last_log_time(times: Floats, newest: int, epoch: int, max_time: float) -> int:
    """Check the times of new rows, and return the log time of the last row, ns, or an error code.

    Return `OUT_OF_RANGE` if a time is negative or not below `max_time` (s), and `NOT_INCREASING` if a time is not later
    than the previous one.

    times: times of the rows, s, (n,).
    newest: log time of the previously recorded row, ns.
    epoch: log time at simulation time 0, ns.
    """
    for k in range(len(times)):
        if not 0.0 <= times[k] < max_time:
            return OUT_OF_RANGE
        log_time = int(np.rint(times[k] * 1e9)) + epoch
        if log_time <= newest:
            return NOT_INCREASING
        newest = log_time
    return newest
