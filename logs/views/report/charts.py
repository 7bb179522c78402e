"""A chart as plain data: panels of lines, bands, bars and dots with names, looks and units; the page's script draws it.

A look is a word ("planned", "missile"), never a colour: the page has one set of colours for light and one for dark.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.foxglove_scene import SPAN, model_colours, model_corners
from logs.verdict.findings import Verdict
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.places import Place
from logs.verdict.wording import place_text
from logs.views import drawing
from logs.views.compare_charts import NamedFlight, comparison_stack
from logs.views.envelope import envelope_lines, flown_moments
from logs.views.failures import Failures, paths_differ
from logs.views.scene import drawn_rows, scene_bounds, scene_data
from logs.views.threats_and_zones import kill_radius_at_path
from logs.views.time_series import Axis, Panel, Series, Stack
from logs.views.turns import PLACE_PANELS, PlaceValue, place_values
from world.geometry import leg_slopes

Floats = NDArray[np.float64]


LayerKind = Literal["line", "band", "bars", "dots", "rings", "dashes"]
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Layer:
    """One thing that a panel shows.

    kind: "dashes" are short level strokes, "rings" mark what fails; "band" is filled from `low` up to `y`.
    name: in legend and read-out; "" leaves it out of both.
    look: how it looks, a word of the page's style.
    x, y: (n,) in the panel's units; not-a-number parts a line.
    low: (n,) lower edge of a band.
    width: of a line, pixels.
    dashed: whether a line is.
    quiet: it is in the legend and not in the read-out.
    legend: what the legend calls it, where that stands for several; "" for its name.
    """

    kind: LayerKind
    name: str
    look: str
    x: Floats
    y: Floats
    low: Floats | None = None
    width: float = 1.5
    dashed: bool = False
    quiet: bool = False
    legend: str = ""


@dataclass(frozen=True, slots=True)
class ChartPanel:
    """Layers over one pair of axes.

    title: of the upright axis, without its unit.
    unit: of what is shown upwards; "" for none.
    layers: from the lowest.
    limits: level lines, label and value.
    span: the range shown upwards, (low, high); None for what the layers need.
    along: of the level axis where the panels share none, else "".
    note: what the panel does not show; "" for nothing.
    """

    title: str
    unit: str
    layers: tuple[Layer, ...]
    limits: tuple[tuple[str, float], ...] = ()
    span: tuple[float, float] | None = None
    along: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Chart:
    """Panels one above the other.

    along, unit: what the level axis shows, and its unit, of panels that share one.
    panels: from the top.
    shared: whether the panels share the level axis: zoomed and read out together.
    marks: where legs begin, as value along the axis and words.
    timed: whether the level axis is the time of flight, so that a click on it can move the aircraft there.
    tall: height of a panel, pixels.
    """

    along: str
    unit: str
    panels: tuple[ChartPanel, ...]
    shared: bool = True
    marks: tuple[tuple[float, str], ...] = ()
    timed: bool = False
    tall: int = 120


def numbers(values: Iterable[float], digits: int) -> list[float | None]:
    """Numbers for JSON: rounded, None for what is not finite.

    >>> numbers([1.26, math.nan], 1)
    [1.3, None]
    """
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return [value if math.isfinite(value) else None for value in rounded.tolist()]


def telling_digits(values: Floats) -> int:
    """Decimals that show a ten-thousandth of the range of values: as fine as a screen can.

    >>> telling_digits(np.array([0.0, 90.0])), telling_digits(np.array([0.001, 0.002]))
    (3, 7)
    """
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    span = span or (float(abs(finite[0])) if finite.size else 0.0) or 1.0
    return max(0, min(9, 4 - math.floor(math.log10(span) + 1e-9)))


def chart_json(chart: Chart) -> Json:
    """The chart as what JSON can hold.

    >>> line = Layer("line", "flown", "flown", np.array([0.0, 1.0]), np.array([2.0, np.nan]))
    >>> made = chart_json(Chart("time", "s", (ChartPanel("bank", "°", (line,)),)))
    >>> made["panels"][0]["layers"][0]["y"]
    [2.0, None]
    """
    return {
        "along": chart.along,
        "unit": chart.unit,
        "shared": chart.shared,
        "timed": chart.timed,
        "tall": chart.tall,
        "marks": [[round(value, 3), words] for value, words in chart.marks],
        "panels": [_panel_json(panel) for panel in chart.panels],
    }


def _panel_json(panel: ChartPanel) -> Json:
    found: Json = {
        "title": panel.title,
        "unit": panel.unit,
        "along": panel.along,
        "note": panel.note,
        "limits": [[label, round(value, 4)] for label, value in panel.limits if math.isfinite(value)],
        "layers": [_layer_json(layer) for layer in panel.layers if np.isfinite(layer.y).any()],
    }
    return found if panel.span is None else found | {"span": numbers(panel.span, 4)}


def _layer_json(layer: Layer) -> Json:
    found: Json = {
        "kind": layer.kind,
        "name": layer.name,
        "look": layer.look,
        "x": numbers(layer.x, telling_digits(layer.x)),
        "y": numbers(layer.y, telling_digits(layer.y)),
        "width": layer.width,
    }
    if layer.low is not None:
        found["low"] = numbers(layer.low, telling_digits(layer.low))
    rarer = {"dashed": layer.dashed, "quiet": layer.quiet, "legend": layer.legend}
    return found | {word: value for word, value in rarer.items() if value}


# ----------------------------------------------------------------------
# The flight moment by moment: what slider, read-out and the map's line say of it.

MAX_MOMENTS = 2000


def flight_moments(
    setup: FlightSetup, track: Track, *, name: str = "flown", look: str = "flown", dashed: bool = False
) -> dict[str, Any]:
    """Columns of at most `MAX_MOMENTS` rows of a flight, from its first to its last known place.

    time (s); east, north, up (m AMSL), above (m above ground, null without terrain); airspeed, climb (m/s); bank (right
    positive), pitch, heading (°); leg.  What is not a number is null.  Beside them legs: what each leg is called.
    name, look, dashed: of its line.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> moments = flight_moments(log.setup, log.track)
    >>> len(moments["time"]) == len(moments["leg"]), moments["name"]
    (True, 'flown')
    """
    rows = drawn_rows(track, MAX_MOMENTS)
    position, terrain = track.position[rows], setup.scenario.terrain
    east, north, up = position.T
    above = np.full(len(rows), np.nan) if terrain is None else up - terrain.height(east, north)
    roll, pitch, yaw = np.degrees(track.attitude[rows].astype(np.float64)).T
    _, _, climb = track.velocity[rows].T
    return {
        "name": name,
        "look": look,
        "dashed": dashed,
        "time": numbers(track.time[rows], 2),
        "east": numbers(east, 1),
        "north": numbers(north, 1),
        "up": numbers(up, 1),
        "above": numbers(above, 1),
        "airspeed": numbers(track.airspeed[rows], 2),
        "climb": numbers(climb, 2),
        "bank": numbers(roll, 1),
        "pitch": numbers(pitch, 1),
        "heading": numbers(yaw % 360.0, 1),
        "leg": track.leg[rows].tolist(),
        "legs": leg_names(setup),
    }


def leg_names(setup: FlightSetup) -> list[str]:
    """What each leg is called, with the mission item that it leads to.

    >>> from logs.recording.example_log import example_log
    >>> leg_names(example_log().setup)[0]
    'leg 0, to item 2'
    """
    items = setup.route.items.tolist()
    return [place_text(Place("leg", k, to_item=_known(items[k + 1]))) for k in range(setup.route.legs)]


def waypoint_names(setup: FlightSetup) -> list[str]:
    """What each waypoint is called, with its mission item and height."""
    heights = setup.route.waypoints[:, 2].tolist()
    return [
        f"{place_text(Place('waypoint', k, item=_known(item)))}<br>{heights[k]:.0f} m AMSL"
        for k, item in enumerate(setup.route.items.tolist())
    ]


def _known(item: int) -> int | None:
    return item if item >= 0 else None


def aircraft_model() -> dict[str, Any]:
    """The log's aircraft: corners of its triangles, forward, left and up, one unit wide, and each one's colour."""

    def rounded(values: NDArray[np.float32]) -> Any:
        return np.round(values.astype(np.float64), 4).tolist()

    return {"corners": rounded(model_corners() / SPAN), "colours": rounded(model_colours()[:, :3])}


def position_text(lat_deg: float, lon_deg: float) -> str:
    """A place as its axis names it.

    >>> position_text(46.0, -8.5)
    '46.0000°, −8.5000°'
    """
    return f"{lat_deg:.4f}°, {lon_deg:.4f}°".replace("-", "\N{MINUS SIGN}") if math.isfinite(lat_deg) else ""


# ----------------------------------------------------------------------
# The charts over time and distance: the panels of the drawn pictures, to be pointed at.

# What a colour of the pictures stands for.
LOOKS = {
    drawing.FLOWN: "flown", drawing.PLANNED: "planned", drawing.LIMIT: "commanded", drawing.MISSILE: "missile",
    drawing.RADAR: "radar", drawing.BLUE: "second", drawing.FAIL: "fail",
}  # fmt: skip
# Blocks that a series is thinned to; each keeps its lowest and highest row.
_BLOCKS = 600


def stack_chart(stack: Stack) -> Chart:
    """Make a chart of a stack of panels; those without a value are left out.

    >>> from logs.views.time_series import Axis, Panel, Series
    >>> along = Axis("time since the start (s)", np.array([0.0, 1.0]))
    >>> chart = stack_chart(Stack("a flight", [Panel("bank (°)", [Series("flown", along.values)])], along, None))
    >>> chart.along, chart.unit, chart.panels[0].title, chart.panels[0].unit
    ('time since the start', 's', 'bank', '°')
    """
    along, unit = parted_unit(stack.axis.label)
    panels = tuple(_panel(panel, stack.axis) for panel in stack.shown())
    marks = () if stack.track is None else _legs(stack.track, stack.axis.values)
    return Chart(along, unit, panels, marks=marks, timed=unit == "s")


def parted_unit(label: str) -> tuple[str, str]:
    """An axis' label as words and unit, which stands in parentheses at its end; "" for a unit of 1.

    >>> parted_unit("bank, right + (°)"), parted_unit("kill strength (1)"), parted_unit("name")
    (('bank, right +', '°'), ('kill strength', ''), ('name', ''))
    """
    words, bracket, unit = " ".join(label.split()).rpartition(" (")
    if not bracket:
        return unit, ""
    unit = unit.removesuffix(")")
    return words, "" if unit == "1" else unit


def _panel(panel: Panel, axis: Axis) -> ChartPanel:
    title, unit = parted_unit(panel.title)
    layers = [_layer(line, axis.values) for line in panel.series]
    held = panel.held
    if held is not None and held.any():
        layers.insert(0, _held(held, panel, axis.values))
    limits = tuple((" ".join(label.split()), value) for label, value in panel.limits)
    return ChartPanel(title, unit, tuple(layers), limits, span=_span(panel))


def _layer(line: Series, along: Floats) -> Layer:
    rows = drawing.outline_rows(line.values, _BLOCKS)
    x, y = along[rows], line.values[rows]
    look = LOOKS[line.color]
    low = np.zeros(len(y)) if line.filled else None
    kind: LayerKind = "band" if line.filled else "line"
    dashed = line.dashes != "-"
    return Layer(kind, line.label, look, x, y, low, width=max(1.2, line.width), dashed=dashed)


def _held(held: NDArray[np.bool_], panel: Panel, along: Floats) -> Layer:
    """The stretches at the limit as a band over the whole panel; not-a-number parts them."""
    low, high = _span(panel)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    starts, ends = along[edges[::2]], along[edges[1::2] - 1]
    gap = np.full(len(starts), np.nan)
    x = np.column_stack([starts, ends, ends]).ravel()
    y = np.column_stack([np.full(len(starts), high), np.full(len(starts), high), gap]).ravel()
    return Layer("band", "held at its limit", "fail", x, y, np.full(len(x), low), width=0.0, quiet=True)


def _span(panel: Panel) -> tuple[float, float]:
    """The range of values and limits, no less than the panel's least, with some room."""
    values = [value for _, value in panel.limits if np.isfinite(value)]
    for line in panel.series:
        finite = line.values[np.isfinite(line.values)]
        values += [float(finite.min()), float(finite.max())] if finite.size else []
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    widening = max(0.0, panel.least_span - (high - low)) / 2
    room = 0.08 * (high - low + 2 * widening)
    return low - widening - room, high + widening + room


