"""Messages of an ArduPilot dataflash log: the start of each, and its fields as columns.

A message is 0xA3, 0x95, its type, and a body whose length and fields the log itself states in messages named FMT_TYPE
(ArduPilot, libraries/AP_Logger/LogStructure.h).  There are no checksums: a message is valid if the next one, or the
end of the file, follows immediately.  pymavlink's `DFReader` reports no damage, stopped at message 471 of 4,737 in a
log with 400 wrong bytes, and takes 6 to 14 times as long.
"""

import mmap
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import Damage
from world.arrays import Bytes, Floats, Ints
from world.kernels import compiled, copy_into, read_only

# ----------------------------------------------------------------------
# Bytes of a log without its size in memory: mapped, and released piece by piece.

# Bytes that are read before they are released.
PIECE_BYTES = 16 * 2**20


class MappedFile:
    """Bytes of a file as a memory-mapped array.

    data: (n,) its bytes.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.BIN"
    ...     count = path.write_bytes(b"abc")
    ...     bytes(MappedFile(path).data)
    b'abc'
    """

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self.data: Bytes = np.frombuffer(self._map, np.uint8)

    def release_memory(self) -> None:
        """Release the memory of the mapped file; it is read again when needed."""
        # Windows has no such call, and accounts for mapped pages differently.
        if hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED)


def piece_ends(size: int, release_memory: Callable[[], None]) -> Iterator[int]:
    """Yield the end of each piece of a file of ``size`` bytes, and release the memory after each piece.

    >>> list(piece_ends(3, lambda: None))
    [3]
    >>> list(piece_ends(PIECE_BYTES + 1, lambda: None)) == [PIECE_BYTES, PIECE_BYTES + 1]
    True
    """
    end = 0
    while end < size:
        end = min(size, end + PIECE_BYTES)
        yield end
        release_memory()


# ----------------------------------------------------------------------
# Messages: their formats, their starts, and their fields as columns.

HEADER_BYTES = 3
FMT_TYPE = 128
_FMT_BYTES = 89
# Largest number of bytes at the end of a log that are not damage: block-wise storage leaves old bytes in its last page.
MAX_TRAILING_BYTES = 528
# Format letters: numpy type, and the factor that stored numbers are multiplied by (ArduPilot,
# libraries/AP_Logger/LogStructure.h, "Format characters in the format string").
FIELDS: dict[str, tuple[str, int]] = {
    "a": ("S64", 1),
    "b": ("i1", 1),
    "B": ("u1", 1),
    "h": ("<i2", 1),
    "H": ("<u2", 1),
    "i": ("<i4", 1),
    "I": ("<u4", 1),
    "f": ("<f4", 1),
    "d": ("<f8", 1),
    "g": ("<f2", 1),
    "n": ("S4", 1),
    "N": ("S16", 1),
    "Z": ("S64", 1),
    "c": ("<i2", 100),
    "C": ("<u2", 100),
    "e": ("<i4", 100),
    "E": ("<u4", 100),
    "L": ("<i4", 10_000_000),
    "M": ("u1", 1),
    "q": ("<i8", 1),
    "Q": ("<u8", 1),
}


