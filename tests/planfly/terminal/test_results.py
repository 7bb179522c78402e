"""What commands print of results, and errors in the words of the command line."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from logs.recording.reader import read_log
from logs.verdict.conditions import judging_conditions
from logs.verdict.findings import Finding, make_finding, message
from logs.verdict.places import FLIGHT, Change, Place
from logs.verdict.verdict import Verdict
from planfly.cli import build_parser, main
from planfly.terminal.command_parser import error_text
from planfly.terminal.output import print_warnings
from planfly.terminal.verdict_lines import verdict_lines
from planfly.workflow.pipeline import ReturnSummary
from tests.logs.made_flight import make_setup
from world.errors import LogError, PlanflyError

# ----------------------------------------------------------------------
# A log that is cut short: every command that reads it says so, and ends with 3.


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("command", ["check", "report", "replay", "recover"])
def test_an_unfinished_log_ends_with_3_and_its_end_time(
    broken: Path, tmp_path: Path, command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "cut.mcap"
    copy.write_bytes(broken.read_bytes())
    assert main([command, str(copy)]) == 3
    out = capfd.readouterr()
    assert f"{copy}: incomplete: " in out.err
    assert f"ends at {read_log(broken).end_time:.1f} s" in out.err
    assert not out.out.startswith("flyable")


# ----------------------------------------------------------------------
# What a command prints of a verdict: what fails first, then what is closest to each rule's limit.


def slope(leg: int, flown: float, limit: float) -> Finding:
    return Finding(
        "slope",
        Place("leg", leg),
        4.0,
        flown,
        limit,
        "aircraft",
        0.1,
        limit - flown,
        "deg",
        "fit",
        flown <= limit,
        f"leg {leg} climbs at {flown:g}°; the aircraft's limit is {limit:g}°",
        suggestions=((Change("length", Place("leg", leg), 300.0, 400.0, "m"),),),
    )


def test_a_value_beyond_its_limit_that_passes_is_within_its_tolerance(capsys: pytest.CaptureFixture[str]) -> None:
    """4.06° flown where 4° are the limit, with a tolerance of 0.1°: it passes, and says by what."""
    beyond = replace(slope(1, 4.06, 4.0), ok=True)
    lines = printed(capsys, Verdict((beyond,), flyable=True, complete=True, lines=("flyable",), level="flown"))
    assert "4.06° (limit ≤ 4°, set by the aircraft; within the tolerance of 0.1°)" in lines[-1]
    inside = Verdict((slope(1, 3.9, 4.0),), flyable=True, complete=True, lines=("flyable",), level="flown")
    assert "tolerance" not in printed(capsys, inside)[-1]


def printed(capsys: pytest.CaptureFixture[str], verdict: Verdict, *notes: str) -> list[str]:
    print(*verdict_lines(verdict, notes), sep="\n")
    return capsys.readouterr().out.splitlines()


def test_the_table_counts_the_zones(capsys: pytest.CaptureFixture[str]) -> None:
    """One finding stands for all zones that are kept to."""
    kept = make_finding("fence", FLIGHT, ok=True, reason="none of 14 zones is violated")
    made = Verdict(
        (kept,), True, True, ("flyable",), "flown", conditions=replace(judging_conditions(make_setup()), zones=14)
    )
    assert [line.split() for line in printed(capsys, made) if line.startswith("  zones")] == [
        ["zones", "14", "zones;", "1", "of", "1", "ok"]
    ]


def test_failures_stand_below_the_summary_with_what_would_pass(capsys: pytest.CaptureFixture[str]) -> None:
    findings = (slope(0, 5.0, 8.0), slope(1, 9.0, 8.0), slope(2, 7.5, 8.0))
    lines = printed(capsys, Verdict(findings, False, True, ("not flyable: slope",), "flown"), "gusty")
    assert lines[0] == "not flyable: slope"
    assert lines[1] == "  failed  slope at leg 1: leg 1 climbs at 9°; the aircraft's limit is 8°"
    assert lines[2].endswith("would pass: lengthen leg 1 from 300 m to 400 m")
    # Of 5 and 7.5 and 9 against 8 the last has the least margin.
    assert "2 of 3 ok; furthest beyond its limit at leg 1: slope 9° (limit ≤ 8.1°, set by the aircraft)" in lines[3]
    assert lines[-1] == "  note    gusty"


@pytest.mark.parametrize(("flown", "limit"), [(25_634.2, 1_139_821.0), (9999.0, 10_000.4)])
def test_large_numbers_stand_without_a_power_of_ten(
    capsys: pytest.CaptureFixture[str], flown: float, limit: float
) -> None:
    lines = printed(capsys, Verdict((slope(0, flown, limit),), True, True, ("flyable",), "flown"))
    assert lines[1].endswith(f"leg 0: slope {round(flown)}° (limit ≤ {round(limit)}°, set by the aircraft)")


def test_failures_of_one_rule_are_one_paragraph_the_worst_first(capsys: pytest.CaptureFixture[str]) -> None:
    findings = (*(slope(k, 9.0 + k, 8.0) for k in range(9)), slope(9, 4.0, 8.0))
    lines = printed(capsys, Verdict(findings, False, True, ("not flyable",), "flown"))
    assert lines[1] == (
        "  failed  slope: 9 of 10 places fail; the worst is at leg 8: leg 8 climbs at 17°; the aircraft's limit is 8°"
    )
    assert lines[2].endswith("would pass: lengthen leg 8 from 300 m to 400 m")
    # The suggestions of the five worst places, each with its place.
    assert [line.split("would pass: ")[1] for line in lines[3:8]] == [
        *(f"at leg {leg}: lengthen leg {leg} from 300 m to 400 m" for leg in (7, 6, 5, 4)),
        "and 4 more, in --json",
    ]
    assert lines[8] == (
        "          also at leg 7: 16°; leg 6: 15°; leg 5: 14°; leg 4: 13°; leg 3: 12°; leg 2: 11°; 2 more"
    )
    assert not any(line.startswith("  failed") for line in lines[2:])


def test_a_failure_by_other_evidence_than_its_number_states_its_reason_instead(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A level leg fails by the arc at its end: 0 degrees alone would be no reason."""
    arc = message("the arc at waypoint 1", " descends at 9.9°")
    level = make_finding(
        "slope",
        Place("leg", 0),
        ok=False,
        reason=arc.text,
        faults=[arc],
        planned=0.0,
        limit=5.0,
        margin=5.0,
        unit="deg",
    )
    lines = printed(capsys, Verdict((slope(2, 9.0, 8.0), level), False, True, ("not flyable",), "flown"))
    assert "          also at leg 0: the arc at waypoint 1" in lines


