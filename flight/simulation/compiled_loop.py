"""Exchange the state and the commands of a tick with a compiled model, within the compiled loop of a control law.

Each control law has a loop of its own: it reads the state, does a tick, sets the outputs and steps the model.
"""

from typing import Any

from flight.dynamics.compiled_frame import CODE_END, READS_BEGIN, STEPS, WRITES_BEGIN, step
from flight.dynamics.instructions import Code
from flight.simulation.tick import WORKSPACE
from world.arrays import Floats
from world.kernels import Record, Records, inner

_FIELDS: Any = WORKSPACE.fields
# First numbers of the state and of the outputs in the block of a workspace.
_STATE_BEGIN = int(_FIELDS["state"][1]) // 8
_OUTPUT_BEGIN = int(_FIELDS["output"][1]) // 8


@inner
def read_state(block: Floats, numbers: Floats, code: Code) -> None:
    """Copy the state of the model to the workspace, in JSBSim's units."""
    begin = code[READS_BEGIN]
    for k in range(code[WRITES_BEGIN] - begin):
        block[_STATE_BEGIN + k] = numbers[code[begin + k]]


@inner
def advance_model(
    block: Floats, frame: Record, numbers: Floats, code: Code, contacts: Records, frictions: Records
) -> None:
    """Copy the outputs of the workspace to the model, and step it to the next tick."""
    begin = code[WRITES_BEGIN]
    for k in range(code[CODE_END] - begin):
        numbers[code[begin + k]] = block[_OUTPUT_BEGIN + k]
    for _ in range(code[STEPS]):
        step(frame, numbers, code, contacts, frictions)
