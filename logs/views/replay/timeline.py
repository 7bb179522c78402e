"""List the timeline of a recorded flight: legs, turns, clearances, threats and events.

Legs and clearances are computed from the track, the route, the terrain and the threats in the log; recorded legs,
clearances and verdicts are not used.
"""

import itertools
import math
import textwrap
from dataclasses import dataclass, replace

import numpy as np

from flight.mission.route import Route
from flight.simulation.track import THROTTLE
from logs.recording.reader import FlightLog
from logs.verdict.measures.path_sweeps import segment_clearances, sphere_stays
from logs.verdict.measures.track_alignment import find_leg_ends, with_legs
from world.frames import to_geo
from world.geometry import leg_courses, leg_runs, leg_slopes, signed_turns

# Largest width of a line, columns.
WIDTH = 100
# The throttle is at a limit if it is within this tolerance of 0 or 1.
_THROTTLE_LIMIT_TOLERANCE = 1e-3
# Shortest time of the throttle at a limit that gets an entry, s.
_MIN_SATURATION_TIME_S = 2.0
# Kinds of entries, in the order in which entries at the same time are listed.
_ORDER = ("start", "turn", "leg", "ground", "threat", "throttle", "event", "end", "log")


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """One entry of a timeline.

    time: flight time, s.
    kind: subject of the entry, one of "start", "turn", "leg", "ground", "threat", "throttle", "event", "end", "log".
    text: text of printable characters.
    """

    time: float
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class _LegRows:
    """Successive rows of the track that were flown on one leg.

    leg: index of the leg.
    first, last: first and last row.
    """

    leg: int
    first: int
    last: int


def timeline(log: FlightLog) -> list[TimelineEntry]:
    """Return the timeline of a flight: its events and legs in chronological order.

    >>> from logs.recording.example_log import example_log
    >>> for entry in timeline(example_log())[3:6]:
    ...     print(entry.time, entry.kind, "-", entry.text)
    14.7... threat - inside the missile range of Alfa (300 m)
    20.0 turn - turn left 14.0° at waypoint 1 (item 2), peak bank 0.0°
    20.0 leg - leg 1 to waypoint 2 (item 3): course 076°, 412 m, slope +2.8°, 25.0 m/s
    """
    return timeline_of_legs(log_with_legs(log))


def log_with_legs(log: FlightLog) -> FlightLog:
    """Return the log with the recorded leg of each row replaced by the leg computed from the track."""
    return replace(log, track=with_legs(log.track, find_leg_ends(log.setup, log.track)))


