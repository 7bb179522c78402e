"""Chart two flights together, or an imported flight and its simulation."""

from dataclasses import dataclass, replace

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import ROLL, THROTTLE, Track
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.views.charts import Chart, Layer, Panel, filled_series, make_leg_marks, series, shorten
from logs.views.map import DrawnTrack, MapChart, NamedWind, map_chart
from logs.views.time_series import to_float64
from world.arrays import Floats

# Roles of the first and the second flight.
ROLES = ("flown", "other")
# Number of points along the distance flown.
_POINTS = 3000


@dataclass(frozen=True, slots=True)
class NamedFlight:
    """A flight to draw, with the name that its lines have in the legend."""

    name: str
    setup: FlightSetup
    track: Track


def make_two_flights_map(flights: tuple[NamedFlight, NamedFlight]) -> MapChart:
    """Make the map of two flights: the route of the first flight, and both tracks.

    It shows both winds if they differ in more than the seed of their gusts, otherwise one.
    """
    first, _ = flights
    winds = [
        NamedWind(flight.setup.scenario.wind, flight.name, role) for flight, role in zip(flights, ROLES, strict=True)
    ]
    first_wind, second_wind = (replace(named_wind.wind, seed=None) for named_wind in winds)
    return map_chart(
        with_fence_zones(first.setup).scenario,
        "two flights from above",
        plan_waypoints=None,
        route_waypoints=first.setup.route.positions,
        tracks=[
            DrawnTrack(shorten(flight.name, 40), flight.track, role, k)
            for k, (flight, role) in enumerate(zip(flights, ROLES, strict=True))
        ],
        winds=[NamedWind(first_wind)] if first_wind == second_wind else winds,
        verdict=None,
        stops=first.setup.route.stops.tolist(),
        items=first.setup.route.items.tolist(),
    )


def make_two_flights_chart(flights: tuple[NamedFlight, NamedFlight]) -> Chart:
    """Make the chart of two flights over the distance flown, with a line for each flight in every panel.

    The panels are altitude, height above ground (omitted without terrain), airspeed, bank, cross-track error and
    throttle.
    """
    tracks = [flight.track for flight in flights]
    steps = [np.nan_to_num(np.hypot(*np.diff(track.position[:, :2], axis=0).T)) for track in tracks]
    distances = [np.concatenate([[0.0], np.cumsum(track_steps)]) for track_steps in steps]
    along = np.linspace(0.0, max(float(distance[-1]) for distance in distances), _POINTS)

    def make_flight_lines(values: list[Floats]) -> tuple[Layer, ...]:
        """Make a line for each flight over the distance flown; values: one quantity along each track."""
        return tuple(
            series(shorten(flight.name, 22), role, along / 1e3, np.interp(along, distance, value, right=np.nan))
            for flight, role, distance, value in zip(flights, ROLES, distances, values, strict=True)
        )

    heights = []
    for flight in flights:
        terrain, position = flight.setup.scenario.terrain, flight.track.position
        ground: float | Floats = np.nan if terrain is None else terrain.height(position[:, 0], position[:, 1])
        heights.append(np.asarray(position[:, 2] - ground))
    panels = (
        Panel("altitude", "m AMSL", make_flight_lines([track.position[:, 2] for track in tracks])),
        Panel("height above ground", "m", make_flight_lines(heights)),
        Panel("airspeed", "m/s", make_flight_lines([to_float64(track.airspeed) for track in tracks]), min_span=4.0),
        Panel(
            "bank, right +",
            "°",
            make_flight_lines([np.degrees(to_float64(track.attitude[:, ROLL])) for track in tracks]),
        ),
        Panel(
            "cross-track, right +",
            "m",
            make_flight_lines([to_float64(track.cross_track) for track in tracks]),
            min_span=0.1,
        ),
        Panel(
            "throttle", "%", make_flight_lines([100.0 * to_float64(track.controls[:, THROTTLE]) for track in tracks])
        ),
    )
    return Chart("Two flights along their paths", "distance flown over the ground", "km", panels)


# An imported flight and the simulated flight of the same mission: one chart a quantity, over the distance.

# File name, field of a profile, title, unit, factor, smallest range shown.
_REFLOWN = (
    ("refly-cross-track.png", "cross_track", "right of the legs", "m", 1.0, 4.0),
    ("refly-height.png", "height_error", "above the legs", "m", 1.0, 4.0),
    ("refly-ground-speed.png", "ground_speed", "ground speed", "m/s", 1.0, 4.0),
    ("refly-bank.png", "bank", "bank, right +", "°", 180.0 / np.pi, 10.0),
    ("refly-energy.png", "energy", "energy used", "Wh", 1.0, 1.0),
)


def refly_charts(reflight: Reflight) -> dict[str, Chart]:
    """Chart the quantities of an imported flight and of its simulation over the distance along the legs.

    Return the chart of each quantity, keyed by its PNG file name.  Quantities that the log lacks have no chart.

    >>> from flight.simulation.setup import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.imported.flown_legs import flown_legs
    >>> from logs.verdict.imported.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> list(refly_charts(again))[:2]
    ['refly-cross-track.png', 'refly-height.png']
    """
    distance_km = reflight.distance / 1e3
    legs = np.searchsorted(reflight.ends, reflight.distance, side="right")
    marks = make_leg_marks(reflight.setup.route.leg_numbers_of(legs), distance_km)
    charts = {}
    for file, name, title, unit, factor, span in _REFLOWN:
        flown_values = factor * getattr(reflight.flown, name)
        simulated_values = factor * getattr(reflight.model, name)
        if not np.isfinite(flown_values).any():
            continue
        lines = (
            series("flown", "flown", distance_km, flown_values),
            series("simulated", "other", distance_km, simulated_values),
        )
        difference = (
            filled_series("flown minus simulated", "difference", distance_km, flown_values - simulated_values),
        )
        panels = (
            Panel(title, unit, lines, min_span=span),
            Panel("difference", unit, difference, limits=(("", 0.0),), min_span=0.5 * span),
        )
        heading = f"{shorten(reflight.setup.scenario.name, 40)}: flown, and by the model {reflight.setup.aircraft}"
        charts[file] = Chart(heading, "along the legs", "km", panels, marks=marks)
    return charts
