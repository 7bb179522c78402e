"""Check output files and folders, and remove old results of planfly.

Other files are never overwritten.
"""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from world.errors import PlanflyError
from world.files import write_atomically

# Default folder of results.
RESULTS = Path("runs")
# Pattern of the default folder of a run, in which {name} is the name of the scenario or mission.
RUN_FOLDER = "runs/{name}-seed{seed}"
# Default log of a flight as a pattern, in a folder that no run writes its pictures to.
FLY_LOG = "runs/{name}-fly-seed{seed}/flight.mcap"

# Files of `planfly.run`.
RUN_FILES = (
    "plan.json",
    "mission.waypoints",
    "mission.plan",
    "mission.rally",
    "mission.parm",
    "flight.mcap",
    "flight.BIN",
    "flight.ulg",
    "verdict.json",
    "map.png",
    "profile.png",
    "report.html",
)
# Names of the figures of a report, as in `logs.views.figures.FIGURES`.
REPORT_FIGURES = (
    *("map", "profile", "scene", "turns", "returns", "worst-returns", "return-heights", "glide", "survey"),
    *("link-map", "link", "time", "exposure", "controls", "energy", "envelope"),
)
# Files of a report, including all figures as PNG and SVG.
LOG_FIGURES = ("report.html", *(f"{name}.{kind}" for name in REPORT_FIGURES for kind in ("png", "svg")))
# Files of `planfly.compare`.
COMPARE_FILES = (
    *(f"compare-{name}.{kind}" for kind in ("png", "svg") for name in ("map", "profile")),
    "compare.html",
)
# Files of `planfly.survey`, with the picture of the lines, and the missions and parameters of the remedies.
SURVEY_FILES = (
    "survey.png",
    *(
        f"{remedy}.{kind}"
        for remedy in ("trigger", "height", "side", "turn-around", "gates", "every", "course", "parameter", "airspeed")
        for kind in ("waypoints", "plan")
    ),
    "parameter.param",
    "parameter.params",
)
# Maximum number of returns that an autopilot program may fly.
MAX_BY_PROGRAM = 20
# Files of `planfly.returns`.
RETURN_FILES = (
    *(f"{name}.png" for name in ("returns", "worst-returns", "return-heights", "glide")),
    "returns.kml",
    "returns.mcap",
    *(f"worst-return-{k}{suffix}" for k in range(1, MAX_BY_PROGRAM + 1) for suffix in (".mcap", ".BIN")),
)
# Maximum number of parts of a flight that are flown again.
MAX_REFLOWN_PARTS = 9
# Files of each part that is flown again, numbered from the second part on.
REFLY_FILES = tuple(
    name
    for ending in ("", *(f"-{number}" for number in range(2, MAX_REFLOWN_PARTS + 1)))
    for name in (
        f"simulated{ending}.mcap",
        *(f"refly-{kind}{ending}.png" for kind in ("cross-track", "height", "ground-speed", "bank", "energy")),
    )
)


# Files that `planfly predict` writes.
PREDICT_FILES = ("predict.html", "predict.png")


def check_output_file(
    path: Path, overwrite: bool, source: Path | None = None, *, suffix: str = "", folder_must_exist: bool = True
) -> None:
    """Raise PlanflyError if an output file cannot or must not be written.

    The path must not be the input file, a folder, or a file in a missing folder; without `overwrite` it must not exist.

    source: the input file, or None.
    suffix: suffix that the file must have, because its format does not depend on its name; "" for any suffix.
    folder_must_exist: False if the caller makes the folder.
    """
    if suffix and path.suffix.lower() != suffix:
        allowed = f"expected a {suffix} file; planfly.export writes other formats"
        raise PlanflyError(f"{path}: {allowed}", file=path, field="suffix", value=path.suffix, allowed=allowed)
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        raise PlanflyError(f"{path}: is the input file; name another output file", file=path)
    if path.is_dir():
        raise PlanflyError(f"{path}: is a folder; expected a file name", file=path)
    if path.exists() and not overwrite:
        raise PlanflyError(f"{path}: exists; overwrite=True replaces it", file=path)
    if folder_must_exist and not path.parent.exists():
        raise PlanflyError(f"{path}: the folder {path.parent} does not exist", file=path)


def check_output_folder(folder: Path, overwrite: bool) -> None:
    """Raise PlanflyError if an output folder cannot or must not be written.

    The path must not be a file or below a file, and the folder must be writable; without `overwrite` it must be missing
    or empty.
    """
    existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        file_path = folder if existing == folder.absolute() else existing
        raise PlanflyError(f"{file_path}: is a file; expected a folder", file=file_path)
    if not os.access(existing, os.W_OK | os.X_OK):
        raise PlanflyError(f"{folder}: cannot be written: {existing} is not writable", file=folder)
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise PlanflyError(f"{folder}: exists and is not empty; overwrite=True replaces its results", file=folder)


def prepare_folder(folder: Path, files: tuple[str, ...] = RUN_FILES) -> None:
    """Make a folder if it is missing, and remove old results of planfly from it, but no other file.

    files: names of the results.  If it is `RUN_FILES` itself, the results of earlier rounds and the pictures of a
        report are removed, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rounds = sorted(folder.glob("round-[0-9]*")) if files is RUN_FILES else []
    if files is RUN_FILES:
        (folder / "rounds.json").unlink(missing_ok=True)
    # The pictures that `planfly report --pictures` drew from an earlier run are old results, too.
    pictures = [f"{name}.png" for name in REPORT_FIGURES] if files is RUN_FILES else []
    for directory in (folder, *rounds):
        for name in (*files, *pictures):
            (directory / name).unlink(missing_ok=True)
        if directory != folder and not any(directory.iterdir()):
            directory.rmdir()


def clean_folder(out: str | Path, files: tuple[str, ...], *, overwrite: bool) -> Path:
    """Check an output folder, make it if it is missing, and remove old results of planfly.

    Return its path.

    files: names of the results to remove, as for `prepare_folder`.
    overwrite: True permits a folder that is not empty.
    Raises PlanflyError as `check_output_folder`.
    """
    folder = Path(out)
    check_output_folder(folder, overwrite)
    prepare_folder(folder, files)
    return folder


def replace_files(folder: Path, contents: Mapping[str, str | bytes], *, overwrite: bool) -> tuple[Path, ...]:
    """Write files into a folder, and return their paths.

    Files of an earlier result are replaced if `overwrite`.

    contents: content of each file by its name.
    Raises PlanflyError as `check_output_folder`.
    """
    clean_folder(folder, tuple(contents), overwrite=overwrite)
    for name, content in contents.items():
        write_atomically(folder / name, content)
    return tuple(folder / name for name in contents)


def expand_path_pattern(target: str | Path, name: str, seed: int) -> Path:
    """Return the path `target` with {name} and {seed} replaced; unsafe characters of the name become "-".

    If this changes the name, the first digits of the name's SHA-256 are appended, so that different names stay
    different.

    >>> str(expand_path_pattern(RUN_FOLDER, "a/b", 3)), str(expand_path_pattern(RUN_FOLDER, "a b", 3))
    ('runs/a-b-c14cdd-seed3', 'runs/a-b-c8687a-seed3')
    """
    safe_name = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name).lstrip(".") or "run"
    if safe_name != name:
        safe_name += f"-{hashlib.sha256(name.encode(errors='surrogatepass')).hexdigest()[:6]}"
    return Path(str(target).replace("{name}", safe_name).replace("{seed}", str(seed)))
