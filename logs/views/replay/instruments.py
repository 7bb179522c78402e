"""Show the instruments of a recorded flight at one time as a frame: lines of text for a terminal.

A frame depends only on the log, the flight time and the width, not on the clock.
"""

import bisect
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flight.simulation.track import control_limits
from logs.recording.reader import FlightLog
from logs.views.charts import shorten
from logs.views.replay.timeline import TimelineEntry, log_with_legs, timeline_of_legs, waypoint_name
from world.arrays import Floats

# Smallest width of a frame, columns.
MIN_WIDTH = 60
# Rows of the horizon; a frame and the line below it fit into a terminal of 24 lines.
_HORIZON_ROWS = 7

# Pitch shown by a row of the horizon, degrees.
_DEGREES_A_ROW = 5.0
# Number of timeline entries at the bottom of a frame.
_LATEST_ENTRIES = 3


class _Size(NamedTuple):
    """Widths of a frame and of its parts, columns.

    columns: smallest width of a frame that uses this size.
    horizon: width of the horizon without its edges.
    bar: width of a control's bar without its ends.
    """

    columns: int
    horizon: int
    bar: int


# Even the narrow size shows the numbers next to the horizon in full.
_WIDE = _Size(80, 25, 31)
_NARROW = _Size(MIN_WIDTH, 11, 21)


