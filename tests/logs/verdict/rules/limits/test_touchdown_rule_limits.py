"""How far from its landing point an aircraft may touch down and stop, by the strip's length and width."""

from dataclasses import replace

import numpy as np
import pytest

from tests.logs.verdict.rules.flown_circuits import STRIP, flown_circuit, found, moved


def on_strip(**strip: float) -> bool | None:
    flown = flown_circuit()
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, landing=replace(STRIP, **strip)))
    return found(setup, flown.track, "touchdown").ok


def known(what: str) -> float:
    flown = flown_circuit()
    return {fact.what: fact.value for fact in found(flown.setup, flown.track, "touchdown").facts}[what]


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_thirty_metres_of_the_strip_are_left(more: float, ok: bool) -> None:
    """The strip's half, less 30 m, against where the aircraft stops or touches down, whatever is farther."""
    farther = max(abs(known("along")), 300.0 - known("strip left"))
    assert on_strip(length=2.0 * (farther + 30.0 + more)) is ok


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_it_stays_within_half_the_width(more: float, ok: bool) -> None:
    flown = flown_circuit()
    farther = max(abs(known("aside")), abs(float(flown.track.position[-1, 1]) - 600.0))
    assert on_strip(width=2.0 * (farther + more)) is ok


@pytest.mark.parametrize(("over", "same"), [(0.018, True), (0.022, False)])
def test_two_centimetres_over_where_it_stands_it_has_touched_down(over: float, same: bool) -> None:
    flown = flown_circuit()
    track = flown.track
    down = int(np.argmax((track.time > 60.0) & (track.clearance < track.clearance[-1] + 0.02)))
    row = down - 60
    standing = float(track.position[-1, 2])
    low = moved(track, slice(row, row + 1), up=standing + over - float(track.position[row, 2]))
    facts = {fact.what: fact.value for fact in found(flown.setup, low, "touchdown").facts}
    assert (facts["along"] < known("along") - 1.0) is same
