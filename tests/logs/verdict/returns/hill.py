"""A hill 3 km east of home, and a mission straight over it to 6.5 km: what its returns come to can be summed up.

The hill is 400 m high, the ground elsewhere 0 m, the mission at 600 m.  A return from x metres east sinks from 600 m to
100 m over home on a straight line, 3 s late: over the hill it is at 100 + 500 * 3000 / x m and some 7 m more.  So it
hits the hill from far enough.
"""

from pathlib import Path

from flight.mission.items import Mission
from flight.mission_files.formats import read_mission
from flight.simulation.setup import FlightSetup
from logs.verdict.returns.drawn_returns import DrawnReturns, collect_drawn_returns
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.return_starts import planned_starts
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from world.scenario import load_scenario

# Its destination is 100 m beyond the mission's end, so the return after the mission is judged.
SCENARIO = """
name = "hill"
[origin]
lat_deg = 46.0
lon_deg = 8.0
[area]
east_m = [-2000, 9000]
north_m = [-3000, 3000]
[start]
east_m = 0
north_m = 0
amsl_m = 600
[destination]
east_m = 6600
north_m = 0
amsl_m = 600
[terrain]
kind = "peaks"
[[terrain.peak]]
east_m = 3000
north_m = 0
height_m = 400
sigma_m = 300
"""
HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1\n"
# 1 km east is 0.0129119 degrees of longitude at 46 degrees north (WGS 84: 77,448 m a degree).
DEGREE = 77_448.0
# Lands at no place: ends at 6.5 km.
WAY = (0.0, 6500.0)


def mission_text(*east: float, amsl: float = 600.0, back: bool = False) -> str:
    """A mission file along a line of latitude through places (m east), at a height."""
    rows = [
        f"{k}\t0\t0\t16\t0\t0\t0\t0\t46.0\t{8.0 + x / DEGREE:.7f}\t{amsl:g}\t1" for k, x in enumerate(east or WAY, 1)
    ]
    rows += [f"{len(rows) + 1}\t0\t0\t20\t0\t0\t0\t0\t0\t0\t0\t1"] if back else []
    return HEAD + "\n".join(rows) + "\n"


def hill_setup(folder: Path, more: str = "", mission: str = "", rally: tuple[object, ...] = ()) -> FlightSetup:
    """The setup of a mission over the hill.

    more: of the scenario's file.  mission: its text.  rally: items.
    """
    file, way = folder / "hill.toml", folder / "hill.waypoints"
    file.write_text(SCENARIO + more, encoding="utf-8")
    way.write_text(mission or mission_text(), encoding="utf-8")
    scenario, read = load_scenario(str(file)), read_mission(way)
    made = Mission(read.home, read.items, rally=rally, source=read.source)  # type: ignore[arg-type]
    return make_setup(scenario, load_uav(scenario), made, 1)


def hill_drawn(setup: FlightSetup, every: float = 10.0) -> DrawnReturns:
    """What is drawn of the returns and glides from its planned path."""
    world, starts = make_return_world(setup), planned_starts(setup, every)
    return collect_drawn_returns(world, starts, judge_returns(world, starts, every), judge_glides(world, starts))
