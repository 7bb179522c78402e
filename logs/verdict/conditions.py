"""Describe a verdict's conditions, in the lines after the answer.

The conditions are aircraft, speed, weather and world.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import find_logged_aircraft
from aircraft.tracking import CORRIDOR_RADII
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.gust_height import gust_deviation
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.measures.mission_ends import missing_ends_text
from logs.verdict.measures.route_requirements import judged_airspace, judged_surveys
from logs.verdict.suggestions import home_height_text
from world.errors import FlightError
from world.json_schema import DocumentConfig
from world.scenario import Scenario
from world.scenario_tables import DEFAULT_AUTOPILOT, Navigation
from world.wind import Turbulence
from world.wording import count_text

_NAVIGATION_TEXTS = {
    "perfect": "without position error",
    "rtk": "with an RTK error of 0.05 m on each axis",
    "gnss": "with a GNSS error of 1.5 m on each axis",
}
AirspeedSource = Literal["scenario", "parameters", "aircraft", "flight"]
_AIRSPEED_SOURCE_TEXTS: dict[AirspeedSource, str] = {
    "scenario": "from the scenario or an option",
    "parameters": "from the autopilot's parameters",
    "aircraft": "its cruise speed",
    "flight": "from the log",
}


@dataclass(frozen=True, slots=True)
class Conditions(DocumentConfig):
    """Conditions of a verdict or a plan; None for a field that the log of an imported flight lacks."""

    aircraft: str
    """Name or folder of the aircraft; empty for an imported flight without a named aircraft."""
    mass_kg: float | None
    aircraft_named: bool
    """True if the aircraft was named; if not, it is the default."""
    airspeed_mps: float
    """Airspeed until the mission sets another."""
    airspeed_kind: Literal["true", "equivalent"]
    """true or equivalent."""
    airspeed_source: AirspeedSource
    """scenario (or an option), parameters, aircraft (its cruise speed) or flight (as it was flown)."""
    wind_mps: float | None
    wind_from_deg: float | None
    """Both fields of the wind are null if the wind is the result; in a forecast, they are those of the start."""
    turbulence: Turbulence | None
    """Null if the flight was not simulated, as is navigation."""
    navigation: Navigation | None
    """perfect, rtk or gnss."""
    autopilot: str
    """Autopilot, with its most important settings."""
    autopilot_version: str
    """Version of the autopilot; empty for planfly's own guidance, and if the program of a log states it."""
    terrain: str | None
    height_datum: str | None
    zones: int = 0
    """Number of zones of the scenario and of the mission's fence."""
    forecast: str = ""
    """Forecast of the wind with its time of issue, age, grid and levels; empty for a stated wind."""
    wind_gradient_per_s: float = 0.0
    """Increase of the wind speed with height, m/s per m; 0 in a forecast that states the wind at each height."""
    wind_amsl_m: float | None = None
    """Altitude at which the wind has its speed; null without a gradient."""
    unused_parameters: tuple[str, ...] = ()
    """Names in the parameter file that have no effect on the simulated flight."""
    notes: tuple[str, ...] = ()
    """Notes on what is judged, such as a home that is far from the ground, or a landing that PX4 requires."""


def plan_conditions(scenario: Scenario, aircraft: str, airspeed: float, autopilot: Autopilot) -> Conditions:
    """Return the conditions of a plan made in a scenario.

    aircraft: name or folder of the aircraft.
    airspeed: cruise airspeed, m/s.
    """
    flight_table, wind, terrain = scenario.flight, scenario.wind, scenario.terrain
    mass = None
    # The mass is unknown if the aircraft of a log is not installed on this machine.
    with suppress(FlightError):
        mass = find_logged_aircraft(aircraft, flight_table.aircraft).mass
    east, north = scenario.wind_velocity(scenario.start.tolist())
    has_field = wind.field is not None
    gradient = 0.0 if has_field else wind.gradient
    # If the user named no autopilot and it is not the default, say from which file it was taken.
    source_text = (
        ""
        if flight_table.autopilot_from is None or flight_table.steering.autopilot == DEFAULT_AUTOPILOT
        else f"; taken from {flight_table.autopilot_from}, because no autopilot was named"
    )
    # Source of the cruise airspeed, in this order: scenario, parameter file, aircraft.
    if scenario.flight.airspeed_mps is not None:
        airspeed_source: AirspeedSource = "scenario"
    else:
        stated_airspeed = autopilot.stated_value(autopilot.speeds.cruise_parameter)
        airspeed_source = "aircraft" if stated_airspeed is None else "parameters"
    return Conditions(
        aircraft=aircraft,
        mass_kg=mass,
        aircraft_named=not flight_table.aircraft_by_default,
        airspeed_mps=airspeed,
        airspeed_kind="equivalent" if autopilot.speeds.equivalent else "true",
        airspeed_source=airspeed_source,
        wind_mps=math.hypot(east, north) if has_field else wind.speed,
        wind_from_deg=round(
            math.degrees(math.atan2(-east, -north) if has_field else wind.from_course) % 360.0, 3 if has_field else 9
        ),
        turbulence=wind.turbulence,
        navigation=flight_table.steering.nav,
        autopilot=autopilot.describe(aircraft) + source_text,
        autopilot_version=autopilot.version,
        terrain=None if terrain is None else terrain.source,
        height_datum=None if terrain is None else terrain.datum,
        zones=len(scenario.zones),
        forecast="" if wind.forecast is None else wind.forecast.describe(),
        wind_gradient_per_s=gradient,
        wind_amsl_m=wind.reference_amsl if gradient else None,
        unused_parameters=() if autopilot.parameters is None else autopilot.parameters.unused,
    )


