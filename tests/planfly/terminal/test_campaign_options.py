"""Options of campaigns: what is taken, and one line for the rest."""

import pytest

from planfly.terminal.parser import build_parser


@pytest.mark.parametrize(
    "words",
    [
        ("campaign", "--prove", "1.0"),
        ("campaign", "--prove", "0.49"),
        ("campaign", "--at-least", "nan"),
        ("campaign", "--flights", "0"),
        ("campaign", "--refly", "-1"),
        ("campaign", "--prove", "0.9", "--at-least", "0.9"),
        ("winds", "--directions", "3"),
        ("winds", "--directions", "73"),
        ("winds", "--most", "0.9"),
        ("winds", "--most", "41"),
    ],
)
def test_bad_values_get_one_line(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build_parser().parse_args([words[0], "jacksboro", *words[1:]])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_is_taken() -> None:
    args = build_parser().parse_args(
        ["campaign", "jacksboro", "--prove", "0.5", "--flights", "10000000", "--refly", "0"]
    )
    assert (args.prove, args.flights, args.refly) == (0.5, 10_000_000, 0)
    args = build_parser().parse_args(["winds", "x", "--directions", "72", "--most", "40"])
    assert (args.directions, args.most, args.prove) == (72, 40.0, 0.99)
