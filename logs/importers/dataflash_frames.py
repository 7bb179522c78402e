"""Find the messages of an ArduPilot dataflash log, and read their fields as columns.

A message consists of the bytes 0xA3 and 0x95, the message type, and a body.  The log itself states the length and the
fields of each type in FMT messages (ArduPilot, libraries/AP_Logger/LogStructure.h).  There are no checksums: a message
is valid if the next message, or the end of the file, follows immediately.

This reader is used instead of pymavlink's `DFReader`, which reports no damage, stopped at message 471 of 4,737 in a log
with 400 wrong bytes, and takes 6 to 14 times as long.
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
# Bytes of a log that is mapped into memory, and released piece by piece.

# Size of a piece, bytes.
PIECE_BYTES = 16 * 2**20


class MappedFile:
    """The bytes of a file as a memory-mapped array.

    data: bytes of the file, (n,).

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.BIN"
    ...     count = path.write_bytes(b"abc")
    ...     bytes(MappedFile(path).data)
    b'abc'
    """

    def __init__(self, path: Path) -> None:
        """Map a file into memory, read-only."""
        with path.open("rb") as file:
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self.data: Bytes = np.frombuffer(self._map, np.uint8)

    def release_memory(self) -> None:
        """Release the memory of the mapped file; its bytes are read from the disk again when needed."""
        # Windows does not have this call, and accounts for mapped pages differently.
        if hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED)


def iterate_piece_ends(size: int, release_memory: Callable[[], None]) -> Iterator[int]:
    """Yield the byte number at which each piece of a file ends, to read a large file piece by piece.

    `release_memory` is called after each piece, when the next end is requested.

    size: size of the file, bytes; all pieces except the last have `PIECE_BYTES`.

    >>> list(iterate_piece_ends(3, lambda: None))
    [3]
    >>> list(iterate_piece_ends(PIECE_BYTES + 1, lambda: None)) == [PIECE_BYTES, PIECE_BYTES + 1]
    True
    """
    end = 0
    while end < size:
        end = min(size, end + PIECE_BYTES)
        yield end
        release_memory()


# ----------------------------------------------------------------------
# Messages: their formats, their starts, and their fields as columns.

# Length of the header of a message, bytes.
HEADER_BYTES = 3
# Type of FMT messages, which state the formats of the other messages.
FMT_TYPE = 128
# Length of an FMT message, bytes.
_FMT_BYTES = 89
# Largest number of bytes after the last message that are not damage: block storage leaves old bytes in its last page.
MAX_TRAILING_BYTES = 528
# Format letters: numpy type, and the factor by which a value is multiplied before it is stored (ArduPilot,
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
    """The format of the messages of one type, as an FMT message states it.

    number: number of the message type.
    name: name of the messages.
    length: length of a message, bytes.
    columns: names of the fields.
    letters: format letters of the fields, which are keys of `FIELDS`.
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
        """Factor by which the values of a field are multiplied before they are stored, keyed by field name.

        Fields that are stored unchanged are absent.
        """
        letters_by_name = zip(self.columns, self.letters, strict=True)
        return {name: FIELDS[letter][1] for name, letter in letters_by_name if FIELDS[letter][1] != 1}


def _decode_text(value: bytes) -> str:
    """Decode a text up to its first zero byte; bytes that are not UTF-8 become escapes."""
    return value.partition(b"\0")[0].decode(errors="backslashreplace")


@dataclass(frozen=True, slots=True)
class Messages:
    """All messages of one name, in the order of the file.

    starts: byte at which each message begins, (n,).
    rows: structured array with the fields of each message as stored, (n,).
    scales: factor by which the values of a field were multiplied before they were stored; absent for a factor of 1.
    """

    starts: Ints
    rows: NDArray[np.void]
    scales: dict[str, int]

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.starts)

    def has(self, *names: str) -> bool:
        """Return True if there is at least one message, and messages have all these fields."""
        return len(self.starts) > 0 and set(names) <= set(self.rows.dtype.names or ())

    def column(self, name: str) -> Floats:
        """Return the values of a numeric field, with the factor of their storage removed, (n,)."""
        values = self.rows[name].astype(np.float64)
        # Division, unlike multiplication by 0.01, gives the float nearest to the decimal number.
        return np.asarray(values / self.scales.get(name, 1))

    def texts(self, name: str) -> list[str]:
        """Return the values of a text field, one for each message."""
        return [_decode_text(value) for value in self.rows[name].tolist()]

    def select(self, is_selected: NDArray[np.bool_]) -> "Messages":
        """Return only the messages for which a mask (n,) is True."""
        return Messages(self.starts[is_selected], self.rows[is_selected], self.scales)


