"""Preflight notes on a mission's take-off, landing, home, altitudes, rally points and return.

The verdict judges collisions. These notes cover what a pilot would find out on the field: tail wind, a wrong home, an
altitude in a wrong frame, a rally point below ground or out of range, an RTL below the hills around home, a landing
sequence that prevents arming, and the ground under a landing without a stated strip.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from flight.mission.altitude_frames import find_misread_altitudes
from flight.mission.items import Command, Mission
from flight.mission.placing import return_points
from flight.mission.return_path import ReturnPoint, ReturnRules
from flight.mission.route import Route
from world.airfield import STEEPEST_STRIP_SLOPE, LandingStrip, strip_slopes
from world.arrays import Floats
from world.errors import MissionError
from world.frames import to_map
from world.geometry import leg_courses
from world.scenario import Scenario

# Minimum wind component that a note mentions, m/s.
MIN_NOTED_WIND_MPS = 0.05
# Maximum distance of a mission's home from the scenario's home without a note, m.
MAX_HOME_DISTANCE_M = 50.0
# Minimum radius about home within which the ground is checked for an RTL, m: with WP_LOITER_RAD 60, ArduPlane flew
# loiters of up to 260 m.
MIN_RTL_LOITER_RADIUS_M = 260.0
# Largest depth below the ground of a rally point that was set on the ground, m.
RALLY_ALTITUDE_ERROR_M = 10.0
# Number of rings about home on which the ground is checked.
_RING_COUNT = 13
# Number of directions on each ring.
_DIRECTION_COUNT = 72


def preflight_notes(
    mission: Mission,
    route: Route,
    scenario: Scenario,
    rules: ReturnRules,
    parameters: Mapping[str, float],
    assumed_parameters: Mapping[str, float],
) -> tuple[str, ...]:
    """Return notes on a mission's launch, landing, home, rally points and RTL.

    rules: RTL rules of the autopilot.
    parameters: parameters of the autopilot that are stated, by name.
    assumed_parameters: parameters that are assumed for the mission's landing, by name.
    """
    rally_problems: tuple[str, ...] = ()
    try:
        return_targets = return_points(mission, scenario.origin, scenario.terrain)
    except MissionError as error:
        # The rally points belong to another airfield: only an RTL would fly to them, and that RTL is refused elsewhere.
        return_targets, rally_problems = (), (str(error),)
    return (
        *rally_problems,
        *_note_tail_winds(route, scenario),
        *_note_distant_home(mission, scenario),
        *_note_misread_altitudes(mission, scenario),
        *_note_rally_points(return_targets[1:], route, scenario, rules),
        *_note_low_return(return_targets[:1], scenario, rules),
        *_note_autoland(mission, scenario, parameters, assumed_parameters),
        *_note_landing_ground(mission, route, scenario),
    )


def _note_tail_winds(route: Route, scenario: Scenario) -> Iterator[str]:
    """Yield a note on the tailwind at the scenario's launch, and one on the tailwind at its landing."""
    courses = leg_courses(route.positions)
    launch, landing = scenario.launch, scenario.landing
    ends = []
    if launch is not None and route.takeoff_ground is not None:
        stated_course = launch.course
        ends.append(("launch", float(courses[0]) if stated_course is None else stated_course, route.takeoff_ground))
    if landing is not None and route.landing_ground is not None:
        ends.append(("landing", float(courses[-1]), route.landing_ground))
    for name, course, altitude in ends:
        tail_wind = scenario.wind.components_on_course(course, altitude)[0]
        if tail_wind > MIN_NOTED_WIND_MPS:
            yield f"{name}: {tail_wind:.1f} m/s of tailwind on course {round(math.degrees(course)) % 360}°"


def _note_distant_home(mission: Mission, scenario: Scenario) -> Iterator[str]:
    """Yield a note if the mission's home is far from the scenario's home."""
    home, scenario_home = mission.home, scenario.home
    if home is None or scenario_home is None:
        return
    east, north = to_map(scenario.origin, home.lat_deg, home.lon_deg)
    distance = math.dist((float(east), float(north)), scenario_home[:2])
    if distance > MAX_HOME_DISTANCE_M:
        yield (
            f"the mission's home is {distance:.0f} m from the scenario's home: after a launch at the scenario's home, "
            "heights are relative to the scenario's home"
        )


