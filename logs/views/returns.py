"""Chart simulated returns to launch: outcome along the path, worst returns, lowest safe altitudes.

A return, here, is a simulated return to launch that starts at a point of the flown or planned path.
"""

from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.returns.drawn_returns import DrawnReturns, group_segments
from logs.verdict.returns.judge_glides import Glide, Reach
from logs.verdict.returns.judge_returns import KINDS, Kind, SimulatedReturn
from logs.verdict.returns.return_starts import planned_positions
from logs.verdict.returns.returns_text import outcome_text, segment_text
from logs.views.charts import Chart, Label, Layer, Panel, join_with_gaps, series, shorten
from logs.views.map import MapChart, NamedWind, end_labels, map_extent, scenario_map
from logs.views.profile import make_ground_bands, terrain_altitudes
from logs.views.threats_and_zones import PathPlane, threat_cuts, zone_bands
from world.arrays import Floats

# Role and name of a path segment by the outcome of returns from there; the safe outcome is drawn lowest.
_ROLES_AND_NAMES: dict[Kind, tuple[str, str]] = {
    kind: (f"return-{kind}", segment_text(kind)) for kind in reversed(KINDS)
}
# Smallest range of altitudes that a profile shows, m.
_MIN_SPAN = 100.0
# Number of drawn points of a path, and of ground samples under it.
_PATH_POINTS = 1200
# Smallest interval of the points of a planned path, s.
_MIN_STEP_S = 0.2

Key = TypeVar("Key", bound=str)
Element = TypeVar("Element")


class PathPoint(NamedTuple, Generic[Element]):
    """A point of the flown or planned path, with the judged element that is nearest in time.

    time: flight time, s.
    position: east, north and altitude, m, (3,).
    element: judged element, such as a return or a glide.
    """

    time: float
    position: Floats
    element: Element