def _legs(track: Track, along: Floats) -> tuple[tuple[float, str], ...]:
    """Where each leg begins along the axis, and its name."""
    starts = [0, *(np.flatnonzero(np.diff(track.leg)) + 1).tolist()]
    return tuple((float(along[row]), f"leg {track.leg[row]}") for row in starts)


# ----------------------------------------------------------------------
# What the page's map shows beside the scene that it shares with the 3-D view.

# Rim about what is shown, of its longer side.
_RIM = 0.015


def map_chart(setup: FlightSetup, tracks: Sequence[Track], failed: Failures) -> dict[str, Any]:
    """Reach of missiles at the path's height, names of waypoints, ends, and how far the map reaches; lengths in m.

    entered: numbers of threats whose rule fails.  searched: the plan where it differs from the mission's route.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> sorted(map_chart(log.setup, [log.track], Failures({}, {})))[:4]
    ['area', 'destination', 'entered', 'origin']
    """
    scenario, route = setup.scenario, setup.route.waypoints
    missiles = np.flatnonzero(scenario.threats.kill_radius > 0.0)
    reach = np.zeros(len(scenario.threats))
    if missiles.size:
        reach[missiles] = kill_radius_at_path(scenario.threats, missiles, route)
    bounds = np.stack([scene_bounds(setup, None), *(scene_bounds(setup, track) for track in tracks)])
    low, high = bounds[..., 0].min(axis=0), bounds[..., 1].max(axis=0)
    rim = _RIM * float((high - low).max())
    plan = setup.plan.waypoints if setup.plan is not None else None
    differs = plan is not None and paths_differ(plan, route, 1.0)
    return {
        "origin": position_text(scenario.origin.lat_deg, scenario.origin.lon_deg),
        "shown": np.round(np.stack([low - rim, high + rim], axis=1), 1).tolist(),
        "area": None if scenario.external else np.round(scenario.bounds, 1).tolist(),
        "reach": np.round(reach, 1).tolist(),
        "entered": sorted({place.index for place in failed.threats if place.index is not None}),
        "waypoints": waypoint_names(setup),
        "routeName": "route of the mission" if plan is None or differs else "planned path",
        "searched": np.round(plan[:, :2], 1).tolist() if plan is not None and differs else None,
        "start": np.round(scenario.start[:2], 1).tolist(),
        "destination": np.round(scenario.destination[:2], 1).tolist(),
    }


