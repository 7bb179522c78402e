"""What of a mission's ground ends and returns will not do as it stands: a note for people each.

Whether an aircraft hits something is for the verdict.  These are what a pilot finds out on the field: wind from behind,
a home that is somewhere else, a rally point in the ground or out of reach, a return below the hills about home, a
landing sequence that keeps an autopilot from arming, and the ground that a mission lands on without a stated strip.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission
from flight.mission.placing import return_places
from flight.mission.return_path import ReturnPlace, ReturnRules
from flight.mission.route import Route
from world.airfield import STEEPEST_STRIP, LandingStrip, strip_slopes
from world.errors import MissionError
from world.frames import to_map
from world.geometry import leg_courses
from world.scenario import Scenario

Floats = NDArray[np.float64]

# m/s.  Less wind from behind is none.
CALM = 0.05
# m.  A mission's home this far from the scenario's is another one.
HOME_APART = 50.0
# m.  A return circles home this far out at least: with WP_LOITER_RAD 60, circles of up to 260 m were flown.
MIN_CIRCLE = 260.0
# Rings and directions that the ground about home is looked at on.
_RINGS, _DIRECTIONS = 13, 72


def field_notes(
    mission: Mission, route: Route, scenario: Scenario, rules: ReturnRules, parameters: Mapping[str, float]
) -> tuple[str, ...]:
    """Notes on a mission's launch, landing, home, rally points and return.

    rules: how whoever flies returns.  parameters: the autopilot's, by name, as far as somebody states them.
    """
    beyond: tuple[str, ...] = ()
    try:
        places = return_places(mission, scenario.origin, scenario.terrain)
    except MissionError as error:
        # Left over from another field: nothing flies there but a return, which is refused itself.
        places, beyond = (), (str(error),)
    return (
        *beyond,
        *_tail_winds(route, scenario),
        *_home_elsewhere(mission, scenario),
        *_rally(places[1:], route, scenario, rules),
        *_low_return(places[:1], scenario, rules),
        *_not_armed(mission, parameters),
        *_landed_on(mission, route, scenario),
    )


def _tail_winds(route: Route, scenario: Scenario) -> Iterator[str]:
    """Wind from behind at a launch, or at a landing, that the scenario asks for."""
    courses = leg_courses(route.waypoints)
    launch, landing = scenario.launch, scenario.landing
    ends = []
    if launch is not None and not math.isnan(route.takeoff_ground):
        stated = launch.course
        ends.append(("launch", float(courses[0]) if stated is None else stated, route.takeoff_ground))
    if landing is not None and not math.isnan(route.landing_ground):
        ends.append(("landing", float(courses[-1]), route.landing_ground))
    for name, course, up in ends:
        tail = scenario.wind.along(course, up)[0]
        if tail > CALM:
            yield f"{name}: {tail:.1f} m/s of wind from behind on {round(math.degrees(course)) % 360}°"


def _home_elsewhere(mission: Mission, scenario: Scenario) -> Iterator[str]:
    """A mission's home far from the scenario's, where the launch is."""
    home, stated = mission.home, scenario.home
    if home is None or stated is None:
        return
    east, north = to_map(scenario.origin, home.lat_deg, home.lon_deg)
    away = math.dist((float(east), float(north)), stated[:2])
    if away > HOME_APART:
        yield f"the mission's home is {away:.0f} m from the scenario's: launched there, heights count from elsewhere"


def _rally(points: tuple[ReturnPlace, ...], route: Route, scenario: Scenario, rules: ReturnRules) -> Iterator[str]:
    """Rally points in the ground, and those that no return from the route flies to for their distance."""
    for point in points:
        name = f"rally point {point.number}"
        under = math.nan if scenario.terrain is None else float(scenario.terrain.height(point.east, point.north))
        up = point.up + rules.rally_height
        if up <= under:
            yield f"{name} is {under - up:.0f} m under the ground there: {up:.0f} m AMSL, the ground {under:.0f} m"
        away = _distance(route.waypoints, (point.east, point.north))
        if 0.0 < rules.rally_limit < away:
            limit = f"RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
            yield f"{name} is {away / 1000.0:.1f} km from the mission or more, beyond {limit}: no return flies to it"


def _distance(way: Floats, spot: tuple[float, float]) -> float:
    """Least distance of a place from a way (w, 3) across the ground, m."""
    begin, step = way[:-1, :2], np.diff(way[:, :2], axis=0)
    length2 = np.maximum(1e-12, (step**2).sum(axis=1))
    share = np.clip(((np.array(spot) - begin) * step).sum(axis=1) / length2, 0.0, 1.0)
    return float(np.hypot(*(begin + share[:, None] * step - np.array(spot)).T).min())


def _low_return(home: tuple[ReturnPlace, ...], scenario: Scenario, rules: ReturnRules) -> Iterator[str]:
    """A return to home whose height is below the ground where it circles."""
    if not home or scenario.terrain is None or math.isnan(rules.height):
        return
    radius = max(MIN_CIRCLE, abs(rules.radius))
    angle = np.linspace(0.0, 2.0 * math.pi, _DIRECTIONS, endpoint=False)
    reach = np.linspace(0.0, radius, _RINGS)[:, None]
    ground = scenario.terrain.height(home[0].east + reach * np.sin(angle), home[0].north + reach * np.cos(angle))
    highest = float(np.nanmax(ground, initial=-math.inf)) - home[0].up
    if highest >= rules.height:
        yield (
            f"a return circles home {rules.height:.0f} m over it, and the ground there is {highest:.0f} m over it"
            f" within {radius:.0f} m"
        )


def _not_armed(mission: Mission, parameters: Mapping[str, float]) -> Iterator[str]:
    """A landing sequence that a parameter forbids: ArduPlane's check before arming (AP_Arming.cpp)."""
    marks = [item.seq for item in mission.items if item.command == Command.DO_LAND_START]
    if marks and parameters.get("RTL_AUTOLAND") == 0.0:
        yield f"item {marks[0]}: DO_LAND_START with RTL_AUTOLAND 0: ArduPlane does not arm"


