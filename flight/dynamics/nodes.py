"""JSBSim's properties, read and set from compiled code with no Python between.

A call through Python takes 35 ns, and a tick makes thirty: as much as the guidance itself.  JSBSim's library exports
the two functions that Python would call; what they need is the node's address, which Python's object for a node holds.
Where in it is known for one build of JSBSim; on any other, `addresses` gives None, and the loop goes through Python.
Both ways give the same track, bit for bit.
"""

import ctypes
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import types
from numpy.typing import NDArray

from flight.dynamics.state import COMMAND_SIZE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Where the gusts' three setters and the ground's stand, after the commands'.
GUST_SETTERS, GROUND_SETTER = range(COMMAND_SIZE, COMMAND_SIZE + 3), COMMAND_SIZE + 3
SETTERS = GROUND_SETTER + 1

_GET, _SET = "_ZNK14SGPropertyNode14getDoubleValueEv", "_ZN14SGPropertyNode14setDoubleValueEd"
_TABLE = "_ZTV14SGPropertyNode"
# By version of JSBSim: the size of Python's object for a node, and where in it the node's address stands, bytes.
KNOWN = {"1.3.3": (32, 24)}

# For compiled code: value of the node at an address, and the setter, which returns whether it could.
get_node: Any = types.ExternalFunction(_GET, types.float64(types.intp))
set_node: Any = types.ExternalFunction(_SET, types.uint8(types.intp, types.float64))


@dataclass(frozen=True, slots=True)
class Links:
    """The bound nodes themselves, in JSBSim's units, for the one loop that cannot afford `Fdm`'s conversions.

    getters: the state in the order of `flight.dynamics.state.S`; times factors (STATE_SIZE,) it is SI. setters:
    commands in the order of `flight.dynamics.state.C`, gusts north, east and down, the ground's height. scales:
    (SETTERS, 2) what takes an SI value to JSBSim's where it is above zero, and where not. nodes: (STATE_SIZE +
    SETTERS,) addresses of all of them for compiled code, 0 for none; None where `flight.dynamics.nodes` does not know
    this JSBSim.
    """

    getters: tuple[Callable[[], float], ...]
    factors: Floats
    setters: tuple[Callable[[float], object], ...]
    scales: Floats
    nodes: Ints | None
    run: Callable[[], object]


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
    if not all(hasattr(loaded, name) for name in (_GET, _SET, _TABLE)):
        return None
    found = [0 if node is None else _word(id(node) + where) for node in nodes]
    # A C++ object of this class begins with the address of its table of methods, past two words.
    table = ctypes.addressof(ctypes.c_char.in_dll(loaded, _TABLE)) + 16
    if any(_word(address) != table for address in found if address):
        return None
    read = loaded[_GET]
    read.restype, read.argtypes = ctypes.c_double, [ctypes.c_void_p]
    for node, address in zip(nodes, found, strict=True):
        if node is not None and not _same(read(address), node.get_double_value()):
            return None
    for name in (_GET, _SET):
        llvm.add_symbol(name, ctypes.cast(loaded[name], ctypes.c_void_p).value)
    return np.array(found, dtype=np.int64)


def _word(address: int) -> int:
    return ctypes.c_size_t.from_address(address).value


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))
