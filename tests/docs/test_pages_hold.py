"""The pages name what is there: every rule, tolerance, command, option and public name; links lead somewhere."""

import json
import math
import re
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import planfly
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.parameters import NOT_SIMULATED, Px4Parameters
from logs.recording.reader import read_log
from logs.verdict import tolerances
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules.registry import RULES
from planfly.campaigns.flight_row import SPHERE_SCALE_M
from planfly.cli import build_parser, main
from planfly.terminal.command_parser import EXIT_CODES
from tests.docs.page_blocks import PAGES, ROOT
from tests.planfly.made_plans import default_run
from world.elevation_formats import SUFFIXES

ALL = [ROOT / "README.md", *PAGES]
_CODE = re.compile(r"(?<!`)`(planfly [^`]+)`(?!`)")
_LINK = re.compile(r"\]\(([^)\s]+)\)")


def text_of(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def section(text: str, title: str) -> str:
    """What stands under a heading of the second level."""
    return re.split(r"^## ", text.split(f"\n## {title}\n", 1)[1], maxsplit=1, flags=re.MULTILINE)[0]


def section_of_table(name: str, head: str) -> str:
    """The rows of a page's table, known by the head of its first column."""
    return text_of(name).split(f"\n| {head} |", 1)[1].split("\n\n", 1)[0]


def numbers(value: object) -> list[float]:
    return list(value.values()) if isinstance(value, dict) else [float(value)]  # type: ignore[arg-type]


def test_the_first_flight_is_as_its_page_says() -> None:
    """Lines of its output, lengths of path and route to 0.1 km, and the number of air-defence units."""
    page = text_of("first-flight.md")
    _, said, files = default_run()
    printed = said.splitlines()
    for block in re.findall(r"^```text\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        assert [line for line in block.splitlines() if line not in printed] == []
    plan = json.loads(files["plan.json"])
    path = np.linalg.norm(np.diff(plan["waypoints_east_north_amsl_m"], axis=0), axis=1).sum() / 1000.0
    words = " ".join(page.split())
    assert f"plans a path of {path:.1f} km" in words
    assert len(plan["scenario"]["threats"]) == 15
    with TemporaryDirectory() as folder:
        log = Path(folder, "flight.mcap")
        log.write_bytes(files["flight.mcap"])
        route = read_log(log).setup.route.positions
    assert f"{np.linalg.norm(np.diff(route[:, :2], axis=0), axis=1).sum() / 1000.0:.1f} km in all" in words


def test_every_rule_has_a_section() -> None:
    page = text_of("verdict.md")
    assert [rule for rule in RULES if f"\n### {rule}\n" not in page] == []


def test_every_tolerance_stands_on_the_page_with_its_value() -> None:
    page = text_of("verdict-tolerances.md")
    names = [name for name in vars(tolerances) if name.isupper()]
    assert len(names) > 80
    for name in names:
        rows = re.findall(rf"^\| `{name}` \| (.*?) \| (.*?) \|$", page, re.MULTILINE)
        assert rows, name
        for shown, meaning in rows:
            assert meaning
            told = [
                math.radians(float(number)) if degrees else float(number)
                for number, degrees in re.findall(r"(-?[\d.]+(?:e[+-]?\d+)?)(°?)", shown)
            ]
            assert told == pytest.approx(numbers(getattr(tolerances, name)), rel=1e-5), name


def test_every_setting_that_leaves_the_verdict_open_stands_on_its_page() -> None:
    # The pages name a group of settings once.
    groups = (
        (r"FLAP_(\d)_.*", r"FLAP_\1_*"),
        (r"BATT[2-9A-G]_.*", "BATT2_*"),
        (r"(?:RLL|PTCH)_RATE_(FF|P|I|D|FLTT|FLTE|IMAX)", r"*_RATE_\1"),
        (r"ARSPD[3-6]_(TYPE|USE)", r"ARSPD2_\1"),
        (r"SERVO\d+_(FUNCTION|MIN|TRIM|MAX)", r"SERVOn_\1"),
        (r"RC\d+_(MIN|TRIM|MAX|REVERSED)", r"RCn_\1"),
        (r"FW_(RR|PR)_(?:P|I|D|FF)", r"FW_\1_*"),
        (r"CA_SV_CS\d_(TYPE|TRQ_R|TRQ_P)", r"CA_SV_CSn_\1"),
        (r"CA_(SV|R)\d+_SLEW", r"CA_\1n_SLEW"),
        (r"[A-Z0-9_]+_FUNC\d+", "PWM_MAIN_FUNCn"),
    )

    def group_of(name: str) -> str:
        pattern, group = next((pair for pair in groups if re.fullmatch(pair[0], name)), (".*", name))
        return re.sub(pattern, group, name, count=1)

    names = [group_of(name) for name in ArduPilotParameters.table.when_stated]
    px4_names = [group_of(name) for name in Px4Parameters.table.when_stated]
    assert len(names) > 30
    for page, expected in (("arduplane-branches.md", names), ("px4-branches.md", px4_names)):
        text = text_of(page)
        assert [name for name in expected if f"`{name}`" not in text] == []


def test_every_parameter_of_px4_that_is_not_flown_stands_on_its_page() -> None:
    text = text_of("px4-branches.md")
    assert [name for name in NOT_SIMULATED if f"`{name}`" not in text] == []


def test_every_scale_that_ranks_flights_stands_on_its_page() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| ([\d.]+) (.*?) \|$", text_of("campaigns.md"), re.MULTILINE)
    stated = {rule: (of, float(scale), unit) for rule, of, scale, unit in rows}
    margins = {rule.name: rule.margin for rule in RULE_WORDS.values() if rule.scale is not None}
    wanted = {name: (margin.quantity, margin.scale, margin.unit) for name, margin in margins.items() if margin}
    assert stated == wanted | {"threat": ("distance outside the missile's sphere", SPHERE_SCALE_M, "m")}


def test_every_elevation_format_stands_on_its_page() -> None:
    kinds = section_of_table("your-dem.md", "kind")
    assert [suffix for suffix in SUFFIXES if f"(`{suffix}`)" not in kinds] == []


def test_every_command_stands_in_the_reference_with_its_options_and_what_they_do() -> None:
    page = text_of("commands.md")
    rows = section_of_table("commands.md", "command")
    common = section(page, "Common options")
    for name, parser in build_parser().commands.items():
        assert re.search(rf"^\| `planfly {name}\b", rows, re.MULTILINE), name
        part = section(page, name)
        usage = part.split("```")[1]
        assert [option for option in parser.long_options() if option not in usage] in ([], ["--help"]), name
        part += common
        defined = " ".join(re.findall(r"^`(.*)`$", part, re.MULTILINE))
        assert [option for option in parser.long_options() if option not in defined] == [], name
        # Every word of the help but the usage, which breaks its lines elsewhere, and the exit codes.
        helped = parser.format_help().partition("\n\n")[2].replace(EXIT_CODES.strip(), "")
        # The help breaks its lines at hyphens, too.
        helped = re.sub(r"(?<=\w)-\n\s+(?=\w)", "-", helped)
        told = set(re.sub(r"[`:*]", " ", part.replace("\\", "")).split())
        assert set(re.sub(r"[`:*]", " ", helped).split()) <= told, name


def test_every_public_name_stands_in_the_reference() -> None:
    page = text_of("api.md")
    missing = [name for name in planfly.__all__ if name != "__version__" and f"\n| `planfly.{name}" not in page]
    assert missing == []


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.stem)
def test_commands_in_the_text_have_options_that_there_are(page: Path) -> None:
    commands = build_parser().commands
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"^    planfly .*$", text, re.MULTILINE) == [], "a command stands in a fenced block"
    for code in _CODE.findall(text):
        words = shlex.split(code)[1:]
        if words[0].startswith("-"):
            continue
        names = words[0].split("|")
        assert set(names) <= set(commands), code
        for name in names:
            options = {option for word in words[1:] if word.startswith("--") for option in word.split("|")}
            known = {*commands[name].long_options(), "--help"}
            assert {option.partition("=")[0] for option in options} <= known, code


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.stem)
def test_links_lead_to_files(page: Path) -> None:
    targets = [link.partition("#")[0] for link in _LINK.findall(page.read_text(encoding="utf-8"))]
    local = [target for target in targets if target and not target.startswith(("http:", "https:"))]
    assert [target for target in local if not (page.parent / target).exists()] == []


def test_pages_are_named_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert [page.name for page in PAGES if page.stem != "index" and f"\n{page.stem}\n" not in index] == []


def test_the_page_on_mission_files_shows_what_its_flight_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """But for "...", and for where its lines break."""
    page = (ROOT / "docs" / "your-mission-file.md").read_text(encoding="utf-8")
    mission = re.search(r"<!-- test: file survey.waypoints -->\n```text\n(.*?)```", page, re.DOTALL)
    run = re.search(r"<!-- test: exit 4 -->\n```sh\nplanfly (fly .*?)\n```\n\n```text\n(.*?)```", page, re.DOTALL)
    assert mission is not None
    assert run is not None
    monkeypatch.chdir(tmp_path)
    Path("survey.waypoints").write_text(mission[1], encoding="utf-8")
    assert main(run[1].split()) == 4
    printed = " ".join(capsys.readouterr().out.split())
    assert re.search(".*".join(map(re.escape, " ".join(run[2].split()).split("..."))), printed)
    depths = re.findall(r"(\d+) m (?:below the leg|too low)", page)
    assert len(depths) == 2
    assert len(set(depths)) == 1
