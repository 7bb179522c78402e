"""Large logs: what an import takes of the memory, and files that claim too much."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from planfly.cli import main
from tests.logs.importers.big_logs import big_log, claims
from tests.soak import SOAK, at_most, note

MEGABYTE = 2**20
# MB.  What 200 MB of log may take, and what planfly itself takes, whatever the log.
MAX_MEGABYTES, WHOLE, ITSELF = 500.0, 200.0, 270.0
# Not ru_maxrss: a process begins with that of the one that started it.
_CODE = """
import sys
from pathlib import Path
from planfly.cli import main
code = main(["import", sys.argv[1], sys.argv[2], "--overwrite"])
held = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM:"))
print("peak", code, int(held.split()[1]) / 1024.0)
"""


def peak(log: Path, target: Path) -> float:
    """Most memory that importing a log takes, MB."""
    ran = subprocess.run(
        [sys.executable, "-c", _CODE, str(log), str(target)], capture_output=True, text=True, check=True, timeout=3600
    )
    _, code, megabytes = ran.stdout.splitlines()[-1].split()
    assert code in ("0", "4"), ran.stdout
    return float(megabytes)


@pytest.mark.skipif(not SOAK, reason="beside a log of 200 MB: in make soak")
@pytest.mark.skipif(sys.platform != "linux", reason="/proc/self/status is Linux's")
def test_memory_grows_by_less_than_the_log(tmp_path: Path) -> None:
    few, many = (big_log(tmp_path / f"{size}.BIN", size * MEGABYTE) for size in (2, 14))
    # Kernels may have to be compiled first, and that takes memory.
    peak(few, tmp_path / "b.mcap")
    grown = peak(many, tmp_path / "a.mcap") - peak(few, tmp_path / "b.mcap")
    assert grown < 12.0 * (MAX_MEGABYTES - ITSELF) / WHOLE


@pytest.mark.skipif(not SOAK or sys.platform != "linux", reason="takes minutes")
@pytest.mark.parametrize("suffix", [".BIN", ".tlog", ".ulg"])
def test_200_megabytes_take_less_than_500(tmp_path: Path, suffix: str) -> None:
    taken = peak(big_log(tmp_path / f"a{suffix}", round(WHOLE) * MEGABYTE), tmp_path / "a.mcap")
    note(f"memory for 200 MB of {suffix}", megabytes=round(taken))
    assert taken < MAX_MEGABYTES


@pytest.mark.parametrize("suffix", [".BIN", ".tlog", ".ulg", ".igc", ".gpx", ".kml"])
def test_a_log_that_claims_ten_gigabytes_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str
) -> None:
    log = claims(tmp_path / f"a{suffix}", 10 * 2**30)
    began = time.process_time()
    assert main(["check", str(log)]) == 2
    assert time.process_time() - began < at_most(2.0)
    assert (
        capsys.readouterr().err
        == f"planfly: {log}: too large: 10,737,418,240 bytes; the limit is 2,147,483,648 bytes\n"
    )
