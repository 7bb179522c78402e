"""Every error of bad input is one kind, which the command line catches in one place."""

import inspect
import pickle
from pathlib import Path

import pytest

import world.errors
from planfly.cli import COMMANDS_BY_NAME, main
from world.errors import (
    ArgumentError,
    CrashError,
    FlightError,
    ForecastError,
    LogError,
    MissingExtraError,
    MissionError,
    ParameterError,
    PlanflyError,
    ScenarioError,
    StartError,
    TerrainError,
)

KINDS = (ScenarioError, TerrainError, ForecastError, MissionError, FlightError, ParameterError, LogError)


def test_every_error_is_a_planfly_error() -> None:
    members = [kind for _, kind in inspect.getmembers(world.errors, inspect.isclass)]
    defined = [kind for kind in members if kind.__module__ == "world.errors"]
    assert set(defined) == {PlanflyError, StartError, CrashError, ArgumentError, MissingExtraError, *KINDS}
    assert all(issubclass(kind, PlanflyError) for kind in defined)


def test_no_error_hides_a_fault_of_the_program() -> None:
    # Who catches bad input must not catch a wrong index, a wrong type or a failed assertion with it.
    for kind in KINDS:
        assert kind.__mro__ == (kind, PlanflyError, Exception, BaseException, object)
    assert StartError.__mro__[1:] == CrashError.__mro__[1:] == FlightError.__mro__
    # Callers may take a number that is out of its range for what Python calls it.
    assert ArgumentError.__mro__[1:-1] == (PlanflyError, ValueError, Exception, BaseException)
    assert MissingExtraError.__mro__[1:-1] == (PlanflyError, ImportError, Exception, BaseException)


def test_the_tree_in_the_docstring_names_each_error() -> None:
    tree = (world.errors.__doc__ or "").splitlines()
    for kind in (StartError, CrashError, ArgumentError, MissingExtraError, *KINDS):
        assert sum(kind.__name__ in line for line in tree) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_the_command_line_ends_with_exit_code_2_and_the_message(
    kind: type[PlanflyError], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> int:
        raise kind("file.toml: limits: too many")

    command = COMMANDS_BY_NAME["scenarios"]._replace(run=fail)
    monkeypatch.setitem(COMMANDS_BY_NAME, "scenarios", command)
    assert main(["scenarios"]) == 2
    assert capsys.readouterr().err.splitlines() == ["planfly: file.toml: limits: too many"]


@pytest.mark.parametrize("kind", [PlanflyError, *KINDS])
def test_an_error_of_one_value_holds_the_four_and_says_them(kind: type[PlanflyError]) -> None:
    error = kind.at(Path("a.toml"), "wind.speed_mps", 41.0, "allowed 0..40", shown="41")
    assert str(error) == "a.toml: wind.speed_mps: 41: allowed 0..40"
    assert (error.file, error.field, error.value, error.allowed) == ("a.toml", "wind.speed_mps", 41.0, "allowed 0..40")
    assert str(kind.at("a.toml", "seed", -1, "0 or more")) == "a.toml: seed: -1: 0 or more"


def test_a_value_that_is_not_there_is_left_out_of_the_line() -> None:
    error = ScenarioError.at("a.toml", "name", None, "missing", shown="")
    assert (str(error), error.value) == ("a.toml: name: missing", None)


@pytest.mark.parametrize(("file", "begin"), [("", ""), (Path("a.mcap"), "a.mcap: ")])
def test_an_error_of_an_argument_names_it_and_its_file(file: str | Path, begin: str) -> None:
    error = LogError.of_argument("to", 5.0, "the log ends at 4.0 s", shown="5", file=file)
    assert str(error) == f"{begin}to 5: the log ends at 4.0 s"
    assert (error.file, error.field, error.value) == (str(file), "to", 5.0)
    assert error.allowed == "the log ends at 4.0 s"


@pytest.mark.parametrize(
    ("error", "file", "field", "value"),
    [
        # It knows where the fault lies, and all of it is kept.
        (TerrainError.at("a.tif", "bands", 2, "1 band"), "a.tif", "bands", 2),
        # It knows the field alone, or the file alone.
        (FlightError("bands: 2: 1 band", field="bands", value=2, allowed="1 band"), "b.toml", "bands", 2),
        (TerrainError("a.tif: no such file", file="a.tif", allowed="1 band"), "b.toml", "terrain.path", "a.tif"),
    ],
)
def test_an_error_told_of_another_place_keeps_what_it_knows(
    error: PlanflyError, file: str, field: str, value: object
) -> None:
    told = ScenarioError.from_error(error, "b.toml", "terrain.path", "a.tif")
    assert type(told) is ScenarioError
    assert str(told) == f"b.toml: terrain.path: {error}"
    assert (told.file, told.field, told.value, told.allowed) == (file, field, value, "1 band")


def test_an_error_of_another_kind_alone_is_the_same_else() -> None:
    error = TerrainError.at("a.tif", "bands", 2, "1 band")
    again = LogError.from_error(error)
    assert (type(again), str(again), vars(again)) == (LogError, str(error), vars(error))


def test_what_is_not_known_is_empty() -> None:
    error = MissionError("no items")
    assert (error.file, error.field, error.value, error.allowed) == ("", "", None, "")


@pytest.mark.parametrize(
    "error",
    [
        ScenarioError.at("a.toml", "seed", -1, "0 or more"),
        StartError("a.plan", "no progress", field="course", value=1.5),
        LogError("empty"),
    ],
)
def test_errors_come_whole_from_another_process(error: PlanflyError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert (str(again), vars(again)) == (str(error), vars(error))
