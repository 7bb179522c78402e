"""Files that are written whole or not at all, folders that do not outlive their use, targets kept to one process."""

import contextlib
import errno
import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from world.errors import PlanflyError
from world.interruption import unfinished, uninterrupted


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
    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise PlanflyError(f"{path}: another planfly is writing there; name another target") from error
        yield
    finally:
        os.close(handle)
