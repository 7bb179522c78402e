"""Exchange the state and the commands of a tick with a compiled model, within the compiled loop of a control law.

Each control law has a loop of its own: it reads the state, does a tick, sets the outputs and steps the model.
"""

from typing import Any

from flight.dynamics.compiled_frame import CODE_END, READS_START, STEPS, WRITES_START, step
from flight.dynamics.instructions import Code
from flight.simulation.tick import WORKSPACE
from world.arrays import Floats
from world.kernels import Record, Records, inner

_FIELDS: Any = WORKSPACE.fields
# Indices of the first numbers of the state and of the outputs in a workspace's block.
_STATE_OFFSET = int(_FIELDS["state"][1]) // 8
_OUTPUT_OFFSET = int(_FIELDS["output"][1]) // 8


@inner
def read_state(block: Floats, registers: Floats, code: Code) -> None:
    """Copy the state of the compiled model to the block of a workspace, in JSBSim's units.

    block: numbers of the flight's workspace.
    registers: values of the compiled model.
    code: program of the compiled model, which lists the registers to read.
    """
    first_read = code[READS_START]
    for k in range(code[WRITES_START] - first_read):
        block[_STATE_OFFSET + k] = registers[code[first_read + k]]


@inner
def advance_model(
    block: Floats, frame: Record, registers: Floats, code: Code, contacts: Records, frictions: Records
) -> None:
    """Copy the autopilot's outputs to the compiled model's registers, and step the model to the next tick.

    block: numbers of the flight's workspace, which contain the outputs in JSBSim's units.
    registers, code: values and program of the compiled model.
    """
    first_write = code[WRITES_START]
    for k in range(code[CODE_END] - first_write):
        registers[code[first_write + k]] = block[_OUTPUT_OFFSET + k]
    for _ in range(code[STEPS]):
        step(frame, registers, code, contacts, frictions)
