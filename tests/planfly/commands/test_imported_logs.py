import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from flight.mission_files.formats import mission_text
from logs.importers.raw_log import RawLog, example_raw_log
from logs.recording.example_log import write_example_log
from logs.recording.reader import read_log
from planfly.cli import main
from tests.logs.importers.written_logs import columns, dataflash, gpx, igc, kml, px4, telemetry
from tests.planfly.commands.imported_log_files import FLIGHTS, example_plan
from tests.soak import SOAK

# ----------------------------------------------------------------------
# `planfly import` and `planfly check LOG`: every format, refusals, and what the other commands make of the result.

WRITERS: dict[str, Callable[[Path], Path]] = {
    "a.BIN": dataflash,
    "a.tlog": telemetry,
    "a.ulg": px4,
    "a.gpx": gpx,
    "a.igc": igc,
    "a.kml": kml,
    "a.columns.toml": columns,
}
Output = pytest.CaptureFixture[str]


@pytest.mark.parametrize("name", WRITERS)
def test_each_format_becomes_a_log_of_our_own(tmp_path: Path, capsys: Output, name: str) -> None:
    log = WRITERS[name](tmp_path / name)
    plan = example_plan(tmp_path)
    assert main(["import", str(log), str(tmp_path / "a.mcap"), "--plan", str(plan)]) == 0
    written = capsys.readouterr().out
    assert main(["check", str(tmp_path / "a.mcap")]) == 0
    again = capsys.readouterr().out
    assert written.startswith(again)
    assert main(["check", str(log), "--plan", str(plan)]) == 0
    assert capsys.readouterr().out == again
    source = read_log(tmp_path / "a.mcap").setup.imported_log
    assert source is not None
    assert (source.file, source.mission, len(source.sha256)) == (name, "of plan.waypoints", 64)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize(("radius", "code"), [(100.0, 4), (None, 0)])
def test_a_flight_of_the_field_is_held_against_a_fence_that_is_named(
    tmp_path: Path, capsys: Output, radius: float | None, code: int
) -> None:
    """An exclusion about its second waypoint; or a zone that lies far from all of it."""
    log = dataflash(tmp_path / "a.BIN")
    fence = tmp_path / ("around.fence" if radius else "far.geojson")
    if radius:
        fence.write_text(f"QGC WPL 110\n0\t0\t0\t5004\t{radius}\t0\t0\t0\t46.0089967\t8.0\t0\t1\n")
    else:
        ring = [[8.1, 46.1], [8.11, 46.1], [8.11, 46.11], [8.1, 46.1]]
        fence.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    assert main(["import", str(log), str(tmp_path / "a.mcap"), "--fence", str(fence)]) == code
    written = capsys.readouterr().out
    assert ("fence item 0 (exclusion) violated" in written) == (code == 4)
    assert main(["check", str(log), "--fence", str(fence)]) == code
    assert written.startswith(capsys.readouterr().out)
    # The log has kept it.
    assert main(["check", str(tmp_path / "a.mcap")]) == code


def test_the_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    log = dataflash(tmp_path / "a.BIN")
    for name in ("one.mcap", "two.mcap"):
        assert main(["import", str(log), str(tmp_path / name)]) == 0
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()


