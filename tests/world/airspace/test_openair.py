"""OpenAir: each command by plain sums, files as they are published, and lines that are none."""

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
import shapely

from world.airspace.openair import NAUTICAL_MILE, openair_zones
from world.airspace.zone_files import is_zone_file, read_zone_file
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_map

HEAD = "AC R\nAN LAKE\nAL GND\nAH 2500ft AMSL\n"
CENTRE = GeoOrigin(46.0, 8.0)
SQUARE = "DP 46:00:00 N 008:00:00 E\nDP 46:00:00N 008:06:00E\nDP 46:06.000N 008:06.000E\nDP 46:06:00N 008:00:00E\n"


def entries_of(text: str) -> dict[str, Any]:
    ((_, entries),) = openair_zones(text, "z.openair")
    assert isinstance(entries, dict)
    return entries


def ring_of(text: str) -> list[tuple[float, float]]:
    """The ring of the only zone, (east, north) m about 46 N, 8 E."""
    (ring,) = entries_of(text)["rings_deg"]
    east, north = to_map(CENTRE, [lat for lat, _ in ring], [lon for _, lon in ring])
    return list(zip(east.tolist(), north.tolist(), strict=True))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("46:30:36N 008:15:00E", [46.51, 8.25]),
        ("46:30.600N 008:15.000E", [46.51, 8.25]),
        ("46:30.6 s, 008:15 w", [-46.51, -8.25]),
        # As some files have it: the next minute.
        ("46:29:60 N 008:14:60 E", [46.5, 8.25]),
    ],
)
def test_places(text: str, wanted: list[float]) -> None:
    corners = entries_of(f"{HEAD}DP {text}\nDP 47:00:00N 008:00:00E\nDP 47:00:00N 009:00:00E")["rings_deg"][0]
    assert corners[0] == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("low", "high", "wanted"),
    [
        ("GND", "2500ft AMSL", {"ceiling_amsl_m": 762.0}),
        ("SFC", "3000 MSL", {"ceiling_amsl_m": 914.4}),
        ("SFC", "UNLTD", {}),
        ("500ft AGL", "300m AGL", {"floor_agl_m": 152.4, "ceiling_agl_m": 300.0}),
        ("1500 GND", "UNL", {"floor_agl_m": 457.2}),
        # 9,500 ft are 2,895.6 m, and 400 m are kept for the pressure of the day.
        ("FL 95", "UNLIMITED", {"floor_amsl_m": 2495.6}),
        ("100 F ASFC", "4000ft STD", {"floor_agl_m": 30.48, "ceiling_amsl_m": 1619.2}),
        ("0", "1500M ALT", {"ceiling_amsl_m": 1500.0}),
    ],
)
def test_limits(low: str, high: str, wanted: dict[str, float]) -> None:
    entries = entries_of(f"AC R\nAN LAKE\nAL {low}\nAH {high}\n{SQUARE}")
    assert {key: value for key, value in entries.items() if "_m" in key} == pytest.approx(wanted)


def test_limits_the_wrong_way_round_are_swapped_and_said(tmp_path: Path) -> None:
    """As a zone of France's file of 2011 has them; the level's 400 m for the pressure of the day go upwards then.

    Above ground and above the sea are not compared: a hill of 400 m lies between these.
    """
    path = tmp_path / "zones.openair"
    upside_down = f"AC P\nAN R9B\nAH 1700F AMSL\nAL FL195\n{SQUARE}"
    circle = "AC D\nAN LOW\nAH 300m AGL\nAL 1000m AGL\nV X=46:00:00N 008:00:00E\nDC 5\n"
    path.write_text(f"{upside_down}{circle}AC D\nAN HILL\nAL 500m AMSL\nAH 300m AGL\n{SQUARE}", encoding="utf-8")
    found = read_zone_file(path, "z.openair")
    swapped, low, hill = found.zones
    assert (swapped.floor_amsl_m, swapped.ceiling_amsl_m) == pytest.approx((1700 * 0.3048, 19500 * 0.3048 + 400))
    assert (low.floor_agl_m, low.ceiling_agl_m) == (300.0, 1000.0)
    assert (hill.floor_amsl_m, hill.ceiling_agl_m) == (500.0, 300.0)
    assert found.notes == ["z.openair: lower and upper limits in the wrong order are swapped: R9B (P), LOW (D)"]


