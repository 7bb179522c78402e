"""What the planner calls safe is flyable, by the geometry of the plan and, in the soak, by its flight."""

import pytest

from benchmarks.plans_and_verdicts import answer
from tests.fresh_plans import fresh_scenario
from tests.soak import SOAK, scaled

# Plans that climbed more steeply than the aircraft can at the true airspeed of their height: X8 and Aerosonde.
AT_HEIGHT = (1025, 1104)
NUMBERS = range(2000, 2000 + scaled(100, 0)) if SOAK else AT_HEIGHT


@pytest.mark.parametrize("number", NUMBERS)
def test_a_safe_plan_is_flyable(number: int) -> None:
    found = answer(number, flown=SOAK)
    assert found.plan == "safe" or SOAK
    if found.plan != "safe":
        return
    assert found.drawn == "flyable", found.wrong
    # Aircraft of less than 4 kg may be thrown off their legs by moderate turbulence, which no plan makes room for.
    if SOAK and fresh_scenario(number).wind.turbulence != "moderate":
        assert found.flown == "flyable", found.wrong


def test_the_scenarios_differ_and_are_the_same_again() -> None:
    first, again, other = fresh_scenario(7), fresh_scenario(7), fresh_scenario(8)
    assert first.spec == again.spec
    assert first.spec != other.spec
    made = [fresh_scenario(number) for number in range(24)]
    assert len({(one.flight.aircraft, one.flight.autopilot) for one in made}) == 12
    heights = [float(one.start[2]) for one in made]
    assert min(heights) < 1000.0 < 3000.0 < max(heights)
