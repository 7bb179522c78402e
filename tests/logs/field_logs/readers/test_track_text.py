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
