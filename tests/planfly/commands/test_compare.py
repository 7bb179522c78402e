"""``planfly compare``: the table of two flights, and pictures into a folder of their own."""

from pathlib import Path

import pytest

from planfly.cli import main


@pytest.mark.usefixtures("unrendered")
def test_the_table_stands_alone_and_pictures_go_into_an_empty_folder(
    flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(flight / "flight.mcap")
    assert main(["compare", log, log]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:1] == ["verdict"]
    assert main(["compare", log, log, "--out", str(tmp_path / "c"), "--svg"]) == 0
    assert len(list((tmp_path / "c").iterdir())) == 5
    assert main(["compare", log, log, "--out", str(tmp_path / "c")]) == 2
