"""A log as mcap's own readers give it, its messages by protobuf classes made from the schemas inside it."""

from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap.records import Chunk, Message, Schema
from mcap.stream_reader import StreamReader


def message_class(schema: Schema) -> Any:
    """From the embedded FileDescriptorSet alone."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))


def messages(path: Path) -> dict[str, list[tuple[Message, Any]]]:
    found: dict[str, list[tuple[Message, Any]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        classes: dict[int, Any] = {}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            kind = classes.setdefault(schema.id, message_class(schema))
            found.setdefault(channel.topic, []).append((message, kind.FromString(message.data)))
    return found


def chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        return [
            item for item in StreamReader(file, emit_chunks=True, validate_crcs=True).records if isinstance(item, Chunk)
        ]
