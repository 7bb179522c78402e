import contextlib
import re
import time
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import gpxpy
import numpy as np
import pytest

from logs.importers import track_files
from logs.importers.imported_flight import make_flight
from logs.importers.raw_log import example_raw_log
from logs.importers.track_files import read_gpx, read_igc, read_kml, read_track_text
from planfly.cli import main
from tests.logs.importers.written_logs import BEGAN, gpx, igc, kml
from world.errors import LogError


def test_a_document_type_is_refused(tmp_path: Path) -> None:
    """Entities could grow without bound, or name other files."""
    path = tmp_path / "a.gpx"
    path.write_text('<!DOCTYPE gpx [<!ENTITY a "aaaa">]><gpx>&a;</gpx>')
    with pytest.raises(LogError, match="a document type"):
        read_track_text(path, xml=True)
    assert read_track_text(path, xml=False).startswith("<!DOCTYPE")


def test_a_file_may_be_as_large_as_is_said_and_no_larger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(track_files, "MAX_BYTES", 10)
    path = tmp_path / "a.igc"
    path.write_bytes(b"x" * 10)
    assert read_track_text(path, xml=False) == "x" * 10
    path.write_bytes(b"x" * 11)
    with pytest.raises(LogError, match="too large: 11 bytes; the limit for a track is 10 bytes"):
        read_track_text(path, xml=False)


def zipped(path: Path, **entries: str) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in entries.items():
            archive.writestr(name.replace("_", "."), text)
    return path


