"""The recorder: one flight to one MCAP file, written as it is flown.

The same setup and rows give the same bytes, in whatever blocks the rows arrive: log_time is simulation time (see
`logs.recording.state_channel.EPOCH_NS`), a chunk ends at 64 KiB or at a whole second of it, and nothing reads a clock.
"""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import COLUMNS, TRACK_ROW, Rows, Track, join_rows, track_rows
from logs.recording import foxglove_scene as scene
from logs.recording.chunk_layout import (
    FIRST_NS,
    INDEX_START,
    INDEX_STOP,
    LAST_NS,
    START,
    STOP,
    Layout,
    Messages,
    last_stamp,
    lay_out,
    messages_of,
)
from logs.recording.foxglove_poses import FIX_TOPIC, TF_TOPIC, TRACK_TOPIC, Poses
from logs.recording.mcap_writer import ChunkContent, ContainerWriter
from logs.recording.setup_attachments import MEDIA_TYPES, pack_setup
from logs.recording.state_channel import (
    EPOCH_NS,
    EVENT_TOPIC,
    RECORD,
    SECOND_NS,
    STATE_NAME,
    STATE_TOPIC,
    encode_rows,
    schema_of,
    state_schema,
    times_ns,
)
from logs.verdict.findings import Verdict, verdict_json

CHUNK_SIZE = 64 * 1024
RESULT, VERDICT, RECOVERY = "result.json", "verdict.json", "recovery.json"
RESULT_SCHEMA = "planfly.result/1"
PROFILE = "planfly"
LONGEST = 1e7  # s

_BUFFER = 2**20
_NO_ROWS, _NO_STAMPS = np.empty(0, TRACK_ROW), np.empty(0, dtype=np.int64)
_CHANNELS: dict[str, Any] = {
    TF_TOPIC: FrameTransform,
    FIX_TOPIC: LocationFix,
    EVENT_TOPIC: Log,
    **{f"/scene/{name}": SceneUpdate for name in ("terrain", "threats", "plan")},
    TRACK_TOPIC: SceneUpdate,
}

Ints = NDArray[np.int64]


