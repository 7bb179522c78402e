"""All charts of a page by the name of the picture that each stands for."""

from typing import Any

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.figures.elements.failures import Failures
from logs.figures.exposure import exposure_stack
from logs.figures.time_series import control_stack, energy_stack, time_stack
from logs.report.charts.chart import Chart, chart_json
from logs.report.charts.envelope_chart import envelope_chart
from logs.report.charts.flight_moments import aircraft_model, flight_moments
from logs.report.charts.map_chart import map_chart
from logs.report.charts.profile_chart import profile_chart
from logs.report.charts.stack_chart import stack_chart
from logs.report.charts.turn_chart import turn_chart
from logs.verdict.findings import Verdict


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
