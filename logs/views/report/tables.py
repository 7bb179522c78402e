"""Build the tables of the report: legs, threats, controls, energy, and facts on scenario and flight."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup
from flight.simulation.track import ROLL, Track, control_limits, saturated_rows
from logs.verdict.measures.path_sweeps import segment_clearances, sphere_stays
from logs.verdict.measures.track_alignment import takeoff_and_approach_rows
from planner.plan import GIVEN_WAYPOINTS
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs, leg_slopes, path_length, signed_turns
from world.scenario import lat_lon_of_points
from world.wording import NOTHING, count_text, format_number, format_quantity

if TYPE_CHECKING:
    from logs.recording.reader import LogEvent

Facts = list[tuple[str, str]]

# Largest number of events that a page lists.
MAX_EVENTS = 200


@dataclass(frozen=True, slots=True)
class LegRow:
    """A row of the table of legs.

    cells: texts in the columns of `LEG_COLUMNS`.
    failing: True if a finding on the leg failed.
    """

    cells: tuple[str, ...]
    failing: bool


LEG_COLUMNS = (
    "leg",
    "length (m)",
    "course (°)",
    "slope (°)",
    "from (m AMSL)",
    "to (m AMSL)",
    "turn at its end (°)",
    "flown (s)",
    "mean airspeed (m/s)",
    "peak bank (°)",
    "peak cross-track (m)",
    "peak height error (m)",
    "lowest height above ground (m)",
    "energy (Wh)",
)


def leg_rows(setup: FlightSetup, track: Track | None, failing: frozenset[int]) -> list[LegRow]:
    """Return a row for each leg of the route, with its planned shape and its flown values.

    track: flown track; None for a plan, whose cells of flown values contain `NOTHING`.
    failing: indices of the legs with a failed finding.
    """
    waypoints = setup.display_waypoints
    runs = leg_runs(waypoints)
    courses = np.degrees(leg_courses(waypoints))
    slopes = np.degrees(leg_slopes(waypoints))
    turns = np.degrees(signed_turns(waypoints))
    heights_above_ground = ground_clearance(setup, track) if track is not None else None
    rows, numbers = [], setup.route.leg_numbers
    for leg in range(setup.route.legs):
        turn = NOTHING
        if leg < len(turns):
            direction = "right" if turns[leg] > 0.0 else "left"
            turn = f"{format_number(abs(float(turns[leg])), digits=1)} {direction}" if abs(turns[leg]) >= 0.05 else "0"
        planned_cells = (
            f"{numbers[leg]}",
            format_number(float(runs[leg]), digits=0),
            f"{round(float(courses[leg]), 1) % 360.0:05.1f}",
            format_number(float(slopes[leg]), signed=True, digits=2),
            format_number(float(waypoints[leg, 2]), digits=1),
            format_number(float(waypoints[leg + 1, 2]), digits=1),
            turn,
        )
        flown_cells: tuple[str, ...] = (NOTHING,) * 7
        leg_track_rows = np.flatnonzero(track.leg == leg) if track is not None else np.zeros(0, dtype=np.intp)
        if track is not None and leg_track_rows.size:
            # A leg ends at the first row of the next leg.
            first, last = int(leg_track_rows[0]), min(int(leg_track_rows[-1]) + 1, len(track) - 1)
            roll = track.attitude[leg_track_rows, ROLL]
            lowest = None if heights_above_ground is None else _find_min_finite(heights_above_ground[leg_track_rows])
            flown_cells = (
                format_number(float(track.time[last] - track.time[first]), digits=1),
                format_number(float(np.mean(track.airspeed[leg_track_rows], dtype=np.float64)), digits=1),
                format_number(math.degrees(_find_max_magnitude(roll)), digits=1),
                format_number(_find_max_magnitude(track.cross_track[leg_track_rows]), digits=2),
                format_number(_find_max_magnitude(track.height_error[leg_track_rows]), digits=2),
                format_number(lowest, digits=1),
                format_number(float(track.energy[last]) - float(track.energy[first]), digits=2),
            )
        rows.append(LegRow(planned_cells + flown_cells, leg in failing))
    return rows


def ground_clearance(setup: FlightSetup, track: Track) -> Floats | None:
    """Return the lowest height above ground between each row of a track and the next, m, (t,).

    It is measured in the same way as by the clearance rule.  The last value is the height of the last row.  Return None
    without terrain.
    """
    terrain = setup.scenario.terrain
    if terrain is None:
        return None
    end = track.position[-1]
    return np.append(segment_clearances(terrain, track.position)[0], end[2] - terrain.height(end[0], end[1]))


def flight_sentence(setup: FlightSetup, track: Track | None) -> str:
    """Return a sentence on distance, time, lowest height above ground and energy of a flight.

    Return "" without a track.
    """
    if track is None:
        return ""
    seconds = float(track.time[-1] - track.time[0])
    distance = float(path_length(track.position)) / 1000.0
    heights_above_ground = ground_clearance(setup, track)
    is_ground_phase = takeoff_and_approach_rows(track, setup.ground_phases)
    lowest_text = (
        NOTHING
        if heights_above_ground is None
        else format_number(_find_min_finite(heights_above_ground[~is_ground_phase]), digits=0)
    )
    phase_text = ""
    if is_ground_phase.any():
        phases = setup.ground_phases
        parts = ["after the take-off"] if phases.take_off is not None else []
        if phases.approach is not None:
            parts.append(f"before the final approach on leg {setup.route.leg_numbers[phases.approach.leg]}")
        phase_text = " " + " and ".join(parts) if parts else ""
    height_text = f", never less than {lowest_text} m above ground{phase_text}" if lowest_text != NOTHING else ""
    energy_used = float(track.energy[-1])
    # An imported log may contain no battery data.
    energy_text = (
        f", {format_number(energy_used, digits=0)} of {format_number(setup.battery, digits=0)} Wh"
        if math.isfinite(energy_used)
        else ""
    )
    flight_text = f"{format_number(distance, digits=1)} km in {format_number(seconds, digits=0)} s"
    return f"Flown: {flight_text}{height_text}{energy_text}."


def _find_max_magnitude(values: NDArray[np.float32]) -> float:
    """Return the largest finite absolute value, or NaN if there is none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else math.nan