class MessageFormat(NamedTuple):
    """Content of a FMT_TYPE message, the format of other messages.

    number: number of the message type.  length: length of a message, bytes.  columns: names of the fields.
    letters: format letters of the fields, keys of `FIELDS`.
    """

    number: int
    name: str
    length: int
    columns: tuple[str, ...]
    letters: str

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Numpy type of the body of a message."""
        return np.dtype([(name, FIELDS[letter][0]) for name, letter in zip(self.columns, self.letters, strict=True)])

    @property
    def scales(self) -> dict[str, int]:
        """Factors of the scaled fields, by name."""
        letters_by_name = zip(self.columns, self.letters, strict=True)
        return {name: FIELDS[letter][1] for name, letter in letters_by_name if FIELDS[letter][1] != 1}


def _decode_text(value: bytes) -> str:
    """Decode text up to its first zero; bytes that are not UTF-8 become escapes."""
    return value.partition(b"\0")[0].decode(errors="backslashreplace")


@dataclass(frozen=True, slots=True)
class Messages:
    """All messages of one name, in the order of the file.

    starts: (n,) byte at which each begins.
    rows: (n,) of the format's fields, as stored.
    scales: factors of the scaled fields.
    """

    starts: Ints
    rows: NDArray[np.void]
    scales: dict[str, int]

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.starts)

    def has(self, *names: str) -> bool:
        """Return True if there are messages with all these fields."""
        return len(self.starts) > 0 and set(names) <= set(self.rows.dtype.names or ())

    def column(self, name: str) -> Floats:
        """Return a field of numbers, in the unit of the format."""
        values = self.rows[name].astype(np.float64)
        # Division gives the number nearest to its decimal digits.
        return np.asarray(values / self.scales.get(name, 1))

    def texts(self, name: str) -> list[str]:
        """Return a field of text."""
        return [_decode_text(value) for value in self.rows[name].tolist()]

    def select(self, is_selected: NDArray[np.bool_]) -> "Messages":
        """Return the selected messages."""
        return Messages(self.starts[is_selected], self.rows[is_selected], self.scales)


@dataclass(frozen=True, slots=True)
class Dataflash:
    """Indexed log.

    data: bytes of the log.
    starts: start of each message, by number of the message type.
    formats: formats by number of the message type.
    names: names of the messages that the log contains.
    release_memory: called regularly, to release the memory of the mapped log.
    damage: parts that could not be read.
    """

    data: Bytes
    starts: dict[int, Ints]
    formats: dict[int, MessageFormat]
    names: tuple[str, ...]
    damage: Damage
    release_memory: Callable[[], None] = lambda: None

    def messages(self, name: str) -> Messages:
        """Return all messages of a name; an empty object if there are none."""
        for number, message_format in self.formats.items():
            if message_format.name == name and number in self.starts:
                return _read_messages(self.data, self.starts[number], message_format, self.release_memory)
        return Messages(np.zeros(0, np.int64), np.zeros(0, np.dtype([])), {})


def index_dataflash(
    data: Bytes, names: Collection[str], release_memory: Callable[[], None] = lambda: None
) -> Dataflash:
    """Index the messages with these names in the bytes (n,) of a log.

    release_memory: called regularly, to release memory.

    The log is read twice: for the formats, and for the messages of those names, so that the index of a large log is
    small.
    """
    only_formats = np.zeros(256, np.bool_)
    only_formats[FMT_TYPE] = True
    first = _find_messages(data, only_formats, release_memory)
    formats: dict[int, MessageFormat] = {}
    unreadable = 0
    for start in first.starts.tolist():
        message_format = _parse_format(bytes(data[start + HEADER_BYTES : start + _FMT_BYTES]))
        if message_format is None:
            unreadable += 1
        else:
            formats.setdefault(message_format.number, message_format)
    is_requested = np.zeros(256, np.bool_)
    is_requested[[number for number, entry in formats.items() if entry.name in names]] = True
    messages_found = _find_messages(data, is_requested, release_memory)
    order = np.argsort(messages_found.kinds, kind="stable")
    numbers, firsts = np.unique(messages_found.kinds[order], return_index=True)
    # Without messages numpy returns one empty part.
    starts = {
        int(number): message_starts
        for number, message_starts in zip(numbers, np.split(messages_found.starts[order], firsts[1:]), strict=False)
    }
    held_names = tuple(entry.name for number, entry in formats.items() if messages_found.counts[number])
    damage = Damage(int(messages_found.places), int(messages_found.size), bool(messages_found.cut), unreadable)
    return Dataflash(data, starts, formats, held_names, damage, release_memory)


class _FoundMessages(NamedTuple):
    """Starts and types of the requested messages, the number of messages of each type, and the damage."""

    starts: Ints
    kinds: Bytes
    counts: Ints
    places: int
    size: int
    cut: bool


def _find_messages(data: Bytes, is_requested: NDArray[np.bool_], release_memory: Callable[[], None]) -> _FoundMessages:
    state, lengths, counts = np.zeros(6, np.int64), np.zeros(256, np.int64), np.zeros(256, np.int64)
    state[_IS_READING], lengths[FMT_TYPE] = 1, _FMT_BYTES
    starts, kinds = [np.zeros(0, np.int64)], [np.zeros(0, np.uint8)]
    for end in piece_ends(data.size, release_memory):
        piece = _walk_messages(
            read_only(data), end, state, lengths, counts, HEADER_BYTES, FMT_TYPE, MAX_TRAILING_BYTES, is_requested
        )
        starts.append(piece[0])
        kinds.append(piece[1])
    places, size, behind = int(state[_DAMAGED_PLACES]), int(state[_LOST_BYTES]), int(state[_LAST_END])
    if not state[_IS_READING] and behind and data.size - behind < MAX_TRAILING_BYTES:
        # The rest of the last page is no damage.
        places -= 1
        size -= min(size, data.size - HEADER_BYTES + 1 - behind)
    return _FoundMessages(np.concatenate(starts), np.concatenate(kinds), counts, places, size, bool(state[_IS_CUT]))


def _parse_format(body: bytes) -> MessageFormat | None:
    """Return the format stated by a FMT_TYPE message; None for an invalid one."""
    if len(body) < _FMT_BYTES - HEADER_BYTES:
        return None
    number, length, *texts = struct.unpack("<BB4s16s64s", body)
    name, letters, columns = (_decode_text(text) for text in texts)
    names = tuple(columns.split(",")) if columns else ()
    is_valid = set(letters) <= FIELDS.keys() and len(names) == len(letters)
    if not is_valid or len(set(names)) < len(names) or "" in names:
        return None
    message_format = MessageFormat(number, name, length, names, letters)
    return message_format if message_format.dtype.itemsize + HEADER_BYTES == length else None


def _read_messages(
    data: Bytes, starts: Ints, message_format: MessageFormat, release_memory: Callable[[], None]
) -> Messages:
    starts = starts[starts + message_format.length <= len(data)]
    dtype = message_format.dtype
    rows = np.zeros(0, dtype)
    if len(starts) and dtype.itemsize:
        windows = np.lib.stride_tricks.sliding_window_view(data, dtype.itemsize)
        rows = np.empty(len(starts), dtype)
        first = 0
        for end in piece_ends(data.size, release_memory):
            last = int(np.searchsorted(starts, end))
            rows[first:last] = windows[starts[first:last] + HEADER_BYTES].view(dtype)[:, 0]
            first = last
    return Messages(starts, rows, message_format.scales)


# Indices into the state of a walk: the next byte,
_NEXT_BYTE = 0
# the number of places where no message begins,
_DAMAGED_PLACES = 1
# the number of bytes there,
_LOST_BYTES = 2
# the end of the last message,
_LAST_END = 3
# 1 while messages follow each other,
_IS_READING = 4
# and 1 if the last message is cut.
_IS_CUT = 5


@compiled
def _walk_messages(
    data: Bytes,
    stop: int,
    state: Ints,
    lengths: Ints,
    counts: Ints,
    header: int,
    fmt: int,
    trailing: int,
    is_requested: NDArray[np.bool_],
) -> tuple[Ints, Bytes]:
    """Return starts and types of requested messages before byte `stop`, continuing from and updating `state`."""
    starts, kinds = np.empty(1024, np.int64), np.empty(1024, np.uint8)
    count, end = 0, data.size
    places, size, k, behind = state[_DAMAGED_PLACES], state[_LOST_BYTES], state[_NEXT_BYTE], state[_LAST_END]
    reading, cut = state[_IS_READING] == 1, state[_IS_CUT] == 1
    while k + header <= end and k < stop:
        length = 0
        if data[k] == 0xA3 and data[k + 1] == 0x95:
            length = lengths[data[k + 2]]
        after = k + length
        # Another message has to follow, unless the file ends there.
        follows = after >= end - 1 or (data[after] == 0xA3 and data[after + 1] == 0x95) or end - after < trailing
        if length == 0 or not follows:
            places += reading
            reading = False
            size += 1
            k += 1
            continue
        kind = data[k + 2]
        counts[kind] += 1
        if is_requested[kind]:
            if count == starts.size:
                more_starts, more_kinds = np.empty(2 * count, np.int64), np.empty(2 * count, np.uint8)
                copy_into(more_starts, starts)
                copy_into(more_kinds, kinds)
                starts, kinds = more_starts, more_kinds
            starts[count], kinds[count] = k, kind
            count += 1
        if kind == fmt and after <= end:
            lengths[data[k + header]] = data[k + header + 1]
        k = behind = after
        cut = after > end
        reading = True
    state[_DAMAGED_PLACES], state[_LOST_BYTES], state[_NEXT_BYTE], state[_LAST_END] = places, size, k, behind
    state[_IS_READING], state[_IS_CUT] = reading, cut
    return starts[:count], kinds[:count]
