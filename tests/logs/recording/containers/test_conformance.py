"""The MCAP project's 416 conformance vectors: byte for byte those files, each read as what it holds."""

import hashlib
import io
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema

from logs.recording import mcap_writer
from logs.recording.mcap_reader import Container, chunk_records, read_chunks, record_stream
from logs.recording.mcap_writer import ContainerWriter
from logs.recording.reader import read_log
from tests.logs.recording.containers.conformance_vectors import CONTENTS, DATA, MAGIC, Content, variants, vector
from world.errors import LogError

# Number of vectors of each content, and SHA-256 of the lines "NAME SHA-256 OF THE FILE" of all of them in order of
# their names: of the files of foxglove/mcap at 95d0673 (tests/conformance/data).
PUBLISHED = {
    "NoData": (6, "b44e4fcaa02a347a846c3a73cdacedb2760f052849d42770cc524df905e912b0"),
    "OneAttachment": (14, "40a833056836d43242de4c6f1ade432318b9dd99bbdd7288af67e6e8ec66d2e1"),
    "OneMessage": (154, "aef6afb96b3307499b965743343a956c8b299a130d3197fa946573038d0a842c"),
    "OneMetadata": (14, "2cace83e09dc6c7273cb209c5753020726da2d56b8f49ab229261d8c15ab36cd"),
    "OneSchemalessMessage": (74, "cc98bcbc33f2d30118337060fce1ded94dab10c48c966172fb9fca39222d7b3a"),
    "TenMessages": (154, "5409ef83eaebca38cac56f6c84896368ce077675b162719b22c6784a53a0578c"),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_vectors_are_those_that_are_published(name: str) -> None:
    """So what is read below is what the MCAP project reads, without a file of its own here."""
    made = {"-".join((name, *chosen)): vector(CONTENTS[name], chosen) for chosen in variants(CONTENTS[name])}
    lines = "".join(f"{one} {hashlib.sha256(made[one]).hexdigest()}\n" for one in sorted(made))
    assert (len(made), hashlib.sha256(lines.encode()).hexdigest()) == PUBLISHED[name]


def held(content: Content) -> tuple[list[Any], dict[str, bytes]]:
    """Records and attachments that a reader is to give of a content; metadata is nothing that it gives."""
    found: list[Any] = []
    if content.schema is not None:
        name, encoding, data = content.schema
        found.append(Schema(id=1, data=data, encoding=encoding, name=name))
    if content.channel is not None:
        schema, topic, encoding, metadata = content.channel
        found.append(Channel(id=1, topic=topic, message_encoding=encoding, metadata=metadata, schema_id=schema))
    found += [
        Message(channel_id=1, data=DATA, log_time=log, publish_time=published, sequence=sequence)
        for sequence, log, published in content.messages
    ]
    return found, {"myFile": DATA} if content.attachment else {}


_KINDS: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}


def parsed(opcode: int, content: bytes) -> Any:
    if opcode == Opcode.MESSAGE:
        return Message.read(record_stream(content), len(content))
    return _KINDS[opcode].read(record_stream(content))


@pytest.mark.parametrize("name", CONTENTS)
def test_each_vector_is_read_whole(name: str, tmp_path: Path) -> None:
    content = CONTENTS[name]
    wanted, attachments = held(content)
    for chosen in variants(content):
        data = vector(content, chosen)
        file, found = io.BytesIO(data), Container()
        file.seek(len(MAGIC))
        read = [parsed(opcode, body) for part in read_chunks(file, found) for opcode, _, body in chunk_records(part)]
        assert (found.problem, found.attachments) == ("", attachments), chosen
        assert read == wanted, chosen
        path = tmp_path / f"{'-'.join((name, *chosen))}.mcap"
        path.write_bytes(data)
        with pytest.raises(LogError) as caught:
            read_log(path)
        assert str(caught.value) == f"{path}: not a planfly log: an MCAP file without setup.json"


class _Plain:
    """A compressor that leaves its data as they are."""

    def __init__(self, level: int) -> None:
        self.level = level

    def compress(self, data: bytes) -> bytes:
        return data


@pytest.mark.parametrize(
    ("name", "features"),
    [
        ("NoData", ("st", "sum")),
        ("OneMessage", ("ch", "chx", "mx", "rch", "rsh", "st", "sum")),
        ("TenMessages", ("ch", "chx", "mx", "rch", "rsh", "st", "sum")),
    ],
)
def test_what_our_writer_can_write_is_the_vector_byte_for_byte(
    name: str, features: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its compression: none of the vectors has any.

    It always writes chunks with both indexes, statistics, repeats and offsets, and no metadata; an attachment's time of
    creation, which the vectors state, it leaves at 0.
    """
    monkeypatch.setattr(mcap_writer, "_COMPRESSION", bytes(4))
    monkeypatch.setattr("logs.recording.mcap_writer.zstandard.ZstdCompressor", _Plain)
    out, content = io.BytesIO(), CONTENTS[name]
    writer = ContainerWriter(out, "")
    if content.messages:
        file = io.BytesIO(vector(content, ("ch",)))
        file.seek(len(MAGIC))
        (chunk,) = read_chunks(file, Container())
        writer.copy_chunk(chunk)
    writer.write_end()
    assert out.getvalue() == vector(content, features)