def _note_misread_altitudes(mission: Mission, scenario: Scenario) -> Iterator[str]:
    """Yield notes on items whose altitudes fit the terrain only in the other altitude frame.

    One note is for altitudes AMSL that fit only as heights above home, the other for the opposite.
    """
    below_ground, too_high = find_misread_altitudes(mission, scenario.origin, scenario.terrain)
    amsl, over_home = "altitudes above mean sea level (frame 0)", "heights above home (frame 3)"
    for readings, stated_as, other in ((below_ground, amsl, over_home), (too_high, over_home, amsl)):
        if readings:
            numbers = [str(mission.items[reading.item_index].seq) for reading in readings]
            yield (
                f"item{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}: flown as {stated_as},"
                f" {_heights_text([reading.height for reading in readings])}; read as {other}:"
                f" {_heights_text([reading.other_height for reading in readings])}. Check the frame"
            )


def _heights_text(heights: list[float]) -> str:
    """Describe the range of heights above ground (m, negative below it) in rounded numbers.

    >>> _heights_text([-20.4, -330.0]), _heights_text([12.3])
    ('330 to 20 m below ground', '12 m above ground')
    """
    low, high = round(min(heights)), round(max(heights))
    side = "below" if high < 0 else "above"
    if low < 0 <= high:
        return f"from {-low} m below to {high} m above ground"
    return f"{abs(low)} m {side} ground" if low == high else f"{abs(low)} to {abs(high)} m {side} ground"


def _note_rally_points(
    points: tuple[ReturnPoint, ...], route: Route, scenario: Scenario, rules: ReturnRules
) -> Iterator[str]:
    """Yield notes on rally points that are below ground, or too far away for an RTL from the route.

    points: the rally points on the map.
    rules: RTL rules of the autopilot.
    """
    for point in points:
        name = f"rally point {point.number}"
        ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(point.east, point.north))
        # A return that ends above the rally point may use a point on the ground, whose altitude has errors.
        tolerance = RALLY_ALTITUDE_ERROR_M if rules.rally_height > 0.0 else 0.0
        if point.up <= ground - tolerance:
            yield (
                f"{name} is {ground - point.up:.0f} m below the ground"
                f" ({point.up:.0f} m AMSL; the ground there is at {ground:.0f} m AMSL)"
            )
        distance = _distance_from_path(route.positions, (point.east, point.north))
        if 0.0 < rules.rally_limit < distance:
            limit = f"RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
            yield (
                f"no RTL flies to {name}, because it is at least {distance / 1000.0:.1f} km from the mission,"
                f" beyond {limit}"
            )


def _distance_from_path(waypoints: Floats, point: tuple[float, float]) -> float:
    """Return the minimum horizontal distance of a point from a path (w, 3), m."""
    leg_starts, leg_vectors = waypoints[:-1, :2], np.diff(waypoints[:, :2], axis=0)
    squared_lengths = np.maximum(1e-12, (leg_vectors**2).sum(axis=1))
    fractions = np.clip(((np.array(point) - leg_starts) * leg_vectors).sum(axis=1) / squared_lengths, 0.0, 1.0)
    return float(np.hypot(*(leg_starts + fractions[:, None] * leg_vectors - np.array(point)).T).min())


def _note_low_return(home_points: tuple[ReturnPoint, ...], scenario: Scenario, rules: ReturnRules) -> Iterator[str]:
    """Yield a note if an RTL to home would end at or below the ground somewhere on its loiter.

    home_points: home; empty if the mission has no home.
    """
    if not home_points or scenario.terrain is None or math.isnan(rules.height):
        return
    radius = max(MIN_RTL_LOITER_RADIUS_M, abs(rules.radius))
    angles = np.linspace(0.0, 2.0 * math.pi, _DIRECTION_COUNT, endpoint=False)
    distances = np.linspace(0.0, radius, _RING_COUNT)[:, None]
    ground = scenario.terrain.height(
        home_points[0].east + distances * np.sin(angles), home_points[0].north + distances * np.cos(angles)
    )
    ground_height = float(np.nanmax(ground, initial=-math.inf)) - home_points[0].up
    if ground_height >= rules.height:
        yield (
            f"an RTL loiters {rules.height:.0f} m above home, but the ground within {radius:.0f} m of home rises to"
            f" {ground_height:.0f} m above home"
        )


