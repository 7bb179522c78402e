"""Campaigns for tests: a short mission over level ground, and flights that are made up instead of flown."""

import os
import sqlite3
import time
from pathlib import Path
from typing import Any

from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, open_campaign
from planfly.campaigns.dispersions import Dispersions, default_dispersions, draw_flight
from planfly.campaigns.flight_row import FlightRow, MinimumMargin
from planfly.campaigns.tables import RUN_DEPENDENT_COLUMNS

SCENARIO = """\
name = "short"
[terrain]
kind = "flat"
amsl_m = 100
[origin]
lat_deg = 46.0
lon_deg = 8.0
[area]
east_m = [-500, 2500]
north_m = [-800, 800]
ceiling_amsl_m = 400
[start]
east_m = 0
north_m = 0
amsl_m = 180
[destination]
east_m = 1500
north_m = 0
amsl_m = 180
[limits]
min_clearance_m = 60
[flight]
autopilot = "planfly"
[wind]
speed_mps = 5
from_deg = 250
turbulence = "light"
"""
# Waypoints 0, 700 and 1,400 m east of 46 N, 8 E.
MISSION = """\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t180\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.00904\t180\t1
3\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.01808\t180\t1
"""


def write_short(folder: Path) -> tuple[Path, Path]:
    """The mission's file and the scenario's."""
    scenario, mission = folder / "short.toml", folder / "short.waypoints"
    scenario.write_text(SCENARIO)
    mission.write_text(MISSION)
    return mission, scenario


def short_base(folder: Path, dispersions: Dispersions | None = None, seed: int = 1) -> CampaignBase:
    mission, scenario = write_short(folder)
    return open_campaign(str(mission), dispersions or default_dispersions(), {"scenario": scenario, "seed": seed})


def table(path: Path) -> list[tuple[Any, ...]]:
    """All rows of a table that nobody holds, in order, to the byte, but for who flew and how long that took."""
    connection = sqlite3.connect(path.absolute().as_uri() + "?mode=ro", uri=True)
    try:
        rows = connection.execute("SELECT * FROM flights ORDER BY flight")
        names = [column[0] for column in rows.description]
        left_out = {names.index(name) for name in (*RUN_DEPENDENT_COLUMNS, "checksum")}
        return [tuple(value for k, value in enumerate(row) if k not in left_out) for row in rows]
    finally:
        connection.close()


def made_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A flight whose outcome follows from its draw: nine of ten fly; in a wind from W at most 12 m/s, else 8."""
    draw = draw_flight(base.dispersions, base.seed, index)
    luck = draw.seed % 1000 / 1000.0
    strong = 12.0 if wind is not None and wind.from_deg == 270.0 else 8.0
    good = luck < 0.9 if wind is None else wind.speed < strong + luck - 0.5
    margin = MinimumMargin(1.0 if good else -1.0, "m", Place("leg", 1))
    failed = () if good else (("clearance", Place("leg", 1)),)
    return FlightRow(
        draw,
        outcome="flyable" if good else "not flyable",
        ended="completed",
        failed=failed,
        margins=(("clearance", margin),),
        energy_left=50.0 * luck,
        duration=60.0,
        seconds=0.01,
    )


def all_fly(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A made flight that always flies."""
    draw = draw_flight(base.dispersions, base.seed, index)
    return FlightRow(draw, "flyable", "completed", energy_left=50.0, duration=60.0)


def slow_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """A made flight that takes a while, for whoever is to be killed meanwhile."""
    time.sleep(0.05)
    return made_flight(base, index, wind)


def deadly_in_the_east(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Flight 9 in wind from the east, of 5 m/s where it is among the second six, ends its worker's process."""
    if index == 9 and wind is not None and wind.from_deg == 90.0:
        os.abort()
    return made_flight(base, index, wind)
