"""`planfly aircraft --identify`: from a log to a folder that flies, and what is refused."""

import shutil
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import load_aircraft, read_aircraft
from aircraft.identification.estimate import Estimate
from aircraft.identification.flight_record import FlightRecord
from aircraft.uncertainty import read_draws, read_uncertainty
from flight.dynamics.fdm import Fdm
from logs.importers.motion import MotionLog, Samples
from logs.views.report import identification
from planfly.api import identifying
from planfly.api.identifying import find_logs_without_current, find_slow_logs
from planfly.cli import main
from planfly.identification.records import MIN_HZ, find_slowest_log_rate
from tests.aircraft.identification.flown_truth import TRUTH, flown_truth
from tests.instrumented_flights import PX4_PARAMETERS, px4_topics, short_motion, write_motion, write_px4
from tests.soak import SOAK
from world.errors import LogError

ARGUMENTS = ["--mass", "13.2", "--span", "2.8956", "--area", "0.55"]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@cache
def log_bytes() -> bytes:
    log = flown_truth().log
    return write_motion(Path("a.BIN"), log if SOAK else start_of(log, 240.0)).read_bytes()


def start_of(log: MotionLog, seconds: float = 200.0) -> MotionLog:
    """The first seconds of a log: three minutes are the least that is taken."""
    end = float(log.inertial.time[0]) + seconds
    kinds = {field.name: getattr(log, field.name) for field in fields(log)}
    kept = {
        name: Samples(one.time[one.time < end], one.values[one.time < end])
        for name, one in kinds.items()
        if isinstance(one, Samples)
    }
    return replace(log, **kept)


def identify(*more: str) -> int:
    return main(["aircraft", "--identify", "a.BIN", *ARGUMENTS, "--out", "./mine", *more])


