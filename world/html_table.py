"""Small HTML table that displays planfly's results in notebooks."""

from collections.abc import Iterable, Sequence
from html import escape


def html_table(title: str, rows: Iterable[Sequence[object]], head: Sequence[str] = ()) -> str:
    """Make a table under a title; all text is escaped, so that names of files and missions are only text.

    head: names of the columns, if any.

    >>> html_table("a<b", [("length", 1.5)])
    '<div><strong>a&lt;b</strong><table><tbody><tr><td>length</td><td>1.5</td></tr></tbody></table></div>'
    """
    body = "".join(_row("td", row) for row in rows)
    heading = f"<thead>{_row('th', head)}</thead>" if head else ""
    return f"<div><strong>{escape(title)}</strong><table>{heading}<tbody>{body}</tbody></table></div>"


def _row(cell: str, values: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(str(value))}</{cell}>' for value in values)}</tr>"
