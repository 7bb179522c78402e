"""[[zones]]: each form of a shape and a band, and each fault in one line."""

from pathlib import Path

import pytest

from tests.world.made.made_scenario import refused, with_fault
from world.airspace.zone_tables import ZoneTable

SQUARE = "polygon_m = [[-500, 1000], [500, 1000], [500, 2000], [-500, 2000]]"


def zone(text: str, *, name: str = "town", kind: str = "exclusion") -> str:
    return f'[[zones]]\nname = "{name}"\nkind = "{kind}"\n{text}\n'


def test_what_a_table_holds() -> None:
    table = ZoneTable(name="mast", kind="exclusion", lat_deg=46.0, lon_deg=8.0, radius_m=200.0, ceiling_agl_m=120.0)
    assert table.model_dump(exclude_none=True) == {
        "name": "mast",
        "kind": "exclusion",
        "lat_deg": 46.0,
        "lon_deg": 8.0,
        "radius_m": 200.0,
        "ceiling_agl_m": 120.0,
    }


FAULTS = {
    "no shape": (zone(""), "zones.0: polygon_m: give one of polygon_m, polygon_deg, rings_m, rings_deg, radius_m"),
    "two shapes": (zone(f"{SQUARE}\nradius_m = 5\neast_m = 0\nnorth_m = 0"), "zones.0: polygon_m: give one of"),
    "a centre alone": (zone(f"{SQUARE}\neast_m = 0"), "zones.0: radius_m: missing; a centre is a cylinder's"),
    "a radius alone": (zone("radius_m = 50"), "zones.0: position: give east_m and north_m, or lat_deg and lon_deg"),
    "a kind": (zone(SQUARE, kind="prohibited"), 'zones.0.kind: "prohibited"'),
    "no name": (zone(SQUARE, name=""), "zones.0.name"),
    "an unknown key": (zone(f"{SQUARE}\nbase_ft = 100"), "zones.0.base_ft: unknown key"),
    "NaN": (zone("polygon_m = [[0, nan], [9, 0], [9, 9]]"), "zones.0.polygon_m.0.1: nan: allowed -500000..500000"),
    "a corner of three": (zone("polygon_m = [[0, 0, 5], [9, 0], [9, 9]]"), "zones.0.polygon_m.0"),
    "longitude first": (
        zone("polygon_deg = [[-97.5, 46.0], [-97.0, 46.0], [-97.0, 46.5]]"),
        "zones.0.polygon_deg.0: latitude -97.5: allowed -89..89; a corner is [latitude, longitude]",
    ),
    "a radius of zero": (zone("east_m = 0\nnorth_m = 0\nradius_m = 0"), "zones.0.radius_m: 0: allowed above 0"),
    "two floors": (zone(f"{SQUARE}\nfloor_amsl_m = 9\nfloor_agl_m = 9"), "floor_agl_m: give floor_amsl_m or floor_agl"),
    "floor above ceiling": (
        zone(f"{SQUARE}\nfloor_amsl_m = 900\nceiling_amsl_m = 500"),
        "zones.0: ceiling_amsl_m: 500: must be above floor_amsl_m 900",
    ),
    "floor at ceiling": (
        zone(f"{SQUARE}\nfloor_agl_m = 120\nceiling_agl_m = 120"),
        "zones.0: ceiling_agl_m: 120: must be above floor_agl_m 120",
    ),
    "the greatest height below the least": (
        "[limits]\nmin_clearance_m = 120\nmax_height_m = 120\n",
        "limits: max_height_m: 120: must be above min_clearance_m 120",
    ),
    "the greatest height NaN": ("[limits]\nmax_height_m = nan\n", "limits.max_height_m: nan: allowed above 0..9000"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_one_fault_one_line(case: str, tmp_path: Path) -> None:
    text, wanted = FAULTS[case]
    assert wanted in refused(tmp_path, with_fault("", text))
