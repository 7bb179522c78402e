"""What JSBSim does not say, or does to the machine: each a clear error or a "not flyable", never a crash of ours."""

import shutil
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from planfly.cli import main

HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1\n"
ROW = "{}\t0\t0\t16\t0\t0\t0\t0\t{:.6f}\t8.0\t{:.1f}\t1\n"
SCENARIO = """\
name = "pit"
origin = { lat_deg = 46.0, lon_deg = 8.0 }
[terrain]
kind = "peaks"
[[terrain.peak]]
east_m = 0
north_m = 3000
height_m = 600
sigma_m = 400
[area]
east_m = [-4000, 4000]
north_m = [-2000, 8000]
ceiling_amsl_m = 3000
[start]
east_m = 0
north_m = -1000
amsl_m = 1000
[destination]
east_m = 0
north_m = 7000
amsl_m = 1000
"""


def _mission(*heights: float) -> None:
    """Due north, a point every 2 km from 1 km south of the origin, at these heights AMSL."""
    rows = [ROW.format(k + 1, 46.0 + (2000.0 * k - 1000.0) / 111_170.0, up) for k, up in enumerate(heights)]
    Path("m.waypoints").write_text(HEAD + "".join(rows), encoding="utf-8")


def _scenario(more: str = "") -> None:
    Path("s.toml").write_text(SCENARIO + more, encoding="utf-8")


def _fly() -> int:
    return main(["fly", "m.waypoints", "--scenario", "s.toml", "--log", "f.mcap"])


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def edit(tmp_path: Path) -> Callable[[str, str], None]:
    """Make ./own, the Aerosonde with one change, and a scenario that flies it."""

    def change(old: str, new: str) -> None:
        shutil.copytree(load_aircraft("aerosonde").folder, tmp_path / "own")
        for file in (tmp_path / "own").glob("aerosonde.*"):
            file.rename(file.with_stem("own"))
        model = tmp_path / "own" / "own.xml"
        text = model.read_text(encoding="utf-8")
        assert old in text
        model.write_text(text.replace(old, new, 1), encoding="utf-8")
        _scenario('[flight]\naircraft = "./own"\n')
        _mission(1000.0, 1000.0, 1000.0)

    return change


def _refused(capsys: pytest.CaptureFixture[str], *said: str) -> None:
    """Both ways in refuse the model in one line, with exit code 2, and nothing is written."""
    before = sorted(Path().rglob("*"))
    for command in (["fly", "m.waypoints", "--scenario", "s.toml", "--log", "f.mcap"], ["aircraft", "./own"]):
        assert main(command) == 2
        captured = capsys.readouterr()
        lines = [line for line in captured.err.splitlines() if line.startswith("planfly: ")]
        assert len(lines) == 1, captured.err
        assert "Traceback" not in captured.err
        for part in said:
            assert part in lines[0]
    assert sorted(Path().rglob("*")) == before


def test_a_dive_into_the_ground(capsys: pytest.CaptureFixture[str]) -> None:
    _scenario()
    _mission(400.0, 400.0, 400.0, 400.0)
    assert _fly() == 4
    text = capsys.readouterr().out
    assert text.startswith("not flyable")
    assert "ground contact" in text
    assert main(["check", "f.mcap"]) == 4


def test_a_start_under_the_terrain(capsys: pytest.CaptureFixture[str]) -> None:
    _scenario()
    _mission(-5.0, 800.0, 800.0)
    assert _fly() == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "m.waypoints: start at -5 m AMSL: not above the terrain, which is at 0 m" in error


# ln(4 - t) is minus infinity from the fourth second on, and no number soon after.
POISON = """<function name="aero/poison">
<ln><difference><value>4</value><p>simulation/sim-time-sec</p></difference></ln>
</function>"""


def test_a_state_that_is_not_a_number(edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]) -> None:
    edit('<axis name="PITCH">', '<axis name="PITCH">' + POISON)
    assert _fly() == 4
    text = capsys.readouterr().out
    assert text.startswith("not flyable")
    assert "not a number" in text
    assert main(["check", "f.mcap"]) == 4


def test_a_missing_model(edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]) -> None:
    edit("<fdm_config", "<fdm_config")
    Path("own/own.xml").unlink()
    _refused(capsys, "own.xml", "cannot be read: No such file")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<p> aero/beta-rad </p>", "<p> aero/side-angle </p>", "property aero/side-angle is read, and neither"),
        ("<p> aero/beta-rad </p>", "<p> propulsion/engine[7]/thrust-lbs </p>", "propulsion/engine[7]/thrust-lbs"),
        ("motor/battery-current-a", "motor/amperes", "property motor/battery-current-a is needed and not defined"),
    ],
)
def test_an_unknown_property(
    old: str, new: str, said: str, edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    edit(old, new)
    _refused(capsys, "own.xml", said)


def test_a_model_that_aborts_jsbsim(edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]) -> None:
    # An engine that JSBSim would make is one of those names that cannot be looked up before: this one it does not
    # make, because there is only a tank.
    edit("<p> aero/beta-rad </p>", "<p> propulsion/engine[7]/thrust-lbs </p>")
    model = Path("own/own.xml")
    tank = '<propulsion><tank type="FUEL"><location unit="IN"><x>0</x><y>0</y><z>0</z></location><capacity unit="LBS">1'
    text = model.read_text(encoding="utf-8")
    assert "<propulsion/>" in text
    tank += '</capacity><contents unit="LBS">0</contents></tank></propulsion>'
    model.write_text(text.replace("<propulsion/>", tank), encoding="utf-8")
    _refused(capsys, "own.xml", "JSBSim")


@pytest.mark.parametrize(
    "channel",
    [
        '<input port="5599"/>',
        '<input port="5599" protocol="UDP" action="ECHO"/>',
        '<output name="own.csv" type="CSV" rate="10"><rates>ON</rates></output>',
        '<output name="localhost" type="SOCKET" port="5599" rate="10"/>',
        '<output file="elsewhere"/>',
    ],
)
def test_an_xml_that_opens_a_port_or_writes_a_file(
    channel: str, edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    edit("</fdm_config>", channel + "</fdm_config>")
    line = Path("own/own.xml").read_text(encoding="utf-8").split(channel)[0].count("\n") + 1
    _refused(capsys, f"own.xml:{line}: ", "opens a port or writes a file; the model is refused")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 5599))


def test_a_channel_in_a_file_that_the_model_brings_in(
    edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    edit("<propulsion/>", '<propulsion/><system file="radio"/>')
    Path("own/radio.xml").write_text('<system name="radio">\n<output type="SOCKET" port="5599"/>\n</system>\n')
    _refused(capsys, "radio.xml:2: <output> opens a port or writes a file")
    Path("own/radio.xml").unlink()
    _refused(capsys, "own.xml:", 'file="radio"', "not in the aircraft's folder")