@dataclass(frozen=True, slots=True, eq=False)
class Instruments:
    """The instruments of a recorded flight, which `frame` shows at any time; see `make_instruments`.

    log: log whose legs were computed from its track.
    entries: timeline of the flight.
    ground: altitude of the ground under each row of the track, m AMSL, (t,); NaN if unknown.
    limits: name of each control and its greatest deflection in either direction, rad; 1 for the throttle.
    """

    log: FlightLog
    entries: tuple[TimelineEntry, ...]
    ground: Floats
    limits: tuple[tuple[str, float], ...]

    def frame(self, time: float, *, width: int = 80) -> list[str]:
        """Return the frame at a time: the instruments as lines of text.

        It shows the track's last row at or before that time, or the first row if there is none.

        time: flight time, s.
        width: largest width of a line, columns; a smaller value than `MIN_WIDTH` is raised to it.
        """
        columns = max(MIN_WIDTH, width)
        log, track = self.log, self.log.track
        k = max(0, int(np.searchsorted(track.time, time, side="right")) - 1)
        size = _WIDE if columns >= _WIDE.columns else _NARROW
        horizon_lines, readout_lines = self._draw_horizon(k, size.horizon), self._format_readouts(k)
        rows = max(len(horizon_lines), len(readout_lines))
        horizon_lines += [" " * (size.horizon + 2)] * (rows - len(horizon_lines))
        readout_lines += [""] * (rows - len(readout_lines))
        # The title with the time, a bar of the time flown, and the leg with the remaining distance.
        row_time, start_time = float(track.time[k]), float(track.time[0])
        title = _replace_control_characters(f"{log.setup.scenario.name}: {log.setup.aircraft}")
        clock = f"{row_time:8.1f} of {log.end_time:.1f} s"
        title_width = max(1, columns - len(clock))
        filled_columns = round((columns - 2) * (row_time - start_time) / max(log.end_time - start_time, 1e-9))
        bar = "[" + "=" * filled_columns + " " * (columns - 2 - filled_columns) + "]"
        leg, route, position = int(track.leg[k]), log.setup.route, track.position[k]
        leg_text = "after the last waypoint"
        if leg < route.legs:
            distance = float(np.hypot(*(route.positions[leg + 1, :2] - position[:2])))
            leg_text = (
                f"leg {route.leg_numbers[leg]} of {route.leg_numbers[-1] + 1}, to {waypoint_name(route, leg + 1)},"
                f" {_format_metres(distance)} to go"
            )
        lines = [title[: title_width - 1].ljust(title_width) + clock, bar, leg_text]
        lines += [
            f"{left_line}  {right_line}" for left_line, right_line in zip(horizon_lines, readout_lines, strict=True)
        ]
        threats = log.setup.scenario.threats
        distances = np.sqrt(((threats.position - position) ** 2).sum(axis=1))
        threats_in_reach = [
            f"{unit} {threats.names[m]} at {_format_metres(float(distances[m]))}"
            for unit, radii in (("MISSILE", threats.kill_radius), ("radar", threats.detection_radius))
            for m in np.flatnonzero((radii > 0.0) & (distances <= radii)).tolist()
        ]
        threats_text = _replace_control_characters(
            "within reach of: " + "; ".join(threats_in_reach) if threats_in_reach else "outside the reach of all units"
        )
        entry_count = bisect.bisect_right([entry.time for entry in self.entries], row_time + 1e-9)
        latest_lines = [
            f"{entry.time:8.1f} s  {entry.text}"
            for entry in self.entries[max(0, entry_count - _LATEST_ENTRIES) : entry_count]
        ]
        lines += [
            "",
            *self._format_control_lines(k, size.bar),
            threats_text,
            *latest_lines,
        ]
        return [shorten(line, columns).rstrip() for line in lines]

    def _draw_horizon(self, track_row: int, columns: int) -> list[str]:
        """Draw the artificial horizon as lines: sky (blank) above, ground (:) below, the wings in the center.

        track_row: index of the track's row.
        columns: width of the horizon without its edges.
        """
        roll, pitch, _ = (float(angle) for angle in self.log.track.attitude[track_row])
        rows = []
        for row in range(_HORIZON_ROWS):
            cells = []
            for column in range(columns):
                x = (column - columns // 2) / 2.0  # a letter is twice as high as wide
                y = _HORIZON_ROWS // 2 - row
                # Height of this cell above the rolled horizon, rows.
                elevation = y * math.cos(roll) + x * math.sin(-roll) + math.degrees(pitch) / _DEGREES_A_ROW
                cells.append("-" if abs(elevation) <= 0.5 else " " if elevation > 0.0 else ":")
            rows.append(cells)
        middle = rows[_HORIZON_ROWS // 2]
        for offset, mark in ((-5, "="), (-4, "="), (-3, "="), (0, "o"), (3, "="), (4, "="), (5, "=")):
            middle[columns // 2 + offset] = mark
        edge = "+" + "-" * columns + "+"
        return [edge, *("|" + "".join(cells) + "|" for cells in rows), edge]

    def _format_readouts(self, row: int) -> list[str]:
        """Return the lines next to the horizon: speeds, heights, attitude, path errors, wind and battery.

        row: index of the track's row.
        """
        track, setup = self.log.track, self.log.setup
        east, north, up = (float(value) for value in track.velocity[row])
        roll, pitch, yaw = (math.degrees(float(angle)) for angle in track.attitude[row])
        _, _, amsl = track.position[row].tolist()
        height_above_ground = amsl - float(self.ground[row])
        wind_east, wind_north, _ = (float(value) for value in track.wind[row])
        height = _format_metres(height_above_ground) if math.isfinite(height_above_ground) else "unknown"
        airspeed, commanded, load_factor, energy_used, current = (
            float(column[row])
            for column in (track.airspeed, track.speed_command, track.load_factor, track.energy, track.current)
        )
        return [
            f"airspeed     {_format_number(airspeed, 1)} m/s, commanded {_format_number(commanded, 1)}",
            f"ground speed {_format_number(math.hypot(east, north), 1)} m/s, climb {_format_number(up, 1, '+')} m/s",
            f"height       {_format_metres(amsl)} AMSL, {height} above ground",
            f"course       {_format_course(math.degrees(math.atan2(east, north)))}, heading {_format_course(yaw)}",
            f"roll, pitch  {_format_number(roll, 1, '+')}°, {_format_number(pitch, 1, '+')}°, "
            f"{_format_number(load_factor, 2)} g",
            f"off the path {_format_number(float(track.cross_track[row]), 1, '+')} m right, "
            f"{_format_number(float(track.height_error[row]), 1, '+')} m high",
            f"wind         {_format_number(math.hypot(wind_east, wind_north), 1)} m/s from "
            f"{_format_course(math.degrees(math.atan2(-wind_east, -wind_north)))}",
            f"battery      {_format_number(energy_used, 1)} of {_format_number(setup.battery, 0)} Wh used,"
            f" {_format_number(current, 1)} A",
        ]

    def _format_control_lines(self, row: int, bar_width: int) -> list[str]:
        """Return a line for each control: a bar with its position (O) and its command (|) between its limits.

        The bar of a surface without a limit ends at 30° on either side.

        row: index of the track's row.
        bar_width: width of the bar, columns.
        """
        lines = []
        controls = self.log.track.controls[row].tolist()
        commands = self.log.track.commands[row].tolist()
        for (name, limit), deflection, command in zip(self.limits, controls, commands, strict=True):
            is_throttle = name == "throttle"
            max_value = limit if math.isfinite(limit) else math.radians(30.0)
            cells = list("." * bar_width)
            if not is_throttle:
                cells[bar_width // 2] = "+"
            for value, symbol in ((command, "|"), (deflection, "O")):
                if math.isfinite(value):
                    position = value if is_throttle else 0.5 + 0.5 * value / max_value
                    cells[round((bar_width - 1) * min(max(position, 0.0), 1.0))] = symbol
            state_text = (
                f"{_format_number(100.0 * deflection, 0)} %"
                if is_throttle
                else f"{_format_number(math.degrees(deflection), 1, '+')}°"
            )
            limit_text = "  AT ITS LIMIT" if (command >= 1.0 if is_throttle else abs(command) >= max_value) else ""
            lines.append(f"{name:<9} [{''.join(cells)}] {state_text}{limit_text}")
        return lines


def make_instruments(log: FlightLog) -> Instruments:
    """Compute the legs, the timeline and the ground altitudes that the instruments of a log show.

    The legs are computed from the track; the recorded legs are not used.

    >>> from logs.recording.example_log import example_log
    >>> frame = make_instruments(example_log()).frame(10.0)
    >>> print(frame[2])
    leg 0 of 2, to waypoint 1 (item 2), 250 m to go
    >>> print(frame[5])
    |                         |  height       200 m AMSL, 100 m above ground
    """
    log = log_with_legs(log)
    terrain = log.setup.scenario.terrain
    position = log.track.position
    ground = np.full(len(log.track), math.nan)
    if terrain is not None:
        ground = np.asarray(terrain.height(position[:, 0], position[:, 1]), dtype=np.float64)
    return Instruments(log, tuple(timeline_of_legs(log)), ground, tuple(control_limits(log.setup.aircraft)))


def _replace_control_characters(text: str) -> str:
    """Replace unprintable characters by spaces, so that a text cannot control the terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _format_number(value: float, digits: int, sign: str = "") -> str:
    """Format a number with a fixed number of decimals; "?" if it is not finite.

    sign: "+" to write a plus sign before positive numbers and zero.
    """
    # Zero has no unwanted sign: "+0.0" or "0", never "-0".
    return f"{round(value, digits) + 0.0:{sign}.{digits}f}" if math.isfinite(value) else "?"


def _format_metres(value: float) -> str:
    """Format a length in whole metres, with the unit; "? m" if it is not finite."""
    return f"{_format_number(value, 0)} m"


def _format_course(degrees: float) -> str:
    """Format a course as three digits from 000° to 359°; "?" if it is not finite."""
    return f"{round(degrees) % 360:03d}°" if math.isfinite(degrees) else "?"
