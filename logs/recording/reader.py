"""Read a flight log, check it, and rebuild the flight from the log alone.

A recorded verdict is returned unchanged, for comparison; no code relies on it.
"""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.records import Message as MessageRecord

from flight.simulation.setup import FlightSetup
from flight.simulation.track import MAX_TIME_S, Track
from logs.importers.open_log import is_imported_log
from logs.recording.foxglove_scene import LOG_LEVELS
from logs.recording.foxglove_updates import EVENT_SOURCE as FLIGHT_EVENT_SOURCE
from logs.recording.mcap_reader import FRAME, MAGIC, PARSE_ERRORS, Container, chunk_records, read_chunks, record_stream
from logs.recording.mcap_writer import FRAME_SIZE, MESSAGE_HEADER
from logs.recording.setup_attachments import (
    RECOVERY_FILE,
    REFERENCE_FILE,
    RESULT_FILE,
    SETUP_FILE,
    VERDICT_FILE,
    unpack_setup,
)
from logs.recording.state_channel import (
    EPOCH_NS,
    EVENT_TOPIC,
    LOG_NAME,
    RECORD,
    STATE_NAME,
    STATE_TOPIC,
    RowMatcher,
    StateRecords,
    decode_rows,
    join_records,
    parse_row,
    state_class,
)
from logs.verdict.places import ReferenceFlights
from logs.verdict.reference_attachment import parse_reference_flights
from world.argument_types import checks_types
from world.errors import LogError
from world.files import missing_text
from world.html_table import html_table
from world.wording import count_text

# ----------------------------------------------------------------------
# Messages of a log as they were written, for viewers that accept them unchanged.


@dataclass(frozen=True, slots=True)
class LogChannel:
    """Channel of a log: its topic, and the encoding and the schema of its messages.

    schema: name of the schema.
    """

    topic: str
    encoding: str
    schema: str
    schema_encoding: str
    schema_data: bytes


@dataclass(frozen=True, slots=True)
class LogMessage:
    """One message of a log.

    log_time: ns since 1970.
    """

    channel: LogChannel
    log_time: int
    data: bytes


def log_messages(path: Path) -> Iterator[LogMessage]:
    """Yield the messages of a log in the order of the file, up to its first damage.

    Raises OSError for a file that cannot be read.

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
                yield from _parse_messages(data, schemas, channels)
            except (*PARSE_ERRORS, DecodeError, KeyError):
                return


def log_channels(path: Path) -> list[LogChannel]:
    """Return the channels that the first chunk of a log declares.

    A log from `logs.recording.recorder.Recorder` may have one more channel, for the returns drawn at its end.  Raises
    OSError for a file that cannot be read.

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
            for _ in _parse_messages(data, {}, channels):
                pass
            break
    return list(channels.values())


def _parse_messages(data: bytes, schemas: dict[int, Schema], channels: dict[int, LogChannel]) -> Iterator[LogMessage]:
    """Yield the messages of one chunk.

    The schemas and channels that the chunk declares are added to the two dictionaries.

    data: records of the chunk.
    schemas, channels: schemas and channels of earlier chunks, by number.
    """
    for opcode, _, content in chunk_records(data):
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(record_stream(content))
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(record_stream(content))
            if channel.id not in channels:
                message_schema = schemas[channel.schema_id]
                channels[channel.id] = LogChannel(
                    channel.topic,
                    channel.message_encoding,
                    message_schema.name,
                    message_schema.encoding,
                    message_schema.data,
                )
        elif opcode == Opcode.MESSAGE:
            message = MessageRecord.read(record_stream(content), len(content))
            yield LogMessage(channels[message.channel_id], message.log_time, message.data)


# ----------------------------------------------------------------------
# A log as one flight.

_MESSAGE = struct.Struct("<HIQQ")
_LEVEL_NAMES = {number: name for name, number in LOG_LEVELS.items()}


@dataclass(frozen=True, slots=True)
class LogEvent:
    """One event of the log.

    time: flight time, s, exact to the nanosecond.
    level: a key of `logs.recording.foxglove_scene.LOG_LEVELS`.
    """

    time: float
    text: str
    level: str


