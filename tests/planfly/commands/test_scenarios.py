"""``planfly scenarios``: a line for each scenario file that is embedded."""

import tomllib
from pathlib import Path

import pytest

import world
from planfly.cli import main

FILES = sorted((Path(world.__path__[0]) / "scenarios").glob("*.toml"))


def test_every_embedded_file_has_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    lines = capsys.readouterr().out.splitlines()
    described = {line.split(maxsplit=1)[0]: line.split(maxsplit=1)[1] for line in lines}
    wanted = {}
    for file in FILES:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
        wanted[table["name"]] = table["description"]
    assert len(wanted) >= 4
    assert described == wanted
