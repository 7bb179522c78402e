"""Settings: limits and the autopilot's parameters are judged at once, refused in one line, and said to be lost."""

from pathlib import Path

import pytest

from flight.mission_files.formats import mission_text
from planfly.flight_options import MissionOptions
from planfly.studio.documents import open_document
from planfly.studio.messages import Settings
from planfly.studio.session import Session, open_session
from tests.own_aircraft import copy_aerosonde
from tests.planfly.studio.drafts import drawn_session
from world.errors import PlanflyError


def set_in(session: Session, **asked: object) -> None:
    session.change_settings(Settings.model_validate({"kind": "settings", **asked}))


@pytest.fixture(scope="module")
def kept() -> Session:
    """A session that stays as it is, for all that is refused."""
    return drawn_session(6, 14)


def test_settings_are_judged_at_once() -> None:
    session = drawn_session(6, 14)
    set_in(session, wind_speed=9.0, wind_from=270.0, limits={"min_clearance_m": 10.0, "max_height_m": 800.0})
    shown = session.settings_json()
    assert (shown["wind_speed"], shown["wind_from"], shown["limits"]["min_clearance_m"]) == (9.0, 270.0, 10.0)
    scenario = session.judged.setup.scenario
    assert (scenario.wind.speed, scenario.limits.max_height_m) == (9.0, 800.0)
    set_in(session, limits={"max_height_m": None}, ceiling=1300.0)
    assert session.judged.setup.scenario.limits.max_height_m is None
    assert session.settings_json()["ceiling"] == session.judged.setup.scenario.ceiling == 1300.0
    set_in(session, autopilot="px4", aircraft="aerosonde")
    assert session.settings_json()["autopilot"] == "px4"
    changed = "the settings changed in the studio: autopilot, wind, minimum clearance, ceiling"
    assert changed in session.save("waypoints").losses


def test_only_settings_that_differ_from_the_opening_are_lost(tmp_path: Path) -> None:
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(6, 14).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(terrain="jacksboro"))
    shown = session.settings_json()
    for change, name in (
        ({"limits": {"corridor_m": 90.0}}, "corridor each side"),
        ({"limits": {"min_clearance_m": 11.0}}, "minimum clearance"),
        ({"wind_speed": 4.0}, "wind"),
        ({"airspeed": 26.0}, "airspeed"),
        ({"turbulence": "light"}, "turbulence"),
    ):
        set_in(session, **change)
        assert session.save("waypoints").losses == (f"the settings changed in the studio: {name}",)
        # Changed back, nothing differs, although the scenario now states the value.
        values = change.get("limits", change)
        own = shown["limits"] if "limits" in change else shown
        back = {key: own[key] for key in values}
        set_in(session, **({"limits": back} if "limits" in change else back))
        assert session.save("waypoints").losses == ()


def test_parameters_are_flown_with_and_saved() -> None:
    session = drawn_session(6, 14)
    text = "# of a ground station\nLIM_ROLL_CD,2500\nWP_RADIUS 45\nSERIAL1_BAUD 57\n"
    set_in(session, parameter_file="mine.param", parameter_text=text)
    assert session.settings_json()["parameters"] == {"ROLL_LIMIT_DEG": 25.0, "WP_RADIUS": 45.0}
    # What they set is judged: turns are wider with less bank.
    assert session.judged.setup.limits.max_bank < 0.45
    assert "the parameters of mine.param" in session.judged.setup.autopilot.describe("aerosonde")
    shown = session.settings_json()
    assert (shown["parameter_file"], shown["unused"]) == ("mine.param", "SERIAL1_BAUD")
    set_in(session, parameter="WP_RADIUS=60")
    set_in(session, without=["ROLL_LIMIT_DEG"])
    assert session.settings_json()["parameters"] == {"WP_RADIUS": 60.0}
    assert session.save("parm").data.splitlines()[1:] == [b"WP_RADIUS 60"]
    assert any("1 parameter set in the studio" in line for line in session.save("plan").losses)
    # A change of the weather leaves them, and another autopilot has others.
    set_in(session, wind_speed=2.0)
    assert session.settings_json()["parameters"] == {"WP_RADIUS": 60.0}
    set_in(session, autopilot="px4")
    assert session.settings_json()["parameters"] == {}
    with pytest.raises(PlanflyError, match="no parameter was set in the studio"):
        session.save("parm")


