"""Every error of bad input is one kind, which the command line catches in one place."""

import inspect

import pytest

import world.errors
from planfly.cli import main
from planfly.commands import scenarios
from world.errors import (
    FlightError,
    LogError,
    MissionError,
    ParameterError,
    PlanflyError,
    ScenarioError,
    StartError,
    TerrainError,
)

KINDS = (ScenarioError, TerrainError, MissionError, FlightError, ParameterError, LogError)


def test_every_error_is_a_planfly_error() -> None:
    defined = [kind for _, kind in inspect.getmembers(world.errors, inspect.isclass)]
    assert set(defined) == {PlanflyError, StartError, *KINDS}
    assert all(issubclass(kind, PlanflyError) for kind in defined)


def test_no_error_hides_a_fault_of_the_program() -> None:
    # Who catches bad input must not catch a wrong index, a wrong type or a failed assertion with it.
    for kind in KINDS:
        assert kind.__mro__ == (kind, PlanflyError, Exception, BaseException, object)
    assert StartError.__mro__[1:] == FlightError.__mro__


def test_the_tree_in_the_docstring_names_each_error() -> None:
    tree = (world.errors.__doc__ or "").splitlines()
    for kind in (StartError, *KINDS):
        assert sum(kind.__name__ in line for line in tree) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_the_command_line_ends_with_exit_code_2_and_the_message(
    kind: type[PlanflyError], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> int:
        raise kind("file.toml: limits: too many")

    monkeypatch.setattr(scenarios, "scenarios", fail)
    assert main(["scenarios"]) == 2
    assert capsys.readouterr().err.splitlines() == ["planfly: file.toml: limits: too many"]