def _find_min_finite(values: Floats) -> float:
    """Return the smallest finite value, or NaN if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else math.nan


def scenario_facts(setup: FlightSetup) -> Facts:
    """Return names and texts of facts on the scenario: area, terrain, threats, limits and wind."""
    scenario = setup.scenario
    terrain = scenario.terrain
    facts: Facts = [("Scenario", scenario.name)]
    if scenario.spec.description:
        facts.append(("About", scenario.spec.description))
    east, north = (float(np.ptp(axis_range)) / 1000.0 for axis_range in scenario.bounds)
    facts.append(("Map origin", _format_position(scenario.origin.lat_deg, scenario.origin.lon_deg)))
    area = scenario.spec.area
    floor_text = f"from {format_number(scenario.floor)} " if area is not None and area.floor_amsl_m is not None else ""
    if not scenario.external:
        facts += [
            ("Area", f"{format_number(east)} km east–west, {format_number(north)} km north–south"),
            ("Heights allowed", f"{floor_text}up to {format_number(scenario.ceiling)} m AMSL"),
        ]
    for name, point in (("Start", scenario.start), ("Destination", scenario.destination)):
        lat, lon = lat_lon_of_points(scenario, point)
        facts.append(
            (name, f"{_format_position(float(lat), float(lon))}, {format_quantity(float(point[2]), 'm')} AMSL")
        )
    if terrain is None:
        facts.append(("Terrain", "none was given, so the ground is not judged"))
    else:
        error_text = (
            f", stated error {format_quantity(terrain.vertical_error, 'm')}"
            if terrain.vertical_error is not None
            else ""
        )
        facts.append(
            ("Terrain", f"{terrain.source}, every {format_quantity(terrain.spacing, 'm')}; {terrain.datum}{error_text}")
        )
    missile_count = int(np.count_nonzero(scenario.threats.kill_radius > 0.0))
    radar_count = int(np.count_nonzero(scenario.threats.detection_radius > 0.0))
    facts.append(
        ("Threats", f"{len(scenario.threats)} units: {missile_count} with missiles, {radar_count} with radars")
    )
    limits, wind = scenario.limits, scenario.wind
    # A limit on an angle that the scenario states as text is the aircraft's limit.
    max_turn, max_climb, max_dive = (
        "the aircraft's" if isinstance(limit, str) else format_quantity(limit, "deg")
        for limit in (limits.max_turn_deg, limits.max_climb_deg, limits.max_dive_deg)
    )
    limits_text = (
        f"turn {max_turn}, climb {max_climb}, dive {max_dive};"
        f" {format_quantity(limits.min_clearance_m, 'm')} above ground;"
        f" within {format_quantity(setup.corridor, 'm')} of the legs"
    )
    wind_text = f"{format_quantity(wind.speed, 'm/s')} from {round(math.degrees(wind.from_course)) % 360:03d}°"
    if wind.gradient:
        gradient_text = format_number(100.0 * wind.gradient, signed=True)
        wind_text += f" at {format_quantity(wind.reference_amsl, 'm')} AMSL, {gradient_text} m/s per 100 m of height"
    if wind.forecast is not None:
        wind_text = f"{wind.forecast.describe()}; mean profile {wind_text}"
    facts += [
        ("Limits", limits_text),
        ("Wind", f"{wind_text if wind.speed else 'calm'}; turbulence: {wind.turbulence}"),
    ]
    return facts


def _format_position(lat_deg: float, lon_deg: float) -> str:
    """Format a position as degrees of latitude, N or S, and of longitude, E or W."""
    ns, ew = "N" if lat_deg >= 0.0 else "S", "E" if lon_deg >= 0.0 else "W"
    return f"{abs(lat_deg):.6f}° {ns}, {abs(lon_deg):.6f}° {ew}"


def flight_facts(setup: FlightSetup, end_reason: str) -> Facts:
    """Return names and texts of facts on aircraft, mission, route, plan and end of the flight.

    end_reason: reason why the flight ended; "" to leave it out.
    """
    bank = min(setup.max_bank, setup.envelope.max_bank)
    braking_text = "may drive the motor" if setup.envelope.motor_braking else "does not drive the motor"
    route = setup.route
    facts: Facts = [
        (
            "Aircraft",
            f"{setup.aircraft}, at {format_quantity(setup.airspeed, 'm/s')}, bank up to {format_quantity(bank, 'rad')}",
        ),
        ("Descent", f"the propeller {braking_text}"),
        (
            "Mission",
            f"{setup.mission.source}: {count_text(len(setup.mission.items), 'item')}, {count_text(route.legs, 'leg')}",
        ),
        ("Route", f"{format_quantity(float(path_length(route.positions)) / 1000.0, 'km')} long"),
    ]
    if setup.plan is not None:
        plan = setup.plan
        plan_text = f"{plan.algorithm}, seed {plan.seed}, {plan.evaluations} paths tried"
        if plan.algorithm == GIVEN_WAYPOINTS:
            plan_text = "given waypoints, not searched"
        has_only_unmet_margins = bool(plan.unmet_margins) and not plan.failures
        status = "planner's margins not met" if has_only_unmet_margins else "not feasible"
        if plan.feasible:
            place = "and outside every" if plan.safe else "but within a"
            status = f"feasible, {place} missile's reach"
        facts.append(("Plan", f"{plan_text}; {status}"))
    if end_reason:
        facts.append(("Flight ended", end_reason))
    return facts


def event_rows(events: Sequence["LogEvent"]) -> list[tuple[str, str, str]]:
    """Return a row for each of the first `MAX_EVENTS` events: time (s), text and level."""
    return [(format_number(event.time, digits=2), event.text, event.level) for event in events[:MAX_EVENTS]]


def mission_notes(setup: FlightSetup) -> list[str]:
    """Return warnings about the mission file, and notes on the scenario and on items that cannot be flown."""
    return [*setup.mission.warnings, *setup.scenario.notes, *setup.notes]


def energy_facts(setup: FlightSetup, track: Track | None) -> Facts:
    """Return facts on the battery: energy left, peak current, mean power, energy per kilometre.

    Each fact is a name and a text.  The energy used is part of `flight_sentence`.  Return [] without a track, or if its
    energy is unknown.
    """
    if track is None or len(track) == 0:
        return []
    used_energy = float(track.energy[-1])
    if not math.isfinite(used_energy):
        return []
    seconds = float(track.time[-1] - track.time[0])
    distance = float(path_length(track.position)) / 1000.0
    facts: Facts = [
        (
            "Left",
            f"{format_quantity(setup.battery - used_energy, 'Wh')},"
            f" {format_quantity(100.0 * (1.0 - used_energy / setup.battery), '%')}",
        ),
        ("Peak current", format_quantity(_find_max_magnitude(track.current), "A")),
    ]
    if seconds > 0.0:
        facts.append(("Mean power", format_quantity(used_energy * 3600.0 / seconds, "W")))
    if distance > 0.0:
        facts.append(("Per kilometre", format_quantity(used_energy / distance, "Wh")))
    return facts


def reproducibility_facts(setup: FlightSetup, versions: Mapping[str, str]) -> Facts:
    """Return names and texts of the seed, versions and hashes that are needed to reproduce the flight."""
    wind_seed = setup.scenario.wind.seed
    facts: Facts = [("Seed", f"{setup.seed}" + (f"; turbulence {wind_seed}" if wind_seed is not None else ""))]
    facts += [(name, versions[name]) for name in sorted(versions)]
    text = mission_text(setup.mission, "waypoints")
    facts.append(("Mission file, SHA-256", hashlib.sha256(text.encode("utf-8")).hexdigest()))
    if setup.envelope.model_hash:
        facts.append(("Aircraft model, hash", setup.envelope.model_hash))
    terrain = setup.scenario.terrain
    if terrain is not None and terrain.sha256:
        facts.append(("Terrain file, SHA-256", terrain.sha256))
    return facts


PASSAGE_COLUMNS = ("unit", "reach", "entered (s)", "left (s)", "inside (s)", "closest (m)", "radius (m)")


def passage_rows(setup: FlightSetup, track: Track | None) -> list[tuple[str, ...]]:
    """Return a row for each stay inside the sphere of a missile or radar, in order of time.

    Return [] without a track.  Rows have the columns of `PASSAGE_COLUMNS`.
    """
    if track is None or len(track) == 0:
        return []
    threats = setup.scenario.threats
    stays = [
        (stay, name, unit, float(radii[k]))
        for k, name in enumerate(threats.names)
        for unit, radii in (("missile", threats.kill_radius), ("radar", threats.detection_radius))
        for stay in sphere_stays(track.time, track.position, threats.position[k], float(radii[k]))
    ]
    return [
        (
            name,
            unit,
            format_number(stay.start, digits=1),
            format_number(stay.end, digits=1) if stay.whole else "still inside",
            format_number(stay.end - stay.start, digits=1),
            format_number(stay.closest, digits=0),
            format_number(radius, digits=0),
        )
        for stay, name, unit, radius in sorted(stays, key=lambda entry: entry[0].start)
    ]


def saturation_rows(setup: FlightSetup, track: Track | None) -> list[tuple[str, ...]]:
    """Return a row for each control: name, limit, largest command, and time at the limit (s, %).

    Return [] without a track or for fewer than two rows.  The cells that an unknown limit leaves open contain
    `NOTHING`.
    """
    if track is None or len(track) < 2:
        return []
    durations = np.append(np.diff(track.time), 0.0)
    rows: list[tuple[str, ...]] = []
    for k, ((name, limit), command) in enumerate(zip(control_limits(setup.aircraft), track.commands.T, strict=True)):
        min_command = 0.0 if name == "throttle" else -limit
        saturation_time = float(durations[saturated_rows(track, k, min_command, limit)].sum())
        scale, unit = (100.0, " %") if name == "throttle" else (180.0 / math.pi, "°")
        peak_text = format_number(scale * _find_max_magnitude(command), digits=1)
        limit_text = format_number(scale * limit, digits=1)
        rows.append(
            (
                name,
                limit_text if limit_text == NOTHING else limit_text + unit,
                peak_text + unit,
                format_number(saturation_time, digits=1) if math.isfinite(limit) else NOTHING,
                format_number(100.0 * saturation_time / max(float(durations.sum()), 1e-9), digits=1)
                if math.isfinite(limit)
                else NOTHING,
            )
        )
    return rows
