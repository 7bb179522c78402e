import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import planfly
from logs.importers.columns.guesses import guess_column_table
from logs.importers.motion_log import read_motion
from tests.logs.importers.columns.column_files import circle, write_log
from world.errors import LogError
from world.files import toml_table

ROOT = Path(__file__).parents[4]
REAL = ROOT / "examples" / "real"


def test_a_guessed_table_reads_the_same_motion(tmp_path: Path) -> None:
    """Names without units; angles in degrees, the force down in g and upwards, the throttle in %."""
    columns = circle()
    renamed = {"t": "time", "ele": "elevator", "ail": "aileron", "thr": "throttle"}
    frame = pd.DataFrame({renamed.get(name, name): values for name, values in columns.items()})
    frame["az"] = -columns["az"] / 9.80665
    frame["az"] += 1e-9 * np.sin(columns["t"])
    frame["ay"] = frame["ax"] = 0.01 * np.sin(columns["t"])
    frame["vd"] = 1e-6 * np.sin(columns["t"])
    frame["roll"] += 0.1 * np.sin(columns["t"])
    for name in ("alt", "pitch", "p", "q", "r", "volt", "amp", "tas"):
        frame[name] += 1e-3 * np.sin(columns["t"])
    (tmp_path / "a").mkdir()
    frame.to_csv(tmp_path / "a" / "flight.csv", index=False)
    guessed = planfly.guess_columns(tmp_path / "a" / "flight.csv", tmp_path / "a" / "flight.columns.toml")
    table = toml_table(guessed.table.read_text())["columns"]
    units = {name: entry["unit"] for name, entry in table.items()}
    assert (units["roll"], units["yaw"], units["latitude"], units["throttle"]) == ("deg", "deg", "deg", "%")
    assert table["acceleration_down"] == {"column": "az", "unit": "g", "frame": "FLU"}
    assert table["airspeed"]["frame"] == "true"
    found, written = read_motion(guessed.table), read_motion(write_log(tmp_path))
    assert found.inertial.values[:, 2] == pytest.approx(written.inertial.values[:, 2])
    assert found.controls.values == pytest.approx(written.controls.values)
    assert found.attitude.values == pytest.approx(written.attitude.values, abs=0.01)


def test_units_are_taken_from_names_and_from_a_row_below_the_header(tmp_path: Path) -> None:
    time = np.arange(0.0, 20.0, 0.1)
    wave = np.sin(time)
    (tmp_path / "a.csv").write_text(
        "Time (ms),Roll_deg,Airspeed [kt],alt,p\n,,,ft,deg/s\n"
        + "".join(f"{1e3 * t},{0.5 * w},{35 + w},{900 + w},{w}\n" for t, w in zip(time, wave, strict=True))
    )
    table = toml_table(guess_column_table([tmp_path / "a.csv"], tmp_path / "columns.toml"))
    assert table["clocks"]["main"] == {"column": "Time (ms)", "unit": "ms"}
    units = {name: entry["unit"] for name, entry in table["columns"].items()}
    assert units == {"roll": "deg", "airspeed": "kt", "altitude": "ft", "roll_rate": "deg/s"}


def test_a_quaternion_is_guessed_without_unit(tmp_path: Path) -> None:
    """The names are those of a topic of PX4; with it, no angle is missing."""
    time = np.arange(0.0, 20.0, 0.1)
    columns = {f"q[{k}]": np.sin(time + k) for k in range(4)}
    pd.DataFrame({"timestamp": 1e6 * time} | columns).to_csv(tmp_path / "a.csv", index=False)
    text = guess_column_table([tmp_path / "a.csv"], tmp_path / "columns.toml")
    table = toml_table(text)
    assert table["clocks"]["main"] == {"column": "timestamp", "unit": "us"}
    assert table["columns"]["quaternion_w"] == {"column": "q[0]", "frame": "NED"}
    assert table["columns"]["quaternion_z"] == {"column": "q[3]"}
    assert "needed by planfly aircraft --identify: roll_rate, pitch_rate" in text


def test_each_guess_is_marked_and_what_is_missing_is_listed(tmp_path: Path) -> None:
    text = guess_column_table([REAL / "thor75" / "thor_flight75.mat"], tmp_path / "columns.toml")
    body = text[text.index("[columns]") :].splitlines()[1:]
    entries = [line for line in body if line and not line.startswith("#")]
    assert len(entries) == 25
    assert all(re.search(r"# guess", line) for line in entries)
    assert re.search(r"# Not found, and optional: .*temperature", text)
    table = toml_table(text)
    # The motor's log at 2 Hz has a clock of its own.
    clock = table["columns"]["current"]["clock"]
    assert table["clocks"][clock] == {
        "column": "flight_data.motor_time",
        "unit": "s",
        "align": {"column": "flight_data.motor_throttle", "with": "throttle"},
    }
    assert table["columns"]["static_pressure"]["unit"] == "kPa"
    assert table["columns"]["latitude"] == {"column": "flight_data.navlat", "unit": "rad"}


def test_two_files_are_aligned_by_a_throttle_that_both_have(tmp_path: Path) -> None:
    time = np.arange(0.0, 60.0, 0.02)
    throttle = 0.5 + 0.4 * np.sign(np.sin(0.3 * time))
    pd.DataFrame({"time": time, "roll": np.sin(time), "dthr": throttle}).to_csv(tmp_path / "a.csv", index=False)
    motor = {"t_ms": 500 * np.arange(80), "throttle_us": 1000.0 + 1000.0 * throttle[::25][:80], "amp": 9.0 + time[:80]}
    pd.DataFrame(motor).to_csv(tmp_path / "motor.csv", index=False)
    table = toml_table(guess_column_table([tmp_path / "a.csv", tmp_path / "motor.csv"], tmp_path / "columns.toml"))
    assert table["columns"]["throttle"] == {"column": "dthr", "unit": "fraction"}
    assert table["columns"]["current"]["clock"] == "motor"
    assert table["clocks"]["motor"] == {
        "file": "motor.csv",
        "column": "t_ms",
        "unit": "ms",
        "align": {"column": "throttle_us", "with": "throttle"},
    }


def test_messages_of_one_file_share_the_clock_of_the_longest(tmp_path: Path) -> None:
    table = toml_table(guess_column_table([REAL / "arduplane2013" / "TestLog2.mat"], tmp_path / "columns.toml"))
    # GPS.TimeMS counts from the start of the week, GPS.T from the start of the vehicle, as all others do.
    assert table["clocks"]["GPS"] == {"column": "GPS.T", "unit": "ms"}
    assert table["columns"]["voltage"]["unit"] == "cV"
    assert not any("align" in clock for clock in table["clocks"].values())


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("table.toml", "expected columns.toml or a name that ends with .columns.toml"),
        ("a.columns.toml", "no column was"),
    ],
)
def test_what_cannot_be_guessed_is_refused(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / "a.csv").write_text("x,y\n1,2\n2,3\n3,4\n")
    with pytest.raises(LogError, match=said):
        planfly.guess_columns(tmp_path / "a.csv", tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
