"""Tables for notebooks: well-formed, and text stays text."""

from xml.etree import ElementTree

from world.html_table import html_table


def test_rows_and_heads_stand_where_they_belong() -> None:
    page = ElementTree.fromstring(html_table("a", [("x", 1), ("y", 2.5)], ("name", "value")))
    assert page.findtext("strong") == "a"
    assert [cell.text for cell in page.iter("th")] == ["name", "value"]
    assert [[cell.text for cell in row] for row in page.find("table/tbody") or ()] == [["x", "1"], ["y", "2.5"]]


def test_what_a_file_is_called_runs_nothing() -> None:
    text = html_table("<script>alert(1)</script>", [('"><img src=x onerror=alert(1)>', "&amp;")], ("<b>",))
    page = ElementTree.fromstring(text)
    assert {element.tag for element in page.iter()} == {
        *("div", "strong", "table", "thead", "tbody", "tr", "th", "td"),
    }
    assert [cell.text for cell in page.iter("td")] == ['"><img src=x onerror=alert(1)>', "&amp;"]
