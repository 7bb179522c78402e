"""The 416 conformance vectors of the MCAP project, made from the format's own rules.

Six contents, each with every combination of ten features that a writer may have or leave out (foxglove/mcap,
tests/conformance: the names of files are the content's and the features' in order).  Records are laid out as the "MCAP
Format Specification" of mcap.dev has them; where it leaves an order open, that of the vectors is kept.
"""

import itertools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field

MAGIC = b"\x89MCAP0\r\n"
# Numbers of the kinds of records.
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT = range(1, 10)
ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(10, 16)
# Behind a record, where "pad" is among the features; the kinds that end with their data take none.
_PADDING = b"\x01\xff\xff"


@dataclass(frozen=True)
class Content:
    """What a vector holds, whichever way it is written down.

    schema: name, encoding and data of number 1.  channel: schema, topic, encoding and metadata of number 1.
    messages: sequence, log time and publish time of each; all hold the bytes 1, 2, 3.
    """

    schema: tuple[str, str, bytes] | None = None
    channel: tuple[int, str, str, dict[str, str]] | None = None
    messages: tuple[tuple[int, int, int], ...] = ()
    attachment: bool = False
    metadata: bool = False


DATA = b"\x01\x02\x03"
_EXAMPLE = ("Example", "c", b"\x04\x05\x06")
_CHANNEL = (1, "example", "a", {"foo": "bar"})
_TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
CONTENTS = {
    "NoData": Content(),
    "OneSchemalessMessage": Content(channel=(0, "example", "text", {}), messages=((10, 2, 1),)),
    "OneMessage": Content(_EXAMPLE, _CHANNEL, ((10, 2, 1),)),
    "OneAttachment": Content(attachment=True),
    "OneMetadata": Content(metadata=True),
    "TenMessages": Content(_EXAMPLE, _CHANNEL, tuple((k, at, at) for k, at in enumerate(_TIMES))),
}
_FEATURES = ("ax", "ch", "chx", "mdx", "mx", "pad", "rch", "rsh", "st", "sum")


def variants(content: Content) -> Iterator[tuple[str, ...]]:
    """The combinations of features, each in order, that a content can have."""
    cannot = {
        "ax": not content.attachment,
        "mdx": not content.metadata,
        "rsh": content.schema is None,
        **dict.fromkeys(("rch", "ch", "chx", "mx"), content.channel is None),
    }
    able = [name for name in _FEATURES if not cannot.get(name, False)]
    for count in range(len(able) + 1):
        for chosen in itertools.combinations(able, count):
            summed = {"ax", "chx", "mdx", "rch", "rsh", "st"} & set(chosen)
            if ("sum" in chosen and not summed) or ({"chx", "mx"} & set(chosen) and "ch" not in chosen):
                continue
            yield chosen


@dataclass
class _Output:
    """The bytes so far.  padded: whether records have more bytes than they need."""

    padded: bool
    data: bytearray = field(default_factory=lambda: bytearray(MAGIC))

    def put(self, kind: int, content: bytes, *, fixed: bool = False) -> tuple[int, int]:
        """Write a record; where it stands, and its length."""
        at, body = len(self.data), content + (b"" if fixed or not self.padded else _PADDING)
        self.data += struct.pack("<BQ", kind, len(body)) + body
        return at, len(self.data) - at


def _decode_text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def _map(values: dict[str, str]) -> bytes:
    inside = b"".join(_decode_text(key) + _decode_text(value) for key, value in values.items())
    return struct.pack("<I", len(inside)) + inside


def _schema(content: Content) -> bytes:
    assert content.schema is not None
    name, encoding, data = content.schema
    return struct.pack("<H", 1) + _decode_text(name) + _decode_text(encoding) + struct.pack("<I", len(data)) + data


def _channel(content: Content) -> bytes:
    assert content.channel is not None
    schema, topic, encoding, metadata = content.channel
    return struct.pack("<HH", 1, schema) + _decode_text(topic) + _decode_text(encoding) + _map(metadata)


def _put_messages(out: _Output, content: Content) -> list[tuple[int, int]]:
    """Write schema, channel and messages: log time and place of each message."""
    if content.schema is not None:
        out.put(SCHEMA, _schema(content))
    if content.channel is not None:
        out.put(CHANNEL, _channel(content))
    return [
        (at, out.put(MESSAGE, struct.pack("<HIQQ", 1, sequence, at, published) + DATA, fixed=True)[0])
        for sequence, at, published in content.messages
    ]


