"""The recorder: one flight to one MCAP file, written as it is flown.

The same setup and rows give the same bytes, in whatever blocks the rows arrive: log_time is simulation time (see
`logs.schema.EPOCH_NS`), a chunk ends at 64 KiB or at a whole second of it, and nothing reads a clock.
"""

import bisect
import contextlib
import json
import struct
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

from flight.setup import FlightSetup
from flight.track import COLUMNS, Track
from logs import scene
from logs.container_write import ChunkContent, ContainerWriter
from logs.schema import (
    EPOCH_NS,
    EVENT_TOPIC,
    MESSAGE_HEADER,
    MESSAGE_OPCODE,
    RECORD,
    SECOND_NS,
    STATE_NAME,
    STATE_TOPIC,
    Rows,
    encode_rows,
    join_rows,
    schema_of,
    state_schema,
    times_ns,
)
from logs.setup_file import MEDIA_TYPES, pack_setup
from logs.verdict import Verdict, verdict_json
from world.frames import to_geo

CHUNK_SIZE = 64 * 1024
RESULT, VERDICT, RECOVERY = "result.json", "verdict.json", "recovery.json"
RESULT_SCHEMA = "planfly.result/1"
PROFILE = "planfly"
LONGEST = 1e7  # s

_BUFFER = 2**20
_NO_ROWS = join_rows([])
_ROWS_A_CHUNK = CHUNK_SIZE // RECORD.itemsize
_SLOT_NS = 200_000_000  # one transform in each, 5 Hz; one fix a second
_HEAD = struct.Struct("<BQHIQQ")
_CHANNELS: dict[str, Any] = {
    "/tf": FrameTransform,
    "/fix": LocationFix,
    EVENT_TOPIC: Log,
    **{f"/scene/{name}": SceneUpdate for name in ("terrain", "threats", "plan", "track")},
}

