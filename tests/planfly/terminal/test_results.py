"""Targets on disk: what may be written over, and what is cleared."""

import json
from pathlib import Path

import pytest

from flight.mission_files.formats import read_mission
from logs.recording.reader import read_log
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import Change, Place
from planfly.cli import main
from planfly.terminal.results import (
    RUN_FILES,
    default_folder,
    named_or_default,
    prepare_folder,
    print_verdict,
    print_warnings,
    refuse_existing,
    refuse_folder,
    write_missions,
    write_verdict,
)
from tests.logs.made_flight import make_setup
from world.errors import PlanflyError


def test_a_named_file_is_refused_where_it_would_destroy(tmp_path: Path) -> None:
    there, link = tmp_path / "there.plan", tmp_path / "link.plan"
    there.write_text("mine", encoding="utf-8")
    link.symlink_to(there)
    refuse_existing(tmp_path / "new.plan", overwrite=False, source=there)
    refuse_existing(there, overwrite=True)
    for path, overwrite, source, message in (
        (there, False, None, "--overwrite replaces it"),
        (link, True, there, "is the input itself"),
        (tmp_path, True, None, "is a folder"),
        (tmp_path / "none" / "a.plan", True, None, "does not exist"),
    ):
        with pytest.raises(PlanflyError, match=message):
            refuse_existing(path, overwrite, source)
    assert there.read_text(encoding="utf-8") == "mine"


def test_a_named_folder_is_refused_unless_it_is_empty(tmp_path: Path) -> None:
    refuse_folder(tmp_path, overwrite=False)
    refuse_folder(tmp_path / "new", overwrite=False)
    file = tmp_path / "mine.txt"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(PlanflyError, match="not empty; --overwrite"):
        refuse_folder(tmp_path, overwrite=False)
    with pytest.raises(PlanflyError, match="a folder is expected"):
        refuse_folder(file, overwrite=True)
    refuse_folder(tmp_path, overwrite=True)


def test_a_run_clears_its_old_results_and_nothing_of_others(tmp_path: Path) -> None:
    old = tmp_path / "round-1"
    mixed = tmp_path / "round-2"
    for folder in (tmp_path, old, mixed):
        folder.mkdir(exist_ok=True)
        for name in RUN_FILES:
            (folder / name).write_text("old", encoding="utf-8")
    for kept in (tmp_path / "mine.txt", mixed / "mine.txt", tmp_path / "map.svg"):
        kept.write_text("mine", encoding="utf-8")
    (tmp_path / "rounds.json").write_text("old", encoding="utf-8")
    prepare_folder(tmp_path)
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*"))
    assert left == ["map.svg", "mine.txt", "round-2", "round-2/mine.txt"]


def test_a_folder_of_old_results_alone_stays_to_take_the_new_ones(tmp_path: Path) -> None:
    folder = tmp_path / "runs" / "a"
    prepare_folder(folder)
    (folder / "plan.json").write_text("old", encoding="utf-8")
    prepare_folder(folder)
    assert folder.is_dir()
    assert list(folder.iterdir()) == []


def test_another_command_leaves_a_runs_rounds_alone(tmp_path: Path) -> None:
    (tmp_path / "round-1").mkdir()
    for name in ("round-1/map.png", "map.png", "plan.json", "rounds.json"):
        (tmp_path / name).write_text("old", encoding="utf-8")
    prepare_folder(tmp_path, ("map.png", "report.html"))
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert left == ["plan.json", "round-1/map.png", "rounds.json"]


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("jacksboro", "runs/jacksboro-seed3"),
        ("../../etc/passwd", "runs/-..-etc-passwd-seed3"),
        ("a b/c", "runs/a-b-c-seed3"),
        ("...", "runs/run-seed3"),
    ],
)
def test_a_default_folder_stays_below_runs(name: str, folder: str) -> None:
    assert default_folder(name, 3) == Path(folder)


def test_a_default_is_replaced_and_a_named_target_is_not(tmp_path: Path) -> None:
    there, source = tmp_path / "there.json", tmp_path / "in.json"
    there.write_text("mine", encoding="utf-8")
    assert named_or_default(None, there, overwrite=False, source=source) == there
    assert named_or_default(str(there), source, overwrite=True, source=source) == there
    with pytest.raises(PlanflyError, match="exists"):
        named_or_default(str(there), source, overwrite=False, source=source)


# ----------------------------------------------------------------------
# A log that is cut short: every command that reads it says so, and ends with 3.


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
    assert "2 of 3 ok; closest to its limit at leg 1: slope 9° (limit 8°, aircraft)" in lines[3]
    assert lines[-1] == "  note    gusty"


@pytest.mark.parametrize(("flown", "limit"), [(25_634.2, 1_139_821.0), (9999.0, 10_000.4)])
def test_large_numbers_stand_without_a_power_of_ten(
    capsys: pytest.CaptureFixture[str], flown: float, limit: float
) -> None:
    lines = printed(capsys, Verdict((slope(0, flown, limit),), True, True, ("flyable",), "flown"))
    assert lines[1].endswith(f"leg 0: slope {round(flown)}° (limit {round(limit)}°, aircraft)")


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
