"""Read an MCAP container from front to back without trusting its sizes and checksums.

mcap 1.6's `StreamReader` would save 150 lines.  However, it reports a damaged attachment only at the end of the file,
its seeking reader does not report it at all, and lz4 chunks decompress to any size.  Therefore this module reads the
framing; the classes of mcap then parse records from bytes that are already bounded and CRC-checked.  Reading stops at
the first damage, so that the returned data are complete and in order.

Any container that the format allows is read: with chunks or without, compressed by zstd, lz4 or not, with or without
an index, statistics, a summary and CRCs, with unknown kinds of records, and with surplus bytes in a record. A
CRC of 0 means that its writer omitted it (mcap.dev, "MCAP Format Specification"). Messages outside chunks, which have
no CRC of their own, are accepted only if the end of the data section confirms that it is complete.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, DataEnd, Footer

# Magic at start and end of an MCAP file.
MAGIC = b"\x89MCAP0\r\n"
# Maximum size of a record or an uncompressed chunk that is read, bytes.
RECORD_LIMIT = 64 * 2**20
# Minimum size of the pieces in which records outside chunks are returned, bytes.
_PIECE_BYTES = 2**18
# Records that are returned if they are outside chunks.
_OUTSIDE_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
# Maximum ratio of the size of all chunks to the bytes read; valid logs stay under 20.
_MAX_GROWTH_RATIO = 256
# Frame of a record: opcode and length.
FRAME = struct.Struct("<BQ")
# Errors of mcap's record classes for invalid bytes.
PARSE_ERRORS = (McapError, struct.error, ValueError, OverflowError, MemoryError)


class _Damage(Exception):
    """Error for a damaged file; the message states position and kind of the damage."""


@dataclass(slots=True)
class Container:
    """Content of a file up to its end, or up to its first damage.

    attachments: bytes of each attachment by name.
    media: media type and log time (ns) of each attachment by name.
    problem: description of the damage; "" if the file is whole.
    """

    attachments: dict[str, bytes] = field(default_factory=dict)
    media: dict[str, tuple[str, int]] = field(default_factory=dict)
    problem: str = ""


def read_chunks(file: BinaryIO, container: Container) -> Iterator[bytes]:
    """Yield the records of each complete chunk as bytes, and fill a container with the attachments.

    Records outside chunks are yielded in pieces of the same form.  Damage ends the reading without an error;
    `Container.problem` then describes it.

    file: file, positioned after the magic at its start.
    container: empty container; it is complete after the last chunk has been yielded.
    """
    crc = zlib.crc32(MAGIC)
    total = 0
    is_checked = False
    loose_records = bytearray()
    try:
        while True:
            position = file.tell()
            frame, content = _read_record(file, position)
            opcode = frame[0]
            # Records outside chunks are yielded in pieces.
            if loose_records and (opcode not in _OUTSIDE_CHUNKS or len(loose_records) >= _PIECE_BYTES):
                yield bytes(loose_records)
                loose_records.clear()
            if opcode in _OUTSIDE_CHUNKS:
                if not is_checked:
                    _check_data_section(file, crc, position)
                    is_checked = True
                loose_records += frame + content
            elif opcode == Opcode.CHUNK:
                data = _read_chunk(content, position)
                total += len(data)
                if total > RECORD_LIMIT + _MAX_GROWTH_RATIO * file.tell():
                    raise _Damage(
                        f"chunks grow to {total:,} bytes at byte {position:,} of the file:"
                        f" more than {_MAX_GROWTH_RATIO}-fold"
                    )
                yield data
            elif opcode == Opcode.ATTACHMENT:
                _read_attachment(content, position, container)
            elif opcode == Opcode.DATA_END:
                _check_data_end(content, position, crc)
                break
            elif opcode == Opcode.FOOTER:
                raise _Damage("the data section has no end record")
            elif opcode == 0:
                raise _Damage(f"the record at byte {position:,} has no type")
            crc = zlib.crc32(content, zlib.crc32(frame, crc))
        _check_summary(file)
    except _Damage as damage:
        container.problem = str(damage)


def _check_data_section(file: BinaryIO, crc: int, start: int) -> None:
    """Read ahead to the end of the data section and check its CRC, then restore the file's position.

    Records outside chunks have no CRC of their own, so this check comes before their use.  Raises _Damage if the CRC
    differs or the section is damaged.

    crc: CRC of the section up to byte `start`, at which the reading starts.
    """
    resume_position = file.tell()
    file.seek(start)
    try:
        while True:
            position = file.tell()
            frame, content = _read_record(file, position)
            if frame[0] in (Opcode.DATA_END, Opcode.FOOTER):
                break
            crc = zlib.crc32(content, zlib.crc32(frame, crc))
        if frame[0] == Opcode.DATA_END:
            _check_data_end(content, position, crc)
    except _Damage as damage:
        raise _Damage(f"the records outside chunks, from byte {start:,} on, cannot be checked: {damage}") from None
    file.seek(resume_position)


def _read_record(file: BinaryIO, position: int) -> tuple[bytes, bytes]:
    """Read one record; return its frame (opcode and length) and its content.

    Raises _Damage if the file ends in the record, or if the record is larger than `RECORD_LIMIT`.

    position: position of the record in the file, for messages.
    """
    frame = file.read(FRAME.size)
    if len(frame) < FRAME.size:
        raise _Damage(f"the file ends at byte {position + len(frame):,}, before its end record")
    _, length = FRAME.unpack(frame)
    if length > RECORD_LIMIT:
        raise _Damage(f"the record at byte {position:,} declares {length:,} bytes: at most {RECORD_LIMIT:,} are read")
    content = file.read(length)
    if len(content) < length:
        raise _Damage(f"the file ends at byte {position + len(frame) + len(content):,}, inside a record")
    return frame, content


def chunk_records(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield opcode, offset and content of each record in a chunk.

    Raises ValueError for a record that reaches beyond the end of the chunk.
    """
    position = 0
    while position < len(data):
        if position + FRAME.size > len(data):
            raise ValueError("a record reaches beyond its chunk")
        opcode, length = FRAME.unpack_from(data, position)
        end = position + FRAME.size + length
        if end > len(data):
            raise ValueError("a record reaches beyond its chunk")
        yield opcode, position, data[position + FRAME.size : end]
        position = end


