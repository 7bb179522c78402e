"""Options that several commands have: each command takes those that hold for it."""

import pytest

from planfly.terminal.parser import build_parser


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("fly m.waypoints --autopilot bin/arduplane", "autopilot", "bin/arduplane"),
        ("run tight --autopilot bin/arduplane", "autopilot", "bin/arduplane"),
        ("run tight", "autopilot", None),
        ("fly m.waypoints --params my.parm", "params", "my.parm"),
        ("check m.waypoints --guidance l1", "guidance", "l1"),
        ("serve --nav rtk", "nav", "rtk"),
        ("check m.waypoints --terrain a.tif", "terrain", "a.tif"),
        ("fly m.waypoints --airspeed 22", "airspeed", 22.0),
        ("export p.json a.kml --overwrite", "overwrite", True),
        ("serve --allow 10.0.0.1", "allow", "10.0.0.1"),
    ],
)
def test_an_option_holds_for_its_commands(line: str, name: str, value: object) -> None:
    assert getattr(build_parser().parse_args(line.split()), name) == value


@pytest.mark.parametrize(
    "line", ["check m.waypoints --autopilot a", "plan tight --nav rtk", "fly m.waypoints --nav good"]
)
def test_and_for_no_other(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(line.split())
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
