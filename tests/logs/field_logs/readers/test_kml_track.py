import re
from pathlib import Path

import numpy as np
import pytest

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.readers.kml_track import read_kml
from tests.logs.field_logs.written_logs import BEGAN, kml
from world.errors import LogError


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
    with pytest.raises(LogError, match="its 1 lines have no times"):
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
        LogError, match=r"a track of \d+ times \(when\) and \d+ places \(gx:coord\): as many of both are expected"
    ):
        read_kml(path)