def _put_chunk(out: _Output, content: Content, indexed: bool) -> bytes:
    """Write a chunk and its message index: the content of its chunk index."""
    inside = _Output(padded=False, data=bytearray())
    pairs = _put_messages(inside, content)
    times = [at for at, _ in pairs]
    span, size = (min(times), max(times)), len(inside.data)
    head = struct.pack("<QQQI", *span, size, zlib.crc32(inside.data)) + _decode_text("") + struct.pack("<Q", size)
    at, length = out.put(CHUNK, head + bytes(inside.data), fixed=True)
    offsets, index_length = b"", 0
    if indexed:
        listed = b"".join(struct.pack("<QQ", *pair) for pair in pairs)
        index_at, index_length = out.put(MESSAGE_INDEX, struct.pack("<HI", 1, len(listed)) + listed)
        offsets = struct.pack("<HQ", 1, index_at)
    start = struct.pack("<QQQQI", *span, at, length, len(offsets)) + offsets
    return start + struct.pack("<Q", index_length) + _decode_text("") + struct.pack("<QQ", size, size)


def vector(content: Content, features: tuple[str, ...]) -> bytes:
    """A content as a file with these features."""
    out = _Output("pad" in features)
    out.put(HEADER, _decode_text("") + _decode_text(""))
    indexes: dict[int, bytes] = {}
    if "ch" in features:
        chunk_index = _put_chunk(out, content, "mx" in features)
        indexes |= {CHUNK_INDEX: chunk_index} if "chx" in features else {}
    else:
        _put_messages(out, content)
    if content.attachment:
        name, kind = _decode_text("myFile"), _decode_text("application/octet-stream")
        body = struct.pack("<QQ", 2, 1) + name + kind + struct.pack("<Q", len(DATA)) + DATA
        at, length = out.put(ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
        if "ax" in features:
            indexes[ATTACHMENT_INDEX] = struct.pack("<QQQQQ", at, length, 2, 1, len(DATA)) + name + kind
    if content.metadata:
        at, length = out.put(METADATA, _decode_text("myMetadata") + _map({"foo": "bar"}))
        if "mdx" in features:
            indexes[METADATA_INDEX] = struct.pack("<QQ", at, length) + _decode_text("myMetadata")
    out.put(DATA_END, struct.pack("<I", zlib.crc32(out.data)), fixed=True)
    _put_summary(out, content, features, indexes)
    return bytes(out.data) + MAGIC


def _put_summary(out: _Output, content: Content, features: tuple[str, ...], indexes: dict[int, bytes]) -> None:
    begin = len(out.data)
    groups = {
        **({SCHEMA: _schema(content)} if "rsh" in features else {}),
        **({CHANNEL: _channel(content)} if "rch" in features else {}),
        **({STATISTICS: _statistics(content, "ch" in features)} if "st" in features else {}),
        **{kind: indexes[kind] for kind in (METADATA_INDEX, ATTACHMENT_INDEX, CHUNK_INDEX) if kind in indexes},
    }
    places = {kind: out.put(kind, body) for kind, body in groups.items()}
    offset_start = len(out.data) if "sum" in features else 0
    if "sum" in features:
        for kind, (at, length) in places.items():
            out.put(SUMMARY_OFFSET, struct.pack("<BQQ", kind, at, length))
    footer = struct.pack("<QQ", begin if places else 0, offset_start)
    crc = zlib.crc32(bytes(out.data[begin:]) + struct.pack("<BQ", FOOTER, 20) + footer)
    out.put(FOOTER, footer + struct.pack("<I", crc), fixed=True)


def _statistics(content: Content, chunked: bool) -> bytes:
    times = [at for _, at, _ in content.messages]
    counts = struct.pack("<HQ", 1, len(times)) if times else b""
    numbers = (content.schema is not None, content.channel is not None, content.attachment, content.metadata, chunked)
    span = (min(times), max(times)) if times else (0, 0)
    return struct.pack("<QHIIIIQQI", len(times), *numbers, *span, len(counts)) + counts
