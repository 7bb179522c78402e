"""End a command with a one-line error if the address space is too small for a library.

The limit is that of ``ulimit -v``; the error comes before the library is imported.

OpenBLAS, which NumPy and SciPy contain, requests its buffers in an endless loop while it holds the interpreter: without
room for them, neither Ctrl-C nor SIGTERM ends the process.  LLVM and others end the process without a message.
"""

import mmap

# Address space that must be free to import a module, bytes: more than OpenBLAS with its buffers, 90 MB.
MIN_FREE_BYTES = 112 * 2**20
# Address space that must be free to import LLVM, bytes: more than its library of 160 MB.
LLVM_MIN_FREE_BYTES = 192 * 2**20


class AddressSpaceError(MemoryError):
    """Error for a limit that leaves too little address space for a library.

    It is caused by the machine's limits, not by an input file.
    """


def has_address_space(size: int) -> bool:
    """Return True if ``size`` bytes of address space are free, tested by mapping and releasing them.

    >>> has_address_space(2**20)
    True
    """
    try:
        mmap.mmap(-1, size).close()
    except OSError:
        return False
    return True


class AddressSpaceGuard:
    """Import hook that refuses imports if there is too little address space.

    It is at the head of ``sys.meta_path``.

    limit: address space of this process, bytes.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Raise AddressSpaceError if too little address space is free to import a module.

        Otherwise return None, so that the other hooks find the module.
        """
        required_bytes = LLVM_MIN_FREE_BYTES if name.startswith("llvmlite") else MIN_FREE_BYTES
        if not has_address_space(required_bytes):
            limit = f"{self._limit // 1024:,} kB of address space (ulimit -v)"
            library = name.partition(".")[0]
            required_text = f"{required_bytes // 2**20} MB"
            raise AddressSpaceError(f"the limit of {limit} leaves less than {required_text} to import {library}")
