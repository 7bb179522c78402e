"""Events that end a mission of PX4, by the values in its parameter reference."""

import math

import pytest

from flight.autopilots.px4.failsafes import failsafe_causes, link_loss_reactions
from flight.autopilots.px4.parameters import Px4Parameters
from world.scenario_tables import LinkUse


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
        ({"COM_RC_IN_MODE": 4.0}, "RC lost", "on", "COM_RC_IN_MODE"),
        ({"COM_RC_IN_MODE": 4.0, "NAV_DLL_ACT": 2.0}, "station lost", "return", "NAV_DLL_ACT"),
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


# ----------------------------------------------------------------------
# Lost radio links.


def reactions(use: LinkUse, **values: float) -> list[tuple[str, float, str, float]]:
    """Return what it does instead of its mission."""
    found = link_loss_reactions(Px4Parameters.defaults().changed(**values), use)
    return [] if found[0].action == "on" else [tuple(reaction) for reaction in found]


@pytest.mark.parametrize(
    ("value", "action"),
    [(0, ""), (1, "circle"), (2, "return"), (3, "land here"), (4, ""), (5, "terminate"), (6, "disarm")],
)
@pytest.mark.parametrize(
    ("use", "name", "delay"), [("telemetry", "NAV_DLL_ACT", 10.0), ("control", "NAV_RCL_ACT", 0.5)]
)
def test_the_action_is_the_parameters(use: LinkUse, name: str, delay: float, value: int, action: str) -> None:
    """Before a return or a landing it holds for COM_FAIL_ACT_T, 5 s by default; the others begin at once."""
    found = reactions(use, **{name: float(value)})
    if action in ("return", "land here"):
        assert found == [("circle", delay, "COM_FAIL_ACT_T", 5.0), (action, delay + 5.0, name, value)]
    else:
        assert found == ([(action, delay, name, value)] if action else [])


def test_its_defaults_ignore_the_station_and_return_without_the_remote_control() -> None:
    assert reactions("telemetry") == []
    assert [action for action, *_ in reactions("control")] == ["circle", "return"]


@pytest.mark.parametrize(("hold", "count"), [(0.0, 1), (0.1, 1), (0.2, 2)])
def test_without_a_time_to_act_it_does_not_hold(hold: float, count: int) -> None:
    found = reactions("telemetry", NAV_DLL_ACT=2.0, COM_DL_LOSS_T=30.0, COM_FAIL_ACT_T=hold)
    assert len(found) == count
    assert found[-1] == ("return", 30.0 + (hold if count == 2 else 0.0), "NAV_DLL_ACT", 2)


@pytest.mark.parametrize(("bits", "is_ignored"), [(0.0, False), (1.0, True), (2.0, False), (4.0, False), (7.0, True)])
def test_a_mission_may_be_an_exception(bits: float, is_ignored: bool) -> None:
    assert (reactions("telemetry", NAV_DLL_ACT=2.0, COM_DLL_EXCEPT=bits) == []) is is_ignored
    assert (reactions("control", COM_RCL_EXCEPT=bits) == []) is is_ignored


def test_without_a_remote_control_none_is_lost() -> None:
    assert reactions("control", COM_RC_IN_MODE=4.0) == []
    assert reactions("telemetry", COM_RC_IN_MODE=4.0, NAV_DLL_ACT=1.0) != []


def test_where_the_mission_continues_the_deciding_parameter_is_named() -> None:
    (found,) = link_loss_reactions(Px4Parameters.defaults(), "telemetry")
    assert tuple(found) == ("on", math.inf, "NAV_DLL_ACT", 0)
    changed = Px4Parameters.defaults().changed(NAV_DLL_ACT=2.0, COM_DLL_EXCEPT=3.0)
    assert link_loss_reactions(changed, "telemetry")[0][2:] == ("COM_DLL_EXCEPT", 3.0)
    # Without an action the exception does not matter.
    assert link_loss_reactions(changed.changed(NAV_DLL_ACT=0.0), "telemetry")[0].parameter == "NAV_DLL_ACT"
