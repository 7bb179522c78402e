"""``planfly report``: figures and page from a log, or Foxglove's layout file."""

from pathlib import Path

import pytest

from planfly.cli import main


@pytest.mark.usefixtures("unrendered")
def test_the_layout_is_written_alone_and_figures_as_svg_too(
    flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 0
    assert (tmp_path / "layout.json").stat().st_size > 1000
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 2
    assert main(["report"]) == 2
    assert main(["report", str(flight / "flight.mcap"), "--svg", "--out", str(tmp_path / "r")]) == 4
    names = {path.name for path in (tmp_path / "r").iterdir()}
    drawn = ("map", "profile", "scene", "turns", "envelope")
    assert names == {"report.html", *(f"{name}.{kind}" for name in drawn for kind in ("png", "svg"))}
