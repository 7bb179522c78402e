"""Record one flight to one MCAP file while it is flown.

The same setup and rows give the same bytes, regardless of the blocks in which the rows are written: log_time is
simulation time (see `logs.recording.state_channel.EPOCH_NS`), a chunk ends at 64 KiB or at a whole second, and no clock
is read.
"""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from flight.simulation.setup import FlightSetup
from flight.simulation.track import COLUMNS, MAX_TIME_S, TRACK_ROW, Rows, Track, join_rows, track_rows
from logs.recording import foxglove_scene as scene
from logs.recording import foxglove_updates as clouds
from logs.recording.foxglove_scene import aircraft_scene
from logs.recording.foxglove_updates import FIX_TOPIC, TF_TOPIC, TRACK_POINTS, TRACK_TOPIC, FlightEvents, ViewerMessages
from logs.recording.mcap_writer import (
    CHUNK,
    NOT_INCREASING,
    OUT_OF_RANGE,
    SECOND_NS,
    ChannelIndex,
    ChunkContent,
    ContainerWriter,
    MessageRecords,
    last_log_time,
    lay_out_chunks,
    single_record,
)
from logs.recording.setup_attachments import REFERENCE_FILE, RESULT_FILE, VERDICT_FILE, media_type, pack_setup
from logs.recording.state_channel import (
    EPOCH_NS,
    EVENT_TOPIC,
    STATE_NAME,
    STATE_TOPIC,
    as_bytes,
    encode_rows,
    file_descriptor_set,
    state_schema,
    times_ns,
)
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.places import ReferenceFlights
from logs.verdict.reference_attachment import reference_flights_json
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.verdict import Verdict, verdict_json
from world.arrays import Ints
from world.files import lock_path
from world.interruption import delay_signals

# Maximum size of a chunk, bytes.
CHUNK_SIZE = 64 * 1024
RESULT_SCHEMA = "planfly.result/1"
PROFILE = "planfly"
# Topic of logs whose scenario has zones.
ZONES_TOPIC = "/scene/zones"
# Topic of logs that were written with judged returns.
RETURNS_TOPIC = "/scene/returns"

# Size of the file's write buffer, bytes.
_BUFFER_BYTES = 2**20
_NO_ROWS: Rows = np.empty(0, dtype=TRACK_ROW)
_NO_TIMES = np.empty(0, dtype=np.int64)
_CHANNELS: dict[str, Any] = {
    TF_TOPIC: FrameTransform,
    FIX_TOPIC: LocationFix,
    EVENT_TOPIC: Log,
    **{f"/scene/{name}": SceneUpdate for name in ("terrain", "threats", "plan", "aircraft")},
    TRACK_TOPIC: SceneUpdate,
    **{f"/points/{name}": PointCloud for name in ("terrain", "threats", "plan", "aircraft")},
    TRACK_POINTS: PointCloud,
}


# Reason for the end of a flight that was interrupted.
INTERRUPTED = "interrupted"


