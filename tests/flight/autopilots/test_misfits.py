"""Values of a parameter file that contradict one another, or a value that the file does not state."""

from pathlib import Path

import pytest

import flight.autopilots.arduplane.parameters as arduplane
import flight.autopilots.px4.parameters as px4
from aircraft.catalog import load_aircraft


@pytest.mark.parametrize(
    ("text", "misfits"),
    [
        ("TRIM_THROTTLE 45\nTHR_MIN 10", ()),
        ("TRIM_THROTTLE 9\nTHR_MIN 10", ("THR_MIN 10 of the file is above TRIM_THROTTLE 9 of the file",)),
        ("THR_MAX 40", ("THR_MAX 40 of the file is below TRIM_THROTTLE 45 of the defaults",)),
        ("AIRSPEED_CRUISE 8", ("AIRSPEED_CRUISE 8 of the file is below AIRSPEED_MIN 9 of the defaults",)),
        ("TRIM_ARSPD_CM 2300", ("AIRSPEED_CRUISE 23 of the file is above AIRSPEED_MAX 22 of the defaults",)),
        ("TECS_SINK_MIN 6", ("TECS_SINK_MIN 6 of the file is above TECS_SINK_MAX 5 of the defaults",)),
        ("PTCH_TRIM_DEG 21", ("PTCH_TRIM_DEG 21 of the file is above PTCH_LIM_MAX_DEG 20 of the defaults",)),
    ],
)
def test_arduplanes(text: str, misfits: tuple[str, ...]) -> None:
    found = arduplane.ArduPilotParameters.from_text(text, "a.param").contradictions
    assert len(found) == len(misfits)
    # Which of two values of one file is named first does not matter.
    for one, expected in zip(found, misfits, strict=True):
        assert set(one.replace("above", "below").split(" is below ")) == set(
            expected.replace("above", "below").split(" is below ")
        )


@pytest.mark.parametrize(
    ("text", "misfits"),
    [
        ("FW_AIRSPD_TRIM 15", ()),
        ("FW_AIRSPD_TRIM 21", ("FW_AIRSPD_TRIM 21 of the file is above FW_AIRSPD_MAX 20 of the defaults",)),
        ("FW_THR_MIN 0.7", ("FW_THR_MIN 0.7 of the file is above FW_THR_TRIM 0.6 of the defaults",)),
        ("FW_T_CLMB_MAX 2.5", ("FW_T_CLMB_MAX 2.5 of the file is below FW_T_CLMB_R_SP 3 of the defaults",)),
        ("FW_T_SINK_MIN 6", ("FW_T_SINK_MIN 6 of the file is above FW_T_SINK_MAX 5 of the defaults",)),
    ],
)
def test_px4s(text: str, misfits: tuple[str, ...]) -> None:
    assert px4.Px4Parameters.from_text(text, "a.params").contradictions == misfits


def test_a_file_is_compared_with_the_aircraft_and_the_aircraft_with_nothing(tmp_path: Path) -> None:
    """The Zagi's THR_MIN is 74 %."""
    zagi, path = load_aircraft("zagi"), tmp_path / "a.param"
    path.write_text("TRIM_THROTTLE 60\n", encoding="utf-8")
    misfit = "TRIM_THROTTLE 60 of the file is below THR_MIN 74 of the aircraft"
    assert arduplane.ArduPilotParameters.load(zagi, path).contradictions == (misfit,)
    assert arduplane.ArduPilotParameters.load(zagi).contradictions == ()
