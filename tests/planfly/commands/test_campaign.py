"""``planfly campaign``: from its first flight to its report, on, again, and one line for what cannot be."""

import json
import shutil
import threading
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

from planfly.api import campaigns
from planfly.campaigns.campaign_base import open_campaign
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.tables import is_same_flight
from planfly.cli import main
from tests.planfly.campaigns.made_campaigns import write_short
from tests.planfly.terminal.answers.checked_answers import answered, validate
from tests.soak import some

pytestmark = pytest.mark.filterwarnings("default")
TABLE = '[{}]\ndistribution = "{}"\nloc = {}\nscale = 0.01\nsource = "by hand"\n'


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path]:
    folder = tmp_path_factory.mktemp("campaign")
    mission, scenario = write_short(folder)
    line = ["campaign", str(mission), "--scenario", str(scenario), "--workers", "1", "--out", str(folder / "out")]
    assert main([*line, "--flights", "4", "--at-least", "0.9"]) == 3
    return line, folder / "out"


def test_it_leaves_its_files_and_says_undecided(flown: tuple[list[str], Path]) -> None:
    _, out = flown
    assert {path.name for path in out.iterdir()} == {"campaign.sqlite", "summary.json", "report.html", "worst"}
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["flights"], summary["answer"]) == (4, "undecided")
    validate("campaign", summary | {"exit_code": 3})
    assert len(list((out / "worst").iterdir())) == 3


def test_a_flight_is_flown_again_byte_for_byte(flown: tuple[list[str], Path]) -> None:
    line, out = flown
    log = next((out / "worst").iterdir())
    assert main([*line, "--refly", str(int(log.stem.removeprefix("flight-")))]) == 0
    assert (out / "flights" / log.name).read_bytes() == log.read_bytes()


