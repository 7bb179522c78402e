"""Missions of dataflash logs, and home where they hold none."""

from pathlib import Path

from flight.mission.items import Home
from logs.field_logs.readers.dataflash_log import read_dataflash
from tests.logs.field_logs.written_logs import DataflashWriter


def test_home_is_the_vehicles_where_the_mission_holds_none(tmp_path: Path) -> None:
    item = ("CMD", "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame")
    origin = ("ORGN", "QBLLf", "TimeUS,Type,Lat,Lng,Alt")
    unset = (*item, 0, 3, 0, 16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    items = [(*item, 0, 3, k, 16, 0.0, 0.0, 0.0, 0.0, 46.0, 8.0 + k * 0.01, 100.0, 3) for k in (1, 2)]
    out = DataflashWriter()
    for message in ((*origin, 0, 0, 47.0, 9.0, 1.0), (*origin, 0, 1, 46.5, 8.5, 431.0), unset, *items):
        out.message(*message)
    out.message("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", 0, 46.0, 8.0, 500.0, 0.0)
    path = tmp_path / "a.BIN"
    path.write_bytes(bytes(out.data))
    (logged,) = read_dataflash(path).missions
    assert logged.mission.home == Home(46.5, 8.5, 431.0)
    assert [(item.seq, item.frame, item.alt) for item in logged.mission.items] == [(1, 3, 100.0), (2, 3, 100.0)]
