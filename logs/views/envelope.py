"""The aircraft's envelope and a flight in it: climb and descent over airspeed, and bank over airspeed."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from aircraft.envelope import Envelope
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.views import drawing
from world.geometry import leg_slopes

Floats = NDArray[np.float64]

_HEIGHT, _TOP, _BOTTOM = 4.9, 0.62, 1.2
_MAX_DOTS = 4000


def draw_envelope_and_flight(setup: FlightSetup, track: Track | None) -> Figure:
    """Two panels over true airspeed (m/s): path angle through the air with the trims' limits, and bank with its limit.

    Limits at the lowest and highest height of the route.  Dots: the flight, one each fraction of a second; a pull-up
    or a gust may stand outside for a moment, a leg may not.  Rings: the legs as planned.
    """
    with drawing.clean_style():
        figure = drawing.new_figure(_HEIGHT)
        base, tall = _BOTTOM / _HEIGHT, 1.0 - (_TOP + _BOTTOM) / _HEIGHT
        slope_axes = figure.add_axes((0.08, base, 0.5, tall))
        bank_axes = figure.add_axes((0.66, base, 0.32, tall))
        _limits(slope_axes, setup)
        _planned(slope_axes, setup)
        bank = float(np.degrees(min(setup.max_bank, setup.envelope.max_bank)))
        bank_axes.axhline(
            bank, color=drawing.MISSILE, linewidth=1.6, label="limit of planned turns;\ncorrections may bank beyond it"
        )
        aircraft = float(np.degrees(setup.envelope.max_bank))
        if abs(aircraft - bank) > 0.1:
            bank_axes.axhline(
                aircraft, color=drawing.MISSILE, linewidth=1.2, linestyle=(0, (4, 2)), label="the aircraft's"
            )
        if track is not None and len(track):
            _flown(slope_axes, bank_axes, track)
        for axes, label in ((slope_axes, "path angle through the air (°)"), (bank_axes, "bank, either side (°)")):
            axes.set_xlabel("true airspeed (m/s)")
            axes.set_ylabel(label)
            axes.grid(color="#e4e4e4", linewidth=0.5)
            axes.set_axisbelow(True)
        bank_axes.set_ylim(bottom=0.0)
        _range(slope_axes, bank_axes, setup.envelope)
        name = drawing.shorten(setup.scenario.name, 60)
        slope_axes.set_title(
            f"{name}: the {drawing.shorten(setup.aircraft, 20)}'s envelope and this flight", fontweight="bold"
        )
        anchor: dict[str, Any] = {"loc": "upper left", "ncols": 2, "borderaxespad": 0.0}
        slope_axes.legend(bbox_to_anchor=(0.0, -0.17), **anchor)
        bank_axes.legend(bbox_to_anchor=(0.0, -0.17), loc="upper left", borderaxespad=0.0)
    return figure


@dataclass(frozen=True, slots=True)
class EnvelopeLine:
    """Steepest steady path angles (°) at one height (m AMSL) over true airspeed (m/s), (120,); descents negative."""

    amsl: int
    airspeed: Floats
    climb: Floats
    descent: Floats


def envelope_lines(setup: FlightSetup) -> list[EnvelopeLine]:
    """The envelope at the lowest and the highest height of the route."""
    envelope, up = setup.envelope, setup.route.waypoints[:, 2]
    speeds = np.linspace(envelope.airspeed[0], envelope.airspeed[-1], 120)
    lines = []
    for amsl in sorted({round(float(up.min())), round(float(up.max()))}):
        climb, descent = np.degrees([envelope.air_angles(float(speed), float(amsl)) for speed in speeds]).T
        lines.append(EnvelopeLine(amsl, speeds, climb, -descent))
    return lines


@dataclass(frozen=True, slots=True)
class FlownMoments:
    """True airspeed (m/s), path angle through the air and bank to either side (°) at moments of a flight, (n,) each."""

    airspeed: Floats
    angle: Floats
    bank: Floats


def flown_moments(track: Track, most: int = _MAX_DOTS) -> FlownMoments:
    """At most so many moments of a track, those that are numbers."""
    rows = np.unique(np.linspace(0, len(track) - 1, min(len(track), most)).astype(np.intp))
    air = (track.velocity[rows] - track.wind[rows]).astype(np.float64)
    east, north, up = air.T
    angle = np.degrees(np.arctan2(up, np.hypot(east, north)))
    speed = track.airspeed[rows].astype(np.float64)
    roll, _, _ = track.attitude[rows].T
    bank = np.degrees(np.abs(roll.astype(np.float64)))
    good = np.isfinite(speed) & np.isfinite(angle) & np.isfinite(bank)
    return FlownMoments(speed[good], angle[good], bank[good])


def _limits(axes: Any, setup: FlightSetup) -> None:
    for line, dashes in zip(envelope_lines(setup), ("-", (0, (5, 2))), strict=False):
        look: dict[str, Any] = {"linestyle": dashes, "linewidth": 1.8}
        axes.plot(line.airspeed, line.climb, color=drawing.MISSILE, label=f"steepest climb at {line.amsl} m", **look)
        axes.plot(line.airspeed, line.descent, color=drawing.BLUE, label=f"steepest descent at {line.amsl} m", **look)
    axes.axhline(0.0, color="#777777", linewidth=0.7)


def _planned(axes: Any, setup: FlightSetup) -> None:
    slopes = np.degrees(leg_slopes(setup.route.waypoints))
    ring: dict[str, Any] = {"mfc": drawing.PLANNED, "mec": "black", "mew": 0.8, "markersize": 7.0, "zorder": 5}
    axes.plot(setup.route.airspeed, slopes, "o", label="legs as planned (over the ground)", **ring)


def _flown(slope_axes: Any, bank_axes: Any, track: Track) -> None:
    flown = flown_moments(track)
    look: dict[str, Any] = {"markersize": 2.2, "alpha": 0.28, "color": drawing.FLOWN, "markeredgewidth": 0, "zorder": 3}
    slope_axes.plot(flown.airspeed, flown.angle, "o", label="flown, moment by moment", **look)
    bank_axes.plot(flown.airspeed, flown.bank, "o", label="flown, moment by moment", **look)


def _range(slope_axes: Any, bank_axes: Any, envelope: Envelope) -> None:
    low, high = float(envelope.airspeed[0]), float(envelope.airspeed[-1])
    for axes in (slope_axes, bank_axes):
        axes.set_xlim(low - 0.5, high + 0.5)
