"""Whole missions by planfly's law as ArduPlane 4.6.3 and 4.7 flew them, as `kept_releases/` holds them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly

FOLDER = Path(__file__).with_name("kept_releases")
FLIGHTS: dict[str, dict[str, Any]] = json.loads((FOLDER / "flights.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_mission_is_flown_as_its_release_flew_it(name: str, tmp_path: Path) -> None:
    kept = FLIGHTS[name]
    options: dict[str, Any] = {key: kept[key] for key in ("terrain",) if key in kept}
    if "wind" in kept:
        options["wind"] = tuple(kept["wind"])
    if "params" in kept:
        options["params"] = FOLDER / kept["params"]
    options["autopilot"] = f"ardupilot-{kept.get('release', '4.6')}"
    flown = planfly.fly(FOLDER / kept["mission"], log=tmp_path / "flight.mcap", **options)
    track = flown.track
    # The verdict is that of the flight itself by the same limits.
    assert [finding.rule for finding in flown.verdict.findings if finding.ok is False] == kept["fails"]
    # The bounds are those within which the model is to agree with ArduPlane: 6 m, 10 m and 5 %.
    assert np.nanmin(track.clearance) == pytest.approx(kept["least_clearance_m"], abs=6.0)
    assert np.nanmax(np.abs(track.cross_track)) == pytest.approx(kept["largest_cross_track_m"], abs=10.0)
    assert track.energy[-1] == pytest.approx(kept["energy_wh"], rel=0.05)
    if name.startswith("below-home"):
        # 4.7 climbs steeply only up to CLIMB_SLOPE_HGT over home, 4.6 all the way: 1.7 % of energy apart.
        assert track.energy[-1] == pytest.approx(kept["energy_wh"], rel=0.005)
    # Without the end of the take-off by TKOFF_PLIM_SEC and the fading integrators the low pitch lands 5 s early.
    assert track.time[-1] == pytest.approx(kept["seconds"], rel=0.01)
