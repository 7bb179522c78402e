"""``planfly replay --movie``: files that hold the frames, the same each time, and refusals in a line."""

import json
import os
import stat
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image, ImageColor

from logs import theme
from logs.recording.reader import FlightLog, read_log
from logs.views.replay.movie_frames import RATE, MovieFrames
from planfly.cli import main
from tests.logs.made_flight import make_setup, make_track, record


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("movie") / "a.mcap", make_setup(), make_track())


@pytest.fixture(scope="module")
def log(log_path: Path) -> FlightLog:
    return read_log(log_path)


@pytest.fixture(scope="module")
def wanted(log: FlightLog) -> list[np.ndarray]:
    """The film's frames, of a minute a second."""
    return list(MovieFrames(log.setup, log.track, 0.0, log.end_time, 60.0).frames())


def test_a_gif_holds_the_frames(
    wanted: list[np.ndarray], log_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "film.gif"
    command = ["replay", str(log_path), "--movie", str(target), "--speed", "60"]
    assert main(command) == 0
    assert f"movie     {target}" in capsys.readouterr().out
    with Image.open(target) as film:
        assert film.n_frames == len(wanted)
        film.seek(len(wanted) - 1)
        last = np.asarray(film.convert("RGB")).astype(int)
    # 255 colours instead of all: near everywhere, and the trail is where it was.
    assert np.abs(last - wanted[-1]).mean() < 4.0
    # What is drawn keeps its colour to the bit: aircraft, trail, path, start and destination, radars.
    for name in ("aircraft", "flown", "planned", "highlight"):
        colour = theme.colour(name)
        there = (wanted[-1] == ImageColor.getrgb(colour)).all(axis=2)
        assert there.sum() > 20, colour
        np.testing.assert_array_equal(last[there], wanted[-1][there])
    first = target.read_bytes()
    assert main(command) == 2
    assert "exists; --overwrite replaces it" in capsys.readouterr().err
    assert main([*command, "--overwrite"]) == 0
    assert target.read_bytes() == first


def test_a_folder_takes_the_frames(log_path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    command = ["replay", str(log_path), "--movie", str(folder), "--speed", "24", "--from", "2"]
    assert main([*command, "--to", "6"]) == 0
    assert sorted(file.name for file in folder.iterdir()) == ["frame-0000.png", "frame-0001.png", "frame-0002.png"]
    assert main([*command, "--to", "4", "--overwrite"]) == 0
    assert len(list(folder.iterdir())) == 2
    (folder / "mine.txt").write_text("kept", encoding="utf-8")
    assert main([*command, "--to", "6"]) == 2
    assert (folder / "mine.txt").exists()


@pytest.mark.parametrize(
    ("target", "more", "message"),
    [
        ("film.avi", (), "expected .gif, .mp4 or a folder"),
        ("film.mp4", (), "film.mp4: an .mp4 needs ffmpeg (a .gif or a folder does not), or the extra 'films'"),
        ("none/film.gif", (), "does not exist"),
        ("film.gif", ("--speed", "0.001"), "frames: at most 5,000 are allowed; raise --speed"),
        ("film.gif", ("--foxglove",), "expected only one of them"),
        ("film.gif", ("--to", "127.0.0.1:9"), "expected only one of them"),
    ],
)
def test_what_cannot_be_filmed(
    target: str,
    more: tuple[str, ...],
    message: str,
    log_path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.chdir(tmp_path)
    assert main(["replay", str(log_path), "--movie", target, *more]) == 2
    printed = capsys.readouterr().err.strip().splitlines()
    assert message in printed[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("extra", [False, True])
def test_an_mp4_is_what_ffmpeg_makes_of_the_frames(
    extra: bool,
    wanted: list[np.ndarray],
    log_path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A program in place of ffmpeg, on the path or of the extra, keeps its arguments and its input."""
    fake = tmp_path / "ffmpeg"
    fake.write_text(
        f"#!{sys.executable}\nimport json, pathlib, sys\n"
        f"pathlib.Path({str(tmp_path / 'told.json')!r}).write_text(json.dumps(sys.argv[1:]))\n"
        "pathlib.Path(sys.argv[-1]).write_bytes(sys.stdin.buffer.read())\n",
        encoding="utf-8",
    )
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    if extra:
        monkeypatch.setenv("PATH", str(tmp_path / "none"))
        module = ModuleType("imageio_ffmpeg")
        module.__spec__ = ModuleSpec("imageio_ffmpeg", None)
        module.get_ffmpeg_exe = lambda: str(fake)  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", module)
    else:
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    target = tmp_path / "film.mp4"
    assert main(["replay", str(log_path), "--movie", str(target), "--speed", "60"]) == 0
    assert target.read_bytes() == b"".join(frame.tobytes() for frame in wanted)
    told = json.loads((tmp_path / "told.json").read_text(encoding="utf-8"))
    assert f"{wanted[0].shape[1]}x{wanted[0].shape[0]}" in told
    assert told[told.index("-r") + 1] == str(RATE)
    fake.write_text(f"#!{sys.executable}\nimport sys\nsys.exit('Unknown encoder')\n", encoding="utf-8")
    assert main(["replay", str(log_path), "--movie", str(target), "--speed", "60", "--overwrite"]) == 1
    assert "ffmpeg: status 1: Unknown encoder" in capsys.readouterr().err
    assert target.stat().st_size > 1000
