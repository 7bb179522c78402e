"""The bytes inside chunks, for many seconds of flight at once, in compiled code.

A message at a time through Python costs more than flying it.  Here messages are laid out in order of time, cut into
chunks, and indexed; what is left for Python is one compression a chunk.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

# A message record's frame (opcode, length) and its header (channel, sequence, log time, publish time).
FRAME_SIZE: Final = 9
MESSAGE_HEADER: Final = 22
MESSAGE_OPCODE: Final = 5
_INDEX_OPCODE: Final = 7
# A message index's frame, channel and length, and one of its entries.
_INDEX_HEAD: Final = 15
_INDEX_ENTRY: Final = 16
SECOND_NS: Final = 1_000_000_000

# A message on its way into a chunk: where it comes from (its first byte in the blob of messages, or `FROM_ROWS` for the
# next state row), bytes, channel, log time (ns), and where it starts in its chunk.
ENTRY: Final = np.dtype([(name, np.int64) for name in ("source", "length", "channel", "log_time", "offset")])
FROM_ROWS: Final = -1
# What `last_log_time` gives for times that cannot be recorded.
OUT_OF_RANGE: Final = -1
NOT_INCREASING: Final = -2
# A chunk: its bytes in `Layout.records`, the log times of its first and last message (ns), and the bytes of its message
# indexes in `Layout.index`.
CHUNK: Final = np.dtype(
    [(name, np.int64) for name in ("start", "stop", "first_ns", "last_ns", "index_start", "index_stop")]
)
# A channel in a chunk: where its index starts behind the chunk's first one, and its messages; 0 of these: no index.
CHANNEL_INDEX: Final = np.dtype([("offset", np.int64), ("messages", np.int64)])

Entries = NDArray[np.void]  # of ENTRY
Chunks = NDArray[np.void]  # of CHUNK
ChannelIndexes = NDArray[np.void]  # of CHANNEL_INDEX


@dataclass(frozen=True, slots=True)
class MessageRecords:
    """Message records of one channel, in order of time, one after the other in ``blob``.

    log_times: (n,) ns.  offsets: (n + 1,) where each starts in ``blob``, and where the last ends.
    """

    channel: int
    log_times: Ints
    offsets: Ints
    blob: Bytes


@dataclass(frozen=True, slots=True)
class Layout:
    """Chunks of message records, and the message indexes of each.

    records: all chunks' records, one chunk after the other.
    index: all their message index records.
    chunks: (c,) of `CHUNK`.
    channels: (c, channels + 1) of `CHANNEL_INDEX`, by chunk and channel number.
    """

    records: Bytes
    index: Bytes
    chunks: Chunks
    channels: ChannelIndexes


@compiled
def _put(out: Bytes, at: int, value: int, size: int) -> int:
    """Write a number of ``size`` bytes, low first; returns where it ends."""
    for k in range(size):
        out[at + k] = (value >> (8 * k)) & 0xFF
    return at + size


@compiled
def _put_varint(out: Bytes, at: int, value: int) -> int:
    while value > 127:
        out[at] = (value & 127) | 128
        value >>= 7
        at += 1
    out[at] = value
    return at + 1


@compiled
def _put_head(out: Bytes, at: int, size: int, channel: int, log_time: int) -> int:
    """Write a message record's frame and header; ``size`` is the message's."""
    out[at] = MESSAGE_OPCODE
    at = _put(out, at + 1, MESSAGE_HEADER + size, 8)
    at = _put(out, at, channel, 2)
    at = _put(out, at, 0, 4)
    at = _put(out, at, log_time, 8)
    return _put(out, at, log_time, 8)


@compiled
def _stamped(log_times: Ints, channel: int, tag: int, bodies: Bytes) -> tuple[Bytes, Ints]:
    count, body_size = bodies.shape
    # The timestamp takes at most 2 + 12 bytes: its tag and length, two tags, two varints of five bytes.
    out = np.empty(count * (FRAME_SIZE + MESSAGE_HEADER + 14 + body_size), dtype=np.uint8)
    offsets = np.zeros(count + 1, dtype=np.int64)
    timestamp = np.empty(16, dtype=np.uint8)
    at = 0
    for k in range(count):
        log_time = log_times[k]
        timestamp[0] = 0x08
        size = _put_varint(timestamp, 1, log_time // SECOND_NS)
        timestamp[size] = 0x10
        size = _put_varint(timestamp, size + 1, log_time % SECOND_NS)
        at = _put_head(out, at, 2 + size + body_size, channel, log_time)
        out[at], out[at + 1] = tag, size
        at += 2
        out[at : at + size] = timestamp[:size]
        at += size
        out[at : at + body_size] = bodies[k]
        at += body_size
        offsets[k + 1] = at
    return out[:at], offsets


def stamped_records(log_times: Ints, channel: int, timestamp_field: int, bodies: Bytes) -> MessageRecords:
    """Messages that are a timestamp followed by bytes of one size, as records.

    log_times: (n,) ns since 1970.  timestamp_field: the timestamp's field number.  bodies: (n, size) what follows it,
    in protobuf's encoding.
    """
    tag = timestamp_field << 3 | 2  # length-delimited
    blob, offsets = _stamped(np.ascontiguousarray(log_times), channel, tag, bodies)
    return MessageRecords(channel, log_times, offsets, blob)


def single_record(channel: int, log_time: int, data: bytes) -> MessageRecords:
    """One message (its bytes in ``data``) as a record."""
    out = np.empty(FRAME_SIZE + MESSAGE_HEADER + len(data), dtype=np.uint8)
    at = _put_head(out, 0, len(data), channel, log_time)
    out[at:] = np.frombuffer(data, np.uint8)
    return MessageRecords(channel, np.array([log_time]), np.array([0, len(out)]), out)


@compiled
def _order(
    row_times: Ints, row_length: int, row_channel: int, others: Entries, front: int, limit: int
) -> tuple[Entries, Ints]:
    """Merge rows and other messages by time, a row last, and cut: all messages (n,), and the chunks' first ones.

    The last of the firsts is n.
    """
    count = len(row_times) + len(others)
    merged = np.empty(count, dtype=ENTRY)
    firsts = np.empty(count + 1, dtype=np.int64)
    chunks, size, i, j = 0, front, 0, 0
    for k in range(count):
        entry = merged[k]
        if i < len(row_times) and (j >= len(others) or row_times[i] < others[j].log_time):
            entry.source, entry.length, entry.channel = FROM_ROWS, row_length, row_channel
            entry.log_time = row_times[i]
            i += 1
        else:
            other = others[j]
            entry.source, entry.length, entry.channel = other.source, other.length, other.channel
            entry.log_time = other.log_time
            j += 1
        second = entry.log_time // SECOND_NS
        if k == 0 or (
            k > firsts[chunks - 1] and (size + entry.length > limit or second != merged[k - 1].log_time // SECOND_NS)
        ):
            firsts[chunks] = k
            chunks += 1
            size = front if k == 0 else 0
        entry.offset = size
        size += entry.length
    firsts[chunks] = count
    return merged, firsts[: chunks + 1]


@compiled
def _fill(entries: Entries, rows: Bytes, blob: Bytes, front: Bytes) -> Bytes:
    """Copy the messages one after the other, behind ``front``."""
    total = len(front)
    for k in range(len(entries)):
        total += entries[k].length
    out = np.empty(total, dtype=np.uint8)
    out[: len(front)] = front
    at, row = len(front), 0
    for k in range(len(entries)):
        length, source = entries[k].length, entries[k].source
        if source == FROM_ROWS:
            out[at : at + length] = rows[row]
            row += 1
        else:
            out[at : at + length] = blob[source : source + length]
        at += length
    return out


@compiled
def _index(entries: Entries, firsts: Ints, front: int, most: int) -> tuple[Bytes, Chunks, ChannelIndexes]:
    """Message index records of each chunk, channel by channel; and `Layout`'s tables.  most: the highest channel."""
    count = len(firsts) - 1
    out = np.empty(len(entries) * _INDEX_ENTRY + count * (most + 1) * _INDEX_HEAD, dtype=np.uint8)
    chunks = np.zeros(count, dtype=CHUNK)
    channels = np.zeros((count, most + 1), dtype=CHANNEL_INDEX)
    at, start = 0, 0
    for c in range(count):
        chunk, first, stop = chunks[c], firsts[c], firsts[c + 1]
        size = front if c == 0 else 0
        for k in range(first, stop):
            channels[c, entries[k].channel].messages += 1
            size += entries[k].length
        chunk.start, chunk.stop = start, start + size
        chunk.first_ns, chunk.last_ns = entries[first].log_time, entries[stop - 1].log_time
        start += size
        chunk.index_start = at
        for channel in range(most + 1):
            index = channels[c, channel]
            if index.messages == 0:
                continue
            index.offset = at - chunk.index_start
            length = index.messages * _INDEX_ENTRY
            out[at] = _INDEX_OPCODE
            at = _put(out, at + 1, 6 + length, 8)
            at = _put(out, at, channel, 2)
            at = _put(out, at, length, 4)
            for k in range(first, stop):
                if entries[k].channel == channel:
                    at = _put(out, at, entries[k].log_time, 8)
                    at = _put(out, at, entries[k].offset, 8)
        chunk.index_stop = at
    return out[:at], chunks, channels


