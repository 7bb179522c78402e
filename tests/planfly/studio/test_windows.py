"""The verdict about a moved item is the whole one's there, and beyond it nothing has changed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import geometric_findings
from logs.verdict.measures.route_requirements import route_requirements
from planfly.studio import edits
from planfly.studio.windows import judge_windows
from tests.planfly.studio.drafts import drawn_session
from tests.soak import note, scaled
from world.errors import MissionError

MISSIONS = scaled(1000, 5)
# A window's path is rounded from its own beginning, and heights over ground differ by what that is worth, m.
ROUNDED = 0.02
Judged = dict[tuple[str, str, int], list[Any]]


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


def test_windows_say_what_the_whole_says() -> None:
    windowed = compared = 0
    for seed in range(MISSIONS):
        session = drawn_session(seed, 10 + 7 * seed % 60)
        rng = np.random.default_rng(10_000 + seed)
        k = int(rng.choice(edits.places(session.mission)))
        east, north, _ = session.place_of(k)
        step = rng.normal(0.0, 150.0, 2)
        try:
            mission = edits.moved(session.mission, k, *session.desk.geographic(east + step[0], north + step[1]))
            found = judge_windows(session.desk, mission, k)
            whole = by_place(geometric_findings(route_requirements(session.desk.setup(mission))))
        except MissionError:
            continue
        route, windows = found
        windowed += windows[0].last - windows[0].first < route.legs
        inside: Judged = {}
        for window in windows:
            inside |= by_place(window.findings, window.begin)
        covered = {
            key: rows
            for key, rows in whole.items()
            if any(one.first <= key[2] < one.last + (key[1] == "waypoint") for one in windows)
        }
        assert set(inside) == set(covered), f"seed {seed}"
        assert all(same(inside[key], covered[key]) for key in covered), f"seed {seed}"
        compared += len(covered)
        if route.legs == session.judged.setup.route.legs:
            before = by_place(session.judged.verdict.findings)
            beyond = {key: rows for key, rows in whole.items() if key not in covered}
            assert all(same(before.get(key, []), rows) for key, rows in beyond.items()), f"seed {seed}"
    assert windowed >= MISSIONS // 2
    assert compared > 20 * MISSIONS
    note("studio: windows against the whole", missions=MISSIONS, windowed=windowed, compared=compared, differing=0)


def test_a_move_is_seen_where_it_matters() -> None:
    session = drawn_session(11, 60)
    k = edits.places(session.mission)[40]
    east, north, _ = session.place_of(k)
    mission = edits.moved(session.mission, k, *session.desk.geographic(east + 400.0, north))
    found = judge_windows(session.desk, mission, k)
    assert found[1][0].last - found[1][0].first < found[0].legs
    before = by_place(session.judged.verdict.findings)
    changed = [
        key
        for window in found[1]
        for key, rows in by_place(window.findings, window.begin).items()
        if not same(rows, before.get(key, []))
    ]
    assert len(changed) >= 3
