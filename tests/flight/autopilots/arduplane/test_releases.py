"""The simulated release of ArduPlane: the stated one, a parameter file's, a log's, or the newest."""

from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import TABLE, ArduPilotParameters
from flight.autopilots.arduplane.releases import choose_release, simulated_release
from flight.autopilots.arduplane.renamed_parameters import NAMES_BEFORE_4_7, RENAMED, name_in_release
from flight.autopilots.autopilot import ParameterValue, StoredAutopilot, StoredParameters
from flight.autopilots.catalog import autopilot_from_log
from flight.autopilots.parameter_files import LONGEST_NAME
from world.errors import ParameterError
from world.scenario import load_scenario, with_flight
from world.scenario_tables import ArduPlaneVersion, FlightTable


def notes_of(text: str, file: Path, version: str) -> tuple[str, ...]:
    """Return the note on a renamed parameter of a file, if it has one."""
    new_names = {"LIM_ROLL_CD": "ROLL_LIMIT_DEG"} | (
        {"GLIDE_SLOPE_MIN": "ALT_SLOPE_MIN", "GLIDE_SLOPE_THR": "ALT_SLOPE_MAXHGT"} if version == "4.7" else {}
    )
    return tuple(
        f"{file}: {old} is read as {new}, its name in ArduPlane {version}"
        for old, new in new_names.items()
        if old in text
    )


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("WP_RADIUS 60", "4.7"),
        ("GLIDE_SLOPE_THR 10", "4.6"),
        ("LIM_ROLL_CD 4500", "4.6"),
        ("ALT_SLOPE_MAXHGT 10", "4.7"),
        ("CLIMB_SLOPE_HGT 30", "4.7"),
        ("#NOTE: ArduPlane V4.6.3 (3fc7011a)\nWP_RADIUS 60", "4.6"),
        ("# Stack: ArduPilot\n# Version: 4.6.3\nWP_RADIUS 60", "4.6"),
        # A comment decides before the names.
        ("# ArduPlane V4.7.3\nGLIDE_SLOPE_MIN 15", "4.7"),
        # Names of both are of no release.
        ("GLIDE_SLOPE_MIN 15\nALT_SLOPE_MAXHGT 10", "4.7"),
    ],
)
def test_a_parameter_file_selects_its_release(text: str, version: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.param"
    file.write_text(text, encoding="utf-8")
    table = FlightTable(params=str(file))
    made = ArduPlane.load(table, load_aircraft("aerosonde"), "a")
    assert (made.version, made.checks.parameter_notes) == (version, notes_of(text, file, version))
    assert f"the simulated ArduPlane {version} with the parameters of" in made.describe("aerosonde")


@pytest.mark.parametrize(
    ("text", "stated", "note"),
    [
        (
            "GLIDE_SLOPE_MIN 20",
            "4.7",
            "was written for ArduPlane 4.6 (GLIDE_SLOPE_MIN), but ArduPlane 4.7 is simulated, as requested",
        ),
        (
            "ALT_SLOPE_MIN 20",
            "4.6",
            "was written for ArduPlane 4.7 (ALT_SLOPE_MIN), but ArduPlane 4.6 is simulated, as requested",
        ),
        (
            "# ArduPlane V4.5.7\nWP_RADIUS 60",
            None,
            "was written for ArduPlane 4.5 (ArduPlane V4.5), but ArduPlane 4.6 is simulated,"
            " the nearest available release",
        ),
        (
            "# ArduPlane V4.9.0\nWP_RADIUS 60",
            None,
            "was written for ArduPlane 4.9 (ArduPlane V4.9), but ArduPlane 4.7 is simulated,"
            " the nearest available release",
        ),
    ],
)
def test_a_file_of_another_release_is_noted_in_one_line(
    text: str, stated: ArduPlaneVersion | None, note: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.param"
    file.write_text(text, encoding="utf-8")
    assert choose_release(stated, str(file)).notes[0] == f"{file} {note}"


def test_the_newest_release_is_the_default_and_a_scenario_states_it() -> None:
    scenario = load_scenario("jacksboro-air")
    assert ArduPlane.load(scenario.flight, load_aircraft("aerosonde"), "a").version == "4.7"
    assert scenario.flight.with_stated_defaults().arduplane_version == "4.7"
    assert with_flight(scenario, autopilot="px4").flight.with_stated_defaults().arduplane_version is None
    older = with_flight(scenario, autopilot="ardupilot", arduplane_version="4.6")
    assert ArduPlane.load(older.flight, load_aircraft("aerosonde"), "a").version == "4.6"
    # Another autopilot is flown in its own release.
    assert with_flight(older, autopilot="px4").flight.arduplane_version is None


def test_a_release_belongs_to_arduplane_alone() -> None:
    with pytest.raises(ValueError, match=r'arduplane_version: only a key of autopilot = "ardupilot", not of "px4"'):
        FlightTable(autopilot="px4", arduplane_version="4.6")
    with pytest.raises(ParameterError, match=r"^arduplane_version: '4.5': expected 4.6 or 4.7$"):
        ArduPilotParameters.defaults("4.5")


@pytest.mark.parametrize(
    ("program", "version"), [("ArduPlane V4.6.3 (3fc7011a)", "4.6"), ("ArduPlane V4.7.3", "4.7"), ("ArduPlane", "4.7")]
)
def test_a_log_selects_the_release_that_flew_it(program: str, version: str) -> None:
    assert simulated_release(program) == version
    flown, notes = autopilot_from_log(program, {"WP_RADIUS": 60.0}, "a.BIN") or (None, ())
    assert flown is not None
    assert (flown.version, notes) == (version, ())


def test_a_release_comes_back_from_a_log_and_a_log_without_one_is_of_46() -> None:
    for version in ("4.6", "4.7"):
        law = ArduPlane(ArduPilotParameters.from_text("ALT_SLOPE_MIN 20", "mine.param", version))
        assert ArduPlane.restore(law.store()) == law
    values = (ParameterValue("GLIDE_SLOPE_MIN", 20.0, "file"),)
    older = ArduPlane.restore(StoredAutopilot(parameters=StoredParameters(values, (), "mine.param")))
    assert (older.version, older.parameters.altitude_slope_min) == ("4.6", 20.0)


def test_a_parameter_of_47_is_not_used_by_46() -> None:
    text = "ALT_SLOPE_MIN 20\nCLIMB_SLOPE_HGT 30\n"
    newer, older = (ArduPilotParameters.from_text(text, "mine.param", version) for version in ("4.7", "4.6"))
    assert (newer.climb_slope_height, newer.unused) == (30.0, ())
    # 4.6 climbs in one step from 20 m over home and below (`Plane::setup_glide_slope`).
    assert (older.climb_slope_height, older.unused) == (20.0, ("CLIMB_SLOPE_HGT",))
    assert older.altitude_slope_min == newer.altitude_slope_min == 20.0
    assert newer.with_release("4.6").climb_slope_height == 20.0
    assert [made.record().is_4_7 for made in (newer, older)] == [True, False]


# The same value under the name before 4.5, under the name of 4.6, and under the name of 4.7 (ArduPlane's release notes,
# conversion tables of ArduPlane/Parameters.cpp): every renamed parameter that the control law reads.
READ_UNDER_OLD_NAMES = [
    ("GLIDE_SLOPE_MIN 21", "GLIDE_SLOPE_MIN 21", "ALT_SLOPE_MIN 21"),
    ("GLIDE_SLOPE_THR 7", "GLIDE_SLOPE_THR 7", "ALT_SLOPE_MAXHGT 7"),
    ("TRIM_ARSPD_CM 1500", "AIRSPEED_CRUISE 15", "AIRSPEED_CRUISE 15"),
    ("ARSPD_FBW_MIN 11", "AIRSPEED_MIN 11", "AIRSPEED_MIN 11"),
    ("ARSPD_FBW_MAX 26", "AIRSPEED_MAX 26", "AIRSPEED_MAX 26"),
    ("MIN_GNDSPD_CM 600", "MIN_GROUNDSPEED 6", "MIN_GROUNDSPEED 6"),
    ("LIM_ROLL_CD 5500", "ROLL_LIMIT_DEG 55", "ROLL_LIMIT_DEG 55"),
    ("LIM_PITCH_MAX 2500", "PTCH_LIM_MAX_DEG 25", "PTCH_LIM_MAX_DEG 25"),
    ("LIM_PITCH_MIN -2000", "PTCH_LIM_MIN_DEG -20", "PTCH_LIM_MIN_DEG -20"),
    ("TRIM_PITCH_CD 200", "PTCH_TRIM_DEG 2", "PTCH_TRIM_DEG 2"),
    ("ALT_HOLD_RTL 9000", "RTL_ALTITUDE 90", "RTL_ALTITUDE 90"),
    ("LAND_PITCH_CD 300", "LAND_PITCH_DEG 3", "LAND_PITCH_DEG 3"),
    ("GPS_TYPE 9", "GPS1_TYPE 9", "GPS1_TYPE 9"),
    ("GPS_TYPE2 9", "GPS2_TYPE 9", "GPS2_TYPE 9"),
]


@pytest.mark.parametrize("names", READ_UNDER_OLD_NAMES)
def test_a_renamed_parameter_is_read_under_each_of_its_names(names: tuple[str, str, str]) -> None:
    made = [ArduPilotParameters.from_text(text, "a") for text in names]
    assert made[0].by_origin("file") == made[1].by_origin("file") == made[2].by_origin("file")
    assert made[2].by_origin("file") == {names[2].split()[0]: float(names[2].split()[1])}
    assert [one.unused for one in made] == [(), (), ()]


def test_every_renamed_parameter_is_read_or_not_used_and_named_in_one_line(tmp_path: Path) -> None:
    read = {text.split()[0] for names in READ_UNDER_OLD_NAMES for text in names}
    for release, new_names in RENAMED.items():
        for old, new in new_names.items():
            assert len(new) <= LONGEST_NAME, new
            # No name is renamed twice, and none is both old and new.
            assert new not in NAMES_BEFORE_4_7, new
            assert name_in_release(old, "4.7") == new
            assert name_in_release(new, "4.6") == (old if release == "4.7" else new)
            assert (old in TABLE.by_any_name, new in TABLE.by_any_name) == (old in read, new in read), old
    file = tmp_path / "old.param"
    for old in NAMES_BEFORE_4_7:
        file.write_text(f"{old} 7\nWP_RADIUS 60\n", encoding="utf-8")
        (note,) = choose_release("4.7", str(file)).notes[1:]
        new = name_in_release(old, "4.7")
        said = f"{old} is read as {new}, its name in ArduPlane 4.7" if old in read else f"{old} (now {new}) is not used"
        assert note == f"{file}: {said}"


def test_a_file_of_47_that_46_flies_states_the_older_name(tmp_path: Path) -> None:
    file = tmp_path / "new.param"
    file.write_text("ALT_SLOPE_MIN 20\nAIRSPEED_CRUISE 20\n", encoding="utf-8")
    notes = choose_release("4.6", str(file)).notes
    assert notes[1:] == (f"{file}: ALT_SLOPE_MIN is read as GLIDE_SLOPE_MIN, its name in ArduPlane 4.6",)
    # A name of the release that flies needs no note.
    assert choose_release("4.7", str(file)).notes == ()


def names_by_release() -> dict[str, frozenset[str]]:
    """The names of ArduPlane's parameter references, by release."""
    names: dict[str, set[str]] = {release: set() for release in ("4.4", "4.5", "4.6", "4.7")}
    releases: list[str] = []
    for line in Path(__file__).with_name("parameter_names.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            releases = line.strip("[]").split()
        elif not line.startswith("#"):
            for release in releases:
                names[release].update(line.split())
    return {release: frozenset(found) for release, found in names.items()}


LISTED = names_by_release()
# Parameters that a release removed, or replaced by one of another meaning (ARMING_CHECK by ARMING_SKIPCHK).
REMOVED = {
    "4.5": {"GPS_BLEND_TC", "RELAY_DEFAULT"}
    | {f"CAN_D{number}_{name}" for number in "123" for name in ("KDE_NPOLE", "TST_ID", "TST_LPR8")},
    "4.6": {"GPS_MIN_DGPS"},
    "4.7": {"ARMING_CHECK", "ARM_C_RTL_ALT", "EK3_MAX_FLOW", "FLOW_HGT_OVR", "FS_SHORT_TIMEOUT", "PLND_ORIENT"}
    | {f"CAM_RC_{name}" for name in ("BTN_DELAY", "BT_DELAY", "CONTROL", "FEATURES", "MDE_DELAY", "TYPE")}
    | {f"VIEP_{name}" for name in ("CAM_SWHIGH", "CAM_SWLOW", "CAM_SWMID", "DEBUG", "ZOOM_MAX", "ZOOM_SPEED")}
    | {"SYSID_ENFORCE"},
}


@pytest.mark.parametrize(("before", "release"), [("4.4", "4.5"), ("4.5", "4.6"), ("4.6", "4.7")])
def test_every_name_that_a_release_gave_up_is_renamed_or_removed(before: str, release: str) -> None:
    """The references of 4.4 and 4.5 list the GPS names of both 4.5 and 4.6."""
    given_up = LISTED[before] - LISTED[release]
    assert given_up - set(RENAMED[release]) == REMOVED[release]
    assert set(RENAMED[release].values()) <= LISTED[release]
    if release != "4.6":
        assert set(RENAMED[release]) <= given_up


@pytest.mark.parametrize(("release", "version"), [("4.5", "4.6"), ("4.6", "4.6"), ("4.7", "4.7")])
def test_every_parameter_of_a_release_is_read_or_said_not_to_be_used(
    release: str, version: ArduPlaneVersion, tmp_path: Path
) -> None:
    """A file with all of the list: each name is read under its present name, or is among those that are not used."""
    # Of a parameter that the references list under two names, a file has one.
    names = {
        name for name in LISTED[release] if name_in_release(name, "4.7") in (name, *(set(RENAMED["4.7"].values())))
    }
    assert len(names) > 4000
    defaults = {name: definition.default / factor for name, (definition, factor) in TABLE.by_any_name.items()}
    text = "".join(f"{name} {defaults.get(name, 1.0):.10g}\n" for name in sorted(names))
    file = tmp_path / "all.param"
    file.write_text(text, encoding="utf-8")
    made = ArduPilotParameters.load(load_aircraft("aerosonde"), file, version)
    read, unused = set(made.by_origin("file")), set(made.unused)
    assert not read & unused
    present = {name: TABLE.by_any_name[name][0].name for name in names if name in TABLE.by_any_name}
    assert read == set(present.values()) - ({"CLIMB_SLOPE_HGT"} if version == "4.6" else set())
    assert unused == names - {name for name, known in present.items() if known in read}
    # The renamed ones are said in one line.
    renamed = {name for name in names if name_in_release(name, version) != name}
    notes = " ".join(choose_release(version, str(file)).notes)
    for name in renamed & TABLE.by_any_name.keys():
        assert f"{name} is read as {name_in_release(name, version)}" in notes
    left = len(renamed - TABLE.by_any_name.keys())
    assert ("not used" in notes) == (left > 0)
    assert (f" and {left - 1} more renamed parameter" in notes) == (left > 1)