def lay_out(
    rows: Bytes, row_times: Ints, row_channel: int, others: list[MessageRecords], front: bytes, limit: int
) -> Layout:
    """Lay message records out in order of time, cut into chunks of one second and ``limit`` bytes at most, and index.

    rows: (n, size) records of the channel ``row_channel``, at ``row_times`` (ns); at one time a row comes last.
    front: bytes before the first message.  A message of more than ``limit`` has a chunk of its own.
    """
    most = max([row_channel, *(item.channel for item in others)])
    blob = np.concatenate([np.zeros(0, np.uint8), *(item.blob for item in others)])
    merged, firsts = _order(row_times, rows.shape[1], row_channel, _entries(others), len(front), limit)
    if not len(merged):
        none = np.zeros(0, np.uint8)
        return Layout(none, none, np.zeros(0, CHUNK), np.zeros((0, most + 1), CHANNEL_INDEX))
    records = _fill(merged, rows, blob, np.frombuffer(front, np.uint8))
    index, chunks, channels = _index(merged, firsts, len(front), most)
    return Layout(records, index, chunks, channels)


def _entries(others: list[MessageRecords]) -> Entries:
    """Messages in order of time, where they start in all their blobs together; offsets are still open."""
    found: Entries = np.zeros(sum(len(item.log_times) for item in others), dtype=ENTRY)
    first, start = 0, 0
    for item in others:
        part = found[first : first + len(item.log_times)]
        part["source"] = item.offsets[:-1] + start
        part["length"] = np.diff(item.offsets)
        part["channel"] = item.channel
        part["log_time"] = item.log_times
        first += len(part)
        start += len(item.blob)
    return found[np.argsort(found["log_time"], kind="stable")]


@compiled
def last_log_time(times: Floats, newest: int, epoch: int, longest: float) -> int:
    """Log time (ns) of the last of ``times`` (s).

    newest: the log time before the first.  `OUT_OF_RANGE` where a time is not in 0..longest, `NOT_INCREASING` where
    one is not later than the one before it.
    """
    for k in range(len(times)):
        if not 0.0 <= times[k] < longest:
            return OUT_OF_RANGE
        log_time = int(np.rint(times[k] * 1e9)) + epoch
        if log_time <= newest:
            return NOT_INCREASING
        newest = log_time
    return newest
