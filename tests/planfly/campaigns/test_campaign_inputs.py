"""The inputs in which two campaigns differ, by name."""

from dataclasses import replace
from pathlib import Path

import pytest

from planfly.campaigns.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.campaign_inputs import describe_differences, difference_texts
from planfly.campaigns.dispersions import default_dispersions, parse_dispersions
from planfly.flight_options import MissionOptions
from tests.planfly.campaigns.made_campaigns import write_short


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({}, ""),
        ({"wind": (8.0, 250.0)}, "wind.speed_mps 8.0 instead of 5.0"),
        ({"seed": 2}, "seed 2 instead of 1"),
        ({"turbulence": "moderate"}, "wind.turbulence moderate instead of light"),
    ],
)
def test_an_option_that_differs_is_named_with_both_values(tmp_path: Path, changed: MissionOptions, text: str) -> None:
    mission, scenario = write_short(tmp_path)

    def base(options: MissionOptions) -> CampaignBase:
        given: MissionOptions = {"scenario": scenario, "seed": 1}
        return open_campaign(str(mission), default_dispersions(), {**given, **options})

    assert describe_differences(base({}).inputs(), base(changed).inputs()) == text


def test_a_long_input_is_named_alone(base: CampaignBase) -> None:
    spread = parse_dispersions('[mass]\ndistribution = "norm"\nloc = 1.0\nscale = 0.02\nsource = "x"', "x")
    fenced = replace(base.mission, fences=base.mission.items[:1])
    other = replace(base, dispersions=spread, mission=fenced)
    assert describe_differences(base.inputs(), other.inputs()) == "fences, spread"


def test_a_parameter_is_named_with_its_source(tmp_path: Path) -> None:
    mission, scenario = write_short(tmp_path)
    file = tmp_path / "mine.parm"
    file.write_text("WP_RADIUS 50\n", encoding="ascii")
    given: MissionOptions = {"scenario": scenario, "seed": 1, "autopilot": "ardupilot"}
    first, second = (
        open_campaign(str(mission), default_dispersions(), {**given, **more}).inputs()
        for more in (MissionOptions(), MissionOptions(params=str(file)))
    )
    text = describe_differences(first, second)
    assert f"flight.params {file} (not stated before)" in text
    assert "parameters.WP_RADIUS 50.0 (file) instead of 90.0 (default)" in text
    # Twice the acceptance radius.
    assert "limits in effect.corridor_m 100.0 instead of 180.0" in text


def test_a_corridor_that_the_scenario_states_is_no_limit_of_the_autopilot(base: CampaignBase) -> None:
    limits = base.scenario.limits.model_copy(update={"corridor_m": 60.0})
    stated = replace(base, scenario=replace(base.scenario, limits=limits))
    assert "limits in effect.corridor_m" in base.inputs()
    assert "limits in effect.corridor_m" not in stated.inputs()


def test_no_more_than_six_are_described() -> None:
    stored, current = ({f"x{k}": value for k in range(8)} for value in (1, 2))
    text = describe_differences(stored, current)
    assert text.startswith("x0 2 instead of 1, ")
    assert text.endswith(", x5 2 instead of 1, and 2 more")
    assert describe_differences({"a": 1}, {}) == "a not stated instead of 1"


def test_rounding_is_named_only_if_nothing_else_differs() -> None:
    stored, current = {"a": 250.0, "b": 1.0}, {"a": 250.00000000000003, "b": 2.0}
    assert describe_differences(stored, current) == "b 2.0 instead of 1.0"
    assert describe_differences(stored, current | {"b": 1.0}) == "a 250.00000000000003 instead of 250.0"


def test_the_parameters_of_another_autopilot_are_not_named_one_by_one() -> None:
    stored = {"autopilot": "PX4 1.17", "parameters.NAV_ACC_RAD": "10.0 (default)", "parameters.FW_R_LIM": "30.0"}
    current = {"autopilot": "ArduPlane 4.7", "parameters.WP_RADIUS": "90.0 (default)"}
    assert difference_texts(stored, current) == [
        "parameters: each autopilot has its own",
        "autopilot ArduPlane 4.7 instead of PX4 1.17",
    ]
    # Two versions of one autopilot have the same parameters.
    newer = stored | {"autopilot": "PX4 1.18", "parameters.FW_R_LIM": "35.0"}
    assert difference_texts(stored, newer) == [
        "autopilot PX4 1.18 instead of PX4 1.17",
        "parameters.FW_R_LIM 35.0 instead of 30.0",
    ]
