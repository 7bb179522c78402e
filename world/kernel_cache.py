"""Choose the cache folder of compiled kernels, whose name contains a digest of their sources.

Numba's cache checks only the file that defines a kernel, and misses changes to kernels and constants from other files.
So the cache folder's name contains a digest of every file that defines a kernel, and of every planfly file that these
import, directly or not: a constant reaches a kernel only through an import.  Other files, such as reports, may change
without recompiling a kernel.
"""

import atexit
import contextlib
import hashlib
import os
import re
import tempfile
from pathlib import Path

from world.interruption import remove_at_end

# Packages that are searched for kernels.
PACKAGES = ("aircraft", "flight", "logs", "planner", "world")
# Decorators of `world.kernels` that compile a function.
DECORATORS = ("compiled", "compiled_inline", "inner", "inlined")
_DECORATOR_LINES = tuple(f"\n@{name}\n".encode() for name in DECORATORS)
# An import of a planfly module, without the "from" at the start of its line.
_IMPORT = re.compile(rb"((?:" + "|".join(PACKAGES).encode() + rb")[\w.]*) import (\(?[^\n]*)")


def kernel_sources(root: Path) -> dict[str, bytes]:
    """Return the source files on which kernels below ``root`` depend, by path below ``root``.

    The values are the contents of the files.

    root: folder of the packages.

    These are the files that define kernels, and the files that they import, directly or not.

    >>> files = kernel_sources(Path(__file__).parents[1])
    >>> "world/terrain.py" in files, "logs/views/report/page.py" in files
    (True, False)
    """
    files = {file.relative_to(root).as_posix(): file for name in PACKAGES for file in (root / name).rglob("*.py")}
    contents = {name: file.read_bytes() for name, file in files.items()}
    pending = [name for name, content in contents.items() if any(line in b"\n" + content for line in _DECORATOR_LINES)]
    sources: dict[str, bytes] = {}
    while pending:
        name = pending.pop()
        if name in contents and name not in sources:
            sources[name] = contents[name]
            # Modules that the source may import; an imported name may be a module, too.
            content = contents[name]
            paths = []
            # Splitting takes a tenth of the time of a search for lines that begin with "from".
            for match in filter(None, map(_IMPORT.match, (b"\n" + content).split(b"\nfrom ")[1:])):
                module, names = match.groups()
                path = module.decode().replace(".", "/")
                paths += [f"{path}.py", *(f"{path}/{name}.py" for name in re.findall(r"\w+", names.decode()))]
            pending += paths
    return sources


def sources_digest(root: Path) -> str:
    """Return a digest of the sources of all kernels below ``root``, 16 hexadecimal digits.

    >>> len(sources_digest(Path(__file__).parents[1]))
    16
    """
    digest = hashlib.sha256()
    for name, content in sorted(kernel_sources(root).items()):
        digest.update(name.encode() + b"\0" + content)
    return digest.hexdigest()[:16]


# Environment variable with numba's cache folder, which child processes inherit.
CACHE_DIR_VARIABLE = "NUMBA_CACHE_DIR"


# Prefix of the names of folders with the kernels of one version of the sources.
_PREFIX = "kernels-"


def versioned_folder(base: Path, root: Path) -> Path:
    """Return the subfolder of `base` for kernels compiled from the sources below `root`.

    If `base` is already such a subfolder, or this process's temporary folder, it is returned unchanged.

    >>> versioned_folder(Path("/tmp/kernels-mine"), Path(__file__).parents[1]).as_posix()
    '/tmp/kernels-mine'
    """
    return base if _PREFIX in base.name else base / f"{_PREFIX}{sources_digest(root)}"


def can_write(folder: Path) -> bool:
    """Return True if files can be created in a folder; create the folder if it does not exist.

    >>> can_write(Path(__file__) / "kernels")
    False
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def usable_folder(preferred_folder: Path) -> Path | None:
    """Return the preferred folder for compiled kernels if it is writable, or else a temporary folder.

    The temporary folder is used by this process and its children, and removed at exit. Returns None if no folder is
    writable.
    """
    if can_write(preferred_folder):
        return preferred_folder
    try:
        folder = Path(tempfile.mkdtemp(prefix="planfly-kernels-"))
    except OSError:
        return None
    exit_stack = contextlib.ExitStack()
    exit_stack.enter_context(remove_at_end(folder))
    atexit.register(exit_stack.close)
    os.environ[CACHE_DIR_VARIABLE] = str(folder)
    return folder
