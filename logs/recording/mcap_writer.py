"""The MCAP container, written front to back in chunks that come ready made.

mcap's own `Writer` takes one message at a time, at some 6 us each, and its `Chunk` and `ChunkIndex` copy their fields
through a record builder for as long as the compression takes; here a chunk's records and the index of its messages come
as bytes.  Records that are written once are mcap's own classes.  Every CRC that the format has is written.
"""

import struct
import zlib
from collections import Counter
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple

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

from logs.recording.mcap_reader import FRAME, MAGIC, record_stream, records

Index = NDArray[np.uint64]
_MESSAGE = struct.Struct("<HIQ")
# Before a chunk's compression: its times, size and CRC.
_CHUNK = struct.Struct("<QQQI")
# Times, offset and length of a chunk, and the length of its table of message indexes; a line of that; its sizes.
_CHUNK_INDEX, _OFFSET, _SIZES = struct.Struct("<QQQQI"), struct.Struct("<HQ"), struct.Struct("<QQ")
_COMPRESSION = b"\x04\x00\x00\x00zstd"
_PAIRS_HEAD = 6  # channel and length, before a message index's pairs


class ChannelIndex(NamedTuple):
    """A channel's message index behind a chunk: where its record starts, and how many messages it lists."""

    channel: int
    offset: int
    messages: int


@dataclass(frozen=True, slots=True)
class ChunkContent:
    """Message records one after the other, and the message index records to stand behind them.

    records: of the messages, and of schemas and channels before them.
    index: message index records.
    channels: those with messages here, each with where its record starts in ``index``.
    start, end: log time of the oldest and the newest message, ns.
    """

    records: bytes | memoryview
    index: bytes
    channels: tuple[ChannelIndex, ...]
    start: int
    end: int


class _ChunkIndex(NamedTuple):
    """What the chunk index says of a chunk in the file; a frozen dataclass takes six times as long to make."""

    content_start: int
    content_end: int
    at: int
    length: int
    offsets: tuple[tuple[int, int], ...]
    index_length: int
    compressed: int
    size: int

    def record(self) -> bytes:
        """Its chunk index record."""
        offsets = b"".join(_OFFSET.pack(channel, at) for channel, at in self.offsets)
        times = _CHUNK_INDEX.pack(self.content_start, self.content_end, self.at, self.length, len(offsets))
        sizes = _SIZES.pack(self.compressed, self.size)
        content = times + offsets + self.index_length.to_bytes(8, "little") + _COMPRESSION + sizes
        return FRAME.pack(Opcode.CHUNK_INDEX, len(content)) + content


