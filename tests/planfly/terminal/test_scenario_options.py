"""Options change what they name in a scenario, and nothing else."""

import argparse
import math
from pathlib import Path
from typing import Any

import pytest

from planfly.terminal.scenario_options import scenario_change
from tests.setups import small_scenario

NONE = {"aircraft": None, "airspeed": None}


def changed(**options: Any) -> Any:
    return scenario_change(argparse.Namespace(**(NONE | options)))(
        small_scenario(wind={"speed_mps": 3.0, "from_deg": 200.0, "turbulence": "light"})
    )


def test_without_options_the_scenario_stays() -> None:
    plain = changed()
    assert (plain.wind.speed, plain.wind.turbulence) == (3.0, "light")
    assert math.degrees(plain.wind.from_course) % 360.0 == pytest.approx(200.0)
    assert (plain.flight.aircraft, plain.flight.airspeed_mps) == ("aerosonde", None)


def test_each_option_changes_what_it_names() -> None:
    flown = changed(aircraft="c172x", airspeed=45.0, guidance="l1", nav="gnss")
    assert (flown.flight.aircraft, flown.flight.airspeed_mps) == ("c172x", 45.0)
    assert (flown.flight.guidance, flown.flight.nav) == ("l1", "gnss")
    assert flown.wind.speed == 3.0
    windy = changed(wind=(7.0, 90.0), turbulence="moderate")
    assert (windy.wind.speed, windy.wind.turbulence) == (7.0, "moderate")
    # Wind from the east blows to the west.
    assert windy.wind.at(100.0) == pytest.approx((-7.0, 0.0), abs=1e-12)
    gusty = changed(wind=None, turbulence="none")
    assert (gusty.wind.speed, gusty.wind.turbulence) == (3.0, "none")


def test_parameters_mean_arduplane_and_a_law_of_guidance_takes_its_place() -> None:
    flown = changed(params="mine.parm").flight
    assert flown.steering == ("ardupilot", "path", "gnss")
    assert flown.params == str(Path("mine.parm").resolve())
    again = scenario_change(argparse.Namespace(guidance="l1"))(changed(params="mine.parm")).flight
    assert (again.params, again.steering) == (None, ("ideal", "l1", "perfect"))
    assert changed(params="mine.parm", nav="rtk").flight.steering.nav == "rtk"
