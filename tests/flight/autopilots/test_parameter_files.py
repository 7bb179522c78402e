"""Parameter files as QGroundControl, MAVProxy and Mission Planner write them, and every fault in one line."""

from pathlib import Path

import pytest

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parameter_files import MAX_BYTES, parse_parameters, read_parameter_file
from world.errors import ParameterError

QGC = """# Onboard parameters for Vehicle 1
#
# Stack: ArduPilot
# Vehicle: Fixed Wing Aircraft
# Version: 4.6.0
#
# Vehicle-Id Component-Id Name Value Type
1\t1\tNAVL1_PERIOD\t15.000000000000000000\t9
1\t1\tROLL_LIMIT_DEG\t30.000000000000000000\t9
1\t1\tFLTMODE_CH\t8\t2
"""
MAVPROXY = """NAVL1_PERIOD     15.000000
ROLL_LIMIT_DEG   30.000000
FLTMODE_CH       8
"""
MISSION_PLANNER = """#NOTE: 11/20/2026 7:40:00 PM Plane: my plane
NAVL1_PERIOD,15
ROLL_LIMIT_DEG,30
FLTMODE_CH,8
"""
DEFAULTS = "NAVL1_PERIOD = 15  # s\r\nROLL_LIMIT_DEG=3.0e1\r\n\r\nFLTMODE_CH\t8"


@pytest.mark.parametrize("text", [QGC, MAVPROXY, MISSION_PLANNER, DEFAULTS, "\ufeff" + MAVPROXY])
def test_every_form_gives_the_same(text: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.param"
    file.write_bytes(text.encode())
    found = read_parameter_file(file)
    assert {name: entry.value for name, entry in found.items()} == {
        "NAVL1_PERIOD": 15.0,
        "ROLL_LIMIT_DEG": 30.0,
        "FLTMODE_CH": 8.0,
    }


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("WP_RADIUS", "a.parm:1: 'WP_RADIUS': expected a name and a value"),
        ("WP_RADIUS 90 m", "a.parm:1: 'WP_RADIUS 90 m': expected a name and a value"),
        ("# x\nwp_radius 90", "a.parm:2: name 'wp_radius': expected up to 16 capitals, digits and _"),
        ("WP_RADIUS nan", "a.parm:1: WP_RADIUS: 'nan': expected a finite number"),
        ("WP_RADIUS 1e999", "a.parm:1: WP_RADIUS: '1e999': expected a finite number"),
        ("1\t1\tWP_RADIUS\tinf\t9", "a.parm:1: WP_RADIUS: 'inf': expected a finite number"),
        ("WP_RADIUS 0x5a", "a.parm:1: WP_RADIUS: '0x5a': expected a finite number"),
        ("WP_RADIUS 90\nTHR_MAX 100\nWP_RADIUS 90", "a.parm:3: WP_RADIUS: already on line 1: name each"),
        ("# nothing\n\n", "a.parm: no parameter; expected lines with a name and a value"),
    ],
)
def test_faults_are_one_line(text: str, said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        parse_parameters(text, "a.parm")
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)


def test_a_name_of_sixteen_characters_is_one() -> None:
    assert list(parse_parameters("A234567890123456 1", "a.parm")) == ["A234567890123456"]


def test_what_is_no_text_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot be read"):
        read_parameter_file(tmp_path / "missing.parm")
    with pytest.raises(ParameterError, match="is a folder; expected a parameter file"):
        read_parameter_file(tmp_path)
    file = tmp_path / "bytes.parm"
    file.write_bytes(b"WP_RADIUS 90\n\xff\xfe 1\n")
    with pytest.raises(ParameterError, match=r"bytes.parm:2: not a text file in UTF-8"):
        read_parameter_file(file)
    file.write_bytes(b" " * (MAX_BYTES + 1))
    with pytest.raises(ParameterError, match="has at most"):
        read_parameter_file(file)


@pytest.mark.parametrize("order", [(1, 51), (51, 1)])
def test_of_several_components_the_autopilots_counts(order: tuple[int, int]) -> None:
    value = {1: 90.0, 51: 20.0}
    text = "".join(f"1\t{component}\tNAV_ACC_RAD\t{value[component]}\t9\n" for component in order)
    assert parse_parameters(text, "a.params")["NAV_ACC_RAD"].value == 90.0


def test_a_name_that_is_too_long_is_read_and_known_to_no_law() -> None:
    """PITCH_LIM_MAX_DEG has 17 characters; MAVLink carries 16."""
    made = ArduPilotParameters.from_text("PITCH_LIM_MAX_DEG,15.00\nROLL_LIMIT_DEG,35\n", "x8rev.param")
    assert made.unused == ("PITCH_LIM_MAX_DEG",)
    assert made.by_origin("file") == {"ROLL_LIMIT_DEG": 35.0}
