import math
from dataclasses import replace

from flight.simulation.field_source import MissionStretch
from logs.recording.example_log import example_log
from logs.report.refly_lines import left_lines, refly_lines, trust_line
from logs.verdict.field.flown_legs import flown_legs
from logs.verdict.field.model_comparison import Spread, compare_with_model
from world.scenario_variants import with_wind

LOG = example_log()
FLOWN = flown_legs(LOG.setup, LOG.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
assert FLOWN is not None
AGAIN = compare_with_model(LOG.setup, FLOWN, LOG.track, "completed")


def test_a_row_a_leg_and_a_turn() -> None:
    lines = refly_lines(AGAIN)
    assert [line.split()[:2] for line in lines if line.startswith(("leg", "waypoint"))] == [
        ["leg", "0"],
        ["leg", "1"],
        ["waypoint", "1"],
    ]


def test_what_is_not_known_is_a_dash() -> None:
    silent = replace(AGAIN.legs[0], energy=(math.nan, 2.0))
    assert "- / 2.0" in refly_lines(replace(AGAIN, legs=(silent,)))[2]


def test_the_trust_is_a_line_with_medians() -> None:
    spread = (Spread("cross_track", "m", 0.5, 2.0),)
    line = trust_line(replace(AGAIN, spreads=spread))
    blown = "Model aerosonde in 0.0 m/s of wind, no gusts, against the flight"
    assert line == f"{blown}, median (95 %): cross-track 0.50 m (2.00 m)"
    scenario = with_wind(AGAIN.setup.scenario, 4.0, 0.0, "light")
    gusty = replace(AGAIN, setup=replace(AGAIN.setup, scenario=scenario))
    assert "in 4.0 m/s of wind, light turbulence, against" in trust_line(gusty)
    assert "which stands in for an aircraft that is not named" in trust_line(replace(AGAIN, stands_in=True))
    assert "ended early: departure" in trust_line(replace(AGAIN, ended="departure"))
    assert "no place in common" in trust_line(replace(AGAIN, spreads=()))


def test_what_was_not_flown_again_is_named_with_its_reason() -> None:
    other = MissionStretch(50.0, 60.0, "AUTO", "log")
    assert left_lines((AGAIN,), (AGAIN.stretch,), 9) == []
    (line,) = left_lines((AGAIN,), (AGAIN.stretch, other), 9)
    assert line == "Not flown again: AUTO from 50.0 s to 60.0 s: it passed no two waypoints in order"
    (line,) = left_lines((AGAIN,), (AGAIN.stretch, other), 1)
    assert line.endswith("in order, or 1 longer ones were")
