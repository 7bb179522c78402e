"""Chart a flight in its aircraft's envelope: climb, descent and bank over airspeed."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import true_airspeed_route
from logs.views.charts import Chart, Layer, Panel, shorten
from world.arrays import Floats
from world.geometry import leg_slopes

# Largest number of drawn moments of a flight.
_MAX_DOTS = 2000


@dataclass(frozen=True, slots=True)
class EnvelopeLine:
    """Steepest climb and descent in steady flight at one altitude, over true airspeed.

    amsl: altitude, m above mean sea level.
    airspeed: true airspeeds, m/s, (120,).
    climb, descent: path angle relative to the air at each airspeed, degrees, (120,); descents are negative.
    """

    amsl: int
    airspeed: Floats
    climb: Floats
    descent: Floats


def sample_envelope_lines(setup: FlightSetup) -> list[EnvelopeLine]:
    """Return the envelope at the lowest and at the highest altitude of the route, in that order.

    There is one line if both altitudes round to the same metre.
    """
    envelope, altitudes = setup.envelope, setup.route.positions[:, 2]
    speeds = np.linspace(envelope.airspeed[0], envelope.airspeed[-1], 120)
    lines = []
    for amsl in sorted({round(float(altitudes.min())), round(float(altitudes.max()))}):
        climb, descent = np.degrees([envelope.air_angles(float(speed), float(amsl)) for speed in speeds]).T
        lines.append(EnvelopeLine(amsl, speeds, climb, -descent))
    return lines


@dataclass(frozen=True, slots=True)
class FlownMoments:
    """Airspeed, path angle and bank at n moments of a flight, (n,) each.

    airspeed: true airspeed, m/s.
    angle: air-relative path angle, degrees.
    bank: absolute bank angle, degrees.
    """

    airspeed: Floats
    angle: Floats
    bank: Floats


def select_flown_moments(track: Track, count: int = _MAX_DOTS) -> FlownMoments:
    """Return at most `count` moments of a flight, evenly spaced in the rows of its track.

    Moments with NaN values are omitted.
    """
    rows = np.unique(np.linspace(0, len(track) - 1, min(len(track), count)).astype(np.intp))
    air_velocity = (track.velocity[rows] - track.wind[rows]).astype(np.float64)
    east, north, up = air_velocity.T
    angle = np.degrees(np.arctan2(up, np.hypot(east, north)))
    speed = track.airspeed[rows].astype(np.float64)
    roll, _, _ = track.attitude[rows].T
    bank = np.degrees(np.abs(roll.astype(np.float64)))
    is_finite = np.isfinite(speed) & np.isfinite(angle) & np.isfinite(bank)
    return FlownMoments(speed[is_finite], angle[is_finite], bank[is_finite])


def envelope_chart(setup: FlightSetup, track: Track | None) -> Chart:
    """Chart the air-relative path angle and the bank of a flight over true airspeed, with their limits.

    Limits of the path angle are shown for the lowest and the highest altitude of the route.  Dots are moments of the
    flight, which may exceed the limits for a short time, in a pull-up or a gust, and planned legs, which must not.

    track: flown track; None to show only the limits and the planned legs.

    >>> from logs.recording.example_log import example_log
    >>> [panel.title for panel in envelope_chart(example_log().setup, None).panels]
    ['path angle through the air', 'bank, either side']
    """
    slopes, banks = [], []
    for line, dashed in zip(sample_envelope_lines(setup), (False, True), strict=False):
        for name, role, angle in (("climb", "steady-limit", line.climb), ("descent", "second", line.descent)):
            line_name = f"steepest {name} at {line.amsl} m"
            slopes.append(Layer("line", line_name, role, line.airspeed, angle, dashed=dashed))
    if track is not None and len(track):
        moments = select_flown_moments(track)
        slopes.append(Layer("dots", "flown, moment by moment", "moment", moments.airspeed, moments.angle))
        banks.append(Layer("dots", "flown, moment by moment", "moment", moments.airspeed, moments.bank))
    leg_slopes_deg = np.degrees(leg_slopes(setup.display_waypoints))
    planned_speeds = true_airspeed_route(setup).leg_airspeeds
    slopes.append(Layer("dots", "legs as planned (over the ground)", "planned-leg", planned_speeds, leg_slopes_deg))
    min_speed = float(setup.envelope.airspeed[0])
    max_speed = float(setup.envelope.airspeed[-1])
    speed_range = (min_speed - 0.5, max_speed + 0.5)
    speed_ends = np.array(speed_range)
    planned_bank, aircraft_bank = (
        float(np.degrees(bank_limit)) for bank_limit in (setup.max_bank, setup.envelope.max_bank)
    )
    limits = [("limit of planned turns; corrections may bank beyond it", min(planned_bank, aircraft_bank), False)]
    if abs(aircraft_bank - min(planned_bank, aircraft_bank)) > 0.1:
        limits.append(("the aircraft's bank limit", aircraft_bank, True))
    banks += [
        Layer("line", name, "steady-limit", speed_ends, np.full(2, value), dashed=dashed_line)
        for name, value, dashed_line in limits
    ]
    max_bank = max([value for _, value, _ in limits] + [float(layer.y.max()) for layer in banks if layer.y.size])
    panels = (
        Panel("path angle through the air", "°", tuple(slopes)),
        Panel("bank, either side", "°", tuple(banks), span=(0.0, 1.06 * max_bank)),
    )
    aircraft_name = shorten(setup.aircraft, 20)
    title = f"{shorten(setup.scenario.name, 60)}: the {aircraft_name}'s envelope and this flight"
    layout: dict[str, Any] = {"page_height": 260, "print_height": 3.08, "widths": (0.6, 0.4), "legend": "below"}
    return Chart(title, "true airspeed", "m/s", panels, axis_range=speed_range, **layout)
