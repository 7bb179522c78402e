"""Compare the envelope's limits with flown limits: slopes, and the shortest leg between two turns."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aircraft.catalog import Aircraft, load_aircraft
from benchmarks.flight import flown_with
from flight.dynamics.envelope_tables import load_envelope
from flight.guidance.gains import load_gains
from flight.mission.items import Mission
from flight.mission.route import Route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import route_requirements
from world.arrays import Floats
from world.scenario import scenario_from_spec

# Course of the flights, rad.
COURSE = 0.5
# Altitude of the flights, m AMSL.
AMSL = 800.0
# Bank limit of the flights, rad.
BANK = math.radians(30.0)
# Largest decrease of the airspeed in a held climb, or increase in a held dive, m/s, mean of 5 s.
SPEED_HELD = 0.25
# Largest altitude error on a held slope, m.
HEIGHT_HELD = 1.0
# A leg is long enough if its turns are flown at the bank limit, as with a leg of `FAR` between them: the track within 2
# m of the fly-by path (the verdict allows 5 m), and the largest mean bank of 2 seconds at most half a degree above the
# limit, or above the bank of turns far apart (30.7 degrees on a 30 degree arc in calm air) if that is more, but at most
# `MAX_BANK`.  Guidance may not slow down for arcs here, as that would keep the bank in turns too tight for the
# airspeed.
# Length of a leg between independent turns, m.
FAR = 4000.0
# Largest cross-track error on a sufficient leg, m.
CROSS_HELD = 2.0
# Excess of the mean bank over the limit on a sufficient leg, rad.
BANK_HELD = math.radians(0.5)
# Upper limit of the mean bank in any case, rad.
MAX_BANK = BANK + math.radians(1.3)
# Number of bisection steps.
_BISECTIONS = 7


@dataclass(frozen=True, slots=True)
class Limit:
    """Predicted and flown limit.  Slopes in rad, positive in the direction of their name; legs in m.

    same_way: True if both turns of a leg have the same direction.

    optimistic: excess of the predicted over the flown limit; negative if the prediction is on the safe side.
    conservative: distance of the prediction inside the flown limit, as a fraction of it.
    """

    kind: str
    wind: float
    wind_from: float
    predicted: float
    flown: float
    same_way: bool = True

    @property
    def optimistic(self) -> float:
        """Excess of the prediction over the flown limit, in the limit's unit."""
        less = self.flown - self.predicted
        return less if self.kind == "leg" else -less

    @property
    def conservative(self) -> float:
        """Shortfall of the prediction, relative to the flown limit."""
        return -self.optimistic / self.flown


def made_setup(points: ArrayLike, aircraft: Aircraft, wind: float, wind_from: float) -> FlightSetup:
    """Make a flight through points at cruise over flat ground, in a steady wind.

    wind, wind_from: speed of the wind, m/s, and direction from which it blows, rad.
    """
    waypoints = np.array(points, dtype=np.float64)
    low, high = waypoints.min(axis=0) - 3000.0, waypoints.max(axis=0) + 3000.0
    ends = [
        dict(zip(("east_m", "north_m", "amsl_m"), map(float, p), strict=True)) for p in (waypoints[0], waypoints[-1])
    ]
    spec: dict[str, Any] = {
        "name": "limits",
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {
            "east_m": [float(low[0]), float(high[0])],
            "north_m": [float(low[1]), float(high[1])],
            "ceiling_amsl_m": 9000.0,
        },
        "start": ends[0],
        "destination": ends[1],
        "flight": {"aircraft": aircraft.name},
        "wind": {"speed_mps": wind, "from_deg": math.degrees(wind_from)},
    }
    route = Route(route_points(waypoints, aircraft.airspeed, item=np.arange(len(waypoints))), "")
    battery = aircraft.battery_energy / 3600.0
    scenario = scenario_from_spec(spec, "limits", external=True)
    return FlightSetup(
        scenario=scenario,
        mission=Mission(None, (), source="limits"),
        route=route,
        limits=make_limits(scenario, load_envelope(aircraft), aircraft.airspeed, BANK),
        aircraft=aircraft.name,
        battery=battery,
        seed=1,
    )


