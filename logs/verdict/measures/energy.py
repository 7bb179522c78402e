"""Predict the energy that a route takes in steady flight on each leg, from the aircraft's envelope."""

import math

import numpy as np

from aircraft.envelope import ground_speed
from logs.verdict.measures.route_requirements import RouteRequirements


def predicted_energy(requirements: RouteRequirements) -> tuple[float, float]:
    """Predict the energy (Wh) and peak current (A) of steady flight along a route; NaN if the power is not known.

    Each leg is flown at its commanded airspeed, its slope over the ground in the mean wind, and its mean height; turns
    and gusts take a few per cent more.
    """
    volts = requirements.setup.envelope.volts
    energies, most = leg_energies(requirements)
    return float(sum(energies)), most / volts if volts else math.nan


def leg_energies(requirements: RouteRequirements) -> tuple[list[float], float]:
    """Predict the energy (Wh) of steady flight on each leg, and the highest power (W); NaN if it is not known."""
    envelope, route = requirements.setup.envelope, requirements.route
    if not np.isfinite(requirements.ground_speed).all():
        return [math.nan] * requirements.legs, math.nan
    energies, most = [], 0.0
    seconds_on = np.bincount(
        requirements.path.legs, weights=np.diff(requirements.path.times), minlength=requirements.legs
    )
    for leg, seconds in enumerate(seconds_on):
        speed, up = (
            float(route.airspeed[leg]),
            float(0.5 * (requirements.points[leg, 2] + requirements.points[leg + 1, 2])),
        )
        power = envelope.power(speed, up, air_angle(requirements, leg, speed, up))
        energies.append(power * float(seconds) / 3600.0)
        most = max(most, power) if math.isfinite(power) else math.nan
    return energies, most


def air_angle(requirements: RouteRequirements, leg: int, speed: float, up: float) -> float:
    """Return the path angle relative to the air on a leg, in the mean wind at an altitude (m AMSL), rad."""
    tail, cross = requirements.setup.scenario.wind.along(float(requirements.courses[leg]), up)
    rise, angle = math.tan(float(requirements.slopes[leg])), 0.0
    for _ in range(4):
        along = ground_speed(speed * math.cos(angle), tail, cross)
        angle = math.asin(min(1.0, max(-1.0, rise * along / speed)))
    return angle
