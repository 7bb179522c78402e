"""Damaged copies of each format: refused in a line, or read with every loss stated."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import ImportedLog
from logs.importers.raw_log import example_raw_log
from logs.recording.reader import read_log
from planfly.cli import main
from tests.logs.importers.damaged_copies import damaged
from tests.logs.importers.written_logs import BEGAN, dataflash, gpx, igc, kml, px4, telemetry
from tests.planfly.commands.imported_log_files import example_plan
from tests.soak import note, scaled

Output = pytest.CaptureFixture[str]
WRITERS: dict[str, Callable[[Path], Path]] = {
    "a.BIN": dataflash,
    "a.tlog": telemetry,
    "a.ulg": px4,
    "a.gpx": gpx,
    "a.igc": igc,
    "a.kml": partial(kml, in_turn=True),
}
# Of what their clocks begin with.
TRACKS = ("a.gpx", "a.igc", "a.kml")
# Rows were written for so long, s.
TIMES = example_raw_log().series["position"].time


def untold(name: str, time: np.ndarray, source: ImportedLog, out: str) -> str:
    """A stretch of over a second that is missing from the rows (n,) and that the result does not tell; "" for none."""
    known = {(round(gap.start, 6), round(gap.end, 6)) for gap in source.gaps}
    for start, end in zip(time[:-1].tolist(), time[1:].tolist(), strict=True):
        if end - start > 1.0 + 1e-6 and (round(start, 6), round(end, 6)) not in known:
            return f"{start} to {end} s"
    if known and " gap" not in out:
        return "gaps that are not in words"
    if source.faults.clock_jumps:
        return "" if "clock jump" in out else "a clock jump"
    begin, end = float(TIMES[0]), float(np.floor(TIMES[-1])) if name in TRACKS else float(TIMES[-1])
    if name in TRACKS:
        begin, end = BEGAN.timestamp(), BEGAN.timestamp() + end - begin
        time = time + source.utc_start
    said = "Lost: " in out or "without a position" in out
    if float(time[0]) > begin + 1.0 and not said and "the log begins in flight" not in out:
        return f"the beginning, to {time[0]} s"
    if float(time[-1]) < end - 1.0 and not said and "the log ends in flight" not in out:
        return f"the end, from {time[-1]} s on"
    return ""


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_copies_are_refused_or_told(tmp_path: Path, capsys: Output, name: str) -> None:
    data, suffix = WRITERS[name](tmp_path / name).read_bytes(), Path(name).suffix
    log, target = tmp_path / f"copy{suffix}", tmp_path / "copy.mcap"
    # A track holds no mission; a route and a task may be what was damaged.
    plan = ["--plan", str(example_plan(tmp_path))] if name == "a.kml" else []
    # Whole, it may have kernels compiled, which is told.
    assert main(["import", str(tmp_path / name), str(target), *plan]) in (0, 3)
    capsys.readouterr()
    codes: list[int] = []
    for seed in range(scaled(1000, 5)):
        log.write_bytes(damaged(data, seed, suffix))
        code = main(["import", str(log), str(target), "--overwrite", *plan])
        out, err = capsys.readouterr()
        codes.append(code)
        assert code in (0, 2, 3, 4), (seed, err)
        if code == 2:
            assert err.startswith("planfly: "), seed
            assert err.count("\n") == 1, (seed, err)
            continue
        assert err == "", seed
        flown = read_log(target)
        source = flown.setup.imported_log
        assert source is not None
        # What is told is what was found.
        assert ("Lost: " in out) == (source.damage.lossy or source.damage.cut), seed
        # A flight whose log pauses for long is judged as far as it is seen.
        assert (code == 3) == (source.damage.lossy or out.startswith("not judged from ")), (seed, out)
        assert untold(name, flown.track.time, source, out) == "", (seed, out)
    assert set(codes) & {0, 3, 4}, "none was read"
    refused = codes.count(2)
    note(f"imported logs: damaged {name}", copies=len(codes), refused=refused, judged=len(codes) - refused, silent=0)
