"""Which sources compiled kernels are made of: their cache holds as long as none of these changes.

Numba's cache looks at the file that a kernel stands in, and misses the kernels and constants that it takes from other
files.  So the cache folder carries a digest of every file that defines a kernel, and of every file of ours that these
import, directly or not: a constant reaches a kernel only through an import.  Other files, reports among them, may
change without a kernel being compiled anew.
"""

import atexit
import contextlib
import hashlib
import os
import re
import tempfile
from pathlib import Path

from world.interruption import unfinished

PACKAGES = ("aircraft", "flight", "logs", "planner", "world")
# Of `world.kernels`: each has a function compiled.
DECORATORS = ("compiled", "compiled_inline", "inner", "inlined")
_KERNEL = re.compile(rb"^@(?:" + "|".join(DECORATORS).encode() + rb")$", re.MULTILINE)
_IMPORT = re.compile(rb"^from ((?:" + "|".join(PACKAGES).encode() + rb")[\w.]*) import (\(?[^\n]*)", re.MULTILINE)


def kernel_sources(root: Path) -> dict[str, bytes]:
    """The files that kernels are made of, with their contents, by their paths below a folder that holds the packages.

    >>> files = kernel_sources(Path(__file__).parents[1])
    >>> "world/terrain.py" in files, "logs/views/report/page.py" in files
    (True, False)
    """
    texts = {file.relative_to(root).as_posix(): file for name in PACKAGES for file in (root / name).rglob("*.py")}
    contents = {name: file.read_bytes() for name, file in texts.items()}
    waiting = [name for name, content in contents.items() if _KERNEL.search(content)]
    found: dict[str, bytes] = {}
    while waiting:
        name = waiting.pop()
        if name in contents and name not in found:
            found[name] = contents[name]
            waiting += _imported(contents[name])
    return found


def _imported(content: bytes) -> list[str]:
    """Paths that a source may import from: of modules, and of names in packages, which may be modules."""
    paths = []
    for module, names in _IMPORT.findall(content):
        path = module.decode().replace(".", "/")
        paths += [f"{path}.py", *(f"{path}/{name}.py" for name in re.findall(r"\w+", names.decode()))]
    return paths


def sources_digest(root: Path) -> str:
    """A digest of the files that kernels are made of, 16 hexadecimal digits.

    >>> len(sources_digest(Path(__file__).parents[1]))
    16
    """
    digest = hashlib.sha256()
    for name, content in sorted(kernel_sources(root).items()):
        digest.update(name.encode() + b"\0" + content)
    return digest.hexdigest()[:16]


# Numba's own name for it, which processes that are started here inherit.
VARIABLE = "NUMBA_CACHE_DIR"


# What stands in the names of folders that hold the kernels of one version of the sources.
_PREFIX = "kernels-"


def wanted_folder(base: Path, root: Path) -> Path:
    """The folder within a base where the kernels of the sources below a root are kept.

    A base that is such a folder itself, or a temporary one of this process, is taken as it is.

    >>> wanted_folder(Path("/tmp/kernels-mine"), Path(__file__).parents[1]).as_posix()
    '/tmp/kernels-mine'
    """
    return base if _PREFIX in base.name else base / f"{_PREFIX}{sources_digest(root)}"


def can_write(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made where it is not there.

    >>> can_write(Path(__file__) / "kernels")
    False
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def usable_folder(wanted: Path) -> Path | None:
    """The folder where compiled kernels are kept, if it can be written, or else a temporary one.

    A temporary one serves this process and those that it starts, and goes with it.  None where nothing can be written.
    """
    if can_write(wanted):
        return wanted
    try:
        folder = Path(tempfile.mkdtemp(prefix="planfly-kernels-"))
    except OSError:
        return None
    kept = contextlib.ExitStack()
    kept.enter_context(unfinished(folder))
    atexit.register(kept.close)
    os.environ[VARIABLE] = str(folder)
    return folder