def split_judged_path(
    setup: FlightSetup,
    track: Track | None,
    elements: Sequence[Element],
    time_of: Callable[[Element], float],
    key_of: Callable[[Element], Key],
) -> list[tuple[Key, list[PathPoint[Element]]]]:
    """Split the path into segments with the same judgment, such as the same outcome of a return.

    Each point of the path gets the judged element that is nearest in time; a segment ends where the key of the element
    changes.  Return the key and the points of each segment, in order of time; [] without elements.  Each segment except
    the last also has the first point of the next segment, so that there are no gaps.

    track: flown track; None for the planned path.
    elements: judged elements, such as returns, in order of time, at most one at a time.
    time_of: function that returns the flight time of an element, s.
    key_of: function that returns the key of an element, such as the outcome of a return.
    """
    if not elements:
        return []
    times = np.array([time_of(element) for element in elements])
    # The first and the last element also apply to half an interval of the path before and after them.
    margin = 0.5 * float(np.diff(times).max(initial=0.0))
    first, last = float(times[0]) - margin, float(times[-1]) + margin
    if track is None:
        path_times, positions = planned_positions(setup, max(_MIN_STEP_S, (last - first) / _PATH_POINTS))
        is_shown = (path_times >= first) & (path_times <= last)
        path_times, positions = path_times[is_shown], positions[is_shown]
    else:
        is_shown = np.isfinite(track.position).all(axis=1) & (track.time >= first) & (track.time <= last)
        rows = np.flatnonzero(is_shown)
        rows = rows[:: max(1, len(rows) // _PATH_POINTS)]
        path_times, positions = track.time[rows], track.position[rows]
    nearest = np.searchsorted(0.5 * (times[1:] + times[:-1]), path_times)
    points = [PathPoint(float(path_times[k]), positions[k], elements[nearest[k]]) for k in range(len(path_times))]
    return group_segments(points, lambda point: key_of(point.element))


def path_layers(
    segments: Sequence[tuple[Key, Sequence[Element]]],
    roles_and_names: dict[Key, tuple[str, str]],
    position_of: Callable[[Element], tuple[float, float]],
    text_of: Callable[[Element], str],
) -> list[Layer]:
    """Return line layers of a path whose segments are coloured by their key.

    There is one layer for each role and name.

    segments: key and points of each segment of the path.
    roles_and_names: role and legend text of each key, in the order of the layers.
    position_of: function that returns the coordinates of a point on the chart, (x, y).
    text_of: function that returns the hover text of a point.
    """
    layers = []
    for role, name in dict.fromkeys(roles_and_names.values()):
        matching_segments = [elements for kind, elements in segments if roles_and_names[kind] == (role, name)]
        x, y = join_with_gaps(
            [np.array([position_of(element) for element in elements]) for elements in matching_segments]
        )
        texts = [text for elements in matching_segments for text in (*map(text_of, elements), "")]
        layers.append(Layer("line", name, role, x, y, hover_texts=tuple(texts)))
    return [layer for layer in layers if layer.x.size]


def returns_map(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> MapChart:
    """Make a map of the path, coloured by the outcome of returns from it, and of the worst returns.

    track: flown track; None if the returns start on the planned path.
    """
    scenario, route = setup.scenario, setup.route.positions
    limit = drawn_returns.returns.limit

    def describe_return(ret: SimulatedReturn) -> str:
        """Return the hover text of a return: start time, target and outcome."""
        return f"{ret.time:.0f} s: to {ret.target.name}: {outcome_text(ret, limit)}"

    segments = split_path_by_outcome(setup, drawn_returns, track)
    layers = path_layers(segments, _ROLES_AND_NAMES, east_and_north, lambda point: describe_return(point.element))
    for worst in drawn_returns.worst:
        name = "path of one of the worst returns, numbered"
        layers.append(
            Layer(
                "line",
                name,
                "return-way",
                worst.path[:, 0],
                worst.path[:, 1],
                hover_texts=(describe_return(worst.simulated),),
            )
        )
    unsafe = [worst for worst in drawn_returns.worst if not worst.simulated.safe]
    if unsafe:
        positions = np.array([worst.marked_position for worst in unsafe])
        texts = tuple(describe_return(worst.simulated) for worst in unsafe)
        layers.append(Layer("rings", "where it fails", "fail", positions[:, 0], positions[:, 1], hover_texts=texts))
    targets = {ret.target.name: ret.target.position for ret in drawn_returns.returns.each}
    if targets:
        east, north, _ = np.array(list(targets.values())).T
        layers += [Layer("dots", "return targets", "waypoint", east, north, hover_texts=tuple(targets))]
    labels = [
        Label(str(number), float(worst.marked_position[0]), float(worst.marked_position[1]), "number", "fail")
        for number, worst in enumerate(drawn_returns.worst, 1)
    ]
    labels += [
        Label(shorten(name, 30), position[0], position[1], "end", "waypoint", (1, 1))
        for name, position in targets.items()
    ]
    paths = [worst.path for worst in drawn_returns.worst] + [np.array(list(targets.values()) or np.zeros((0, 3)))]
    extent = map_extent(scenario, route, [*paths, np.array([ret.start for ret in drawn_returns.returns.each])])
    return scenario_map(
        scenario,
        "returns to launch from points along the route",
        layers,
        [*labels, *end_labels(scenario, route, setup.route.items.tolist())],
        extent,
        route=route,
        winds=(NamedWind(scenario.wind),),
    )


def east_and_north(point: PathPoint[Any]) -> tuple[float, float]:
    """Return east and north of a point of the path, m."""
    return float(point.position[0]), float(point.position[1])


def split_path_by_outcome(
    setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None
) -> list[tuple[Kind, list[PathPoint[SimulatedReturn]]]]:
    """Split the path into segments by the outcome of the return that starts nearest in time.

    Return the outcome and the points of each segment, see `split_judged_path`.

    track: flown track; ignored if the returns start on the planned path.
    """
    flown_track = track if drawn_returns.returns.flown else None
    return split_judged_path(
        setup, flown_track, drawn_returns.worst_by_start, lambda ret: ret.time, lambda ret: ret.kind
    )


def split_path_by_reach(
    setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None
) -> list[tuple[Reach, list[PathPoint[Glide]]]]:
    """Split the path into segments by the best destination of the glide that starts nearest in time.

    Return the destination and the points of each segment, see `split_judged_path`.

    track: flown track; ignored if the glides start on the planned path.
    """
    flown_track = track if drawn_returns.returns.flown else None
    glides = drawn_returns.glides.each
    return split_judged_path(setup, flown_track, glides, lambda glide: glide.time, lambda glide: glide.reach)


# ----------------------------------------------------------------------
# The worst returns in profile.


def worst_returns_chart(setup: FlightSetup, drawn_returns: DrawnReturns) -> Chart | None:
    """Chart altitude and ground along each of the worst returns, in a panel for each return.

    Return None if there are no worst returns.
    """
    if not drawn_returns.worst:
        return None
    scenario = setup.scenario
    # All panels show the same range of altitudes, which contains all paths and the ground under them, with a margin, m.
    spans = []
    for worst in drawn_returns.worst:
        ground = terrain_altitudes(scenario, worst.path)
        altitudes = np.concatenate([worst.path[:, 2], np.zeros(0) if ground is None else ground])
        min_altitude, max_altitude = float(np.nanmin(altitudes)), float(np.nanmax(altitudes))
        margin = 0.1 * max(max_altitude - min_altitude, _MIN_SPAN)
        spans.append((min_altitude - margin, max_altitude + margin))
    span = (min(bottom for bottom, _ in spans), max(top for _, top in spans))
    panels = []
    for number, worst in enumerate(drawn_returns.worst, 1):
        path = worst.path
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))]) / 1000.0
        plane = PathPlane(along, path, terrain_altitudes(scenario, path), *span)
        zones, zone_labels = zone_bands(scenario.zones, plane)
        cuts, cut_names = threat_cuts(scenario.threats, plane, frozenset())
        layers = [*zones, *cuts, *make_ground_bands(scenario, plane)]
        layers.append(Layer("line", "path of the return", "return-way", along, path[:, 2]))
        if not worst.simulated.safe:
            nearest_row = int(np.argmin(np.linalg.norm(path - worst.marked_position, axis=1)))
            layers.append(
                Layer("rings", "where it fails", "fail", along[[nearest_row]], worst.marked_position[[2]], quiet=True)
            )
        title = f"{number}: from {worst.simulated.time:.0f} s"
        note = segment_text(worst.simulated.kind).removeprefix("a return ")
        labels = (*cut_names, *zone_labels)
        panels.append(Panel(title, "m AMSL", tuple(layers), span=span, note=note, labels=labels))
    return Chart(
        f"{shorten(scenario.name, 60)}: the worst returns to launch",
        "distance since it turned back",
        "km",
        tuple(panels),
        page_height=240,
        print_height=2.3,
        legend="below",
        scaled=True,
    )


