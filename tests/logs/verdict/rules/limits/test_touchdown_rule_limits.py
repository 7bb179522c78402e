"""How far from the strip's middle an aircraft may touch down and stop, and what of its final leaves that open."""

from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.findings import GROUND_PATH, Finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.rules.touchdown_rule import _detect_faults, _Landing, _landing_finding
from tests.flight.autopilots.arduplane.flown_grounds import circuit
from tests.logs.verdict.judging import leg
from tests.logs.verdict.rules.flown_circuits import RAIL, STRIP, flown_circuit, found, moved
from world.wind import Turbulence


def distances_from_strip_center(**strip: float) -> bool | None:
    flown = flown_circuit()
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, landing=replace(STRIP, **strip)))
    return found(setup, flown.track, "touchdown").ok


def known(what: str) -> float:
    flown = flown_circuit()
    return {fact.what: fact.value for fact in found(flown.setup, flown.track, "touchdown").facts}[what]


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_thirty_metres_of_the_strip_are_left(more: float, ok: bool) -> None:
    """The strip's half, less 30 m, against where the aircraft stops or touches down, whatever is farther."""
    farther = max(abs(known("along")), 300.0 - known("strip left"))
    assert distances_from_strip_center(length=2.0 * (farther + 30.0 + more)) is ok


@pytest.mark.parametrize(
    ("length", "stop", "faults", "open_"),
    [
        (60.0, 59.9, 0, True),
        (60.0, 60.1, 1, True),
        (60.1, 0.2, 1, False),
        (60.1, 0.0, 0, False),
    ],
)
def test_a_strip_that_the_error_leaves_nothing_of_is_left_open(
    length: float, stop: float, faults: int, open_: bool
) -> None:
    """On 60 m and less only a stop more than 30 m off the strip's end is known to be off it."""
    approach = flown_circuit().setup.ground_phases.approach
    assert approach is not None
    short = replace(approach, strip=replace(approach.strip, length=length))
    at = _Landing(0.0, 0.0, (0.0, 0.0), (stop, 0.0), 0.5 * length - stop, 1.0, 1.0, 10.0, 0.0)
    without_faults = _landing_finding(leg(0), short, at, [], has_gusts=False)
    assert (len(_detect_faults(short, at)), without_faults.ok is None) == (faults, open_)


@pytest.mark.parametrize(
    ("touch", "stop", "gusts", "ok"),
    [
        (0.0, 49.9, True, True),
        (0.0, 50.1, True, None),
        (0.0, 50.1, False, True),
        (0.0, 70.1, True, False),
        (49.9, 0.0, True, True),
        (50.1, 0.0, True, None),
        (-50.1, 0.0, True, True),
        (-70.1, 0.0, True, False),
    ],
)
def test_in_turbulence_fifty_metres_of_the_strip_are_left(
    touch: float, stop: float, gusts: bool, ok: bool | None
) -> None:
    """On a strip of 200 m."""
    approach = flown_circuit().setup.ground_phases.approach
    assert approach is not None
    strip = replace(approach, strip=replace(approach.strip, length=200.0))
    at = _Landing(0.0, 0.0, (touch, 0.0), (stop, 0.0), 100.0 - stop, 1.0, 1.0, 10.0, 0.0)
    assert _landing_finding(leg(0), strip, at, _detect_faults(strip, at), has_gusts=gusts).ok is ok


@pytest.mark.parametrize(("turbulence", "ok"), [("none", True), ("light", None)])
def test_the_scenarios_turbulence_counts(turbulence: Turbulence, ok: bool | None) -> None:
    """Forty metres of the strip are left."""
    flown = flown_circuit()
    scenario, length = flown.setup.scenario, 2.0 * (300.0 - known("strip left") + 40.0)
    changed = replace(scenario, wind=replace(scenario.wind, turbulence=turbulence))
    setup = flown.setup.in_scenario(replace(changed, landing=replace(STRIP, length=length)))
    assert found(setup, flown.track, "touchdown").ok is ok


