import zipfile
from pathlib import Path

import pytest

from logs.field_logs.readers import track_text as module
from logs.field_logs.readers.track_text import track_text
from world.errors import LogError


def test_a_document_type_is_refused(tmp_path: Path) -> None:
    """Entities could grow without bound, or name other files."""
    path = tmp_path / "a.gpx"
    path.write_text('<!DOCTYPE gpx [<!ENTITY a "aaaa">]><gpx>&a;</gpx>')
    with pytest.raises(LogError, match="a document type"):
        track_text(path, xml=True)
    assert track_text(path, xml=False).startswith("<!DOCTYPE")


def test_a_file_may_be_as_large_as_is_said_and_no_larger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_BYTES", 10)
    path = tmp_path / "a.igc"
    path.write_bytes(b"x" * 10)
    assert track_text(path, xml=False) == "x" * 10
    path.write_bytes(b"x" * 11)
    with pytest.raises(LogError, match="11 bytes: at most 10 are read"):
        track_text(path, xml=False)


def zipped(path: Path, **entries: str) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in entries.items():
            archive.writestr(name.replace("_", "."), text)
    return path


def test_of_a_zipped_file_the_first_kml_is_read(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.kmz", image_png="x", doc_kml="<kml>é</kml>", more_kml="<kml/>")
    assert track_text(path, xml=True) == "<kml>é</kml>"


def test_a_zipped_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"a zipped file without a \.kml in it"):
        track_text(zipped(tmp_path / "a.kmz", image_png="x"), xml=True)
    path = zipped(tmp_path / "b.kmz", doc_kml="<kml>" + "0123456789" * 100 + "</kml>")
    data = bytearray(path.read_bytes())
    data[50] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(LogError, match="a zipped file that cannot be read"):
        track_text(path, xml=True)


def test_what_unpacks_to_more_than_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = zipped(tmp_path / "a.kmz", doc_kml="0" * 5000)
    monkeypatch.setattr(module, "MOST_BYTES", 5000)
    assert len(track_text(path, xml=True)) == 5000
    monkeypatch.setattr(module, "MOST_BYTES", 4999)
    with pytest.raises(LogError, match="more than 4,999 bytes unpacked"):
        track_text(path, xml=True)
