"""The summary's first line: the answer, the worst of each rule, and no more than four of them."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict.conditions import judging_conditions
from logs.verdict.findings import Finding, make_finding, message
from logs.verdict.places import FLIGHT, Change, LevelAnswer, Place
from logs.verdict.rules.registry import RULES
from logs.verdict.summary import headline, summary_lines, unjudged_parts
from logs.verdict.verdict import Verdict
from tests.logs.verdict.judging import leg, missile, waypoint
from tests.synthetic import make_setup
from world.airfield import ReturnRequirements


def failed(rule: str, place: Place, margin: float, **numbers: float) -> Finding:
    return make_finding(rule, place, ok=False, reason="why", margin=margin, unit="deg", **numbers)


def test_what_ends_a_flight_comes_before_what_a_plan_may_be_mended_by() -> None:
    found = [failed(rule, FLIGHT, -1.0) for rule in RULES]
    late = [one for one in found if one.rule in ("landing", "energy", "departure", "completion")]
    assert headline(late, False) == (
        "not flyable: loss of control (why), completion (why), landing (why), energy (why)"
    )
    assert headline(found, False).endswith(f" and {len(RULES) - 4} more")
    assert headline(found, False).startswith(
        "not flyable: launch (why), loss of control (why), completion (why), mission (why) and "
    )


def test_the_worst_of_each_rule_comes_before_the_second_worst_of_any() -> None:
    slopes = [failed("slope", leg(k), -float(k), planned=8.0 + k, limit=8.0) for k in range(1, 6)]
    turn = failed("turn", waypoint(2), -0.1, planned=50.1, limit=50.0)
    assert headline([*slopes, turn], False) == (
        "not flyable: slope on leg 3 (11° > 8°), slope on leg 4 (12° > 8°), slope on leg 5 (13° > 8°),"
        " turn at waypoint 2 (50.1° > 50°) and 2 more"
    )


def test_evidence_without_a_number_beyond_its_limit_is_named_in_brief() -> None:
    fault = message("overshoots its arc by 8 m", " (at most 5 m)")
    item = make_finding(
        "turn", waypoint(1), ok=False, reason=fault.text, faults=[fault], planned=30.0, limit=60.0, unit="deg"
    )
    assert headline([item], False) == "not flyable: turn at waypoint 1 (overshoots its arc by 8 m)"


def test_a_threat_is_named_once() -> None:
    places = (missile("Alfa"), Place("missile", 1), missile("threatening hill"))
    items = [make_finding("threat", place, ok=False, reason="", flown=3.0) for place in places]
    assert headline(items, False) == (
        "not flyable: missile Alfa (3.0 s inside its range), missile threat 2 (3.0 s inside its range),"
        " missile threatening hill (3.0 s inside its range)"
    )


def test_each_unjudged_leg_has_its_own_reason() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]])
    reasons = ("", "dips to 84 m below ground", "not flown", "not flown")
    found = [
        make_finding("clearance", leg(k), ok=None if reason else True, reason=reason)
        for k, reason in enumerate(reasons)
    ]
    assert dict(unjudged_parts(found, setup))["clearance"] == (
        "clearance on leg 1 (dips to 84 m below ground); on leg 2; leg 3 (not flown)"
    )


def test_terrain_that_was_not_judged_is_named_where_all_else_passes() -> None:
    known = make_finding("clearance", leg(0), ok=True, reason="")
    unknown = make_finding("clearance", leg(1), ok=None, reason="")
    assert headline([known], True) == "flyable"
    assert headline([known, unknown], True) == "flyable; terrain not judged on 1 leg"
    assert headline([unknown], True) == "flyable; terrain not judged"


def test_a_take_off_or_a_landing_that_was_not_judged_is_named_too() -> None:
    terrain = make_finding("clearance", leg(0), ok=None, reason="")
    ends = [make_finding(rule, waypoint(0), ok=None, reason="") for rule in ("takeoff", "landing")]
    assert headline([ends[0]], True) == "flyable; take-off not judged"
    assert headline([terrain, *ends], True) == "flyable; terrain not judged; take-off not judged; landing not judged"
    assert headline([make_finding("takeoff", waypoint(1), ok=True, reason="")], True) == "flyable"


def test_who_flew_is_said_with_the_parameters_that_decide_most() -> None:
    setup = replace(make_setup([[0, 0, 300], [0, 2000, 300]]), nav="gnss")
    levels = (LevelAnswer("autopilot", True, "flyable"),)

    def lines_by(parameters: ArduPilotParameters) -> tuple[str, ...]:
        by = replace(setup, autopilot=ArduPlane(parameters))
        return summary_lines([], by, "flown", levels, judging_conditions(by))

    lines = lines_by(ArduPilotParameters.defaults())
    assert (
        "Flown by: the simulated ArduPlane 4.7 with its default parameters (WP_RADIUS 90 m, NAVL1_PERIOD 17 s,"
        " TECS_HDEM_TCONST 3 s)"
    ) in lines
    assert not [line for line in lines if line.startswith("Parameters")]
    mine = ArduPilotParameters.from_text("WP_RADIUS 50\n" + "".join(f"FOO{k} 1\n" for k in range(6)), "mine.parm")
    lines = lines_by(mine)
    assert any("with the parameters of mine.parm (WP_RADIUS 50 m" in line for line in lines)
    known = len(mine.values) - 1
    assert (
        f"Parameters: 1 from the file, 0 from the aircraft, {known} from ArduPlane's defaults;"
        " not used: FOO0, FOO1, FOO2, FOO3 and 2 more"
    ) in lines
    landing = lines_by(ArduPilotParameters.from_text("WP_RADIUS 50", "mine.parm").changed("assumed", RTL_AUTOLAND=1.0))
    assert any(line.startswith("Parameters: 1 from the file, 1 assumed for the landing, 0 from") for line in landing)
    returns = ArduPilotParameters.from_text("RTL_AUTOLAND 1\nTERRAIN_FOLLOW 1\n", "mine.parm")
    lines = lines_by(returns)
    assert any(line.endswith("defaults; read but not simulated: TERRAIN_FOLLOW") for line in lines)


def test_a_name_one_letter_from_a_parameter_has_its_own_note() -> None:
    """Swapped, missing and wrong letters are misspelled; other batteries and gains and names beside theirs are not."""
    setup = make_setup(((0.0, 0.0, 100.0), (900.0, 0.0, 100.0)))

    def misspelled(text: str, is_flown: bool = True) -> list[str]:
        by = replace(setup, autopilot=ArduPlane(ArduPilotParameters.from_text(text, "mine.param")))
        level = "flown" if is_flown else "geometric"
        lines = summary_lines([], by, level, (LevelAnswer("autopilot", True, "flyable"),), judging_conditions(by))
        return [line for line in lines if line.startswith("Not a parameter")]

    for text, wrong, right in (
        ("WP_RADUIS 50", "WP_RADUIS", "WP_RADIUS"),
        ("NAVL1_PERID 17", "NAVL1_PERID", "NAVL1_PERIOD"),
        ("ROLL_LIMIT_DEX 40", "ROLL_LIMIT_DEX", "ROLL_LIMIT_DEG"),
    ):
        note = f"Not a parameter of the simulated ArduPlane: {wrong}: did you mean {right}?"
        assert misspelled(text) == misspelled(text, is_flown=False) == [note]
    assert misspelled("RLL_RATE_K 0.1") == []
    assert misspelled("BATT2_CAPACITY 5000\nFOO 1\nRELAY1_PIN 3") == []
    assert misspelled("WP_RADIUS 50\nWP_RADUIS 50") == []


def test_what_px4_has_no_parameter_for_is_not_used() -> None:
    setup = make_setup(((0.0, 0.0, 100.0), (900.0, 0.0, 100.0)))
    asked = replace(setup.scenario, returns=ReturnRequirements(("rtl",), None, np.zeros((0, 3)), 2))
    levels = (LevelAnswer("autopilot", True, "flyable"),)
    not_used = []
    for autopilot in (ArduPlane(ArduPilotParameters.defaults()), Px4(Px4Parameters.defaults())):
        by = replace(setup, scenario=asked, autopilot=autopilot)
        lines = summary_lines([], by, "flown", levels, judging_conditions(by))
        not_used += [line for line in lines if line.startswith("Not used")]
    assert not_used == ["Not used: rtl_autoland of [returns], for which PX4 has no parameter"]


# ----------------------------------------------------------------------
# A verdict on a terminal's one line, and as a notebook shows it.

TURN = Place("waypoint", 1)
FAILS = make_finding("turn", TURN, ok=False, reason="turns 90° <of 60°>", planned=90.0, limit=60.0)
PASSES = make_finding("turn", Place("waypoint", 2), ok=True, reason="turns 10°")
UNKNOWN = make_finding("clearance", Place("leg", 0), ok=None, reason="no terrain")
VERDICT = Verdict((FAILS, PASSES, UNKNOWN), flyable=False, complete=True, lines=("not flyable: turn",), level="flown")


def test_a_verdict_prints_in_a_line_whatever_it_holds() -> None:
    assert repr(VERDICT) == "<Verdict flown: not flyable; 3 findings, 1 failed>"
    many = Verdict((PASSES,) * 500, flyable=True, complete=True, lines=("flyable",), level="geometric")
    assert repr(many) == "<Verdict geometric: flyable; 500 findings, 0 failed>"
    cut = Verdict((PASSES,), flyable=False, complete=False, lines=(), level="flown")
    assert repr(cut) == "<Verdict flown: not flyable; 1 finding, 0 failed>"


def test_a_notebook_shows_each_rule_and_what_fails_of_it() -> None:
    page = ElementTree.fromstring(VERDICT._repr_html_())
    rows = [[cell.text or "" for cell in row] for row in page.find("table/tbody") or ()]
    assert rows == [
        ["turn", "✗ fails", "1 of 2 fail", "waypoint 1", "90.0", "–", "≤\u00a060.0", "–", "", "turns 90° <of 60°>", ""],
        ["clearance", "– not judged", "1 not judged", "no terrain", "–", "–", "–", "–", "", "", ""],
    ]
    assert page.findtext("strong") == "not flyable: turn"


def test_what_would_pass_stands_beside_what_fails() -> None:
    change = Change("turn", TURN, 90.0, 60.0, "deg")
    failing = make_finding("turn", TURN, ok=False, reason="too far")
    mended = replace(failing, suggestions=((change,),))
    text = Verdict((mended,), flyable=False, complete=True, lines=("no",), level="flown")._repr_html_()
    assert "turn at most 60.0° at waypoint" in text


def test_the_failed_findings_are_at_hand() -> None:
    assert VERDICT.failed == (FAILS,)