_LEVEL = "is level"


def _sloping(slope: float) -> str:
    """How the ground slopes (m per m), in words."""
    shown = f"{abs(slope):.1%}"
    return _LEVEL if shown == "0.0%" else f"{'rises' if slope > 0.0 else 'falls'} by {shown}"


def _landed_on(mission: Mission, route: Route, scenario: Scenario) -> Iterator[str]:
    """What is known of the ground where a mission lands whose scenario states no strip."""
    last = int(route.items[-1])
    lands = any(item.seq == last and item.command == Command.NAV_LAND for item in mission.items)
    if scenario.landing is not None or not lands:
        return
    course, (east, north) = float(leg_courses(route.waypoints)[-1]), route.waypoints[-1, :2].tolist()
    wind = ""
    if not math.isnan(route.landing_ground):
        tail = scenario.wind.along(course, route.landing_ground)[0]
        wind = f", with {tail:.1f} m/s of wind from behind" if tail > CALM else wind
        wind = f", against {-tail:.1f} m/s of wind" if tail < -CALM else wind
    ground = "the ground there is not known"
    strip = LandingStrip(east, north)
    slopes = (math.nan, math.nan)
    if scenario.terrain is not None:
        slopes = strip_slopes(scenario.terrain, strip, course)
    if not any(math.isnan(one) for one in slopes):
        along, across = (_sloping(one) for one in slopes)
        ground = f"over {strip.length:.0f} m about its point the ground {along} along it, and {across} to the right"
        if along == across == _LEVEL:
            ground = f"over {strip.length:.0f} m about its point the ground {_LEVEL}"
        if max(abs(one) for one in slopes) > STEEPEST_STRIP:
            ground += f" ({STEEPEST_STRIP:.0%} is the most that a plan lands on)"
    unknown = "no [landing] states its strip: touch-down and way to rest are not judged"
    yield f"item {last}: lands on {round(math.degrees(course)) % 360}°{wind}; {ground}; {unknown}"
