"""The messages of a log as they were written, for viewers that take them as they are."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import DecodeError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.records import Message as MessageRecord

from logs.recording.mcap_reader import MAGIC, PARSE_ERRORS, Container, read_chunks, record_stream, records


@dataclass(frozen=True, slots=True)
class LogChannel:
    """A topic of a log: encoding of its messages, and their schema's name, encoding and data."""

    topic: str
    encoding: str
    schema: str
    schema_encoding: str
    schema_data: bytes


@dataclass(frozen=True, slots=True)
class LogMessage:
    """One message; log_time in ns since 1970."""

    channel: LogChannel
    log_time: int
    data: bytes


def log_messages(path: Path) -> Iterator[LogMessage]:
    """Give the messages of a log in the order of the file, up to its first damage.  Raises OSError.

    >>> import tempfile
    >>> from collections import Counter
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_example_log(Path(folder) / "example.mcap")
    ...     counts = Counter(message.channel.topic for message in log_messages(path))
    >>> counts["/state"], counts["/tf"], counts["/fix"]
    (366, 183, 37)
    """
    schemas: dict[int, Schema] = {}
    channels: dict[int, LogChannel] = {}
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        for data in read_chunks(file, Container()):
            try:
                yield from _messages(data, schemas, channels)
            except (*PARSE_ERRORS, DecodeError, KeyError):
                return


def log_channels(path: Path) -> list[LogChannel]:
    """List the channels that the first chunk of a log declares: all that a `logs.recording.recorder.Recorder` uses.

    Raises OSError.

    >>> import tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     channels = log_channels(write_example_log(Path(folder) / "example.mcap"))
    >>> channels[0].topic, channels[0].encoding, channels[0].schema
    ('/state', 'protobuf', 'planfly.State')
    """
    channels: dict[int, LogChannel] = {}
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        for data in read_chunks(file, Container()):
            for _ in _messages(data, {}, channels):
                pass
            break
    return list(channels.values())


def _messages(data: bytes, schemas: dict[int, Schema], channels: dict[int, LogChannel]) -> Iterator[LogMessage]:
    for opcode, _, content in records(data):
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(record_stream(content))
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(record_stream(content))
            if channel.id not in channels:
                known = schemas[channel.schema_id]
                channels[channel.id] = LogChannel(
                    channel.topic, channel.message_encoding, known.name, known.encoding, known.data
                )
        elif opcode == Opcode.MESSAGE:
            message = MessageRecord.read(record_stream(content), len(content))
            yield LogMessage(channels[message.channel_id], message.log_time, message.data)
