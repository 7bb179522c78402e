"""The verdict about a moved item is the whole one's there, and beyond it nothing has changed."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from flight.mission import edits
from flight.mission.items import Command, Mission, MissionItem
from flight.mission.route import ROUTE_POINT, Route
from logs.verdict.findings import Finding
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.rules.registry import run_rules
from planfly.studio.edit_context import EditContext
from planfly.studio.incremental_verdict import judge_windows
from planfly.studio.moved_route import update_moved_route
from planfly.studio.session import Session
from planfly.studio.settings import ChangedParameters
from planfly.studio.states import violated_legs
from tests.logs.verdict.returns.hill import DEGREE, HEAD, hill_setup
from tests.planfly.studio.drafts import drawn_session
from tests.soak import note, scaled
from world.airspace.zones import Cylinder, Zone
from world.errors import MissionError
from world.kernels import field_names

MISSIONS, MOVED, ZONES = scaled(1000, 5), scaled(300, 6), scaled(400, 150)
# A window's path is rounded from its own beginning, and heights over ground differ by what that is worth, m.
ROUNDED = 0.02
Judged = dict[tuple[str, str, int], list[Any]]


def place_findings(requirements: RouteRequirements) -> tuple[Finding, ...]:
    return run_rules(requirements, None, geometric=True, includes_whole_flight=False)


def by_place(findings: Sequence[Finding], shift: int = 0) -> Judged:
    found: Judged = {}
    for item in findings:
        if item.place.kind in ("leg", "waypoint") and item.place.index is not None:
            key = (item.rule, item.place.kind, item.place.index + shift)
            found.setdefault(key, []).append((item.ok, item.margin))
    return found


def same(found: list[Any], wanted: list[Any]) -> bool:
    if [ok for ok, _ in found] != [ok for ok, _ in wanted]:
        return False
    pairs = [(a, b) for (_, a), (_, b) in zip(found, wanted, strict=True)]
    return all(a == b or (None not in (a, b) and abs(a - b) < ROUNDED) for a, b in pairs)


def changed(session: Session, k: int, how: str, rng: np.random.Generator) -> tuple[Mission, int]:
    """The mission with a place moved, raised, inserted or deleted, and the place about which it has changed."""
    east, north, _ = session.item_position(k)
    lat, lon = session.context.to_geographic(*(np.array([east, north]) + rng.normal(0.0, 150.0, 2)).tolist())
    match how:
        case "up":
            return edits.raise_items(session.mission, [k], float(rng.normal(0.0, 60.0))), k
        case "insert":
            return edits.insert_waypoint(session.mission, k, lat, lon), edits.insertion_index(session.mission, k)
        case "delete":
            mission = edits.delete_item(session.mission, k)
            return mission, min(edits.movable_indices(mission), key=lambda one: abs(one - k))
        case _:
            return edits.move_item(session.mission, k, lat, lon), k


def test_windows_say_what_the_whole_says() -> None:
    windowed = compared = 0
    for seed in range(MISSIONS):
        session = drawn_session(seed, 10 + 7 * seed % 60)
        rng = np.random.default_rng(10_000 + seed)
        how = ("move", "up", "insert", "move", "delete")[seed % 5]
        try:
            mission, k = changed(session, int(rng.choice(edits.movable_indices(session.mission))), how, rng)
            found = judge_windows(session.context, mission, k, session.judged.setup)
            whole = by_place(place_findings(route_requirements(session.context.setup(mission))))
        except MissionError:
            continue
        route, windows = found
        windowed += windows[0].last - windows[0].first < route.legs
        inside: Judged = {}
        for window in windows:
            inside |= by_place(window.findings, window.start)
        covered = {
            key: rows
            for key, rows in whole.items()
            if any(one.first <= key[2] < one.last + (key[1] == "waypoint") for one in windows)
        }
        assert set(inside) == set(covered), f"seed {seed}"
        assert all(same(inside[key], covered[key]) for key in covered), f"seed {seed}"
        compared += len(covered)
        if route.legs == session.judged.setup.route.legs:
            before = by_place(place_findings(route_requirements(session.judged.setup)))
            beyond = {key: rows for key, rows in whole.items() if key not in covered}
            assert all(same(before.get(key, []), rows) for key, rows in beyond.items()), f"seed {seed}"
    assert windowed >= MISSIONS // 2
    assert compared > 20 * MISSIONS
    note("studio: windows against the whole", missions=MISSIONS, windowed=windowed, compared=compared, differing=0)


def fenced(
    requirements: RouteRequirements, findings: Sequence[Finding], begin: int
) -> tuple[dict[int, set[int]], set[int]]:
    """The zones that are violated on each leg, and those that are more than once."""
    legs, again = dict[int, set[int]](), set[int]()
    for item in findings:
        if item.rule == "fence" and item.ok is False and item.place.index is not None:
            again |= {item.place.index} if " times" in item.reason else set()
            for leg in violated_legs(requirements, item):
                legs.setdefault(leg + begin, set()).add(item.place.index)
    return legs, again


def test_windows_violate_the_zones_that_the_whole_does() -> None:
    rng, found = np.random.default_rng(4), 0
    session = drawn_session(11, 30, jumps=False)
    (west, east), (south, north) = session.context.scenario.bounds.tolist()
    places = np.column_stack([rng.uniform(west, east, ZONES), rng.uniform(south, north, ZONES)]).tolist()
    zones = [Zone(str(k), "exclusion", Cylinder(x, y, 120.0)) for k, (x, y) in enumerate(places)]
    zones.append(Zone("stay", "inclusion", Cylinder(0.0, 0.0, 0.7 * east)))
    context = replace(session.context, scenario=replace(session.context.scenario, zones=tuple(zones)))
    for k in edits.movable_indices(session.mission)[::8]:
        x, y = places[min(range(ZONES), key=lambda one: math.dist(places[one], session.item_position(k)[:2]))]
        mission = edits.move_item(session.mission, k, *context.to_geographic(x, y))
        _, windows = judge_windows(context, mission, k)
        whole = route_requirements(context.setup(mission))
        legs, again = fenced(whole, place_findings(whole), 0)
        for one in windows:
            seen, _ = fenced(one.requirements, one.findings, one.start)
            for leg in range(one.first, one.last):
                # A zone that is entered twice is violated from the first time to the last for the whole.
                assert seen.get(leg, set()) - again == legs.get(leg, set()) - again
                found += len(seen.get(leg, ()))
    assert found >= 5


def test_a_dragged_mission_is_flown_with_the_parameters_of_its_landing(tmp_path: Path) -> None:
    """After an RTL it goes on to its landing sequence, with the RTL_AUTOLAND 1 that is assumed; by default it stays."""
    setup = hill_setup(tmp_path, mission=HEAD + mission_rows())
    context = EditContext.from_setup(setup).with_settings(setup.scenario, ChangedParameters())
    mission = edits.raise_items(context.opened_setup.mission, [0], 50.0)
    released = context.setup(mission)
    route, (window, *_) = judge_windows(context, mission, 0, context.opened_setup)
    assert released.route.positions[:, 0].max() > 5900.0
    assert np.array_equal(route.positions, released.route.positions)
    assert window.requirements.setup.autopilot == released.autopilot


def mission_rows() -> str:
    """Waypoints 1 and 2 km east of home, an RTL, and a landing sequence that begins 6 km east."""
    places = ((16, 1000.0, 600.0), (16, 2000.0, 600.0), (20, None, 0.0), (189, None, 0.0))
    landing = ((16, 6000.0, 100.0), (21, 7000.0, 1.0))
    rows = ""
    for number, (command, east, amsl) in enumerate((*places, *landing), 1):
        lat, lon = (0.0, 0.0) if east is None else (46.0, 8.0 + east / DEGREE)
        rows += f"{number}\t0\t0\t{command}\t0\t0\t0\t0\t{lat:.7f}\t{lon:.7f}\t{amsl:g}\t1\n"
    return rows


def test_a_moved_route_is_the_one_that_is_laid() -> None:
    moved = 0
    for seed in range(MOVED):
        session = drawn_session(seed, 12, jumps=False)
        rng = np.random.default_rng(20_000 + seed)
        setup, context = session.judged.setup, session.context
        for how in ("move", "up", "move"):
            try:
                mission, _ = changed(session, int(rng.choice(edits.movable_indices(session.mission))), how, rng)
                laid = context.route(mission)
            except MissionError:
                continue
            made = update_moved_route(setup.route, setup.mission, mission, context.scenario, context.uav)
            if made is None:
                continue
            moved += 1
            for name in field_names(ROUTE_POINT):
                ours, theirs = made.points[name], laid.points[name]
                assert np.allclose(ours, theirs, rtol=0.0, atol=1e-6, equal_nan=True), f"seed {seed} {name}"
    assert moved >= MOVED


def test_what_a_move_may_change_elsewhere_has_the_route_laid_anew() -> None:
    session = drawn_session(11, 12, jumps=False)
    context, mission, setup = session.context, session.mission, session.judged.setup
    own = edits.movable_indices(mission)
    circles = {k for k in own if mission.items[k].command != Command.NAV_WAYPOINT}
    beside = next(a for a, b in pairwise(own) if a not in circles and b in circles)
    free = next(b for a, b, c in zip(own, own[1:], own[2:], strict=False) if not circles & {a, b, c})

    def made(k: int, place: MissionItem, north: float = 0.0) -> Route | None:
        after = edits.move_item(mission, k, place.lat_deg + north, place.lon_deg)
        return update_moved_route(setup.route, mission, after, context.scenario, context.uav)

    assert made(free, mission.items[free], 0.001) is not None
    assert made(beside, mission.items[beside], 0.001) is None
    assert made(min(circles), mission.items[min(circles)], 0.001) is None
    # At the place of the one before, with which it is merged.
    assert made(free, mission.items[own[own.index(free) - 1]]) is None


def test_a_move_is_seen_where_it_matters() -> None:
    session = drawn_session(11, 60)
    k = edits.movable_indices(session.mission)[40]
    east, north, _ = session.item_position(k)
    mission = edits.move_item(session.mission, k, *session.context.to_geographic(east + 400.0, north))
    found = judge_windows(session.context, mission, k)
    assert found[1][0].last - found[1][0].first < found[0].legs
    before = by_place(session.judged.verdict.findings)
    changed = [
        key
        for window in found[1]
        for key, rows in by_place(window.findings, window.start).items()
        if not same(rows, before.get(key, []))
    ]
    assert len(changed) >= 3