def judging_conditions(setup: FlightSetup) -> Conditions:
    """Return the conditions under which a mission or a flight is judged, from its setup.

    For an imported flight, turbulence and navigation are None, and so is the mass of an unknown aircraft.
    """
    conditions = plan_conditions(setup.scenario, setup.aircraft, setup.airspeed, setup.autopilot)
    conditions = replace(
        conditions, navigation=setup.nav, zones=len(judged_airspace(setup).zones), notes=mission_notes(setup)
    )
    imported_log = setup.imported_log
    if imported_log is None:
        return conditions
    has_flown_airspeed = conditions.airspeed_source == "aircraft" and "airspeed" in imported_log.holds
    if not imported_log.aircraft_known:
        conditions = replace(conditions, aircraft="", mass_kg=None, aircraft_named=False)
    return replace(
        conditions,
        airspeed_source="flight" if has_flown_airspeed else conditions.airspeed_source,
        turbulence=None,
        navigation=None,
        autopilot=imported_log.program or "not stated",
        autopilot_version="",
    )


def mission_notes(
    setup: FlightSetup, home_effect: str | None = ", which shifts all heights above home"
) -> tuple[str, ...]:
    """Return notes on an uncertain aircraft, a doubtful home altitude, and a landing that PX4 requires.

    home_effect: text after the home's height above the ground; None to omit the note on home.
    """
    notes = [f"the aircraft's model is from {setup.envelope.source}"] if setup.envelope.source else []
    if home_effect is not None and (home_text := home_height_text(setup)):
        notes.append(home_text + home_effect)
    limits = setup.autopilot.checks.feasibility
    is_flown_by_px4 = setup.autopilot.checks.dialect == "px4" and setup.imported_log is None
    if is_flown_by_px4 and not limits.stated and missing_ends_text(setup.mission, limits):
        notes.append(f"by default (MIS_TKO_LAND_REQ {limits.requires}) PX4 rejects a mission without a landing")
    return tuple(notes)


def condition_lines(conditions: Conditions) -> list[str]:
    """Return two lines: one on aircraft and airspeed, and one on weather, navigation, terrain and zones."""
    speed = (
        f"{conditions.airspeed_mps:.3g} m/s {conditions.airspeed_kind} airspeed"
        f" ({_AIRSPEED_SOURCE_TEXTS[conditions.airspeed_source]})"
    )
    if not conditions.aircraft:
        aircraft_line = f"Aircraft: not named, so none of its limits are judged (name yours with --aircraft); {speed}"
    else:
        mass = "" if conditions.mass_kg is None else f", {conditions.mass_kg:.3g} kg"
        line = f"Aircraft: {conditions.aircraft}{mass}, {speed}"
        aircraft_line = (
            line
            if conditions.aircraft_named
            else f"{line}; no aircraft was named, so this is the default (name yours with --aircraft)"
        )
    wind_text = "no wind"
    if conditions.wind_mps is None:
        wind_text = "wind from every direction in turn"
    elif conditions.wind_mps > 0.0:
        wind_text = f"wind {conditions.wind_mps:.3g} m/s from {conditions.wind_from_deg:.0f} degrees"
    if conditions.wind_amsl_m is not None:
        gradient = f"{100.0 * conditions.wind_gradient_per_s:+.3g} m/s per 100 m of height"
        wind_text += f" at {conditions.wind_amsl_m:.0f} m AMSL, {gradient}"
    if conditions.forecast:
        wind_text = f"wind from {conditions.forecast}; {wind_text} at the start"
    turbulence_text = ""
    if conditions.turbulence is not None:
        turbulence_text = ", no turbulence"
        if conditions.turbulence != "none":
            deviation = gust_deviation(conditions.turbulence)
            turbulence_text = f", {conditions.turbulence} turbulence (vertical gusts: {deviation:.2f} m/s RMS)"
    navigation_text = (
        "" if conditions.navigation is None else f"; navigation {_NAVIGATION_TEXTS[conditions.navigation]}"
    )
    terrain_text = (
        "no terrain"
        if conditions.terrain is None
        else f"terrain {conditions.terrain}, heights above {conditions.height_datum}"
    )
    zones_text = f"; {count_text(conditions.zones, 'zone')}" if conditions.zones else ""
    world_line = f"Conditions: {wind_text}{turbulence_text}{navigation_text}; {terrain_text}{zones_text}"
    return [aircraft_line, world_line]


