"""Returns from a take-off and a landing that were flown: what of them is left out, and what counts."""

import re
from dataclasses import replace

import numpy as np
import pytest

from flight.mission.return_path import ReturnTarget
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import Kind, SimulatedReturn, judge_returns, make_return_world, sinks_to_ground
from logs.verdict.returns.return_starts import SINK_HEIGHT_LOSS_M, flown_starts
from logs.verdict.returns.returns_text import returns_headline
from logs.views.report.tables import flight_sentence
from tests.logs.verdict.rules.flown_circuits import flown_circuit
from world.scenario import scenario_from_spec


def a_return(kind: Kind, sunk: float, run: float) -> SimulatedReturn:
    """One that comes to its least clearance so much lower than it begins, and so far from there, m."""
    start, at = (100.0, 0.0, 340.0), (100.0, run, 340.0 - sunk)
    target = ReturnTarget((0.0, 0.0, 400.0), "home", "", 0.0)
    return SimulatedReturn(0.0, start, target, kind, 0.0, at, 99.0, -1, -1, 1.0, 9.0, 1.0)


@pytest.mark.parametrize(
    ("kind", "sunk", "run", "height", "left_out"),
    [
        # Half of its height within 500 m.
        ("ground", 20.0, 300.0, 40.0, True),
        ("ground", 19.9, 300.0, 40.0, False),
        ("low", 20.0, 300.0, 40.0, True),
        ("ground", 20.0, 500.0, 40.0, True),
        ("ground", 20.0, 500.1, 40.0, False),
        # Lower than 10 m whatever it loses: the ground of a field may rise.
        ("ground", 0.0, 300.0, 9.9, True),
        ("ground", 0.0, 300.0, 10.0, False),
        # A sphere is none of the ground's business.
        ("threat", 20.0, 300.0, 5.0, False),
        ("safe", 20.0, 300.0, 5.0, False),
    ],
)
def test_what_sinks_to_the_ground_beside_what_flies_into_it(
    kind: Kind, sunk: float, run: float, height: float, left_out: bool
) -> None:
    assert sinks_to_ground(a_return(kind, sunk, run), height) is left_out


def test_nothing_of_a_good_flight_from_the_ground_to_the_ground_hits_it() -> None:
    flown = flown_circuit()
    world, track = make_return_world(flown.setup), flown.track
    starts = flown_starts(flown.setup, track, 1.0)
    found = judge_returns(world, starts, 1.0)
    assert found.count("ground") == 0
    # It takes off in a second or two, and slides and stands for a quarter of a minute.
    assert starts.grounded_count >= 5
    assert found.omitted_count >= starts.grounded_count
    assert len(found.each) + found.omitted_count == pytest.approx(track.time[-1] - track.time[0], abs=2.0)
    assert (
        f"; {found.omitted_count} starts on or near the ground during take-off and landing omitted"
        in returns_headline(found)
    )
    # Low are the climb to the take-off's height and the final, none between them.
    low = starts.time[starts.is_low]
    # The ground is level, at 0 m.
    assert (starts.rows["up"][starts.is_low] < flown.setup.limits.min_clearance + SINK_HEIGHT_LOSS_M).all()
    between = (starts.time > 20.0) & (track.leg[np.searchsorted(track.time, starts.time)] < flown.approach.leg)
    assert not starts.is_low[between].any()
    assert low[0] < 5.0
    # Without its engine it comes down straight ahead from there.
    assert {one.time for one in judge_glides(world, starts).each} == set(starts.time[~starts.is_low].tolist())


def test_a_report_states_the_least_height_between_take_off_and_landing() -> None:
    """The take-off ends at 60 m; the way leads over 80 m and 70 m to 54 m, where the landing begins."""
    flown = flown_circuit()
    said = flight_sentence(flown.setup, flown.track)
    low = re.search(
        r"never less than (\d+) m above ground after the take-off and before the final approach on leg 3,", said
    )
    assert low is not None, said
    assert int(low[1]) == pytest.approx(54, abs=4)


def test_a_return_from_the_climb_into_a_hill_counts() -> None:
    """The aircraft takes off to the east; a hill of 120 m stands 400 m north of where it turns back."""
    flown = flown_circuit()
    hill = {"east_m": 150.0, "north_m": 250.0, "height_m": 150.0, "sigma_m": 90.0}
    spec = flown.setup.scenario.to_json()
    walled = scenario_from_spec(spec | {"terrain": {"kind": "peaks", "peak": [hill]}}, "walled")
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, terrain=walled.terrain))
    starts = flown_starts(setup, flown.track, 1.0)
    found = judge_returns(make_return_world(setup), starts, 1.0)
    low = set(starts.time[starts.is_low].tolist())
    assert [one for one in found.each if one.time in low and one.kind == "ground"]
