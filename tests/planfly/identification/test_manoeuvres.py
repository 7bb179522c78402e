from pathlib import Path

import numpy as np

import planfly
from aircraft.catalog import load_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Command
from flight.mission_files.formats import waypoints_text
from planfly.identification.manoeuvres import make_identification_mission


def test_the_mission_can_be_flown_and_shows_what_it_is_for(tmp_path: Path) -> None:
    aircraft = load_aircraft("aerosonde")
    mission = make_identification_mission(
        aircraft, load_envelope(aircraft), 36.2578, -84.1401, 335.0, max_rates=(5.6, 5.6)
    )
    speeds = {item.params[1] for item in mission.items if item.command == Command.DO_CHANGE_SPEED}
    assert len(speeds) >= 4
    file = tmp_path / "identify.waypoints"
    file.write_text(waypoints_text(mission), encoding="utf-8")
    flown = planfly.fly(str(file), params=str(aircraft.folder / "ardupilot.parm"), turbulence="light", seed=1)
    assert flown.verdict.flyable, flown.verdict.lines
    assert 300.0 < flown.track.time[-1] < 500.0
    throttle = flown.track.commands[:, 3]
    # Some 20 s each near full throttle and near idle.
    assert np.count_nonzero(throttle > 0.95) / 60.0 > 20.0
    assert np.count_nonzero(throttle < 0.62) / 60.0 > 20.0
