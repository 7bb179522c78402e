"""Missions that turn back, and legs above ground, over a hill: the path that is judged is the path that is flown.

A fly-by arc that turns by 174 degrees begins 2 km before its waypoint; ArduPlane and PX4 fly on to the waypoint.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import planfly
from planfly.cli import main

HOME = (36.5, -84.2)
# m by degree of latitude, and of longitude there.
NORTH, EAST = 110_950.0, 111_320.0 * math.cos(math.radians(HOME[0]))
GROUND = 300.0
LAWS = ("ardupilot", "px4", "planfly")


def row(seq: int, east: float, north: float, height: float, frame: int = 3) -> str:
    lat, lon = HOME[0] + north / NORTH, HOME[1] + east / EAST
    return f"{seq} {int(seq == 0)} {0 if seq == 0 else frame} 16 0 0 0 0 {lat:.7f} {lon:.7f} {height} 1"


def write_mission(folder: Path, *places: tuple[float, float, float], frame: int = 3) -> str:
    rows = [row(0, 0.0, 0.0, GROUND), *(row(k, *place, frame) for k, place in enumerate(places, 1))]
    file = folder / "there-and-back.waypoints"
    file.write_text("\n".join(["QGC WPL 110", *rows]) + "\n", encoding="utf-8")
    return str(file)


def write_hill(folder: Path, north: float, top: float, slope: float = 1.0) -> str:
    """A cone on level ground, this far north of home, top m above it."""
    lat = HOME[0] + np.linspace(8000.0, -3000.0, 551) / NORTH
    lon = HOME[1] + np.linspace(-4000.0, 4000.0, 401) / EAST
    away = np.hypot((lat[:, None] - HOME[0]) * NORTH - north, (lon[None, :] - HOME[1]) * EAST)
    heights = GROUND + np.maximum(0.0, top - slope * away)
    file = folder / "hill.npz"
    edges = {"xmin": lon[0], "xmax": lon[-1], "ymin": lat[-1], "ymax": lat[0]}
    np.savez(file, elevation=heights.astype(np.float32), **edges)
    return str(file)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("turn_deg", [165.0, 174.0, 180.0])
def test_a_waypoint_inside_a_hill_is_not_flyable_however_sharp_its_turn(
    turn_deg: float, law: str, tmp_path: Path
) -> None:
    """The waypoint is 200 m inside the hill, and the fly-by arc turns before it."""
    back = 2400.0 * math.cos(math.radians(180.0 - turn_deg))
    aside = 2400.0 * math.sin(math.radians(180.0 - turn_deg))
    mission = write_mission(tmp_path, (0.0, 0.0, 200.0), (0.0, 2500.0, 200.0), (aside, 2500.0 - back, 200.0))
    terrain = write_hill(tmp_path, 2500.0, 400.0, slope=2.0)
    assert main(["check", mission, "--terrain", terrain, "--autopilot", law]) == 4
    geometry = planfly.check(mission, terrain=terrain, autopilot=law, geometry=True)
    assert {item.place.to_item for item in geometry.failed if item.rule == "clearance"} == {2, 3}


@pytest.mark.parametrize("law", LAWS)
def test_there_and_back_over_level_ground_is_flown_to_the_waypoint_and_flyable(law: str, tmp_path: Path) -> None:
    mission = write_mission(tmp_path, (0.0, 0.0, 200.0), (0.0, 2500.0, 200.0), (0.0, 0.0, 200.0))
    flown = planfly.fly(mission, terrain=write_hill(tmp_path, 7000.0, 1.0), autopilot=law)
    assert flown.verdict.flyable, flown.verdict.summary
    # ArduPlane turns at WP_RADIUS, 90 m; the other two fly over the waypoint.
    assert flown.track.position[:, 1].max() > 2500.0 - (91.0 if law == "ardupilot" else 10.0)
    assert planfly.check(mission, terrain=write_hill(tmp_path, 7000.0, 1.0), autopilot=law, geometry=True).flyable


@pytest.mark.parametrize("law", ["ardupilot", "planfly"])
def test_a_leg_above_ground_follows_the_ground(law: str, tmp_path: Path) -> None:
    """A straight leg would meet the hill's flank of 5 degrees 30 m below its top."""
    places = (0.0, 0.0, 100.0), (0.0, 1000.0, 100.0), (0.0, 6500.0, 100.0)
    terrain = write_hill(tmp_path, 4000.0, 130.0, slope=math.tan(math.radians(5.0)))
    flown = planfly.fly(write_mission(tmp_path, *places, frame=10), terrain=terrain, autopilot=law)
    # The return after the last item, straight and at RTL_ALTITUDE, meets the hill.
    assert {finding.rule for finding in flown.verdict.failed} == ({"return"} if law == "ardupilot" else set())
    assert flown.track.clearance.min() > 85.0
    # TERRAIN_LOOKAHD lifts ArduPlane before the top, by no more than the hill's height above half of its climb.
    assert flown.track.clearance.max() < 130.0
    straight = planfly.fly(write_mission(tmp_path, *places, frame=3), terrain=terrain, autopilot=law)
    assert straight.ended == "ground contact"


def test_ground_steeper_than_the_aircraft_climbs_is_not_flyable_on_a_leg_above_ground(tmp_path: Path) -> None:
    places = (0.0, 0.0, 60.0), (0.0, 1000.0, 60.0), (0.0, 6500.0, 60.0)
    terrain = write_hill(tmp_path, 4000.0, 900.0, slope=0.9)
    assert main(["check", write_mission(tmp_path, *places, frame=10), "--terrain", terrain]) == 4


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_zone_on_one_side_of_a_reversal_is_never_flyable(side: float, law: str, tmp_path: Path) -> None:
    """The turn of 180 degrees needs 230 m or more to one side, and navigation errors decide which."""
    mission = write_mission(tmp_path, (0.0, 0.0, 200.0), (0.0, 2500.0, 200.0), (0.0, 0.0, 200.0))
    corners = ((100.0, 2200.0), (700.0, 2200.0), (700.0, 3200.0), (100.0, 3200.0), (100.0, 2200.0))
    ring = [[HOME[1] + side * east / EAST, HOME[0] + north / NORTH] for east, north in corners]
    zone = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": "yard"},
                "geometry": {"type": "Polygon", "coordinates": [ring]},
            }
        ],
    }
    file = tmp_path / "yard.geojson"
    file.write_text(json.dumps(zone), encoding="utf-8")
    given = {"terrain": write_hill(tmp_path, 7000.0, 1.0), "fence": [str(file)], "autopilot": law}
    for geometry in (False, True):
        assert not planfly.check(mission, **given, geometry=geometry).flyable


@pytest.mark.parametrize(("law", "reads"), [("ardupilot", 255.0), ("px4", 300.0)])
def test_arduplane_reads_an_acceptance_radius_as_a_byte(law: str, reads: float, tmp_path: Path) -> None:
    """`AP_Mission` stores the radius of a waypoint in eight bits."""
    mission = write_mission(tmp_path, (0.0, 0.0, 200.0), (0.0, 2500.0, 200.0), (2500.0, 2500.0, 200.0))
    text = Path(mission).read_text(encoding="utf-8").replace("16 0 0 0 0", "16 0 300 0 0")
    Path(mission).write_text(text, encoding="utf-8")
    verdict = planfly.check(mission, terrain=write_hill(tmp_path, 7000.0, 1.0), autopilot=law)
    passed = [item.limit for item in verdict.findings if item.rule == "waypoint" and item.place.item == 2]
    assert passed == [reads]