class ContainerWriter:
    """Writes the magic and the header at once, then attachments and chunks, and the summary at `finish`."""

    def __init__(self, file: BinaryIO, profile: str, level: int = 3) -> None:
        """file: empty, open for writing.  profile: goes into the header, as the library's name too.  level: of zstd."""
        self._file = file
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._crc = 0
        self._at = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._unwritten: list[McapRecord] = []
        self._attachments: list[AttachmentIndex] = []
        self._chunks: list[_ChunkIndex] = []
        self._counts: Counter[int] = Counter()
        self._put(MAGIC + _bytes(Header(profile=profile, library=profile)))

    def attach(self, name: str, media_type: str, data: bytes, log_time: int) -> None:
        """Write an attachment."""
        record = _bytes(Attachment(create_time=0, log_time=log_time, name=name, media_type=media_type, data=data))
        index = AttachmentIndex(self._at, len(record), log_time, 0, len(data), name, media_type)
        self._attachments.append(index)
        self._put(record)

    def channel(self, topic: str, schema: str, data: bytes) -> int:
        """Add a protobuf channel and return its number; it is written into the next chunk.

        schema: the message's full name.  data: its FileDescriptorSet.
        """
        if schema not in self._schemas:
            self._schemas[schema] = Schema(id=len(self._schemas) + 1, data=data, encoding="protobuf", name=schema)
            self._unwritten.append(self._schemas[schema])
        channel = Channel(len(self._channels) + 1, topic, "protobuf", {}, self._schemas[schema].id)
        self._channels.append(channel)
        self._unwritten.append(channel)
        return channel.id

    def front(self) -> bytes:
        """Give the schemas and channels that no chunk holds yet, as the beginning of the next."""
        front = b"".join(_bytes(record) for record in self._unwritten)
        self._unwritten.clear()
        return front

    def copy(self, data: bytes) -> None:
        """Write a chunk as it stood in another file, from its records.  Raises ValueError and what mcap's classes do.

        Its schemas and channels count as this file's.
        """
        index: dict[int, list[tuple[int, int]]] = {}
        for opcode, at, content in records(data):
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(record_stream(content))
                self._schemas.setdefault(f"{schema.id}", schema)
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(record_stream(content))
                if all(channel.id != known.id for known in self._channels):
                    self._channels.append(channel)
            elif opcode == Opcode.MESSAGE:
                number, _, log_time = _MESSAGE.unpack_from(content)
                index.setdefault(number, []).append((log_time, at))
        parts, channels, at = [], [], 0
        for number, pairs in sorted(index.items()):
            parts.append(_message_index(number, np.array(pairs, dtype=np.uint64)))
            channels.append(ChannelIndex(number, at, len(pairs)))
            at += len(parts[-1])
        times = [log_time for pairs in index.values() for log_time, _ in pairs]
        start, end = (min(times), max(times)) if times else (0, 0)
        self.chunk(ChunkContent(data, b"".join(parts), tuple(channels), start, end))

    def chunk(self, content: ChunkContent) -> None:
        """Write a chunk."""
        data = self._compressor.compress(content.records)
        size = len(content.records)
        head = _CHUNK.pack(content.start, content.end, size, zlib.crc32(content.records)) + _COMPRESSION
        head += len(data).to_bytes(8, "little")
        length = FRAME.size + len(head) + len(data)
        behind = self._at + length
        offsets = tuple((item.channel, behind + item.offset) for item in content.channels)
        for item in content.channels:
            self._counts[item.channel] += item.messages
        self._chunks.append(
            _ChunkIndex(content.start, content.end, self._at, length, offsets, len(content.index), len(data), size)
        )
        frame = FRAME.pack(Opcode.CHUNK, length - FRAME.size)
        self._put(b"".join((frame, head, data, content.index)))

    @property
    def last_time(self) -> int:
        """log_time of the newest message, ns; 0 before the first chunk."""
        return max((chunk.content_end for chunk in self._chunks), default=0)

    def finish(self) -> None:
        """Write the end of the data and the summary; the file stays open."""
        self._put(_bytes(DataEnd(self._crc)))
        start = self._at
        groups = [
            (Opcode.SCHEMA, [_bytes(schema) for schema in self._schemas.values()]),
            (Opcode.CHANNEL, [_bytes(channel) for channel in self._channels]),
            (Opcode.STATISTICS, [_bytes(self._statistics())]),
            (Opcode.CHUNK_INDEX, [chunk.record() for chunk in self._chunks]),
            (Opcode.ATTACHMENT_INDEX, [_bytes(index) for index in self._attachments]),
        ]
        summary = b""
        offsets = b""
        for opcode, members in groups:
            group = b"".join(members)
            if group:
                offsets += _bytes(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        footer = _bytes(Footer(start, start + len(summary), 0))
        # The CRC covers the summary and the footer up to the CRC itself.
        crc = zlib.crc32(summary + offsets + footer[:-4])
        self._put(summary + offsets + footer[:-4] + crc.to_bytes(4, "little") + MAGIC)

    def _statistics(self) -> Statistics:
        return Statistics(
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

    def flush(self) -> None:
        """Hand what was written to the operating system.  Raises OSError."""
        try:
            self._file.flush()
        except OSError as error:
            raise _named(error, self._file) from error

    def _put(self, data: bytes) -> None:
        try:
            self._file.write(data)
        except OSError as error:
            raise _named(error, self._file) from error
        self._crc = zlib.crc32(data, self._crc)
        self._at += len(data)


def _named(error: OSError, file: BinaryIO) -> OSError:
    """Give an error while writing (a full disk) the name of the file, which a write does not know."""
    return OSError(error.errno, error.strerror, getattr(file, "name", None))


def _bytes(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()  # mcap leaves some of its methods without annotations
    record.write(builder)
    return bytes(builder.end())


def _message_index(channel: int, pairs: Index) -> bytes:
    data = np.ascontiguousarray(pairs, dtype="<u8").tobytes()
    head = channel.to_bytes(2, "little") + len(data).to_bytes(4, "little")
    return FRAME.pack(Opcode.MESSAGE_INDEX, _PAIRS_HEAD + len(data)) + head + data
