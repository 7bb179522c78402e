"""Build the mission for an identification, with climbs, glides, level runs at several speeds, and turns.

The mission is flown in AUTO.  Control doublets cannot be mission items; fly them by hand in FBWA, or with AUTOTUNE.
"""

import math
from collections.abc import Iterator

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.envelope import Envelope
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from world.frames import GeoOrigin, to_geo

# Slopes of the mission as a fraction of the steepest climb and descent, which need slightly less than full throttle, so
# that the mission can be flown in wind.
_SHARE = 0.85
# Duration of a level run, s.
_RUN = 25.0
# Duration of a climb or a glide, s.
_SLOPE_TIME_S = 25.0
# Height above home at which the mission starts, m.
_START_HEIGHT_M = 150.0


def identification_mission(
    aircraft: Aircraft, envelope: Envelope, lat_deg: float, lon_deg: float, ground: float, repeats: int = 1
) -> Mission:
    """Return the mission around a home position.

    lat_deg, lon_deg, ground: home position, degrees and m AMSL.
    repeats: number of times that the sequence is flown.

    The legs form squares, so that every manoeuvre is flown with the wind and against it.
    """
    places = list(_waypoints(aircraft, envelope, ground + _START_HEIGHT_M, repeats))
    east, north = np.array([place[:2] for place in places]).T
    lats, lons = to_geo(GeoOrigin(lat_deg, lon_deg), east, north)
    items: list[MissionItem] = []

    def add(
        command: int, frame: int, params: tuple[float, float, float, float], lat: float, lon: float, up: float
    ) -> None:
        number = len(items) + 1
        items.append(MissionItem(number, command, frame, params, on_grid(lat), on_grid(lon), round(up, 2)))

    speed = math.nan
    for (_, _, up, asked), lat, lon in zip(places, lats.tolist(), lons.tolist(), strict=True):
        if asked != speed and items:
            add(int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), (0.0, asked, -1.0, 0.0), 0.0, 0.0, 0.0)
        speed = asked
        add(int(Command.NAV_WAYPOINT), int(Frame.GLOBAL_RELATIVE_ALT), (0.0, 0.0, 0.0, 0.0), lat, lon, up - ground)
    return Mission(Home(on_grid(lat_deg), on_grid(lon_deg), ground), tuple(items), source="identify.waypoints")


def _waypoints(
    aircraft: Aircraft, envelope: Envelope, base: float, repeats: int
) -> Iterator[tuple[float, float, float, float]]:
    """Yield east, north and altitude of each waypoint, m, and the airspeed on the leg to the waypoint, m/s."""
    cruise = aircraft.airspeed
    slow = aircraft.airspeed_min + 0.15 * (cruise - aircraft.airspeed_min)
    fast = cruise + 0.6 * (aircraft.airspeed_max - cruise)
    between = 0.5 * (slow + cruise)
    # Airspeed, duration (s), and -1, 0 or 1 for descent, level flight and climb.
    figure = (
        (cruise, _RUN, 0),
        (cruise, _SLOPE_TIME_S, 1),
        (slow, _RUN, 0),
        (cruise, _SLOPE_TIME_S, -1),
        (fast, _RUN, 0),
        (between, _SLOPE_TIME_S, 1),
        (cruise, _RUN, 0),
        (fast, _SLOPE_TIME_S, -1),
        (between, _RUN, 0),
        (cruise, _SLOPE_TIME_S, 1),
        (0.5 * (cruise + fast), _RUN, 0),
        (cruise, _SLOPE_TIME_S, -1),
    )
    east = north = 0.0
    up, heading = base, 0.0
    yield east, north, up, cruise
    for _ in range(repeats):
        for number, (speed, seconds, way) in enumerate(figure):
            # Add length for the turns at both ends of the leg.
            length = speed * seconds + 2.0 * speed * speed / 9.81
            climb, descent = envelope.air_angles(speed, up)
            angle = (climb if way > 0 else descent) * _SHARE if way else 0.0
            up = max(base - 60.0, up + way * length * math.tan(max(0.0, angle) if math.isfinite(angle) else 0.0))
            east += length * math.sin(heading)
            north += length * math.cos(heading)
            yield east, north, up, speed
            # Four right turns, then four left turns.
            heading += 0.5 * math.pi if number // 4 % 2 == 0 else -0.5 * math.pi