# ----------------------------------------------------------------------
# The charts of two flights: both on one map, and along their way.

_NO_FAILURES = Failures({}, {})


def compare_charts(flights: tuple[NamedFlight, NamedFlight]) -> dict[str, Any]:
    """Scene, flights and charts as what JSON can hold: over the first one's map, which is None for two origins.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> made = compare_charts(tuple(NamedFlight(name, log.setup, log.track) for name in ("one", "other")))
    >>> sorted(made), sorted(made["charts"])
    (['charts', 'flight', 'scene'], ['along', 'map'])
    """
    first, second = flights
    charts: dict[str, Any] = {"along": chart_json(stack_chart(comparison_stack(flights)))}
    scene = None
    if first.setup.scenario.origin == second.setup.scenario.origin:
        drawn = with_fence_zones(first.setup)
        charts["map"] = map_chart(drawn, [flight.track for flight in flights], _NO_FAILURES)
        scene = scene_data(drawn, first.track, _NO_FAILURES)
    looks: tuple[dict[str, Any], dict[str, Any]] = ({"look": "flown"}, {"look": "missile", "dashed": True})
    moments = [
        flight_moments(flight.setup, flight.track, name=drawing.shorten(flight.name, 40), **look)
        for flight, look in zip(flights, looks, strict=True)
    ]
    return {"scene": scene, "flight": {"flights": moments}, "charts": charts}


