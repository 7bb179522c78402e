"""Malformed mission files by name, each with what the refusal must say."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from flight.mission_files.formats import read_mission
from world.errors import MissionError

HOME_LINE = "0\t1\t0\t16\t0\t0\t0\t0\t36.5\t-84.2\t300\t1"


def wpl(*fields: str, at: dict[int, str] | None = None) -> str:
    """A file whose third line has these columns changed."""
    line = ["1", "0", "3", "16", "0", "0", "0", "0", "36.5", "-84.2", "300", "1"]
    for column, value in (at or {}).items():
        line[column] = value
    return "\n".join(["QGC WPL 110", HOME_LINE, "\t".join(fields or line)]) + "\n"


BAD_WPL = {
    "empty": ("", "empty"),
    "blank": (" \n\n", "empty"),
    "only-comments": ("# nothing\n", "empty"),
    "no-header": (HOME_LINE + "\n", ":1: header"),
    "other-version": ("QGC WPL 100\n" + HOME_LINE, ":1: header"),
    "header-only": ("QGC WPL 110\n", "no items"),
    "html": ("<!DOCTYPE html>\n<html></html>", ":1: header"),
    "eleven-columns": (wpl("1", "0", "3", "16", "0", "0", "0", "0", "36.5", "-84.2", "300"), ":3: 11 columns"),
    "thirteen-columns": (
        wpl(*["1", "0", "3", "16", "0", "0", "0", "0", "36.5", "-84.2", "300", "1", "9"]),
        ":3: 13 columns",
    ),
    "empty-column": (wpl("1", "0", "3", "16", "", "0", "0", "0", "36.5", "-84.2", "300", "1"), ":3: 11 columns"),
    "nan-latitude": (wpl(at={8: "nan"}), ":3: latitude 'nan'"),
    "photos-everywhere": (wpl(at={3: "206", 4: "1e-6"}), ":3: p1 1e-06: a distance between photos is 0 for off, or at"),
    "nan-parameter": (wpl(at={4: "NaN"}), ":3: p1 'NaN'"),
    "inf-altitude": (wpl(at={10: "inf"}), ":3: altitude 'inf'"),
    "overflow": (wpl(at={10: "1e999"}), ":3: altitude '1e999'"),
    "latitude-91": (wpl(at={8: "91"}), ":3: latitude 91: allowed -90..90"),
    "longitude-181": (wpl(at={9: "-180.5"}), ":3: longitude -180.5: allowed -180..180"),
    "swapped": (wpl(at={8: "-112.2", 9: "36.5"}), "latitude and longitude swapped?"),
    "home-latitude": (wpl().replace("\t36.5\t", "\t136.5\t", 1), ":2: latitude 136.5"),
    "decimal-comma": (wpl(at={10: "12,5"}), ":3: altitude '12,5': expected a finite number (a decimal comma?)"),
    "word": (wpl(at={9: "west"}), ":3: longitude 'west'"),
    "hex": (wpl(at={4: "0x10"}), ":3: p1 '0x10'"),
    "underscore": (wpl(at={10: "1_000"}), ":3: altitude '1_000'"),
    "arabic-digits": (wpl(at={10: "٣٠٠"}), ":3: altitude"),
    "negative-seq": (wpl(at={0: "-1"}), ":3: seq '-1'"),
    "float-seq": (wpl(at={0: "1.5"}), ":3: seq '1.5'"),
    "huge-seq": (wpl(at={0: "99999"}), ":3: seq '99999'"),
    "current-2": (wpl(at={1: "2"}), ":3: current '2'"),
    "frame-1": (wpl(at={2: "1"}), ":3: frame 1: allowed 0, 2, 3, 5, 6, 10, 11"),
    "frame-2-waypoint": (wpl(at={2: "2"}), ":3: frame 2"),
    "negative-command": (wpl(at={3: "-16"}), ":3: command '-16'"),
    "altitude": (wpl(at={10: "50000"}), ":3: altitude 50000: allowed -1000..20000"),
    "autocontinue": (wpl(at={11: "yes"}), ":3: autocontinue 'yes'"),
    "jump-count": (wpl(*["1", "0", "2", "177", "1", "-2", "0", "0", "0", "0", "0", "1"]), ":3: p2 -2"),
    "jump-target": (wpl(*["1", "0", "2", "177", "1.5", "2", "0", "0", "0", "0", "0", "1"]), ":3: p1 1.5"),
    "loiter-turns": (wpl(*["1", "0", "3", "18", "-2", "0", "0", "0", "36.5", "-84.2", "300", "1"]), ":3: p1 -2"),
    "too-many": ("QGC WPL 110\n" + "\n" * 5 + f"{HOME_LINE}\n" * 20_001, "too long: 20,001 items; the limit is 20,000"),
    "json-in-disguise": ('{"fileType": "Plan"', "not valid JSON"),
}


BAD_BYTES = {
    "nul": (b"QGC WPL 110\n0\t1\0", ":2: contains a NUL byte"),
    "utf-16": ("QGC WPL 110\n".encode("utf-16"), "UTF-16"),
    "latin-1": (b"QGC WPL 110\n# H\xf6he\n", ":2: not a text file in UTF-8"),
    "zip": (b"PK\x03\x04" + bytes(range(256)), "NUL"),
    "large": (b"#" * (16 * 2**20 + 1), "at most 16,777,216"),
}


def plan_data(**changes: Any) -> dict[str, Any]:
    """A small plan, with keys of its only item changed."""
    item: dict[str, Any] = {
        "autoContinue": True,
        "command": 16,
        "doJumpId": 1,
        "frame": 3,
        "params": [0, 0, 0, None, 36.5, -84.2, 300],
        "type": "SimpleItem",
    }
    item |= changes
    return {"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": [item]}}


def with_key(path: str, value: Any) -> dict[str, Any]:
    """A small plan with one key changed."""
    data = plan_data()
    *parents, key = path.split(".")
    place = data
    for parent in parents:
        place = place.setdefault(parent, {"version": 2})
    place[key] = value
    return data


BAD_PLAN = {
    "truncated": (json.dumps(plan_data())[:-9], "not valid JSON"),
    "list": ("[]", "got list"),
    "deep": ("[" * 100_000, "not valid JSON"),
    "nan": (json.dumps(plan_data(params=[0, 0, 0, 0, math.nan, 0, 0])), "NaN is not a number"),
    "overflow": (json.dumps(plan_data()).replace("36.5", "1e999"), "mission.items.0.params.4"),
    "long-integer": (json.dumps(plan_data()).replace("36.5", "9" * 400), "mission.items.0.params.4"),
    "other-file": (with_key("fileType", "Mission"), 'fileType: "Mission": expected "Plan"'),
    "version": (with_key("version", 3), "version: 3"),
    "no-mission": ({"fileType": "Plan", "version": 1}, "mission: missing"),
    "mission-version": (with_key("mission.version", 1), "mission.version: 1"),
    "no-items": (with_key("mission.items", []), "mission.items: no items"),
    "items-null": (with_key("mission.items", None), "mission.items: null"),
    "complex": (plan_data(type="ComplexItem", complexItemType="StructureScan"), "mission.items.0.type"),
    "empty-survey": (plan_data(type="ComplexItem", complexItemType="survey"), "TransectStyleComplexItem.Items"),
    "landing-pattern": (plan_data(type="ComplexItem", complexItemType="fwLandingPattern"), "landCoordinate: missing"),
    "text-number": (plan_data(params=["0", 0, 0, 0, 0, 0, 0]), "mission.items.0.params.0"),
    "boolean-number": (plan_data(params=[True, 0, 0, 0, 0, 0, 0]), "mission.items.0.params.0"),
    "six-params": (plan_data(params=[0] * 6), "mission.items.0.params"),
    "latitude-91": (plan_data(params=[0, 0, 0, 0, 91, 0, 0]), "(item 1): latitude 91: allowed -90..90"),
    "frame-1": (plan_data(frame=1), "(item 1): frame 1"),
    "frame-text": (plan_data(frame="3"), 'mission.items.0.frame: "3"'),
    "command-float": (plan_data(command=16.5), "mission.items.0.command: 16.5"),
    "command-negative": (plan_data(command=-1), "mission.items.0.command: -1"),
    "id-repeated": (
        {"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": plan_data()["mission"]["items"] * 2}},
        "mission.items.1.doJumpId: 1: must be above",
    ),
    "home-latitude": (with_key("mission.plannedHomePosition", [100, 0, 0]), "plannedHomePosition: latitude 100"),
    "home-short": (with_key("mission.plannedHomePosition", [36, -84]), "mission.plannedHomePosition"),
    "cruise": (with_key("mission.cruiseSpeed", -1), "mission.cruiseSpeed: -1"),
    "fence-radius": (
        with_key("geoFence.circles", [{"circle": {"center": [0, 0], "radius": -5}, "inclusion": True}]),
        "geoFence.circles.0.circle.radius: -5",
    ),
    "fence-corners": (
        with_key("geoFence.polygons", [{"polygon": [[0, 0], [1, 1]], "inclusion": True}]),
        "geoFence.polygons.0.polygon",
    ),
    "rally": (with_key("rallyPoints.points", [[95, 0, 0]]), "rallyPoints.points.0: latitude 95"),
}


def refused(file: Path, wanted: str) -> None:
    """Reading ends in one line that names the file and says what is wrong."""
    with pytest.raises(MissionError) as caught:
        read_mission(file)
    message = str(caught.value)
    assert message.startswith(str(file))
    assert wanted in message
    assert "\n" not in message
    assert len(message) < len(str(file)) + 300
