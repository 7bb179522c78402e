"""What happens in flight, noted when it happens: legs that begin, threats whose reach is entered and left."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from logs.recording.chunk_layout import MessageRecords, single_record
from logs.recording.foxglove_scene import log_message

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# `name` of these in the log: what a timeline works out for itself is not read back.
NAME = "flight"
# Threats are looked at so often, ns.
_LOOK = 200_000_000


class FlightEvents:
    """Makes a Log message of each, whatever blocks the rows come in."""

    def __init__(self, setup: FlightSetup, channel: int) -> None:
        """channel: number of the log's topic."""
        self._route, self._threats, self._channel = setup.route, setup.scenario.threats, channel
        self._leg, self._slot = -1, -1
        self._inside = {
            "missile range": np.zeros(len(self._threats.names), dtype=bool),
            "radar range": np.zeros(len(self._threats.names), dtype=bool),
        }

    def take(self, log_times: Ints, position: Floats, leg: Floats) -> Iterator[MessageRecords]:
        """Messages of rows; log_times: (n,) ns.  position: (n, 3).  leg: (n,) the active one."""
        if not len(log_times):
            return
        for k in np.flatnonzero(np.diff(leg, prepend=self._leg) != 0).tolist():
            yield self._message(int(log_times[k]), self._leg_text(int(leg[k])), "info")
        self._leg = int(leg[-1])
        slots = log_times // _LOOK
        looked = np.flatnonzero(np.diff(slots, prepend=self._slot) > 0)
        self._slot = int(slots[-1])
        if not len(self._threats.names) or not looked.size:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            off = position[looked, None, :] - self._threats.position
            distance = np.sqrt((off**2).sum(axis=2))
        reaches = (self._threats.kill_radius, self._threats.detection_radius)
        for (kind, before), radius in zip(self._inside.items(), reaches, strict=True):
            inside = (distance < radius) & (radius > 0.0)
            changed = np.diff(inside, axis=0, prepend=before[None, :])
            for row, threat in np.argwhere(changed).tolist():
                yield self._threat(int(log_times[looked[row]]), kind, threat, bool(inside[row, threat]))
            self._inside[kind] = inside[-1]

    def _leg_text(self, leg: int) -> str:
        items = self._route.items
        to = leg + 1
        if not 0 <= to < len(items):
            return f"leg {leg}"
        return f"leg {leg}, to waypoint {to}" + (f" (item {items[to]})" if items[to] >= 0 else "")

    def _threat(self, time: int, kind: str, threat: int, entered: bool) -> MessageRecords:
        name, level = self._threats.names[threat], "warning" if kind == "missile range" else "info"
        text = f"inside the {kind} of {name}" if entered else f"out of the {kind} of {name}"
        return self._message(time, text, level if entered else "info")

    def _message(self, time: int, text: str, level: str) -> MessageRecords:
        message = log_message(time, text, level, NAME).SerializeToString(deterministic=True)
        return single_record(self._channel, time, message)
