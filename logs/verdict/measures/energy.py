"""Predict the energy of steady flight along a route from the aircraft's envelope."""

import math
from functools import cache

import numpy as np

from aircraft.envelope import ground_speed
from logs.verdict.measures.route_requirements import RouteRequirements
from world.errors import StartError

# A mission is not flown if its predicted energy exceeds this multiple of the energy carried, because the flight would
# show nothing new.
MAX_ENERGY_RATIO = 2.0


def predicted_energy(requirements: RouteRequirements) -> tuple[float, float]:
    """Predict the energy (Wh) and peak current (A) of steady flight along a route; NaN without power data.

    Each leg is flown at its commanded airspeed, its slope over the ground in the mean wind, and its mean altitude.  The
    prediction leaves out turns and gusts, which take a few per cent more.
    """
    volts = requirements.setup.envelope.volts
    energies, peak_power = leg_energies(requirements)
    return float(sum(energies)), peak_power / volts if volts else math.nan


def leg_energies(requirements: RouteRequirements) -> tuple[list[float], float]:
    """Predict the energy of steady flight on each leg (Wh), and the peak power (W).

    Both are NaN without power data.
    """
    envelope, route = requirements.setup.envelope, requirements.route
    if not np.isfinite(requirements.ground_speed).all():
        return [math.nan] * requirements.legs, math.nan
    energies, peak_power = [], 0.0
    # The laps of a loiter have equal legs, so each power is computed only once.
    power_at = cache(envelope.power)
    leg_durations = np.bincount(
        requirements.path.legs, weights=np.diff(requirements.path.times), minlength=requirements.legs
    )
    for leg, duration in enumerate(leg_durations):
        speed = float(route.leg_airspeeds[leg])
        altitude = float(0.5 * (requirements.points[leg, 2] + requirements.points[leg + 1, 2]))
        power = power_at(speed, altitude, air_climb_angle(requirements, leg, speed, altitude))
        energies.append(power * float(duration) / 3600.0)
        peak_power = max(peak_power, power) if math.isfinite(power) else math.nan
    return energies, peak_power


def air_climb_angle(requirements: RouteRequirements, leg: int, speed: float, altitude: float) -> float:
    """Return the climb angle relative to the air on a leg in the mean wind, rad; negative in a descent.

    The angle is found by iteration, because the ground speed depends on it.

    speed: true airspeed, m/s.
    altitude: altitude at which the wind is taken, m AMSL.
    """
    tailwind, crosswind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), altitude)
    slope, angle = math.tan(float(requirements.slopes[leg])), 0.0
    for _ in range(4):
        ground_track_speed = ground_speed(speed * math.cos(angle), tailwind, crosswind)
        angle = math.asin(min(1.0, max(-1.0, slope * ground_track_speed / speed)))
    return angle


def check_energy(requirements: RouteRequirements) -> None:
    """Raise StartError if the predicted energy exceeds `MAX_ENERGY_RATIO` times the energy carried.

    The prediction is skipped if even full power throughout the flight would not exceed this energy.
    """
    setup = requirements.setup
    duration = setup.path.length / float(setup.demanded_route.leg_airspeeds.min())
    full_power = setup.envelope.power_full
    full_energy = float(np.nanmax(full_power, initial=0.0)) * duration / 3600.0
    if full_energy <= MAX_ENERGY_RATIO * setup.battery:
        return
    energy_ratio = predicted_energy(requirements)[0] / setup.battery
    if energy_ratio > MAX_ENERGY_RATIO:
        reason = f"the mission needs {energy_ratio:.0f} times the energy carried"
        raise StartError(setup.mission.source, reason, field="energy", value=energy_ratio)
