"""The longest accepted outage, and the time after which the autopilot leaves: just inside and just outside."""

import math
from dataclasses import replace

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import of
from tests.synthetic import make_setup
from world.frames import GeoOrigin
from world.radio import make_link
from world.scenario_tables import LinkTable

# 100 dB are left, which free space takes over 0.299792458 m / (4 pi) * 10^5 = 2385.67 m at 1 GHz.  From an antenna at
# the aircraft's height the outage begins there, 2614.33 m before the end of 5 km.  An equivalent airspeed of 25 m/s is
# 1.0145 times faster in the standard atmosphere at 300 m.
LENGTH_M = 5000.0
OUTAGE_M = LENGTH_M - 0.299792458 / (4.0 * math.pi) * 1e5
AIRSPEED_MPS = 25.0 / math.sqrt((1.0 - 0.0065 * 300.0 / 288.15) ** 4.2559)


def linked(accepted: float, autopilot: ArduPlane, beyond_db: float = 0.0) -> FlightSetup:
    """Return a straight flight away from the station, with 100 dB left between the antennas, and so much more."""
    budget = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -90.0, "antenna_m": 300.0}
    table = LinkTable(**budget, east_m=0.0, north_m=0.0, max_outage_s=accepted)
    link = make_link(table, "mine.toml", GeoOrigin(46.0, 8.0), None)
    assert link is not None
    setup = make_setup([[0, 0, 300], [0, LENGTH_M, 300]])
    link = replace(link, allowed_loss=link.allowed_loss + beyond_db)
    return replace(setup, scenario=replace(setup.scenario, link=link), autopilot=autopilot)


@pytest.mark.parametrize(("beyond", "ok"), [(-0.01, True), (0.01, False)])
@pytest.mark.parametrize("limited_by", ["scenario", "autopilot"])
def test_the_longest_outage(limited_by: str, beyond: float, ok: bool) -> None:
    limit = OUTAGE_M / AIRSPEED_MPS - beyond
    values = {"FS_GCS_ENABL": 1.0, "FS_LONG_ACTN": 3.0, "FS_LONG_TIMEOUT": limit} if limited_by == "autopilot" else {}
    autopilot = ArduPlane(ArduPilotParameters.defaults().changed(**values))
    item = of(judge_geometry(linked(3600.0 if values else limit, autopilot)), "link")
    assert item.planned == pytest.approx(OUTAGE_M / AIRSPEED_MPS, abs=0.005)
    assert (item.ok, item.limit_source) == (ok, limited_by)


@pytest.mark.parametrize(("beyond_db", "ok"), [(0.001, True), (-0.001, False)])
def test_no_outage_is_accepted_by_default(beyond_db: float, ok: bool) -> None:
    """Free space takes 20 log(5000 / 2385.67) dB more over the whole way."""
    whole_way_db = 20.0 * math.log10(LENGTH_M / (LENGTH_M - OUTAGE_M))
    setup = linked(0.0, ArduPlane(ArduPilotParameters.defaults()), whole_way_db + beyond_db)
    assert of(judge_geometry(setup), "link").ok is ok
