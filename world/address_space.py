"""A limit of address space (``ulimit -v``) ends a command in one line, before it meets a library that never returns.

OpenBLAS, which NumPy and SciPy bring along, asks for its buffers in a loop without end, holding the interpreter: where
there is no room for them, neither Ctrl-C nor SIGTERM ends the process.  LLVM and others end it without a word.
"""

import mmap

# Bytes that have to be left when a module is imported: more than OpenBLAS takes with its buffers, 90 MB, and for LLVM
# more than its library of 160 MB.
ROOM = 112 * 2**20
LLVM_ROOM = 192 * 2**20


class AddressSpaceError(MemoryError):
    """The limit leaves too little for a library: the machine's trouble, and no file's."""


def has_room(size: int) -> bool:
    """Whether so many bytes can be mapped; none are.

    >>> has_room(2**20)
    True
    """
    try:
        mmap.mmap(-1, size).close()
    except OSError:
        return False
    return True


class RoomFinder:
    """Finds no module, and has none imported where there is too little room: to stand first in ``sys.meta_path``.

    limit: of this process's address space, bytes.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Nothing, whichever module is looked for.  Raises AddressSpaceError where too little is left."""
        room = LLVM_ROOM if name.startswith("llvmlite") else ROOM
        if not has_room(room):
            limit = f"{self._limit // 1024:,} kB of address space (ulimit -v)"
            library = name.partition(".")[0]
            raise AddressSpaceError(f"the limit of {limit} leaves less than {room // 2**20} MB to import {library}")