def bisect(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """Bisect for the boundary between a value that holds and one that does not.

    NaN if there is no change.
    """
    if not holds(good) or holds(bad):
        return math.nan
    for _ in range(_BISECTIONS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return 0.5 * (good + bad)


def slope_limit(aircraft: Aircraft, direction: float, wind: float = 0.0, wind_from: float = 0.0) -> Limit:
    """Find the steepest climb (direction 1) or dive (-1) that is held over 1.2 km after a level 1 km.

    The prediction is the envelope's limit at the limiting end of the leg: the top of a climb (thinner air, less power),
    and the top of a dive (thinner air, less drag).
    """
    along = np.array([math.sin(COURSE), math.cos(COURSE), 0.0])
    low = np.array([0.0, 0.0, AMSL])

    def leg(slope: float) -> Floats:
        """Return the waypoints of a mission with a leg of a slope."""
        run = 1200.0 * aircraft.airspeed / 25.0
        first, second = low, low + 0.8 * run * along
        return np.array([first, second, second + run * (along + np.array([0.0, 0.0, direction * math.tan(slope)]))])

    def holds(slope: float) -> bool:
        """Return True if a flight holds a slope, m per m."""
        flown = fly_to_end(Flight(made_setup(leg(slope), aircraft, wind, wind_from), aircraft))
        track, rows = flown.track, flown.track.leg == 1
        width = round(5.0 / float(np.median(np.diff(track.time))))
        speed = track.airspeed[rows].astype(np.float64) - aircraft.airspeed
        if flown.ended != "completed" or speed.size < width:
            return False
        mean = np.convolve(speed, np.full(width, 1.0 / width), "valid")
        keeps_speed = (-direction * mean).max() <= SPEED_HELD
        return bool(keeps_speed and np.abs(track.height_error[rows]).max() <= HEIGHT_HELD)

    setup = made_setup(leg(0.05), aircraft, wind, wind_from)

    def predict(amsl: float) -> float:
        """Return the predicted limit at an altitude, m AMSL."""
        return setup.limits.slopes(COURSE, amsl)[0 if direction > 0.0 else 1]

    flown = bisect(holds, 0.3 * predict(AMSL), 1.6 * predict(AMSL))
    ends = leg(flown)[1:, 2] if math.isfinite(flown) else np.array([AMSL])
    predicted = min(predict(float(amsl)) for amsl in ends)
    return Limit("climb" if direction > 0.0 else "dive", wind, wind_from, predicted, flown)


def leg_limit(aircraft: Aircraft, turn: float, same_way: bool, wind: float = 0.0, wind_from: float = 0.0) -> Limit:
    """Find the shortest leg between two turns (rad each) at 30 degrees of bank.

    The turns are in the same direction or in opposite directions.
    """
    courses = np.array([COURSE, COURSE + turn, COURSE + (2.0 * turn if same_way else 0.0)])
    directions = np.array([[math.sin(course), math.cos(course), 0.0] for course in courses])
    straight = 60.0 * aircraft.airspeed

    def points(leg: float) -> Floats:
        """Return the waypoints of a mission with a leg of a length (m) between two turns."""
        runs = np.array([straight, leg, straight])[:, None]
        return np.array([0.0, 0.0, AMSL]) + np.vstack([np.zeros(3), np.cumsum(runs * directions, axis=0)])

    def fly(leg: float) -> Track | None:
        """Fly a mission with a leg of a length, m; return its track, or None if it ended early."""
        with flown_with(replace(load_gains(aircraft), arc_slowing_max=0.0)):
            flown = fly_to_end(Flight(made_setup(points(leg), aircraft, wind, wind_from), aircraft))
        return (
            flown.track.rows(int(np.searchsorted(flown.track.time, 5.0)), len(flown.track))
            if flown.ended == "completed"
            else None
        )

    apart = fly(FAR)
    if apart is None:
        return Limit("leg", wind, wind_from, math.nan, math.nan, same_way)
    bank = min(max(_held_bank(apart), BANK) + BANK_HELD, MAX_BANK)

    def holds(leg: float) -> bool:
        """Return True if a flight with a leg of a length (m) keeps the bank and its legs."""
        track = fly(leg)
        return track is not None and _held_bank(track) <= bank and float(np.abs(track.cross_track).max()) <= CROSS_HELD

    shape = route_requirements(made_setup(points(FAR), aircraft, wind, wind_from))
    predicted = float(shape.length_after[1] + shape.reversal[1] + shape.length_before[2])
    return Limit("leg", wind, wind_from, predicted, bisect(holds, 1.4 * predicted, 0.6 * predicted), same_way)


def _held_bank(track: Track) -> float:
    """Return the largest mean bank over two seconds, to either side, rad."""
    width = round(2.0 / float(np.median(np.diff(track.time))))
    bank = track.attitude[:, 0].astype(np.float64)
    return float(np.abs(np.convolve(bank, np.full(width, 1.0 / width), "valid")).max())


def calm_limits(*, whole: bool) -> list[Limit]:
    """Measure slopes and shortest legs of the Aerosonde in calm air; fewer of them unless ``whole``."""
    aircraft = load_aircraft("aerosonde")
    found = [slope_limit(aircraft, side) for side in ((1.0, -1.0) if whole else (1.0,))]
    turns = [(turn, same_way) for turn in (60.0, 30.0, 45.0, 90.0, 120.0) for same_way in (False, True)]
    found += [leg_limit(aircraft, math.radians(turn), same_way) for turn, same_way in (turns if whole else turns[:1])]
    return found


def wind_limits(*, whole: bool) -> list[Limit]:
    """Measure slopes and shortest legs of the Aerosonde in a wind of 10 m/s.

    The wind comes from ahead, from behind and from the side.
    """
    aircraft = load_aircraft("aerosonde")
    sides = [COURSE + part * math.pi for part in ((0.0, 0.5, 1.0, 1.5) if whole else (1.0,))]
    found = []
    for side in sides:
        found += [slope_limit(aircraft, 1.0, 10.0, side), slope_limit(aircraft, -1.0, 10.0, side)]
        turns = (
            [(turn, same_way) for turn in (60.0, 90.0, 120.0) for same_way in (False, True)]
            if whole
            else [(60.0, False)]
        )
        found += [leg_limit(aircraft, math.radians(turn), same_way, 10.0, side) for turn, same_way in turns]
    return found
