"""Radio link between a ground station and an aircraft over terrain.

The loss is the free-space loss (ITU-R P.525-4, equation 4) plus the diffraction loss over the terrain by the Bullington
construction (ITU-R P.526-15, section 4.5.1, equations 47 to 55), with an Earth of 4/3 of its radius.  Not modelled:
vegetation, buildings, rain, absorption by the air, reflections, antenna patterns, and shadowing by the airframe.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from world.arrays import Flags, Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.map_positions import map_coordinates
from world.scenario_tables import LinkTable, LinkUse
from world.terrain import STRAIGHT_PIECE_M, Terrain

# Speed of light, m/s.
LIGHT_SPEED_MPS = 299_792_458.0
# Effective radius of the Earth for radio rays in the lower atmosphere, m: 4/3 of 6371 km (ITU-R P.526-15, section 1).
EFFECTIVE_EARTH_RADIUS_M = 6_371_000.0 * 4.0 / 3.0
# Smallest distance for which the loss is computed, m: nearer, the formula of the far field does not apply.
MIN_DISTANCE_M = 10.0
# Smallest height of an aircraft's antenna above ground, m: an aircraft on the ground, or below it by an error of the
# terrain, is not behind the ground that it stands on.
MIN_AIRCRAFT_HEIGHT_M = 0.5
# Diffraction parameter below which a knife edge causes no loss (ITU-R P.526-15, equation 31).
_MIN_DIFFRACTION_PARAMETER = -0.78
# Smallest number of pieces of one path, between which the ground is sampled, whatever the spacing of the terrain.
_MIN_PROFILE_PIECES = 50
# Largest number of pieces of one path.
_MAX_PROFILE_PIECES = 4000


@dataclass(frozen=True, slots=True)
class RadioLink:
    """Radio link of a scenario.

    use: "telemetry" for the ground station, "control" for the pilot's remote control.
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


def station_position(table: LinkTable | None, origin: GeoOrigin) -> tuple[float, float] | None:
    """Return east and north of the station's antenna of a [link] table, m.

    Return None for the mission's home.
    """
    if table is None or (table.east_m is None and table.lat_deg is None):
        return None
    return map_coordinates(table, origin)


def make_link(table: LinkTable | None, source: str, origin: GeoOrigin, ground: Terrain | None) -> RadioLink | None:
    """Convert a scenario's [link] table to a radio link; None without a table.

    Raises ScenarioError for a station at a position with unknown ground.
    """
    if table is None:
        return None
    station = station_position(table, origin)
    if station is not None and ground is not None and math.isnan(float(ground.height(*station))):
        position = f"east {station[0]:.0f} m, north {station[1]:.0f} m"
        message = f"{source}: link: the elevation file has no data at the ground station, {position}"
        raise ScenarioError(message, file=source, field="link")
    gains = table.station_gain_dbi + table.aircraft_gain_dbi - table.cable_loss_db
    allowed_loss = table.power_dbm + gains - table.sensitivity_dbm - table.fade_margin_db
    return RadioLink(table.use, station, table.antenna_m, 1e6 * table.frequency_mhz, allowed_loss, table.max_outage_s)


def free_space_loss(distance: float, frequency: float) -> float:
    """Return the free-space loss, dB (ITU-R P.525-4).

    distance: m; below `MIN_DISTANCE_M` it is taken as `MIN_DISTANCE_M`.
    frequency: Hz.

    >>> round(free_space_loss(1000.0, 1e9), 2)
    92.45
    """
    return 20.0 * math.log10(4.0 * math.pi * max(MIN_DISTANCE_M, distance) * frequency / LIGHT_SPEED_MPS)


