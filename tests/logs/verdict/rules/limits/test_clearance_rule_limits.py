"""Heights over level ground just inside and just outside the clearance, planned and flown, on each leg."""

from dataclasses import replace

import numpy as np
import pytest

from flight.mission.items import Home, Mission, MissionItem
from flight.simulation.setup import FlightSetup, ImportedLog
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.suggestions import home_height_text
from tests.logs.verdict.judging import judge, leg, of
from tests.synthetic import bump, fly_path, make_setup

ROUTE = [[0, 0], [0, 3000], [0, 6000], [0, 9000]]


def over(up: float) -> list[list[float]]:
    return [[*place, up] for place in ROUTE]


@pytest.mark.parametrize(("up", "ok"), [(59.91, True), (59.89, False), (57.5, False)])
def test_a_planned_clearance_is_kept_to_a_decimetre(up: float, ok: bool) -> None:
    setup = make_setup(over(up), limits={"min_clearance_m": 60.0})
    assert of(judge_geometry(setup), "clearance", leg(1)).ok is ok


@pytest.mark.parametrize(("up", "ok"), [(59.92, True), (59.88, False), (57.5, False)])
@pytest.mark.parametrize(("number", "at"), [(0, 0.0), (0, 1500.0), (1, 4500.0), (2, 7500.0), (2, 9000.0)])
def test_a_flown_clearance_is_kept_to_a_decimetre_from_the_first_row_to_the_last(
    up: float, ok: bool, number: int, at: float
) -> None:
    setup = make_setup(over(100.0), limits={"min_clearance_m": 60.0})
    item = of(judge(setup, fly_path(setup, up=bump(at, up - 100.0, 150.0))), "clearance", leg(number))
    assert item.ok is ok
    assert item.flown == pytest.approx(up, abs=0.01)
    assert np.isclose(item.margin or 0.0, up - 60.0, atol=0.01)


@pytest.mark.parametrize(("up", "ok"), [(59.92, True), (59.88, False)])
@pytest.mark.parametrize(("number", "at"), [(0, 500.0), (2, 9500.0)])
def test_what_was_flown_before_the_first_waypoint_and_after_the_last_counts(
    up: float, ok: bool, number: int, at: float
) -> None:
    """A track that begins a kilometre before its route and ends a kilometre after it."""
    longer = make_setup([[0, 0, 100], [0, 10_000, 100]])
    setup = make_setup(
        [[0, 1000, 100], [0, 4000, 100], [0, 6000, 100], [0, 9000, 100]], limits={"min_clearance_m": 60.0}
    )
    item = of(judge(setup, fly_path(longer, up=bump(at, up - 100.0, 50.0))), "clearance", leg(number))
    assert item.ok is ok
    assert item.flown == pytest.approx(up, abs=0.01)


@pytest.mark.parametrize(("alt", "is_noted"), [(9.9, False), (10.1, True), (-9.9, False), (-10.1, True)])
def test_a_home_off_the_ground_is_named_beyond_the_error_of_elevation_files(alt: float, is_noted: bool) -> None:
    setup = at_home(make_setup(over(75.0), limits={"min_clearance_m": 30.0}), alt)
    verdict = judge_geometry(setup)
    assert verdict.flyable
    assert ("the ground there" in verdict.headline) is is_noted
    # The home of a log is where its aircraft was armed.
    assert not home_height_text(replace(setup, imported_log=ImportedLog("flight.bin", "", "")))


def at_home(setup: FlightSetup, alt: float, frame: int = 3) -> FlightSetup:
    """The setup of a mission file with a home, and with one item in a frame."""
    origin = setup.scenario.origin
    item = MissionItem(1, 16, frame, (0.0,) * 4, origin.lat_deg, origin.lon_deg, 50.0)
    mission = Mission(Home(origin.lat_deg, origin.lon_deg, alt), (item,))
    return replace(setup, mission=mission)


@pytest.mark.parametrize(("alt", "open_"), [(100.9, False), (101.1, True), (436.0, True), (50.0, False)])
def test_a_route_below_home_is_open_where_no_terrain_is_given(alt: float, open_: bool) -> None:
    """Waypoints at 100 m AMSL; a metre is what ground stations round by."""
    made = make_setup(over(100.0))
    blind = at_home(replace(made, scenario=replace(made.scenario, terrain=None)), alt)
    for verdict in (judge_geometry(blind), judge(blind, fly_path(blind))):
        assert verdict.undecided is open_
        assert (f"{alt - 100.0:.0f} m below home" in verdict.headline) is open_
    # Over terrain its heights above ground are judged.
    assert judge_geometry(at_home(made, min(alt, 40.0))).flyable


@pytest.mark.parametrize(
    ("alt", "up", "open_"), [(49.9, 75.0, False), (50.1, 75.0, True), (50.1, 85.0, False), (-60.0, 75.0, False)]
)
@pytest.mark.parametrize("frame", [0, 3])
def test_heights_over_a_home_above_the_ground_are_open_where_they_are_too_low_from_the_ground(
    alt: float, up: float, open_: bool, frame: int
) -> None:
    """The ground is at 0 m AMSL, and 30 m above it are required; only frame 3 counts from home."""
    setup = at_home(make_setup(over(up), limits={"min_clearance_m": 30.0}), alt, frame)
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert verdict.undecided is (open_ and frame == 3)
        assert not verdict.failed
        # An altitude that leaves the verdict undecided is said once.
        is_noted = frame == 3 and not open_
        note = f"; home is {abs(alt):.0f} m below the ground there, which shifts all heights above home"
        if alt > 0.0:
            low = f"with home on the ground the lowest clearance is {up - alt:.1f} m"
            note = f"; home is {alt:.0f} m above the ground there; {low}"
        assert verdict.headline.endswith(note) is is_noted
        assert ("the ground there" in verdict.headline) is (frame == 3)
        # From the ground, 75 m are lower by 50.1 m: 5.1 m are missing, and 1 m more is suggested.
        texts = [finding.suggestion for finding in verdict.findings if finding.suggestions]
        home = f"set home to 0.0 m AMSL, the ground there, instead of {alt:.1f} m"
        assert all(text.startswith(f"{home} and raise both ends of leg 0 (") and " by 6 m" in text for text in texts)
        assert len(texts) == (open_ and frame == 3)
