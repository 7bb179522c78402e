"""Scenario files: every fault in one line with file, key, value and range."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.world.made.made_scenario import SMALL, THREAT, refused, with_fault
from world.errors import ScenarioError
from world.scenario import load_scenario
from world.scenario_file import check_scenario, parse_scenario

# What is replaced in the small file or appended to it, and what the line must say.
CASES: dict[str, tuple[str, str, str]] = {
    "unknown key": ("", "colour = 1", "destination.colour: unknown key"),
    "unknown key at the top": ('name = "small"', 'name = "small"\ncolour = 1', "colour: unknown key"),
    "unknown key like a type": ("", "integer = 1", "destination.integer: unknown key"),
    "unknown key with a line break": ("", '"a\\nb" = 1', 'destination."a\\nb": unknown key'),
    "a key mistaken": (
        "",
        "[limits]\nmin_clearence_m = 3",
        "min_clearence_m: unknown key: did you mean 'min_clea",
    ),
    "a required key mistaken": ('name = "small"', 'nam = "small"', "nam: unknown key: did you mean 'name'?"),
    "a key of a list mistaken": (
        "",
        THREAT + "kill_radus_m = 3",
        "kill_radus_m: unknown key: did you mean 'kill_radius",
    ),
    "a table mistaken": ("", "[wnd]\nspeed_mps = 3", "wnd: unknown key: did you mean 'wind'?"),
    "unknown table": ("", "[weather]\nrain = 1", "weather: unknown key"),
    "missing name": ('name = "small"', "", "name: missing"),
    "a number of 9000 digits": ("amsl_m = 400", f"amsl_m = 1{'0' * 9000}", "not valid TOML"),
    "ends on one another": (
        "east_m = 4000",
        "east_m = -3991",
        "destination: less than 10 m horizontally from the start",
    ),
    "a fault in the second threat": (
        "",
        THREAT + THREAT + "name = 3",
        "threats.1.name: 3: expected text",
    ),
    "no terrain": ('kind = "flat"\namsl_m = 200', 'kind = "none"', 'terrain.kind: "none": allowed are'),
    "no terrain but a hash": (
        'kind = "flat"\namsl_m = 200',
        'kind = "none"\nsha256 = "0"',
        'terrain.kind: "none": allowed',
    ),
    "no such tile": ('kind = "flat"\namsl_m = 200', 'kind = "dem"\npath = "no.tif"', "terrain.path: "),
    "a key twice": ("amsl_m = 400", "amsl_m = 400\namsl_m = 401", "not valid TOML"),
    "no TOML": ('name = "small"', "name: small", "not valid TOML"),
    "cut off": ("height_m = 200\n", 'height_m = 200\n[flight]\naircraft = "aero', "not valid TOML"),
}


@pytest.mark.parametrize("case", CASES)
def test_one_fault_one_line(case: str, tmp_path: Path) -> None:
    old, new, wanted = CASES[case]
    assert wanted in refused(tmp_path, with_fault(old, new))


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (
            b"",
            "name: missing (also missing: terrain, start, destination); tables [start] and [destination] need ",
        ),
        (
            b'[landing]\neast_m = 0\nnorth_m = 0\n[terrain]\nkind = "dem"\npath = "jacksboro"\n',
            "name: missing (also missing: start, destination); tables [start] and [destination] need east_m and"
            " north_m, or lat_deg and lon_deg, and amsl_m or height_m",
        ),
        (b"\x00\x01\x02\xff\xfe" * 50, "not a text file in UTF-8"),
        (b"\x89HDF\r\n\x1a\n" + bytes(200), "not a text file in UTF-8"),
        (bytes(300), "not valid TOML"),
        (b"limits = 5\n" + SMALL.encode(), "limits: 5: expected a table"),
        (b"threats = 5\n" + SMALL.encode(), "threats: 5: expected a list"),
        (b"x = " + b"[" * 100_000, "not valid TOML"),
    ],
)
def test_files_that_are_no_scenario(content: bytes, wanted: str, tmp_path: Path) -> None:
    assert wanted in refused(tmp_path, content)


def test_missing_and_unreadable_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ScenarioError, match="no such file, and not a built-in scenario \\(jacksboro"):
        load_scenario(str(tmp_path / "none.toml"))
    with pytest.raises(ScenarioError, match="no such file"):
        load_scenario("x" * 5000)
    with pytest.raises(ScenarioError, match="is a folder; expected a scenario file"):
        load_scenario(str(tmp_path))
    (tmp_path / "big.toml").write_bytes(b"#" * (16 * 2**20 + 1))
    with pytest.raises(ScenarioError, match="a scenario file has at most 16,777,216"):
        load_scenario(str(tmp_path / "big.toml"))


def test_more_faults_are_counted() -> None:
    text = SMALL.replace("amsl_m = 400", "amsl_m = 1e9").replace("height_m = 200", "height_m = -3")
    with pytest.raises(ScenarioError, match=r"start\.amsl_m: 1000000000\.0: allowed -500\.\.9000 \(and 1 more error\)"):
        parse_scenario(text, "x")


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    file = tmp_path / "bom.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())
    assert load_scenario(str(file)).name == "small"


def test_a_dictionary_that_is_checked_is_not_changed() -> None:
    data: dict[str, Any] = tomllib.loads(SMALL)
    kept = copy.deepcopy(data)
    file = check_scenario(data, "x")
    assert data == kept
    assert check_scenario(file.model_dump(mode="json", exclude_none=True), "x") == file
    with pytest.raises(ScenarioError, match="expected an object, got list"):
        check_scenario([1], "x")


@pytest.mark.parametrize("key", ["height_m", "heights", "sigma_m"])
def test_a_key_of_another_table_is_not_suggested(key: str, tmp_path: Path) -> None:
    """`height_m` and `sigma_m` are keys of [[terrain.peak]], and not of [terrain]."""
    text = refused(tmp_path, with_fault('kind = "flat"', f'kind = "flat"\n{key} = 500'))
    assert f"terrain.{key}: unknown key" in text
    assert "did you mean 'height_m'" not in text
    assert "did you mean 'sigma_m'" not in text