def knife_edge_loss(diffraction_parameter: float) -> float:
    """Return the diffraction loss at a knife edge, dB; never below 0 (ITU-R P.526-15, equation 31).

    diffraction_parameter: dimensionless; positive if the edge is above the ray (equation 26).

    >>> round(knife_edge_loss(0.0), 2), knife_edge_loss(-1.0)
    (6.03, 0.0)
    """
    if diffraction_parameter <= _MIN_DIFFRACTION_PARAMETER:
        return 0.0
    shifted = diffraction_parameter - 0.1
    return 6.9 + 20.0 * math.log10(math.sqrt(shifted * shifted + 1.0) + shifted)


def earth_bulge(distance: Floats, length: float) -> Floats:
    """Return the height by which the curved Earth rises above the straight line between two antennas, m.

    distance: distances from one antenna at which the height is computed, m.
    length: distance between the antennas, m.

    >>> round(float(earth_bulge(np.array([25_000.0]), 50_000.0)[0]), 1)
    36.8
    """
    return np.asarray(distance * (length - distance) / (2.0 * EFFECTIVE_EARTH_RADIUS_M))


def line_of_sight(terrain: Terrain, station: Floats, aircraft: Floats) -> bool | None:
    """Return True if the straight line between two antennas is clear of the ground.

    Return None if the ground is unknown.

    station, aircraft: positions of the antennas, (3,) m.

    The ground is interpolated bilinearly and raised by the bulge of the Earth. It is compared exactly, not at samples.
    """
    length = math.dist(station[:2], aircraft[:2])
    fractions = np.linspace(0.0, 1.0, max(1, math.ceil(length / STRAIGHT_PIECE_M)) + 1)
    points = station + fractions[:, None] * (aircraft - station)
    points[:, 2] -= earth_bulge(fractions * length, length)
    clearances = [terrain.clearance(start, end)[0] for start, end in pairwise(points)]
    return None if any(map(math.isnan, clearances)) else min(clearances) > 0.0


class PathProfile(NamedTuple):
    """Profile of the ground between two antennas.

    distances: (n,) distances from the station along the ground, m, without both ends.
    altitudes: (n,) altitudes of the ground, m AMSL, raised by the bulge of the Earth between the antennas.
    length: distance between the antennas along the ground, m.
    """

    distances: Floats
    altitudes: Floats
    length: float


class PathLoss(NamedTuple):
    """Loss between two antennas.

    loss: dB; NaN if the ground is unknown.
    diffraction_loss: part of the loss that the terrain causes, dB.
    fresnel_clearance: smallest clearance over the ground as a ratio of the first Fresnel zone's radius; inf for a path
        without ground between its ends.
    """

    loss: float
    diffraction_loss: float
    fresnel_clearance: float


def path_profile(terrain: Terrain, station: Floats, aircraft: Floats) -> PathProfile:
    """Return the ground profile between two antennas, sampled at the spacing of the terrain.

    The profile is empty for an aircraft within `MIN_DISTANCE_M` of the station on the map.

    station, aircraft: positions of the antennas, (3,) m.
    """
    length = math.dist(station[:2], aircraft[:2])
    pieces = max(_MIN_PROFILE_PIECES, min(_MAX_PROFILE_PIECES, math.ceil(length / max(1.0, terrain.spacing))))
    fractions = np.arange(1, pieces) / pieces if length >= MIN_DISTANCE_M else np.zeros(0)
    east = station[0] + fractions * (aircraft[0] - station[0])
    north = station[1] + fractions * (aircraft[1] - station[1])
    distances = fractions * length
    return PathProfile(distances, terrain.height(east, north) + earth_bulge(distances, length), length)


