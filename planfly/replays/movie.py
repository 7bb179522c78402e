"""Write the frames of a flight as a GIF, an MP4 or a folder of PNG files."""

import contextlib
import errno
import io
import itertools
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageColor

from logs.recording.reader import FlightLog
from logs.theme import palette_colours
from logs.views.replay.movie_frames import RATE, MovieFrames
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_file, check_output_folder
from world.errors import PlanflyError
from world.extras import require_extra
from world.files import temporary_folder, write_atomically

# Duration of a film without a given speed, s.
_DEFAULT_DURATION_S = 20.0
_MAX_FRAMES = 5000
# Duration of the last frame of a GIF, ms.
_LAST_FRAME_MS = 2000
# Color number of transparent pixels, which show the previous frame.
_TRANSPARENT = 255
SUFFIXES = (".gif", ".mp4")


def write_movie(
    log: FlightLog, target: Path, start: float, end: float, *, speed: float | None, overwrite: bool
) -> list[Path]:
    """Write a film of a flight as a .gif or .mp4 file, or as a folder of frame-0000.png and so on.

    Return the files.

    start, end: start and end in flight time, s.
    speed: multiple of real time; None for a film of 20 s.
    Raises PlanflyError for a target that exists, too many frames, and an .mp4 without ffmpeg and the extra ``films``.
    """
    kind = target.suffix.lower()
    if kind in SUFFIXES:
        check_output_file(target, overwrite)
    elif kind:
        allowed = f"expected {', '.join(SUFFIXES)} or a folder"
        raise PlanflyError.of_argument("movie", kind, allowed, shown="", file=target)
    else:
        check_output_folder(target, overwrite)
    # ffmpeg, installed or from the extra `films`.
    program = shutil.which("ffmpeg") if kind == ".mp4" else ""
    if program is None:
        require_extra("films", f"{target}: an .mp4 needs ffmpeg (a .gif or a folder does not), or")
        from imageio_ffmpeg import get_ffmpeg_exe

        program = str(get_ffmpeg_exe())
    film = MovieFrames(log.setup, log.track, start, end, speed or max(1.0, (end - start) / _DEFAULT_DURATION_S))
    if len(film) > _MAX_FRAMES:
        allowed = f"{len(film):,} frames: at most {_MAX_FRAMES:,} are allowed; raise `speed`"
        raise PlanflyError.of_argument("movie", len(film), allowed, shown="", file=target)
    if not kind:
        target.mkdir(parents=True, exist_ok=True)
        for old_file in target.glob("frame-[0-9][0-9][0-9][0-9].png"):
            old_file.unlink()
        files = []
        for number, image in enumerate(_yield_frames(film)):
            data = io.BytesIO()
            image.save(data, "PNG")
            files.append(target / f"frame-{number:04d}.png")
            write_atomically(files[-1], data.getvalue())
        return files
    write_atomically(target, _encode_gif(film) if kind == ".gif" else _encode_mp4(film, program))
    return [target]


def _yield_frames(film: MovieFrames) -> Iterator[Image.Image]:
    """Yield the frames of a film as images, and report the progress."""
    with stage("drawing", "drawing frames") as advance:
        for number, frame in enumerate(film.frames(), 1):
            yield Image.fromarray(frame)
            advance(number, len(film), f"frame {number} of {len(film)}")


def _apply_palette(frame: Image.Image, palette: Image.Image) -> Image.Image:
    """Return a frame with each colour replaced by the nearest colour of a palette.

    Transparent pixels of the palette are not used.
    """
    image = frame.quantize(palette=palette, dither=Image.Dither.NONE)
    numbers = np.asarray(image)
    opaque = Image.fromarray(np.where(numbers == _TRANSPARENT, 0, numbers).astype(np.uint8))
    opaque.putpalette(palette.getpalette() or [])
    return opaque


def _encode_gif(film: MovieFrames) -> bytes:
    """Return a film encoded as GIF, with one palette.

    Each frame contains only the pixels that differ from the frame before.
    """
    images = _yield_frames(film)
    first_frame = next(images)
    # The palette has the exact drawing colours, and the main colours of the first frame. If all colours were chosen by
    # area, thin lines and small marks would get the colours of the ground.
    drawing_colours = [ImageColor.getrgb(colour)[:3] for colour in palette_colours()]
    blended_palette = (
        first_frame.quantize(_TRANSPARENT - len(drawing_colours), dither=Image.Dither.NONE).getpalette() or []
    )
    entries = [component for colour in drawing_colours for component in colour] + blended_palette[
        : 3 * (_TRANSPARENT - len(drawing_colours))
    ]
    palette_image = Image.new("P", (1, 1))
    # The rest of the 256 entries repeats the first entry.
    palette_image.putpalette(entries + entries[:3] * (256 - len(entries) // 3))
    palette = palette_image
    first_image = _apply_palette(first_frame, palette)
    previous, later_images = np.asarray(first_image), []
    for image in images:
        current = np.asarray(_apply_palette(image, palette))
        later_images.append(Image.fromarray(np.where(current == previous, _TRANSPARENT, current).astype(np.uint8)))
        later_images[-1].putpalette(first_image.getpalette() or [])
        later_images[-1].info["transparency"] = _TRANSPARENT
        previous = current
    data = io.BytesIO()
    durations = [round(1000 / RATE)] * len(later_images) + [_LAST_FRAME_MS]
    first_image.save(
        data,
        "GIF",
        save_all=True,
        append_images=later_images,
        duration=durations,
        loop=0,
        optimize=False,
        disposal=1,
        transparency=_TRANSPARENT,
    )
    return data.getvalue()


def _encode_mp4(film: MovieFrames, program: str) -> bytes:
    """Return a film encoded as MP4 by ffmpeg.

    program: path of ffmpeg.
    Raises OSError with the last line of ffmpeg's output if ffmpeg fails.
    """
    frames = film.frames()
    first_frame = next(frames)
    height, width = first_frame.shape[:2]
    with temporary_folder("planfly-movie-") as folder, tempfile.TemporaryFile() as messages:
        out = folder / "film.mp4"
        command = [
            program,
            "-loglevel",
            "error",
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-s",
            f"{width}x{height}",
            "-r",
            str(RATE),
            "-i",
            "-",
            "-pix_fmt",
            "yuv420p",
            "-movflags",
            "+faststart",
            str(out),
        ]
        with (
            stage("drawing", "drawing frames") as advance,
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages) as encoder,
        ):
            encoder_input = encoder.stdin
            # If ffmpeg ends early, its status gives the reason.
            with contextlib.suppress(BrokenPipeError):
                for number, frame in enumerate(itertools.chain([first_frame], frames), 1):
                    if encoder_input is not None:
                        encoder_input.write(frame.tobytes())
                    advance(number, len(film), f"frame {number} of {len(film)}")
                if encoder_input is not None:
                    encoder_input.close()
            status = encoder.wait()
        messages.seek(0)
        lines = messages.read().decode("utf-8", "replace").strip().splitlines()
        if status or not out.exists():
            raise OSError(errno.EIO, f"status {status}: {lines[-1] if lines else 'no message'}", "ffmpeg")
        return out.read_bytes()
