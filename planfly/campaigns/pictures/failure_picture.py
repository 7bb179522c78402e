"""Failures by rule and place."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from logs.figures.elements.style import FAIL, INK, QUIET, clean_style, new_figure, shorten

# Most bars, of the most frequent.
MOST = 14


def draw_failures(counts: Sequence[tuple[str, str, int]], flights: int) -> Figure:
    """Bars of how many flights failed by which rule at which place, the most first.

    counts: rule's title, place in words, flights.  flights: all of them.
    """
    with clean_style():
        shown = sorted(counts, key=lambda one: -one[2])[:MOST]
        tall = 1.4 + 0.32 * max(1, len(shown))
        figure = new_figure(tall)
        axes = figure.add_axes((0.27, 0.6 / tall, 0.69, 1.0 - 1.1 / tall))
        axes.set_title("Failures by rule and place")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        if not shown:
            axes.set_axis_off()
            axes.text(0.0, 0.5, f"No flight of {flights} failed.", transform=axes.transAxes, fontsize=11, color=QUIET)
            return figure
        rows = list(range(len(shown)))
        numbers = [one[2] for one in shown]
        axes.barh(rows, numbers, height=0.62, color=FAIL)
        for row, number in zip(rows, numbers, strict=True):
            axes.annotate(
                f"{number}  ({100.0 * number / max(1, flights):.1f} %)", (number, row), xytext=(4, 0),
                textcoords="offset points", va="center", fontsize=8, color=INK,
            )  # fmt: skip
        axes.set_yticks(rows, [shorten(f"{rule}, {place}", 38) for rule, place, _ in shown])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.2 * max(numbers))
        axes.set_xlabel(f"flights, of {flights}")
    return figure
