"""Copies of logs with one thing changed, and comparison of what they give, field by field."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment, Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from flight.simulation.track import Track
from world.scenario_tables import FlightTable, ScenarioFile

Attachments = dict[str, bytes]


def same(a: Any, b: Any, where: str = "setup") -> None:
    """Equal in every field, arrays bit for bit, NaN equal to NaN."""
    assert type(a) is type(b), where
    # What is written states who flies, where a scenario leaves it to the default.
    if isinstance(a, ScenarioFile):
        a, b = (item.model_copy(update={"flight": item.flight.with_stated_defaults()}) for item in (a, b))
    elif isinstance(a, FlightTable):
        a, b = a.with_stated_defaults(), b.with_stated_defaults()
    if dataclasses.is_dataclass(a):
        for item in (item for item in dataclasses.fields(a) if item.compare):
            same(getattr(a, item.name), getattr(b, item.name), f"{where}.{item.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        assert a.shape == b.shape, where
        for name in a.dtype.names or ():
            same(a[name], b[name], f"{where}.{name}")
        # Bytes between the fields of a record have no meaning.
        assert a.dtype.names or a.tobytes() == b.tobytes(), where
    elif isinstance(a, tuple):
        assert len(a) == len(b), where
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{k}]")
    elif isinstance(a, float) and math.isnan(a):
        assert math.isnan(b), where
    else:
        assert a == b, where


def prefix_of(whole: Track, found: Track) -> None:
    same(found, whole.rows(0, len(found)))


def rewrite(source: Path, target: Path, change: Callable[[Any, str], Any]) -> Path:
    """Copy a log with mcap's own writer; change(record, topic or name) gives what is written, None to leave it out."""
    channels: dict[int, Channel] = {}
    made: dict[int, int] = {}
    schemas: dict[int, Schema] = {}
    with source.open("rb") as file, target.open("wb") as out:
        writer: Any = Writer(out)
        writer.start(profile="other", library="other")
        for item in StreamReader(file).records:
            if isinstance(item, Schema):
                schemas[item.id] = item
            elif isinstance(item, Channel) and item.id not in channels:
                channels[item.id] = item
                schema = schemas[item.schema_id]
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                made[item.id] = writer.register_channel(item.topic, item.message_encoding, number)
            elif isinstance(item, Message):
                item = change(item, channels[item.channel_id].topic)
                if item is not None:
                    writer.add_message(made[item.channel_id], item.log_time, item.data, item.publish_time)
            elif isinstance(item, Attachment):
                item = change(item, item.name)
                if item is not None:
                    writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
        writer.finish()
    return target
