import time
from pathlib import Path

import gpxpy
import numpy as np
import pytest

from logs.field_logs.readers.gpx_track import read_gpx
from tests.logs.field_logs.written_logs import gpx
from world.errors import LogError


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


def test_a_route_is_a_plan(tmp_path: Path) -> None:
    (logged,) = read_gpx(gpx(tmp_path / "a.gpx")).missions
    assert [item.alt for item in logged.mission.items] == [500.0] * 3
    assert logged.with_heights
    assert read_gpx(gpx(tmp_path / "b.gpx", route=False)).missions == ()


def test_points_without_times_are_no_flight(tmp_path: Path) -> None:
    path = tmp_path / "a.gpx"
    point = '<trkpt lat="46" lon="8"><ele>1</ele></trkpt>'
    path.write_text(f'<gpx version="1.1" creator="x"><trk><trkseg>{point}{point}</trkseg></trk></gpx>')
    with pytest.raises(LogError, match="0 track points with a time of 2"):
        read_gpx(path)


def test_what_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gpx"
    path.write_text("<gpx><trk>")
    with pytest.raises(LogError, match="not a GPX file that can be read"):
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
