"""All charts of a page by the name of the picture that each stands for."""

from typing import Any

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Verdict
from logs.views import drawing
from logs.views.failures import Failures, route_distance, route_samples, track_distance
from logs.views.report.charts import (
    Chart,
    ChartPanel,
    Floats,
    Layer,
    aircraft_model,
    chart_json,
    envelope_chart,
    flight_moments,
    map_chart,
    stack_chart,
    turn_chart,
)
from logs.views.threats_and_zones import sphere_cuts, zone_cuts, zone_label
from logs.views.time_series import control_stack, energy_stack, exposure_stack, time_stack
from world.scenario import Scenario

# ----------------------------------------------------------------------
# The chart of the profile: terrain, plan, flight, spheres and zones in the vertical plane along the path.

# Samples along the path, of the flight, and the least span of heights that is shown, m.
_SAMPLES, _BLOCKS, _MIN_SPAN = 800, 800, 50.0


def profile_chart(setup: FlightSetup, track: Track | None, failed: Failures) -> Chart:
    """Heights (m AMSL) over the distance along the route (km); flown ones stand at the flight's progress.

    A band of clearance shows where the path is too low; a sphere or a zone is cut where the path runs through it.

    >>> from logs.recording.example_log import example_log
    >>> chart = profile_chart(example_log().setup, None, Failures({}, {}))
    >>> chart.unit, [layer.name for layer in chart.panels[0].layers][-2:]
    ('km', ['planned', 'waypoints'])
    """
    scenario, route = setup.scenario, setup.route.waypoints
    at = route_distance(route)
    distance, points = route_samples(route, max(float(at[-1]) / _SAMPLES, 1.0))
    ground = None if scenario.terrain is None else scenario.terrain.height(points[:, 0], points[:, 1])
    low, high = _span(scenario, route, track, ground)
    along = distance / 1000.0
    layers = _zones(scenario, along, points, ground, low, high) + _spheres(scenario, along, points)
    layers += _ground(scenario, along, ground, low)
    layers += [
        Layer("line", "leg that fails", "fail", at[k : k + 2] / 1000.0, route[k : k + 2, 2], width=9.0, quiet=True)
        for k in failed.legs
    ]
    layers.append(Layer("line", "planned", "planned", along, points[:, 2], width=4.0))
    if track is not None and len(track):
        rows = drawing.outline_rows(track.position[:, 2], _BLOCKS)
        progress = track_distance(route, track)[rows] / 1000.0
        layers.append(Layer("line", "flown", "flown", progress, track.position[rows, 2], width=1.6))
    layers.append(Layer("dots", "waypoints", "planned", at / 1000.0, route[:, 2], width=6.0, quiet=True))
    limits = [] if scenario.external else [("ceiling", scenario.ceiling), ("floor", scenario.floor)]
    shown = tuple((f"{name}, {value:.0f} m AMSL", value) for name, value in limits if low < value < high)
    panel = ChartPanel("height", "m AMSL", tuple(layers), shown, span=(low, high))
    marks = tuple((float(start) / 1000.0, f"leg {k}") for k, start in enumerate(at[:-1]))
    return Chart("distance along the planned path", "km", (panel,), marks=marks, tall=420)


def _span(scenario: Scenario, route: Floats, track: Track | None, ground: Floats | None) -> tuple[float, float]:
    """Range that holds ground, plan and flight, and the ceiling where that does not press them flat."""
    heights = [route[:, 2]] + ([] if ground is None else [ground]) + ([] if track is None else [track.position[:, 2]])
    together = np.concatenate(heights)
    together = together[np.isfinite(together)]
    low, high = float(together.min()), float(together.max())
    span = max(high - low, _MIN_SPAN)
    if high < scenario.ceiling <= high + 1.2 * span:
        high = scenario.ceiling
    return low - 0.12 * span, high + 0.14 * span


def _ground(scenario: Scenario, along: Floats, ground: Floats | None, low: float) -> list[Layer]:
    if ground is None or not np.isfinite(ground).any():
        return []
    required, most = scenario.limits.min_clearance_m, scenario.limits.max_height_m
    layers = [Layer("band", "terrain", "terrain", along, ground, np.full(len(ground), low), width=1.2)]
    if required > 0.0:
        name = f"required clearance, {required:g} m"
        layers.append(Layer("band", name, "clearance", along, ground + required, ground, width=0.0))
    if most is not None:
        name = f"greatest height, {most:g} m above ground"
        layers.append(Layer("line", name, "zone", along, ground + most, width=1.6, dashed=True))
    return layers


def _spheres(scenario: Scenario, along: Floats, points: Floats) -> list[Layer]:
    """The cut of each sphere that stands over the path; radars' first."""
    threats, layers = scenario.threats, []
    for kind, look, radii in (
        ("radar", "radar", threats.detection_radius),
        ("missile", "missile", threats.kill_radius),
    ):
        for k in np.flatnonzero(radii > 0.0):
            lower, upper = sphere_cuts(threats.position[k], float(radii[k]), points)
            over = np.flatnonzero(np.isfinite(upper))
            if over.size:
                # One sample more on either side, so that the outline ends where the sphere does.
                cut_out = slice(max(0, int(over[0]) - 1), int(over[-1]) + 2)
                name = f"{threats.names[k][:40]} ({kind})"
                whole = f"{kind}'s sphere over the path"
                cut = Layer(
                    "band",
                    name,
                    look,
                    along[cut_out],
                    upper[cut_out],
                    lower[cut_out],
                    1.2,
                    dashed=kind == "radar",
                    legend=whole,
                )
                layers.append(cut)
    return layers


def _zones(
    scenario: Scenario, along: Floats, points: Floats, ground: Floats | None, low: float, high: float
) -> list[Layer]:
    layers = []
    for cut in zone_cuts(scenario.zones, points, ground, low, high):
        whole = "zone to keep out of" if cut.zone.kind == "exclusion" else "outside a zone to stay in"
        top = np.where(cut.where, cut.top, np.nan)
        layers.append(Layer("band", zone_label(cut.zone), "zone", along, top, cut.bottom, 1.0, legend=whole))
    return layers


def report_charts(setup: FlightSetup, track: Track | None, verdict: Verdict, failed: Failures) -> dict[str, Any]:
    """Charts of a plan and its flight as what JSON can hold; what has no data is left out.

    track: None, or with at least one row.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.judge_geometry import judge_geometry
    >>> setup = example_log().setup
    >>> list(report_charts(setup, None, judge_geometry(setup), Failures({}, {})))
    ['map', 'profile', 'turns', 'envelope']
    """
    charts: dict[str, Chart | None] = {
        "profile": profile_chart(setup, track, failed),
        "turns": turn_chart(verdict),
        "envelope": envelope_chart(setup, track),
    }
    if track is not None:
        exposure = exposure_stack(setup, track)
        charts |= {
            "time": stack_chart(time_stack(setup, track)),
            "exposure": None if exposure is None else stack_chart(exposure),
            "controls": stack_chart(control_stack(setup, track)),
            "energy": stack_chart(energy_stack(setup, track)),
        }
    made = {name: chart_json(chart) for name, chart in charts.items() if chart is not None}
    return {"map": map_chart(setup, [] if track is None else [track], failed), **made}


def report_flight(setup: FlightSetup, track: Track | None) -> dict[str, Any]:
    """The flight for slider and map, and the model of the aircraft; no flight of a bare plan."""
    flights = [] if track is None else [flight_moments(setup, track)]
    # A flight of which no place is known cannot be shown at any moment.
    known = [flight for flight in flights if flight["time"]]
    return {"flights": known, "model": aircraft_model()}
