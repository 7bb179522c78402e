"""Progress on standard error: plain lines where no terminal is, and none for work that never begins."""

import re

import pytest

from planfly.terminal.progress import progress


def test_a_line_when_work_begins_and_one_when_it_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("flying") as advance:
        assert capsys.readouterr().err == ""
        advance(1.0, 4.0, "1 of 4 km")
        assert capsys.readouterr().err == "flying ...\n"
        advance(4.0, 4.0, "4 of 4 km")
        assert capsys.readouterr().err == ""
    printed = capsys.readouterr()
    assert re.fullmatch(r"flying: done in \d+\.\d s: 4 of 4 km\n", printed.err)
    assert printed.out == ""


def test_input_that_is_refused_first_has_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="refused"), progress("flying"):
        raise ValueError("refused")
    assert capsys.readouterr().err == ""
