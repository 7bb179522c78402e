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
_ENTRY: Final = 16
_SECOND_NS: Final = 1_000_000_000
# Columns of `Layout.chunks`.
START: Final = 0
STOP: Final = 1
FIRST_NS: Final = 2
LAST_NS: Final = 3
INDEX_START: Final = 4
INDEX_STOP: Final = 5
CHUNK_COLUMNS: Final = 6


@dataclass(frozen=True, slots=True)
class Messages:
    """Message records of one channel, in order of time, one after the other in ``blob``.

    stamps: (n,) log time in ns.  offsets: (n + 1,) where each starts in ``blob``, and where the last ends.
    """

    channel: int
    stamps: Ints
    offsets: Ints
    blob: Bytes


@dataclass(frozen=True, slots=True)
class Layout:
    """Chunks (c, `CHUNK_COLUMNS`) of ``records``, and the message index records of each in ``index``.

    places: (c, channels + 1) where each channel's index starts behind its chunk's first, -1 for none.  counts: the
    same shape, messages.
    """

    records: Bytes
    index: Bytes
    chunks: Ints
    places: Ints
    counts: Ints


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
def _put_head(out: Bytes, at: int, size: int, channel: int, stamp: int) -> int:
    """Write a message record's frame and header; ``size`` is the message's."""
    out[at] = MESSAGE_OPCODE
    at = _put(out, at + 1, MESSAGE_HEADER + size, 8)
    at = _put(out, at, channel, 2)
    at = _put(out, at, 0, 4)
    at = _put(out, at, stamp, 8)
    return _put(out, at, stamp, 8)