@pytest.mark.parametrize(
    ("limits", "wanted"),
    [
        ("AL GND\nAH 0", (None, None)),
        ("AL 0ft AGL\nAH 0ft AGL", (None, None)),
        ("AL 500ft AGL\nAH 0", (None, None)),
        ("AL 1000m AMSL\nAH 1000m AMSL", (1000.0, None)),
        ("AL FL95\nAH 9500ft AMSL", (9500 * 0.3048 - 400.0, None)),
    ],
)
def test_limits_that_leave_no_height_lose_the_upper_one(
    limits: str, wanted: tuple[float | None, float | None], tmp_path: Path
) -> None:
    path = tmp_path / "zones.openair"
    path.write_text(f"AC P\nAN R1\n{limits}\n{SQUARE}", encoding="utf-8")
    found = read_zone_file(path, "z.openair")
    (zone,) = found.zones
    assert (zone.floor_agl_m, zone.ceiling_agl_m) == (None, None)
    assert (zone.floor_amsl_m, zone.ceiling_amsl_m) == pytest.approx(wanted)
    said = "z.openair: upper limits of 0, or equal to the lower one, mean no ceiling: R1 (P)"
    assert found.notes == [said]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-8", "latin-1"])
def test_a_text_file_is_openair_by_its_first_command(encoding: str, tmp_path: Path) -> None:
    """Switzerland's file begins with the mark of UTF-8, and comments."""
    path = tmp_path / "zones.txt"
    path.write_text(f"* Lac L\u00e9man\n{HEAD}{SQUARE}", encoding=encoding)
    assert is_zone_file(path)
    assert len(read_zone_file(path, "zones.txt").zones) == 1
    path.write_text(f"AN LAKE\nAC R\n{SQUARE}", encoding=encoding)
    assert is_zone_file(path)
    with pytest.raises(ScenarioError, match="line 1: AN: an airspace must begin with AC before it"):
        read_zone_file(path, "zones.txt")


def test_a_semicolon_in_what_draws_begins_a_comment() -> None:
    """As the files of Malawi and of German low-flying areas have it; in a name it is none."""
    entries = entries_of(
        "AC R\nAN LAKE; WEST\nAL GND\nAH FL95\nDP 46:00.000 N 008:00.000 E ; follows the border\n"
        "DP 46:00:00N 008:06:00E;\t(railway) northward, 5 NM * and a star\nDP 46:06:00N 008:06:00E\n"
    )
    assert entries["name"] == "LAKE; WEST (R)"
    assert entries["rings_deg"] == [[[46.0, 8.0], [46.0, 8.1], [46.1, 8.1]]]
    assert entries_of(f"{HEAD}V X=46:00:00N 008:00:00E ; tower\nDC 2 ; NM")["radius_m"] == 2.0 * 1852.0


def test_colours_without_an_airspace_are_none(tmp_path: Path) -> None:
    """The Czech file begins each kind of airspace so; an airspace whose shape is missing is refused all the same."""
    path = tmp_path / "zones.openair"
    colours = "AC Q\nSP 0,2,127,0,127\nSB -1,-1,-1\n\n"
    path.write_text(f"{colours}{HEAD}{SQUARE}AC CTR\nSB 1,1,1\n", encoding="utf-8")
    found = read_zone_file(path, "z.openair")
    assert [zone.name for zone in found.zones] == ["LAKE (R)"]
    assert found.notes == ["z.openair: 2 zones restrict no flight: without a name, limits or a shape"]
    path.write_text(f"{colours}{HEAD}", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"line 5 \(LAKE\): expected one shape"):
        read_zone_file(path, "z.openair")


def test_a_circle_is_a_cylinder() -> None:
    entries = entries_of(f"{HEAD}V X=46:00:00N 008:00:00E\nDC 2.5")
    assert (entries["lat_deg"], entries["lon_deg"], entries["radius_m"]) == (46.0, 8.0, 2.5 * 1852.0)


