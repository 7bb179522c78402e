"""What all figures share: colours, sizes, the clean matplotlib settings they are drawn under, and their bytes.

Colours are those of Okabe and Ito, "Color Universal Design" (2008), which people with any of the common colour
vision deficiencies tell apart; line style, marker or fill make the same distinction a second time.
"""

import io
import itertools
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from PIL import Image

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

# 10 in at 150 dots an inch: every picture is 1500 px wide.
DPI = 150
WIDTH = 10.0

PLANNED = "#56B4E9"
FLOWN = "#000000"
MISSILE = "#D55E00"
RADAR = "#007A5A"  # Okabe-Ito's bluish green, darkened for thin dashes on pale ground
FAIL = "#B0408A"  # reddish purple, darkened for text
LIMIT = "#E69F00"
# Dark red-brown, always with a hatch or a broad line, which missiles have not; and the same as red, green and blue.
ZONE, ZONE_FILL = "#7A1F1F", (0.478, 0.122, 0.122)
BLUE = "#0072B2"
INK = "#222222"
QUIET = "#6b6b6b"
MARKER = "#F0E442"  # start and destination
# What a picture of few colours keeps as it is.
DRAWN = (PLANNED, FLOWN, MISSILE, RADAR, FAIL, LIMIT, ZONE, BLUE, INK, QUIET, MARKER, "#FFFFFF")

# Rises in lightness from valley to summit, so that height reads without colour.
GROUND = ("#9fbfa5", "#cfd8b0", "#efe7c8", "#f6efe2", "#ffffff")

_SETTINGS: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.edgecolor": "#555555",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "text.color": INK,
    # A scenario's or a threat's name may hold a dollar sign; it is never a formula.
    "text.parse_math": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "path.simplify": True,
    # Names inside an SVG would be random.
    "svg.hashsalt": "planfly",
}


@contextmanager
def clean_style() -> Iterator[None]:
    """Draw under matplotlib's own defaults and the settings above, whatever the user's matplotlibrc holds.

    The settings in force before come back at the end.

    >>> with clean_style():
    ...     mpl.rcParams["font.size"]
    8.5
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


def new_figure(height: float) -> Figure:
    """Make an empty figure of the common width, `height` inches tall, with its own canvas (no pyplot state).

    >>> new_figure(4.0).get_size_inches().tolist()
    [10.0, 4.0]
    """
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """Render the figure as a PNG; the same figure gives the same bytes (no date, no version inside).

    >>> figure = new_figure(2.0)
    >>> data = png_bytes(figure)
    >>> int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    (1500, 300)
    """
    return _rendered(figure, "png", {"Software": None})


def few_colours(png: bytes) -> bytes:
    """A PNG with 256 colours at most: of shaded ground a fifth of its size, with no difference to see on paper.

    >>> few_colours(png_bytes(new_figure(1.0)))[1:4]
    b'PNG'
    """
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        flat = picture.convert("RGB").quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    flat.save(buffer, format="png")
    return buffer.getvalue()


def svg_bytes(figure: Figure) -> bytes:
    """Render the figure as an SVG, its letters as outlines; the same figure gives the same bytes."""
    return _rendered(figure, "svg", {"Date": None, "Creator": None})


def _rendered(figure: Figure, kind: str, metadata: Any) -> bytes:
    buffer = io.BytesIO()
    with clean_style(), warnings.catch_warnings():
        # A name in a script that the font lacks shows as boxes; that is no reason to stop or to talk.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        figure.savefig(buffer, format=kind, dpi=DPI, metadata=metadata)
    return buffer.getvalue()


def shorten(text: str, length: int) -> str:
    """Cut the text with an ellipsis to at most `length` characters.

    >>> shorten("clearance, leg 12", 12)
    'clearance,…'
    """
    return text if len(text) <= length else text[: length - 1].rstrip() + "…"


def nice_step(span: float, parts: int) -> float:
    """Find the step of 1, 2 or 5 times a power of ten that cuts `span` into at most `parts` pieces."""
    raw = max(span, 1e-9) / parts
    power = 10.0 ** np.floor(np.log10(raw))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= raw * (1 - 1e-9):
            return float(factor * power)
    return float(10.0 * power)


def outline_rows(values: ArrayLike, count: int) -> Indices:
    """Rows that keep the outline of a long series: lowest and highest of each of `count` equal blocks, in order.

    values: (t,); not-a-number rows are kept out unless a block has nothing else.  Short series come back whole.
    """
    series = np.asarray(values, dtype=np.float64)
    if series.size <= 2 * count:
        return np.arange(series.size)
    edges = np.linspace(0, series.size, count + 1).astype(int)
    kept = {0, series.size - 1}
    for low, high in itertools.pairwise(edges):
        block = series[low:high]
        good = np.flatnonzero(np.isfinite(block))
        if good.size == 0:
            kept.add(int(low))
            continue
        kept.update((int(low + good[np.argmin(block[good])]), int(low + good[np.argmax(block[good])])))
    return np.array(sorted(kept), dtype=np.intp)
