import pytest

from planfly.terminal.parser import build_parser


def test_import_takes_a_log_and_a_target() -> None:
    args = build_parser().parse_args(["import", "a.tlog", "a.mcap", "--terrain", "dem.tif"])
    assert (args.command, args.log, args.target, args.terrain) == ("import", "a.tlog", "a.mcap", "dem.tif")


def test_refly_takes_a_flight() -> None:
    args = build_parser().parse_args(["refly", "a.mcap", "--turbulence", "light"])
    assert (args.log, args.turbulence, args.out) == ("a.mcap", "light", None)


def test_flights_are_numbered_from_1(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        build_parser().parse_args(["check", "a.BIN", "--flight", "0"])
    assert "a whole number from 1" in capsys.readouterr().err
