"""Small HTML table that displays planfly's results in notebooks."""

from collections.abc import Iterable, Sequence
from html import escape


def html_table(title: str, rows: Iterable[Sequence[object]], head: Sequence[str] = ()) -> str:
    """Return a table under a title as HTML; all text is escaped, so that a name cannot contain HTML.

    head: names of the columns, if any.

    >>> html_table("a<b", [("length", 1.5)])
    '<div><strong>a&lt;b</strong><table><tbody><tr><td>length</td><td>1.5</td></tr></tbody></table></div>'
    """
    body = "".join(_row_html("td", row) for row in rows)
    heading = f"<thead>{_row_html('th', head)}</thead>" if head else ""
    return f"<div><strong>{escape(title)}</strong><table>{heading}<tbody>{body}</tbody></table></div>"


def _row_html(tag: str, values: Iterable[object]) -> str:
    """Return a row of a table as HTML; its values are escaped."""
    return f"<tr>{''.join(f'<{tag}>{escape(str(value))}</{tag}>' for value in values)}</tr>"