@dataclass(frozen=True, slots=True)
class Dataflash:
    """The index of a dataflash log: where its messages begin.

    data: bytes of the log.
    starts: byte numbers at which the indexed messages begin, keyed by the number of the message type.
    formats: format of each message type, keyed by its number.
    names: names of all messages that the log contains, also of those that are not indexed.
    damage: parts that could not be read.
    release_memory: function that releases the memory of the mapped log; called regularly while the log is read.
    """

    data: Bytes
    starts: dict[int, Ints]
    formats: dict[int, MessageFormat]
    names: tuple[str, ...]
    damage: Damage
    release_memory: Callable[[], None] = lambda: None

    def messages(self, name: str) -> Messages:
        """Return all indexed messages with a name, except a cut message at the end.

        The result has length 0 if there are none.
        """
        numbers = [number for number, entry in self.formats.items() if entry.name == name and number in self.starts]
        if not numbers:
            return Messages(np.zeros(0, np.int64), np.zeros(0, np.dtype([])), {})
        message_format, starts = self.formats[numbers[0]], self.starts[numbers[0]]
        starts = starts[starts + message_format.length <= len(self.data)]
        dtype = message_format.dtype
        rows = np.zeros(0, dtype)
        if len(starts) and dtype.itemsize:
            windows = np.lib.stride_tricks.sliding_window_view(self.data, dtype.itemsize)
            rows = np.empty(len(starts), dtype)
            first = 0
            for end in iterate_piece_ends(self.data.size, self.release_memory):
                last = int(np.searchsorted(starts, end))
                rows[first:last] = windows[starts[first:last] + HEADER_BYTES].view(dtype)[:, 0]
                first = last
        return Messages(starts, rows, message_format.scales)


def index_dataflash(
    data: Bytes, names: Collection[str], release_memory: Callable[[], None] = lambda: None
) -> Dataflash:
    """Index the messages of a log that have one of the given names.

    The log is read twice, first for the formats and then for the messages with these names, so that the index of a
    large log is small.

    data: bytes of the log, (n,).
    names: names of the messages to index, such as "POS".
    release_memory: function that releases the memory of the bytes read so far; called regularly.
    """
    is_format = np.zeros(256, np.bool_)
    is_format[FMT_TYPE] = True
    format_messages = _find_messages(data, is_format, release_memory)
    formats: dict[int, MessageFormat] = {}
    unreadable = 0
    for start in format_messages.starts.tolist():
        message_format = _parse_format(bytes(data[start + HEADER_BYTES : start + _FMT_BYTES]))
        if message_format is None:
            unreadable += 1
        else:
            formats.setdefault(message_format.number, message_format)
    is_requested = np.zeros(256, np.bool_)
    is_requested[[number for number, entry in formats.items() if entry.name in names]] = True
    requested_messages = _find_messages(data, is_requested, release_memory)
    order = np.argsort(requested_messages.kinds, kind="stable")
    numbers, firsts = np.unique(requested_messages.kinds[order], return_index=True)
    # Without messages `np.split` returns one empty part.
    starts = {
        int(number): message_starts
        for number, message_starts in zip(numbers, np.split(requested_messages.starts[order], firsts[1:]), strict=False)
    }
    present_names = tuple(entry.name for number, entry in formats.items() if requested_messages.counts[number])
    damage = Damage(
        int(requested_messages.places), int(requested_messages.size), bool(requested_messages.cut), unreadable
    )
    return Dataflash(data, starts, formats, present_names, damage, release_memory)


class _FoundMessages(NamedTuple):
    """The requested messages of a log, and the damage of the log.

    starts: byte number at which each requested message begins, (n,).
    kinds: type of each requested message, (n,).
    counts: number of messages of each type, also of types that were not requested, (256,).
    places, size: number of damaged places, and their total size in bytes.
    cut: True if the last message is cut.
    """

    starts: Ints
    kinds: Bytes
    counts: Ints
    places: int
    size: int
    cut: bool


