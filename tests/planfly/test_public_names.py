"""What `import planfly` shows: its verbs and their results, each once, typed, and nothing else; and it is quick."""

import json
import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import planfly
from tests.soak import SOAK

ROOT = Path(planfly.__file__).parents[1]
VERBS = {
    *(
        "plan",
        "plan_front",
        "replan",
        "what_blocks",
        "what_may_fail",
        "fly",
        "fly_by_each",
        "plan_then_fly",
        "run",
        "check",
        "judge",
        "read_log",
        "returns",
        "link",
        "survey",
        "figures",
        "report",
    ),
    *("compare", "export", "foxglove_layout", "replay", "timeline", "instruments", "movie", "play_to_foxglove"),
    *(
        "play_to_stations",
        "guess_columns",
        "import_log",
        "refly",
        "predict",
        "recover",
        "campaign",
        "campaign_flight",
        "winds",
        "battery",
        "window",
        "ground_risk",
        "compare_campaigns",
        "serve",
        "open_studio",
    ),
    *(
        "scenarios",
        "aircraft",
        "describe_aircraft",
        "new_aircraft",
        "new_scenario",
        "make_scenario",
        "terrain",
        "identify_aircraft",
        "paper_tables",
        "optimise",
        "progress",
    ),
}
RESULTS = {
    *("AircraftNumbers", "BestFound", "CampaignFlight", "CampaignResult", "Comparison", "ExportedFiles", "FlightLog"),
    *("ColumnGuesses", "Front", "FrontPlan", "IdentifiedAircraft"),
    *("FlownMission", "ImportedFlight", "Instruments", "Judged", "Optimiser", "PaperTables", "Plan", "PlanThenFly"),
    *(
        "Predicted",
        "Reflown",
        "LinkResult",
        "ReturnsResult",
        "Round",
        "RunResult",
        "Scenario",
        "SurveyResult",
        "TimelineEntry",
        "Track",
        "Verdict",
        "BatteryResult",
        "GroundRiskResult",
        "CampaignComparison",
        "WindowResult",
        "WindsResult",
        "WrittenReport",
    ),
}
ERRORS = {
    *("PlanflyError", "FlightError", "LogError", "MissionError", "ParameterError", "ScenarioError", "StartError"),
    *("TerrainError", "ForecastError", "SchedulerError", "SpreadError", "ArgumentError", "MissingExtraError"),
}


def output(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT).stdout


def test_it_shows_verbs_results_and_errors_and_nothing_else() -> None:
    assert set(dir(planfly)) == set(planfly.__all__) == VERBS | RESULTS | ERRORS | {"__version__"}
    # Whatever of it has been imported since.
    code = "import planfly, planfly.commands.check\nprint(dir(planfly) == sorted(planfly.__all__))"
    assert output(code) == "True\n"


@pytest.mark.parametrize("name", sorted(VERBS | RESULTS | ERRORS))
def test_each_name_is_that_of_what_it_names_and_says_what_it_is(name: str) -> None:
    thing = getattr(planfly, name)
    assert thing.__name__ == name
    assert (thing.__doc__ or "").strip()
    assert callable(thing)


def test_the_tree_of_errors_is_one() -> None:
    assert all(issubclass(getattr(planfly, name), planfly.PlanflyError) for name in ERRORS)


def test_help_names_every_verb_with_its_arguments() -> None:
    text = pydoc.render_doc(planfly, renderer=pydoc.plaintext)
    for verb in VERBS - {"aircraft"}:
        assert re.search(rf"^    {verb}\(", text, re.MULTILINE), verb
    functions = text.partition("\nFUNCTIONS\n")[2].partition("\nDATA\n")[0]
    assert set(re.findall(r"^    (\w+)\(", functions, re.MULTILINE)) == VERBS
    classes = text.partition("\nCLASSES\n")[2].partition("\nFUNCTIONS\n")[0]
    assert set(re.findall(r"^    class (\w+)\(", classes, re.MULTILINE)) <= RESULTS | ERRORS


def test_the_docstring_names_every_verb() -> None:
    assert planfly.__doc__ is not None
    assert {verb for verb in VERBS if re.search(rf"\b{verb}\b", planfly.__doc__)} == VERBS


def test_a_name_that_is_none_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'run_campaign'"):
        planfly.run_campaign  # noqa: B018


def test_importing_it_loads_nothing_but_itself() -> None:
    code = (
        "import json, sys\nbefore = set(sys.modules)\nimport planfly\n"
        "print(json.dumps(sorted({name.partition('.')[0] for name in set(sys.modules) - before})))"
    )
    loaded = set(json.loads(output(code)))
    assert loaded <= {"planfly", "importlib", "typing", "collections", "pathlib", "contextlib", "warnings"} | set(
        sys.stdlib_module_names
    )
    heavy = ("numpy", "numba", "pydantic", "matplotlib", "scipy", "pandas", "world")
    assert loaded.isdisjoint(heavy)


def test_importing_it_takes_no_more_than_30_milliseconds() -> None:
    code = "import time\nstarted = time.process_time()\nimport planfly\nprint(time.process_time() - started)"
    assert min(float(output(code)) for _ in range(3)) < 0.03


@pytest.mark.skipif("CI" not in os.environ, reason="half a minute of mypy: in CI")
@pytest.mark.skipif(not SOAK, reason="a checker that reads all of planfly anew: in make soak")
def test_types_are_seen_by_a_checker(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(
        "import planfly\n"
        "flown = planfly.fly(planfly.plan('jacksboro', seed=1), wind=(8, 270))\n"
        "reveal_type(flown.verdict.flyable)\n"
        "planfly.plan('jacksboro', sead=1)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--follow-imports=silent", "script.py"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT)},
    )
    assert 'Revealed type is "bool"' in done.stdout.replace("builtins.", "")
    assert 'Unexpected keyword argument "sead"' in done.stdout
