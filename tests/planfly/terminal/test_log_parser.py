"""The options of commands that take logs."""

import pytest

from planfly.terminal.parser import build_parser


def test_defaults_and_places_of_logs() -> None:
    parse = build_parser().parse_args
    assert parse(["compare", "a.mcap", "b.mcap"]).second == "b.mcap"
    replay = parse(["replay", "a.mcap", "--to", "127.0.0.1:14550"])
    assert (replay.to, replay.bind, replay.port, replay.speed) == ("127.0.0.1:14550", "127.0.0.1:0", 8765, None)
    assert parse(["replay", "a.mcap", "--to", "90"]).to == 90.0
    assert parse(["report", "--layout", "l.json"]).log is None


def test_a_log_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        build_parser().parse_args(["recover"])
    assert "LOG.mcap" in capsys.readouterr().err
