"""What the verbs give prints in a line and is a table in a notebook."""

from pathlib import Path
from xml.etree import ElementTree

import planfly


def test_a_flight_prints_in_a_line(flown: planfly.FlownMission) -> None:
    line = repr(flown)
    assert line.startswith("<FlownMission paper-07: completed; <Track: ")
    assert "<Verdict flown: flyable; " in line
    assert len(line) < 250


def test_a_flight_names_its_parts(flown: planfly.FlownMission, path: planfly.Plan) -> None:
    assert flown.flyable is flown.verdict.flyable is True
    assert flown.mission is flown.setup.mission
    assert flown.plan is path


def test_a_notebook_shows_verdict_and_track(flown: planfly.FlownMission) -> None:
    page = ElementTree.fromstring(f"<page>{flown._repr_html_()}</page>")
    assert [title.text for title in page.iter("strong")] == [flown.verdict.headline, repr(flown.track)[1:-1]]


def test_a_report_shows_its_files() -> None:
    written = planfly.WrittenReport(Path("out/report.html"), (Path("out/map.png"), Path("out/report.html")))
    page = ElementTree.fromstring(written._repr_html_())
    assert [cell.text for cell in page.iter("td")] == ["map.png", "report.html"]
