"""Files that are written whole or not at all, folders that do not outlive their use, targets kept to one process."""

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from world.errors import PlanflyError
from world.interruption import unfinished, uninterrupted

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


def write_whole(path: Path, data: str | bytes) -> None:
    """Write a file under a temporary name beside its target and rename it: whole, or not at all.

    Text is written in UTF-8.  A target that is a link stays one: the file that it leads to is replaced.  Raises
    OSError, which names the target, and leaves what was there.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_whole(Path(folder) / "plan.json", "{}")
    ...     print((Path(folder) / "plan.json").read_text())
    {}
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        target = _led_to(path) if path.is_symlink() else path
        # Cut by bytes, of which a name may have 255: letters may be up to four.
        name = target.name.encode()[:200].decode("utf-8", "ignore")
        temporary = target.with_name(f".{name}.{os.getpid()}-{os.urandom(4).hex()}")
        with uninterrupted(), unfinished(temporary):
            with temporary.open("xb") as file:
                file.write(content)
            temporary.replace(target)
    except OSError as error:
        if error.errno is None:
            raise
        # The user knows the target, not the temporary name.
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_folder(path: Path, files: Mapping[str, bytes]) -> None:
    """Make a folder that is not there yet, with files by their paths within it: whole, or not at all.

    Raises OSError, which names the folder, and leaves nothing.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as home:
    ...     write_folder(Path(home) / "made", {"a.txt": b"1", "b/c.txt": b"2"})
    ...     print((Path(home) / "made" / "b" / "c.txt").read_text())
    2
    """
    temporary = path.with_name(f".{path.name[:50]}.{os.getpid()}-{os.urandom(4).hex()}")
    try:
        with uninterrupted(), unfinished(temporary):
            temporary.mkdir()
            for name, content in files.items():
                (temporary / name).parent.mkdir(parents=True, exist_ok=True)
                (temporary / name).write_bytes(content)
            temporary.rename(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _led_to(link: Path) -> Path:
    try:
        return link.resolve()
    except RuntimeError:
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from None


@contextlib.contextmanager
def temporary_folder(prefix: str) -> Iterator[Path]:
    """Make a folder among the system's temporary files, and remove it with all that is in it.

    >>> with temporary_folder("planfly-") as folder:
    ...     _ = (folder / "notes").write_text("gone soon")
    >>> folder.exists()
    False
    """
    folder = Path(tempfile.gettempdir()) / f"{prefix}{os.getpid()}-{os.urandom(8).hex()}"
    with unfinished(folder):
        folder.mkdir(mode=0o700)
        yield folder


@contextlib.contextmanager
def hold(path: Path) -> Iterator[None]:
    """Keep a file or folder that is there to this process: another that would hold it is refused meanwhile.

    The system lets go of it when the process ends, however that is.  Raises PlanflyError where another holds it, and
    OSError where it cannot be opened.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder, hold(Path(folder)):
    ...     try:
    ...         with hold(Path(folder)):
    ...             print("never")
    ...     except PlanflyError:
    ...         print("held")
    held
    """
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(_locked(path))
        except (BlockingIOError, PermissionError) as error:
            if isinstance(error, PermissionError) and fcntl is not None:
                raise
            raise PlanflyError(f"{path}: another planfly is writing there; name another target", file=path) from error
        yield


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """The system's lock on a file or folder.

    Raises BlockingIOError, on Windows PermissionError, where another has it.
    """
    if fcntl is not None:
        handle = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        finally:
            os.close(handle)
        return
    # Windows locks bytes of files, for readers too, and opens no folder: a file beside stands for either.
    beside = path.with_name(f".{path.name}.planfly-lock")
    handle = os.open(beside, os.O_RDWR | os.O_CREAT)
    try:
        windows: Any = import_module("msvcrt")
        windows.locking(handle, windows.LK_NBLCK, 1)
        yield
    finally:
        os.close(handle)
        with contextlib.suppress(OSError):
            beside.unlink()