def test_a_log_becomes_a_folder_that_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # The page is looked at in its own tests.
    monkeypatch.setattr(identification, "draw_pictures", lambda charts: {f"{name}.png": b"" for name in charts})
    Path("a.BIN").write_bytes(log_bytes())
    # The start of the same flight as PX4 would have logged it.
    write_px4(Path("b.ulg"), px4_topics(start_of(flown_truth().log, 60.0)), PX4_PARAMETERS)
    assert identify("--battery", "44.4V,888Wh", "--check", "b.ulg") == 0
    said = capsys.readouterr().out
    assert "at cruise" in said
    folder = tmp_path / "mine"
    assert {file.name for file in folder.iterdir()} >= {
        *("mine.xml", "mine.toml", "gains.toml", "ardupilot.parm", "ardupilot.toml", "posterior.toml", "draws.csv"),
        "identify.waypoints",
    }
    made = read_aircraft(folder)
    assert made.mass == pytest.approx(13.2)
    draws = read_draws(folder / "draws.csv")
    known = read_uncertainty(folder)
    assert known is not None
    assert draws.values.shape == (512, len(known.quantities))
    assert draws.names == tuple(one.name for one in known.quantities)
    truth = TRUTH.parameters()
    for k, one in enumerate(known.quantities):
        assert abs(one.estimate - truth[one.name.removeprefix("ident/")]) < 3.0 * one.sd, one.name
        # Draws stay within bounds, which cut what a log does not show.
        assert 0.6 * one.sd < draws.values[:, k].std() < 1.15 * one.sd, one.name
        # The model's own value is the estimate.
        assert Fdm(made).properties.getter(one.name)() == pytest.approx(one.estimate, abs=1e-5)
    joint = np.corrcoef(draws.values.T)
    thrust, speed = (draws.names.index(f"ident/{name}") for name in ("thrust", "motor-speed"))
    assert joint[thrust, speed] < -0.5
    # A minute of check: far nearer than the base, whose ailerons and mass are others.
    rows = [line.split(":") for line in said.splitlines() if line.strip().startswith("ahead") and "roll rate" in line]
    assert [model.split()[1] for model, _ in rows] == ["constant", "aerosonde", "identified"]
    roll = [float(errors.split("roll rate ")[1].split(",")[0]) for _, errors in rows]
    assert roll[2] < 0.5 * roll[1] < roll[0]
    assert "predictions on b.ulg" in said
    # Nothing of the mission is beyond the model; of some minutes of log its slopes may stay undecided.
    assert main(["check", "mine/identify.waypoints", "--aircraft", "./mine"]) in (0, 3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--identify", "a.BIN", "--span", "2.9", "--out", "./mine"], "--identify needs --mass"),
        (["--identify", "a.BIN", "--mass", "13", "--span", "2.9"], "--identify needs --out, the folder to make"),
        (["--identify", "no.BIN", *ARGUMENTS, "--out", "./mine"], "no.BIN: no such file"),
        (["--identify", "a.BIN", *ARGUMENTS, "--cruise", "20", "--out", "./mine"], "cannot be combined with --cruise"),
        (
            ["--identify", "a.BIN", *ARGUMENTS, "--params", "a.parm", "--out", "./mine"],
            "cannot be combined with --params",
        ),
        (["--identify", "a.BIN", *ARGUMENTS, "--from", "x8", "--out", "./mine"], "--base names the aircraft"),
        (
            ["--identify", "a.BIN", *ARGUMENTS, "--motor-braking", "--out", "./mine"],
            "cannot be combined with --motor-braking",
        ),
        (["--identify", "a.BIN", "--mass", "2", "--span", "2.9", "--out", "./mine"], "with the base aerosonde"),
        (["--identify", "a.BIN", "--mass", "99", "--span", "2.9", "--out", "./mine"], "allowed 0.3..50 kg"),
        (["--identify", "a.BIN", *ARGUMENTS, "--battery", "12", "--out", "./mine"], "volts and capacity"),
        (
            ["--identify", "a.BIN", *ARGUMENTS, "--base", "c172x", "--out", "./mine"],
            "--base c172x: expected an electric aircraft",
        ),
        (
            ["--identify", "a.BIN", *ARGUMENTS, "--out", "./mine"],
            "0 s of usable wing-borne flight: at least 180 s are needed to identify an aircraft, and 30 s to check one",
        ),
        (["aerosonde", "--check", "a.BIN"], "only with --identify"),
        (["--new", "./mine", "--mass", "2", "--until", "20"], "only with --identify"),
        (["--new", "./mine", "--mass", "2", "--out", "./elsewhere"], "--out: --new names the folder"),
        (["--new", "./mine", "--mass", "2", "--motor-braking"], "--motor-braking: it is an option for flights"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_motion(Path("a.BIN"), replace(short_motion(), parameters={"AIRSPEED_MIN": 18.0}))
    assert main(["aircraft", *arguments]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("planfly: ")]
    assert len(lines) == 1
    assert said in lines[0]
    assert not Path("mine").exists()


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is said, in one line, of input that is refused, with nothing written."""
    assert main(["aircraft", *arguments]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("planfly: ")]
    assert not Path("mine").exists()
    return line


def test_an_identified_aircraft_is_no_base(capsys: pytest.CaptureFixture[str]) -> None:
    """Its motor's factors are properties of its model, which the numbers of a base leave out."""
    shutil.copytree(load_aircraft("aerosonde").folder, "known", ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    for file in Path("known").glob("aerosonde.*"):
        file.rename(file.with_stem("known"))
    Path("known/posterior.toml").write_text('base = "aerosonde"\n', encoding="utf-8")
    write_motion(Path("a.BIN"), short_motion())
    said = refused(["--identify", "a.BIN", *ARGUMENTS, "--base", "./known", "--out", "./mine"], capsys)
    assert "--base ./known: this aircraft was itself identified from flight logs; name the --base that its" in said


def test_only_the_rows_before_until_are_used(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The estimate sees no row after `--until`, in s of the log; too few rows before it are refused by its name."""
    seen: list[FlightRecord] = []

    def note(records: list[FlightRecord], _base: object, *, dynamics: bool) -> Estimate:
        seen.extend(records)
        raise LogError(f"noted with dynamics {dynamics}")

    monkeypatch.setattr(identifying, "estimate_model", note)
    log = start_of(flown_truth().log, 240.0)
    write_motion(Path("a.BIN"), log)
    end = float(log.inertial.time[0]) + 220.0
    assert "noted" in refused(["--identify", "a.BIN", *ARGUMENTS, "--until", f"{end}", "--out", "./mine"], capsys)
    last = max(float(record.time[-1]) for record in seen)
    # Rows are 0.02 s apart.
    assert end - 0.05 < last < end
    message = refused(["--identify", "a.BIN", *ARGUMENTS, "--until", "100", "--out", "./mine"], capsys)
    assert "s of usable wing-borne flight before 100 s: at least 180 s" in message


@pytest.mark.parametrize("again", [["--identify", "a.BIN", "b.BIN"], ["--identify", "a.BIN", "--check", "b.BIN"]])
def test_the_same_log_twice_is_refused(again: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    write_motion(Path("a.BIN"), short_motion())
    shutil.copy("a.BIN", "b.BIN")
    said = refused([*again, *ARGUMENTS, "--out", "./mine"], capsys)
    assert "b.BIN: has the same bytes as a.BIN: name each log only once" in said


def test_logs_without_current_among_others_are_named() -> None:
    def record(source: str, amperes: float) -> FlightRecord:
        one, two, three, four = (np.zeros((5, n)) for n in (1, 2, 3, 4))
        flat = one[:, 0]
        return FlightRecord(
            flat, three, three, three, three, two, flat, flat, flat, four, flat + amperes, flat, source=source
        )

    known, unknown = record("a.BIN", 3.0), record("b.BIN", np.nan)
    assert find_logs_without_current([known, unknown, unknown]) == ("b.BIN",)
    assert find_logs_without_current([known, known]) == find_logs_without_current([unknown, unknown]) == ()


def test_logs_with_few_rows_are_named_with_what_records_more() -> None:
    """PX4's default set has what is told to the surfaces ten times a second, more or less: still enough for moments."""
    log = short_motion()
    time = np.arange(0.0, 4.0, 0.1003)
    few = Samples(time, np.zeros((len(time), 4)))
    px4 = replace(log, source="b.ulg", program_kind="px4", controls=few)
    assert find_slow_logs([log]) == ()
    (slow,) = find_slow_logs([log, px4])
    assert (slow.source, slow.setting) == ("b.ulg", "SDLOG_PROFILE 17")
    assert slow.hertz == pytest.approx(9.97, abs=0.01)
    assert slow.hertz >= MIN_HZ
    thin = replace(log, outputs=Samples(log.outputs.time[::4], log.outputs.values[::4]))
    (slow,) = find_slow_logs([thin])
    assert slow.setting == "LOG_BITMASK 65535"
    assert slow.hertz == pytest.approx(6.25)
    assert find_slowest_log_rate(thin) < MIN_HZ


@pytest.mark.parametrize(("hertz", "dynamics"), [(50.0, True), (10.0, True), (9.6, True), (9.4, False)])
def test_moments_are_estimated_from_10_rows_a_second(
    monkeypatch: pytest.MonkeyPatch, hertz: float, dynamics: bool
) -> None:
    """Ten a second exactly are enough, and so is what a clock makes of them; of fewer, lift, drag and thrust alone."""
    asked: list[bool] = []

    def noted(_records: object, _base: object, *, dynamics: bool) -> Estimate:
        asked.append(dynamics)
        raise LogError("far enough")

    monkeypatch.setattr(identifying, "estimate_model", noted)
    log = start_of(flown_truth().log)

    def at(samples: Samples) -> Samples:
        time = np.arange(samples.time[0], samples.time[-1], 1.0 / hertz)
        return Samples(time, np.column_stack([np.interp(time, samples.time, one) for one in samples.values.T]))

    outputs = at(log.outputs)
    slow = (replace(log, inertial=at(log.inertial)), replace(log, outputs=replace(outputs, values=outputs.values // 1)))
    for one in slow:
        write_motion(Path("slow.BIN"), one)
        assert main(["aircraft", "--identify", "slow.BIN", *ARGUMENTS, "--out", "./mine"]) == 2
    assert asked == [dynamics, dynamics]
    assert not Path("mine").exists()