def test_parameters_of_the_command_and_of_the_studio_are_told_apart(tmp_path: Path) -> None:
    file, kept, own = tmp_path / "m.waypoints", tmp_path / "m.json", tmp_path / "my.parm"
    file.write_text(mission_text(drawn_session(6, 8).mission, "waypoints"), encoding="utf-8")
    own.write_text("WP_RADIUS 60\nNAVL1_PERIOD 20\n", encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(terrain="jacksboro", params=own), kept)
    assert session.settings_json()["scenario_parameter_file"] == "my.parm"
    set_in(session, parameter="WP_RADIUS=90")
    described = session.judged.setup.autopilot.describe("aerosonde")
    assert "my.parm, changed in the studio: WP_RADIUS (WP_RADIUS 90 m" in described
    # The airspeeds of the aircraft (its TOML); the value is in no file.
    with pytest.raises(PlanflyError) as refused:
        set_in(session, parameter="AIRSPEED_CRUISE=40")
    assert str(refused.value) == "Parameter AIRSPEED_CRUISE: 40: allowed 18..31 m/s for aerosonde"
    with pytest.raises(PlanflyError) as refused:
        set_in(session, parameter="NO_SUCH=1")
    assert str(refused.value) == "Parameter NO_SUCH: not a parameter of the simulated ArduPlane"
    # Of a file that was opened on the page, too, and after a restart.
    set_in(session, parameter_file="mine.param", parameter_text="WP_RADIUS 45\nRTL_RADIUS 80\n")
    assert "changed in the studio" not in session.judged.setup.autopilot.describe("aerosonde")
    set_in(session, parameter="RTL_RADIUS=70")
    session.autosave(kept)
    again, _ = open_session(str(file), MissionOptions(terrain="jacksboro"), kept)
    for one in (session, again):
        assert "mine.param, changed in the studio: RTL_RADIUS (" in one.judged.setup.autopilot.describe("aerosonde")


def test_the_parameters_of_the_command_are_flown_again_after_another_autopilot(tmp_path: Path) -> None:
    file, own = tmp_path / "m.waypoints", tmp_path / "my.parm"
    file.write_text(mission_text(drawn_session(6, 8).mission, "waypoints"), encoding="utf-8")
    own.write_text("WP_RADIUS 60\nNAVL1_PERIOD 20\n", encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(terrain="jacksboro", params=own))
    set_in(session, autopilot="px4")
    assert session.settings_json()["scenario_parameter_file"] == ""
    set_in(session, autopilot="ardupilot")
    assert session.settings_json()["scenario_parameter_file"] == "my.parm"
    assert session.context.uav.autopilot.stated_value("WP_RADIUS") == 60.0


