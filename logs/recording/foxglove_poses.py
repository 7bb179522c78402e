"""The moving part of what viewers show: the pose five times a second, a fix a second, and the track so far."""

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from numpy.typing import NDArray

from logs.recording import foxglove_scene as scene
from logs.recording.chunk_layout import SECOND_NS, MessageRecords, single_record, stamped_records
from logs.recording.protobuf_arrays import (
    Encoded,
    as_bytes,
    fill_doubles,
    fill_submessage,
    submessage,
    tagged_doubles,
)
from logs.recording.state_channel import EPOCH_NS
from logs.recording.viewers.point_clouds import track_cloud
from logs.recording.viewers.track_so_far import EVERY, TrackSoFar
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TF_TOPIC, FIX_TOPIC, TRACK_TOPIC, TRACK_POINTS = "/tf", "/fix", "/scene/track", "/points/track"

_SLOT_NS = 200_000_000  # one transform in each, 5 Hz; one fix a second
_XYZ, _XYZW, _GEO = "xyz", "xyzw", ("latitude", "longitude", "altitude")
# The track's points: s between messages at least, and the ratio of their times, so that a long flight's stay few.
_CLOUD_EVERY, _CLOUD_RATIO = 10.0, 1.05
# The messages behind their timestamps, in protobuf's encoding.
_TRANSFORM_NAMES = FrameTransform(parent_frame_id=scene.MAP, child_frame_id=scene.AIRCRAFT).SerializeToString(
    deterministic=True
)
_TRANSFORM = np.dtype(
    [
        ("names", np.uint8, (len(_TRANSFORM_NAMES),)),
        ("translation", submessage(_XYZ)),
        ("rotation", submessage(_XYZW)),
    ]
)
_FIX_NAMES = LocationFix(frame_id=scene.AIRCRAFT).SerializeToString(deterministic=True)
_FIX = np.dtype([("names", np.uint8, (len(_FIX_NAMES),)), *tagged_doubles(_GEO)])


def transform_messages(channel: int, log_times: Ints, position: Floats, attitude: Floats) -> MessageRecords:
    """Position and attitude of the aircraft: a FrameTransform for each of n rows.

    position, attitude: (n, 3).  Rounded to 2^-10 m and 2^-20 of the quaternion, which no viewer shows and which halves
    their size in the log; the state's own message is exact.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        translation = np.round(position * 1024.0) / 1024.0
    rotation = np.round(scene.body_rotation(attitude) * 2.0**20) / 2.0**20
    out: Encoded = np.zeros(len(log_times), dtype=_TRANSFORM)
    out["names"] = np.frombuffer(_TRANSFORM_NAMES, np.uint8)
    fill_submessage(out["translation"], FrameTransform.TRANSLATION_FIELD_NUMBER, _XYZ, translation)
    fill_submessage(out["rotation"], FrameTransform.ROTATION_FIELD_NUMBER, _XYZW, rotation)
    return stamped_records(log_times, channel, FrameTransform.TIMESTAMP_FIELD_NUMBER, as_bytes(out))


def fix_messages(channel: int, log_times: Ints, origin: GeoOrigin, position: Floats) -> MessageRecords:
    """Latitude, longitude and height above mean sea level: a LocationFix for each of n rows.

    position: (n, 3).
    """
    east, north, up = position.T
    lat, lon = to_geo(origin, east, north)
    out: Encoded = np.zeros(len(log_times), dtype=_FIX)
    out["names"] = np.frombuffer(_FIX_NAMES, np.uint8)
    fill_doubles(out, _GEO, np.stack([lat, lon, up], axis=1))
    return stamped_records(log_times, channel, LocationFix.TIMESTAMP_FIELD_NUMBER, as_bytes(out))


class Poses:
    """Chooses the rows that viewers get, second by second, and makes their messages."""

    def __init__(self, origin: GeoOrigin, channels: dict[str, int]) -> None:
        """channels: the number of each topic."""
        self._origin, self._channels = origin, channels
        self._slot = self._second = -1
        self._path: list[Floats] = []  # positions, one a second
        self._tail = np.zeros((0, 3))  # the newest position
        self._so_far = TrackSoFar()
        self._next_cloud = 0.0  # s

    def take(self, log_times: Ints, position: Floats, attitude: Floats) -> Iterator[MessageRecords]:
        """Messages for the first good row in each slot, a fix a second, and the track so far every `EVERY` seconds.

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
        self._path.append(firsts)
        for k in np.flatnonzero((log_times[starts] - EPOCH_NS) // SECOND_NS % EVERY == 0).tolist():
            log_time = int(log_times[starts[k]])
            with np.errstate(over="ignore", invalid="ignore"):
                line = np.round(self._so_far.add(firsts[k]) * 16.0) / 16.0
            yield single_record(self._channels[TRACK_TOPIC], log_time, scene.track_scene(log_time, line))
            time = (log_time - EPOCH_NS) / SECOND_NS
            if time >= self._next_cloud:
                self._next_cloud = max(time + _CLOUD_EVERY, time * _CLOUD_RATIO)
                yield self._cloud(log_time, [*self._path[:-1], firsts[: k + 1]])

    def whole(self, log_time: int) -> Iterator[MessageRecords]:
        """The track up to the newest row, a point a second, at ``log_time`` (ns): as a line and as points."""
        parts = [*self._path, self._tail]
        path = scene.track_scene(log_time, np.concatenate([np.zeros((0, 3)), *parts]))
        yield single_record(self._channels[TRACK_TOPIC], log_time, path)
        yield self._cloud(log_time, parts)

    def _cloud(self, log_time: int, parts: list[Floats]) -> MessageRecords:
        points = track_cloud(log_time, np.concatenate([np.zeros((0, 3)), *parts]))
        return single_record(self._channels[TRACK_POINTS], log_time, points)


def _changes(values: Ints, before: int) -> Ints:
    """Where non-decreasing values differ from the one before, the first from ``before``."""
    return np.flatnonzero(np.diff(values, prepend=before) > 0)
