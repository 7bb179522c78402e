"""The launch rule: judge a flown take-off, from rail, hand or runway to the start of the first leg.

The rule compares the launch acceleration with the acceleration that starts the motor.  It judges the height lost after
the launch, the runway left at lift-off, and the hazards on the climb (ground, missile spheres and zones) on the course
that the autopilot holds.  A take-off that is not flown is judged from the mission's items by the take-off and climb-out
rules.
"""

import math

import numpy as np

from flight.mission.ground_phases import TakeOff
from flight.simulation.track import Track
from logs.verdict.findings import GROUND_PATH, Fact, Finding, finding_reason, make_finding, message
from logs.verdict.measures.ground_paths import GroundPath, hazard_on_path, min_path_clearance, track_path
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rule import Rule
from logs.verdict.suggestions import suggest_better_launch
from logs.verdict.tolerances import (
    CLIMB_MODEL_ERROR_M,
    CONTACT_HEIGHT_M,
    LAUNCH_CLEARANCE_M,
    LAUNCH_RUN_M,
    MAX_LAUNCH_HEIGHT_LOSS_M,
    RUNWAY_MARGIN_M,
)
from logs.verdict.wording import compared_texts, gentle_launch_text
from world.arrays import Floats
from world.terrain import Terrain


def launch_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge a flown take-off with one finding; return [] if no take-off was flown.

    The finding covers the start of the motor, the height reached, the height lost after the launch, the runway left,
    and hazards on the climb.
    """
    ground, terrain = requirements.ground_phases, requirements.setup.scenario.terrain
    if ground is None or ground.procedures.take_off is None:
        return []
    take_off, track = ground.procedures.take_off, ground.takeoff_track
    position, distances = path = track_path(track)
    height_lost = float(position[0, 2] - position[:, 2].min())
    clearance, distance = _climb_clearance(requirements, path)
    trigger = requirements.setup.autopilot.ground.launch_trigger
    faults = []
    if trigger is not None and take_off.acceleration < trigger[0]:
        faults.append(message(gentle_launch_text(take_off.acceleration, trigger), ": the motor never starts"))
    top_altitude = float(position[:, 2].max())
    if top_altitude <= take_off.end_altitude:
        brief = f"the take-off climbed to only {top_altitude - take_off.home_altitude:.0f} m above home"
        faults.append(message(brief, f"; it must climb to {take_off.end_altitude - take_off.home_altitude:.0f} m"))
    if height_lost > MAX_LAUNCH_HEIGHT_LOSS_M:
        faults.append(
            message(
                f"sinks {compared_texts(height_lost, MAX_LAUNCH_HEIGHT_LOSS_M, 'm', 1)[0]} after the launch",
                f"; at most {MAX_LAUNCH_HEIGHT_LOSS_M:g} m are allowed",
            )
        )
    # Runway left at the aircraft's last contact with it.
    runway_left = math.inf
    if take_off.launch.method == "runway" and terrain is not None:
        heights = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
        standing_height = float(position[0, 2] - take_off.home[2])
        contact_rows = np.flatnonzero(heights <= standing_height + CONTACT_HEIGHT_M)
        last = position[contact_rows[-1] if contact_rows.size else 0]
        runway_left = take_off.launch.effective_length - math.dist(last[:2], take_off.home[:2])
    if runway_left < RUNWAY_MARGIN_M:
        brief = f"leaves the ground {take_off.launch.effective_length - runway_left:.0f} m from home"
        runway_text = f"; {RUNWAY_MARGIN_M:.0f} m of the {take_off.launch.effective_length:.0f} m runway must be left"
        faults.append(message(brief, runway_text))
    if clearance < LAUNCH_CLEARANCE_M:
        place_text = f" {distance:.0f} m from home on the flown course; {LAUNCH_CLEARANCE_M:g} m are required"
        side = "above" if clearance >= 0.0 else "below"
        faults.append(message(f"{abs(clearance):.1f} m {side} ground", place_text))
    entered_hazard = hazard_on_path(requirements, path)
    if entered_hazard:
        faults.append(message(f"the climb enters {entered_hazard}"))
    notes = _describe_take_off(take_off, track, distances, clearance, terrain)
    undecided_messages = []
    if not faults and LAUNCH_CLEARANCE_M <= clearance < LAUNCH_CLEARANCE_M + CLIMB_MODEL_ERROR_M:
        brief = f"the launch passes {clearance:.1f} m above ground {distance:.0f} m from home"
        error_text = (
            f"; {LAUNCH_CLEARANCE_M:g} m are required, and the simulated climb may be"
            f" {CLIMB_MODEL_ERROR_M:g} m too high"
        )
        undecided_messages.append(message(brief, error_text))
    elif not faults and math.isnan(clearance):
        undecided_messages.append(message("the terrain below the launch's climb is unknown"))
    return [
        make_finding(
            "launch",
            requirements.waypoint_place(take_off.waypoint),
            ok=False if faults else None if undecided_messages else True,
            reason=finding_reason(faults or undecided_messages, notes),
            faults=faults or undecided_messages,
            flown=clearance,
            limit=LAUNCH_CLEARANCE_M,
            at_least=True,
            source="check",
            tolerance=0.0,
            margin=clearance - LAUNCH_CLEARANCE_M,
            unit="m",
            method="exact along the flown track",
            check=GROUND_PATH if undecided_messages else "",
            facts=(Fact("height lost", height_lost, "m"), Fact("runway left", runway_left, "m")),
        )
    ]


def _climb_clearance(requirements: RouteRequirements, path: GroundPath) -> tuple[float, float]:
    """Return the minimum height above ground after the launch run, m, and its distance, m.

    The distance is along the path.

    The launch run is the first `LAUNCH_RUN_M`, or on a runway all of the path up to lift-off if that is longer.  The
    height is inf if the take-off ends within it, and NaN without terrain; the distance is then NaN.
    """
    terrain, (position, distances) = requirements.setup.scenario.terrain, path
    if terrain is None:
        return math.nan, math.nan
    # On a runway, the height above ground is judged only after lift-off.
    first_distance = LAUNCH_RUN_M
    take_off = None if requirements.ground_phases is None else requirements.ground_phases.procedures.take_off
    if take_off is not None and take_off.launch.method == "runway":
        standing_height = float(position[0, 2] - take_off.home[2])
        heights = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
        is_airborne = heights > standing_height + LAUNCH_CLEARANCE_M + CLIMB_MODEL_ERROR_M
        first_distance = max(
            first_distance, float(distances[int(np.argmax(is_airborne))]) if is_airborne.any() else float(distances[-1])
        )
    if distances[-1] <= first_distance:
        return math.inf, math.nan
    return min_path_clearance(terrain, path.between(first_distance, float(distances[-1])))


def _describe_take_off(
    take_off: TakeOff, track: Track, distances: Floats, clearance: float, terrain: Terrain | None
) -> list[str]:
    """Describe a take-off in phrases: course, launch method, climb and minimum height above ground.

    distances: distance of each row along the track, m, (t,).
    clearance: minimum height above ground after the launch run, m.
    """
    course, method = round(math.degrees(take_off.course)) % 360, take_off.launch.method
    notes = [f"launched on a runway on {course}°"]
    if method != "runway":
        method_text = "from a catapult" if method == "catapult" else "by hand"
        notes = [f"launched {method_text} on {course}° at {take_off.speed:.1f} m/s, {take_off.acceleration:.1f} m/s²"]
    if distances[-1] > 1.0:
        position = track.position
        altitude_gain, distance = float(position[-1, 2] - position[0, 2]), float(distances[-1])
        course_text = (
            f"finally on a course of {round(math.degrees(math.atan2(*track.velocity[-1, :2].tolist()))) % 360}°"
        )
        if altitude_gain >= 0.0:
            climb_text = f"climbs {100.0 * altitude_gain / distance:.0f} m in 100 m, {course_text}"
        else:
            ground = (
                math.nan if terrain is None else float(terrain.height(float(position[-1, 0]), float(position[-1, 1])))
            )
            end_text = course_text if math.isnan(ground) else f"down to {position[-1, 2] - ground:.1f} m above ground"
            climb_text = f"sinks {-altitude_gain:.1f} m in the {distance:.0f} m flown, {end_text}"
        notes.append(climb_text)
    if math.isfinite(clearance):
        notes.append(f"beyond {LAUNCH_RUN_M:.0f} m from the launch at least {clearance:.0f} m above ground")
    return notes


RULE = Rule(
    name="launch",
    tolerances=(
        "LAUNCH_RUN_M",
        "LAUNCH_CLEARANCE_M",
        "CLIMB_MODEL_ERROR_M",
        "MAX_LAUNCH_HEIGHT_LOSS_M",
        "RUNWAY_MARGIN_M",
        "CONTACT_HEIGHT_M",
        "CALM_WIND_MPS",
        "ROUNDING_M",
    ),
    judge=launch_findings,
    suggest=suggest_better_launch,
)
