"""``planfly aircraft --json``: the list, one aircraft with its numbers, and a new folder."""

from pathlib import Path

import pytest

from tests.planfly.terminal.answers.checked_answers import answered

Output = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_list_and_a_new_one(capsys: Output) -> None:
    found = answered(capsys, 0, "aircraft")["aircraft"]
    assert [(one["name"], one["mass_kg"], one["detail"]) for one in found] == [
        ("aerosonde", 11.0, None),
        ("c172x", 1124.9, None),
        ("ultrastick25e", 1.959, None),
        ("x8", 3.364, None),
        ("zagi", 1.56, None),
    ]
    (made,) = answered(capsys, 0, "aircraft", "--new", "mine")["aircraft"]
    assert (made["name"], made["mass_kg"], Path(made["folder"])) == ("mine", 11.0, Path("mine").resolve())


@pytest.mark.usefixtures("unrendered")
def test_one_with_its_numbers(capsys: Output) -> None:
    (one,) = answered(capsys, 0, "aircraft", "aerosonde", "--out", "out")["aircraft"]
    detail = one["detail"]
    assert one["max_bank_deg"] == 30.0
    # As its README has them: the slowest and the fastest level flight at the sea.
    assert detail["level_speed_min_mps"] == pytest.approx(15.9, abs=0.05)
    assert detail["level_speed_max_mps"] == pytest.approx(32.5, abs=0.05)
    assert {mode["name"] for mode in detail["modes"]} == {"short period", "phugoid", "Dutch roll", "roll", "spiral"}
    assert sorted(detail["files"]) == sorted(str(path) for path in Path("out").iterdir())
    assert detail["lacking"] == []
