"""Targets on disk: refused where they exist, cleared where they are ours."""

from pathlib import Path

from world.errors import PlanflyError

RESULTS = Path("runs")
RUN_FILES = (
    "plan.json",
    "mission.waypoints",
    "mission.plan",
    "flight.mcap",
    "flight.BIN",
    "verdict.json",
    "map.png",
    "profile.png",
    "scene.png",
    "turns.png",
    "envelope.png",
    "report.html",
)


_FIGURES = ("map", "profile", "scene", "turns", "envelope")
# What `report` and `compare` may write, figures as SVG included.
LOG_FIGURES = ("report.html", *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")))
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
COMPARE_FILES = (
    "compare.html",
    *(f"compare-{name}.{kind}" for name in ("map", "profile") for kind in ("png", "svg")),
)


def refuse_existing(path: Path, overwrite: bool, source: Path | None = None, *, ask: str = "--overwrite") -> None:
    """Refuse a named target file that exists, is a folder, cannot be made, or is the input.  Raises PlanflyError.

    ask: what a person writes to have it replaced.
    """
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        raise PlanflyError(f"{path}: is the input itself; name another file to write", file=path)
    if path.is_dir():
        raise PlanflyError(f"{path}: is a folder; a file name is expected", file=path)
    if path.exists() and not overwrite:
        raise PlanflyError(f"{path}: exists; {ask} replaces it", file=path)
    if not path.parent.exists():
        raise PlanflyError(f"{path}: its folder {path.parent} does not exist", file=path)


def refuse_folder(folder: Path, overwrite: bool, *, ask: str = "--overwrite") -> None:
    """Refuse a named target folder that is a file or holds anything; ask: as above.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise PlanflyError(f"{folder}: exists and is not empty; {ask} replaces its results", file=folder)


def prepare_folder(folder: Path, files: tuple[str, ...] = RUN_FILES) -> None:
    """Make a folder and clear old results of ours: what the command writes, never anything else that lies there."""
    folder.mkdir(parents=True, exist_ok=True)
    rounds = sorted(folder.glob("round-[0-9]*")) if files is RUN_FILES else []
    if files is RUN_FILES:
        (folder / "rounds.json").unlink(missing_ok=True)
    for directory in (folder, *rounds):
        for name in files:
            (directory / name).unlink(missing_ok=True)
        if directory != folder and not any(directory.iterdir()):
            directory.rmdir()


def default_folder(name: str, seed: int) -> Path:
    """Where results go that nobody named a folder for: ``runs/<name>-seed<N>``."""
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name).lstrip(".") or "run"
    return RESULTS / f"{safe}-seed{seed}"


def named_or_default(named: str | None, default: Path, overwrite: bool, source: Path) -> Path:
    """The target file that was named, or the default, which is replaced.

    source: the input, which no target may be.  Raises PlanflyError for a named one that `refuse_existing` refuses.
    """
    if named is None:
        return default
    target = Path(named)
    refuse_existing(target, overwrite, source)
    return target
