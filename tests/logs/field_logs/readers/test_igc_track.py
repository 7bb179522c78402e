"""IGC files by the FAI's layout: fixes worked out by hand."""

from pathlib import Path

import pytest

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.readers.igc_track import read_igc
from tests.logs.field_logs.written_logs import igc
from world.errors import LogError

HEAD = "AXXX001\r\nHFDTE020324\r\nHFALGALTGPS:GEO\r\n"
# 52 degrees 06.343 minutes north, 0 degrees 06.198 minutes west: the specification's own example.
FIX = "B1101355206343N00006198WA0058700558"


def read(tmp_path: Path, text: str):
    path = tmp_path / "a.igc"
    path.write_text(text)
    return read_igc(path)


def test_a_fix_is_degrees_minutes_and_their_thousandths(tmp_path: Path) -> None:
    raw = read(tmp_path, f"{HEAD}{FIX}\r\n{FIX.replace('110135', '110136')}\r\n")
    lat, lon, up = raw.series["position"].values[0]
    assert lat == pytest.approx(52.0 + 6.343 / 60.0)
    assert lon == pytest.approx(-6.198 / 60.0)
    assert up == 558.0
    assert raw.heights[0].series.values[0, 0] == 587.0
    assert raw.utc_start == 1_709_337_600.0 + 11 * 3600 + 95


def test_south_and_east_and_below_the_sea(tmp_path: Path) -> None:
    fix = "B1101353352000S15112000EA-0012-0015"
    raw = read(tmp_path, f"{HEAD}{fix}\r\n{fix.replace('110135', '110136')}\r\n")
    lat, lon, up = raw.series["position"].values[0]
    assert (lat, lon, up) == (pytest.approx(-33.0 - 52.0 / 60.0), pytest.approx(151.2), -15.0)


def test_time_goes_on_after_midnight(tmp_path: Path) -> None:
    fixes = [FIX.replace("110135", clock) for clock in ("235959", "000001")]
    assert read(tmp_path, HEAD + "\r\n".join(fixes)).series["position"].time.tolist() == [0.0, 2.0]


@pytest.mark.parametrize(
    ("line", "datum"),
    [("HFALGALTGPS:GEO", "amsl"), ("HFALGALTGPS:ELL", "ellipsoid"), ("", "ellipsoid"), ("HFALGALTGPS:NIL", "unstated")],
)
def test_the_datum_is_the_files(tmp_path: Path, line: str, datum: str) -> None:
    assert read_igc(igc(tmp_path / "a.igc", datum=line)).datum == datum


def test_without_gnss_heights_those_by_pressure_count(tmp_path: Path) -> None:
    fix = FIX.replace("A0058700558", "V0058700000")
    raw = read(tmp_path, f"{HEAD}{fix}\r\n{fix.replace('110135', '110136')}\r\n")
    assert raw.datum == "pressure"
    assert raw.series["position"].values[0, 2] == 587.0


def test_the_declared_task_is_a_plan_without_heights(tmp_path: Path) -> None:
    """Take-off and landing places, which a declaration begins and ends with, are none of it."""
    (logged,) = read_igc(igc(tmp_path / "a.igc")).missions
    wanted = example_raw_log().missions[0].mission.items
    assert not logged.with_heights
    assert len(logged.mission.items) == 3
    for item, one in zip(logged.mission.items, wanted, strict=True):
        # To a thousandth of a minute.
        assert item.lat_deg == pytest.approx(one.lat_deg, abs=1e-5)
        assert item.lon_deg == pytest.approx(one.lon_deg, abs=1e-5)


def test_fixes_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    raw = read(tmp_path, f"{HEAD}{FIX}\r\nB11GARBAGE\r\n{FIX.replace('110135', '110136')}\r\n")
    assert raw.damage.unreadable == 1
    with pytest.raises(LogError, match=r"0 fixes \(B records\)"):
        read(tmp_path, HEAD)
