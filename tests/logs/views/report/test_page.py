"""Captions of the pictures that were drawn, and of no others, fitting what was flown."""

import base64
import gzip
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

import logs.views.figures
from logs.verdict.places import Change, Place
from logs.verdict.verdict import Verdict
from logs.views.figures import FIGURES, View, figure_views, make_subject
from logs.views.report.page import (
    CHART_SCRIPTS,
    VIEW_SCRIPTS,
    page_charts,
    page_library,
    report_flight,
    report_pictures,
    script_text,
    style_text,
    write_report,
)
from tests.logs.views.report.report_data import (
    ARGUMENTS,
    EVIL,
    FINDINGS,
    PNG,
    VERDICT,
    Page,
    finding,
    make_setup,
    make_track,
    report_html,
)
from tests.soak import SOAK

NAMES = [entry.name for entry in FIGURES]
STILLS = ("map", "profile")
TURN = Place("waypoint", 1, 2)
FLOWN = make_subject(make_setup(), make_track(), VERDICT)
DRAWN = {f"{name}.png": name.encode() for name in NAMES}


def test_every_picture_that_is_drawn_has_its_caption_and_its_bytes() -> None:
    pictures = report_pictures(FLOWN, NAMES, DRAWN)
    assert [picture.identifier for picture in pictures] == NAMES
    for picture in pictures:
        head, _, data = picture.data.partition(",")
        if picture.identifier in STILLS:
            assert head == "data:image/png;base64"
            assert base64.b64decode(data) == picture.identifier.encode()
        else:
            assert picture.data == ""
        assert picture.title
        assert len(picture.alternative) > 30
        assert len(picture.caption) > 30
    assert len({picture.title for picture in pictures}) == len({picture.caption for picture in pictures}) == len(NAMES)
    assert pictures[0].identifier == "map"


def test_what_was_not_drawn_is_left_out_in_the_same_order() -> None:
    some = [name for name in NAMES if name not in ("scene", "time")]
    assert [picture.identifier for picture in report_pictures(FLOWN, set(some), DRAWN)] == some
    assert report_pictures(FLOWN, (), {}) == []


def test_a_plan_alone_is_not_said_to_have_been_flown() -> None:
    setup = make_setup(terrain={"kind": "none"}, threats=[])
    names = ("map", "profile", "scene")
    flown = report_pictures(FLOWN, names, DRAWN)
    planned = report_pictures(make_subject(setup, None, VERDICT), names, DRAWN)
    assert all("flown" in picture.alternative for picture in flown)
    assert not any("flown" in picture.alternative for picture in planned)
    # Three legs and one unit over terrain; the other has neither.
    assert "shaded terrain, 1 threat, the planned path of 3 legs" in flown[0].alternative
    assert "no terrain, 0 threats, the planned path of 3 legs." in planned[0].alternative


def test_there_is_a_chart_for_every_figure_with_data() -> None:
    charts = page_charts(figure_views(FLOWN))
    # The flight is exposed to nothing.
    assert set(charts) == {"map", "profile", "scene", "turns", "envelope", "time", "controls", "energy"}
    json.dumps(charts, allow_nan=False)
    planned = page_charts(figure_views(make_subject(make_setup(), None, VERDICT)))
    assert set(planned) == {"map", "profile", "scene", "turns", "envelope"}


def test_a_flight_without_a_known_place_is_none_to_show() -> None:
    setup, track = make_setup(), make_track()
    assert len(report_flight(setup, track)["flights"]) == 1
    assert report_flight(setup, None)["flights"] == []
    lost = replace(track, position=np.full_like(track.position, np.nan))
    assert report_flight(setup, lost)["flights"] == []


# ----------------------------------------------------------------------
# The page's scripts are whole files of their own, and plotly.js comes out of the page as it went in.


def test_plotly_comes_out_as_it_went_in_and_its_hash_is_named() -> None:
    library = page_library()
    text = gzip.decompress(base64.b64decode(library.packed))
    assert text.decode("utf-8") == get_plotlyjs()
    assert library.digest == "sha256-" + base64.b64encode(hashlib.sha256(text).digest()).decode()
    assert library.version in text[:200].decode()
    # A third of the script, so that a page with all it may hold stays below 8 MB.
    assert len(library.packed) < 2.2e6


def test_every_script_stands_in_the_page_once_and_none_is_long() -> None:
    folder = resources.files("logs.views.report").joinpath("templates", "scripts")
    names = {file.name.removesuffix(".js") for file in folder.iterdir()}
    assert names == {*CHART_SCRIPTS, *VIEW_SCRIPTS, "start"}
    whole = script_text((*CHART_SCRIPTS, *VIEW_SCRIPTS))
    for name in names:
        text = folder.joinpath(f"{name}.js").read_text(encoding="utf-8")
        assert whole.count(text) == 1
        assert text.startswith("// ")
        assert text.count("\n") <= 200, name
    assert "</script" not in whole
    assert "http" not in whole + style_text("style", "report", "compare")