def _find_messages(data: Bytes, is_requested: NDArray[np.bool_], release_memory: Callable[[], None]) -> _FoundMessages:
    """Find the messages of the requested types, and count damaged places and lost bytes.

    Up to `MAX_TRAILING_BYTES` old bytes after the last message are not damage.

    is_requested: True for each requested message type, (256,).
    release_memory: function that is called after each piece of the log.
    """
    state = np.zeros(6, np.int64)
    lengths = np.zeros(256, np.int64)
    counts = np.zeros(256, np.int64)
    state[_IS_READING], lengths[FMT_TYPE] = 1, _FMT_BYTES
    starts, kinds = [np.zeros(0, np.int64)], [np.zeros(0, np.uint8)]
    for end in iterate_piece_ends(data.size, release_memory):
        piece_starts, piece_kinds = _walk_messages(
            read_only(data), end, state, lengths, counts, HEADER_BYTES, FMT_TYPE, MAX_TRAILING_BYTES, is_requested
        )
        starts.append(piece_starts)
        kinds.append(piece_kinds)
    damaged_places = int(state[_DAMAGED_PLACES])
    lost_bytes = int(state[_LOST_BYTES])
    last_end = int(state[_LAST_END])
    if not state[_IS_READING] and last_end and data.size - last_end < MAX_TRAILING_BYTES:
        # The walk counted the old bytes after the last message as a damaged place.
        damaged_places -= 1
        lost_bytes -= min(lost_bytes, data.size - HEADER_BYTES + 1 - last_end)
    is_cut = bool(state[_IS_CUT])
    return _FoundMessages(np.concatenate(starts), np.concatenate(kinds), counts, damaged_places, lost_bytes, is_cut)


def _parse_format(body: bytes) -> MessageFormat | None:
    """Return the format that the body of an FMT message states; None for an invalid body."""
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


# Indices of the state of a walk over messages.
# Number of the next byte.
_NEXT_BYTE = 0
# Number of damaged places, where no message begins.
_DAMAGED_PLACES = 1
# Number of bytes in damaged places.
_LOST_BYTES = 2
# End of the last message, bytes.
_LAST_END = 3
# 1 while messages follow each other, 0 in a damaged place.
_IS_READING = 4
# 1 if the last message is cut.
_IS_CUT = 5


# The walk goes from message to message by their lengths.  In a damaged place, where no valid message begins, it
# continues byte by byte to the next valid message.
@compiled
def _walk_messages(
    data: Bytes,
    stop: int,
    state: Ints,
    lengths: Ints,
    counts: Ints,
    header_bytes: int,
    fmt_type: int,
    max_trailing_bytes: int,
    is_requested: NDArray[np.bool_],
) -> tuple[Ints, Bytes]:
    """Find the requested messages that begin before byte `stop`.

    Return their starts (byte numbers) and their types.

    state: progress of the walk, indexed by `_NEXT_BYTE` and so on; the walk continues from it and updates it.
    lengths: length of the messages of each type, bytes, (256,); 0 if not yet known; updated at each FMT message.
    counts: number of messages of each type, (256,); updated.
    header_bytes: length of a message's header, bytes.
    fmt_type: message type of FMT messages.
    max_trailing_bytes: largest number of bytes at the end that need not be a message.
    is_requested: True for each type to find, (256,).
    """
    starts, kinds = np.empty(1024, np.int64), np.empty(1024, np.uint8)
    found_count, data_end = 0, data.size
    damaged_places, lost_bytes = state[_DAMAGED_PLACES], state[_LOST_BYTES]
    k, last_end = state[_NEXT_BYTE], state[_LAST_END]
    is_reading, is_cut = state[_IS_READING] == 1, state[_IS_CUT] == 1
    while k + header_bytes <= data_end and k < stop:
        length = 0
        # Every message begins with these two bytes and its type.
        if data[k] == 0xA3 and data[k + 1] == 0x95:
            length = lengths[data[k + 2]]
        message_end = k + length
        # Another message must follow, unless the file ends.
        is_followed = (
            message_end >= data_end - 1
            or (data[message_end] == 0xA3 and data[message_end + 1] == 0x95)
            or data_end - message_end < max_trailing_bytes
        )
        if length == 0 or not is_followed:
            damaged_places += is_reading
            is_reading = False
            lost_bytes += 1
            k += 1
            continue
        kind = data[k + 2]
        counts[kind] += 1
        if is_requested[kind]:
            if found_count == starts.size:
                more_starts, more_kinds = np.empty(2 * found_count, np.int64), np.empty(2 * found_count, np.uint8)
                copy_into(more_starts, starts)
                copy_into(more_kinds, kinds)
                starts, kinds = more_starts, more_kinds
            starts[found_count], kinds[found_count] = k, kind
            found_count += 1
        if kind == fmt_type and message_end <= data_end:
            lengths[data[k + header_bytes]] = data[k + header_bytes + 1]
        k = last_end = message_end
        is_cut, is_reading = message_end > data_end, True
    state[_DAMAGED_PLACES], state[_LOST_BYTES] = damaged_places, lost_bytes
    state[_NEXT_BYTE], state[_LAST_END] = k, last_end
    state[_IS_READING], state[_IS_CUT] = is_reading, is_cut
    return starts[:found_count], kinds[:found_count]
