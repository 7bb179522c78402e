"""Collect moments of a flight, names of its places, and the aircraft model for the page.

A moment is a row of the track; a long track is thinned.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.foxglove_scene import MODEL_SPAN_M, model_colours, model_corners
from logs.verdict.places import Place
from logs.verdict.wording import place_text
from logs.views.charts import json_numbers
from logs.views.scene import select_drawn_rows

# Largest number of moments of a flight in a page.
MAX_MOMENTS = 2000


def flight_moments(setup: FlightSetup, track: Track, *, name: str = "flown", role: str = "flown") -> dict[str, Any]:
    """Return at most `MAX_MOMENTS` rows of a flight as JSON data: a list of values for each column.

    The columns are time (s); east, north (m), up (m AMSL) and above (m above ground); airspeed and climb (m/s); bank
    (right positive), pitch and heading (degrees); and leg.  The key "legs" has the names of all legs.  Unknown values
    are None.  Rows without a position are left out.

    name, role: legend text and role of the flight's line on the map.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> moments = flight_moments(log.setup, log.track)
    >>> len(moments["time"]) == len(moments["leg"]), moments["name"]
    (True, 'flown')
    """
    rows = select_drawn_rows(track, MAX_MOMENTS)
    position, terrain = track.position[rows], setup.scenario.terrain
    east, north, up = position.T
    height_above_ground = np.full(len(rows), np.nan) if terrain is None else up - terrain.height(east, north)
    roll, pitch, yaw = np.degrees(track.attitude[rows].astype(np.float64)).T
    _, _, climb = track.velocity[rows].T
    return {
        "name": name,
        "role": role,
        "time": json_numbers(track.time[rows], 2),
        "east": json_numbers(east, 1),
        "north": json_numbers(north, 1),
        "up": json_numbers(up, 1),
        "above": json_numbers(height_above_ground, 1),
        "airspeed": json_numbers(track.airspeed[rows], 2),
        "climb": json_numbers(climb, 2),
        "bank": json_numbers(roll, 1),
        "pitch": json_numbers(pitch, 1),
        "heading": json_numbers(yaw % 360.0, 1),
        "leg": track.leg[rows].tolist(),
        "legs": leg_names(setup),
    }


def leg_names(setup: FlightSetup) -> list[str]:
    """Return the name of each leg of the route, with the mission item that it leads to.

    >>> from logs.recording.example_log import example_log
    >>> leg_names(example_log().setup)[0]
    'leg 0 (to item 2)'
    """
    items = setup.route.items.tolist()
    numbers = setup.route.leg_numbers.tolist()
    return [
        place_text(Place("leg", k, to_item=_get_item(items[k + 1]), number=numbers[k])) for k in range(setup.route.legs)
    ]


def waypoint_names(setup: FlightSetup) -> list[str]:
    """Return a text on each waypoint of the route: its name with its item, and its altitude."""
    heights, numbers = setup.display_waypoints[:, 2].tolist(), setup.route.stops.tolist()
    return [
        f"{place_text(Place('waypoint', k, item=_get_item(item), number=numbers[k]))}\n{heights[k]:.0f} m AMSL"
        for k, item in enumerate(setup.route.items.tolist())
    ]


def _get_item(item: int) -> int | None:
    """Return the item number of a waypoint, or None if it is negative: a waypoint without a mission item."""
    return item if item >= 0 else None


def aircraft_model() -> dict[str, Any]:
    """Return corners and colours of the triangles that depict the aircraft on the page, as JSON data.

    Coordinates of corners are forward, left and up, in wing spans; colours are red, green and blue, 0 to 1.
    """

    def round_values(values: NDArray[np.float32]) -> Any:
        """Convert an array to nested lists, rounded to four decimals."""
        return np.round(values.astype(np.float64), 4).tolist()

    return {"corners": round_values(model_corners() / MODEL_SPAN_M), "colours": round_values(model_colours()[:, :3])}
