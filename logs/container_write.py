"""The MCAP container, written front to back in chunks that come ready made.

mcap's own `Writer` takes one message at a time, at some 6 us each; here a chunk's records and the index of its messages
come as arrays.  The records around them are mcap's own classes.  Every CRC that the format has is written.
"""

import contextlib
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from logs.container import FRAME, MAGIC, records, stream

Index = NDArray[np.uint64]
_MESSAGE = struct.Struct("<HIQ")
_CHUNK = struct.Struct("<QQQI")
_PAIRS_HEAD = 6  # channel and length, before a message index's pairs


@dataclass(frozen=True, slots=True)
class ChunkContent:
    """Message records one after the other, and where each is.

    index: for each channel (n, 2): log_time in ns and offset into ``records``, in the order of the records.
    """

    records: bytes
    index: dict[int, Index]


class ContainerWriter:
    """Writes the magic and the header at once, then attachments and chunks, and the summary at `finish`."""

    def __init__(self, file: BinaryIO, profile: str) -> None:
        """file: empty, open for writing.  profile: goes into the header, as the library's name too."""
        self._file = file
        self._compressor = zstandard.ZstdCompressor(level=3)
        self._crc = 0
        self._at = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._unwritten: list[McapRecord] = []
        self._attachments: list[AttachmentIndex] = []
        self._chunks: list[ChunkIndex] = []
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

    def chunk(self, content: ChunkContent) -> None:
        """Write a chunk of at least one message."""
        if not self._unwritten:
            self._chunk(content.records, content.index)
            return
        front = b"".join(_bytes(record) for record in self._unwritten)
        self._unwritten.clear()
        moved = np.array([0, len(front)], dtype=np.uint64)
        self._chunk(front + content.records, {channel: pairs + moved for channel, pairs in content.index.items()})

    def copy(self, data: bytes) -> None:
        """Write a chunk as it stood in another file, from its records.  Raises ValueError and what mcap's classes do.

        Its schemas and channels count as this file's.
        """
        index: dict[int, list[tuple[int, int]]] = {}
        for opcode, at, content in records(data):
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream(content))
                self._schemas.setdefault(f"{schema.id}", schema)
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(stream(content))
                if all(channel.id != known.id for known in self._channels):
                    self._channels.append(channel)
            elif opcode == Opcode.MESSAGE:
                number, _, log_time = _MESSAGE.unpack_from(content)
                index.setdefault(number, []).append((log_time, at))
        self._chunk(data, {number: np.array(pairs, dtype=np.uint64) for number, pairs in index.items()})

    def _chunk(self, data: bytes, index: dict[int, Index]) -> None:
        times = np.concatenate([np.zeros(0, dtype=np.uint64), *(pairs[:, 0] for pairs in index.values())])
        chunk = Chunk(
            compression="zstd",
            data=self._compressor.compress(data),
            message_start_time=int(times.min()) if times.size else 0,
            message_end_time=int(times.max(initial=0)),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        record = _chunk_record(chunk)
        start = self._at
        offsets = {}
        index_start = at = start + len(record)
        pieces = [record]
        for channel, pairs in sorted(index.items()):
            offsets[channel] = at
            pieces.append(_message_index(channel, pairs))
            at += len(pieces[-1])
            self._counts[channel] += len(pairs)
        self._put(b"".join(pieces))
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(record),
                chunk_start_offset=start,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=self._at - index_start,
                message_index_offsets=offsets,
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    @property
    def last_time(self) -> int:
        """log_time of the newest message, ns; 0 before the first chunk."""
        return max((index.message_end_time for index in self._chunks), default=0)

    def finish(self) -> None:
        """Write the end of the data and the summary; the file stays open."""
        self._put(_bytes(DataEnd(self._crc)))
        start = self._at
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels)),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.ATTACHMENT_INDEX, list(self._attachments)),
        ]
        summary = b""
        offsets = b""
        for opcode, members in groups:
            group = b"".join(_bytes(record) for record in members)
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
            message_end_time=max((index.message_end_time for index in self._chunks), default=0),
            message_start_time=min((index.message_start_time for index in self._chunks), default=0),
            metadata_count=0,
            schema_count=len(self._schemas),
        )

    def flush(self) -> None:
        """Hand what was written to the operating system.  Raises OSError."""
        with _named(self._file):
            self._file.flush()

    def _put(self, data: bytes) -> None:
        with _named(self._file):
            self._file.write(data)
        self._crc = zlib.crc32(data, self._crc)
        self._at += len(data)


@contextlib.contextmanager
def _named(file: BinaryIO) -> Iterator[None]:
    """Give an error while writing (a full disk) the name of the file, which a write does not know."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, getattr(file, "name", None)) from error


def _bytes(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()  # mcap leaves some of its methods without annotations
    record.write(builder)
    return bytes(builder.end())


def _chunk_record(chunk: Chunk) -> bytes:
    """Chunk.write, which copies its data through a record builder, takes as long as the compression."""
    name = chunk.compression.encode()
    head = _CHUNK.pack(
        chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size, chunk.uncompressed_crc
    )
    content = head + len(name).to_bytes(4, "little") + name + len(chunk.data).to_bytes(8, "little")
    return b"".join([FRAME.pack(Opcode.CHUNK, len(content) + len(chunk.data)), content, chunk.data])


def _message_index(channel: int, pairs: Index) -> bytes:
    data = np.ascontiguousarray(pairs, dtype="<u8").tobytes()
    head = channel.to_bytes(2, "little") + len(data).to_bytes(4, "little")
    return FRAME.pack(Opcode.MESSAGE_INDEX, _PAIRS_HEAD + len(data)) + head + data
