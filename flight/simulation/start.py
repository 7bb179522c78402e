"""Start a flight: trimmed in the air on its route, or released from a rail, a hand or a runway."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aircraft.catalog import Aircraft
from aircraft.contacts import Gear, find_contacts
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import Trim
from flight.mission.ground_ways import GroundPhases, TakeOff
from flight.simulation.local_map import Ground, LocalMap
from flight.simulation.setup import FlightSetup
from world.errors import FlightError, StartError
from world.frames import to_geo


@dataclass(frozen=True, slots=True)
class Start:
    """Position, course, airspeed and wind at the start of a route.

    lat_deg, lon_deg: geodetic.
    amsl: altitude of the aircraft, m.
    course: true course of the first leg, rad.
    slope: slope of the first leg, rad.
    airspeed: m/s, true.
    wind: velocity of the air, north, east and down, m/s.
    ground: altitude of the ground, m AMSL.
    """

    lat_deg: float
    lon_deg: float
    amsl: float
    course: float
    slope: float
    airspeed: float
    wind: tuple[float, float, float]
    ground: float


def find_start(
    setup: FlightSetup,
    local_map: LocalMap,
    ground: Ground,
    aircraft: Aircraft,
    airspeed: float,
    offset: tuple[float, float, float],
) -> Start:
    """Return the start of the route, with the airspeed limited to the aircraft's range.

    airspeed: airspeed of the first leg, m/s.
    offset: east, north and up from the first waypoint to the start, m.

    Raises StartError if the start is not above the terrain.
    """
    points = setup.route.positions
    east, north, up = (float(value + offset_part) for value, offset_part in zip(points[0], offset, strict=True))
    ground_altitude = ground.height(east, north)
    if not math.isnan(ground_altitude) and up <= ground_altitude:
        reason = f"start at {up:.0f} m AMSL: not above the terrain, which is at {ground_altitude:.0f} m"
        raise StartError(setup.mission.source, reason, field="start", value=up)
    lat, lon = (float(value) for value in to_geo(setup.scenario.origin, east, north))
    first_leg = points[1] - points[0]
    convergence = local_map.convergence(lat, lon)
    # If the aircraft cannot hold the airspeed or the first slope, the flight starts level at the nearest airspeed that
    # the aircraft can hold; the verdict reports it.
    return Start(
        lat_deg=lat,
        lon_deg=lon,
        amsl=up,
        course=math.atan2(first_leg[0], first_leg[1]) - convergence,
        slope=math.atan2(first_leg[2], math.hypot(first_leg[0], first_leg[1])),
        airspeed=min(aircraft.airspeed_max, max(aircraft.airspeed_min, airspeed)),
        wind=_find_wind(setup, (east, north, up), convergence),
        ground=min(0.0, up - 1000.0) if math.isnan(ground_altitude) else ground_altitude,
    )


def _find_wind(setup: FlightSetup, position: Sequence[float], convergence: float) -> tuple[float, float, float]:
    """Return the mean wind at a position (east, north, up, m) at the start, true north, east and down, m/s.

    convergence: grid convergence, the map course of true north, rad.
    """
    east, north = setup.scenario.wind_velocity(position)
    # The wind of a forecast is along true north, and a stated wind along the map's north.
    angle = convergence if setup.scenario.wind.field is None else 0.0
    return *_to_true_north(east, north, angle), 0.0


def start_trimmed(fdm: Fdm, source: str, start: Start) -> Trim:
    """Start the aircraft trimmed on the slope of the first leg, or level if it cannot hold that slope.

    source: file of the mission, for messages.

    Raises StartError if the aircraft can fly neither the slope nor level.
    """
    start_values = (start.lat_deg, start.lon_deg, start.amsl, start.course, start.airspeed)
    try:
        trimmed = fdm.start(*start_values, start.slope, start.wind, start.ground)
    except FlightError:
        try:
            trimmed = fdm.start(*start_values, 0.0, start.wind, start.ground)
        except FlightError as error:
            error_fields = {"field": error.field, "value": error.value, "allowed": error.allowed}
            raise StartError(source, str(error), **error_fields) from error
    # Mean wind is set as part of the gust.
    fdm.set_wind(0.0, 0.0, 0.0)
    fdm.set_gust(*start.wind)
    return trimmed


# ----------------------------------------------------------------------
# Start from the ground.


@dataclass(frozen=True, slots=True)
class Release:
    """State of the aircraft at its release.

    position: latitude and longitude, deg, and altitude, m AMSL.
    attitude: roll, pitch, yaw (true), rad.
    velocity: velocity of the aircraft over the ground, north, east and down, m/s.
    wind: velocity of the air, north, east and down, m/s.
    ground: altitude of the ground, m AMSL.
    """

    position: tuple[float, float, float]
    attitude: tuple[float, float, float]
    velocity: tuple[float, float, float]
    wind: tuple[float, float, float]
    ground: float


def default_gear(ground_phases: GroundPhases) -> Gear:
    """Return the gear that is added to a model without contacts: wheels for a runway, otherwise a belly."""
    return (
        "wheels" if ground_phases.take_off is not None and ground_phases.take_off.launch.method == "runway" else "belly"
    )


def find_release(
    setup: FlightSetup, local_map: LocalMap, ground: Ground, aircraft: Aircraft, take_off: TakeOff
) -> Release:
    """Return the state of the aircraft at the release: at the end of the launch, or at rest on the runway."""
    launch = take_off.launch
    position, velocity = take_off.release()
    if launch.method == "runway":
        stand_heights = [contact.down for contact in find_contacts(aircraft, "wheels") if contact.is_support]
        position[2] += max(stand_heights, default=0.0)
    lat, lon = (float(value) for value in to_geo(setup.scenario.origin, position[0], position[1]))
    convergence = local_map.convergence(lat, lon)
    ground_altitude = ground.height(float(position[0]), float(position[1]))
    return Release(
        position=(lat, lon, float(position[2])),
        attitude=(0.0, launch.incline, take_off.course - convergence),
        velocity=(*_to_true_north(float(velocity[0]), float(velocity[1]), convergence), -float(velocity[2])),
        wind=_find_wind(setup, position.tolist(), convergence),
        ground=float(take_off.home[2]) if math.isnan(ground_altitude) else ground_altitude,
    )


def _to_true_north(east: float, north: float, convergence: float) -> tuple[float, float]:
    """Return the true north and east components of a map vector.

    convergence: grid convergence, the map course of true north, rad.
    """
    cos, sin = math.cos(convergence), math.sin(convergence)
    return north * cos + east * sin, east * cos - north * sin


def release(
    fdm: Fdm, release_state: Release, commands: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Release the aircraft with elevator, aileron, rudder and throttle commands, and return these commands."""
    fdm.release(
        release_state.position,
        release_state.attitude,
        release_state.velocity,
        wind=release_state.wind,
        terrain_amsl=release_state.ground,
        commands=commands,
    )
    # Mean wind is set as part of the gust.
    fdm.set_wind(0.0, 0.0, 0.0)
    fdm.set_gust(*release_state.wind)
    return commands
