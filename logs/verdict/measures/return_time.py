"""Bound the duration of a return to launch, and the battery time left after the mission.

The return may start at any place of the mission.

Both bounds are conservative, so that a failsafe that compares the two (PX4's `rtlEstimateCheck`) certainly does not act
if the battery lasts longer than the return.
"""

import math

import numpy as np

from flight.autopilots.parts import ReturnTimeFailsafe
from flight.mission.placing import landing_starts, return_points
from logs.verdict.measures.route_requirements import RouteRequirements
from world.arrays import Floats

_SECONDS_PER_HOUR = 3600.0
_MAH_PER_AH = 1000.0


def longest_return_time(requirements: RouteRequirements, failsafe: ReturnTimeFailsafe) -> float:
    """Return an upper bound on the duration of a return to launch from anywhere on the mission, s.

    Return inf if there is neither a home nor a rally point, or if the wind is as fast as the aircraft.

    The bound is the sum of four times:
    - the delay of the failsafe;
    - the longest path to a destination and through a landing sequence, against the strongest wind; a failsafe that
      follows the mission adds the length of the mission;
    - the climb from the lowest place;
    - the descent to the lowest destination.
    """
    setup = requirements.setup
    whole_requirements = requirements if requirements.ground_phases is None else requirements.ground_phases.whole_route
    places = whole_requirements.path.points
    home_and_rally = return_points(setup.mission, setup.scenario.origin, setup.scenario.terrain)
    sequences = [
        [stop.position for stop in (start, *start.next_stops)] + ([start.landing] if start.landing else [])
        for start in landing_starts(setup.mission, setup.scenario.origin, setup.scenario.terrain)
    ]
    winds = {setup.scenario.wind, *requirements.winds}
    speed = failsafe.airspeed - max(wind.max_speed_at(places[:, 2]) for wind in winds)
    if not home_and_rally or speed <= 0.0:
        return math.inf
    # The last place covers a landing without DO_LAND_START.
    destinations = np.array(
        [*[end[:3] for end in home_and_rally], *[stop for stops in sequences for stop in stops], places[-1]]
    )
    distance = float(np.hypot(*(places[:, None, :2] - destinations[None, :, :2]).transpose(2, 0, 1)).max())
    distance += max((_path_length(np.array(stops)) for stops in sequences), default=0.0)
    distance += _path_length(places) if failsafe.follows_mission else 0.0
    transit_altitude = float(destinations[:, 2].max()) + failsafe.altitude
    climb = max(0.0, transit_altitude - float(places[:, 2].min()))
    descent = max(transit_altitude, float(places[:, 2].max())) - float(destinations[:, 2].min())
    return distance / speed + climb / failsafe.climb_rate + descent / failsafe.sink_rate + failsafe.delay


def _path_length(places: Floats) -> float:
    """Return the horizontal length of a polyline through points (n, 3), m."""
    return float(np.hypot(*np.diff(places[:, :2], axis=0).T).sum())


def remaining_battery_time(
    requirements: RouteRequirements, failsafe: ReturnTimeFailsafe, energy: float, power_factor: float
) -> float:
    """Return a lower bound on the remaining battery time that the autopilot estimates after a flight, s.

    Return NaN if the battery's voltage is unknown.

    PX4 divides the remaining charge by its average of the current in level flight, whose initial value is a parameter
    (`Battery::computeRemainingTime`).

    energy: energy that the flight has used, Wh.
    power_factor: factor by which the power of the aircraft's model is multiplied.
    """
    envelope, route = requirements.setup.envelope, requirements.route
    if not envelope.volts:
        return math.nan
    altitudes = 0.5 * (requirements.points[:-1, 2] + requirements.points[1:, 2])
    flights = {(float(speed), float(amsl)) for speed, amsl in zip(route.leg_airspeeds, altitudes, strict=True)}
    level_power = float(np.max([envelope.power(speed, amsl, 0.0) for speed, amsl in flights]))
    current = float(np.maximum(failsafe.initial_current, power_factor * level_power / envelope.volts))
    remaining_charge = failsafe.capacity / _MAH_PER_AH - energy / envelope.volts
    return remaining_charge / current * _SECONDS_PER_HOUR