def test_of_a_zipped_file_the_first_kml_is_read(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.kmz", image_png="x", doc_kml="<kml>é</kml>", more_kml="<kml/>")
    assert read_track_text(path, xml=True) == "<kml>é</kml>"


def test_a_zipped_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"the zipped file contains no \.kml"):
        read_track_text(zipped(tmp_path / "a.kmz", image_png="x"), xml=True)
    path = zipped(tmp_path / "b.kmz", doc_kml="<kml>" + "0123456789" * 100 + "</kml>")
    data = bytearray(path.read_bytes())
    data[50] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(LogError, match="the zipped file cannot be unpacked"):
        read_track_text(path, xml=True)


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_zipped_file_is_refused_in_one_line_whatever_packed_it(
    tmp_path: Path, method: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each byte of the packed data changed: bzip2 and LZMA have errors of their own."""
    path, text = tmp_path / "a.kmz", "<kml>" + "0123456789" * 100 + "</kml>"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("doc.kml", text)
        size = archive.infolist()[0].compress_size
    data, begins = path.read_bytes(), 30 + len("doc.kml")
    for at in range(begins, begins + size):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        # A changed bit of padding changes nothing.
        with contextlib.suppress(LogError):
            assert read_track_text(path, xml=True) == text
    path.write_bytes(data[:begins] + bytes(size) + data[begins + size :])
    assert main(["check", str(path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"planfly: {path}: the zipped file cannot be unpacked: ")
    assert told.count("\n") == 1


def test_what_unpacks_to_more_than_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = zipped(tmp_path / "a.kmz", doc_kml="0" * 5000)
    monkeypatch.setattr(track_files, "MAX_BYTES", 5000)
    assert len(read_track_text(path, xml=True)) == 5000
    monkeypatch.setattr(track_files, "MAX_BYTES", 4999)
    with pytest.raises(LogError, match="more than 4,999 bytes when unpacked"):
        read_track_text(path, xml=True)


# ----------------------------------------------------------------------
# GPX.


def test_rows_are_what_gpxpy_reads(tmp_path: Path) -> None:
    path = gpx(tmp_path / "a.gpx")
    raw = read_gpx(path)
    points = gpxpy.parse(path.read_text()).tracks[0].segments[0].points
    for k in np.linspace(0, len(points) - 1, 10).astype(int):
        one = points[k]
        assert raw.series["position"].values[k].tolist() == [one.latitude, one.longitude, one.elevation]
        assert raw.series["position"].time[k] == (one.time - points[0].time).total_seconds()
    assert raw.utc_start == points[0].time.timestamp()
    assert raw.datum == "unstated"


@pytest.mark.parametrize(
    ("row", "stamp", "first", "rows"),
    [
        (0, "2040-01-01T00:00:00Z", "2024-03-02T10:00:01", 91),
        (1, "2010-01-01T00:00:00Z", "2024-03-02T10:00:00", 91),
        (1, "2024-03-02T09:59:50Z", "2024-03-02T09:59:50", 92),
        (91, "2040-01-01T00:00:00Z", "2024-03-02T10:00:00", 91),
    ],
)
def test_a_time_that_is_damaged_costs_its_row(row: int, stamp: str, first: str, rows: int, tmp_path: Path) -> None:
    """The track begins at the earliest time that is none, wherever in the file it stands."""
    path = gpx(tmp_path / "a.gpx")
    text = path.read_text(encoding="utf-8")
    was = re.findall(r"<time>[^<]*</time>", text)[row]
    path.write_text(text.replace(was, f"<time>{stamp}</time>", 1), encoding="utf-8")
    raw = read_gpx(path)
    assert datetime.fromtimestamp(raw.utc_start, UTC).isoformat()[:19] == first
    flight = make_flight(raw)
    assert (flight.time[0], flight.time.size) == (0.0, rows)


@pytest.mark.parametrize("before", [1, 46, 91])
def test_times_of_before_the_receiver_knew_its_own_cost_their_rows(before: int, tmp_path: Path) -> None:
    """As many as half of the rows: the track is the later ones."""
    path = gpx(tmp_path / "a.gpx")
    text = path.read_text(encoding="utf-8")
    for k, was in enumerate(re.findall(r"<time>[^<]*</time>", text)[:before]):
        text = text.replace(was, f"<time>1970-01-01T00:{k // 60:02}:{k % 60:02}Z</time>", 1)
    path.write_text(text, encoding="utf-8")
    raw = read_gpx(path)
    began = datetime.fromtimestamp(raw.utc_start, UTC).year
    assert began == (2024 if before <= 46 else 1970)


def test_a_route_is_a_plan(tmp_path: Path) -> None:
    (logged,) = read_gpx(gpx(tmp_path / "a.gpx")).missions
    assert [item.alt for item in logged.mission.items] == [500.0] * 3
    assert logged.with_heights
    assert read_gpx(gpx(tmp_path / "b.gpx", route=False)).missions == ()


def test_points_without_times_are_no_flight(tmp_path: Path) -> None:
    path = tmp_path / "a.gpx"
    point = '<trkpt lat="46" lon="8"><ele>1</ele></trkpt>'
    path.write_text(f'<gpx version="1.1" creator="x"><trk><trkseg>{point}{point}</trkseg></trk></gpx>')
    with pytest.raises(LogError, match="0 of 2 track points have a time"):
        read_gpx(path)


def test_what_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gpx"
    path.write_text("<gpx><trk>")
    with pytest.raises(LogError, match="not a readable GPX file"):
        read_gpx(path)


def test_times_without_a_zone_are_utc_wherever_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = gpx(tmp_path / "a.gpx")
    with_zone = read_gpx(path).utc_start
    path.write_text(path.read_text().replace("Z</time>", "</time>"))
    monkeypatch.setenv("TZ", "Pacific/Auckland")
    time.tzset()
    try:
        assert read_gpx(path).utc_start == with_zone
    finally:
        monkeypatch.delenv("TZ")
        time.tzset()


# ----------------------------------------------------------------------
# IGC files by the FAI's layout: fixes worked out by hand.

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


@pytest.mark.parametrize(
    "line",
    [
        "B11GARBAGE",
        FIX.replace("B110135", "B240000"),
        FIX.replace("B110135", "B116000"),
        FIX.replace("B110135", "B110160"),
        FIX.replace("5206343N", "5260000N"),
        FIX.replace("00006198W", "00060000W"),
    ],
)
def test_fixes_that_cannot_be_read_are_counted(tmp_path: Path, line: str) -> None:
    raw = read(tmp_path, f"{HEAD}{FIX}\r\n{line}\r\n{FIX.replace('110135', '110136')}\r\n")
    assert raw.damage.unreadable == 1
    assert raw.series["position"].time.tolist() == [0.0, 1.0]
    with pytest.raises(LogError, match=r"0 fixes \(B records\)"):
        read(tmp_path, HEAD)


# ----------------------------------------------------------------------
# KML.


def test_a_track_has_times_and_places(tmp_path: Path) -> None:
    raw = read_kml(kml(tmp_path / "a.kml"))
    position, wanted = raw.series["position"], example_raw_log().series["position"]
    assert position.time[:3].tolist() == [0.0, 1.0, 2.0]
    assert position.values[5] == pytest.approx(wanted.values[25], abs=1e-7)
    assert raw.utc_start == BEGAN.timestamp()
    assert raw.datum == "amsl"
    assert read_kml(kml(tmp_path / "b.kml", mode="relativeToGround")).datum == "unstated"


def test_a_line_without_times_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.kml"
    path.write_text(
        "<kml><Placemark><LineString><coordinates>8,46,5 8,47,5</coordinates></LineString></Placemark></kml>"
    )
    with pytest.raises(LogError, match="1 line without times"):
        read_kml(path)


def test_what_cannot_be_read_of_a_track_is_counted(tmp_path: Path) -> None:
    path = kml(tmp_path / "a.kml")
    path.write_text(path.read_text().replace("<gx:coord>8.0000000 46", "<gx:coord>east 46", 1))
    assert read_kml(path).damage.unreadable == 1


def test_times_and_places_that_stand_in_turn_are_read_alike(tmp_path: Path) -> None:
    one, other = read_kml(kml(tmp_path / "a.kml")), read_kml(kml(tmp_path / "b.kml", in_turn=True))
    assert np.array_equal(one.series["position"].values, other.series["position"].values)
    assert np.array_equal(one.series["position"].time, other.series["position"].time)
    # Without its time a place is nobody's, and the others keep theirs.
    path = tmp_path / "b.kml"
    path.write_text(re.sub("<when>[^<]*10:00:10Z</when>", "", path.read_text()))
    cut = read_kml(path)
    assert cut.damage.unreadable == 1
    assert np.array_equal(cut.series["position"].values, np.delete(other.series["position"].values, 10, axis=0))


def test_as_many_times_as_places_are_expected(tmp_path: Path) -> None:
    path = kml(tmp_path / "a.kml")
    path.write_text(re.sub("<when>[^<]*10:00:10Z</when>", "", path.read_text()))
    with pytest.raises(
        LogError, match=r"a track has \d+ times \(when\) and \d+ positions \(gx:coord\): expected equal numbers"
    ):
        read_kml(path)