def autopilot_line(conditions: Conditions, *, is_flown: bool) -> str:
    """Return the line that names the autopilot.

    is_flown: True if the autopilot flew, False if only a mission is judged.
    """
    return f"{'Flown by' if is_flown else 'Autopilot'}: {conditions.autopilot}"


def flown_condition_lines(conditions: Conditions) -> list[str]:
    """Return the lines of `condition_lines`, a line that names the autopilot, and a line for each note."""
    notes = [f"Note: {note}" for note in conditions.notes]
    return [*condition_lines(conditions), autopilot_line(conditions, is_flown=True), *notes]


# Legs whose lines cross at no more than this angle can lie side by side.
_PARALLEL_ANGLE_RAD = math.radians(15.0)
# Legs closer to each other than this are the same line, m.
_SAME_LINE_DISTANCE_M = 1.0


def corridor_line(setup: FlightSetup, findings: Sequence[Finding]) -> str:
    """Return a line on the corridor's width and where it comes from; "" if the scenario states the width.

    The line also counts the legs that have a wider corridor because of turns or loiters.  It warns if the corridor is
    wider than the distance between legs, because a flight within it may never have followed the legs.  The line is ""
    for surveys, too, because their photo lines are judged one by one.

    findings: findings of the verdict, which contain the corridor of each leg.
    """
    half_width, radius = setup.corridor, setup.autopilot.turns.acceptance_radius or 0.0
    if setup.scenario.limits.corridor_m is not None or judged_surveys(setup):
        return ""
    origin = "planfly's default"
    if CORRIDOR_RADII * radius >= half_width:
        origin = f"{CORRIDOR_RADII:g} times {setup.autopilot.title}'s acceptance radius of {radius:.0f} m"
    wider = [
        finding.limit
        for finding in findings
        if finding.rule == "corridor" and finding.limit is not None and finding.limit > half_width
    ]
    wider_text = ""
    if wider:
        legs_text = count_text(len(wider), "leg")
        wider_text = f". Along {legs_text} it is up to {max(wider):.0f} m, because turns or loiters need more"
    line = (
        f"Corridor: {half_width:.0f} m to either side of the legs, {origin}{wider_text}."
        " To change it, set [limits] corridor_m"
    )
    closest_legs = min_leg_spacing(setup.route.positions)
    if closest_legs is None or closest_legs[0] >= half_width:
        return line
    spacing, leg = closest_legs
    first, second = setup.route.leg_numbers[leg], setup.route.leg_numbers[leg + 2]
    return (
        f"{line}. The corridor is wider than the {spacing:.0f} m between legs {first} and {second}, so a flight within"
        " the corridor may not have followed the lines"
    )


def min_leg_spacing(waypoints: NDArray[np.float64]) -> tuple[float, int] | None:
    """Find the smallest distance between two side-by-side legs k and k + 2; return it, m, and k.

    Legs lie side by side if their courses are parallel or opposite within `_PARALLEL_ANGLE_RAD`, and at least half of
    the shorter leg lies next to the longer one.  Legs on the same line (`_SAME_LINE_DISTANCE_M`) are left out.  Return
    None if there are no such legs.

    waypoints: positions of the route's waypoints, east, north and up, m, (w, 3).

    >>> lines = np.array([[0, 0, 0], [0, 900, 0], [40, 900, 0], [40, 0, 0]], dtype=float)
    >>> min_leg_spacing(lines)
    (40.0, 0)
    >>> min_leg_spacing(lines[:3]) is None
    True
    """
    spacings: list[tuple[float, int]] = []
    for k in range(len(waypoints) - 3):
        (start, end), (other_start, other_end) = waypoints[k : k + 2, :2], waypoints[k + 2 : k + 4, :2]
        leg_vector, other_vector = end - start, other_end - other_start
        leg_length = float(np.hypot(*leg_vector))
        other_length = float(np.hypot(*other_vector))
        if leg_length <= 0.0 or other_length <= 0.0:
            continue
        direction = leg_vector / leg_length
        if abs(float(direction @ other_vector)) / other_length < math.cos(_PARALLEL_ANGLE_RAD):
            continue
        overlap = sorted((float((other_start - start) @ direction), float((other_end - start) @ direction)))
        if min(leg_length, overlap[1]) - max(0.0, overlap[0]) >= 0.5 * min(leg_length, other_length):
            offset = 0.5 * (other_start + other_end) - start
            spacings.append((abs(float(direction[0] * offset[1] - direction[1] * offset[0])), k))
    # Legs on the same line are one line flown twice, not neighbours.
    return min((pair for pair in spacings if pair[0] >= _SAME_LINE_DISTANCE_M), default=None)
