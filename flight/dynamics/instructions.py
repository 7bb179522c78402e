"""Interpret the instructions of a compiled model on numbered registers.

The instructions are arithmetic, tables and actuators.

An instruction is four or more unsigned numbers in a row: operation, target register, number of operands, and the
operands, which are registers. Every operation rounds like JSBSim's function of the same name.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats
from world.kernels import inlined, inner

# Consecutive instructions.
Code = NDArray[np.uint32]


class Operation(IntEnum):
    """Operations of instructions."""

    PRODUCT = 0
    SUM = 1
    DIFFERENCE = 2
    QUOTIENT = 3
    MAX = 4
    MIN = 5
    ABS = 6
    SQRT = 7
    SIN = 8
    COS = 9
    POW = 10
    # Key, first register of the pairs of key and value, number of pairs.
    TABLE = 11
    # Input, first register of the actuator.
    ACTUATOR = 12
    # Value, lower limit, upper limit.
    CLIP = 13


# Offsets of an actuator's values from its first register.
# Last input of its lag.
LAG_INPUT = 0
# Last output of its lag.
LAG_OUTPUT = 1
# Last output of its rate limit.
RATE_OUTPUT = 2
# Factor of the lag for its inputs; NaN without a lag.
INPUT_FACTOR = 3
# Factor of the lag for its last output; NaN without a lag.
OUTPUT_FACTOR = 4
# Maximum change in a step; infinite without a rate limit.
MAX_CHANGE = 5
# Limits of its output.
LOWER_LIMIT = 6
UPPER_LIMIT = 7
# Numbers before the operands of an instruction.
HEADER = 3


@inner
def run_instructions(numbers: Floats, code: Code, start: int, end: int) -> None:
    """Run the instructions in ``code[start:end]``.

    numbers: registers, which are read and changed.
    """
    position = start
    while position < end:
        operation, count = code[position], code[position + 2]
        first_operand = position + HEADER
        next_position = first_operand + count
        value = numbers[code[first_operand]]
        if operation == Operation.PRODUCT:
            for k in range(first_operand + 1, next_position):
                value *= numbers[code[k]]
        elif operation == Operation.SUM:
            value = 0.0 + value
            for k in range(first_operand + 1, next_position):
                value += numbers[code[k]]
        elif operation == Operation.DIFFERENCE:
            for k in range(first_operand + 1, next_position):
                value -= numbers[code[k]]
        elif operation == Operation.QUOTIENT:
            divisor = numbers[code[first_operand + 1]]
            value = value / divisor if divisor != 0.0 else math.inf
        elif operation == Operation.MAX:
            # Start from minus infinity as JSBSim does, which therefore ignores operands that are NaN.
            value = -math.inf
            for k in range(first_operand, next_position):
                operand = numbers[code[k]]
                value = operand if operand > value else value
        elif operation == Operation.MIN:
            value = math.inf
            for k in range(first_operand, next_position):
                operand = numbers[code[k]]
                value = operand if operand < value else value
        elif operation == Operation.TABLE:
            value = _interpolate_table(numbers, code[first_operand + 1], code[first_operand + 2], value)
        elif operation == Operation.ACTUATOR:
            value = _step_actuator(numbers, code[first_operand + 1], value)
        elif operation == Operation.CLIP:
            value = _clip(value, numbers[code[first_operand + 1]], numbers[code[first_operand + 2]])
        elif operation == Operation.POW:
            value = math.pow(value, numbers[code[first_operand + 1]])
        else:
            value = _apply_function(operation, value)
        numbers[code[position + 1]] = value
        position = next_position


@inlined
def _apply_function(operation: int, value: float) -> float:
    """Return the result of a function of one number: ABS, SQRT, SIN or COS."""
    if operation == Operation.ABS:
        return abs(value)
    if operation == Operation.SQRT:
        return math.sqrt(value)
    return math.sin(value) if operation == Operation.SIN else math.cos(value)


@inlined
def _clip(value: float, lower: float, upper: float) -> float:
    """Return the value, limited to the range from lower to upper."""
    if value < lower:
        return lower
    return upper if value > upper else value


@inlined
def _interpolate_table(numbers: Floats, first_register: int, row_count: int, key: float) -> float:
    """Interpolate a table linearly at a key; beyond an end of the table return the value at this end.

    numbers: registers of the model.
    first_register: first register of the table; a row of the table is a key and a value.
    row_count: number of rows.
    key: value at which to interpolate.
    """
    last_row = first_register + 2 * (row_count - 1)
    if key <= numbers[first_register]:
        return numbers[first_register + 1]
    if key >= numbers[last_row]:
        return numbers[last_row + 1]
    lower, upper = 0, row_count - 1
    while upper - lower > 1:
        middle = (lower + upper) >> 1
        if numbers[first_register + 2 * middle] < key:
            lower = middle
        else:
            upper = middle
    row_below, row_above = first_register + 2 * lower, first_register + 2 * upper
    fraction = (key - numbers[row_below]) / (numbers[row_above] - numbers[row_below])
    return fraction * (numbers[row_above + 1] - numbers[row_below + 1]) + numbers[row_below + 1]


@inlined
def _step_actuator(numbers: Floats, first_register: int, value: float) -> float:
    """Advance an actuator by a time step, and return its output.

    The output follows the input with a lag, a rate limit and position limits. The position limits do not change the
    stored state.

    first_register: first register of the actuator.
    value: input.
    """
    factor = numbers[first_register + INPUT_FACTOR]
    if not math.isnan(factor):
        lagged = factor * (value + numbers[first_register + LAG_INPUT])
        lagged += numbers[first_register + LAG_OUTPUT] * numbers[first_register + OUTPUT_FACTOR]
        numbers[first_register + LAG_INPUT], numbers[first_register + LAG_OUTPUT] = value, lagged
        value = lagged
    max_change = numbers[first_register + MAX_CHANGE]
    if max_change < math.inf:
        last_output = numbers[first_register + RATE_OUTPUT]
        change = value - last_output
        if change > max_change:
            value = last_output + max_change
        if change < -max_change:
            value = last_output - max_change
        numbers[first_register + RATE_OUTPUT] = value
    return _clip(value, numbers[first_register + LOWER_LIMIT], numbers[first_register + UPPER_LIMIT])
