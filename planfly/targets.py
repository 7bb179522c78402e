"""Files and folders that are written: refused where they would destroy something, cleared where they are ours."""

import hashlib
from pathlib import Path

from world.errors import PlanflyError

# Where results go that nobody named a place for.
RESULTS = Path("runs")
# The same as a pattern: {name} and {seed} in a path stand for the scenario's or mission's name and the seed.
RUN_FOLDER = "runs/{name}-seed{seed}"

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
    "scene.png",
    "turns.png",
    "envelope.png",
    "report.html",
)
_FIGURES = ("map", "profile", "scene", "turns", "envelope")
# What a report and a comparison may write, figures as SVG included.
LOG_FIGURES = ("report.html", *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")))
COMPARE_FILES = (
    *(f"compare-{name}.{kind}" for kind in ("png", "svg") for name in ("map", "profile")),
    "compare.html",
)
# What `planfly.survey` may write: the picture of the lines, and missions and parameters that would help.
SURVEY_FILES = (
    "survey.png",
    *(f"{kind}.waypoints" for kind in ("side", "turn-around", "every", "course", "parameter", "airspeed")),
    "parameter.param",
)
# Returns that a program may fly, at the most.
MAX_BY_PROGRAM = 20
# What `planfly.returns` may write.
RETURN_FILES = (
    *(f"{name}.png" for name in ("returns", "worst-returns", "return-heights", "glide")),
    "returns.kml",
    "returns.mcap",
    *(f"worst-return-{k}{suffix}" for k in range(1, MAX_BY_PROGRAM + 1) for suffix in (".mcap", ".BIN")),
)
# Stretches of a flight that are flown again, and what is written of each: of those after the first with its number.
REFLOWN = 9
REFLY_FILES = tuple(
    name
    for ending in ("", *(f"-{number}" for number in range(2, REFLOWN + 1)))
    for name in (
        f"simulated{ending}.mcap",
        *(f"refly-{kind}{ending}.png" for kind in ("cross-track", "height", "ground-speed", "bank", "energy")),
    )
)


def refuse_existing(path: Path, overwrite: bool, source: Path | None = None) -> None:
    """Refuse a target file that exists, is a folder, cannot be made, or is the input.  Raises PlanflyError."""
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        raise PlanflyError(f"{path}: is the input itself; name another file to write", file=path)
    if path.is_dir():
        raise PlanflyError(f"{path}: is a folder; a file name is expected", file=path)
    if path.exists() and not overwrite:
        raise PlanflyError(f"{path}: exists; overwrite=True replaces it", file=path)
    if not path.parent.exists():
        raise PlanflyError(f"{path}: its folder {path.parent} does not exist", file=path)


def refuse_folder(folder: Path, overwrite: bool) -> None:
    """Refuse a target folder that is a file or holds anything.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise PlanflyError(f"{folder}: exists and is not empty; overwrite=True replaces its results", file=folder)


def prepare_folder(folder: Path, files: tuple[str, ...] = RUN_FILES) -> None:
    """Make a folder and clear old results of ours: what is written there, never anything else that lies there."""
    folder.mkdir(parents=True, exist_ok=True)
    rounds = sorted(folder.glob("round-[0-9]*")) if files is RUN_FILES else []
    if files is RUN_FILES:
        (folder / "rounds.json").unlink(missing_ok=True)
    for directory in (folder, *rounds):
        for name in files:
            (directory / name).unlink(missing_ok=True)
        if directory != folder and not any(directory.iterdir()):
            directory.rmdir()


def clean_folder(out: str | Path, files: tuple[str, ...], *, overwrite: bool) -> Path:
    """A target folder, checked as `refuse_folder` does, made, and cleared of older files of ours."""
    folder = Path(out)
    refuse_folder(folder, overwrite)
    prepare_folder(folder, files)
    return folder


def is_pattern(target: str | Path) -> bool:
    """Whether a path is made of the name and the seed of what is written.

    >>> is_pattern("runs/{name}-seed{seed}/flight.mcap"), is_pattern("flight.mcap")
    (True, False)
    """
    return "{name}" in str(target) or "{seed}" in str(target)


def filled_pattern(target: str | Path, name: str, seed: int) -> Path:
    """A path with its {name} and {seed} filled in; the name so that it stays one folder, and no other name's.

    A name that has to change for that ends with the beginning of its SHA-256.

    >>> str(filled_pattern(RUN_FOLDER, "a/b", 3)), str(filled_pattern(RUN_FOLDER, "a b", 3))
    ('runs/a-b-c14cdd-seed3', 'runs/a-b-c8687a-seed3')
    """
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name).lstrip(".") or "run"
    if safe != name:
        safe += f"-{hashlib.sha256(name.encode(errors='surrogatepass')).hexdigest()[:6]}"
    return Path(str(target).replace("{name}", safe).replace("{seed}", str(seed)))


def file_target(target: str | Path, name: str, seed: int, *, overwrite: bool, source: Path | None = None) -> Path:
    """The file to write, checked as `refuse_existing` does; the folder of a pattern is made by whoever writes."""
    path = filled_pattern(target, name, seed)
    if path.parent.exists() or not is_pattern(target):
        refuse_existing(path, overwrite, source)
    return path
