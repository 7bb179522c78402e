"""The chart of the aircraft's envelope with a flight in it."""

import numpy as np

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.figures.envelope import envelope_lines, flown_moments
from logs.report.charts.chart import Chart, ChartPanel, Layer
from world.geometry import leg_slopes

_MOST_DOTS = 1000


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
        flown = flown_moments(track, _MOST_DOTS)
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