@pytest.mark.parametrize(("turn", "quarter"), [("V D=+\n", (1, 1)), ("", (1, 1)), ("VD=-\n", (-1, -1))])
def test_an_arc_by_bearings_runs_the_way_it_is_told(turn: str, quarter: tuple[int, int]) -> None:
    """From north to east: a quarter clockwise, or three quarters through south and west."""
    ring = ring_of(f"{HEAD}V X=46:00:00N 008:00:00E\n{turn}DA 5, 0, 90\nDP 46:00:00N 008:00:00E")
    radius = 5 * NAUTICAL_MILE
    arc = ring[:-1]
    assert [math.hypot(*place) for place in arc] == pytest.approx([radius] * len(arc), rel=1e-4)
    assert arc[0] == pytest.approx((0.0, radius), abs=2.0)
    assert arc[-1] == pytest.approx((radius, 0.0), abs=2.0)
    middle = arc[len(arc) // 2]
    assert (math.copysign(1, middle[0]), math.copysign(1, middle[1])) == quarter
    # No chord leaves the circle by more than the metre that is promised.
    for (x0, y0), (x1, y1) in itertools.pairwise(arc):
        assert radius - math.hypot(0.5 * (x0 + x1), 0.5 * (y0 + y1)) < 1.05


def test_an_arc_by_points_keeps_its_ends_and_the_centre_it_was_told() -> None:
    """The next airspace turns clockwise again; its centre is its own."""
    text = (
        f"{HEAD}V X=46:00:00N 008:00:00E\nV D=-\nDB 46:03:00N 008:00:00E,45:57:00N 008:00:00E\n"
        f"{HEAD}V X=46:00:00N 008:00:00E\nDB 46:03:00N 008:00:00E, 45:57:00N 008:00:00E\n"
    )
    left, right = (
        dict(entries)["rings_deg"][0] for _, entries in openair_zones(text, "z") if isinstance(entries, dict)
    )
    for ring, side in ((left, -1), (right, 1)):
        assert (ring[0], ring[-1]) == ([46.05, 8.0], [45.95, 8.0])
        assert all(side * (lon - 8.0) > 0.0 for _, lon in ring[1:-1])


def test_an_airway_is_its_width_wide() -> None:
    ring = ring_of(f"{HEAD}V W=2\nDY 46:00:00N 008:00:00E\nDY 46:30:00N 008:00:00E")
    assert sorted(round(east, 0) for east, _ in ring)[0] == pytest.approx(-NAUTICAL_MILE, abs=1.0)
    assert sorted(round(east, 0) for east, _ in ring)[-1] == pytest.approx(NAUTICAL_MILE, abs=1.0)


@pytest.mark.parametrize(
    ("stated", "free"),
    [
        ("AC G", True),
        ("AC E", True),
        ("AC E\nAY RMZ", False),
        ("AC UNC\nAY NONE", True),
        ("AC UNC\nAY P", False),
        ("AC D", False),
        ("AC CTR", False),
        ("AC G\nAY FIS", True),
        ("AC GP", False),
        ("AC W", True),
    ],
)
def test_airspace_that_is_open_to_all_keeps_nobody_out(stated: str, free: bool) -> None:
    ((_, entries),) = openair_zones(f"{stated}\nAN LAKE\n{SQUARE}", "z.openair")
    assert isinstance(entries, str) == free


def test_names_times_and_comments() -> None:
    text = (
        "* Lakes, 2026\nAC D * controlled\nAY CTR\nAN LAKE\nAF 118.480\nSP 0,3,255\nV Z=100\nAT 46:00:00N 008:00:00E\n"
        f"AA 2026-05-01T12:00Z/2026-05-01T24:00Z\nAA NONE/2026-08-01T00:00Z\nAA NONE\n{SQUARE}*DP nothing\n"
    )
    entries = entries_of(text)
    assert entries["name"] == "LAKE (D, CTR)"
    assert entries["times"] == ["2026-05-01T12:00Z/2026-05-02T00:00Z", "../2026-08-01T00:00Z", "BY NOTAM"]
    assert len(entries["rings_deg"][0]) == 4


def test_the_record_of_the_page_is_read_as_it_says() -> None:
    page = (Path(__file__).parents[3] / "docs" / "airspace.md").read_text(encoding="utf-8")
    entries = entries_of(page.partition("```text\n")[2].partition("```")[0])
    assert entries["times"] == ["2026-05-01T00:00Z/2026-10-01T00:00Z", "BY NOTAM"]
    # A circle of 1.5 nautical miles.
    assert (entries["name"], entries["radius_m"]) == ("MILL (R)", 2778.0)


FAULTS = {
    "AN LAKE": "line 1: AN: an airspace must begin with AC before it",
    HEAD + "AH FL95\n": "line 5: AH 'FL95': an airspace has one lower limit (AL) and one upper limit (AH)",
    HEAD + "DP 46:00:00N\n": "line 5: DP '46:00:00N': expected a position",
    HEAD + "DP 91:00:00N 008:00:00E\n": "line 5: DP '91:00:00N 008:00:00E': allowed 0..90 degrees",
    HEAD + "DP 46:61:00N 008:00:00E\n": "line 5: DP '46:61:00N 008:00:00E': expected degrees, and minutes and seconds",
    HEAD + "DC 5\n": "line 5: DC '5': a centre (V X=) must come before this line",
    HEAD + "V X=46:00:00N 008:00:00E\nDC five": "line 6: DC 'five': expected a number of at least 0",
    HEAD + "V D=left": "line 5: V 'D=left': allowed D=+ (clockwise) or D=-",
    HEAD + "V X=46:00:00N 008:00:00E\nDA 5, 270": "line 6: DA '5, 270': expected radius, first and last bearing",
    HEAD + "DX 5": "line 5: 'DX': unknown; shapes are DP, DA, DB, DC, DY",
    HEAD + "DY 46:00:00N 008:00:00E": "line 1 (LAKE): DY: an airway needs at least two points, and a width",
    HEAD: "line 1 (LAKE): expected one shape",
    "AC R\nAL ask the tower\n": "line 2: AL 'ask the tower': expected a height",
    HEAD + "AA 2026-05-01/2026-04-01": "line 5: AA '2026-05-01/2026-04-01'",
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_line_that_is_none_is_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "z.openair"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        read_zone_file(path, "z.openair")
    assert str(caught.value).startswith(f"z.openair: {FAULTS[text]}")
    assert str(caught.value).isprintable()


THERE_AND_BACK = "DP 46:00:00N 008:00:00E\nDP 46:06:00N 008:06:00E\nDP 46:12:00N 008:06:00E\nDP 46:06:00N 008:06:00E\n"
# As Switzerland has a cable; and the same place three times.
CABLE = "DP 47:14:18 N 009:24:49 E\nDP 47:14:13 N 009:24:42 E\n"
ONE_PLACE = "DP 46:00:00N 008:00:00E\n" * 3


@pytest.mark.parametrize("way", [THERE_AND_BACK, CABLE, CABLE + CABLE, ONE_PLACE])
def test_an_outline_of_no_area_is_left_out_and_said(way: str, tmp_path: Path) -> None:
    """A way there and back, as France's file of 2011 has one; a file of nothing else has no zone, and says why."""
    path = tmp_path / "z.openair"
    for more, count in (("", 0), (f"AC R\nAN LAKE\n{SQUARE}", 1)):
        path.write_text(f"AC Q\nAN RUN\n{way}{more}", encoding="utf-8")
        found = read_zone_file(path, "z.openair")
        assert len(found.zones) == count
        assert found.notes == ["z.openair: outlines that enclose no area are ignored: RUN (Q)"]


def test_what_a_file_does_not_hold_as_it_stands_is_said(tmp_path: Path) -> None:
    """Latin letters of one byte; a bow tie, of which both halves count; and a class that is open to all, twice."""
    bow = "DP 46:00:00N 008:00:00E\nDP 46:06:00N 008:06:00E\nDP 46:06:00N 008:00:00E\nDP 46:00:00N 008:06:00E\n"
    open_to_all = f"AC G\nAN FIELD\n{SQUARE}"
    path = tmp_path / "zones.txt"
    path.write_bytes(f"AC R\nAN ZÜRICH\n{bow}{open_to_all}{open_to_all}".encode("latin-1"))
    assert is_zone_file(path)
    found = read_zone_file(path, "zones.txt")
    assert found.notes == [
        "zones.txt: 2 zones restrict no flight: class G, open to all",
        "zones.txt: an outline that crosses itself is taken as the area it encloses: ZÜRICH (R)",
    ]
    (zone,) = found.zones
    # Each of the bow's corners, grown by a tenth of a metre, and its middle with a way through.
    (ring,) = zone.rings_deg or []
    corners = [[46.0, 8.0], [46.1, 8.1], [46.1, 8.0], [46.0, 8.1]]
    assert all(any(math.dist(at, corner) < 1e-5 for at in ring) for corner in [*corners, [46.05, 8.05]])
    assert shapely.Polygon(ring).area == pytest.approx(0.1 * 0.1 / 2, rel=1e-4)
    assert all(shapely.Polygon(ring).covers(shapely.Point(corner)) for corner in corners)
    (tmp_path / "mission.txt").write_text("QGC WPL 110\n", encoding="utf-8")
    assert not is_zone_file(tmp_path / "mission.txt")