def timeline_of_legs(log: FlightLog) -> list[TimelineEntry]:
    """List the entries of a flight like `timeline`, for a log that `log_with_legs` returned."""
    # The rows are split where the leg changes; rows outside the legs of the route are left out.
    track = log.track
    edges = np.flatnonzero(np.diff(track.leg)) + 1
    starts = [0, *edges.tolist()]
    stops = [*edges.tolist(), len(track)]
    all_parts = [_LegRows(int(track.leg[start]), start, stop - 1) for start, stop in zip(starts, stops, strict=True)]
    parts = [part for part in all_parts if 0 <= part.leg < log.setup.route.legs]
    setup = log.setup
    east, north, up = track.position[0].tolist()
    lat, lon = to_geo(setup.scenario.origin, east, north)
    scenario = "a mission without a scenario" if setup.scenario.external else f"scenario {setup.scenario.name}"
    place = f"from {float(lat):.5f}, {float(lon):.5f} at {up:.0f} m AMSL"
    if setup.imported_log is None:
        text = f"{setup.aircraft}, {scenario}, seed {setup.seed}; {place}. {setup.started}"
    else:
        # A real flight has neither a seed nor a trim.
        text = f"{setup.aircraft}, {scenario}; imported log {setup.imported_log.file}, {place}"
    entries = [TimelineEntry(float(track.time[0]), "start", text.strip())]
    entries += _list_leg_entries(log, parts)
    entries += _list_turn_entries(log, parts)
    entries += _list_clearance_entries(log, parts)
    # Each entry into and exit from the range of a missile or a radar.
    threats = setup.scenario.threats
    for k, name in enumerate(threats.names):
        for unit, radius in (("missile", threats.kill_radius[k]), ("radar", threats.detection_radius[k])):
            for stay in sphere_stays(track.time, track.position, threats.position[k], float(radius)):
                threat_range = f"the {unit} range of {name}"
                entries.append(TimelineEntry(stay.start, "threat", f"inside {threat_range} ({float(radius):.0f} m)"))
                # The track may end inside the range.
                side = "outside" if stay.whole else "still inside"
                stay_text = f"{stay.end - stay.start:.1f} s inside, closest {stay.closest:.0f} m"
                entries.append(TimelineEntry(stay.end, "threat", f"{side} {threat_range}: {stay_text}"))
    # Periods in which the throttle is full or closed.
    throttle = track.commands[:, THROTTLE]
    for name, is_held in (
        ("full", throttle >= 1.0 - _THROTTLE_LIMIT_TOLERANCE),
        ("closed", throttle <= _THROTTLE_LIMIT_TOLERANCE),
    ):
        padded = np.concatenate([[False], is_held, [False]])
        period_edges = np.flatnonzero(padded[1:] != padded[:-1])
        for first, end in zip(period_edges[::2].tolist(), period_edges[1::2].tolist(), strict=True):
            start_time = float(track.time[first])
            # A command holds until the next row.
            duration = float(track.time[min(end, len(track) - 1)]) - start_time
            if duration >= _MIN_SATURATION_TIME_S:
                entries.append(TimelineEntry(start_time, "throttle", f"{name} for {duration:.1f} s"))
    entries += [
        TimelineEntry(event.time, "event", event.text if event.level == "info" else f"{event.level}: {event.text}")
        for event in log.events
    ]
    # The end of the flight, with time, distance and energy; an imported log may contain no battery data.
    distance = float(np.nansum(np.sqrt((np.diff(track.position, axis=0) ** 2).sum(axis=1))))
    end_reason = log.ended if log.ended is not None else "not recorded"
    energy_used = float(track.energy[-1])
    energy_text = f", {energy_used:.1f} Wh from the battery" if math.isfinite(energy_used) else ""
    end_text = f"{end_reason}; {log.end_time:.1f} s, {distance / 1000.0:.2f} km{energy_text}"
    entries.append(TimelineEntry(log.end_time, "end", end_text))
    if not log.complete:
        entries.append(TimelineEntry(log.end_time, "log", f"the log is not complete: {log.problem}"))
    # Unprintable characters could control the terminal.
    clean_entries = [
        TimelineEntry(entry.time, entry.kind, "".join(letter if letter.isprintable() else " " for letter in entry.text))
        for entry in entries
    ]
    return sorted(clean_entries, key=lambda entry: (entry.time, _ORDER.index(entry.kind)))


def entry_lines(entry: TimelineEntry) -> list[str]:
    """Format an entry as lines of at most `WIDTH` columns: time (s), kind, and the wrapped text.

    >>> entry_lines(TimelineEntry(20.0, "turn", "turn left 14.0° at waypoint 1"))
    ['    20.00 s  turn     turn left 14.0° at waypoint 1']
    """
    head = f"{entry.time:9.2f} s  {entry.kind:<9}"
    return textwrap.wrap(
        head + entry.text, WIDTH, subsequent_indent=" " * len(head), drop_whitespace=True, break_on_hyphens=False
    )


def _group_by_loiter(parts: list[_LegRows], route: Route) -> list[list[_LegRows]]:
    """Group the parts of a flight: successive parts on legs of the same loiter together, all others alone.

    parts: rows flown on each leg, in order of time.
    """
    first_legs: list[int] = []
    for leg in range(route.legs):
        is_on_circle = min(route.arc_radii[leg : leg + 2]) > 0.0 and route.items[leg] == route.items[leg + 1]
        continues_loiter = (
            is_on_circle and leg and route.arc_radii[leg - 1] > 0.0 and route.items[leg - 1] == route.items[leg]
        )
        first_legs.append(first_legs[-1] if continues_loiter else leg)
    return [list(group) for _, group in itertools.groupby(parts, key=lambda part: first_legs[part.leg])]


def waypoint_name(route: Route, index: int) -> str:
    """Return the name of a waypoint: its stop number and, if it has one, its mission item.

    index: index of the waypoint in the route.
    """
    item = int(route.items[index])
    number = int(route.stops[index])
    return f"waypoint {number}" if item < 0 else f"waypoint {number} (item {item})"


