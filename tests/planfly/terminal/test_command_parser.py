"""Bad usage is one line that names what was meant; the help stands in groups."""

import pytest

from planfly.terminal.command_parser import CommandParser, LineParser
from planfly.terminal.parser import build_parser

Output = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("flyy m.plan", "planfly: 'flyy': no such command: did you mean 'fly'? (see planfly --help)"),
        ("fly m.plan --wnd 8,270", "planfly fly: --wnd: no such option: did you mean '--wind'?"),
        ("fly m.plan --terain=x", "planfly fly: --terain: no such option: did you mean '--terrain'?"),
        ("run tight --log f.mcap", "planfly run: "),
        ("check a.mcap b.mcap", "planfly check: b.mcap: no such argument (see planfly check --help)"),
        ("fly m.plan -x", "planfly fly: -x: no such option (see planfly fly --help)"),
        ("qqqq", "planfly: 'qqqq': no such command; there are run, plan, "),
    ],
)
def test_what_was_meant_is_named(line: str, said: str, capsys: Output) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args(line.split())
    assert stopped.value.code == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.startswith(said)
    assert out.err.count("\n") == 1


def test_a_parser_knows_its_long_options() -> None:
    parser = CommandParser(prog="x")
    parser.group("a").add_argument("--one-two", metavar="N")
    parser.add_argument("-q", "--quiet", action="store_true")
    assert set(parser.options()) <= {"--one-two", "--quiet"}
    assert "--one-two" in parser.options()


def test_commands_are_found_by_name_and_help_shows_groups() -> None:
    line = LineParser("1.0", "What it is.", "first steps: planfly go")
    go = line.command("go", "go there", "planfly go now", "planfly go later", more="ways:\n  on foot")
    go.group("how fast").add_argument("--speed", help="in m/s")
    assert line.commands == {"go": go}
    text = go.format_help()
    assert "how fast:\n  --speed" in text
    assert "example: planfly go now\n         planfly go later\n\nways:\n  on foot\n\nexit codes" in text
    assert line.parse_args(["go", "--speed", "3"]).speed == "3"