# ----------------------------------------------------------------------
# Heights over time.


def return_heights_chart(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> Chart | None:
    """Chart altitude, lowest safe altitude for a return, and altitude to spare of glides over time.

    The path's altitude is coloured by the outcome of a return from there.  Return None if no returns were judged.

    track: flown track; None if the returns start on the planned path.
    """
    if not drawn_returns.returns.each:
        return None
    scenario, limit = setup.scenario, drawn_returns.returns.limit
    segments = split_path_by_outcome(setup, drawn_returns, track)
    points = [point for _, segment in segments for point in segment]
    time = np.array([point.time for point in points])
    positions = np.array([point.position for point in points])
    ground, safe_altitudes = terrain_altitudes(scenario, positions), drawn_returns.min_safe_altitudes
    altitudes = np.concatenate([positions[:, 2], safe_altitudes.altitude, np.zeros(0) if ground is None else ground])
    min_altitude, max_altitude = float(np.nanmin(altitudes)), float(np.nanmax(altitudes))
    margin = 0.06 * max(max_altitude - min_altitude, _MIN_SPAN)
    span = (min_altitude - margin, max_altitude + margin)
    name = f"lowest altitude for a safe return (no line: not safe even {safe_altitudes.search_range:.0f} m higher)"
    layers = [
        *make_ground_bands(scenario, PathPlane(time, positions, ground, *span)),
        *path_layers(
            segments,
            _ROLES_AND_NAMES,
            lambda point: (point.time, float(point.position[2])),
            lambda point: outcome_text(point.element, limit),
        ),
        Layer("line", name, "limit", safe_altitudes.time, safe_altitudes.altitude),
    ]
    panels = [Panel("altitude", "m AMSL", tuple(layers), span=span)]
    glides = drawn_returns.glides
    if glides.each:
        # Altitude to spare of glides without the engine, by destination.  The wider line is below, so that both are
        # seen where they coincide.
        home_margins = [glide.home_altitude_left for glide in glides.each]
        flat_margins = [glide.flat_altitude_left for glide in glides.each]
        home_name = "to spare for home"
        lines = []
        if len(glides.sites) > 1:
            site_margins = [glide.site_altitude_left for glide in glides.each]
            if np.array_equal(site_margins, home_margins, equal_nan=True):
                home_name = "to spare for home, and for a rally point or landing place there"
            else:
                lines.append(("to spare for a rally point or landing place", "left-site", site_margins))
        lines += [(home_name, "left-home", home_margins), ("to spare for flat ground", "left-flat", flat_margins)]
        glide_times = np.array([glide.time for glide in glides.each])
        margin_layers = tuple(
            series(line_name, role, glide_times, np.where(np.isfinite(margins), margins, np.nan))
            for line_name, role, margins in lines
        )
        limits = (("nothing to spare", 0.0),)
        title = "altitude to spare without the engine"
        panels.append(Panel(title, "m", margin_layers, limits, min_span=_MIN_SPAN))
    return Chart(
        f"{shorten(scenario.name, 60)}: return to launch, or engine failure",
        "time since the start",
        "s",
        tuple(panels),
        timed=True,
        page_height=300,
        print_height=2.8,
        legend="below",
    )
