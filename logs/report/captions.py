"""Captions of the report's pictures: heading, alternative text, and how to read each."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass

from flight.simulation.flight_setup import FlightSetup

# Bytes from which on a picture is kept with few colours.
_LARGE = 200_000


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """One picture of the page.

    identifier: of its section.
    title: its heading.
    alternative: its text for those who cannot see it.
    caption: how to read it.
    data: its address in the page.
    """

    identifier: str
    title: str
    alternative: str
    caption: str
    data: str


@dataclass(frozen=True, slots=True)
class _Caption:
    title: str
    alternative: str
    caption: str


def report_pictures(setup: FlightSetup, flown: bool, pictures: Mapping[str, bytes]) -> list[ReportPicture]:
    """List the page's pictures in its order; what was not drawn is left out.

    pictures: PNG bytes by file name.
    """
    return [
        ReportPicture(
            identifier=name,
            title=caption.title,
            alternative=caption.alternative,
            caption=caption.caption,
            data=picture_address(pictures[f"{name}.png"]),
        )
        for name, caption in _captions(setup, flown).items()
        if f"{name}.png" in pictures
    ]


def picture_address(png: bytes) -> str:
    """A picture as an address that holds it; one that is large with few colours, as it is seen on paper alone.

    >>> picture_address(b"PNG")
    'data:image/png;base64,UE5H'
    """
    # Imported here, as in `page`: matplotlib is not loaded before a drawing.
    from logs.figures.elements.style import few_colours

    small = png if len(png) <= _LARGE else few_colours(png)
    return "data:image/png;base64," + base64.b64encode(small).decode("ascii")


def _captions(setup: FlightSetup, flown: bool) -> dict[str, _Caption]:
    """Captions by the picture's name, in the page's order."""
    return _route_captions(setup, flown) | _FLIGHT_CAPTIONS


def _route_captions(setup: FlightSetup, flown: bool) -> dict[str, _Caption]:
    """Captions of the pictures of route and terrain, which a plan has, too, that was not flown."""
    legs, threats = setup.route.legs, len(setup.scenario.threats)
    ground = "shaded terrain" if setup.scenario.terrain is not None else "no terrain"
    track = " and the flown track" if flown else ""
    heights = "planned and flown heights" if flown else "planned heights"
    progress = "Flown heights stand at the flight's progress along the planned path. " if flown else ""
    return {
        "map": _Caption(
            "Map",
            f"Map, north up: {ground}, {threats} threats, the planned path of {legs} legs{track}.",
            "The broad line is the plan, the thin line on it the flight."
            + (
                " Where they part, at corners, the aircraft flies an arc inside the waypoint."
                if setup.source is None
                else ""
            )
            if flown
            else "Nothing was flown: the line is the plan.",
        ),
        "profile": _Caption(
            "Profile",
            f"Heights along the path: terrain, required clearance, {heights}, the ceiling, and the missile and radar "
            "spheres that stand over the path.",
            f"{progress}A sphere is cut where the path runs through its column of air; the path is within reach only "
            "where its line lies inside the cut.",
        ),
        "scene": _Caption(
            "3-D view",
            f"View from aside: {ground}, {threats} threats, the planned path of {legs} legs{track}.",
            "Domes are the missiles' reach, dashed the radars'; thin poles stand from the ground to the waypoints. "
            "What a ridge hides shows faintly.",
        ),
    }


_FLIGHT_CAPTIONS = {
    "turns": _Caption(
        "Turn by turn, leg by leg",
        "Bars, dots and dashes: planned, flown and limit of each turn, slope, height above ground, waypoint, and of "
        "the distance from the legs.",
        "Bar: planned. Dot: flown. Dash: the limit, the tighter of scenario's and aircraft's, and of a waypoint what "
        "counts as reached. Ringed: fails.",
    ),
    "time": _Caption(
        "Over time",
        "Plots over time: airspeed, bank, load factor, cross-track error, height error, height above ground.",
        "Cross-track and height error are what guidance saw, against the path with its corners rounded. Height "
        "above ground is computed from track and terrain.",
    ),
    "exposure": _Caption(
        "Exposure",
        "Plots along the flown distance: strength and sum of the exposure to missiles and to radars.",
        "Strength is the sum over all units of (scale/distance)⁴ inside their reach: 1 at one scale's distance "
        "(Yang, Tang and Lozano 2014, eq. 9 and 10, as a density). So far: its sum over time.",
    ),
    "controls": _Caption(
        "Controls",
        "Plots over time: elevator, aileron, rudder and throttle, commanded and as they stood, with their limits.",
        "Shaded: the command stands at the control's limit, and the aircraft can give no more.",
    ),
    "energy": _Caption(
        "Energy",
        "Plots over time: battery energy used, power, current, and the aircraft's energy as a height.",
        "Energy as height: height and airspeed²/2g. Its slope is climb that the motor pays for.",
    ),
    "envelope": _Caption(
        "Envelope",
        "Path angle over airspeed with the steepest climbs and descents, and bank over airspeed with its limit.",
        "Lines: the steepest steady climb and descent of the aircraft, from trims of its model. A dot may stand "
        "outside for a moment, in a gust or a pull-up; a leg may not.",
    ),
}
