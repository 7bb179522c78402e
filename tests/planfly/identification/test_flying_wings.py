"""A flying wing of known truth, flown by ArduPlane's law with elevons, and identified by the command."""

from pathlib import Path

import numpy as np
import pytest

import planfly
from aircraft.catalog import read_aircraft
from aircraft.uncertainty import read_uncertainty
from flight.dynamics.envelope_tables import load_envelope
from planfly.cli import main
from tests.instrumented_flights import drawn_sensors, write_motion
from tests.instrumented_wings import changed_wing, fly_wing, log_of_elevons
from tests.soak import SOAK

# Factors of the data sheet's model, each over what it has.
TRUTH = {"zero-lift-drag": 1.25, "thrust": 0.9, "elevator-power": 0.8, "aileron-power": 0.85, "roll-damping": 1.2}


@pytest.mark.skipif(not SOAK, reason="half a minute of computing")
def test_a_flying_wing_is_found_from_its_elevons(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sheet = planfly.new_aircraft("foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
    truth = changed_wing(sheet, tmp_path / "truth", TRUTH)
    track = fly_wing(truth, tmp_path, 5)
    write_motion(tmp_path / "a.BIN", log_of_elevons(track, truth, drawn_sensors(5, battery=True), 5))
    arguments = [
        "--mass",
        "2.1",
        "--span",
        "1.6",
        "--area",
        f"{sheet.wing_area}",
        "--base",
        "./foam",
        "--out",
        "./mine",
    ]
    assert main(["aircraft", "--identify", "a.BIN", *arguments]) == 0
    known = read_uncertainty(tmp_path / "mine")
    assert known is not None
    found = {one.name.removeprefix("ident/"): (one.estimate, one.sd) for one in known.quantities}
    for name, value in TRUTH.items():
        estimate, sd = found[name]
        assert abs(estimate - value) < 3.0 * sd, name
    for name in ("zero-lift-drag", "thrust"):
        assert found[name][0] == pytest.approx(TRUTH[name], abs=0.1), name
    # What the elevator does is seen best against the stiffness that it works against, which is the sheet's.
    assert found["elevator-power"][0] / found["pitch-stiffness"][0] == pytest.approx(TRUTH["elevator-power"], abs=0.08)
    best, right = (load_envelope(one).air_angles(15.0, 480.0) for one in (read_aircraft(tmp_path / "mine"), truth))
    assert np.degrees(best) == pytest.approx(np.degrees(right), abs=1.2)
    assert main(["check", "mine/identify.waypoints", "--aircraft", "./mine"]) in (0, 3)
