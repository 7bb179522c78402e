"""A landing that is aborted, within a few milliseconds: ArduPlane's law steers a point mass back to its line-up.

The law is that of `AP_Landing::type_slope_verify_abort_landing` and `restart_landing_sequence` (libraries/AP_Landing)
and of `Plane::takeoff_calc_pitch`, `takeoff_calc_throttle` (ArduPlane/takeoff.cpp) in ArduPlane 4.6.  With its wings
level it climbs at the pitch of the last take-off with the throttle open, until it is higher over *home* than its height
for that says.  Where the field lies higher than home that may be at once.  Then it flies from where it is to the first
place of the landing sequence, turning on the short side, on a straight slope from the height that it has, and by the
sequence's other places back to the line-up.

The point mass and the law of each way are those of `flight.autopilots.arduplane.swift_return`.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.point_mass import PointMass
from flight.autopilots.arduplane.swift_return import (
    CLIMB,
    RETURN_FLOWN,
    RETURN_START,
    Surroundings,
    SwiftReturns,
    fill_stage,
    fly_stages,
    most_seconds,
    straight_on,
    until_circle,
)
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.mission.return_path import LandingStart
from world.kernels import Record, Records
from world.wind import mean_wind_speed

Floats = NDArray[np.float64]


def aborted_at(place: Sequence[float], course: float, slope: float, airspeed: float, aircraft: PointMass) -> Records:
    """(1,) of `flight.autopilots.arduplane.swift_return.RETURN_START`: on a glide, where its landing is aborted.

    place: east, north, up, m.  course: of the glide over the ground, rad.  slope: of the glide, m per m.
    airspeed: true, m/s.  The wind is the aircraft's.
    """
    start: Records = np.zeros(1, RETURN_START)
    made = aircraft.record
    blows = mean_wind_speed(made.wind_speed, made.wind_gradient, made.wind_reference, float(place[2]))
    east, north = blows * made.wind_east, blows * made.wind_north
    sin, cos = math.sin(course), math.cos(course)
    across = east * cos - north * sin
    over = max(1.0, math.sqrt(max(1.0, airspeed * airspeed - across * across)) + east * sin + north * cos)
    start["east"], start["north"], start["up"] = place
    start["velocity_east"], start["velocity_north"], start["velocity_up"] = over * sin, over * cos, -over * slope
    return start


def fly_go_arounds(
    starts: Records,
    top: float,
    pitch: float,
    sequence: Sequence[LandingStart],
    parameters: ArduPilotParameters,
    aircraft: PointMass,
    around: Surroundings,
) -> SwiftReturns:
    """Fly a go-around from each of n places on a glide to the last place of a landing sequence; their ways are kept.

    starts: (n,) of `flight.autopilots.arduplane.swift_return.RETURN_START`.
    top: height above which the climb ends, m AMSL.  pitch: of the climb, rad.
    sequence: the places to fly to.  One that is a circle is the last: the go-around is over once around it.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.autopilots.arduplane.parameters import load_parameters
    >>> from flight.autopilots.arduplane.point_mass import point_mass
    >>> from flight.autopilots.arduplane.swift_return import surroundings
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> from world.wind import Wind
    >>> aerosonde = load_aircraft("aerosonde")
    >>> made = point_mass(aerosonde, load_envelope(aerosonde), 25.0, Wind())
    >>> start = aborted_at((0.0, 0.0, 800.0), 0.0, 0.06, 20.0, made)
    >>> behind = [LandingStart(3, (800.0, -400.0, 860.0), (800.0, -400.0, 860.0))]
    >>> world, law = surroundings(load_scenario("jacksboro")), load_parameters(aerosonde)
    >>> (way,) = fly_go_arounds(start, 840.0, 0.17, behind, law, made, world).ways
    >>> k = int(np.argmax(way[:, 2] > 840.0))
    >>> bool(abs(way[k, 0]) < 1.0), bool(abs(way[-1, 0] - 800.0) < 100.0), bool(way[:, 2].min() > 797.0)
    (True, True, True)
    """
    stages = _stages(sequence, parameters)
    flown = np.zeros(len(starts), RETURN_FLOWN)
    law, staged, climb = parameters.record(), _climbing(parameters, pitch), np.zeros(1, CLIMB)[0]
    climb.climbs, climb.top, climb.slew = True, top, parameters.throttle_slew or math.inf
    climb.throttle = parameters.takeoff_throttle or parameters.throttle_max
    ways = []
    for k, start in enumerate(starts):
        ends = np.concatenate([straight_on(start), stages])
        ends["airspeed"] = aircraft.record.airspeed
        most = most_seconds(start, ends[1:], aircraft) + max(0.0, top - float(start["up"]))
        way = np.zeros((int(most) + 2, 3))
        fly_stages(
            start, ends, law, staged, climb, aircraft.record, aircraft.excess, aircraft.power, around.heights,
            around.to_pixel, around.spheres, around.radii, around.known, most,
            -math.inf, -math.inf, False, way, flown[k],
        )  # fmt: skip
        ways.append(way[: int(flown[k]["rows"])].copy())
    return SwiftReturns(flown, tuple(ways))


def _climbing(parameters: ArduPilotParameters, pitch: float) -> Record:
    """The parameters of the climb, as of a take-off: speed by pitch, and a pitch that is held."""
    staged = parameters.record()
    staged.tecs_speed_weight = 2.0
    staged.tecs_pitch_min = 0.0
    staged.pitch_limit_min = staged.pitch_limit_max = pitch
    return staged


def _stages(sequence: Sequence[LandingStart], parameters: ArduPilotParameters) -> Records:
    """(n,) of `flight.guidance.lateral_reference_laws.WAYPOINT`: the places up to the first circle."""
    flown = until_circle(sequence)
    stages: Records = np.zeros(len(flown), WAYPOINT)
    for stage, one in zip(stages, flown, strict=True):
        fill_stage(stage, one, parameters)
    return stages
