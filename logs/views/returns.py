"""Chart returns to launch: path by outcome, profiles of the worst returns, and minimum start heights."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.returns.drawn_returns import DrawnReturns, WorstReturn
from logs.verdict.returns.judge_glides import Glides
from logs.verdict.returns.judge_returns import KINDS, Kind, ReturnFlown
from logs.verdict.returns.returns_text import outcome_text, way_text
from logs.views.charts import Chart, Label, Layer, Panel, parted, series, shorten
from logs.views.map import MapChart, NamedWind, end_labels, map_extent, world_map
from logs.views.profile import ground_bands, ground_under
from logs.views.threats_and_zones import PathPlane, threat_cuts, zone_bands
from world.arrays import Floats
from world.scenario import Scenario

# Role and name of the path by outcome of the returns; the safe outcome is drawn lowest.
_LOOKS: dict[Kind, tuple[str, str]] = {kind: (f"return-{kind}", way_text(kind)) for kind in reversed(KINDS)}
# Smallest range of altitudes that a profile shows, m.
_MIN_SPAN = 100.0
# Number of ground samples under a flight.
_GROUND_POINTS = 1200

Key = TypeVar("Key", bound=str)
One = TypeVar("One")


def way_layers(
    stretches: Sequence[tuple[Key, Sequence[One]]],
    looks: dict[Key, tuple[str, str]],
    place: Callable[[One], tuple[float, float]],
    words: Callable[[One], str],
) -> list[Layer]:
    """Return the path in one layer for each look, in the order of the looks.

    looks: role and name of each kind of stretch.  place: coordinates of a point.  words: text of the page on a point.
    """
    layers = []
    for role, name in dict.fromkeys(looks.values()):
        chosen = [ones for kind, ones in stretches if looks[kind] == (role, name)]
        x, y = parted([np.array([place(one) for one in ones]) for ones in chosen])
        said = [text for ones in chosen for text in (*map(words, ones), "")]
        layers.append(Layer("line", name, role, x, y, words=tuple(said)))
    return [layer for layer in layers if layer.x.size]


def returns_map(setup: FlightSetup, drawn: DrawnReturns) -> MapChart:
    """Return the path from above, coloured by the outcome of returns, and the paths of the worst returns."""
    scenario, route = setup.scenario, setup.route.waypoints
    limit = drawn.returns.limit

    def said(one: ReturnFlown) -> str:
        return f"{one.time:.0f} s: to {one.target.name}: {outcome_text(one, limit)}"

    layers = way_layers(drawn.by_kind, _LOOKS, lambda one: one.start[:2], said)
    for one in drawn.worst:
        name = "path of one of the worst returns, numbered"
        layers.append(Layer("line", name, "return-way", one.way[:, 0], one.way[:, 1], words=(said(one.one),)))
    wrong = [one for one in drawn.worst if not one.one.safe]
    if wrong:
        at = np.array([one.at for one in wrong])
        words = tuple(said(one.one) for one in wrong)
        layers.append(Layer("rings", "where it goes wrong", "fail", at[:, 0], at[:, 1], words=words))
    targets = {one.target.name: one.target.position for one in drawn.returns.each}
    layers += _targets(targets)
    labels = [
        Label(str(number), float(one.at[0]), float(one.at[1]), "number", "fail")
        for number, one in enumerate(drawn.worst, 1)
    ]
    labels += [
        Label(shorten(name, 30), place[0], place[1], "end", "waypoint", (1, 1)) for name, place in targets.items()
    ]
    ways = [one.way for one in drawn.worst] + [np.array(list(targets.values()) or np.zeros((0, 3)))]
    extent = map_extent(scenario, route, [*ways, np.array([one.start for one in drawn.returns.each])])
    return world_map(
        scenario,
        "returns to launch from points along the route",
        layers,
        [*labels, *end_labels(scenario, route)],
        extent,
        route=route,
        winds=(NamedWind(scenario.wind),),
    )


def _targets(targets: dict[str, tuple[float, float, float]]) -> list[Layer]:
    if not targets:
        return []
    east, north, _ = np.array(list(targets.values())).T
    return [Layer("dots", "where it returns to", "waypoint", east, north, words=tuple(targets))]


# ----------------------------------------------------------------------
# The worst returns in profile.


def worst_returns_chart(setup: FlightSetup, drawn: DrawnReturns) -> Chart | None:
    """Return altitude profiles of the worst returns with the ground below, one panel each.

    Return None without returns.
    """
    if not drawn.worst:
        return None
    scenario = setup.scenario
    spans = [_span(scenario, one) for one in drawn.worst]
    span = (min(low for low, _ in spans), max(high for _, high in spans))
    panels = tuple(_profile(scenario, one, number, span) for number, one in enumerate(drawn.worst, 1))
    return Chart(
        f"{shorten(scenario.name, 60)}: the worst returns to launch",
        "distance since it turned back",
        "km",
        panels,
        tall=240,
        inches=2.3,
        legend="below",
        scaled=True,
    )


def _span(scenario: Scenario, one: WorstReturn) -> tuple[float, float]:
    """Return lowest and highest altitude of a path and the ground under it, with a margin, m."""
    ground = ground_under(scenario, one.way)
    heights = np.concatenate([one.way[:, 2], np.zeros(0) if ground is None else ground])
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    margin = 0.1 * max(high - low, _MIN_SPAN)
    return low - margin, high + margin


def _profile(scenario: Scenario, one: WorstReturn, number: int, span: tuple[float, float]) -> Panel:
    way = one.way
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way[:, :2], axis=0).T))]) / 1000.0
    plane = PathPlane(along, way, ground_under(scenario, way), *span)
    zones, zone_names = zone_bands(scenario.zones, plane)
    cuts, cut_names = threat_cuts(scenario.threats, plane, frozenset())
    layers = [*zones, *cuts, *ground_bands(scenario, plane)]
    layers.append(Layer("line", "path of the return", "return-way", along, way[:, 2]))
    if not one.one.safe:
        nearest = int(np.argmin(np.linalg.norm(way - one.at, axis=1)))
        layers.append(Layer("rings", "where it goes wrong", "fail", along[[nearest]], one.at[[2]], quiet=True))
    when = f"{number}: from {one.one.time:.0f} s"
    note = way_text(one.one.kind).removeprefix("a return ")
    return Panel(when, "m AMSL", tuple(layers), span=span, note=note, labels=(*cut_names, *zone_names))


# ----------------------------------------------------------------------
# Heights over time.


def return_heights_chart(setup: FlightSetup, drawn: DrawnReturns, track: Track | None) -> Chart | None:
    """Chart flown altitudes by outcome of a return, minimum safe altitudes, and margins of glides, over time.

    None if no returns were judged.
    """
    if not drawn.returns.each:
        return None
    scenario, limit = setup.scenario, drawn.returns.limit
    time, places = _flown_places(drawn, track)
    ground, least = ground_under(scenario, places), drawn.least
    heights = np.concatenate([places[:, 2], least.height, np.zeros(0) if ground is None else ground])
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    margin = 0.06 * max(high - low, _MIN_SPAN)
    span = (low - margin, high + margin)
    name = f"least height for a safe return (no line: none up to {least.searched:.0f} m more)"
    layers = [
        *ground_bands(scenario, PathPlane(time, places, ground, *span)),
        *way_layers(drawn.by_kind, _LOOKS, lambda one: (one.time, one.start[2]), lambda one: outcome_text(one, limit)),
        Layer("line", name, "limit", least.time, least.height),
    ]
    panels = [Panel("height", "m AMSL", tuple(layers), span=span)]
    if drawn.glides.each:
        panels.append(_glide_margin_panel(drawn.glides))
    return Chart(
        f"{shorten(scenario.name, 60)}: called home, or without its engine",
        "time since the start",
        "s",
        tuple(panels),
        timed=True,
        tall=300,
        inches=2.8,
        legend="below",
    )


def _flown_places(drawn: DrawnReturns, track: Track | None) -> tuple[Floats, Floats]:
    """Return times, s, (t,), and positions, m, (t, 3), of the path, from the track or from the starts of returns."""
    first, last = drawn.returns.each[0].time, max(one.time for one in drawn.returns.each)
    if track is not None and drawn.returns.flown:
        whole = np.isfinite(track.position).all(axis=1) & (track.time >= first) & (track.time <= last)
        rows = np.flatnonzero(whole)
        rows = rows[:: max(1, len(rows) // _GROUND_POINTS)]
        if rows.size:
            return track.time[rows], track.position[rows]
    ones = [one for _, group in drawn.by_kind for one in group]
    return np.array([one.time for one in ones]), np.array([one.start for one in ones])


def _glide_margin_panel(glides: Glides) -> Panel:
    """Return a panel of the height margin over time for destinations within reach without the engine."""
    time = np.array([one.time for one in glides.each])

    def line(name: str, role: str, values: list[float]) -> Layer:
        column = np.array(values)
        return series(name, role, time, np.where(np.isfinite(column), column, np.nan))

    layers = [line("left over for home", "left-home", [one.left[0] for one in glides.each])]
    if len(glides.sites) > 1:
        best = [max(one.left[1:]) for one in glides.each]
        layers.append(line("left over for a rally point or landing place", "left-site", best))
    layers.append(line("left over for flat ground", "left-flat", [one.flat for one in glides.each]))
    limits = (("nothing left over", 0.0),)
    return Panel("height left over without the engine", "m", tuple(layers), limits, min_span=_MIN_SPAN)
