"""What ends a mission of PX4, by the values in its parameter reference."""

import pytest

from flight.autopilots.px4.failsafes import failsafe_causes
from flight.autopilots.px4.parameters import Px4Parameters


@pytest.mark.parametrize(
    ("values", "name", "action", "parameter"),
    [
        ({}, "RC lost", "return", "NAV_RCL_ACT"),
        ({"NAV_RCL_ACT": 1.0}, "RC lost", "circle", "NAV_RCL_ACT"),
        ({"NAV_RCL_ACT": 3.0}, "RC lost", "land here", "NAV_RCL_ACT"),
        ({"NAV_RCL_ACT": 2.0, "COM_RCL_EXCEPT": 3.0}, "RC lost", "on", "COM_RCL_EXCEPT"),
        ({"COM_RCL_EXCEPT": 2.0}, "RC lost", "return", "NAV_RCL_ACT"),
        ({}, "station lost", "on", "NAV_DLL_ACT"),
        ({"NAV_DLL_ACT": 2.0}, "station lost", "return", "NAV_DLL_ACT"),
        ({"NAV_DLL_ACT": 5.0}, "station lost", "terminate", "NAV_DLL_ACT"),
        ({"NAV_DLL_ACT": 2.0, "COM_DLL_EXCEPT": 1.0}, "station lost", "on", "COM_DLL_EXCEPT"),
        ({}, "battery critical", "on", "COM_LOW_BAT_ACT"),
        ({"COM_LOW_BAT_ACT": 3.0}, "battery critical", "return", "COM_LOW_BAT_ACT"),
        ({"COM_LOW_BAT_ACT": 3.0}, "battery emergency", "land here", "COM_LOW_BAT_ACT"),
        ({}, "fence broken", "circle", "GF_ACTION"),
        ({"GF_ACTION": 3.0}, "fence broken", "return", "GF_ACTION"),
    ],
)
def test_it_reacts_by_its_parameters(values: dict[str, float], name: str, action: str, parameter: str) -> None:
    causes = failsafe_causes(Px4Parameters.defaults().changed(**values), has_fence=True)
    (cause,) = [one for one in causes if one.name == name]
    assert (cause.action, cause.parameter) == (action, parameter)


def test_a_fence_counts_only_if_the_mission_has_one() -> None:
    assert all(one.name != "fence broken" for one in failsafe_causes(Px4Parameters.defaults(), has_fence=False))
