"""Completion: unfinished flights, records with holes and detours, plans that are not feasible."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track, join_tracks
from logs.verdict.judge_flight import judge_flight, judge_geometry
from planner.plan import GIVEN_WAYPOINTS
from tests.logs.verdict.judging import bad_plan, judge, leg, of, waypoint
from tests.synthetic import (
    copied,
    edited,
    fly_path,
)


def test_an_unfinished_flight_is_never_flyable(setup: FlightSetup) -> None:
    verdict = judge_flight(setup, fly_path(setup, stop=3000.0), "ground contact")
    assert not verdict.complete
    assert not verdict.flyable
    assert verdict.summary.startswith("not flyable: completion (the flight ended early: ground contact)")
    assert of(verdict, "slope", leg(0)).ok
    assert of(verdict, "slope", leg(3)).ok is None
    assert of(verdict, "turn", waypoint(3)).ok is None
    assert of(verdict, "waypoint", waypoint(2)).ok is False
    assert of(verdict, "completion").flown == 1.0
    assert "1 of 4 legs flown; the first leg that was not flown to its end is leg 1" in of(verdict, "completion").reason
    # The same track is not complete even if its recorder says so, nor is a whole one in a damaged log.
    assert not judge(setup, fly_path(setup, stop=3000.0)).complete
    assert not judge(setup, fly_path(setup), log_complete=False).complete


def test_a_hole_in_the_record(setup: FlightSetup, track: Track) -> None:
    holed = join_tracks([track.rows(0, 3000), track.rows(3100, len(track))])
    assert "the log has no rows" in of(judge(setup, holed), "completion").reason


def test_an_infeasible_plan_flown_is_not_complete(setup: FlightSetup, track: Track) -> None:
    plan = bad_plan(setup)
    assert not judge(replace(setup, plan=plan), track).complete
    assert not judge_geometry(replace(setup, plan=plan)).flyable


def test_given_waypoints_need_not_meet_the_planners_margins(setup: FlightSetup, track: Track) -> None:
    """Nothing was searched for them: as the mission of the same waypoints, they are judged by their flight."""
    given = replace(setup, plan=replace(bad_plan(setup), algorithm=GIVEN_WAYPOINTS))
    line = "Planner's margins not met: leg 2: slope 16.6 deg beyond 13.7 deg"
    for verdict, mission in (
        (judge(given, track), judge(setup, track)),
        (judge_geometry(given), judge_geometry(setup)),
    ):
        assert (verdict.flyable, verdict.complete, verdict.findings) == (True, True, mission.findings)
        assert [words for words in verdict.lines if words not in mission.lines] == [line]
    # A departure is searched for them, too.
    certificate = replace(given.plan.certificate, problems=("climb-out: no path", "leg 2: slope 16.6 deg"))
    grounded = replace(given, plan=replace(given.plan, certificate=certificate))
    flown = judge(grounded, track)
    assert of(flown, "completion").reason == "the plan is not feasible: climb-out: no path"
    assert "Planner's margins not met: leg 2: slope 16.6 deg" in flown.lines
    assert (
        judge_geometry(grounded).headline == "not flyable: completion (no feasible plan was found: climb-out: no path)"
    )


def test_a_circle_beside_a_leg_is_not_the_leg(setup: FlightSetup, track: Track) -> None:
    k = int(np.searchsorted(track.position[:, 1], 2600.0))
    columns = copied(track)
    ticks = int(2 * math.pi * 110.0 / 25.0 * 60.0)
    angle = np.linspace(0.0, 2 * math.pi, ticks, endpoint=False)
    circle = {name: np.repeat(column[k : k + 1], ticks, axis=0) for name, column in columns.items()}
    step = columns["position"][k + 1] - columns["position"][k]
    along = step / np.linalg.norm(step)
    right = np.array([along[1], -along[0], 0.0])
    circle["position"] = columns["position"][k] + 110.0 * (
        np.outer(np.sin(angle), along) + np.outer(1 - np.cos(angle), right)
    )
    circle["velocity"] = 25.0 * (np.outer(np.cos(angle), along) + np.outer(np.sin(angle), right))
    circle["time"] = columns["time"][k] + np.arange(ticks) / 60.0
    late = {name: column[k:].copy() for name, column in columns.items()}
    late["time"] += ticks / 60.0
    first = {name: column[:k] for name, column in columns.items()}
    looped = join_tracks([Track(**first), Track(**circle), Track(**late)])
    assert "220 m off the legs" in of(judge(setup, looped), "corridor", leg(1)).reason


def test_one_moved_row_is_a_contradiction(setup: FlightSetup, track: Track) -> None:
    position = track.position.copy()
    position[5000, 0] += 3.0
    verdict = judge(setup, edited(track, position=position))
    assert not verdict.complete
    assert "contradict" in of(verdict, "completion").reason


@pytest.mark.parametrize("row", [700, 5000])
def test_where_a_record_contradicts_itself_is_told(setup: FlightSetup, track: Track, row: int) -> None:
    """One row moved 3 m aside at 60 rows a second: 180 m/s on both sides of it, of which the first is told."""
    position = track.position.copy()
    position[row, 2] += 3.0
    reason = of(judge(setup, edited(track, position=position)), "completion").reason
    told = float(reason.split("contradict each other at ")[1].split(" s")[0])
    assert told in (round(float(track.time[row - 1]), 2), round(float(track.time[row]), 2))


def test_what_is_missing_of_a_record_is_told(setup: FlightSetup, track: Track) -> None:
    holed = join_tracks([track.rows(0, 3000), track.rows(3100, 6000), track.rows(6040, len(track))])
    wanted = f"the log has no rows from {track.time[2999]:.1f} s to {track.time[3100]:.1f} s"
    assert wanted in of(judge(setup, holed), "completion").reason
