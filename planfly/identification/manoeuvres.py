"""Build the mission for an identification.

It has climbs, glides, level runs at several speeds, and turns.

The mission is flown in AUTO.  Control doublets cannot be mission items; fly them by hand in FBWA, or with AUTOTUNE.
"""

import math
from collections.abc import Iterator

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.envelope import Envelope
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from world.frames import GeoOrigin, to_geo

# Slopes of the mission as a fraction of the steepest climb and descent, which need slightly less than full throttle, so
# that the mission can be flown in wind.
_SLOPE_FRACTION = 0.85
# Vertical rates of the mission as a fraction of the autopilot's largest rates.
_RATE_FRACTION = 0.9
# Duration of a level run, s.
_LEVEL_RUN_TIME_S = 25.0
# Duration of a climb or a glide, s.
_SLOPE_TIME_S = 25.0
# Height above home at which the mission starts, m.
_START_HEIGHT_M = 150.0


def make_identification_mission(
    aircraft: Aircraft,
    envelope: Envelope,
    lat_deg: float,
    lon_deg: float,
    ground: float,
    repeats: int = 1,
    *,
    max_rates: tuple[float, float] = (math.inf, math.inf),
) -> Mission:
    """Return a mission of manoeuvres for system identification, around a home position.

    lat_deg, lon_deg, ground: home position, degrees and m AMSL.
    repeats: number of times that the sequence is flown.
    max_rates: largest climb and sink rate of the autopilot that flies it, m/s.

    The legs form squares, so that every manoeuvre is flown with the wind and against it.
    """
    waypoints = list(_lay_out_waypoints(aircraft, envelope, ground + _START_HEIGHT_M, repeats, max_rates))
    east, north = np.array([waypoint[:2] for waypoint in waypoints]).T
    lats, lons = to_geo(GeoOrigin(lat_deg, lon_deg), east, north)
    items: list[MissionItem] = []

    def add_item(
        command: int, frame: int, params: tuple[float, float, float, float], lat: float, lon: float, altitude: float
    ) -> None:
        """Append a mission item with the next number; position and altitude are rounded as in a mission file.

        lat, lon: degrees.
        altitude: m, in the altitude frame of the item.
        """
        number = len(items) + 1
        items.append(
            MissionItem(number, command, frame, params, round_to_grid(lat), round_to_grid(lon), round(altitude, 2))
        )

    speed = math.nan
    for (_, _, altitude, leg_airspeed), lat, lon in zip(waypoints, lats.tolist(), lons.tolist(), strict=True):
        if leg_airspeed != speed and items:
            add_item(int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), (0.0, leg_airspeed, -1.0, 0.0), 0.0, 0.0, 0.0)
        speed = leg_airspeed
        add_item(
            int(Command.NAV_WAYPOINT), int(Frame.GLOBAL_RELATIVE_ALT), (0.0, 0.0, 0.0, 0.0), lat, lon, altitude - ground
        )
    return Mission(
        Home(round_to_grid(lat_deg), round_to_grid(lon_deg), ground), tuple(items), source="identify.waypoints"
    )


def _lay_out_waypoints(
    aircraft: Aircraft, envelope: Envelope, start_altitude: float, repeats: int, max_rates: tuple[float, float]
) -> Iterator[tuple[float, float, float, float]]:
    """Yield for each waypoint east, north and altitude, m, and the airspeed on the leg to it, m/s.

    start_altitude: altitude of the first waypoint, m AMSL.
    repeats, max_rates: see `make_identification_mission`.
    """
    cruise = aircraft.airspeed
    # Slow and fast legs are flown at a distance from the airspeed limits.
    slow_speed = aircraft.airspeed_min + 0.15 * (cruise - aircraft.airspeed_min)
    fast_speed = cruise + 0.6 * (aircraft.airspeed_max - cruise)
    medium_speed = 0.5 * (slow_speed + cruise)
    # Airspeed, duration (s), and -1, 0 or 1 for descent, level flight and climb.
    sequence = (
        (cruise, _LEVEL_RUN_TIME_S, 0),
        (cruise, _SLOPE_TIME_S, 1),
        (slow_speed, _LEVEL_RUN_TIME_S, 0),
        (cruise, _SLOPE_TIME_S, -1),
        (fast_speed, _LEVEL_RUN_TIME_S, 0),
        (medium_speed, _SLOPE_TIME_S, 1),
        (cruise, _LEVEL_RUN_TIME_S, 0),
        (fast_speed, _SLOPE_TIME_S, -1),
        (medium_speed, _LEVEL_RUN_TIME_S, 0),
        (cruise, _SLOPE_TIME_S, 1),
        (0.5 * (cruise + fast_speed), _LEVEL_RUN_TIME_S, 0),
        (cruise, _SLOPE_TIME_S, -1),
    )
    east = north = 0.0
    altitude, heading = start_altitude, 0.0
    yield east, north, altitude, cruise
    for _ in range(repeats):
        for number, (speed, seconds, vertical_direction) in enumerate(sequence):
            # Add length for the turns at both ends of the leg.
            length = speed * seconds + 2.0 * speed * speed / 9.81
            climb, descent = envelope.air_angles(speed, altitude)
            steepest, max_rate = (climb, max_rates[0]) if vertical_direction > 0 else (descent, max_rates[1])
            rate_angle = math.asin(min(1.0, _RATE_FRACTION * max_rate / speed))
            angle = min(steepest * _SLOPE_FRACTION, rate_angle) if vertical_direction else 0.0
            altitude = max(
                start_altitude - 60.0,
                altitude + vertical_direction * length * math.tan(max(0.0, angle) if math.isfinite(angle) else 0.0),
            )
            east += length * math.sin(heading)
            north += length * math.cos(heading)
            yield east, north, altitude, speed
            # Four right turns, then four left turns.
            heading += 0.5 * math.pi if number // 4 % 2 == 0 else -0.5 * math.pi
