"""Radio link between a ground station and an aircraft over terrain.

The loss is the free-space loss (ITU-R P.525-4, equation 4) plus the diffraction loss over the terrain by the Bullington
construction (ITU-R P.526-15, section 4.5.1, equations 47 to 55), with an Earth of 4/3 of its radius.  Not modelled:
vegetation, buildings, rain, reflections, antenna patterns, and shadowing by the airframe.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from world.arrays import Flags, Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.map_positions import map_coordinates
from world.scenario_tables import LinkTable
from world.terrain import Terrain

# Speed of light, m/s.
LIGHT_SPEED_MPS = 299_792_458.0
# Effective radius of the Earth for radio rays in the lower atmosphere, m: 4/3 of 6371 km (ITU-R P.526-15, section 1).
EFFECTIVE_EARTH_RADIUS_M = 6_371_000.0 * 4.0 / 3.0
# Smallest distance for which the loss is computed, m: nearer, the formula of the far field does not apply.
MIN_DISTANCE_M = 10.0
# Diffraction parameter below which a knife edge causes no loss (ITU-R P.526-15, equation 31).
_MIN_DIFFRACTION_PARAMETER = -0.78
# Largest number of ground heights on one path.
_MAX_PROFILE_POINTS = 4000

LinkUse = Literal["telemetry", "control"]


@dataclass(frozen=True, slots=True)
class RadioLink:
    """Radio link of a scenario.

    use: "telemetry" for the link of the ground station, "control" for the pilot's remote control.
    station: east and north of the station's antenna, m; None for the mission's home.
    antenna_height: height of that antenna above ground, m.
    frequency: Hz.
    allowed_loss: largest loss between the antennas that leaves the fade margin, dB.
    max_outage: longest time below the fade margin that the verdict accepts, s.
    """

    use: LinkUse
    station: tuple[float, float] | None
    antenna_height: float
    frequency: float
    allowed_loss: float
    max_outage: float

    @property
    def wavelength(self) -> float:
        """Wavelength, m."""
        return LIGHT_SPEED_MPS / self.frequency


def make_link(table: LinkTable | None, source: str, origin: GeoOrigin, ground: Terrain | None) -> RadioLink | None:
    """Convert a scenario's [link] table to a radio link; return None if there is no table.

    Raises ScenarioError for a station at a position with unknown ground.
    """
    if table is None:
        return None
    station = None
    if table.east_m is not None or table.lat_deg is not None:
        station = map_coordinates(table, origin)
        if ground is not None and math.isnan(float(ground.height(*station))):
            position = f"east {station[0]:.0f} m, north {station[1]:.0f} m"
            message = f"{source}: link: {position}: the elevation file has no data there"
            raise ScenarioError(message, file=source, field="link")
    gains = table.station_gain_dbi + table.aircraft_gain_dbi - table.cable_loss_db
    allowed_loss = table.power_dbm + gains - table.sensitivity_dbm - table.fade_margin_db
    return RadioLink(table.use, station, table.antenna_m, 1e6 * table.frequency_mhz, allowed_loss, table.max_outage_s)


def free_space_loss(distance: float, frequency: float) -> float:
    """Return the free-space loss, dB (ITU-R P.525-4).

    distance: m.
    frequency: Hz.

    >>> round(free_space_loss(1000.0, 1e9), 2)
    92.45
    """
    return 20.0 * math.log10(4.0 * math.pi * max(MIN_DISTANCE_M, distance) * frequency / LIGHT_SPEED_MPS)


def knife_edge_loss(diffraction_parameter: float) -> float:
    """Return the loss of a knife edge, dB (ITU-R P.526-15, equation 31).

    diffraction_parameter: without unit, positive if the edge is above the ray (equation 26).

    >>> round(knife_edge_loss(0.0), 2), knife_edge_loss(-1.0)
    (6.03, 0.0)
    """
    if diffraction_parameter <= _MIN_DIFFRACTION_PARAMETER:
        return 0.0
    shifted = diffraction_parameter - 0.1
    return 6.9 + 20.0 * math.log10(math.sqrt(shifted * shifted + 1.0) + shifted)


class PathProfile(NamedTuple):
    """Ground between two antennas.

    distances: (n,) distances from the station along the ground, m, without both ends.
    altitudes: (n,) of the ground, m AMSL, raised by the bulge of the Earth between the antennas.
    length: distance between the antennas along the ground, m.
    """

    distances: Floats
    altitudes: Floats
    length: float


class PathLoss(NamedTuple):
    """Loss between two antennas.

    loss: dB; NaN if the ground is unknown.
    diffraction_loss: part of the loss that the terrain causes, dB.
    is_visible: True if the straight line between the antennas is clear of the ground.
    fresnel_clearance: smallest clearance over the ground as a ratio of the first Fresnel zone's radius; inf for a path
        without ground between its ends.
    """

    loss: float
    diffraction_loss: float
    is_visible: bool
    fresnel_clearance: float


def path_profile(terrain: Terrain, station: Floats, aircraft: Floats) -> PathProfile:
    """Sample the ground between two antennas at the spacing of the terrain.

    station, aircraft: positions of the antennas, (3,) m.
    """
    length = math.dist(station[:2], aircraft[:2])
    count = min(_MAX_PROFILE_POINTS, math.ceil(length / max(1.0, terrain.spacing)))
    fractions = np.arange(1, count) / max(1, count)
    east = station[0] + fractions * (aircraft[0] - station[0])
    north = station[1] + fractions * (aircraft[1] - station[1])
    distances = fractions * length
    bulge = distances * (length - distances) / (2.0 * EFFECTIVE_EARTH_RADIUS_M)
    return PathProfile(distances, terrain.height(east, north) + bulge, length)


def path_loss(profile: PathProfile, station_altitude: float, aircraft_altitude: float, frequency: float) -> PathLoss:
    """Return the radio loss between two antennas over a ground profile; NaN if the ground is unknown.

    station_altitude, aircraft_altitude: altitudes of the antennas, m AMSL.
    frequency: Hz.
    """
    slant_distance = math.hypot(profile.length, aircraft_altitude - station_altitude)
    free_loss = free_space_loss(slant_distance, frequency)
    if not profile.distances.size:
        return PathLoss(free_loss, 0.0, True, math.inf)
    if np.isnan(profile.altitudes).any():
        return PathLoss(math.nan, math.nan, False, math.nan)
    wavelength, remaining = LIGHT_SPEED_MPS / frequency, profile.length - profile.distances
    ray = station_altitude + (aircraft_altitude - station_altitude) * profile.distances / profile.length
    excess = profile.altitudes - ray
    # Radius of the first Fresnel zone (ITU-R P.526-15, equation 2).
    fresnel_radii = np.sqrt(wavelength * profile.distances * remaining / profile.length)
    diffraction_loss = _bullington_loss(profile, excess, fresnel_radii, station_altitude, aircraft_altitude, wavelength)
    return PathLoss(
        free_loss + diffraction_loss,
        diffraction_loss,
        bool((excess < 0.0).all()),
        float((-excess / fresnel_radii).min()),
    )


def _bullington_loss(
    profile: PathProfile,
    excess: Floats,
    fresnel_radii: Floats,
    station_altitude: float,
    aircraft_altitude: float,
    wavelength: float,
) -> float:
    """Return the diffraction loss of a profile, dB (ITU-R P.526-15, section 4.5.1).

    excess: (n,) height of the ground over the straight line between the antennas, m.
    """
    length = profile.length
    # Slopes towards the highest obstacle in sight from either end, and between both ends (equations 47, 51 and 48).
    station_slope = float(((profile.altitudes - station_altitude) / profile.distances).max())
    path_slope = (aircraft_altitude - station_altitude) / length
    if station_slope <= path_slope:
        # Equation 49; sqrt(2) times the height in radii of the first Fresnel zone is the diffraction parameter.
        parameter = math.sqrt(2.0) * float((excess / fresnel_radii).max())
    else:
        aircraft_slope = float(((profile.altitudes - aircraft_altitude) / (length - profile.distances)).max())
        # The edge where both slopes meet (equations 52 and 53).
        distance = (aircraft_altitude - station_altitude + aircraft_slope * length) / (station_slope + aircraft_slope)
        distance = min(max(distance, 1e-3 * length), (1.0 - 1e-3) * length)
        edge = station_altitude + station_slope * distance
        ray = station_altitude + path_slope * distance
        parameter = (edge - ray) * math.sqrt(2.0 * length / (wavelength * distance * (length - distance)))
    edge_loss = knife_edge_loss(parameter)
    # Equation 55, with the length in kilometres.
    return edge_loss + (1.0 - math.exp(-edge_loss / 6.0)) * (10.0 + 0.02 * length / 1000.0)


class LinkPoints(NamedTuple):
    """Link between the station and points of a path.

    margin: (t,) loss that is left before the fade margin is used, dB; negative below it; NaN over unknown ground.
    distance: (t,) slant distance from the station, m.
    diffraction_loss: (t,) dB.
    is_visible: (t,) True if the straight line is clear of the ground.
    fresnel_clearance: (t,) see `PathLoss`.
    """

    margin: Floats
    distance: Floats
    diffraction_loss: Floats
    is_visible: Flags
    fresnel_clearance: Floats


def link_points(link: RadioLink, terrain: Terrain, station: Floats, positions: Floats) -> LinkPoints:
    """Compute the radio link between a station and each position of the aircraft.

    station: antenna, (3,) m.
    positions: (t, 3) m.
    """
    losses = [
        path_loss(path_profile(terrain, station, position), float(station[2]), float(position[2]), link.frequency)
        for position in positions
    ]
    loss, diffraction_loss, is_visible, fresnel_clearance = np.array(losses, dtype=np.float64).reshape(-1, 4).T
    return LinkPoints(
        link.allowed_loss - loss,
        np.asarray(np.linalg.norm(positions - station, axis=1)),
        diffraction_loss,
        is_visible > 0.0,
        fresnel_clearance,
    )
