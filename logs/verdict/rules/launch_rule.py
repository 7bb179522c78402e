"""The launch rule: a take-off that was flown, from rail, hand or runway to where the first leg begins.

Judged are the acceleration of the launch against the one that starts the motor, whether height is lost after it, and
what the climb meets on the course that the autopilot holds: ground, missile spheres and zones.  A take-off that is not
flown is judged by the take-off and climb-out rules, by the mission's items.
"""

import math

import numpy as np
from numpy.typing import NDArray

from flight.mission.ground_ways import TakeOff
from flight.simulation.track import Track
from logs.verdict.findings import Fact, Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.route_requirements import FlownGround, RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import Way, entered_by_way, way_clearance
from logs.verdict.rule import Margin, Rule, located
from logs.verdict.tolerances import LAUNCH_ROOM, LAUNCH_RUN, LAUNCH_SINK
from logs.verdict.wording import shortened

Floats = NDArray[np.float64]


def launch_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """One finding of a take-off that was flown."""
    ground = requirements.ground
    if ground is None or ground.ways.take_off is None:
        return []
    return [_flown(requirements, ground, ground.ways.take_off)]


def _no_motor(requirements: RouteRequirements, take_off: TakeOff) -> list[Message]:
    """That the launch is too gentle to start the motor; nothing of one that starts it."""
    trigger, pushed = requirements.setup.autopilot.launch_trigger, take_off.acceleration
    if trigger is None or pushed >= trigger[0]:
        return []
    brief = f"the launch accelerates at {pushed:.1f} m/s², less than {trigger[1]} {trigger[0]:g}"
    return [message(brief, ": the motor does not start")]


def _flown(requirements: RouteRequirements, ground: FlownGround, take_off: TakeOff) -> Finding:
    track = ground.launch
    position = np.asarray(track.position, dtype=np.float64)
    run = _runs(position)
    lost = float(position[0, 2] - position[:, 2].min())
    room, where = _room(requirements, position, run)
    faults = _no_motor(requirements, take_off)
    top = float(position[:, 2].max())
    if top <= take_off.top:
        brief = f"the take-off ended {top - take_off.base:.0f} m above home"
        faults.append(message(brief, f", short of {take_off.top - take_off.base:.0f} m"))
    if lost > LAUNCH_SINK:
        faults.append(message(f"sinks {lost:.1f} m after the launch", f"; {LAUNCH_SINK:g} m are allowed"))
    if room < LAUNCH_ROOM:
        faults.append(message(f"{room:.1f} m above ground", f" {where:.0f} m from home, on the course that is held"))
    entered = entered_by_way(requirements, Way(position, run))
    if entered:
        faults.append(message(f"the climb enters {entered}"))
    known = _described(take_off, track, run, room)
    return make_finding(
        "launch",
        requirements.waypoint(take_off.waypoint),
        ok=not faults,
        reason=reason_of(faults, known),
        faults=faults,
        flown=room,
        limit=LAUNCH_ROOM,
        source="check",
        tolerance=0.0,
        margin=room - LAUNCH_ROOM,
        unit="m",
        method="exact along the flown track",
        facts=(Fact("height lost", lost, "m"),),
    )


def _runs(position: Floats) -> Floats:
    """Way over the ground to each position (n, 3), (n,) m."""
    step = np.diff(position[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))])


def _room(requirements: RouteRequirements, position: Floats, run: Floats) -> tuple[float, float]:
    """Least height above ground beyond the launch itself, and how far from home that is; NaN where it is not known."""
    terrain = requirements.setup.scenario.terrain
    # A runway is as long as the aircraft needs: what counts begins where it has left the ground.
    first = LAUNCH_RUN
    take_off = None if requirements.ground is None else requirements.ground.ways.take_off
    if take_off is not None and take_off.launch.method == "runway":
        standing = float(position[0, 2] - take_off.home[2])
        over = position[:, 2] - _under(requirements, position) > standing + LAUNCH_ROOM
        first = max(first, float(run[int(np.argmax(over))]) if over.any() else float(run[-1]))
    if terrain is None or run[-1] <= first:
        return math.nan, math.nan
    return way_clearance(terrain, Way(position, run).between(first, float(run[-1])))


def _under(requirements: RouteRequirements, position: Floats) -> Floats:
    terrain = requirements.setup.scenario.terrain
    if terrain is None:
        return np.full(len(position), math.nan)
    return np.array([float(terrain.height(east, north)) for east, north in position[:, :2].tolist()])


def _described(take_off: TakeOff, track: Track, run: Floats, room: float) -> list[str]:
    """The take-off in words."""
    course, method = math.degrees(take_off.course) % 360.0, take_off.launch.method
    known = [f"launched on a runway on {course:.0f}°"]
    if method != "runway":
        how = "from a catapult" if method == "catapult" else "by hand"
        known = [f"launched {how} on {course:.0f}° at {take_off.speed:.1f} m/s, {take_off.acceleration:.1f} m/s²"]
    if run[-1] > 1.0:
        rise = float(track.position[-1, 2] - track.position[0, 2])
        course = math.degrees(math.atan2(*track.velocity[-1, :2].tolist())) % 360.0
        known.append(f"climbs at {rise / run[-1]:.2f}, at last on {course:.0f}°")
    if math.isfinite(room):
        known.append(f"{room:.0f} m above ground or more beyond {LAUNCH_RUN:.0f} m")
    return known


RULE = Rule(
    name="launch",
    title="launch",
    asks="Does the launch start the motor, lose no height, and climb out free of ground, missiles and zones?",
    margin=Margin("height above ground", "m", 10.0),
    tolerances=("LAUNCH_RUN", "LAUNCH_ROOM", "LAUNCH_SINK", "ROUNDING"),
    judge=launch_findings,
    phrase=lambda item: located("launch", item, shortened(item.brief)),
    explained=True,
)
