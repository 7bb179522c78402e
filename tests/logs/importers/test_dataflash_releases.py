"""What other releases of ArduPilot log in another way, and what real vehicles log that simulated ones do not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from logs.importers.dataflash_log import read_dataflash
from logs.importers.raw_log import RawLog
from tests.logs.importers.written_logs import DataflashWriter

SECOND = 1_000_000


def read(tmp_path: Path, *messages: tuple[Any, ...], program: str = "ArduPlane V4.5.7 (x)") -> RawLog:
    """Ten places a second apart, and other messages before them."""
    out = DataflashWriter()
    out.message("MSG", "QZ", "TimeUS,Message", 0, program)
    for message in messages:
        out.message(*message)
    for k in range(10):
        out.message("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", k * SECOND, 46.0, 8.0 + 1e-4 * k, 500.0, 0.0)
    path = tmp_path / "a.BIN"
    path.write_bytes(bytes(out.data))
    return read_dataflash(path)


@pytest.mark.parametrize("column", ["I", "Inst", "Instance"])
def test_of_several_batteries_the_first_counts(tmp_path: Path, column: str) -> None:
    """ArduPilot has called the number of a battery by three names."""
    batteries = [
        ("BAT", "QBfff", f"TimeUS,{column},Volt,Curr,EnrgTot", k * SECOND, one, 24.0, 10.0 + 30.0 * one, 0.1 * k + one)
        for k in range(10)
        for one in (0, 1)
    ]
    battery = read(tmp_path, *batteries).series["battery"]
    assert battery.values[:, 0].tolist() == [10.0] * 10
    assert battery.values[:, 1] == pytest.approx(0.1 * np.arange(10.0), abs=1e-6)


@pytest.mark.parametrize(
    ("program", "vehicle"),
    [
        ("APM:Plane V3.8.5 (1a2b)", "plane"),
        ("APM:Copter V3.5.5 (1a2b)", "copter"),
        ("ArduPlane V4.6.0beta3 (1a2b)", "plane"),
        ("ArduCopterNotes", "unknown"),
    ],
)
def test_the_program_is_told_by_each_of_its_names(tmp_path: Path, program: str, vehicle: str) -> None:
    assert read(tmp_path, program=program).vehicle == vehicle


def test_a_week_from_before_the_first_fix_is_not_the_day(tmp_path: Path) -> None:
    """Week 2300 begins on 2024-02-04; a receiver that is just on says it is 2019."""
    form = ("GPS", "QBIHLLf", "TimeUS,Status,GMS,GWk,Lat,Lng,Alt")
    raw = read(tmp_path, (*form, 0, 1, 0, 2045, 0.0, 0.0, 0.0), (*form, SECOND, 3, 10_000, 2300, 46.0, 8.0, 500.0))
    # 19,757 days after 1970, ten seconds into the week, less a second of the log and 18 leap seconds.
    assert raw.utc_start == pytest.approx(19_757 * 86_400 + 10.0 - 1.0 - 18.0)


def test_modes_of_quadplanes_and_of_later_releases_have_names(tmp_path: Path) -> None:
    form = ("MODE", "QBBB", "TimeUS,Mode,ModeNum,Rsn")
    modes = [(*form, k, number, number, 1) for k, number in enumerate((21, 10, 19, 99))]
    assert [(mode.name, mode.automatic) for mode in read(tmp_path, *modes).modes] == [
        ("QRTL", False),
        ("AUTO", True),
        ("QLOITER", False),
        ("mode 99", False),
    ]


def test_places_from_before_the_first_fix_are_none(tmp_path: Path) -> None:
    """A fallback to the receiver takes rows with a fix in three dimensions alone."""
    out = DataflashWriter()
    for k in range(12):
        place = (46.0, 8.0 + 1e-4 * k, 500.0) if k > 3 else (0.0, 0.0, 17.0)
        out.message("GPS", "QBLLf", "TimeUS,Status,Lat,Lng,Alt", k * SECOND, 3 if k > 3 else 1, *place)
    path = tmp_path / "a.BIN"
    path.write_bytes(bytes(out.data))
    assert read_dataflash(path).series["position"].time.tolist() == [float(k) for k in range(4, 12)]
