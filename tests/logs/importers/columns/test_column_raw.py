import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from logs.importers.columns.column_checks import check_signs_and_units
from logs.importers.columns.column_log import ColumnLog
from logs.importers.imported_flight import make_flight, mean_wind
from logs.importers.motion_log import read_motion
from logs.importers.open_log import is_imported_log, open_log
from tests.logs.importers.columns.column_files import AIRSPEED, LAT, LON, TABLE, WIND_EAST, circle, write_log
from world.errors import LogError

ROOT = Path(__file__).parents[4]
ARDUPLANE = ROOT / "examples" / "real" / "arduplane2013" / "TestLog2.columns.toml"


def test_a_log_is_read_as_others_are(tmp_path: Path) -> None:
    path = write_log(tmp_path)
    assert is_imported_log(path)
    raw = open_log(path)
    columns = circle()
    assert (raw.format, raw.datum, raw.vehicle, len(raw.sha256)) == ("table of columns", "amsl", "plane", 64)
    assert raw.series["position"].values[0] == pytest.approx([LAT, LON, 500.0])
    assert raw.series["velocity"].values[:, 0] == pytest.approx(columns["ve"])
    assert raw.series["airspeed"].values == pytest.approx(AIRSPEED)
    assert raw.series["throttle"].values[:, 0] == pytest.approx(0.01 * columns["thr"])
    # 11.1 V times 12 A for 239.95 s.
    assert raw.series["battery"].values[-1] == pytest.approx([12.0, 11.1 * 12.0 * 239.95 / 3600.0])
    wind = mean_wind(make_flight(raw))
    assert wind is not None
    assert (wind.speed, wind.source) == (pytest.approx(WIND_EAST, abs=0.1), "the triangle of velocities")
    assert wind.from_course == pytest.approx(1.5 * math.pi, abs=0.03)


@pytest.mark.parametrize("without", ["latitude", "longitude"])
def test_a_flight_without_positions_is_refused(tmp_path: Path, without: str) -> None:
    lines = [line for line in TABLE.splitlines() if not line.startswith(f"{without} =")]
    with pytest.raises(
        LogError, match=f"columns.{without}: missing: expected a column, because a flight is judged by its positions"
    ):
        open_log(write_log(tmp_path, "\n".join(lines)))


def test_the_bytes_of_the_data_are_part_of_the_digest(tmp_path: Path) -> None:
    first = ColumnLog(write_log(tmp_path)).sha256
    assert ColumnLog(write_log(tmp_path, volt=circle()["volt"] + 0.1)).sha256 != first
    assert ColumnLog(write_log(tmp_path, f"{TABLE}\n")).sha256 != first


def test_rows_are_known_again_after_an_edit_of_their_table(tmp_path: Path) -> None:
    """An aircraft that was identified from a log has seen it, whatever was edited in the table of its columns since.

    Another span is of the same data: the span itself says which rows were used.
    """
    first = read_motion(write_log(tmp_path)).sha256
    assert read_motion(write_log(tmp_path, f"# A comment.\n{TABLE}")).sha256 == first
    part = read_motion(write_log(tmp_path, f"span_s = [20.0, 60.0]\n{TABLE}"))
    assert (part.sha256, part.span) == (first, (20.0, 60.0))
    assert read_motion(write_log(tmp_path, volt=circle()["volt"] + 0.1)).sha256 != first


def test_arduplane_of_2013_is_read_from_its_matlab_file() -> None:
    raw = open_log(ARDUPLANE)
    data = loadmat(ARDUPLANE.with_name("TestLog2.mat"), squeeze_me=True)
    assert raw.series["position"].values[:, 0] == pytest.approx(data["GPS"][:, 6] + 0.1)
    speed, course = data["GPS"][:, 10], np.radians(data["GPS"][:, 11])
    assert raw.series["velocity"].values[:, :2] == pytest.approx(
        np.column_stack([speed * np.sin(course), speed * np.cos(course)]), abs=1e-6
    )
    assert raw.series["throttle"].values.max() == pytest.approx(1.0)
    automatic = [(round(mode.time, 3), mode.name) for mode in raw.modes if mode.automatic]
    assert automatic == [(206.061, "AUTO"), (256.602, "AUTO")]
    assert raw.parameters["TRIM_ARSPD_CM"] == 1600.0
    # The table's own parameters take the place of those of the file, which has -60.
    assert (raw.parameters["WP_LOITER_RAD"], len(raw.parameters)) == (60.0, 308)
    assert [item.command for item in raw.missions[0].mission.items] == [22, 17, 16, 16, 17, 16, 16, 17]
    wind = mean_wind(make_flight(raw))
    assert wind is not None
    # 6.3 m/s, measured by others on the same log.
    assert wind.speed == pytest.approx(6.3, abs=0.3)


@pytest.mark.parametrize("table", ["arduplane2013/TestLog2", "thor75/thor_flight75"])
def test_real_flights_do_not_contradict_themselves(table: str) -> None:
    check_signs_and_units(ColumnLog(ROOT / "examples" / "real" / f"{table}.columns.toml"))