def test_warnings_do_not_mix_with_results(capsys: pytest.CaptureFixture[str]) -> None:
    print_warnings(["line 3: CRLF"])
    out = capsys.readouterr()
    assert (out.out, out.err) == ("", "warning: line 3: CRLF\n")


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (LogError.of_argument("start", 9.0, "the log ends at 4 s", file="a.mcap"), "a.mcap: --from 9.0: the log"),
        (
            LogError.of_argument("end", 9.0, "at or after `start`", file="a.mcap"),
            "a.mcap: --to 9.0: at or after --f",
        ),
        (
            PlanflyError("a.gif: exists; overwrite=True replaces it", file="a.gif"),
            "a.gif: exists; --overwrite replaces",
        ),
        # A source that is an argument.
        (PlanflyError.at("speed", "a", 1, "2 is expected"), "--speed: a: 1"),
        # A field of a file, and words, that only have the name of a keyword.
        (PlanflyError.at("a.toml", "speed", 1, "2 is expected"), "a.toml: speed: 1: 2"),
        (PlanflyError("a `word` of no option: speed=True, none=True"), "a `word` of no option: --speed, none=True"),
    ],
)
def test_keywords_are_options(error: PlanflyError, line: str) -> None:
    assert error_text(error, build_parser().commands["replay"]).startswith(line)


# ----------------------------------------------------------------------
# The line on returns.

ANSWER_LINES = {"flyable": ("flyable", "Start: in the air"), "not": ("not flyable: slope", "Start: in the air")}


@pytest.mark.parametrize(
    ("answer", "safe", "undecided", "row"),
    [
        ("flyable", False, False, 1),
        ("flyable", True, False, -1),
        ("flyable", False, True, -1),
        ("not", False, False, -1),
    ],
)
def test_unsafe_returns_of_a_flyable_mission_follow_its_first_line(
    answer: str, safe: bool, undecided: bool, row: int, capsys: pytest.CaptureFixture[str]
) -> None:
    returns: Any = SimpleNamespace(safe=safe, undecided=undecided, each=(None,))
    summary = ReturnSummary("all 3 returns violate a zone", returns=returns)
    verdict = Verdict((), flyable=answer == "flyable", complete=True, lines=ANSWER_LINES[answer], level="geometric")
    print(*verdict_lines(verdict, ["a note"], returns=summary), sep="\n")
    lines = capsys.readouterr().out.splitlines()
    (place,) = [number for number, line in enumerate(lines) if line.startswith("returns")]
    assert place == row % len(lines)
    required = "; the scenario requires no safe return" if row == 1 else ""
    hint = "planfly returns tries every second of the flight"
    assert lines[place] == f"returns   all 3 returns violate a zone{required}; {hint}"


def test_a_mission_without_a_home_has_no_line_on_returns(capsys: pytest.CaptureFixture[str]) -> None:
    verdict = Verdict((), flyable=True, complete=True, lines=("flyable",), level="geometric")
    print(*verdict_lines(verdict, [], returns=ReturnSummary()), sep="\n")
    assert "returns" not in capsys.readouterr().out


def test_a_suggestion_of_several_findings_is_stated_once(capsys: pytest.CaptureFixture[str]) -> None:
    suggestions = slope(8, 17.0, 8.0).suggestions
    findings = tuple(replace(slope(k, 9.0 + k, 8.0), suggestions=suggestions) for k in range(9))
    lines = printed(capsys, Verdict(findings, False, True, ("not flyable",), "flown"))
    assert [line for line in lines if "would pass" in line] == [lines[2]]
