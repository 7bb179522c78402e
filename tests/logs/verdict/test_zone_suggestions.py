"""Ways past a zone: each suggested shift passes, and one a little smaller does not."""

from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import Place
from logs.verdict.tolerances import BUFFER_LENGTH
from logs.verdict.wording import suggestions_text
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup
from world.airspace.zones import Cylinder, Zone, ZoneKind, ZoneLevel, make_polygon

LINE = [[0.0, 0.0, 300.0], [0.0, 4000.0, 300.0]]
# 40 m of it west of the line, 260 m east.
TOWN = make_polygon([[(-40.0, 1000.0), (260.0, 1000.0), (260.0, 2000.0), (-40.0, 2000.0)]])


def with_zone(zone: Zone, line: list[list[float]] = LINE) -> FlightSetup:
    setup = make_setup(line)
    return replace(setup, scenario=replace(setup.scenario, zones=(zone,)))


def test_the_nearest_side_and_the_nearest_height() -> None:
    town = Zone("town", "exclusion", TOWN, None, ZoneLevel(350.0, "ground"))
    item = of(judge_geometry(with_zone(town)), "fence")
    place = Place("exclusion", 0, name="town")
    west, higher = (suggestion[0] for suggestion in item.suggestions)
    assert (west.what, west.place, west.wanted) == ("west", place, pytest.approx(41.0, abs=1.0))
    assert (higher.what, higher.wanted) == ("height", pytest.approx(51.0, abs=1.0))
    assert suggestions_text(item.suggestions) in (
        "pass town 41 m further west, or pass town 51 m higher",
        "pass town 42 m further west, or pass town 52 m higher",
    )


@pytest.mark.parametrize(
    ("zone", "steps"),
    [
        (Zone("disc", "exclusion", Cylinder(30.0, 1500.0, 200.0)), {"west": np.array([-1.0, 0.0, 0.0])}),
        (
            Zone("wedge", "exclusion", make_polygon([[(-90.0, 1500.0), (600.0, 900.0), (600.0, 2100.0)]])),
            {"west": np.array([-1.0, 0.0, 0.0])},
        ),
        (
            Zone("field", "inclusion", Cylinder(1900.0, 2000.0, 2800.0), ZoneLevel(330.0, "amsl")),
            {"height": np.array([0.0, 0.0, 1.0])},
        ),
    ],
)
def test_what_is_suggested_passes_and_less_does_not(zone: Zone, steps: dict[str, np.ndarray]) -> None:
    item = of(judge_geometry(with_zone(zone)), "fence")
    changes = {change.what: change.wanted for suggestion in item.suggestions for change in suggestion}
    assert set(steps) <= set(changes)
    for what, step in steps.items():
        # A metre less than was asked for, but for its rounding up, is not enough; what was asked for is.
        for wanted, passes in ((changes[what], True), (changes[what] - BUFFER_LENGTH - 1.05, False)):
            line = (np.array(LINE) + wanted * step).tolist()
            assert of(judge_geometry(with_zone(zone, line)), "fence").ok is passes


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_a_flight_that_left_its_path_is_what_is_shifted(kind: ZoneKind) -> None:
    # The plan is 20 m outside, or inside, of an edge; the flight is 30 m off to that side.
    side = make_polygon([[(20.0, -900.0), (900.0, -900.0), (900.0, 4900.0), (20.0, 4900.0)]])
    held = make_polygon([[(-900.0, -900.0), (20.0, -900.0), (20.0, 4900.0), (-900.0, 4900.0)]])
    setup = with_zone(Zone("edge", kind, side if kind == "exclusion" else held))
    track = fly_path(setup)
    item = of(judge(setup, edited(track, position=track.position + np.array([30.0, 0.0, 0.0]))), "fence")
    assert item.ok is False
    (change,) = item.suggestions[0]
    assert (change.what, change.wanted) == ("west", pytest.approx(11.0, abs=1.0))
    verb = "pass" if kind == "exclusion" else "stay in"
    assert suggestions_text(item.suggestions).startswith(f"{verb} edge 1")
