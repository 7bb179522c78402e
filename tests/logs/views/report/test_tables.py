"""The report's tables add up to the flight that they tabulate."""

from dataclasses import replace

import numpy as np
import pytest

import planfly
from logs.views.report.tables import (
    LEG_COLUMNS,
    PASSAGE_COLUMNS,
    energy_facts,
    flight_facts,
    flight_sentence,
    leg_rows,
    passage_rows,
    saturation_rows,
)
from planner.plan import GIVEN_WAYPOINTS, Certificate
from tests.logs.views.report.report_data import make_setup, make_track
from world.wording import format_number


def test_legs_add_up_to_the_flight() -> None:
    rows = [
        dict(zip(LEG_COLUMNS, row.cells, strict=True)) for row in leg_rows(make_setup(), make_track(), frozenset({1}))
    ]
    assert [row["length (m)"] for row in rows] == ["1\u2009000", "800", "600"]
    assert [row["course (°)"] for row in rows] == ["090.0", "000.0", "090.0"]
    # atan(40/1000), atan(40/800), atan(-20/600)
    assert [row["slope (°)"] for row in rows] == ["+2.29", "+2.86", "−1.91"]
    assert [row["turn at its end (°)"] for row in rows] == ["90.0 left", "90.0 right", "–"]
    assert sum(float(row["flown (s)"]) for row in rows) == pytest.approx(96.0)
    assert sum(float(row["energy (Wh)"]) for row in rows) == pytest.approx(48.0)
    assert [row["peak bank (°)"] for row in rows] == ["0.0", "28.6", "0.0"]
    assert [row["peak cross-track (m)"] for row in rows] == ["3.25", "0.00", "0.00"]
    # 200 m of ground under 300 m at the start, 340 m after the first leg, 360 m at the end
    assert [row["lowest height above ground (m)"] for row in rows] == ["100.0", "140.0", "160.0"]
    assert [row.failing for row in leg_rows(make_setup(), None, frozenset({1}))] == [False, True, False]


def test_the_lowest_height_is_that_of_the_rule_between_rows() -> None:
    """From 300 m to 300 m over a top of 280 m, half way between two rows of a sparse log."""
    hill = {"east_m": 0.0, "north_m": 0.0, "height_m": 280.0, "sigma_m": 60.0}
    setup, track = make_setup(terrain={"kind": "peaks", "peak": [hill]}), make_track()
    position = np.tile([300.0, 0.0, 300.0], (len(track), 1))
    position[:40, 0] = -300.0
    flown = replace(track, position=position, leg=np.zeros_like(track.leg))
    assert "never less than 20 m above ground" in flight_sentence(setup, flown)
    heights = [
        row.cells[LEG_COLUMNS.index("lowest height above ground (m)")] for row in leg_rows(setup, flown, frozenset())
    ]
    assert float(heights[0]) == pytest.approx(20.0, abs=0.5)


def test_stays_and_held_controls_are_those_of_the_track() -> None:
    threat = {"name": "M", "east_m": 100, "north_m": 0, "amsl_m": 360, "kill_radius_m": 250, "kill_scale_m": 50}
    setup, track = make_setup(threats=[threat]), make_track()
    (row,) = passage_rows(setup, track)
    # On the northward leg at 100 m east: in and out where the sphere's surface crosses it.
    assert dict(zip(PASSAGE_COLUMNS, row, strict=True))["closest (m)"] == "0"
    assert float(row[4]) == pytest.approx(20.0, abs=0.05)
    commands = track.commands.copy()
    commands[10:30, 3] = 1.0
    commands[50:55, 0] = -2.0
    held = saturation_rows(setup, replace(track, commands=commands))
    assert [cells[0] for cells in held] == ["elevator", "aileron", "rudder", "throttle"]
    assert [cells[3] for cells in held[:3]] == ["5.0", "0.0", "0.0"]
    # A closed throttle is at a limit, too: the track's is, all the time.
    assert held[3][3] == format_number(float(track.time[-1]), digits=1)
    assert held[0][2] == "114.6°"


def test_nothing_is_said_of_a_battery_that_the_log_does_not_hold() -> None:
    setup, track = make_setup(), make_track()
    assert flight_sentence(setup, track).endswith(" Wh.")
    assert energy_facts(setup, track)
    silent = replace(track, energy=np.full(len(track), np.nan))
    assert "Wh" not in flight_sentence(setup, silent)
    assert energy_facts(setup, silent) == []


@pytest.mark.parametrize(
    ("problems", "status"),
    [
        (("leg 1: 420 m long",), "planner's margins not met"),
        (("landing: none of 3 paths is clear",), "not feasible"),
        (("leg 1: 420 m long", "landing: none of 3 paths is clear"), "not feasible"),
    ],
)
def test_a_plan_that_no_flight_mends_is_not_feasible(problems: tuple[str, ...], status: str) -> None:
    """Given waypoints that also miss margins of the planner."""
    certificate = Certificate(0.1, 20.0, 0.2, 9.0, 10.0, 50.0, problems)
    plan = replace(
        planfly.plan("tight", seed=1, budget=200),
        certificate=certificate,
        algorithm=GIVEN_WAYPOINTS,
        violations=np.zeros(4),
    )
    facts = dict(flight_facts(replace(make_setup(), plan=plan), ""))
    assert facts["Plan"] == f"given waypoints, not searched; {status}"