@compiled
def _stamped(stamps: Ints, channel: int, tag: int, template: Bytes, slots: Ints, values: Bytes) -> tuple[Bytes, Ints]:
    count = len(stamps)
    # The timestamp takes at most 2 + 12 bytes: its tag and length, two tags, two varints of five bytes.
    out = np.empty(count * (FRAME_SIZE + MESSAGE_HEADER + 14 + len(template)), dtype=np.uint8)
    offsets = np.zeros(count + 1, dtype=np.int64)
    when = np.empty(16, dtype=np.uint8)
    at = 0
    for k in range(count):
        stamp = stamps[k]
        when[0] = 0x08
        size = _put_varint(when, 1, stamp // _SECOND_NS)
        when[size] = 0x10
        size = _put_varint(when, size + 1, stamp % _SECOND_NS)
        at = _put_head(out, at, 2 + size + len(template), channel, stamp)
        out[at], out[at + 1] = tag, size
        at += 2
        for j in range(size):
            out[at + j] = when[j]
        at += size
        for j in range(len(template)):
            out[at + j] = template[j]
        for j in range(len(slots)):
            for byte in range(8):
                out[at + slots[j] + byte] = values[k, 8 * j + byte]
        at += len(template)
        offsets[k + 1] = at
    return out[:at], offsets


def stamped_messages(
    stamps: Ints, channel: int, tag: int, template: bytes, slots: list[int], values: Floats
) -> Messages:
    """Messages that are a timestamp followed by ``template`` with doubles put into it, as records.

    stamps: (n,) ns since 1970.  tag: of the timestamp's field.  slots: (m,) where each double starts in the template.
    values: (n, m).
    """
    shown = np.ascontiguousarray(values, dtype="<f8").view(np.uint8).reshape(len(stamps), 8 * len(slots))
    blob, offsets = _stamped(
        np.ascontiguousarray(stamps), channel, tag, np.frombuffer(template, np.uint8), np.array(slots), shown
    )
    return Messages(channel, stamps, offsets, blob)


def messages_of(channel: int, stamp: int, data: bytes) -> Messages:
    """One message as a record."""
    out = np.empty(FRAME_SIZE + MESSAGE_HEADER + len(data), dtype=np.uint8)
    at = _put_head(out, 0, len(data), channel, stamp)
    out[at:] = np.frombuffer(data, np.uint8)
    return Messages(channel, np.array([stamp]), np.array([0, len(out)]), out)


@compiled
def _order(
    row_stamps: Ints,
    row_size: int,
    stamps: Ints,
    starts: Ints,
    sizes: Ints,
    channels: Ints,
    row_channel: int,
    front: int,
    limit: int,
) -> tuple[Ints, Ints]:
    """Merge rows and other messages by time, a row last, and cut: a table of messages, and the chunks' first ones.

    Table (n, 5): source (-1 for a row, else where it starts in the blob), size, channel, stamp, offset in its chunk.
    """
    count = len(row_stamps) + len(stamps)
    table = np.empty((count, 5), dtype=np.int64)
    firsts = np.empty(count + 1, dtype=np.int64)
    chunks, size, i, j = 0, front, 0, 0
    for k in range(count):
        is_row = i < len(row_stamps) and (j >= len(stamps) or row_stamps[i] < stamps[j])
        stamp = row_stamps[i] if is_row else stamps[j]
        length = row_size if is_row else sizes[j]
        second = stamp // _SECOND_NS
        if k == 0 or (k > firsts[chunks - 1] and (size + length > limit or second != table[k - 1, 3] // _SECOND_NS)):
            firsts[chunks] = k
            chunks += 1
            size = front if k == 0 else 0
        table[k, 0] = -1 if is_row else starts[j]
        table[k, 1], table[k, 2], table[k, 3], table[k, 4] = length, row_channel, stamp, size
        if is_row:
            i += 1
        else:
            table[k, 2] = channels[j]
            j += 1
        size += length
    firsts[chunks] = count
    return table, firsts[: chunks + 1]


@compiled
def _fill(table: Ints, rows: Bytes, blob: Bytes, front: Bytes) -> Bytes:
    """Copy the messages of a table one after the other, behind ``front``."""
    out = np.empty(len(front) + table[:, 1].sum(), dtype=np.uint8)
    out[: len(front)] = front
    at, row = len(front), 0
    for k in range(len(table)):
        size = table[k, 1]
        if table[k, 0] < 0:
            out[at : at + size] = rows[row]
            row += 1
        else:
            start = table[k, 0]
            out[at : at + size] = blob[start : start + size]
        at += size
    return out


@compiled
def _index(table: Ints, firsts: Ints, front: int, most: int) -> tuple[Bytes, Ints, Ints, Ints]:
    """Message index records of each chunk, channel by channel; and `Layout`'s tables.  most: the highest channel."""
    count = len(firsts) - 1
    out = np.empty(len(table) * _ENTRY + count * (most + 1) * _INDEX_HEAD, dtype=np.uint8)
    chunks = np.zeros((count, CHUNK_COLUMNS), dtype=np.int64)
    places = np.full((count, most + 1), -1, dtype=np.int64)
    counts = np.zeros((count, most + 1), dtype=np.int64)
    at, start = 0, 0
    for c in range(count):
        first, stop = firsts[c], firsts[c + 1]
        size = front if c == 0 else 0
        for k in range(first, stop):
            counts[c, table[k, 2]] += 1
            size += table[k, 1]
        chunks[c, START], chunks[c, STOP] = start, start + size
        chunks[c, FIRST_NS], chunks[c, LAST_NS] = table[first, 3], table[stop - 1, 3]
        start += size
        chunks[c, INDEX_START] = at
        for channel in range(most + 1):
            if counts[c, channel] == 0:
                continue
            places[c, channel] = at - chunks[c, INDEX_START]
            length = counts[c, channel] * _ENTRY
            out[at] = _INDEX_OPCODE
            at = _put(out, at + 1, 6 + length, 8)
            at = _put(out, at, channel, 2)
            at = _put(out, at, length, 4)
            for k in range(first, stop):
                if table[k, 2] == channel:
                    at = _put(out, at, table[k, 3], 8)
                    at = _put(out, at, table[k, 4], 8)
        chunks[c, INDEX_STOP] = at
    return out[:at], chunks, places, counts


def lay_out(
    rows: Bytes, row_stamps: Ints, row_channel: int, others: list[Messages], front: bytes, limit: int
) -> Layout:
    """Lay message records out in order of time, cut into chunks of one second and ``limit`` bytes at most, and index.

    rows: (n, size) records of the channel ``row_channel``, at ``row_stamps`` (ns); at one time a row comes last.
    front: bytes before the first message.  A message of more than ``limit`` has a chunk of its own.
    """
    stamps = np.concatenate([np.zeros(0, np.int64), *(item.stamps for item in others)])
    order = np.argsort(stamps, kind="stable")
    ends = np.cumsum([0, *(len(item.blob) for item in others)])
    starts = [item.offsets[:-1] + end for item, end in zip(others, ends, strict=False)]
    none = np.zeros(0, np.int64)
    start = np.concatenate([none, *starts])[order]
    size = np.concatenate([none, *(np.diff(item.offsets) for item in others)])[order]
    channel = np.concatenate([none, *(np.full(len(item.stamps), item.channel) for item in others)])[order]
    most = max([row_channel, *(item.channel for item in others)])
    blob = np.concatenate([np.zeros(0, np.uint8), *(item.blob for item in others)])
    table, firsts = _order(
        row_stamps, rows.shape[1], stamps[order], start, size, channel, row_channel, len(front), limit
    )
    if not len(table):
        empty = np.zeros((0, most + 1), np.int64)
        return Layout(
            np.zeros(0, np.uint8), np.zeros(0, np.uint8), np.zeros((0, CHUNK_COLUMNS), np.int64), empty, empty
        )
    records = _fill(table, rows, blob, np.frombuffer(front, np.uint8))
    index, chunks, places, counts = _index(table, firsts, len(front), most)
    return Layout(records, index, chunks, places, counts)


@compiled
def last_stamp(times: Floats, newest: int, epoch: int, longest: float) -> int:
    """Log time (ns) of the last of ``times`` (s); -1 where one is not in 0..longest, -2 where they do not increase.

    newest: the log time before the first.
    """
    for k in range(len(times)):
        if not 0.0 <= times[k] < longest:
            return -1
        stamp = int(np.rint(times[k] * 1e9)) + epoch
        if stamp <= newest:
            return -2
        newest = stamp
    return newest