class Recorder:
    """Writes a flight log; a context manager, so that a flight that raises leaves a readable, unfinished file.

    The setup goes first; after it each whole second of flight is handed to the operating system, so that a killed
    process loses at most the last one.
    """

    def __init__(self, path: Path, setup: FlightSetup, *, every: int = 1, batch: int = 1) -> None:
        """Open ``path`` for writing (replacing it) and write the setup.  Raises OSError.

        every: one row in so many is recorded, and the flight's last.  batch: whole seconds of flight that are written
        at a time, each in chunks of its own: more costs less, and a killed process loses as much; the bytes are the
        same.
        """
        self._batch_ns = batch * SECOND_NS
        self._every = every
        self._skipped: Rows | None = None  # the newest row, if it was not recorded
        self._seen = 0  # rows, recorded or not
        pieces = pack_setup(setup)
        self._pending: list[Rows] = []  # rows to record
        self._events: list[Messages] = []
        self._written = 0  # rows
        self._last_ns = EPOCH_NS - 1  # of the rows recorded
        self._newest_ns = EPOCH_NS - 1  # of the rows received
        self._channels: dict[str, int] = {}
        self._file = path.open("wb", buffering=_BUFFER)
        self._open = True
        try:
            # A thinned log is taken because it costs little: a quarter more bytes for half the time.
            self._writer = ContainerWriter(self._file, PROFILE, 3 if every == 1 else -1)
            self._begin(pieces, setup)
        except OSError:
            self._file.close()
            raise
        self._poses = Poses(setup.scenario.origin, self._channels)

    def __enter__(self) -> "Recorder":
        """Return the recorder itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file, without a result if `finish` was not called."""
        if not self._open:
            return
        # The first error is the one to be told, not a full disk met again while closing.
        with contextlib.suppress(OSError) if kind is not None else contextlib.nullcontext():
            self._close()

    def write(self, block: Track) -> None:
        """Append rows.  Raises ValueError unless their times increase, from 0 on, across all blocks."""
        self.write_rows(track_rows(block))

    def write_rows(self, rows: Rows) -> None:
        """Record rows, (t,) of `flight.simulation.track.TRACK_ROW`, as a flight hands them on."""
        if not len(rows):
            return
        newest = last_stamp(np.ascontiguousarray(rows["time"]), self._newest_ns, EPOCH_NS, LONGEST)
        if newest == -1:
            raise ValueError(f"time {rows[0].time}..{rows[-1].time} s: 0..{LONGEST:g} is expected")
        if newest == -2:
            raise ValueError(f"rows from {rows[0].time} s on: times must increase by at least 1 ns a row")
        self._newest_ns = newest
        # One row in `every`, counted from the flight's first.
        kept = rows[-self._seen % self._every :: self._every]
        self._seen += len(rows)
        self._skipped = rows[-1:] if (self._seen - 1) % self._every else None
        if len(kept):
            self._append(kept)

    def _append(self, rows: Rows) -> None:
        self._pending.append(rows)
        before, self._last_ns = self._last_ns, round(rows[-1].time * 1e9) + EPOCH_NS
        if self._last_ns // self._batch_ns > before // self._batch_ns:
            self._emit(self._last_ns // SECOND_NS * SECOND_NS)

    def flush(self) -> None:
        """Hand every row received to the operating system now, by the caller's clock.

        For a live flight, so that a killed process loses no whole second: chunks then end where the caller says,
        and the file's bytes (not its rows) depend on when that was.
        """
        self._emit(self._last_ns + 1)

    def event(self, time: float, text: str, level: str = "info") -> None:
        """Record what happened at ``time`` (s); level: debug, info, warning, error or fatal.  Raises ValueError."""
        if level not in scene.LEVELS:
            raise ValueError(f"level {level!r}: {', '.join(scene.LEVELS)} are expected")
        if not 0.0 <= time < LONGEST:
            raise ValueError(f"time {time} s: 0..{LONGEST:g} is expected")
        stamp = round(time * 1e9) + EPOCH_NS
        message = scene.log_message(stamp, text, level).SerializeToString(deterministic=True)
        self._events.append(messages_of(self._channels[EVENT_TOPIC], stamp, message))

    def finish(self, ended: str, verdict: Verdict | None = None) -> None:
        """Write how the flight ended and its verdict, and close the file."""
        if self._skipped is not None:
            self._append(self._skipped)
            self._skipped = None
        self._emit(None)
        stamp = max(self._last_ns, EPOCH_NS)
        self._write([self._poses.whole(stamp)])
        if verdict is not None:
            self._attach(VERDICT, verdict_json(verdict).encode(), stamp)
        result = {
            "schema": RESULT_SCHEMA,
            "ended": ended,
            "rows": self._written,
            "end_time_s": (stamp - EPOCH_NS) / 1e9,
        }
        self._attach(RESULT, (json.dumps(result, indent=1) + "\n").encode(), stamp)
        self._close()

    def _begin(self, pieces: dict[str, bytes], setup: FlightSetup) -> None:
        for name, data in pieces.items():
            self._attach(name, data, EPOCH_NS)
        self._channels[STATE_TOPIC] = self._writer.channel(STATE_TOPIC, STATE_NAME, state_schema())
        for topic, kind in _CHANNELS.items():
            descriptor = kind.DESCRIPTOR
            self._channels[topic] = self._writer.channel(topic, descriptor.full_name, schema_of(descriptor))
        scenes = {
            "/scene/terrain": scene.terrain_scene(EPOCH_NS, setup.scenario),
            "/scene/threats": scene.threats_scene(EPOCH_NS, setup.scenario.threats),
            "/scene/plan": scene.plan_scene(EPOCH_NS, setup.route.waypoints),
        }
        self._write([messages_of(self._channels[name], EPOCH_NS, update) for name, update in scenes.items()])
        self._writer.flush()

    def _close(self) -> None:
        """Write what is pending, the summary and the end of the file."""
        self._open = False
        try:
            self._emit(None)
            self._writer.finish()
        finally:
            self._file.close()

    def _attach(self, name: str, data: bytes, stamp: int) -> None:
        self._writer.attach(name, MEDIA_TYPES["." + name.rsplit(".", 1)[1]], data, stamp)

    def _emit(self, until: int | None) -> None:
        """Write the pending rows and events before ``until`` (ns; None for all), in chunks of at most a second."""
        rows = join_rows(self._pending)
        stamps = times_ns(rows["time"])
        stop = len(rows) if until is None else int(np.searchsorted(stamps, until))
        self._pending = [rows[stop:]] if stop < len(rows) else []
        events = [item for item in self._events if until is None or item.stamps[0] < until]
        self._events = [item for item in self._events if until is not None and item.stamps[0] >= until]
        rows, stamps = rows[:stop], stamps[:stop]
        self._write([*self._poses.take(stamps, rows["position"], rows["attitude"]), *events], rows, stamps)
        self._writer.flush()

    def _write(self, others: list[Messages], rows: Rows = _NO_ROWS, stamps: Ints = _NO_STAMPS) -> None:
        """Write rows and other messages in order of time; at one time the row comes last."""
        channel = self._channels[STATE_TOPIC]
        encoded = encode_rows(rows, self._written, channel)
        self._written += len(rows)
        data = encoded.view(np.uint8).reshape(len(rows), RECORD.itemsize)
        layout = lay_out(data, stamps, channel, others, self._writer.front(), CHUNK_SIZE)
        for content in _chunks(layout):
            self._writer.chunk(content)


def _chunks(layout: Layout) -> Iterator[ChunkContent]:
    records, index = memoryview(layout.records), layout.index.tobytes()  # type: ignore[arg-type]  # an array is a buffer
    rows = zip(layout.chunks.tolist(), layout.places.tolist(), layout.counts.tolist(), strict=True)
    for chunk, places, counts in rows:
        channels = tuple((k, place, counts[k]) for k, place in enumerate(places) if place >= 0)
        part = index[chunk[INDEX_START] : chunk[INDEX_STOP]]
        data = records[chunk[START] : chunk[STOP]]
        yield ChunkContent(data, part, channels, chunk[FIRST_NS], chunk[LAST_NS])


def thin_track(track: Track, every: int) -> Track:
    """The rows of a whole flight that a `Recorder` with this ``every`` keeps."""
    if every <= 1 or not len(track):
        return track
    kept = np.union1d(np.arange(0, len(track), every), [len(track) - 1])
    return Track(*(getattr(track, name)[kept] for name in COLUMNS))
