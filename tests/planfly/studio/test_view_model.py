"""Page data of a verdict and of the profile."""

from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.findings import make_finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from planfly.studio.view_model import verdict_page_data, world_json
from tests.planfly.studio.drafts import drawn_session
from world.airspace.zones import Cylinder, Zone, ZoneLevel


def test_a_flight_that_hits_the_ground_has_the_answer_of_its_headline() -> None:
    hit = make_finding("clearance", Place("leg", 2), ok=False, reason="touches the ground")
    words = "not flyable: clearance on leg 2"
    verdict = Verdict((hit,), flyable=False, complete=False, lines=(words,), level="flown")
    assert verdict_page_data(verdict)["answer"] == "not flyable"


def test_the_walls_of_a_zone_reach_from_its_floor_to_its_ceiling_or_above_the_route() -> None:
    """Without a floor they begin at the ground; without a ceiling they end 50 m above the highest waypoint."""
    session = drawn_session(3, 12, jumps=False)
    zones = (
        Zone("town", "exclusion", Cylinder(0.0, 0.0, 200.0)),
        Zone("cloud", "exclusion", Cylinder(0.0, 500.0, 100.0), ZoneLevel(9000.0, "amsl"), ZoneLevel(9500.0, "amsl")),
    )
    context = replace(session.context, scenario=replace(session.context.scenario, zones=zones))
    setup = context.setup(session.mission)
    town, cloud = world_json(context, setup)["zones"]
    ground = [
        context.scenario.terrain.height(np.array([east]), np.array([north]))[0]
        for (east, north, _), _ in town["walls"][0]
    ]
    assert [low for (_, _, low), _ in town["walls"][0]] == pytest.approx(ground, abs=0.1)
    highest = setup.route.positions[:, 2].max()
    assert [up for _, (_, _, up) in town["walls"][0]] == pytest.approx([highest + 50.0] * len(ground), abs=0.1)
    assert {(low, up) for (_, _, low), (_, _, up) in cloud["walls"][0]} == {(9000.0, 9500.0)}
