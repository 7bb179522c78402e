"""`planfly.aircraft`: those embedded, and one in a folder."""

import shutil
from pathlib import Path

import pytest

import planfly
from aircraft.catalog import aircraft_names, load_aircraft


def test_without_a_name_all_embedded_ones_come() -> None:
    assert planfly.aircraft() == {name: load_aircraft(name) for name in aircraft_names()}


@pytest.mark.parametrize("kind", [str, Path])
def test_a_folder_is_named_as_text_or_path(kind: type, tmp_path: Path) -> None:
    shutil.copytree(load_aircraft("aerosonde").folder, tmp_path / "mine")
    (tmp_path / "mine" / "aerosonde.toml").rename(tmp_path / "mine" / "mine.toml")
    (tmp_path / "mine" / "aerosonde.xml").rename(tmp_path / "mine" / "mine.xml")
    found = planfly.aircraft(kind(tmp_path / "mine"))
    assert (found.name, found.mass, found.folder) == ("mine", load_aircraft("aerosonde").mass, tmp_path / "mine")


@pytest.mark.parametrize(
    ("name", "file"), [("cessna", "cessna"), (Path("nowhere"), str(Path("nowhere/nowhere.toml").resolve()))]
)
def test_a_name_that_is_none_is_bad_input(name: str | Path, file: str) -> None:
    with pytest.raises(planfly.FlightError) as caught:
        planfly.aircraft(name)
    assert caught.value.file == file
