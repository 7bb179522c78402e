"""``planfly report``: figures and page from a log, or Foxglove's layout file."""

from pathlib import Path

import pytest

from planfly.cli import main


@pytest.mark.usefixtures("unrendered")
def test_the_layout_is_written_alone_and_pictures_on_request(
    flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 0
    assert (tmp_path / "layout.json").stat().st_size > 1000
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 2
    assert main(["report"]) == 2
    log, folder = str(flight / "flight.mcap"), tmp_path / "r"
    assert main(["report", log, "--svg", "--out", str(folder)]) == 4
    stills = {f"{name}.{kind}" for name in ("map", "profile") for kind in ("png", "svg")}
    assert {path.name for path in folder.iterdir()} == {"report.html", *stills}
    assert main(["report", log, "--pictures", "--out", str(folder), "--overwrite"]) == 4
    drawn = {path.name for path in folder.iterdir()}
    assert drawn >= {
        "report.html",
        *(f"{name}.png" for name in ("map", "profile", "scene", "turns", "envelope", "time")),
    }
    assert not any(name.endswith(".svg") for name in drawn)
    # A report without --pictures removes what an earlier one drew.
    assert main(["report", log, "--out", str(folder), "--overwrite"]) == 4
    assert {path.name for path in folder.iterdir()} == {"report.html", "map.png", "profile.png"}