class Recorder:
    """Writer of a flight log.

    As a context manager, it leaves a readable file if the flight raises an error.

    The setup is written first; then each whole second of flight is written and flushed, so that a killed process loses
    at most the last second.  The log is locked against other processes, and a signal is delayed until a call has ended.

    The log of an interrupted flight ends with the last flown row and has no verdict; `planfly check` can judge it.  A
    log without rows is removed.  After any other error, the log stays unfinished, and `planfly recover` can read its
    rows.

    end_reason: reason for the end that the log of an interrupted flight states.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.recording.reader import read_log
    >>> flown = example_log()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "flight.mcap"
    ...     with Recorder(path, flown.setup) as recorder:
    ...         recorder.write(flown.track)
    ...         recorder.event(12.0, "half way")
    ...         recorder.finish("completed")
    ...     log = read_log(path)
    ...     try:
    ...         with Recorder(path, flown.setup) as recorder:
    ...             recorder.write_rows(track_rows(flown.track)[:100])
    ...             raise KeyboardInterrupt
    ...     except KeyboardInterrupt:
    ...         left = read_log(path)
    >>> log.ended, len(log.track), log.events[0].text
    ('completed', 366, 'half way')
    >>> left.complete, left.ended, len(left.track)
    (True, 'interrupted', 100)
    """

    def __init__(self, path: Path, setup: FlightSetup, *, every: int = 1, batch: int = 1) -> None:
        """Lock ``path``, open it for writing (replacing it) and write the setup.

        every: stride of the recorded rows: every n-th row, and the last row of the flight.
        batch: number of whole seconds of flight that are written at once.  A larger batch takes less time, but a killed
            process loses up to one batch.  The bytes of the file are the same.
        Raises OSError, and PlanflyError if another process writes the file.
        """
        self.end_reason = INTERRUPTED
        self._path = path
        self._is_open = False
        self._locks = contextlib.ExitStack()
        self._batch_ns = batch * SECOND_NS
        self._every = every
        self._skipped_row: Rows | None = None  # newest row, if it was not recorded
        self._received_count = 0  # number of received rows, recorded or not
        self._terrain = setup.scenario.terrain
        self._pending_rows: list[Rows] = []  # rows to record
        self._events: list[MessageRecords] = []
        self._written_count = 0  # number of written rows
        self._last_ns = EPOCH_NS - 1  # log time of the last recorded row
        self._newest_ns = EPOCH_NS - 1  # log time of the last received row
        self._channels: dict[str, int] = {}
        # Do not remove a symbolic link, even if its target does not exist.
        file_existed = path.exists() or path.is_symlink()
        try:
            with self._uninterrupted_write():
                path.touch()
                # Take the lock before the file is emptied, so that a log locked by another process is not changed.
                self._locks.enter_context(lock_path(path))
                self._open_file(setup)
        except BaseException as error:
            # A signal may have arrived while the log was opened.
            self.__exit__(type(error), error, None)
            if not file_existed:
                path.unlink(missing_ok=True)
            raise

    def __enter__(self) -> Self:
        """Return the recorder itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close a log that is still open, with an end if the flight was interrupted, and release its lock."""
        with self._locks, delay_signals():
            if not self._is_open:
                return
            is_interrupted = kind is not None and issubclass(kind, KeyboardInterrupt)
            if is_interrupted and self._received_count:
                self.finish(self.end_reason)
            elif kind is None:
                self._close_file()
            else:
                if is_interrupted:
                    Path(os.path.realpath(self._path)).unlink(missing_ok=True)
                self.abandon()

    def abandon(self) -> None:
        """Close the file after an error, without a result, and ignore an OSError while closing."""
        if self._is_open:
            with contextlib.suppress(OSError):
                self._close_file()

    @contextlib.contextmanager
    def _uninterrupted_write(self) -> Iterator[None]:
        """Delay signals until the end of the block, and add the file's name to its OSErrors.

        Some of them, such as the error of a full disk, name no file.
        """
        try:
            with delay_signals():
                yield
        except OSError as error:
            if error.filename is not None or error.errno is None:
                raise
            raise OSError(error.errno, error.strerror, str(self._path)) from error

    def write(self, block: Track) -> None:
        """Record the rows of a track, as `write_rows` does."""
        self.write_rows(track_rows(block))

    def write_rows(self, rows: Rows) -> None:
        """Record the next rows of a flight, (t,) of `flight.simulation.track.TRACK_ROW`.

        Raises ValueError unless the times increase across all calls and are in the range from 0 s to `MAX_TIME_S`.
        """
        if not len(rows):
            return
        with self._uninterrupted_write():
            times = np.ascontiguousarray(rows["time"])
            newest = last_log_time(times, self._newest_ns, EPOCH_NS, MAX_TIME_S)
            if newest == OUT_OF_RANGE:
                raise ValueError(f"time {times[0]}..{times[-1]} s: expected 0..{MAX_TIME_S:g}")
            if newest == NOT_INCREASING:
                raise ValueError(f"rows from {times[0]} s on: times must increase by at least 1 ns a row")
            self._newest_ns = newest
            # Keep every n-th row, from the first row of the flight.
            recorded_rows = rows[-self._received_count % self._every :: self._every]
            self._received_count += len(rows)
            self._skipped_row = rows[-1:] if (self._received_count - 1) % self._every else None
            if len(recorded_rows):
                self._append_rows(recorded_rows)

    def _append_rows(self, rows: Rows) -> None:
        """Queue rows, and write the complete seconds in the queue whenever they fill a batch."""
        self._pending_rows.append(rows)
        previous_ns, self._last_ns = self._last_ns, round(rows["time"][-1] * 1e9) + EPOCH_NS
        if self._last_ns // self._batch_ns > previous_ns // self._batch_ns:
            self._write_pending(self._last_ns // SECOND_NS * SECOND_NS)

    @property
    def size(self) -> int:
        """Current size of the file, bytes."""
        return self._file.tell()

    def flush(self) -> None:
        """Write all queued rows and flush the file.

        In a live flight, a killed process then loses less than a second. A chunk ends at each flush, so the bytes of
        the file (not its rows) depend on the times of the calls.
        """
        self._write_pending(self._last_ns + 1)

    def event(self, time: float, text: str, level: str = "info") -> None:
        """Queue an event for the log; raise ValueError for an unknown level or a time out of range.

        time: flight time, s.
        level: debug, info, warning, error or fatal.
        """
        if level not in scene.LOG_LEVELS:
            raise ValueError(f"level {level!r}: expected {', '.join(scene.LOG_LEVELS)}")
        if not 0.0 <= time < MAX_TIME_S:
            raise ValueError(f"time {time} s: expected 0..{MAX_TIME_S:g}")
        log_time = round(time * 1e9) + EPOCH_NS
        message = scene.log_message(log_time, text, level).SerializeToString(deterministic=True)
        self._events.append(single_record(self._channels[EVENT_TOPIC], log_time, message))

    def finish(
        self,
        end_reason: str,
        verdict: Verdict | None = None,
        reference: ReferenceFlights | None = None,
        returns: DrawnReturns | None = None,
    ) -> None:
        """Write the rest of the flight and its results, and close the file.

        end_reason: "completed", or the reason why the flight ended early.
        verdict, reference, returns: verdict, results of reference flights, and returns to draw; None to omit them.
        """
        with self._uninterrupted_write():
            if self._skipped_row is not None:
                self._append_rows(self._skipped_row)
                self._skipped_row = None
            self._write_pending(None)
            end = max(self._last_ns, EPOCH_NS)
            self._write_messages([*self._viewer_messages.whole_track_records(end)])
            if returns is not None:
                # With the log time of the start, viewers show the scene during the whole flight.
                update = scene.returns_scene(EPOCH_NS, returns, self._terrain)
                self._write_messages([single_record(self._add_scene_channel(RETURNS_TOPIC), EPOCH_NS, update)])
                self._writer.flush()
            if reference is not None:
                self._write_attachment(REFERENCE_FILE, reference_flights_json(reference).encode(), end)
            if verdict is not None:
                self._write_attachment(VERDICT_FILE, verdict_json(verdict).encode(), end)
            result = {
                "schema": RESULT_SCHEMA,
                "ended": end_reason,
                "rows": self._written_count,
                "end_time_s": (end - EPOCH_NS) / 1e9,
            }
            self._write_attachment(RESULT_FILE, (json.dumps(result, indent=1) + "\n").encode(), end)
            self._close_file()

    def _open_file(self, setup: FlightSetup) -> None:
        """Open the file, replacing an existing one, and write the setup.

        The setup consists of attachments, channels and static scenes.
        """
        attachments = pack_setup(setup)
        self._file = self._path.open("wb", buffering=_BUFFER_BYTES)
        try:
            # A thinned log should take little time: faster compression takes half the time for a quarter more bytes.
            self._writer = ContainerWriter(self._file, PROFILE, 3 if self._every == 1 else -1)
            for name, data in attachments.items():
                self._write_attachment(name, data, EPOCH_NS)
            self._channels[STATE_TOPIC] = self._writer.add_channel(STATE_TOPIC, STATE_NAME, state_schema())
            for topic, kind in _CHANNELS.items():
                descriptor = kind.DESCRIPTOR
                schema = file_descriptor_set(descriptor)
                self._channels[topic] = self._writer.add_channel(topic, descriptor.full_name, schema)
            scenes = {
                "/scene/terrain": scene.terrain_scene(EPOCH_NS, setup.scenario),
                "/scene/threats": scene.threats_scene(EPOCH_NS, setup.scenario.threats, setup.scenario.terrain),
                "/scene/plan": scene.plan_scene(EPOCH_NS, setup.display_waypoints, setup.route.items.tolist()),
                "/scene/aircraft": aircraft_scene(EPOCH_NS),
                "/points/terrain": clouds.ground_cloud(EPOCH_NS, setup.scenario),
                "/points/threats": clouds.threats_cloud(EPOCH_NS, setup.scenario.threats),
                "/points/plan": clouds.plan_cloud(EPOCH_NS, setup.display_waypoints),
                "/points/aircraft": clouds.aircraft_cloud(EPOCH_NS),
            }
            scenario_with_fence = with_fence_zones(setup).scenario
            if scenario_with_fence.zones:
                self._add_scene_channel(ZONES_TOPIC)
                scenes[ZONES_TOPIC] = scene.zones_scene(EPOCH_NS, scenario_with_fence, setup.route.positions)
            self._write_messages(
                [single_record(self._channels[name], EPOCH_NS, update) for name, update in scenes.items()]
            )
            self._writer.flush()
        except OSError:
            self._file.close()
            raise
        self._viewer_messages = ViewerMessages(setup.scenario.origin, self._channels)
        self._flight_events = FlightEvents(setup, self._channels[EVENT_TOPIC])
        self._is_open = True

    def _add_scene_channel(self, topic: str) -> int:
        """Add a channel for scene updates on an optional topic, and return the channel's number."""
        descriptor = SceneUpdate.DESCRIPTOR
        self._channels[topic] = self._writer.add_channel(topic, descriptor.full_name, file_descriptor_set(descriptor))
        return self._channels[topic]

    def _close_file(self) -> None:
        """Write pending rows and events and the file's summary, close the file, and release its lock."""
        self._is_open = False
        with self._locks, self._file:
            self._write_pending(None)
            self._writer.write_end()

    def _write_attachment(self, name: str, data: bytes, log_time: int) -> None:
        """Write an attachment, with the media type that belongs to the suffix of its name."""
        self._writer.write_attachment(name, media_type(name), data, log_time)

    def _write_pending(self, end_ns: int | None) -> None:
        """Write the pending rows and events that are earlier than a log time, and flush the file.

        The messages are written in chunks of at most one second.

        end_ns: log time, ns; None to write all.
        """
        rows = join_rows(self._pending_rows)
        log_times = times_ns(rows["time"])
        end_row = len(rows) if end_ns is None else int(np.searchsorted(log_times, end_ns))
        self._pending_rows = [rows[end_row:]] if end_row < len(rows) else []
        events = [event for event in self._events if end_ns is None or event.log_times[0] < end_ns]
        self._events = [event for event in self._events if end_ns is not None and event.log_times[0] >= end_ns]
        rows, log_times = rows[:end_row], log_times[:end_row]
        pose_records = self._viewer_messages.pose_records(log_times, rows["position"], rows["attitude"])
        event_records = self._flight_events.event_records(log_times, rows["position"], rows["leg"])
        self._write_messages([*pose_records, *event_records, *events], rows, log_times)
        self._writer.flush()

    def _write_messages(
        self, other_messages: list[MessageRecords], rows: Rows = _NO_ROWS, log_times: Ints = _NO_TIMES
    ) -> None:
        """Write rows and other messages in chunks, in order of time.

        At equal times, a row comes after other messages.

        other_messages: message records of all channels except the channel of the rows.
        log_times: log time of each row, ns, (t,).
        """
        channel = self._channels[STATE_TOPIC]
        encoded = encode_rows(rows, self._written_count, channel)
        self._written_count += len(rows)
        layout = lay_out_chunks(
            as_bytes(encoded), log_times, channel, other_messages, self._writer.pop_new_records(), CHUNK_SIZE
        )
        # Cut the bytes of the layout into its chunks, each with its message indexes.
        records, index = memoryview(layout.records), layout.index.tobytes()  # type: ignore[arg-type]  # an array is a buffer
        # Lists are faster than arrays here: reading a field of one chunk from an array takes a microsecond.
        bounds = {name: layout.chunks[name].tolist() for name in CHUNK.names or ()}
        offsets = layout.channels["offset"].tolist()
        messages = layout.channels["messages"].tolist()
        for k in range(len(layout.chunks)):
            content = ChunkContent(
                records=records[bounds["start"][k] : bounds["stop"][k]],
                index=index[bounds["index_start"][k] : bounds["index_stop"][k]],
                channels=tuple(
                    ChannelIndex(channel, offset, count)
                    for channel, (offset, count) in enumerate(zip(offsets[k], messages[k], strict=True))
                    if count
                ),
                start=bounds["first_ns"][k],
                end=bounds["last_ns"][k],
            )
            self._writer.write_chunk(content)


def thin_track(track: Track, every: int) -> Track:
    """Return every n-th row of a track and its last row: the rows that a `Recorder` with stride n records.

    every: stride n; with 1 or less, the track is returned unchanged.

    >>> from logs.recording.example_log import example_log
    >>> thin_track(example_log().track, 100).time
    array([ 0. , 10. , 20. , 30. , 36.5])
    """
    if every <= 1 or not len(track):
        return track
    recorded_rows = np.union1d(np.arange(0, len(track), every), [len(track) - 1])
    return Track(*(getattr(track, name)[recorded_rows] for name in COLUMNS))
