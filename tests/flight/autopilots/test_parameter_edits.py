"""A parameter file with one value changed: all else stays as the ground station wrote it."""

import pytest

from flight.autopilots.parameter_edits import px4_parameter_text, with_parameter
from flight.autopilots.parameter_files import parse_parameters
from flight.autopilots.parameter_origin import parameter_origin
from world.errors import ParameterError

QGC = (
    "# Onboard parameters for Vehicle 1\n#\n# Stack: PX4 Pro\n# Vehicle: Fixed Wing\n# Version: 1.16.0 \n#\n"
    "# Vehicle-Id Component-Id Name Value Type\n"
    "1\t1\tBAT1_N_CELLS\t4\t6\n1\t1\tNAV_ACC_RAD\t20\t9\n1\t1\tNPFG_PERIOD\t10\t9\n"
)


def test_a_file_of_qgroundcontrol_keeps_its_columns_and_all_of_its_parameters() -> None:
    assert with_parameter(QGC, "a.params", {"NPFG_PERIOD": 7.0}) == QGC.replace("PERIOD\t10", "PERIOD\t7")
    assert with_parameter(QGC, "a.params", {"NPFG_DAMPING": 0.65}) == QGC + "1\t1\tNPFG_DAMPING\t0.65\t9\n"
    # As Windows writes it.
    assert with_parameter(QGC.replace("\n", "\r\n"), "a", {"NAV_ACC_RAD": 20.0}) == QGC


@pytest.mark.parametrize(
    ("text", "changed"),
    [
        ("WP_RADIUS 90  # m\nTHR_MAX 100\n", "WP_RADIUS 60  # m\nTHR_MAX 100\n"),
        ("THR_MAX,100\n WP_RADIUS,90", "THR_MAX,100\n WP_RADIUS,60\n"),
        ("THR_MAX=100\n", "THR_MAX=100\nWP_RADIUS=60\n"),
        # Under an older name in centimetres, which the file's release has, and under both names.
        ("OLD_RADIUS 9000\nTHR_MAX 100\n", "OLD_RADIUS 6000\nTHR_MAX 100\n"),
        ("OLD_RADIUS,9000\nTHR_MAX,100\nWP_RADIUS,90\n", "OLD_RADIUS,6000\nTHR_MAX,100\nWP_RADIUS,60\n"),
    ],
)
def test_any_other_format_stays(text: str, changed: str) -> None:
    assert with_parameter(text, "a.param", {"WP_RADIUS": 60.0, "OLD_RADIUS": 6000.0}) == changed


def test_a_text_that_is_no_parameter_file_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^a\.param: no parameter"):
        with_parameter("# nothing\n", "a.param", {"WP_RADIUS": 60.0})


def test_a_parameter_alone_is_written_as_qgroundcontrol_reads_it() -> None:
    text = px4_parameter_text("NPFG_PERIOD", 7.0, "1.16")
    entries = parse_parameters(text, "a.params")
    assert {name: entry.value for name, entry in entries.items()} == {"NPFG_PERIOD": 7.0}
    assert text.splitlines()[-1].split("\t") == ["1", "1", "NPFG_PERIOD", "7", "9"]
    assert parameter_origin(text, entries).autopilot == "px4"