@pytest.mark.parametrize(("length", "open_"), [(60.0, True), (60.1, False)])
def test_a_strip_that_is_too_short_is_said_before_the_flight(length: float, open_: bool) -> None:
    flown = flown_circuit()
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, landing=replace(STRIP, length=length)))
    said = [one for one in judge_geometry(setup).findings if one.rule == "touchdown"]
    assert [one.check for one in said] == ([GROUND_PATH] if open_ else [])


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_it_stays_within_half_the_width(more: float, ok: bool) -> None:
    flown = flown_circuit()
    farther = max(abs(known("aside")), abs(float(flown.track.position[-1, 1]) - 600.0))
    assert distances_from_strip_center(width=2.0 * (farther + more)) is ok


@pytest.mark.parametrize(("over", "same"), [(0.018, True), (0.022, False)])
def test_two_centimetres_over_where_it_stands_it_has_touched_down(over: float, same: bool) -> None:
    flown = flown_circuit()
    track = flown.track
    down = int(np.argmax((track.time > 60.0) & (track.clearance < track.clearance[-1] + 0.02)))
    row = down - 60
    standing = float(track.position[-1, 2])
    low = moved(track, slice(row, row + 1), up=standing + over - float(track.position[row, 2]))
    facts = {fact.what: fact.value for fact in found(flown.setup, low, "touchdown").facts}
    assert (facts["along"] < known("along") - 1.0) is same


def final_row(before: float) -> int:
    """The row of the landing so far before its point, m; it lands to the west, at 500 m east."""
    track = flown_circuit().track
    east, north = track.position[:, 0], track.position[:, 1]
    return int(np.argmax((track.time > 60.0) & (north > 500.0) & (east < 500.0 + before)))


def with_low_final(before: float, up: float) -> Finding:
    """Of the landing with one row at a height, over ground at 0 m."""
    flown, row = flown_circuit(), final_row(before)
    low = moved(flown.track, slice(row, row + 1), up=up - float(flown.track.position[row, 2]))
    return found(flown.setup, low, "touchdown")


@pytest.mark.parametrize(("up", "ok"), [(3.01, True), (2.99, None)])
def test_a_final_within_three_metres_of_the_ground_is_left_open(up: float, ok: bool | None) -> None:
    one = with_low_final(400.0, up)
    assert one.ok is ok, one.reason
    if ok is None:
        assert (one.check, one.brief) == (GROUND_PATH, "the final approach clears the ground by only 3.0 m")


@pytest.mark.parametrize(("more", "ok"), [(2.0, None), (-2.0, True)])
def test_from_fifteen_metres_over_the_point_on_it_may_flare(more: float, ok: bool | None) -> None:
    """The glide's distance to where it is 15 m over the point, by its slope and where its flare begins."""
    setup = flown_circuit().setup
    approach = setup.ground_phases.approach
    assert approach is not None
    glide = setup.autopilot.ground.glide(approach.start_altitude, approach.length, approach.tail_wind, 0.0)
    before = glide.flare_distance + (15.0 - glide.flare_height) / glide.slope
    assert with_low_final(before + more, 2.0).ok is ok


@pytest.mark.parametrize(("point", "ok"), [(9.98, True), (10.02, None), (-9.98, True), (-10.02, False)])
def test_a_landing_point_is_within_ten_metres_of_the_ground(point: float, ok: bool | None) -> None:
    """Of one that is higher the elevation file or home may be wrong; into a lower one the aircraft flies."""
    setup = circuit(RAIL, STRIP, point=point, TKOFF_THR_MINACC=15.0)
    one = found(setup, flown_circuit().track, "touchdown")
    assert one.ok is ok, one.reason
    assert (one.check == GROUND_PATH) is (ok is None)
    if ok is not True:
        assert one.brief == f"the landing point of item 5 is 10 m {'above' if point > 0.0 else 'below'} the ground"


@pytest.mark.parametrize(("sink", "ok"), [(4.99, True), (5.01, None)])
def test_a_sink_beyond_all_that_was_seen_is_left_open(sink: float, ok: bool | None) -> None:
    flown = flown_circuit()
    track = flown.track
    down = int(np.argmax((track.time > 60.0) & (track.clearance <= track.clearance[-1] + 0.02)))
    velocity = np.array(track.velocity)
    velocity[down - 5 : down + 1, 2] = -sink
    one = found(flown.setup, replace(track, velocity=velocity), "touchdown")
    assert one.ok is ok, one.reason
    if ok is None:
        assert one.check == GROUND_PATH
        assert one.brief == "sinks at 5.0 m/s towards the ground at touchdown"