def _note_autoland(
    mission: Mission, scenario: Scenario, parameters: Mapping[str, float], assumed_parameters: Mapping[str, float]
) -> Iterator[str]:
    """Yield a note on a landing sequence if RTL_AUTOLAND is 0, because ArduPlane then refuses to arm.

    parameters: stated parameters of the autopilot, by name.
    assumed_parameters: parameters that are assumed for the mission's landing, by name.

    Arming is checked in AP_Arming.cpp. There is no note on an assumed value if the scenario has a landing, because
    planfly writes RTL_AUTOLAND for its plan.
    """
    start_numbers = [item.seq for item in mission.items if item.command == Command.DO_LAND_START]
    if start_numbers and parameters.get("RTL_AUTOLAND") == 0.0:
        yield f"item {start_numbers[0]}: ArduPlane does not arm with DO_LAND_START and RTL_AUTOLAND 0"
    elif start_numbers and scenario.landing is None and "RTL_AUTOLAND" in assumed_parameters:
        value = assumed_parameters["RTL_AUTOLAND"]
        yield (
            f"item {start_numbers[0]}: RTL_AUTOLAND {value:g} is assumed for DO_LAND_START, because ArduPlane does not"
            " arm with the default 0"
        )


# Text for level ground.
_LEVEL_TEXT = "is level"


def _slope_text(slope: float) -> str:
    """Describe a slope of the ground (m per m, positive uphill) as the end of a sentence: "rises by 2.0%"."""
    percent_text = f"{abs(slope):.1%}"
    return _LEVEL_TEXT if percent_text == "0.0%" else f"{'rises' if slope > 0.0 else 'falls'} by {percent_text}"


def landing_slopes(mission: Mission, route: Route, scenario: Scenario) -> tuple[float, float] | None:
    """Return the ground slopes along and across the final landing leg, m per m; NaN if unknown.

    Returns None if the mission does not end with a landing, or if the scenario defines a landing strip.
    """
    last_item = int(route.items[-1])
    has_landing = any(item.seq == last_item and item.command == Command.NAV_LAND for item in mission.items)
    if scenario.landing is not None or not has_landing:
        return None
    if scenario.terrain is None:
        return math.nan, math.nan
    east, north = route.positions[-1, :2].tolist()
    return strip_slopes(scenario.terrain, LandingStrip(east, north), float(leg_courses(route.positions)[-1]))


def _note_landing_ground(mission: Mission, route: Route, scenario: Scenario) -> Iterator[str]:
    """Yield a note on wind and ground at a landing for which the scenario has no landing strip."""
    last_item = int(route.items[-1])
    slopes = landing_slopes(mission, route, scenario)
    if slopes is None:
        return
    course = float(leg_courses(route.positions)[-1])
    wind = ""
    if route.landing_ground is not None:
        tail_wind = scenario.wind.components_on_course(course, route.landing_ground)[0]
        wind = f", with {tail_wind:.1f} m/s of tailwind" if tail_wind > MIN_NOTED_WIND_MPS else wind
        wind = f", against {-tail_wind:.1f} m/s of wind" if tail_wind < -MIN_NOTED_WIND_MPS else wind
    ground = "The terrain there is unknown"
    length = LandingStrip(0.0, 0.0).length
    if not any(math.isnan(slope) for slope in slopes):
        along, across = (_slope_text(slope) for slope in slopes)
        ground = (
            f"Over {length:.0f} m around the landing point the ground {along} in the landing direction and {across} to"
            " the right"
        )
        if along == across == _LEVEL_TEXT:
            ground = f"Over {length:.0f} m around the landing point the ground {_LEVEL_TEXT}"
        if max(abs(slope) for slope in slopes) > STEEPEST_STRIP_SLOPE:
            ground += f" (planfly plan accepts landing slopes up to {STEEPEST_STRIP_SLOPE:.0%})"
    strip_text = "Touchdown and roll-out are not judged, because the scenario has no [landing]"
    yield f"item {last_item}: landing on course {round(math.degrees(course)) % 360}°{wind}. {ground}. {strip_text}"