# ----------------------------------------------------------------------
# The chart of the aircraft's envelope with a flight in it.

_MAX_DOTS = 1000


def envelope_chart(setup: FlightSetup, track: Track | None) -> Chart:
    """Path angle through the air and bank over true airspeed, with the limits of the aircraft.

    >>> from logs.recording.example_log import example_log
    >>> [panel.title for panel in envelope_chart(example_log().setup, None).panels]
    ['path angle through the air', 'bank, either side']
    """
    slopes, banks = [], []
    for line, dashed in zip(envelope_lines(setup), (False, True), strict=False):
        for name, look, angle in (("climb", "missile", line.climb), ("descent", "second", line.descent)):
            named = f"steepest {name} at {line.amsl} m"
            slopes.append(Layer("line", named, look, line.airspeed, angle, width=2.0, dashed=dashed))
    if track is not None and len(track):
        flown = flown_moments(track, _MAX_DOTS)
        slopes.append(Layer("dots", "flown, moment by moment", "flown", flown.airspeed, flown.angle, width=3.0))
        banks.append(Layer("dots", "flown, moment by moment", "flown", flown.airspeed, flown.bank, width=3.0))
    legs = np.degrees(leg_slopes(setup.route.waypoints))
    slopes.append(
        Layer("dots", "legs as planned (over the ground)", "planned", np.asarray(setup.route.airspeed), legs, width=7.0)
    )
    ends = setup.envelope.airspeed[[0, -1]]
    planned, aircraft = (float(np.degrees(bank)) for bank in (setup.max_bank, setup.envelope.max_bank))
    limits = [("limit of planned turns; corrections may bank beyond it", min(planned, aircraft), False)]
    if abs(aircraft - min(planned, aircraft)) > 0.1:
        limits.append(("the aircraft's bank limit", aircraft, True))
    for name, value, dashed in limits:
        banks.append(Layer("line", name, "missile", ends, np.full(2, value), width=2.0, dashed=dashed))
    return Chart(
        "true airspeed",
        "m/s",
        (
            ChartPanel("path angle through the air", "°", tuple(slopes)),
            ChartPanel("bank, either side", "°", tuple(banks)),
        ),
        tall=260,
    )