@dataclass(frozen=True, slots=True, repr=False)
class FlightLog:
    """A recorded flight.

    source: name of the file, for messages.
    setup, track, events: the flown setup, the rows, and the events in order of time.
    ended: reason for the end of the flight; None if the log does not state it.
    recorded_verdict: the verdict as written, or None; for comparison only.
    versions: versions of the packages of the flight.
    complete: True if nothing is missing or damaged.
    problem: the fault, in one line; empty for a complete log.
    end_time: time of the last row, s.
    lost: the lost part of the flight, in one line; in a recovered log, `problem` also states it.
    reference: results of reference flights; None if none were flown.
    """

    source: str
    setup: FlightSetup
    track: Track
    events: tuple[LogEvent, ...]
    ended: str | None
    recorded_verdict: dict[str, Any] | None = field(hash=False)
    versions: dict[str, str] = field(hash=False)
    complete: bool
    problem: str
    end_time: float
    lost: str = ""
    reference: ReferenceFlights | None = None

    def __repr__(self) -> str:
        name, state = Path(self.source).name, self.ended or "cut short"
        return f"<FlightLog {name}: {self.setup.scenario.name}, {self.end_time:.1f} s, {state}>"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook."""
        setup = self.setup
        rows = [
            ("scenario", setup.scenario.name),
            ("aircraft", Path(setup.aircraft).name),
            ("mission", f"{setup.mission.source}: {count_text(len(setup.mission.items), 'item')}"),
            ("flown", f"{self.end_time:.1f} s, {count_text(len(self.track), 'row')}, {self.track.energy[-1]:.1f} Wh"),
            ("ended", self.ended or "not recorded"),
            *([("incomplete", self.problem)] if self.problem else []),
        ]
        return html_table(f"Flight log {Path(self.source).name}", rows)


class _MessageCollector:
    """Collector of state rows and events from the bytes of chunks."""

    def __init__(self) -> None:
        self.parts: list[StateRecords] = []
        self.events: list[LogEvent] = []
        self.chunks = 0
        self._schemas: dict[int, str] = {0: ""}
        self._channels: dict[int, tuple[str, str]] = {}
        self._matcher: RowMatcher | None = None
        self._state_channel = -1
        self._parser = state_class()

    def add(self, data: bytes) -> None:
        """Collect the state rows and events of one chunk. Raises one of `PARSE_ERRORS` or DecodeError."""
        self.chunks += 1
        position = 0
        while position < len(data):
            opcode, length = FRAME.unpack_from(data, position)
            start = position + FRAME_SIZE
            end = start + length
            if end > len(data):
                raise ValueError("a record reaches beyond its chunk")
            if opcode == 0:
                raise ValueError("a record without a type")
            if opcode == Opcode.MESSAGE:
                channel_number, _, log_time, _ = _MESSAGE.unpack_from(data, start)
                if channel_number == self._state_channel and self._matcher is not None:
                    # Collect a state row together with all state rows that follow it directly.
                    matched = self._matcher.match(data, position)
                    if len(matched):
                        end = position + len(matched) * RECORD.itemsize
                    else:
                        matched = parse_row(data[start + MESSAGE_HEADER : end], self._parser)
                    self.parts.append(matched)
                elif self._channels.get(channel_number) == (EVENT_TOPIC, LOG_NAME):
                    message = Log.FromString(data[start + MESSAGE_HEADER : end])
                    # Skip events that the recorder derives from the rows.
                    if message.name != FLIGHT_EVENT_SOURCE:
                        # Subtract integers first, because a float cannot represent ns since 1970 exactly.
                        time = (log_time - EPOCH_NS) / 1e9
                        self.events.append(LogEvent(time, message.message, _LEVEL_NAMES.get(message.level, "info")))
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(record_stream(data[start:end]))
                self._schemas[schema.id] = schema.name
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(record_stream(data[start:end]))
                kind = (channel.topic, self._schemas.get(channel.schema_id, ""))
                if channel.id not in self._channels and kind == (STATE_TOPIC, STATE_NAME):
                    # The channel of the track's rows.
                    if self._matcher is not None:
                        raise ValueError("two state channels")
                    self._state_channel, self._matcher = channel.id, RowMatcher(channel.id)
                self._channels.setdefault(channel.id, kind)
            position = end

    def rows(self) -> StateRecords:
        """Return all state rows in the order of the file, (t,) of `RECORD`."""
        return join_records(self.parts, RECORD)


@checks_types
def read_log(path: Path | str) -> FlightLog:
    """Read a flight log; a damaged or unfinished log is read up to the damage (`complete` is False).

    Raises LogError, in one line, for a file that is missing, empty, not an MCAP file or not a planfly log, or that
    contains no complete second of flight.

    >>> import tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = read_log(write_example_log(Path(folder) / "example.mcap"))
    >>> log.complete, log.ended, len(log.track), log.setup.aircraft
    (True, 'completed', 366, 'aerosonde')
    """
    path = Path(path)
    container, messages = Container(), _MessageCollector()
    try:
        if path.exists() and not path.is_file():
            raise LogError(f"{path}: {missing_text(path)}; expected a flight log (.mcap)", file=path)
        with path.open("rb") as file:
            magic = file.read(len(MAGIC))
            if not magic:
                raise LogError(f"{path}: empty; expected a flight log (.mcap)", file=path)
            if magic != MAGIC:
                problem = f"not an MCAP file (it starts with {magic!r}); expected a flight log"
                if is_imported_log(path):
                    problem = f"a log of another program; `planfly import {path}` converts it to a flight log"
                raise LogError(f"{path}: {problem}", file=path)
            for data in read_chunks(file, container):
                try:
                    messages.add(data)
                except (*PARSE_ERRORS, DecodeError):
                    container.problem = f"chunk {messages.chunks} contains records that cannot be read"
                    break
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    if not messages.chunks and (container.problem or SETUP_FILE in container.attachments):
        raise LogError(f"{path}: contains no complete chunk: {container.problem or 'an empty log'}", file=path)
    if SETUP_FILE not in container.attachments and container.problem:
        raise LogError(f"{path}: contains no setup: {container.problem}", file=path)
    stored_setup = unpack_setup(container.attachments, str(path))
    rows, row_fault = _usable_rows(messages.rows(), len(stored_setup.setup.route.points))
    if not len(rows):
        fault = row_fault or container.problem or "an empty log"
        raise LogError(f"{path}: contains no complete second of flight: {fault}", file=path)
    end_reason, result_fault = _read_result(container.attachments, len(rows))
    verdict: dict[str, Any] | None = None
    verdict_fault = ""
    if VERDICT_FILE in container.attachments:
        verdict = _parse_object(container.attachments[VERDICT_FILE]) or None
        verdict_fault = "" if verdict else f"{VERDICT_FILE} is not a JSON object"
    reference: ReferenceFlights | None = None
    reference_fault = ""
    if REFERENCE_FILE in container.attachments:
        try:
            reference = parse_reference_flights(container.attachments[REFERENCE_FILE], REFERENCE_FILE)
        except LogError as error:
            reference_fault = str(error)
    loss = row_fault or container.problem
    is_recovered = not loss and RECOVERY_FILE in container.attachments
    loss = loss or result_fault or verdict_fault or reference_fault
    if is_recovered:
        recorded_loss = _parse_object(container.attachments[RECOVERY_FILE]).get("lost")
        loss = "the extent of the loss is unknown"
        if isinstance(recorded_loss, str) and recorded_loss:
            loss = recorded_loss
    track = decode_rows(rows)
    return FlightLog(
        source=str(path),
        setup=stored_setup.setup,
        track=track,
        events=tuple(sorted(messages.events, key=lambda event: event.time)),
        ended=end_reason,
        recorded_verdict=verdict,
        versions=stored_setup.versions,
        complete=not loss,
        problem=f"recovered: {loss}" if is_recovered else loss,
        end_time=float(track.time[-1]),
        lost=loss,
        reference=reference,
    )


def _usable_rows(rows: StateRecords, waypoint_count: int) -> tuple[StateRecords, str]:
    """Return the rows before the first invalid row, and a text on this row's fault, or "" without one.

    waypoint_count: number of the route's waypoints, which the legs of the rows must not exceed.
    """
    state = rows["state"]
    time = state["time_s"]
    is_increasing = np.isfinite(time) & (time >= 0.0) & (time < MAX_TIME_S)
    is_increasing[1:] &= time[1:] > time[:-1]
    is_numbered = state["row"] == np.arange(len(rows), dtype=np.uint32)
    has_leg = (state["leg_index"] >= 0) & (state["leg_index"] < waypoint_count)
    for is_valid, fault in (
        (is_numbered, "rows are missing"),
        (is_increasing, "time does not increase"),
        (has_leg, "the leg does not exist"),
    ):
        if not is_valid.all():
            first_invalid = int(np.argmin(is_valid & is_numbered & is_increasing & has_leg))
            return rows[:first_invalid], f"{fault} at state message {first_invalid}"
    return rows, ""


def _read_result(attachments: dict[str, bytes], row_count: int) -> tuple[str | None, str]:
    """Return why the flight ended (None if unknown), and a text on an invalid result ("" if it is valid).

    row_count: number of rows in the log; a result that states another number is invalid.
    """
    if RESULT_FILE not in attachments:
        return None, "the recording stopped before the flight had ended"
    data = _parse_object(attachments[RESULT_FILE])
    end_reason = data.get("ended")
    if not isinstance(end_reason, str):
        return None, f"{RESULT_FILE} does not state how the flight ended"
    if data.get("rows") != row_count:
        return end_reason, f"the log contains {row_count} of {data.get('rows')} rows"
    return end_reason, ""


def _parse_object(data: bytes) -> dict[str, Any]:
    """Parse a JSON object; return {} for any other text."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}
