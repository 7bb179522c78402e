"""Workers of another version or model are refused by name."""

import pytest

from planfly.campaigns.engine.fingerprint import WorkerError, code_hash, fingerprint, refuse_different


def test_the_same_is_let_in_and_each_difference_is_named() -> None:
    mine = fingerprint("aerosonde")
    refuse_different(mine, dict(mine), "w")
    for name in ("planfly", "sources", "model", "jsbsim", "numpy"):
        with pytest.raises(WorkerError, match=f"worker tcp://w:1: {name} other, not"):
            refuse_different(mine, mine | {name: "other"}, "tcp://w:1")


def test_aircraft_differ_and_a_missing_one_is_no_error_here() -> None:
    assert fingerprint("aerosonde")["model"] != fingerprint("c172x")["model"]
    assert "none" in fingerprint("nothing")["model"]
    assert len(code_hash()) == 16