def test_an_aircraft_named_by_its_folder_can_be_chosen_again(tmp_path: Path) -> None:
    copy_aerosonde(tmp_path)
    file, kept = tmp_path / "m.waypoints", tmp_path / "m.json"
    file.write_text(mission_text(drawn_session(6, 14).mission, "waypoints"), encoding="utf-8")
    named = MissionOptions(scenario="jacksboro", aircraft=str(tmp_path / "own"))
    session, _ = open_session(str(file), named, kept)
    for _ in range(2):
        set_in(session, aircraft="aerosonde")
        assert session.world_message()["settings"]["aircraft_names"][:2] == ["own", "aerosonde"]
        set_in(session, aircraft="own")
        assert session.context.scenario.flight.aircraft == str(tmp_path / "own")
    # Also when it comes from the kept session, and in another document.
    session.autosave(kept)
    again, _ = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    again.open(open_document(str(file), again.options))
    assert again.settings_json()["aircraft"] == "own"
    set_in(again, aircraft="aerosonde")
    set_in(again, aircraft="own")
    assert again.settings_json()["aircraft"] == "own"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"limits": {"min_clearance_m": 6000.0}}, "Minimum clearance: 6000: allowed 0..5000"),
        ({"limits": {"max_height_m": 20.0}}, "Maximum above ground: 20: must be above Minimum clearance 60"),
        ({"limits": {"max_turn_deg": 400.0}}, 'Sharpest turn: 400: allowed above 0, up to 180, or "aircraft"'),
        ({"limits": {"corridor_m": -1.5}}, "Corridor each side: -1.5: allowed 1..5000"),
        ({"limits": {"max_climb_deg": 0.0}}, 'Steepest climb: 0: allowed above 0, below 90, or "aircraft"'),
        ({"limits": {"max_dive_deg": 99.0}}, 'Steepest descent: 99: allowed above 0, below 90, or "aircraft"'),
        ({"ceiling": -9999.0}, "Ceiling: -9999: allowed -500..9000"),
        # What a setting makes impossible elsewhere is said of the setting.
        ({"ceiling": 100.0}, "Ceiling: 100: start: 485 m AMSL: above the ceiling, 100 m AMSL"),
        ({"wind_speed": 500.0}, "Wind: 500: allowed 0..40"),
        ({"wind_from": -361.0}, "Wind from: -361: allowed -360..360"),
        # One range on both sides, the aircraft's (its TOML); the Zagi flies from 11 m/s, and a scenario takes 15 m/s.
        ({"airspeed": 2.0}, "Airspeed 2: allowed 18..31 m/s for aerosonde"),
        ({"airspeed": 60.5}, "Airspeed 60.5: allowed 18..31 m/s for aerosonde"),
        ({"airspeed": 10.0, "aircraft": "zagi"}, "Airspeed 10: allowed 11..16.9 m/s for zagi"),
        ({"airspeed": 60.0, "aircraft": "zagi"}, "Airspeed 60: allowed 11..16.9 m/s for zagi"),
        ({"aircraft": "zagi"}, "Airspeed: 25: allowed 11..16.9 m/s for zagi"),
        ({"aircraft": "../x8"}, "Aircraft: expected an aircraft listed by 'planfly aircraft'"),
        ({"parameter": "WP_RADIUS=99999"}, "Parameter WP_RADIUS: 99999: allowed 0..32767"),
        ({"parameter": "WP_RADIUS=wide"}, "Parameter WP_RADIUS: 'wide': expected a finite number"),
        ({"parameter": "WP_RADIU=50"}, "Parameter WP_RADIU: not a parameter of the simulated ArduPlane"),
        ({"parameter": "THR_MIN=100"}, "Parameter THR_MIN 100: must be below THR_MAX"),
        ({"parameter_file": "a.parm", "parameter_text": "\n"}, "a.parm: no parameter"),
    ],
)
def test_a_value_that_is_not_allowed_is_refused_in_one_line(kept: Session, asked: dict[str, object], said: str) -> None:
    session = kept
    before = session.rev, session.settings_json(), session.judged
    with pytest.raises(PlanflyError, match=said.replace("(", "[(]")) as refused:
        set_in(session, **asked)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(said)
    assert "/" not in str(refused.value).replace("m/s", "")
    assert (session.rev, session.settings_json(), session.judged) == before


def test_an_error_names_no_file_of_a_mission_without_a_scenario(tmp_path: Path) -> None:
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(6, 14).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(terrain="jacksboro"))
    with pytest.raises(PlanflyError) as refused:
        set_in(session, wind_speed=-1.0)
    assert str(refused.value) == "Wind: -1: allowed 0..40"


@pytest.mark.parametrize(("asked", "shown"), [(-90.0, 270.0), (360.0, 0.0), (-360.0, 0.0), (45.0, 45.0)])
def test_a_wind_comes_from_0_to_below_360_degrees(asked: float, shown: float) -> None:
    session = drawn_session(6, 14)
    set_in(session, wind_speed=4.0, wind_from=asked)
    assert session.settings_json()["wind_from"] == shown
    assert session.context.scenario.spec.wind.from_deg == pytest.approx(shown)


def test_planflys_own_guidance_has_no_parameters() -> None:
    session = drawn_session(6, 14)
    set_in(session, autopilot="planfly")
    assert session.settings_json()["known"] == {}
    with pytest.raises(PlanflyError, match="has no parameters"):
        set_in(session, parameter="WP_RADIUS=60")
