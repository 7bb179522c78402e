"""What a path may ask of the aircraft: the tighter of the scenario's numbers and the envelope's.

The compiled functions judge a planner's candidate, a certificate and a route with one definition.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from aircraft.envelope import GRAVITY, Envelope, ground_slope, ground_speed
from world.geometry import wrap
from world.wind import W20, Wind

Floats = NDArray[np.float64]

# Vertical acceleration where one slope blends into the next, m/s^2.
BLEND_ACCELERATION = 1.0


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on turns, slopes and clearance.

    max_turn, max_climb, max_dive: rad, or None where the scenario leaves them to the aircraft.
    min_clearance: m above ground.  airspeed: m/s.  max_bank: rad, the tighter of scenario and aircraft.
    """

    max_turn: float | None
    max_climb: float | None
    max_dive: float | None
    min_clearance: float
    envelope: Envelope
    airspeed: float
    max_bank: float
    wind: Wind

    def slopes(self, course: float, amsl: float, airspeed: float | None = None) -> tuple[float, float]:
        """Steepest climb and dive over the ground that the aircraft can, rad, both positive, on this course.

        Both are 0 where the wind leaves no way along the course.
        """
        climb, dive = aircraft_slopes(self.packed(airspeed), course, amsl)
        return float(climb), float(dive)

    def turn_radius(self, course_in: float, course_out: float, amsl: float, airspeed: float | None = None) -> float:
        """Radius (m) of the arc at `max_bank` between two courses, for the highest ground speed on the way."""
        return float(turn_radius_between(self.packed(airspeed), course_in, course_out, amsl))

    def packed(self, airspeed: float | None = None) -> Floats:
        """Pack the aircraft's side as one array, for the compiled functions.

        (3, 8 + h): row 0 holds airspeed, tan(max_bank), wind speed, wind direction (towards, rad), gradient,
        reference height, the number of table heights, the gusts' standard deviation; from column 8 on, rows 0..2 hold
        the table's heights (m), climb and descent angles to the air (rad) at this airspeed.
        """
        speed = self.airspeed if airspeed is None else airspeed
        heights = self.envelope.amsl
        packed = np.zeros((3, 8 + heights.size))
        wind = self.wind
        packed[0, :8] = (
            speed,
            math.tan(self.max_bank),
            wind.speed,
            wind.from_course + math.pi,
            wind.gradient,
            wind.reference_amsl,
            heights.size,
            # sigma_w of MIL-F-8785C, which sigma_u meets at 300 m.
            0.1 * W20[wind.turbulence],
        )
        packed[0, 8:] = heights
        for k, amsl in enumerate(heights):
            packed[1:, 8 + k] = self.envelope.air_angles(speed, float(amsl))
        return packed


@compiled
def wind_speed_at(packed: Floats, amsl: float) -> float:  # pragma: no cover - compiled
    """Mean wind speed at a height, m/s."""
    speed: float = max(0.0, packed[0, 2] + packed[0, 4] * (amsl - packed[0, 5]))
    return speed


@compiled
def ground_speed_on(packed: Floats, course: float, amsl: float) -> float:  # pragma: no cover - compiled
    """Ground speed on a course held against the mean wind, m/s; NaN where it cannot be held."""
    wind = wind_speed_at(packed, amsl)
    angle = packed[0, 3] - course
    return ground_speed(packed[0, 0], wind * math.cos(angle), wind * math.sin(angle))


@compiled
def aircraft_slopes(packed: Floats, course: float, amsl: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Steepest climb and dive over the ground on this course, rad, both positive; (0, 0) where no way is made."""
    count = int(packed[0, 6])
    wind = wind_speed_at(packed, amsl)
    angle = packed[0, 3] - course
    tail, cross = wind * math.cos(angle), wind * math.sin(angle)
    heights = packed[0, 8 : 8 + count]
    k = 0
    while k + 2 < count and heights[k + 1] <= amsl:
        k += 1
    # By hand: numba's np.interp of one number costs a microsecond.
    share = min(1.0, max(0.0, (amsl - heights[k]) / (heights[k + 1] - heights[k])))
    climb = packed[1, 8 + k] + share * (packed[1, 9 + k] - packed[1, 8 + k])
    dive = packed[2, 8 + k] + share * (packed[2, 9 + k] - packed[2, 8 + k])
    up = ground_slope(climb, packed[0, 0], tail, cross)
    down = ground_slope(dive, packed[0, 0], tail, cross)
    if math.isnan(up) or math.isnan(down):
        return 0.0, 0.0
    return up, down


@compiled
def turn_radius_between(
    packed: Floats, course_in: float, course_out: float, amsl: float
) -> float:  # pragma: no cover - compiled
    """Arc radius at the bank limit for the highest ground speed between two courses; inf where one cannot be held.

    In turbulence a standard deviation of the gusts comes on top: airspeed, and with it the bank that an arc
    over the ground takes, swings by that much.
    """
    turn = wrap(course_out - course_in)
    before, after = ground_speed_on(packed, course_in, amsl), ground_speed_on(packed, course_out, amsl)
    if math.isnan(before) or math.isnan(after):
        return math.inf
    fastest = max(before, after)
    # The highest ground speed is downwind, if the turn passes through that course.
    down = wrap(packed[0, 3] - course_in)
    # A U-turn may be flown either way.
    around = abs(turn) > math.pi - 1e-6
    if around or (turn > 0.0 and 0.0 < down < turn) or (turn < 0.0 and turn < down < 0.0):
        fastest = max(fastest, ground_speed_on(packed, packed[0, 3], amsl))
    fastest += packed[0, 7]
    radius: float = fastest * fastest / (GRAVITY * packed[0, 1])
    return radius


@compiled
def turn_tangents(packed: Floats, waypoints: Floats) -> Floats:  # pragma: no cover - compiled
    """Length of leg that the fly-by arc at each waypoint uses on either side, (w,) m; 0 at the ends.

    waypoints: (w, 3).  R tan(theta/2); a U-turn has no tangent point and gets inf.
    """
    count = waypoints.shape[0]
    out = np.zeros(count)
    for i in range(1, count - 1):
        ux, uy = waypoints[i, 0] - waypoints[i - 1, 0], waypoints[i, 1] - waypoints[i - 1, 1]
        vx, vy = waypoints[i + 1, 0] - waypoints[i, 0], waypoints[i + 1, 1] - waypoints[i, 1]
        if ux * ux + uy * uy < 1e-12 or vx * vx + vy * vy < 1e-12:
            continue
        turn = math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy)
        if turn < 1e-9:
            continue
        if turn > math.pi - 1e-6:
            out[i] = math.inf
            continue
        radius = turn_radius_between(packed, math.atan2(ux, uy), math.atan2(vx, vy), waypoints[i, 2])
        out[i] = radius * math.tan(0.5 * turn)
    return out