def test_a_track_alone_needs_a_plan(tmp_path: Path, capsys: Output) -> None:
    log = kml(tmp_path / "a.kml")
    assert main(["check", str(log)]) == 2
    said = "contains no mission; name the planned mission with --plan"
    assert capsys.readouterr().err == f"planfly: {log}: {said}\n"


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (
            lambda path: dataflash(path, program="ArduCopter V4.5.7 (x)"),
            "this log is from a copter (program ArduCopter V4.5.7 (x))",
        ),
        (
            lambda path: dataflash(path, program="ArduRover V4.5.0"),
            "this log is from a rover (program ArduRover V4.5.0)",
        ),
        (lambda path: px4(path, vehicle_type=1), "this log is from a copter (program PX4)"),
        (lambda path: telemetry(path, kind=10), "this log is from a rover"),
    ],
)
def test_other_vehicles_are_refused_by_name(
    tmp_path: Path, capsys: Output, write: Callable[[Path], Path], said: str
) -> None:
    suffix = ".tlog" if "of a rover" in said and "Ardu" not in said else ".BIN" if "Ardu" in said else ".ulg"
    log = write(tmp_path / f"a{suffix}")
    assert main(["import", str(log), str(tmp_path / "a.mcap")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "a.mcap").exists()


def test_the_wrong_place_and_the_wrong_order_are_told_in_a_line(tmp_path: Path, capsys: Output) -> None:
    log = dataflash(tmp_path / "a.BIN")
    plan = example_plan(tmp_path)
    lines = plan.read_text().splitlines()
    # Home, then the waypoints the other way round.
    header, home, *items = lines
    turned = [line.split("\t") for line in items]
    other = [[*one[:8], *two[8:]] for one, two in zip(turned, turned[::-1], strict=True)]
    wrong_order = tmp_path / "order.waypoints"
    wrong_order.write_text("\n".join([header, home, *("\t".join(line) for line in other)]) + "\n")
    assert main(["check", str(log), "--plan", str(wrong_order)]) == 2
    error = capsys.readouterr().err
    assert (
        error == f"planfly: {log}: not a flight of {wrong_order}: the flight passed its items in another order:"
        " 3, 2, 1, ...\n"
    )
    elsewhere = tmp_path / "place.waypoints"
    elsewhere.write_text(plan.read_text().replace("46.", "47."))
    assert main(["check", str(log), "--plan", str(elsewhere)]) == 2
    error = capsys.readouterr().err
    assert "the flight is elsewhere, at least 110" in error
    assert error.count("\n") == 1


def test_a_plan_other_than_the_logs_own_mission_is_told(tmp_path: Path, capsys: Output) -> None:
    log, plan = dataflash(tmp_path / "a.BIN"), example_plan(tmp_path)
    plan.write_text(plan.read_text().replace("\t500.000\t", "\t510.000\t", 1))
    assert main(["check", str(log), "--plan", str(plan)]) == 0
    assert (
        "1 item of the mission in the log has another position than in the plan; the first is item 1"
        in capsys.readouterr().out
    )


def test_a_log_with_a_loss_is_read_and_ends_with_3(tmp_path: Path, capsys: Output) -> None:
    log = dataflash(tmp_path / "a.BIN")
    data = log.read_bytes()
    log.write_bytes(data[: len(data) // 2] + data[len(data) // 2 + 20 :])
    assert main(["import", str(log), str(tmp_path / "a.mcap")]) == 3
    assert "Lost: 1 place in the file" in capsys.readouterr().out
    assert (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize(("lat", "lon", "up"), [(-33.9, -70.7, 900.0), (-17.0, 179.995, 120.0), (31.5, 35.45, -380.0)])
def test_flights_anywhere_are_judged_alike(tmp_path: Path, capsys: Output, lat: float, lon: float, up: float) -> None:
    """South and west, across the 180th meridian, below the sea."""
    raw = example_raw_log(lat, lon, up)
    for name, write in WRITERS.items():
        log = write(tmp_path / name, raw)  # type: ignore[call-arg]
        plan = tmp_path / "plan.waypoints"
        lines = ["QGC WPL 110"]
        mission = raw.missions[0].mission
        assert mission.home is not None
        rows = [(0, mission.home.lat_deg, mission.home.lon_deg, mission.home.alt)]
        rows += [(item.seq, item.lat_deg, item.lon_deg, item.alt) for item in mission.items]
        lines += [f"{seq}\t0\t0\t16\t0\t0\t0\t0\t{y:.8f}\t{x:.8f}\t{z:.6f}\t1" for seq, y, x, z in rows]
        plan.write_text("\n".join(lines) + "\n")
        assert main(["check", str(log), "--plan", str(plan)]) == 0, name
        assert "corridor         2 of 2 ok" in capsys.readouterr().out


def with_13_items() -> RawLog:
    """The example's flight along 13 waypoints, home beside them: six of 166.7 m on each leg, and the corner."""
    raw = example_raw_log()
    mission = raw.missions[0].mission
    first, corner, last = mission.items
    lats = [first.lat_deg + (corner.lat_deg - first.lat_deg) * min(k, 6) / 6.0 for k in range(13)]
    lons = [corner.lon_deg + (last.lon_deg - corner.lon_deg) * max(k - 6, 0) / 6.0 for k in range(13)]
    lats[7:] = [corner.lat_deg + (last.lat_deg - corner.lat_deg) * k / 6.0 for k in range(1, 7)]
    places = zip(lats, lons, strict=True)
    items = tuple(
        replace(first, seq=k, lat_deg=round(lat, 7), lon_deg=round(lon, 7)) for k, (lat, lon) in enumerate(places, 1)
    )
    return replace(raw, missions=(replace(raw.missions[0], mission=replace(mission, items=items)),))


# Of each format with a count of items: its writer, the number that it announces for 13 waypoints.
COUNTED = {"a.BIN": (dataflash, 14), "a.tlog": (telemetry, 14), "a.ulg": (px4, 13)}


@pytest.mark.parametrize("name", COUNTED)
def test_a_mission_that_is_in_the_log_in_part_is_judged_in_part(tmp_path: Path, capsys: Output, name: str) -> None:
    """The last item alone, more, or all 13 waypoints: each that the log does not hold is named."""
    write, total = COUNTED[name]
    assert main(["check", str(write(tmp_path / name, with_13_items()))]) == 0
    capsys.readouterr()
    for lost in range(1, 14) if SOAK else (1, 7, 11, 12, 13):
        log = write(tmp_path / name, with_13_items(), without_items=range(14 - lost, 14))
        missing = "item 13" if lost == 1 else f"items {14 - lost} to 13"
        named = f"{missing} of {total} {'is' if lost == 1 else 'are'} ignored or not in the log"
        code = main(["check", str(log)])
        out, error = capsys.readouterr()
        if lost < 12:
            assert (code, out.splitlines()[0]) == (3, f"not judged beyond item {13 - lost}: {named}")
            continue
        # Of one waypoint, or none, there is nothing to judge.
        where = " beyond item 1" if lost == 12 else ""
        says = f"{log}: not judged{where}: {named}; name the planned mission with --plan"
        assert (code, error) == (2, f"planfly: {says}\n")


@pytest.mark.parametrize("name", COUNTED)
def test_items_that_are_missing_anywhere_are_all_named(tmp_path: Path, capsys: Output, name: str) -> None:
    write, total = COUNTED[name]
    for lost, text in (
        ((1, 2, 3), "not judged before item 4: items 1 to 3 of {} are ignored or not in the log"),
        ((5,), "not judged before item 6: item 5 of {} is ignored or not in the log"),
        ((9, 13), "not judged beyond item 8: items 9 and 13 of {} are ignored or not in the log"),
        (
            (2, 8, 9, 13),
            "not judged before item 3 and beyond item 7: items 2, 8 to 9 and 13 of {} are ignored or not in the log",
        ),
    ):
        log = write(tmp_path / name, with_13_items(), without_items=lost)
        assert main(["check", str(log)]) == 3
        assert capsys.readouterr().out.splitlines()[0] == text.format(total)


def test_a_flight_that_is_judged_in_part_is_so_in_every_command(tmp_path: Path, capsys: Output) -> None:
    log = telemetry(tmp_path / "a.tlog", with_13_items(), without_items=range(7, 14))
    flight = tmp_path / "a.mcap"
    assert main(["import", str(log), str(flight), "--json", str(tmp_path / "a.json")]) == 3
    answer = json.loads((tmp_path / "a.json").read_text())
    assert (answer["exit_code"], answer["verdict"]["flyable"], answer["verdict"]["complete"]) == (3, False, False)
    assert main(["check", str(flight)]) == 3
    said = capsys.readouterr().out
    assert said.count("not judged beyond item 6: items 7 to 13 of 14 are ignored or not in the log") >= 2
    assert "6 of 6 legs" not in said
    # The whole mission beside it, and the flight is judged to its end.
    plan = tmp_path / "plan.waypoints"
    plan.write_text(mission_text(with_13_items().missions[0].mission, "waypoints"))
    assert main(["check", str(log), "--plan", str(plan)]) == 0


def test_what_fails_on_the_items_that_the_log_holds_is_not_flown_as_planned(tmp_path: Path, capsys: Output) -> None:
    """The third waypoint 300 m beside the flight."""
    raw = with_13_items()
    mission = raw.missions[0].mission
    items = list(mission.items)
    items[2] = replace(items[2], lon_deg=round(items[2].lon_deg + 0.0039, 7))
    moved = replace(raw, missions=(replace(raw.missions[0], mission=replace(mission, items=tuple(items))),))
    log = dataflash(tmp_path / "a.BIN", moved, without_items=range(7, 14))
    assert main(["check", str(log)]) == 4
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("not flown as planned: ")
    assert first.endswith("; not judged beyond item 6: items 7 to 13 of 14 are ignored or not in the log")


def test_options_that_do_not_go_together_are_refused(tmp_path: Path, capsys: Output) -> None:
    log = dataflash(tmp_path / "a.BIN")
    assert main(["check", str(log), "--guidance", "l1"]) == 2
    assert "--guidance: not allowed for an imported flight" in capsys.readouterr().err
    assert main(["check", str(example_plan(tmp_path)), "--flight", "1"]) == 2
    assert "--flight: allowed only with the log of another program, such as .BIN" in capsys.readouterr().err
    assert main(["import", str(log), str(log)]) == 2
    assert "is the input file" in capsys.readouterr().err


def test_the_other_commands_take_an_imported_flight(tmp_path: Path, capsys: Output) -> None:
    """Replay, compare and recover, and in a long run the report."""
    flight = tmp_path / "a.mcap"
    assert main(["import", str(FLIGHTS / "tight.BIN"), str(flight), "--scenario", "tight"]) == 4
    capsys.readouterr()
    assert main(["replay", str(flight)]) == 0
    assert "nan" not in capsys.readouterr().out.lower()
    assert main(["compare", str(flight), str(flight)]) == 0
    assert main(["recover", str(flight)]) == 0
    assert "there is nothing to recover" in capsys.readouterr().out
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(flight.read_bytes()[: flight.stat().st_size * 3 // 4])
    assert main(["recover", str(cut), "--out", str(tmp_path / "whole.mcap")]) == 3
    if SOAK:
        assert main(["report", str(flight), "--out", str(tmp_path / "report")]) == 4
        page = (tmp_path / "report" / "report.html").read_text()
        assert "tight.BIN" in page
        assert ">nan" not in page


@pytest.mark.usefixtures("unrendered")
def test_tables_pictures_and_a_log_of_the_models_flight(tmp_path: Path, capsys: Output) -> None:
    flight = tmp_path / "a.mcap"
    assert main(["import", str(dataflash(tmp_path / "a.BIN")), str(flight), "--aircraft", "aerosonde"]) == 0
    capsys.readouterr()
    assert main(["refly", str(flight)]) == 0
    out = capsys.readouterr().out
    assert "AUTO from 20.0 s to 111.8 s, legs 0 to 1: flown / simulated" in out
    blown = "Median difference (95 %) between the flight and model aerosonde in 3.0 m/s of wind, no gusts: cross-track"
    assert blown in out
    files = sorted(path.name for path in (tmp_path / "a-refly").iterdir())
    assert files == [
        *(f"refly-{name}.png" for name in ("bank", "cross-track", "energy", "ground-speed", "height")),
        "simulated.mcap",
    ]
    simulated = read_log(tmp_path / "a-refly" / "simulated.mcap")
    assert (simulated.complete, simulated.setup.imported_log) == (True, None)
    assert main(["refly", str(flight), "--out", str(tmp_path / "a-refly")]) == 2
    assert "not empty" in capsys.readouterr().err


@pytest.mark.usefixtures("unrendered")
def test_each_stretch_has_its_tables_and_files_and_what_is_left_is_named(tmp_path: Path, capsys: Output) -> None:
    """AUTO to waypoint 2, by hand, AUTO from before it to the end; and half a second of AUTO between."""
    modes = ((20.0, 10), (40.0, 5), (60.0, 10), (60.5, 5), (68.0, 10))
    flight = tmp_path / "a.mcap"
    main(["import", str(dataflash(tmp_path / "a.BIN", modes=modes)), str(flight), "--aircraft", "aerosonde"])
    capsys.readouterr()
    assert main(["refly", str(flight), "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "AUTO from 20.0 s to 40.0 s, legs 0 to 0: flown / simulated" in out
    assert "AUTO from 68.0 s to 111.8 s, legs 1 to 1: flown / simulated" in out
    assert "Not flown again: AUTO from 60.0 s to 60.5 s: it did not pass two waypoints in order" in out
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"simulated.mcap", "simulated-2.mcap", "refly-height.png", "refly-height-2.png"} <= files
    assert main(["refly", str(flight), "--out", str(tmp_path / "out"), "--overwrite"]) == 0


def test_a_flight_of_planflys_own_is_refused(tmp_path: Path, capsys: Output) -> None:
    log = write_example_log(tmp_path / "a.mcap")
    assert main(["refly", str(log)]) == 2
    assert "flown by planfly itself" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["refly", "replay", "report"])
def test_another_programs_log_is_to_be_imported_first(command: str, tmp_path: Path, capsys: Output) -> None:
    log = dataflash(tmp_path / "a.BIN")
    assert main([command, str(log)]) == 2
    way = f"`planfly import {log}` converts it to a flight log"
    assert capsys.readouterr().err == f"planfly: {log}: a log of another program; {way}\n"
