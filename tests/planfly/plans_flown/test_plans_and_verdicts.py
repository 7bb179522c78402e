"""What the planner calls safe is flyable, by the geometry of the plan and, in the soak, by its flight."""

import pytest

from benchmarks.plans_and_verdicts import answer
from tests.fresh_plans import fresh_scenario
from tests.soak import SOAK, scaled

# Plans that climbed more steeply than the aircraft can at the true airspeed of their height: X8 and Aerosonde.
AT_HEIGHT = (1025, 1104)
# Flown by planfly's guidance in moderate turbulence: gusts faster than an X8 flies, a Zagi that falls into a missile's
# reach, and one in a downdraft of 3 m/s that climbs 1.3 m/s.
IN_GUSTS = (13161, 12118, 13066)
NUMBERS = range(2000, 2000 + scaled(100, 0)) if SOAK else AT_HEIGHT + IN_GUSTS


@pytest.mark.parametrize("number", NUMBERS)
def test_a_safe_plan_is_flyable(number: int) -> None:
    flown = SOAK or number in IN_GUSTS
    found = answer(number, flown=flown)
    assert found.plan == "safe" or SOAK
    if found.plan != "safe":
        return
    assert found.drawn == "flyable", found.wrong
    if flown:
        assert found.flown == "flyable", found.wrong


def test_the_scenarios_differ_and_are_the_same_again() -> None:
    first, again, other = fresh_scenario(7), fresh_scenario(7), fresh_scenario(8)
    assert first.spec == again.spec
    assert first.spec != other.spec
    made = [fresh_scenario(number) for number in range(24)]
    assert len({(one.flight.aircraft, one.flight.autopilot) for one in made}) == 12
    heights = [float(one.start[2]) for one in made]
    assert min(heights) < 1000.0 < 3000.0 < max(heights)