# ----------------------------------------------------------------------
# The chart of turns and legs: planned, flown and limit of each finding that has a place on the route.

# Room above and below what a panel shows, of its span; and a limit this far above everything else is left out of it.
_ROOM, _FAR = 0.12, 4.0


def turn_chart(verdict: Verdict) -> Chart | None:
    """Panels of turns, slopes, clearances, waypoints and corridor; None where the verdict has none of them.

    >>> turn_chart(Verdict((), flyable=False, complete=False, lines=(), level="plan")) is None
    True
    """
    panels = tuple(
        _turn_panel(title, place, values)
        for rule, place, title in PLACE_PANELS
        if (values := place_values(verdict.findings, rule))
    )
    return Chart("", "", panels, shared=False, tall=170) if panels else None


def _turn_panel(title: str, place: str, values: list[PlaceValue]) -> ChartPanel:
    words, unit = parted_unit(title)
    at = np.array([value.number for value in values], dtype=np.float64)
    planned, flown, limit = (
        np.array([getattr(value, name) for value in values]) for name in ("planned", "flown", "limit")
    )
    failed = np.array([value.ok is False for value in values])
    shown = np.where(np.isfinite(flown), flown, planned)
    layers = [
        Layer("bars", "planned", "planned", at, planned),
        Layer("dashes", "limit", "missile", at, limit),
        Layer("dots", "flown", "flown", at, flown),
    ]
    if failed.any():
        layers.append(Layer("rings", "fails", "fail", at[failed], shown[failed], quiet=True))
    seen = np.concatenate([[0.0], planned, flown])
    seen = seen[np.isfinite(seen)]
    finite = limit[np.isfinite(limit)]
    near, far = (finite[chosen] for chosen in _near_and_far(finite, float(np.abs(seen).max())))
    low, high = float(min(seen.min(), *near)) if near.size else float(seen.min()), float(max(seen.max(), *near, 0.0))
    room = _ROOM * ((high - low) or 1.0)
    note = (
        f"{'other ' if near.size else ''}limits from {far.min():.0f}{unit if unit == '°' else ' ' + unit}"
        if far.size
        else ""
    )
    return ChartPanel(words, unit, tuple(layers), span=(low - room, high + room), along=place, note=note)


def _near_and_far(limits: Floats, largest: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which limits are shown, and which stand too far above everything else.  largest: of what is shown."""
    near = limits <= _FAR * max(largest, 1e-9)
    return near, ~near
