"""Words of places and changes, as terminal, report and verdict.json have them."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.document import finding_document
from logs.verdict.findings import Finding, make_finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT, MISSION, PLAN, Change, Place
from logs.verdict.presentation import FindingRow, number_texts
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.verdict import Verdict
from logs.verdict.wording import change_text, place_text, shorten_statement, suggestion_text, suggestions_text
from planfly.terminal.verdict_lines import verdict_lines
from tests.logs.verdict.judging import leg, missile, of, suggested, waypoint
from tests.synthetic import envelope, make_setup

# Of the waypoint of a flight with 5.3 m of navigation error: passed at 4.42 m, where the mission allows 2.99 m.
PASSED = make_finding(
    "waypoint",
    waypoint(1),
    ok=True,
    reason="",
    flown=4.42,
    limit=2.99,
    tolerance=5.3,
    margin=-1.43,
    unit="m",
    source="mission",
)
STALL = make_finding(
    "stall", FLIGHT, ok=True, reason="", flown=14.2, limit=10.0, tolerance=0.5, margin=4.2, unit="m/s", at_least=True
)
# A descent of 7.04 degrees, where 7 and a tolerance of 0.02 are allowed.
DESCENT = make_finding(
    "slope",
    leg(1),
    ok=False,
    reason="",
    planned=-7.04,
    limit=-7.0,
    tolerance=0.02,
    margin=-0.04,
    unit="deg",
    at_least=True,
)


@pytest.mark.parametrize(
    ("finding", "texts"),
    [(PASSED, ("4.42 m", "≤ 2.99 m")), (STALL, ("14.2 m/s", "≥ 9.5 m/s")), (DESCENT, ("-7.04°", "≥ -7.02°"))],
)
def test_a_limit_is_stated_with_its_side_and_its_tolerance(finding: Finding, texts: tuple[str, str]) -> None:
    assert finding.compared_texts() == texts
    verdict = Verdict((finding,), flyable=False, complete=True, lines=("",), level="flown")
    shown = texts[1].replace("-", "\N{MINUS SIGN}").replace(" ", "\u00a0", 1)
    assert finding_document(finding).passes == ("≤ 8.29 m" if finding is PASSED else texts[1])
    assert number_texts(finding).limit.split()[0] == shown.split("\u00a0")[0]
    assert f"{texts[0]} (limit {texts[1]}" in "\n".join(verdict_lines(verdict, ()))


def test_limit_of_a_value_within_its_tolerance_is_shown_without_it() -> None:
    """A descent of 5.38° at a limit of 5.09° and a tolerance of 0.5°: everywhere the limit is 5.09°."""
    place = Place("leg", 1)
    finding = make_finding(
        "slope",
        place,
        ok=True,
        reason="",
        planned=-5.38,
        limit=-5.09,
        tolerance=0.5,
        margin=-0.29,
        unit="deg",
        at_least=True,
    )
    note = "within the tolerance of 0.5°"
    verdict = Verdict((finding,), flyable=True, complete=True, lines=("",), level="flown")
    assert f"-5.38° (limit ≥ -5.09°; {note})" in "\n".join(verdict_lines(verdict, ()))
    # The values that pass include the tolerance.
    document = finding_document(finding)
    assert (document.limit, document.passes) == (-5.09, "≥ -5.59°")
    row = number_texts(finding)
    assert (row.limit, row.margin) == ("≥\u00a0\N{MINUS SIGN}5.09", "\N{MINUS SIGN}0.29")
    state = FindingRow(finding).place_state
    assert state is not None
    assert state.text == "slope -5.38° (≥ -5.09°, less a tolerance of 0.5°)"


@pytest.mark.parametrize("beyond", [0.04, 0.004, 0.0004, 0.00004])
@pytest.mark.parametrize("planned", [-7.0, -0.5, 34.0, 1234.0])
def test_a_failing_number_never_looks_like_its_limit(planned: float, beyond: float) -> None:
    """In headline, terminal, report and studio; a descent and a climb."""
    value = math.copysign(abs(planned) + beyond, planned)
    failed = make_finding(
        "slope",
        leg(1),
        ok=False,
        reason="",
        planned=value,
        limit=planned,
        margin=-beyond,
        unit="deg",
        at_least=planned < 0.0,
    )
    shown, passes = failed.compared_texts()
    assert shown != passes[2:]
    left, right = re.split(" [<>] ", RULE_WORDS["slope"].phrase("slope", failed).partition("(")[2].rstrip(")"))
    assert left != right
    row = number_texts(failed)
    assert row.planned != row.limit[2:]


LONGER = Change("length", leg(1), 150.0, 300.0, "m")


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (FLIGHT, "flight"),
        (MISSION, "mission"),
        (PLAN, "plan"),
        (leg(0), "leg 0"),
        (Place("leg", 0, to_item=0), "leg 0 (to item 0)"),
        (waypoint(0), "waypoint 0"),
        (Place("waypoint", 0, item=0), "waypoint 0 (item 0)"),
        (Place("mission", item=0), "item 0"),
        (Place("missile", 0, name="Alfa"), "Alfa (missile)"),
        (Place("radar", 2, name="threat 3"), "threat 3 (radar)"),
        (Place("radar", 2), "threat 3 (radar)"),
    ],
)
def test_places(place: Place, text: str) -> None:
    assert place_text(place) == text


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (LONGER, "lengthen leg 1 from 150 m to 300 m"),
        (Change("length", leg(1), 0.2, 300.0, "m"), "lengthen leg 1 to 300 m (it is vertical)"),
        (Change("rise", leg(2), 60.0, 44.0, "m"), "climb 44 m instead of 60 m on leg 2"),
        (Change("rise", leg(2), -60.0, -44.0, "m"), "descend 44 m instead of 60 m on leg 2"),
        (Change("rise", leg(2), None, -0.0, "m"), "descend 0 m on leg 2"),
        (Change("airspeed", waypoint(1), 25.0, 20.5, "m/s"), "fly through waypoint 1 at 20.5 m/s instead of 25 m/s"),
        (Change("airspeed", leg(3), 35.0, 18.1, "m/s", most=31.0), "command an airspeed of 18.1 to 31.0 m/s on leg 3"),
        (Change("turn", waypoint(1), 90.0, 61.2, "deg"), "turn at most 61.2° at waypoint 1"),
        (Change("height", leg(4), None, 12.0, "m"), "raise both ends of leg 4 by 12 m"),
        (Change("inset", FLIGHT, None, 7.0, "m"), "bring the path 7 m further inside the area"),
        (Change("distance", missile("Alfa"), None, 41.0, "m"), "pass 41 m further away from Alfa"),
        (Change("distance", Place("missile", 1), None, 41.0, "m"), "pass 41 m further away from threat 2"),
        (Change("duration", FLIGHT, None, 12.0, "%"), "shorten the flight by 12 %"),
        (Change("battery", FLIGHT, None, 1.13, "1"), "use a battery 1.13 times as large"),
        (Change("tank", FLIGHT, None, 2.0, "1"), "use a tank 2.00 times as large"),
    ],
)
def test_changes(change: Change, text: str) -> None:
    assert change_text(change) == suggestion_text((change,)) == suggestions_text(((change,),)) == text


def test_changes_together_and_alternatives() -> None:
    gentler = tuple(Change("rise", leg(k), None, -20.0, "m") for k in (1, 2))
    assert suggestion_text(gentler) == "descend 20 m on leg 1 and descend 20 m on leg 2"
    text = "lengthen leg 1 from 150 m to 300 m and leg 1 from 150 m to 300 m"
    assert suggestion_text((LONGER, LONGER)) == text
    assert suggestions_text((gentler, (LONGER, LONGER))) == f"{suggestion_text(gentler)}; or {text}"
    assert suggestions_text(()) == ""


def test_a_headline_ends_with_a_clause() -> None:
    assert shorten_statement("m" * 80) == "m" * 80
    first, second, third = ("m" * 60, "n" * 17, "o" * 17)
    # The last clause that ends within 80 characters, at each kind of end.
    for end in (". ", "; ", ": ", " because ", ", but ", ", which "):
        assert shorten_statement(f"{first} {second}{end}{third} {first}") == f"{first} {second}", end
    assert shorten_statement(f"{first}; {second}; {third}") == f"{first}; {second}"
    # A short introduction is no statement, and a bracket is not cut.
    assert shorten_statement(f"{'m' * 29}: {first}; {second}") == f"{'m' * 29}: {first}"
    assert shorten_statement(f"{'m' * 30}: {first}; {second}") == "m" * 30
    assert shorten_statement(f"{first} ({second}; {third}) {third}") == first
    # A list is not cut at its commas.
    assert shorten_statement(f"{first}, {second}, {third}") == f"{first}, {second}, {third}"


def test_a_headline_takes_eighty_characters_of_a_long_clause() -> None:
    assert shorten_statement("m" * 160) == "m" * 160
    assert shorten_statement("m" * 161) == "m" * 77 + "..."
    # At the end of a word, and not behind a number whose unit is cut off.
    word, rest = "m" * 70, "m" * 90
    assert shorten_statement(f"{word} whirls {rest}") == f"{word} whirls..."
    assert shorten_statement(f"{word} whirled {rest}") == f"{word}..."
    assert shorten_statement(f"{word}, 12.5 {rest}") == f"{word}..."


STEEP = [[0, 0, 300], [0, 2000, 300], [0, 3000, 600], [0, 6000, 600]]
SHORT = [[0, 0, 300], [0, 1000, 300], [150, 1000, 300], [150, 2000, 300]]
STRAIGHT = [[0, 0, 300], [0, 6000, 300]]
MISSILE = {"name": "Alfa", "east_m": 300.0, "north_m": 3000.0, "amsl_m": 300.0, "kill_radius_m": 500.0}


def powered(volts: float) -> FlightSetup:
    """A route that takes more energy than its aircraft carries."""
    watts = {
        f"power_{name}": np.full((5, 3), value) for name, value in (("idle", 0.0), ("level", 300.0), ("full", 9e2))
    }
    return replace(make_setup(STRAIGHT, table=replace(envelope(), volts=volts, **watts)), battery=10.0)


# A failing route, its rule and place; where the number stands in the text of what is suggested, and its decimals.
SUGGESTED = {
    "rise": (
        lambda: make_setup(STEEP),
        "slope",
        leg(1),
        r"climb ([\d.]+) m instead of 300 m on leg 1 \(to item 2\)",
        0,
    ),
    "fall": (
        lambda: make_setup(STEEP[::-1]),
        "slope",
        leg(1),
        r"descend ([\d.]+) m instead of 300 m on leg 1 \(to item 2\)",
        0,
    ),
    "length": (
        lambda: make_setup(STEEP),
        "slope",
        leg(1),
        r"lengthen leg 1 \(to item 2\) from 1000 m to ([\d.]+) m",
        0,
    ),
    "airspeed": (
        lambda: make_setup(SHORT),
        "turn",
        waypoint(1),
        r"fly through waypoint 1 \(item 1\) at ([\d.]+) m/s instead of 25 m/s",
        1,
    ),
    "range": (
        lambda: make_setup(STRAIGHT, airspeed=33.0),
        "speed",
        leg(0),
        r"command an airspeed of ([\d.]+) to [\d.]+ m/s on leg 0 \(to item 1\)$",
        1,
    ),
    "turn": (lambda: make_setup(SHORT), "turn", waypoint(1), r"turn at most ([\d.]+)° at waypoint 1", 1),
    "height": (
        lambda: make_setup([[0, 0, 20], [0, 6000, 20]]),
        "clearance",
        leg(0),
        r"raise both ends of leg 0 \(to item 1\) by ([\d.]+) m",
        0,
    ),
    "inset": (
        lambda: make_setup([[0, 0, 4900], [0, 3000, 5040], [0, 6000, 4900]]),
        "bounds",
        None,
        r"bring the path ([\d.]+) m further inside the area",
        0,
    ),
    "distance": (
        lambda: make_setup(STRAIGHT, threats=[MISSILE | {"kill_scale_m": 100.0}]),
        "threat",
        missile("Alfa"),
        r"pass ([\d.]+) m further away from Alfa",
        0,
    ),
    "duration": (lambda: powered(44.4), "energy", None, r"shorten the flight by ([\d.]+) %", 0),
    "battery": (lambda: powered(44.4), "energy", None, r"use a battery ([\d.]+) times as large", 2),
    "tank": (lambda: powered(0.0), "energy", None, r"use a tank ([\d.]+) times as large", 2),
}


@pytest.mark.parametrize("case", SUGGESTED)
def test_a_suggestions_text_has_the_number_of_its_data(case: str) -> None:
    make, rule, place, pattern, digits = SUGGESTED[case]
    item = of(judge_geometry(make()), rule, place)
    assert item.ok is False
    change = suggested(item, {"fall": "rise", "range": "airspeed"}.get(case, case))
    printed = re.search(pattern, suggestions_text(item.suggestions))
    assert printed is not None, suggestions_text(item.suggestions)
    assert float(printed[1]) == pytest.approx(abs(change.wanted), abs=0.5 * 10.0**-digits + 1e-9)
    if case in ("rise", "fall"):
        assert math.copysign(1.0, change.wanted) == (1.0 if case == "rise" else -1.0)
    if case == "range":
        assert f" to {change.most:.1f} m/s" in printed[0]
