"""The list of autopilots: every one can be told by its name, stored in a log and restored, and told from the others."""

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, get_args

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots import catalog
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.autopilot import Autopilot, AutopilotProgram, StoredAutopilot
from flight.autopilots.catalog import (
    AUTOPILOTS,
    Entry,
    autopilot_from_log,
    autopilot_names,
    find_program_class,
    load_autopilot,
    restore_autopilot,
    stored_name,
)
from flight.autopilots.parts import RtlSettings
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4 import parameters as px4_parameters
from flight.autopilots.px4.autopilot import Px4
from world.airfield import ReturnRequirements
from world.errors import ScenarioError
from world.scenario import Scenario, load_scenario, with_flight
from world.scenario_tables import ArduPlaneVersion, Px4Version

AEROSONDE = load_aircraft("aerosonde")
GIVEN = {f"P{k}": float(k) for k in range(40)}
PROGRAM = AutopilotProgram("ArduPlane V4.6.0 (7fbc1660)", "0826d539" + "e" * 56, GIVEN, {"P1": 1.0, "P2": 2.5})
MINE = ArduPilotParameters.from_text("WP_RADIUS 50\nFOO 1\n", "mine.parm")


@dataclass(frozen=True)
class Other(PlanflyGuidance):
    """Planfly's guidance by another name."""

    name: ClassVar = "other"


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalog, "AUTOPILOTS", (*AUTOPILOTS, Entry(Other.name, "other.Other")))
    monkeypatch.setitem(sys.modules, "flight.autopilots.other", sys.modules[__name__])


def tight(**flight: str) -> Scenario:
    return with_flight(load_scenario("tight"), **flight)


def arduplane(scenario: Scenario) -> ArduPlane:
    made = load_autopilot(scenario, AEROSONDE)
    assert isinstance(made, ArduPlane)
    return made


def test_a_scenario_names_its_autopilot() -> None:
    assert load_autopilot(tight(autopilot="ardupilot"), AEROSONDE).parameters is not None
    assert load_autopilot(tight(guidance="l1"), AEROSONDE) == PlanflyGuidance("l1")


def test_what_a_scenario_asks_of_its_returns_and_a_file_denies_is_refused(tmp_path: Path) -> None:
    """One of the two is wrong, and nobody but a person knows which."""
    file = tmp_path / "mine.parm"
    asking = replace(load_scenario("tight"), returns=ReturnRequirements((), 180.0, np.zeros((0, 3))))
    for stated, refused in (("RTL_ALTITUDE 180", False), ("RTL_ALTITUDE 181", True), ("ALT_HOLD_RTL 12000", True)):
        file.write_text(f"{stated}\n", encoding="utf-8")
        scenario = with_flight(asking, autopilot="ardupilot", params=str(file))
        if not refused:
            assert arduplane(scenario).parameters.by_origin("file") == {"RTL_ALTITUDE": 180.0}
            continue
        with pytest.raises(ScenarioError, match=r"tight: returns \(RTL_ALTITUDE\): 180: .*mine.parm sets RTL_ALT"):
            load_autopilot(scenario, AEROSONDE)


@pytest.mark.parametrize(("lower", "file", "most"), [(3.5, "", -1.0), (2.5, "", 10.0), (3.5, "TECS_LAND_PMAX 7", 7.0)])
def test_on_a_lower_field_the_nose_is_held_down_in_the_flare(lower: float, file: str, most: float) -> None:
    made = ArduPlane(ArduPilotParameters.from_text(f"RTL_AUTOLAND 2\n{file}\n", "mine.parm"))
    asked = made.with_parameters(**made.returns.make_parameters(RtlSettings(lands=True, field_depth=lower)))
    assert asked.parameters.landing_pitch_max == pytest.approx(math.radians(most))


def test_a_field_is_as_much_lower_as_the_ground_is_there() -> None:
    """jacksboro's field is higher than home; with the two exchanged it is lower, and the flare is held down."""
    scenario = load_scenario("jacksboro")
    assert scenario.landing is not None
    assert scenario.home is not None
    assert scenario.terrain is not None
    assert arduplane(scenario).parameters.landing_pitch_max == pytest.approx(math.radians(10.0))
    # The scenario states rtl_autoland.
    assert arduplane(scenario).parameters.by_origin("file") == {"RTL_AUTOLAND": 3.0}
    there = np.array([scenario.landing.east, scenario.landing.north])
    home = np.array([*there, float(scenario.terrain.height(*there))])
    strip = replace(scenario.landing, east=float(scenario.home[0]), north=float(scenario.home[1]))
    back = arduplane(replace(scenario, home=home, landing=strip))
    assert back.parameters.landing_pitch_max == pytest.approx(math.radians(-1.0))
    assert back.parameters.by_origin("assumed") == {"TECS_LAND_PMAX": -1.0}


