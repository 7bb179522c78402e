"""Targets on disk: refused where they exist, cleared where they are ours."""

from pathlib import Path

from world.errors import PlanflyError

RUN_FILES = (
    "plan.json",
    "mission.waypoints",
    "mission.plan",
    "flight.mcap",
    "verdict.json",
    "map.png",
    "profile.png",
    "report.html",
)


def refuse_existing(path: Path, overwrite: bool) -> None:
    """Refuse a named target file that exists, is a folder, or cannot be made.  Raises PlanflyError."""
    if path.is_dir():
        raise PlanflyError(f"{path}: is a folder; a file name is expected")
    if path.exists() and not overwrite:
        raise PlanflyError(f"{path}: exists; --overwrite replaces it")
    if not path.parent.exists():
        raise PlanflyError(f"{path}: its folder {path.parent} does not exist")


def refuse_folder(folder: Path, *, named: bool, overwrite: bool) -> None:
    """Refuse a target folder that is a file, and a named one that holds anything.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected")
    if named and not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise PlanflyError(f"{folder}: exists and is not empty; --overwrite replaces its results")


def prepare_folder(folder: Path, *, named: bool, overwrite: bool) -> None:
    """Make a run's folder ready: refuse a named one that holds anything, and clear old results of ours.

    Only files that a run writes are removed, never anything else that lies there.  Raises PlanflyError.
    """
    refuse_folder(folder, named=named, overwrite=overwrite)
    folder.mkdir(parents=True, exist_ok=True)
    for name in RUN_FILES:
        (folder / name).unlink(missing_ok=True)
