"""Lines about the work, where nobody receives them."""

from pathlib import Path

import pytest

from planfly.runtime.stages import report_replaced


def test_what_is_replaced_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    there = tmp_path / "flight.mcap"
    there.write_text("a law's", encoding="utf-8")
    report_replaced(there, tmp_path / "flight.BIN")
    assert [one.getMessage() for one in caplog.records] == [f"{there} exists and is replaced"]
