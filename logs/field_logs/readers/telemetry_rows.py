"""The messages of one system in a telemetry log: those of numbers as rows, so that a long log stays small."""

import math
from array import array
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from logs.field_logs.readers.clocks import steady_clock

Floats = NDArray[np.float64]

# Fields that are kept of the messages that come many times a second.
NUMBERS = {
    "GLOBAL_POSITION_INT": ("lat", "lon", "alt", "vx", "vy", "vz"),
    "ATTITUDE": ("roll", "pitch", "yaw"),
    "VFR_HUD": ("airspeed", "groundspeed", "alt", "throttle"),
    "WIND": ("direction", "speed"),
    "WIND_COV": ("wind_x", "wind_y"),
    "GPS_RAW_INT": ("lat", "lon", "alt", "fix_type"),
    "SYS_STATUS": ("current_battery", "voltage_battery"),
    "BATTERY_STATUS": ("current_battery", "energy_consumed"),
}
# Of each other kind this many are kept.
_MOST = 200_000


class BootClock(NamedTuple):
    """The vehicle's clock.

    offset: of time 0, s since 1970.  jumps: s, where the vehicle was switched on anew.  time: (n,) s, of each message.
    """

    offset: float
    jumps: tuple[float, ...]
    time: Floats


class SystemMessages:
    """What one system sent."""

    def __init__(self) -> None:
        self._stamps, self._boots = array("d"), array("d")
        self._rows: dict[str, array[float]] = {}
        self._named: dict[str, list[tuple[int, Any]]] = {}

    def __len__(self) -> int:
        """How many messages."""
        return len(self._stamps)

    def add(self, stamp: float, message: Any) -> None:
        """Take a message, received at ``stamp`` (s since 1970)."""
        name, number = message.get_type(), len(self._stamps)
        boot = getattr(message, "time_boot_ms", None)
        self._stamps.append(stamp)
        self._boots.append(math.nan if boot is None else boot * 1e-3)
        fields = NUMBERS.get(name)
        if fields is None:
            kept = self._named.setdefault(name, [])
            if len(kept) < _MOST:
                kept.append((number, message))
            return
        rows = self._rows.setdefault(name, array("d"))
        rows.append(number)
        rows.extend(float(getattr(message, field)) for field in fields)

    def table(self, name: str) -> Floats:
        """Rows (n, 1 + fields) of a kind in `NUMBERS`: the message's number among all, and its fields."""
        rows = self._rows.get(name)
        return np.array(rows if rows is not None else [], dtype=np.float64).reshape(-1, 1 + len(NUMBERS[name]))

    def named(self, name: str) -> list[tuple[int, Any]]:
        """Number and message of every other kind."""
        return self._named.get(name, [])

    def boot_times(self) -> BootClock:
        """The vehicle's clock, and each message's time on it.

        A message without a time of its own has that of the one before it, and as much more as it was received later.
        """
        stamps, time = np.array(self._stamps), np.array(self._boots)
        known = np.flatnonzero(np.isfinite(time))
        if not known.size:
            offset = float(stamps[0]) if stamps.size else math.nan
            return BootClock(offset, (), stamps - offset)
        offset = float(stamps[known[0]] - time[known[0]])
        steady = steady_clock(time[known])
        time[known] = steady.time
        before = known[np.clip(np.searchsorted(known, np.arange(time.size), side="right") - 1, 0, None)]
        unknown = ~np.isfinite(time)
        time[unknown] = time[before[unknown]] + (stamps - stamps[before])[unknown]
        return BootClock(offset, steady.jumps, time)