def test_a_name_that_is_not_listed_is_one_line() -> None:
    with pytest.raises(ScenarioError) as refused:
        load_autopilot(tight(autopilot="ardupilott"), AEROSONDE)
    assert str(refused.value) == (
        "tight: flight.autopilot: 'ardupilott': expected 'ardupilot' or 'px4' or 'planfly': did you mean 'ardupilot'?"
    )
    assert (refused.value.field, refused.value.value) == ("flight.autopilot", "ardupilott")


@pytest.mark.usefixtures("listed")
def test_the_names_of_the_command_line_are_listed_with_their_releases() -> None:
    assert {entry.name: entry.releases for entry in AUTOPILOTS} == {
        "ardupilot": get_args(ArduPlaneVersion),
        "px4": get_args(Px4Version),
        "planfly": (),
    }
    assert "other" in autopilot_names()


@pytest.mark.usefixtures("listed")
def test_one_without_parameters_takes_no_file_of_them() -> None:
    assert load_autopilot(tight(autopilot="other"), AEROSONDE) == Other()
    with pytest.raises(ScenarioError, match=r"^tight: flight.params: x.parm: not allowed with autopilot = .other.,"):
        Autopilot.load.__func__(Other, tight(autopilot="other", params="x.parm").flight, AEROSONDE, "tight")


@pytest.mark.parametrize(
    ("autopilot", "name"),
    [
        (PlanflyGuidance("vector-field"), None),
        (ArduPlane(MINE), None),
        (ArduPlaneSitl(MINE, PROGRAM), None),
        (Other("l1"), "other"),
        (Px4(px4_parameters.Px4Parameters.from_text("NAV_ACC_RAD 50\nFOO 1\n", "mine.params", "1.16")), "px4"),
        (Px4(px4_parameters.Px4Parameters.defaults()), "px4"),
    ],
)
@pytest.mark.usefixtures("listed")
def test_each_is_stored_and_restored(autopilot: Autopilot, name: str | None) -> None:
    assert stored_name(autopilot) == name
    assert restore_autopilot(name, autopilot.store()) == autopilot


def test_a_name_of_another_version_is_not_restored() -> None:
    with pytest.raises(KeyError):
        restore_autopilot("other", StoredAutopilot())


def test_a_program_is_flown_in_the_place_of_its_law() -> None:
    kind = find_program_class(Path("arduplane"))
    flown = kind.with_model(ArduPlane(MINE), Path("arduplane"))
    assert flown == ArduPlaneSitl(MINE)
    assert flown.model == ArduPlane(MINE)
    assert kind.name == ArduPlane.name


def test_a_log_says_who_wrote_it() -> None:
    flown, notes = autopilot_from_log("ArduPlane V4.3.7", {"WP_RADIUS": 60.0}, "a.BIN") or (None, ())
    assert flown is not None
    assert (flown.turns.acceptance_radius, flown.version) == (60.0, "4.6")
    assert notes == ("flown by ArduPlane 4.3, but simulated with 4.6",)
    assert autopilot_from_log("PX4 v1.14.0", {"WP_RADIUS": 60.0}, "a.ulg") is None


def test_a_program_is_named_by_its_version_its_digest_and_what_was_changed() -> None:
    flown = ArduPlaneSitl(ArduPilotParameters.defaults(), PROGRAM)
    assert flown.describe("aerosonde") == (
        "ArduPlane V4.6.0 (7fbc1660) (sha256 0826d539...), 40 parameters set for aerosonde, changed: P1 1, P2 2.5"
    )
    assert replace(flown, program=replace(PROGRAM, changed={})).describe("a").endswith("changed: none")
    # No more than eight by name.
    assert replace(flown, program=replace(PROGRAM, changed=GIVEN)).describe("a").endswith("P6 6, P7 7 and 32 more")