def _list_leg_entries(log: FlightLog, parts: list[_LegRows]) -> list[TimelineEntry]:
    """Make an entry for the start of each leg, with course, length, slope and airspeed.

    The legs around a loiter share one entry.

    parts: rows flown on each leg, in order of time.
    """
    route = log.setup.route
    points = log.setup.display_waypoints
    courses, runs, slopes = leg_courses(points), leg_runs(points), leg_slopes(points)
    entries = []
    for group in _group_by_loiter(parts, route):
        part = group[0]
        leg = part.leg
        if len(group) > 1:
            item, radius = int(route.items[leg]), route.arc_radii[leg]
            item_text = f"return of item {item}" if leg in route.rtl_legs else f"loiter of item {item}"
            text = f"{item_text}: leg {route.leg_numbers[leg]} continues around its circle, radius {radius:.0f} m"
            entries.append(TimelineEntry(float(log.track.time[part.first]), "leg", text))
            continue
        course = round(math.degrees(courses[leg])) % 360
        text = (
            f"leg {route.leg_numbers[leg]} to {waypoint_name(route, leg + 1)}: course {course:03d}°, "
            f"{runs[leg]:.0f} m, slope {math.degrees(slopes[leg]):+.1f}°, {route.leg_airspeeds[leg]:.1f} m/s"
        )
        entries.append(TimelineEntry(float(log.track.time[part.first]), "leg", text))
    return entries


def _list_turn_entries(log: FlightLog, parts: list[_LegRows]) -> list[TimelineEntry]:
    """Make an entry for each change to the next leg: angle of the turn, and peak bank.

    The angle is the one by which the route turns.  The peak bank is the largest bank between the middles of the two
    legs.  Corners within a loiter have no entries.

    parts: rows flown on each leg, in order of time.
    """
    route, track = log.setup.route, log.track
    turns = signed_turns(route.positions)
    roll, _, _ = track.attitude.T
    bank = np.abs(roll.astype(np.float64))
    entries = []
    for previous, following in itertools.pairwise(parts):
        # The corners of a loiter share the entry of the loiter; a loiter that is left at once has a turn.
        is_same_item = route.items[max(0, following.leg - 1) : following.leg + 2] == route.items[following.leg]
        if following.leg != previous.leg + 1 or (route.arc_radii[following.leg] > 0.0 and is_same_item.sum() > 1):
            continue
        angle = math.degrees(turns[previous.leg])
        side = "right" if angle > 0.0 else "left"
        turn_bank = bank[(previous.first + previous.last) // 2 : (following.first + following.last) // 2 + 1]
        peak_bank = math.degrees(float(np.nanmax(turn_bank))) if np.isfinite(turn_bank).any() else math.nan
        text = f"turn {side} {abs(angle):.1f}° at {waypoint_name(route, following.leg)}, peak bank {peak_bank:.1f}°"
        entries.append(TimelineEntry(float(track.time[following.first]), "turn", text))
    return entries


def _list_clearance_entries(log: FlightLog, rows_by_leg: list[_LegRows]) -> list[TimelineEntry]:
    """Make an entry for the lowest height above ground on each leg.

    It says if this height is below the required clearance.  The legs around a loiter share one entry.  Without terrain,
    the only entry says so.

    rows_by_leg: rows flown on each leg, in order of time.
    """
    terrain, track = log.setup.scenario.terrain, log.track
    if terrain is None:
        return [TimelineEntry(float(track.time[0]), "ground", "no terrain in the log: clearance is unknown")]
    clearances, fractions = segment_clearances(terrain, track.position)
    required = log.setup.scenario.limits.min_clearance_m
    entries = []
    for group in _group_by_loiter(rows_by_leg, log.setup.route):
        leg_rows = replace(group[0], last=group[-1].last)
        name = f"leg {log.setup.route.leg_numbers[leg_rows.leg]}" + (", around its circle" if len(group) > 1 else "")
        # Segment k leads from row k to row k + 1; the segment into the next leg belongs to this leg.
        part_clearances = clearances[leg_rows.first : leg_rows.last + 1]
        if not np.isfinite(part_clearances).any():
            time = float(track.time[leg_rows.first])
            entries.append(TimelineEntry(time, "ground", f"{name}: no terrain data under it"))
            continue
        k = leg_rows.first + int(np.nanargmin(part_clearances))
        time = float(track.time[k] + fractions[k] * (track.time[k + 1] - track.time[k]))
        below_text = "" if clearances[k] >= required else f", below the required {required:.0f} m"
        known_text = "" if np.isfinite(part_clearances).all() else ", where there is terrain data"
        text = f"lowest height on {name}: {clearances[k]:.1f} m above ground{below_text}{known_text}"
        entries.append(TimelineEntry(time, "ground", text))
    return entries
