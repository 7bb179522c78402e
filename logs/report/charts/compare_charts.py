"""The charts of two flights: both on one map, and along their way."""

from typing import Any

from logs.figures.comparison import NamedFlight, comparison_stack
from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from logs.figures.elements.scene_data import scene_data
from logs.report.charts.chart import chart_json
from logs.report.charts.flight_moments import flight_moments
from logs.report.charts.map_chart import map_chart
from logs.report.charts.stack_chart import stack_chart
from logs.verdict.measures.airspace import with_fence_zones

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
        flight_moments(flight.setup, flight.track, name=style.shorten(flight.name, 40), **look)
        for flight, look in zip(flights, looks, strict=True)
    ]
    return {"scene": scene, "flight": {"flights": moments}, "charts": charts}
