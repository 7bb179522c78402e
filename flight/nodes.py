"""JSBSim's properties, read and set from compiled code with no Python between.

A call through Python takes 35 ns, and a tick makes thirty: as much as the guidance itself.  JSBSim's library exports
the two functions that Python would call; what they need is the node's address, which Python's object for a node holds.
Where in it is known for one build of JSBSim; on any other, `addresses` gives None, and the loop goes through Python.
Both ways give the same track, bit for bit.
"""

import ctypes
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import types
from numpy.typing import NDArray

Ints = NDArray[np.int64]

_GET, _SET = "_ZNK14SGPropertyNode14getDoubleValueEv", "_ZN14SGPropertyNode14setDoubleValueEd"
# By version of JSBSim: the size of Python's object for a node, and where in it the node's address stands, bytes.
KNOWN = {"1.3.3": (32, 24)}

# For compiled code: value of the node at an address, and the setter, which returns whether it could.
get_node: Any = types.ExternalFunction(_GET, types.float64(types.intp))
set_node: Any = types.ExternalFunction(_SET, types.uint8(types.intp, types.float64))


def addresses(nodes: Sequence[Any], version: str, library: Path) -> Ints | None:
    """(n,) addresses of these nodes, 0 for None, once compiled code can reach them; None where it cannot.

    nodes: JSBSim's Python objects, or None where an aircraft has no such property.  version: of JSBSim.  library: its
    extension module's file.
    """
    if version not in KNOWN or sys.platform != "linux" or sys.implementation.name != "cpython":
        return None
    size, where = KNOWN[version]
    if any(type(node).__basicsize__ != size for node in nodes if node is not None):
        return None
    loaded = ctypes.CDLL(str(library))
    if not hasattr(loaded, _GET) or not hasattr(loaded, _SET):
        return None
    for name in (_GET, _SET):
        llvm.add_symbol(name, ctypes.cast(loaded[name], ctypes.c_void_p).value)
    found = np.array(
        [0 if node is None else ctypes.c_size_t.from_address(id(node) + where).value for node in nodes], dtype=np.int64
    )
    read = loaded[_GET]
    read.restype, read.argtypes = ctypes.c_double, [ctypes.c_void_p]
    for node, address in zip(nodes, found.tolist(), strict=True):
        if node is not None and not _same(read(address), node.get_double_value()):
            return None
    return found


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))