# ----------------------------------------------------------------------
# The report is whole in one file, safe with hostile names, the verdict first.


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave pictures undrawn: they cost most of a second, and most tests here read text."""

    def draw(views: Mapping[str, View], *, svg: bool = False) -> dict[str, bytes]:
        return {f"{name}.png": PNG for name in views}

    monkeypatch.setattr(logs.views.figures, "draw_pictures", draw)


@pytest.mark.usefixtures("undrawn")
def test_page_is_whole_and_loads_nothing() -> None:
    html = report_html(make_setup(), make_track(), VERDICT, **ARGUMENTS)
    page = Page(html)
    names = [name for name, _ in page.tags]
    assert not {"link", "iframe", "object", "form", "base"} & set(names)
    scripts = [attributes.get("type") for name, attributes in page.tags if name == "script"]
    assert scripts == [*["application/json"] * 3, "application/gzip", None]
    assert dict(page.tags)["html"]["lang"] == "en"
    for name, attributes in page.tags:
        for key in ("src", "href", "srcset", "action"):
            value = attributes.get(key)
            assert value is None or value.startswith(("data:image/png;base64,", "data:image/jpeg;base64,", "#")), (
                name,
                value,
            )
        assert not [key for key in attributes if key.startswith("on")]
    script = html.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = next(str(a["content"]) for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert f"script-src 'sha256-{digest}' '{page_library().digest}';" in policy
    assert "default-src 'none'" in policy
    words = html.replace(page_library().packed, "")
    assert "http:" not in words
    assert "https:" not in words
    assert "url(" not in words
    images = [attributes for name, attributes in page.tags if name == "img"]
    assert [base64.b64decode(str(image["src"]).partition(",")[2]) for image in images] == [PNG] * 2
    assert all(len(str(image["alt"])) > 30 for image in images)
    targets = {attributes.get("id") for _, attributes in page.tags}
    links = [str(attributes["href"]) for name, attributes in page.tags if name == "a"]
    assert links
    assert all(link[1:] in targets for link in links)


@pytest.mark.usefixtures("undrawn")
def test_verdict_comes_first_then_what_fails() -> None:
    page = Page(report_html(make_setup(), make_track(), VERDICT, **ARGUMENTS))
    text = page.text()
    order = [
        "Not flyable",
        "slope on leg 1",
        "No remedy was found.",
        "2 of 3 judged findings pass, 1 fails; 1 could not be judged",
        "Start: in the air",
        "The broad line is the plan",
        "What fails",
        "slope at leg 1: why leg 1. Missed by 3.35°.",
        "What else was judged",
        "One row per rule",
        "item 9: no loiter",
        "Leg by leg",
        "Findings that fail come first",
        "planfly run small",
    ]
    positions = [text.index(part) for part in order]
    assert positions == sorted(positions)
    tables = [row for row in page.rows if row[0] in ("fail", "ok", "unjudged") and len(row[1]) == 10]
    assert [state for state, _ in tables] == ["fail", "ok", "ok", "unjudged"]
    assert tables[0][1][:9] == ["leg 1", "slope", "✗ fails", "4.00", "11.2", "≤\u00a07.90", "−3.35", "°", "aircraft"]
    assert "no scenario was given" in tables[3][1][9]
    rules = [cells for state, cells in page.rows if state and len(cells) == 9]
    assert [cells[0] for cells in rules] == ["turn", "bounds"]
    assert rules[1] == ["bounds", "– not judged", "1 not judged", "no scenario was given", "–", "–", "–", "–", ""]


# What stands in the place of each figure without a still picture, until a script draws it: these and the scene.
FALLBACK = ("This figure needs a browser with scripts.", "planfly report LOG --pictures")
SCRIPTED = ("turns", "time", "controls", "energy", "envelope")


@pytest.mark.usefixtures("undrawn")
def test_one_remedy_stands_first_and_no_text_stands_twice() -> None:
    lower = replace(FINDINGS[2], suggestions=((Change("height", Place("leg", 1), None, 9.0, "m"),),))
    turn = replace(FINDINGS[0], ok=False, margin=-2.0, suggestions=((Change("turn", TURN, 9.0, 6.0, "deg"),),))
    lines = ("not flyable: slope on leg 1", "Not flown as written: item 9: no loiter")
    verdict = Verdict((turn, lower, *FINDINGS[1:2]), False, True, lines, "flown")
    page = Page(report_html(make_setup(), make_track(), verdict, **ARGUMENTS))
    assert page.text().count("Would pass at leg 1: raise both ends of leg 1 by 9 m.") == 1
    # Of each finding the remedy once: of the first at the top, of the other in its place.
    for item in (turn, lower):
        assert page.text().count(item.suggestion) == 1
    texts = [text.strip() for text in page.texts[: page.texts.index("All 3 findings")] if len(text.strip()) >= 25]
    assert [texts.count(text) for text in FALLBACK] == [len(SCRIPTED), len(SCRIPTED) + 1]
    texts = [text for text in texts if text not in FALLBACK]
    assert sorted(texts) == sorted(set(texts))
    assert page.text().count("item 9: no loiter") == 1


@pytest.mark.usefixtures("undrawn")
def test_details_are_folded() -> None:
    html = report_html(make_setup(), make_track(), VERDICT, **ARGUMENTS)
    folded = re.findall(r'<section id="([a-z-]+)">\s*<details class="fold">', html)
    assert {"turns", "time", "controls", "energy", "envelope", "legs", "all", "facts", "again"} <= set(folded)
    assert not {"map", "profile", "scene", "fails", "findings"} & set(folded)
    assert "<details open" not in html


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("line", "times"), [("flyable", 1), ("flyable; take-off not judged", 1)])
def test_an_answer_that_the_badge_gives_is_not_repeated(line: str, times: int) -> None:
    verdict = Verdict((), True, True, (line, "Start: in the air"), "flown")
    text = Page(report_html(make_setup(), make_track(), verdict, **ARGUMENTS)).text()
    assert text[text.index("✓") : text.index("Start: in the air")].lower().count("flyable") == times


@pytest.mark.usefixtures("undrawn")
def test_hostile_names_stay_text() -> None:
    setup = make_setup(name=EVIL, description=EVIL)
    setup = replace(setup, mission=replace(setup.mission, source=EVIL, warnings=(EVIL,)), aircraft=EVIL)
    evil = finding("threat", Place("missile", 0, name=EVIL), False, -1.0, reason=EVIL, method=EVIL, unit=EVIL)
    verdict = Verdict((evil,), False, False, (EVIL,), EVIL)
    html = report_html(setup, make_track(), verdict, ended=EVIL, versions={EVIL: EVIL}, command=EVIL)
    assert len(re.findall("<script", html)) == 5
    assert len(re.findall("</script", html)) == 5
    assert Page(html).text().count("<script>alert('x')</script>") > 8
    scene = json.loads(html.partition('id="scene-data">')[2].partition("</script>")[0])
    assert scene["name"] == EVIL
    assert scene["threats"][0]["name"] == EVIL[:90]


@pytest.mark.usefixtures("undrawn")
def test_a_plan_that_was_not_flown_has_a_report() -> None:
    setup = make_setup(terrain={"kind": "none"}, threats=[])
    verdict = Verdict(FINDINGS, False, False, ("no feasible plan: slope",), "plan")
    for track in (None, make_track().rows(0, 0)):
        html = report_html(setup, track, verdict, ended=None, versions={}, command="planfly run small")
        text = Page(html).text()
        assert "Not flyable: no feasible plan" in text
        assert "Nothing was flown" in text
        assert "none was given" in text
        assert "Energy" not in text
        assert html.count("<img") == 2


def test_pictures_are_drawn_into_page_and_files(tmp_path: Path) -> None:
    out = tmp_path / "made" / "here"
    paths = write_report(out, make_setup(), make_track(), VERDICT, **ARGUMENTS)
    assert [path.name for path in paths] == ["map.png", "profile.png", "report.html"]
    assert {path.name for path in out.iterdir()} == {path.name for path in paths}
    html = paths[-1].read_text(encoding="utf-8")
    # plotly.js, packed, is 1.5 MB of them.
    assert len(html) < 4e6
    assert base64.b64encode(paths[0].read_bytes()).decode() in html
    assert base64.b64encode(paths[1].read_bytes()).decode() in html
    assert html.count("data:image/png;base64,iVBOR") == 2
    if not SOAK:
        return
    before = {path.name: path.read_bytes() for path in paths}
    more = write_report(out, make_setup(), make_track(), VERDICT, every_picture=True, svg=True, **ARGUMENTS)
    assert {path.name: path.read_bytes() for path in paths} == before
    drawn = [path for path in more if path.suffix == ".svg"]
    # This flight is exposed to nothing, flies no survey, and its returns were not judged.
    absent = {"exposure", "survey", "returns", "worst-returns", "return-heights", "glide"}
    assert [path.stem for path in drawn] == [name for name in NAMES if name not in absent]
    assert {path.stem for path in more if path.suffix == ".png"} == {path.stem for path in drawn}
    first = [path.read_bytes() for path in drawn]
    assert all(ElementTree.fromstring(data).tag.endswith("svg") for data in first)
    write_report(out, make_setup(), make_track(), VERDICT, every_picture=True, svg=True, **ARGUMENTS)
    assert [path.read_bytes() for path in drawn] == first


@pytest.mark.usefixtures("undrawn")
def test_a_report_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "map.png").mkdir()
    with pytest.raises(OSError, match=r"map\.png"):
        write_report(tmp_path, make_setup(), make_track(), VERDICT, **ARGUMENTS)
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]
