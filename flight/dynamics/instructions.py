"""Interpret the instructions of a compiled model: arithmetic, tables and actuators on numbered registers.

An instruction is four or more unsigned numbers in a row: operation, target register, number of operands, and the
operands, which are registers. Every operation rounds as JSBSim's function of this name does.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats
from world.kernels import inlined, inner

# Instructions, one after the other.
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


# Registers of an actuator, from its first register on: last input and output of its lag.
LAG_INPUT = 0
LAG_OUTPUT = 1
# Last output of its rate limit.
RATE_OUTPUT = 2
# Factors of the lag for its inputs and for its last output; NaN without a lag.
INPUT_FACTOR = 3
OUTPUT_FACTOR = 4
# Largest change in a step; infinite without a rate limit.
LARGEST_CHANGE = 5
LOWER_LIMIT = 6
UPPER_LIMIT = 7
# Numbers before the operands of an instruction.
HEADER = 3


@inner
def run_instructions(numbers: Floats, code: Code, begin: int, end: int) -> None:
    """Run the instructions of a range of the code.

    numbers: registers.
    """
    at = begin
    while at < end:
        operation, count = code[at], code[at + 2]
        first = at + HEADER
        after = first + count
        value = numbers[code[first]]
        if operation == Operation.PRODUCT:
            for k in range(first + 1, after):
                value *= numbers[code[k]]
        elif operation == Operation.SUM:
            value = 0.0 + value
            for k in range(first + 1, after):
                value += numbers[code[k]]
        elif operation == Operation.DIFFERENCE:
            for k in range(first + 1, after):
                value -= numbers[code[k]]
        elif operation == Operation.QUOTIENT:
            divisor = numbers[code[first + 1]]
            value = value / divisor if divisor != 0.0 else math.inf
        elif operation == Operation.MAX:
            for k in range(first + 1, after):
                other = numbers[code[k]]
                value = other if other > value else value
        elif operation == Operation.MIN:
            for k in range(first + 1, after):
                other = numbers[code[k]]
                value = other if other < value else value
        elif operation == Operation.TABLE:
            value = _look_up(numbers, code[first + 1], code[first + 2], value)
        elif operation == Operation.ACTUATOR:
            value = _actuate(numbers, code[first + 1], value)
        elif operation == Operation.CLIP:
            value = _clip(value, numbers[code[first + 1]], numbers[code[first + 2]])
        elif operation == Operation.POW:
            value = math.pow(value, numbers[code[first + 1]])
        else:
            value = _function(operation, value)
        numbers[code[at + 1]] = value
        at = after


@inlined
def _function(operation: int, value: float) -> float:
    """Return a function of one number."""
    if operation == Operation.ABS:
        return abs(value)
    if operation == Operation.SQRT:
        return math.sqrt(value)
    return math.sin(value) if operation == Operation.SIN else math.cos(value)


@inlined
def _clip(value: float, low: float, high: float) -> float:
    """Return a value within limits."""
    if value < low:
        return low
    return high if value > high else value


@inlined
def _look_up(numbers: Floats, begin: int, rows: int, key: float) -> float:
    """Return the value of a table between its rows, and of its first or last row outside them."""
    last = begin + 2 * (rows - 1)
    if key <= numbers[begin]:
        return numbers[begin + 1]
    if key >= numbers[last]:
        return numbers[last + 1]
    low, high = 0, rows - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if numbers[begin + 2 * middle] < key:
            low = middle
        else:
            high = middle
    below, above = begin + 2 * low, begin + 2 * high
    share = (key - numbers[below]) / (numbers[above] - numbers[below])
    return share * (numbers[above + 1] - numbers[below + 1]) + numbers[below + 1]


@inlined
def _actuate(numbers: Floats, begin: int, value: float) -> float:
    """Return the output of an actuator: its lag, its rate limit, and its limits, which leave its memory as it is."""
    factor = numbers[begin + INPUT_FACTOR]
    if not math.isnan(factor):
        lagged = factor * (value + numbers[begin + LAG_INPUT])
        lagged += numbers[begin + LAG_OUTPUT] * numbers[begin + OUTPUT_FACTOR]
        numbers[begin + LAG_INPUT], numbers[begin + LAG_OUTPUT] = value, lagged
        value = lagged
    largest = numbers[begin + LARGEST_CHANGE]
    if largest < math.inf:
        before = numbers[begin + RATE_OUTPUT]
        change = value - before
        if change > largest:
            value = before + largest
        if change < -largest:
            value = before - largest
        numbers[begin + RATE_OUTPUT] = value
    return _clip(value, numbers[begin + LOWER_LIMIT], numbers[begin + UPPER_LIMIT])