def test_a_campaign_is_resumed_with_its_own_options(
    flown: tuple[list[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The wind of 5 m/s is the scenario's, which is named by an option."""
    line, first = flown
    out = tmp_path / "out"
    shutil.copytree(first, out)
    short = [*line[:2], "--workers", "1", "--out", str(out), "--resume"]
    assert main([*short, "--wind", "8,250"]) == 2
    assert "wind.speed_mps 8.0 instead of 5.0" in capsys.readouterr().err
    # The refused option is not stored.
    assert main(short) == 3
    assert "wind 5 m/s from" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--refly", "9"], "no such flight"),
        (["--refly", "2", "--json", "-"], "--json: cannot be combined with --refly"),
        (["--refly", "2", "--junit", "r.xml"], "--junit: cannot be combined with --refly"),
        ([], "--resume continues it"),
        (["--resume", "--seed", "2"], "contains a campaign with other settings: seed 2 instead of 1"),
        (
            ["--refly", "1", "--wind", "8,250"],
            "contains a campaign with other settings: wind.speed_mps 8.0 instead of 5.0",
        ),
        (["--resume", "--spread", "none.toml"], "cannot be read"),
        (["--overwrite", "--spread", "heavy.toml"], "aerosonde cannot fly level at 25 m/s"),
        (
            ["--overwrite", "--spread", "unknown.toml"],
            "mass.distribution: 'bell': expected a continuous distribution of scipy.stats",
        ),
        (
            ["--resume", "--scheduler", "tcp://10.0.0.1:8786", "--flights", "5"],
            "tcp:// is allowed only on this machine",
        ),
    ],
)
def test_one_line_and_nothing_lost(
    flown: tuple[list[str], Path],
    more: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    line, out = flown
    monkeypatch.chdir(out.parent)
    Path("heavy.toml").write_text(TABLE.format("mass", "norm", 1.9) + TABLE.format("drag", "norm", 2.85))
    Path("unknown.toml").write_text(TABLE.format("mass", "bell", 1.0))
    before = (out / "summary.json").read_bytes()
    assert main([*line, *more]) == 2
    told = [one for one in capsys.readouterr().err.splitlines() if one.startswith("planfly: ")]
    assert len(told) == 1
    assert words in told[0]
    assert (out / "summary.json").read_bytes() == before


def test_the_answer_and_the_cases_of_continuous_integration_have_the_exit_code(
    flown: tuple[list[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Five flyable flights show 0.05 ** (1 / 5) = 0.549 at 95 %: 0.5 is reached, 0.9 is undecided."""
    line, first = flown
    out = tmp_path / "out"
    shutil.copytree(first, out)
    for target, code, answer, result in (("0.5", 0, "reached", None), ("0.9", 3, "undecided", "failure")):
        # As an interrupted campaign leaves it, which --resume replaces without --overwrite.
        xml = tmp_path / f"{target}.xml"
        xml.write_text("interrupted", encoding="utf-8")
        goal = ["--resume", "--flights", "5", "--at-least", target, "--junit", str(xml)]
        document = answered(capsys, code, *line[:-1], str(out), *goal)
        assert (document["exit_code"], document["answer"]) == (code, answer)
        assert "exit_code" not in json.loads((out / "summary.json").read_text())
        ((case, output),) = ElementTree.parse(xml).getroot()
        assert (case.get("classname"), case.get("name")) == (f"planfly.{line[1].replace('.', '_')}", "verdict")
        assert [child.tag for child in case if child.tag != "system-out"] == ([result] if result else [])
        assert output.text is not None
        assert f"the probability of a flyable flight is at least {target}: 5 of 5" in output.text


@pytest.mark.parametrize(("flights", "said"), [(58, 1), (59, 0)])
def test_a_target_beyond_the_flights_is_said_before_they_are_flown(
    flights: int, said: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.95 ** 58 is 0.051, more than 1 - 0.95."""
    lines: list[str] = []
    monkeypatch.setattr(campaigns, "report_line", lines.append)
    campaigns._warn_of_too_few_flights(Goal(0.95, False, flights))
    warning = (
        "warning: 58 flights cannot show a probability of at least 0.95, even if all are flyable; that"
        " needs 59 flights without a failure"
    )
    assert lines == [warning] * said
    campaigns._warn_of_too_few_flights(Goal(None, False, 1))
    assert len(lines) == said


def test_nothing_to_resume(flown: tuple[list[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line, _ = flown
    assert main([*line[:-1], str(tmp_path / "none"), "--resume"]) == 2
    assert "there is no campaign" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("command", some([["campaign", "--flights", "2000"], ["winds", "--directions", "4"]], 2))
def test_a_folder_that_is_removed_ends_it_at_the_next_flight(
    tmp_path: Path, command: list[str], scheduler: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """With exit code 1 and a line that says so, long before its last flight."""
    mission, scenario = write_short(tmp_path)
    out = tmp_path / "out"
    table = out / f"{command[0]}.sqlite"

    def remove() -> None:
        end = time.monotonic() + 300.0
        # The log of what is written grows with the first flights.
        while time.monotonic() < end and not _grown(Path(f"{table}-wal")):
            time.sleep(0.02)
        shutil.rmtree(out)

    remover = threading.Thread(target=remove)
    remover.start()
    line = [*command[:1], str(mission), "--scenario", str(scenario), "--scheduler", scheduler, "--out", str(out)]
    assert main([*line, *command[1:]]) == 1
    remover.join()
    told = capsys.readouterr().err
    last = told.splitlines()[-1]
    assert last.startswith(f"planfly: {table}: was removed or replaced by another file")
    assert "Traceback" not in told
    assert not out.exists()


def _grown(log: Path) -> bool:
    return log.is_file() and log.stat().st_size > 30_000


def test_a_planned_scenario_goes_on_with_its_plan(tmp_path: Path, scheduler: str) -> None:
    _, scenario = write_short(tmp_path)
    out = tmp_path / "out"
    line = ["campaign", str(scenario), "--scheduler", scheduler, "--at-least", "0.5", "--out", str(out)]
    main([*line, "--flights", "1"])
    plan = (out / "plan.json").read_bytes()
    main([*line, "--flights", "2", "--resume"])
    assert (out / "plan.json").read_bytes() == plan
    base = open_campaign(str(scenario), default_dispersions(), {}, plan_file=out / "plan.json")
    with open_store(base, Goal(0.5, False, 2), out, resume=True) as store:
        assert [row.draw.index for row in store.rows()] == [0, 1]
        assert all(is_same_flight(row, fly_one(base, row.draw.index)) for row in store.rows())
