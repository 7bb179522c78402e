"""What a command prints of a verdict: what fails first, then the tightest of each rule."""

import json
from pathlib import Path

import pytest

from flight.mission_files.formats import read_mission
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import Change, Place
from planfly.terminal.results import print_verdict, print_warnings, write_missions, write_verdict
from tests.logs.made_flight import make_setup


def slope(leg: int, flown: float, limit: float) -> Finding:
    return Finding(
        "slope", Place("leg", leg), 4.0, flown, limit, "aircraft", 0.1, limit - flown, "deg", "fit", flown <= limit,
        f"leg {leg} is as it is", suggestions=((Change("length", Place("leg", leg), 300.0, 400.0, "m"),),),
    )  # fmt: skip


def printed(capsys: pytest.CaptureFixture[str], verdict: Verdict, *notes: str) -> list[str]:
    print_verdict(verdict, notes)
    return capsys.readouterr().out.splitlines()


def test_failures_stand_below_the_summary_with_what_would_pass(capsys: pytest.CaptureFixture[str]) -> None:
    findings = (slope(0, 5.0, 8.0), slope(1, 9.0, 8.0), slope(2, 7.5, 8.0))
    lines = printed(capsys, Verdict(findings, False, True, ("not flyable: slope",), "flown"), "gusty")
    assert lines[0] == "not flyable: slope"
    assert lines[1] == "  failed  slope at leg 1: leg 1 is as it is"
    assert lines[2].endswith("would pass: make leg 1 400 m long instead of 300 m")
    # Of 5 and 7.5 and 9 against 8 the last has the least margin.
    assert "2 of 3 ok; tightest at leg 1: 9 deg against 8 (aircraft)" in lines[3]
    assert lines[-1] == "  note    gusty"


@pytest.mark.parametrize(("flown", "limit"), [(25_634.2, 1_139_821.0), (9999.0, 10_000.4)])
def test_large_numbers_stand_without_a_power_of_ten(
    capsys: pytest.CaptureFixture[str], flown: float, limit: float
) -> None:
    lines = printed(capsys, Verdict((slope(0, flown, limit),), True, True, ("flyable",), "flown"))
    assert lines[1].endswith(f"leg 0: {round(flown)} deg against {round(limit)} (aircraft)")


def test_of_many_failures_twelve_are_listed_and_the_rest_counted(capsys: pytest.CaptureFixture[str]) -> None:
    findings = tuple(slope(k, 9.0, 8.0) for k in range(15))
    lines = printed(capsys, Verdict(findings, False, True, ("not flyable",), "flown"))
    assert sum(line.startswith("  failed  slope") for line in lines) == 12
    assert "  failed  and 3 more" in lines


def test_warnings_do_not_mix_with_results(capsys: pytest.CaptureFixture[str]) -> None:
    print_warnings(["line 3: CRLF"])
    out = capsys.readouterr()
    assert (out.out, out.err) == ("", "warning: line 3: CRLF\n")


def test_files_hold_the_mission_and_the_verdict(tmp_path: Path) -> None:
    mission = make_setup().mission
    targets = [tmp_path / "m.waypoints", tmp_path / "m.plan"]
    write_missions(mission, targets)
    for target in targets:
        read = read_mission(target)
        assert [item.command for item in read.items] == [16] * 4
        assert [item.lat_deg for item in read.items] == pytest.approx([46.0 + k / 300 for k in range(4)], abs=1e-7)
    write_verdict(tmp_path / "v.json", Verdict((slope(1, 9.0, 8.0),), False, True, ("not flyable",), "flown"))
    data = json.loads((tmp_path / "v.json").read_text(encoding="utf-8"))
    assert data["flyable"] is False
    assert [(item["rule"], item["flown"], item["limit"]) for item in data["findings"]] == [("slope", 9.0, 8.0)]
