"""Hostile files, each met by a process of its own: refused in a second and 200 MiB, nothing written or fetched."""

import io
import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import zstandard
from rasterio.transform import Affine

from planfly.cli import main
from tests.logs.made_flight import make_setup, make_track, record
from tests.soak import at_most

ROOT = Path(__file__).parents[3]
MAGIC = b"\x89MCAP0\r\n"
# Runs each command that a line asks for under the limits, in a fork of its own; imports stand before them, since it is
# the file that is limited, not Python.
CHILD = """
import json, os, resource, signal, sys, time, traceback
import logs.verdict.judge_flight, logs.recording.reader, planfly.api.flying, planfly.api.imported
import planfly.api.replaying, planfly.api.reporting, world.raster
from planfly.cli import main
def kib(name):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith(name))
def meet(folder, said, argv):
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(os.path.join(said, name), os.O_CREAT | os.O_TRUNC | os.O_WRONLY), number)
    os.chdir(folder)
    signal.alarm(900)
    before = kib("VmSize:")
    resource.setrlimit(resource.RLIMIT_AS, ((before + 200 * 1024) * 1024,) * 2)
    spent = time.process_time()
    code = main(argv)
    print(json.dumps({"code": code, "seconds": time.process_time() - spent}))
for line in sys.stdin:
    child = os.fork()
    if not child:
        ended = 1
        try:
            meet(*json.loads(line))
            ended = 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(ended)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
Judge = Callable[..., tuple[int, float, str]]


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Judge]:
    """Run planfly in a folder: exit code, seconds of work, what it printed on standard error."""
    said = tmp_path_factory.mktemp("said")
    process = subprocess.Popen(
        [sys.executable, "-c", CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert process.stdin is not None
    assert process.stdout is not None
    asked, answers = process.stdin, process.stdout

    def meet(folder: Path, *argv: str) -> tuple[int, float, str]:
        before = {path: path.stat().st_mtime_ns for path in folder.parent.rglob("*")}
        asked.write(json.dumps([str(folder), str(said), argv]) + "\n")
        asked.flush()
        ended = int(answers.readline())
        out, printed = ((said / name).read_text(encoding="utf-8") for name in ("out", "err"))
        assert ended == 0, printed[-2000:]
        assert {path: path.stat().st_mtime_ns for path in folder.parent.rglob("*")} == before, "a file was written"
        report = json.loads(out.splitlines()[-1])
        return report["code"], report["seconds"], printed

    yield meet
    asked.close()
    assert process.wait(10.0) == 0
    answers.close()


def mcap_record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def bomb() -> bytes:
    """A chunk of some 33 kB that is 1 GiB of zeros."""
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=2**30)
    data = b"".join(compressor.compress(bytes(2**22)) for _ in range(256)) + compressor.flush()
    head = struct.pack("<QQQI", 0, 0, 2**30, 1) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(data))
    return MAGIC + mcap_record(1, bytes(8)) + mcap_record(6, head + data)


def giant() -> bytes:
    """A record that says it is 4 GiB long."""
    return MAGIC + mcap_record(1, bytes(8)) + struct.pack("<BQ", 6, 2**32) + bytes(1000)


def climber() -> bytes:
    """An attachment whose name leads out of any folder."""
    name, data = b"../../x", b"#!/bin/sh\n"
    content = (
        bytes(16) + struct.pack("<I", len(name)) + name + struct.pack("<I", 0) + struct.pack("<Q", len(data)) + data
    )
    return MAGIC + mcap_record(1, bytes(8)) + mcap_record(9, content + struct.pack("<I", zlib.crc32(content)))


@pytest.mark.parametrize(
    ("make", "command"),
    [(bomb, "check"), (bomb, "report"), (giant, "check"), (giant, "replay"), (climber, "check"), (climber, "recover")],
)
def test_hostile_logs(make: Callable[[], bytes], command: str, judge: Judge, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (folder / "x.mcap").write_bytes(make())
    code, seconds, printed = judge(folder, command, "x.mcap")
    assert code == 2
    assert seconds < at_most(1.0)
    assert len(printed.strip().splitlines()) == 1
    assert printed.startswith("planfly: x.mcap: ")


def test_an_attachment_with_a_climbing_name_in_a_whole_log(judge: Judge, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    log = record(tmp_path / "good.mcap", make_setup(), make_track(2.0)).read_bytes()
    # Before the first attachment, so that the rest is a log like any other; its data CRC no longer holds.
    header = len(MAGIC) + 9 + struct.unpack_from("<Q", log, len(MAGIC) + 1)[0]
    evil = climber()[len(MAGIC) + 17 :]
    (folder / "x.mcap").write_bytes(log[:header] + evil + log[header:])
    # A verdict's kernels may have to be compiled first.
    assert main(["check", str(tmp_path / "good.mcap")]) in (0, 4)
    code, seconds, printed = judge(folder, "check", "x.mcap")
    assert code == 3
    assert seconds < at_most(1.0)
    assert "incomplete" in printed


def sparse_tiff(path: Path, side: int, **blocks: Any) -> None:
    """A GeoTIFF without a single block of data, of this many pixels a side."""
    profile = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    transform = Affine(1e-4, 0, 8.0, 0, -1e-4, 46.1)
    profile |= blocks or {"tiled": True}
    with rasterio.open(path, "w", transform=transform, sparse_ok=True, bigtiff="YES", **profile):
        pass


def vrt(path: Path) -> None:
    path.write_text(
        '<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
        "<SourceFilename>/etc/passwd</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>",
        encoding="utf-8",
    )


def claiming_npz(path: Path) -> None:
    """Heights that claim 4 TiB and hold 4 kB."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": (2**20, 2**20)})
    np.savez(path, xmin=8.0, xmax=8.2, ymin=46.0, ymax=46.2)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("elevation.npy", header.getvalue() + bytes(4000))


MISSION = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.05\t8.05\t500\t1\n" + "".join(
    f"{k}\t0\t0\t16\t0\t0\t0\t0\t{46.05 + 0.01 * k:.3f}\t8.05\t700\t1\n" for k in (1, 2)
)


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("bomb.tif", lambda path: sparse_tiff(path, 200_000)),
        ("block.tif", lambda path: sparse_tiff(path, 30_000, blockysize=30_000, compress="deflate")),
        ("claims.npz", claiming_npz),
        ("other.tif", vrt),
        ("other.vrt", vrt),
        ("http://127.0.0.1:9/x.tif", None),
        ("/vsicurl/http://127.0.0.1:9/x.tif", None),
    ],
)
def test_hostile_terrain(name: str, make: Callable[[Path], None] | None, judge: Judge, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (folder / "m.waypoints").write_text(MISSION, encoding="utf-8")
    if make is not None:
        make(folder / name)
    code, seconds, printed = judge(folder, "check", "m.waypoints", "--terrain", name)
    assert code == 2, printed
    assert seconds < at_most(1.0)
    assert name in printed
    assert len([line for line in printed.strip().splitlines() if not line.startswith("warning: ")]) == 1