def record_stream(content: bytes) -> ReadDataStream:
    """Wrap the content of one record in a stream for mcap's record classes."""
    return ReadDataStream(BytesIO(content))


def _read_chunk(content: bytes, position: int) -> bytes:
    """Decompress the records of a chunk, and check them by their CRC.

    Raises _Damage for a chunk that cannot be read, or whose size or CRC is wrong.
    """
    try:
        chunk = Chunk.read(record_stream(content))
    except PARSE_ERRORS as error:
        raise _Damage(f"the chunk at byte {position:,} cannot be read") from error
    size = chunk.uncompressed_size
    if size > RECORD_LIMIT:
        raise _Damage(f"the chunk at byte {position:,} declares {size:,} bytes: at most {RECORD_LIMIT:,} are read")
    if chunk.compression not in ("zstd", "lz4", ""):
        raise _Damage(
            f"the chunk at byte {position:,} is compressed with {chunk.compression[:20]!r}: expected zstd, lz4 or none"
        )
    data = chunk.data
    try:
        # Decompress at most `size` + 1 bytes: decompress() would trust the size that the compressed data declare.
        if chunk.compression == "zstd":
            decompressor = zstandard.ZstdDecompressor(max_window_size=2**27)
            data = decompressor.stream_reader(data, read_across_frames=True).read(size + 1)
        elif chunk.compression == "lz4" and data:
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise _Damage(f"the chunk at byte {position:,} cannot be decompressed") from error
    if len(data) != size:
        raise _Damage(f"the chunk at byte {position:,} does not decompress to the {size:,} bytes that it declares")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise _Damage(f"the chunk at byte {position:,} is damaged (its CRC differs)")
    return data


def _read_attachment(content: bytes, position: int, container: Container) -> None:
    """Check an attachment by its CRC, and add it to the container.

    Raises _Damage if it cannot be read, if its CRC differs, or if its name is in the container already.
    """
    try:
        attachment = Attachment.read(record_stream(content))
    except PARSE_ERRORS as error:
        raise _Damage(f"the attachment at byte {position:,} cannot be read") from error
    # The attachment has two times, three lengths with their contents, the CRC, and perhaps unused bytes.
    lengths = (len(attachment.name.encode()), len(attachment.media_type.encode()), len(attachment.data))
    end = 32 + sum(lengths)
    if int.from_bytes(content[end : end + 4], "little") not in (0, zlib.crc32(content[:end])):
        raise _Damage(f"the attachment at byte {position:,} is damaged (its CRC differs)")
    if attachment.name in container.attachments:
        raise _Damage(f"the attachment at byte {position:,} has the name of an earlier one")
    container.attachments[attachment.name] = attachment.data
    container.media[attachment.name] = (attachment.media_type, attachment.log_time)


def _check_data_end(content: bytes, position: int, crc: int) -> None:
    """Raise _Damage if the CRC of the data section differs from the CRC in the end record.

    content, position: content and file position of the end record.
    crc: computed CRC of the data section.
    """
    try:
        stated_crc = DataEnd.read(record_stream(content)).data_section_crc
    except PARSE_ERRORS as error:
        raise _Damage(f"the end record at byte {position:,} cannot be read") from error
    # A writer may leave the CRC out and write 0; chunks and attachments have their own CRC.
    if stated_crc not in (0, crc):
        raise _Damage("the data section is damaged (its CRC differs)")


def _check_summary(file: BinaryIO) -> None:
    """Read the summary, and check its CRC and the magic at the file's end; raise _Damage on an error."""
    crc = 0
    while True:
        position = file.tell()
        frame, content = _read_record(file, position)
        if frame[0] == Opcode.FOOTER:
            break
        crc = zlib.crc32(content, zlib.crc32(frame, crc))
    try:
        footer = Footer.read(record_stream(content))
    except PARSE_ERRORS as error:
        raise _Damage(f"the footer at byte {position:,} cannot be read") from error
    if footer.summary_crc not in (0, zlib.crc32(content[:16], zlib.crc32(frame, crc))):
        raise _Damage("the summary is damaged (its CRC differs)")
    if file.read(len(MAGIC) + 1) != MAGIC:
        raise _Damage("the file does not end as an MCAP file does")
