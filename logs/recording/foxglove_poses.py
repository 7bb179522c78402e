"""The moving part of what viewers show: the pose five times a second, a fix a second, and the track so far."""

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from numpy.typing import NDArray

from logs.recording import foxglove_scene as scene
from logs.recording.chunk_layout import MessageRecords, single_record, stamped_records
from logs.recording.state_channel import EPOCH_NS, SECOND_NS
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TF_TOPIC, FIX_TOPIC, TRACK_TOPIC = "/tf", "/fix", "/scene/track"

_SLOT_NS = 200_000_000  # one transform in each, 5 Hz; one fix a second
# The fields behind the timestamp, in protobuf's encoding, with eight bytes for each double; through message objects
# these cost as much as all of the state.
_TF_TAG, _FIX_TAG = 0x0A, 0x32
_DOUBLE = bytes(8)
_TF = (
    FrameTransform(parent_frame_id=scene.MAP, child_frame_id=scene.AIRCRAFT).SerializeToString(deterministic=True),
    b"\x22\x1b" + b"".join(bytes([tag]) + _DOUBLE for tag in (0x09, 0x11, 0x19)),
    b"\x2a\x24" + b"".join(bytes([tag]) + _DOUBLE for tag in (0x09, 0x11, 0x19, 0x21)),
)
_FIX = (
    LocationFix(frame_id=scene.AIRCRAFT).SerializeToString(deterministic=True),
    b"".join(bytes([tag]) + _DOUBLE for tag in (0x09, 0x11, 0x19)),
)


def _slots(parts: tuple[bytes, ...]) -> tuple[bytes, list[int]]:
    """The template of these parts, and where its doubles start: behind the names, one after each tag."""
    template = b"".join(parts)
    slots, at = [], len(parts[0])
    for part in parts[1:]:
        count = len(part) // 9
        head = len(part) - 9 * count
        slots += [at + head + 9 * k + 1 for k in range(count)]
        at += len(part)
    return template, slots


_TF_TEMPLATE, _TF_SLOTS = _slots(_TF)
_FIX_TEMPLATE, _FIX_SLOTS = _slots(_FIX)


def transform_messages(channel: int, log_times: Ints, position: Floats, attitude: Floats) -> MessageRecords:
    """Position and attitude of the aircraft: a FrameTransform for each of n rows.

    position, attitude: (n, 3).  Rounded to 2^-10 m and 2^-20 of the quaternion, which no viewer shows and which halves
    their size in the log; the state's own message is exact.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        rounded = np.round(position * 1024.0) / 1024.0
    turns = np.round(scene.body_rotation(attitude) * 2.0**20) / 2.0**20
    return stamped_records(log_times, channel, _TF_TAG, _TF_TEMPLATE, _TF_SLOTS, np.hstack([rounded, turns]))


def fix_messages(channel: int, log_times: Ints, origin: GeoOrigin, position: Floats) -> MessageRecords:
    """Latitude, longitude and height above mean sea level: a LocationFix for each of n rows.

    position: (n, 3).
    """
    lat, lon = to_geo(origin, position[:, 0], position[:, 1])
    values = np.stack([lat, lon, position[:, 2]], axis=1)
    return stamped_records(log_times, channel, _FIX_TAG, _FIX_TEMPLATE, _FIX_SLOTS, values)


class Poses:
    """Chooses the rows that viewers get, second by second, and makes their messages."""

    def __init__(self, origin: GeoOrigin, channels: dict[str, int]) -> None:
        """channels: the number of each topic."""
        self._origin, self._channels = origin, channels
        self._slot = self._second = -1
        self._path: list[Floats] = []  # positions, one a second
        self._tail = np.zeros((0, 3))  # the newest position
        self._next_track = 10  # s

    def take(self, log_times: Ints, position: Floats, attitude: Floats) -> Iterator[MessageRecords]:
        """Messages for the first good row in each slot, a fix a second, and now and then the track so far.

        log_times: (n,) ns, of whole seconds.  position, attitude: (n, 3).
        """
        good = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(attitude).all(axis=1))
        slots = log_times[good] // _SLOT_NS
        chosen = good[_changes(slots, self._slot)]
        if good.size:
            self._tail = position[good[-1:]]
        if not chosen.size:
            return
        self._slot = int(slots[-1])
        chosen_times = log_times[chosen]
        yield transform_messages(self._channels[TF_TOPIC], chosen_times, position[chosen], attitude[chosen])
        seconds = chosen_times // SECOND_NS
        starts = chosen[_changes(seconds, self._second)]
        if not starts.size:
            return
        self._second = int(seconds[-1])
        firsts = position[starts]
        yield fix_messages(self._channels[FIX_TOPIC], log_times[starts], self._origin, firsts)
        # After 10, 20, 40, ... s: viewers that seek show the newest, and the file stays small.
        for k in np.flatnonzero(log_times[starts] - EPOCH_NS >= self._next_track * SECOND_NS).tolist():
            log_time = int(log_times[starts[k]])
            if log_time - EPOCH_NS >= self._next_track * SECOND_NS:
                self._next_track *= 2
                yield self._track(log_time, [*self._path, firsts[: k + 1]])
        self._path.append(firsts)

    def whole(self, log_time: int) -> MessageRecords:
        """The track up to the newest row, at ``log_time`` (ns)."""
        return self._track(log_time, [*self._path, self._tail])

    def _track(self, log_time: int, parts: list[Floats]) -> MessageRecords:
        path = scene.track_scene(log_time, np.concatenate([np.zeros((0, 3)), *parts]))
        return single_record(self._channels[TRACK_TOPIC], log_time, path)


def _changes(values: Ints, before: int) -> Ints:
    """Where non-decreasing values differ from the one before, the first from ``before``."""
    return np.flatnonzero(np.diff(values, prepend=before) > 0)