Floats = NDArray[np.float64]
_Extra = tuple[int, str, bytes]  # log_time, topic, message


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
        self._skipped: Track | None = None  # the newest block, if its last row was not recorded
        self._seen = 0  # rows, recorded or not
        pieces = pack_setup(setup)
        self._setup = setup
        self._pending: list[Rows] = []
        self._events: list[_Extra] = []
        self._received = 0  # rows
        self._last_ns = EPOCH_NS - 1  # of the rows recorded
        self._newest_ns = EPOCH_NS - 1  # of the rows received
        self._slot = -1
        self._path: list[Floats] = []  # one position a second
        self._tail: list[Floats] = []  # the newest position
        self._next_track_scene = 10  # s
        self._channels: dict[str, int] = {}
        self._file = path.open("wb", buffering=_BUFFER)
        self._open = True
        try:
            self._writer = ContainerWriter(self._file, PROFILE)
            self._begin(pieces)
        except OSError:
            self._file.close()
            raise

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
        self._take(block)

    def _take(self, block: Track) -> None:
        if not len(block):
            return
        if not (np.isfinite(block.time).all() and block.time[0] >= 0.0 and block.time[-1] < LONGEST):
            raise ValueError(f"time {block.time[0]}..{block.time[-1]} s: 0..{LONGEST:g} is expected")
        stamps = times_ns(block)
        if stamps[0] <= self._newest_ns or (np.diff(stamps) <= 0).any():
            raise ValueError(f"rows from {block.time[0]} s on: times must increase by at least 1 ns a row")
        self._newest_ns = int(stamps[-1])
        # One row in `every`, counted from the flight's first.
        first = -self._seen % self._every
        self._seen += len(block)
        whole = first < len(block) and (len(block) - 1 - first) % self._every == 0
        self._skipped = None if whole else block
        if first < len(block):
            kept = slice(first, None, self._every)
            self._append(encode_rows(block, self._received, self._channels[STATE_TOPIC], kept))

    def _append(self, rows: Rows) -> None:
        self._pending.append(rows)
        self._received += len(rows)
        before, self._last_ns = self._last_ns, int(rows["log_time"][-1])
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
        self._events.append((stamp, EVENT_TOPIC, message))

    def finish(self, ended: str, verdict: Verdict | None = None) -> None:
        """Write how the flight ended and its verdict, and close the file."""
        if self._skipped is not None:
            self._append(encode_rows(self._skipped, self._received, self._channels[STATE_TOPIC], slice(-1, None)))
            self._skipped = None
        self._emit(None)
        stamp = max(self._last_ns, EPOCH_NS)
        final = scene.track_scene(stamp, np.array([*self._path, *self._tail]).reshape(-1, 3))
        self._chunk([(stamp, "/scene/track", final.SerializeToString(deterministic=True))])
        if verdict is not None:
            self._attach(VERDICT, verdict_json(verdict).encode(), stamp)
        result = {
            "schema": RESULT_SCHEMA,
            "ended": ended,
            "rows": self._received,
            "end_time_s": (stamp - EPOCH_NS) / 1e9,
        }
        self._attach(RESULT, (json.dumps(result, indent=1) + "\n").encode(), stamp)
        self._close()

    def _begin(self, pieces: dict[str, bytes]) -> None:
        for name, data in pieces.items():
            self._attach(name, data, EPOCH_NS)
        self._channels[STATE_TOPIC] = self._writer.channel(STATE_TOPIC, STATE_NAME, state_schema())
        for topic, kind in _CHANNELS.items():
            descriptor = kind.DESCRIPTOR
            self._channels[topic] = self._writer.channel(topic, descriptor.full_name, schema_of(descriptor))
        scenario = self._setup.scenario
        scenes = {
            "/scene/terrain": scene.terrain_scene(EPOCH_NS, scenario),
            "/scene/threats": scene.threats_scene(EPOCH_NS, scenario.threats),
            "/scene/plan": scene.plan_scene(EPOCH_NS, self._setup.route.waypoints),
        }
        self._chunk([(EPOCH_NS, name, update.SerializeToString(deterministic=True)) for name, update in scenes.items()])
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
        stop = len(rows) if until is None else int(np.searchsorted(rows["log_time"], until))
        self._pending = [rows[stop:]] if stop < len(rows) else []
        events = sorted((item for item in self._events if until is None or item[0] < until), key=lambda item: item[0])
        self._events = [item for item in self._events if until is not None and item[0] >= until]
        rows = rows[:stop]
        stamps = rows["log_time"].astype(np.int64)
        extras = sorted([*self._poses(rows, stamps), *events], key=lambda item: item[0])
        moments = [item[0] for item in extras]
        seconds = np.unique(np.concatenate([stamps, np.array(moments, dtype=np.int64)]) // SECOND_NS)
        firsts = np.searchsorted(stamps, seconds * SECOND_NS).tolist()
        lasts = np.searchsorted(stamps, (seconds + 1) * SECOND_NS).tolist()
        at = 0
        for second, first, last in zip(seconds.tolist(), firsts, lasts, strict=True):
            to = bisect.bisect_left(moments, (second + 1) * SECOND_NS, at)
            self._emit_second(rows[first:last], stamps[first:last], extras[at:to])
            at = to
        self._writer.flush()

    def _emit_second(self, rows: Rows, stamps: NDArray[np.int64], extras: list[_Extra]) -> None:
        for first in range(0, max(1, len(rows)), _ROWS_A_CHUNK):
            stop = first + _ROWS_A_CHUNK
            # Before the next block's first row; the last block takes what is left.
            count = sum(item[0] < stamps[stop] for item in extras) if stop < len(rows) else len(extras)
            self._chunk(extras[:count], rows[first:stop])
            extras = extras[count:]

    def _chunk(self, extras: list[_Extra], rows: Rows | None = None) -> None:
        """Write one chunk of rows and other messages, both in order of time; at one time the row comes last."""
        rows = _NO_ROWS if rows is None else rows
        data = rows.tobytes()
        places = np.searchsorted(rows["log_time"], np.array([item[0] for item in extras], dtype=np.uint64))
        offsets = np.arange(len(rows), dtype=np.uint64) * np.uint64(RECORD.itemsize)
        pieces, at, size = [], 0, 0
        index: dict[int, list[tuple[int, int]]] = {}
        for (stamp, topic, message), place in zip(extras, places.tolist(), strict=True):
            channel = self._channels[topic]
            record = _HEAD.pack(MESSAGE_OPCODE, MESSAGE_HEADER + len(message), channel, 0, stamp, stamp) + message
            pieces += [data[at * RECORD.itemsize : place * RECORD.itemsize], record]
            index.setdefault(channel, []).append((stamp, place * RECORD.itemsize + size))
            offsets[place:] += np.uint64(len(record))
            size += len(record)
            at = place
        pieces.append(data[at * RECORD.itemsize :])
        pairs = {channel: np.array(entries, dtype=np.uint64) for channel, entries in index.items()}
        if len(rows):
            own = np.empty((len(rows), 2), dtype=np.uint64)
            own[:, 0], own[:, 1] = rows["log_time"], offsets
            pairs[self._channels[STATE_TOPIC]] = own
        self._writer.chunk(ChunkContent(b"".join(pieces), pairs))

    def _poses(self, rows: Rows, stamps: NDArray[np.int64]) -> Iterator[_Extra]:
        """Give a transform for the first good row in each slot, one fix a second, and now and then the track so far.

        rows: of whole seconds.
        """
        state = rows["state"]
        place = np.stack([state[name] for name in ("east_m", "north_m", "up_amsl_m")], axis=1)
        angles = np.stack([state[name] for name in ("roll_rad", "pitch_rad", "yaw_rad")], axis=1)
        good = np.flatnonzero(np.isfinite(place).all(axis=1) & np.isfinite(angles).all(axis=1))
        slots, firsts = np.unique(stamps[good] // _SLOT_NS, return_index=True)
        chosen = good[firsts[slots > self._slot]]
        if not chosen.size:
            return
        self._slot = int(slots[-1])
        when = stamps[chosen]
        for stamp, message in zip(
            when.tolist(), scene.transform_messages(when, place[chosen], angles[chosen]), strict=True
        ):
            yield stamp, "/tf", message
        _, starts = np.unique(when // SECOND_NS, return_index=True)
        firsts = place[chosen[starts]]
        lat, lon = to_geo(self._setup.scenario.origin, firsts[:, 0], firsts[:, 1])
        for stamp, first, lat_deg, lon_deg in zip(
            when[starts].tolist(), firsts, lat.tolist(), lon.tolist(), strict=True
        ):
            fix = scene.fix_message(stamp, lat_deg, lon_deg, float(first[2]))
            yield stamp, "/fix", fix.SerializeToString(deterministic=True)
            self._path.append(first)
            # After 10, 20, 40, ... s: viewers that seek show the newest, and the file stays small.
            if stamp - EPOCH_NS >= self._next_track_scene * SECOND_NS:
                self._next_track_scene *= 2
                path = scene.track_scene(stamp, np.array(self._path))
                yield stamp, "/scene/track", path.SerializeToString(deterministic=True)
        self._tail = [place[good[-1]]]


def thin_track(track: Track, every: int) -> Track:
    """The rows of a whole flight that a `Recorder` with this ``every`` keeps."""
    if every <= 1 or not len(track):
        return track
    kept = np.union1d(np.arange(0, len(track), every), [len(track) - 1])
    return Track(*(getattr(track, name)[kept] for name in COLUMNS))