def path_loss(profile: PathProfile, station_altitude: float, aircraft_altitude: float, frequency: float) -> PathLoss:
    """Return the radio loss between two antennas over a ground profile, dB; NaN if the ground is unknown.

    station_altitude, aircraft_altitude: altitudes of the antennas, m AMSL.
    frequency: Hz.
    """
    slant_distance = math.hypot(profile.length, aircraft_altitude - station_altitude)
    free_loss = free_space_loss(slant_distance, frequency)
    if not profile.distances.size:
        return PathLoss(free_loss, 0.0, math.inf)
    if np.isnan(profile.altitudes).any():
        return PathLoss(math.nan, math.nan, math.nan)
    wavelength, aircraft_distances = LIGHT_SPEED_MPS / frequency, profile.length - profile.distances
    ray = station_altitude + (aircraft_altitude - station_altitude) * profile.distances / profile.length
    excess = profile.altitudes - ray
    # Radius of the first Fresnel zone (ITU-R P.526-15, equation 2).
    fresnel_radii = np.sqrt(wavelength * profile.distances * aircraft_distances / profile.length)
    diffraction_loss = _bullington_loss(profile, excess, fresnel_radii, station_altitude, aircraft_altitude, wavelength)
    return PathLoss(free_loss + diffraction_loss, diffraction_loss, float((-excess / fresnel_radii).min()))


def _bullington_loss(
    profile: PathProfile,
    excess: Floats,
    fresnel_radii: Floats,
    station_altitude: float,
    aircraft_altitude: float,
    wavelength: float,
) -> float:
    """Return the diffraction loss of a ground profile by the Bullington method, dB.

    The source is ITU-R P.526-15, section 4.5.1.

    excess: height of the ground above the straight line between the antennas, m, (n,).
    fresnel_radii: radius of the first Fresnel zone, m, (n,).
    station_altitude, aircraft_altitude: altitudes of the antennas, m AMSL.
    wavelength: m.
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

    margin: (t,) signal above the fade margin, dB; negative below the fade margin; NaN if the ground is unknown.
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
    """Compute the radio link between a ground station and each position of the aircraft.

    station: position of the station's antenna, (3,) m.
    positions: (t, 3) m; the aircraft's antenna is at least `MIN_AIRCRAFT_HEIGHT_M` above ground.
    """
    antennas = _aircraft_antennas(terrain, positions)
    loss, diffraction_loss, fresnel_clearance = _path_losses(link, terrain, station, antennas).T
    sights = [line_of_sight(terrain, station, antenna) for antenna in antennas]
    is_known = np.array([sight is not None for sight in sights], dtype=np.bool_)
    return LinkPoints(
        np.where(is_known, link.allowed_loss - loss, np.nan),
        np.asarray(np.linalg.norm(antennas - station, axis=1)),
        diffraction_loss,
        np.array(sights, dtype=np.bool_),
        fresnel_clearance,
    )


def link_margins(link: RadioLink, terrain: Terrain, station: Floats, positions: Floats) -> Floats:
    """Return the margin of the radio link at each position of the aircraft, dB, (t,).

    It is NaN if the ground is unknown.

    station: position of the station's antenna, (3,) m.
    positions: (t, 3) m.

    This takes half of the time of `link_points`, which also computes visibility and clearances.
    """
    losses = _path_losses(link, terrain, station, _aircraft_antennas(terrain, positions))[:, 0]
    return np.asarray(link.allowed_loss - losses)


def _aircraft_antennas(terrain: Terrain, positions: Floats) -> Floats:
    """Return positions raised to at least `MIN_AIRCRAFT_HEIGHT_M` above ground, (t, 3), m.

    Positions over unknown ground are unchanged.
    """
    antennas = np.array(positions, dtype=np.float64)
    lowest = terrain.height(antennas[:, 0], antennas[:, 1]) + MIN_AIRCRAFT_HEIGHT_M
    antennas[:, 2] = np.fmax(antennas[:, 2], lowest)
    return antennas


def _path_losses(link: RadioLink, terrain: Terrain, station: Floats, antennas: Floats) -> Floats:
    """Return the fields of `PathLoss` for the path from the station to each antenna, (t, 3).

    station, antennas: positions, (3,) and (t, 3) m.
    """
    losses = [
        path_loss(path_profile(terrain, station, antenna), float(station[2]), float(antenna[2]), link.frequency)
        for antenna in antennas
    ]
    return np.array(losses, dtype=np.float64).reshape(-1, 3)
