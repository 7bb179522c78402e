"""Write the page of an answer from many flights.

It has the answer, pictures, tables, and the command that repeats it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from markupsafe import Markup
from matplotlib.figure import Figure

from logs.theme import css_variables
from logs.views.drawing import page_svg
from logs.views.report.page import page_template
from planfly.campaigns.pictures import narrow_figure

# Style of the answer: the colour of its box.
AnswerStyle = Literal["reached", "missed", "undecided", ""]
# Style of an answer that is yes, no, or not known.
STYLES: dict[bool | None, AnswerStyle] = {True: "reached", False: "missed", None: "undecided"}
# Style of a column: of text, of text without line breaks, or of numbers.
ColumnStyle = Literal["", "u", "n"]


class PageTable(NamedTuple):
    """Table of a page.

    columns: title and style of each column.
    rows: cells of each row; the last cell of a shorter row fills the rest of the row.
    heading: heading above the table; "" for none.
    """

    columns: Sequence[tuple[str, ColumnStyle]]
    rows: Sequence[Sequence[str]]
    heading: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerPage:
    """Contents of the page of an answer.

    command_name: command that gives the answer, for the title of the page.
    name: name of the mission.
    heading: question, which follows the name in the heading.
    style: style of the answer.
    lines: answer, then its conditions.
    figures: each figure with its caption.
    explanation: paragraphs below the tables.
    command: command line that repeats the answer; "" without one.
    """

    command_name: str
    name: str
    heading: str
    style: AnswerStyle
    lines: Sequence[str]
    figures: Sequence[tuple[Figure, str]]
    tables: Sequence[PageTable]
    explanation: Sequence[str]
    command: str

    def render(self) -> bytes:
        """Return the page as UTF-8; the figures are changed to the narrow layout."""
        text = render_page(
            "answer.html",
            command_name=self.command_name,
            name=self.name,
            heading=self.heading,
            answer=self.style,
            lines=self.lines,
            pictures=[draw_both_widths(figure, caption) for figure, caption in self.figures],
            tables=self.tables,
            explanation=self.explanation,
            command=self.command,
        )
        return text.encode("utf-8")


def render_page(template: str, **values: object) -> str:
    """Return the HTML text of a template of this package, filled with values."""
    return page_template(template, "planfly.campaigns").render(colours=Markup(css_variables()), **values)


def draw_both_widths(figure: Figure, caption: str) -> Markup:
    """Return HTML with a figure in a wide and a narrow layout.

    The figure itself is changed to the narrow layout.

    caption: text alternative of the figure.
    """
    wide_svg = page_svg(figure, caption)
    narrow_svg = page_svg(narrow_figure(figure), f"{caption} (narrow)")
    return Markup(f'<div class="wide">{wide_svg}</div><div class="narrow">{narrow_svg}</div>')
