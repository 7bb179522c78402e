"""The touchdown rule: a landing that was flown, from the last waypoint to where the aircraft stands.

Judged are where it touches down and where it comes to rest against the strip, its bank, and what the final enters.  How
fast it sinks towards the ground, which may rise before it, is stated and not judged: ArduPlane's law knows the glide to
the flare, but not the last metres so well (`docs/measured.md`).  A landing that is not flown is judged by the landing
and approach rules, by the mission's items.
"""

import math

import numpy as np
from numpy.typing import NDArray

from flight.mission.ground_ways import Approach
from flight.simulation.track import Track
from logs.verdict.findings import Fact, Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import Way, entered_by_way
from logs.verdict.rule import Margin, Rule, located
from logs.verdict.tolerances import TOUCH_ERROR, TOUCHED
from logs.verdict.wording import shortened
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Along this much of the strip about the touch-down the ground's slope is taken, m.
_SLOPE_OVER = 10.0


def touchdown_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """One finding of a landing that was flown, at the landing point; none before the flight."""
    ground = requirements.ground
    if ground is None or ground.ways.approach is None:
        return []
    approach = ground.ways.approach
    place = ground.whole.waypoint(approach.leg + 1)
    track, terrain = ground.landing, requirements.setup.scenario.terrain
    if ground.left >= len(ground.track) - 1:
        reason = "the flight did not get to its landing"
        return [make_finding("touchdown", place, ok=None, reason=reason, unit="m")]
    k = _touched(track, terrain)
    if k is None or terrain is None:
        fault = message("the aircraft did not touch down", f" at {place_of(approach)}")
        return [make_finding("touchdown", place, ok=False, reason=fault.text, faults=[fault], unit="m")]
    along, aside = (float(value) for value in approach.place(np.asarray(track.position[k], dtype=np.float64)))
    stop, off = (float(value) for value in approach.place(np.asarray(track.position[-1], dtype=np.float64)))
    left = 0.5 * approach.strip.length - stop
    faults = _off_strip(approach, (along, aside), (stop, off))
    position = np.asarray(track.position, dtype=np.float64)
    step = np.diff(position[:, :2], axis=0)
    entered = entered_by_way(
        requirements, Way(position, np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))]))
    )
    if entered:
        faults.append(message(f"the final enters {entered}"))
    sink, towards = _sinks(track, terrain, approach, k)
    inside = 0.5 * approach.strip.length - TOUCH_ERROR
    return [
        make_finding(
            "touchdown",
            place,
            ok=not faults,
            reason=reason_of(faults, _described(approach, (along, aside), (stop, left), (sink, towards))),
            faults=faults,
            flown=max(stop, abs(along)),
            limit=inside,
            source="scenario",
            tolerance=0.0,
            margin=inside - max(stop, abs(along)),
            unit="m",
            method="contact of skids or wheels with the ground, from the flown track",
            facts=(
                Fact("along", along, "m"),
                Fact("aside", aside, "m"),
                Fact("sink", sink, "m/s"),
                Fact("sink towards the ground", towards, "m/s"),
                Fact("strip left", left, "m"),
            ),
        )
    ]


def place_of(approach: Approach) -> str:
    """The landing point in words."""
    return f"item {approach.item}"


def _touched(track: Track, terrain: Terrain | None) -> int | None:
    """The row at which the aircraft first stands as low over the ground as it does at rest; None for none."""
    if terrain is None or not len(track):
        return None
    up = np.asarray(track.position[:, 2], dtype=np.float64)
    under = np.array([float(terrain.height(east, north)) for east, north in track.position[:, :2].tolist()])
    over, speed = up - under, np.hypot(*np.asarray(track.velocity[:, :2], dtype=np.float64).T)
    # It stands where it has come to rest; a flight that ended otherwise has not landed.
    if not speed[-1] < 1.0:
        return None
    low = over <= over[-1] + TOUCHED
    return int(np.argmax(low)) if low.any() else None


def _sinks(track: Track, terrain: Terrain, approach: Approach, k: int) -> tuple[float, float]:
    """Sink just before the touch-down, and that towards the ground, which rises or falls along the landing, m/s."""
    k = max(0, k - 2)
    east, north, up = (float(value) for value in track.velocity[k])
    here = np.asarray(track.position[k, :2], dtype=np.float64)
    ahead = 0.5 * _SLOPE_OVER * np.array([math.sin(approach.course), math.cos(approach.course)])
    rise = float(terrain.height(*(here + ahead)) - terrain.height(*(here - ahead))) / _SLOPE_OVER
    over_ground = east * math.sin(approach.course) + north * math.cos(approach.course)
    return -up, -up + rise * over_ground


def _off_strip(approach: Approach, touch: tuple[float, float], stop: tuple[float, float]) -> list[Message]:
    """What of the landing is not on the strip, whose middle is the landing point.

    touch, stop: how far beyond the landing point and to the right of it, m.
    """
    half, side = 0.5 * approach.strip.length, 0.5 * approach.strip.width
    faults = []
    if abs(touch[0]) > half - TOUCH_ERROR:
        where = "before" if touch[0] < 0.0 else "beyond"
        brief = f"touches down {abs(touch[0]):.0f} m {where} the landing point"
        faults.append(message(brief, f"; {half - TOUCH_ERROR:.0f} m are allowed on this strip"))
    if stop[0] > half - TOUCH_ERROR:
        brief = f"comes to rest {half - stop[0]:.0f} m before the strip's end"
        if stop[0] > half:
            brief = f"runs {stop[0] - half:.0f} m beyond the strip's end"
        faults.append(message(brief, f"; {TOUCH_ERROR:.0f} m are to be left"))
    aside = max(abs(touch[1]), abs(stop[1]))
    if aside > side:
        faults.append(message(f"{aside:.0f} m beside the strip's middle", f"; it is {2.0 * side:.0f} m wide"))
    return faults


def _described(
    approach: Approach, touch: tuple[float, float], stop: tuple[float, float], sinks: tuple[float, float]
) -> list[str]:
    """The landing in words; sinks: as `_sinks` gives them."""
    before = "before" if touch[0] < 0.0 else "beyond"
    known = [f"touches down {abs(touch[0]):.0f} m {before} the landing point, {abs(touch[1]):.1f} m aside"]
    known.append(f"comes to rest with {stop[1]:.0f} m of the strip left")
    known.append(f"sinks at {sinks[0]:.1f} m/s, {sinks[1]:.1f} m/s towards the ground, by a flare that is not judged")
    if approach.tail_wind > 0.1:
        known.append(f"with {approach.tail_wind:.1f} m/s of tail wind")
    return known


RULE = Rule(
    name="touchdown",
    title="touchdown",
    asks="Does the aircraft touch down and come to rest on the strip, without entering anything on its final?",
    margin=Margin("strip", "m", 20.0),
    tolerances=("TOUCH_ERROR", "TOUCHED", "ROUNDING"),
    judge=touchdown_findings,
    phrase=lambda item: located("touchdown", item, shortened(item.brief)),
    explained=True,
)
