"""Define the colours, line widths and dashes of all pictures, pages and scenes.

No other file states any.  A role is a word for what is drawn ("missile", "planned"); charts name roles, never colours.
Each role has one style in a light and a dark variant.  PNG and SVG files use the light variant; pages switch between
both by the reader's preference; scenes of Foxglove and Rerun are black and use the dark variant.

The colours of the data come from Okabe and Ito, "Color Universal Design" (2008), so that people with any of the common
colour vision deficiencies can tell them apart.  Limits have ColorBrewer's violet.  Dashes, markers or hatches repeat
each distinction.
"""

import re
from dataclasses import dataclass

# Wong's names of Okabe and Ito's palette.
_SKY = "#56b4e9"
_BLUE = "#0072b2"
_ORANGE = "#e69f00"
_VERMILLION = "#d55e00"
_YELLOW = "#f0e442"
_GREEN = "#007a5a"  # bluish green, darkened for thin dashes on pale ground
_PURPLE = "#b0408a"  # reddish purple, darkened for text
_VIOLET = "#5e3c99"  # ColorBrewer's PuOr
_BROWN = "#7a1f1f"


@dataclass(frozen=True, slots=True)
class RoleStyle:
    """The style in which a role is drawn.

    light, dark: colour on light and on dark background, "#rrggbb".
    width: width of its lines, typographic points; on a page a point is 1.25 pixels.
    dash: lengths of strokes and gaps, points; () for a solid line.
    fill: opacity of its areas, 0 to 1.
    size: size of its dots, points.
    face: role whose colour fills its dots; "" for its own colour.
    edge: role whose colour its areas have at their edge; "" for its own colour.
    marker: shape of its dots: "circle", "triangle", "star" or "cross".
    hatch: hatch of its areas in print, in matplotlib's notation.
    halo: True if its lines have a pale rim in print, because they cross coloured ground.
    """

    light: str
    dark: str
    width: float = 1.2
    dash: tuple[float, ...] = ()
    fill: float = 0.22
    size: float = 5.5
    face: str = ""
    edge: str = ""
    marker: str = "circle"
    hatch: str = ""
    halo: bool = False


_MISSILE = RoleStyle(_VERMILLION, "#ff8033")
_RADAR = RoleStyle(_GREEN, "#2fc79a", dash=(5.0, 3.0), fill=0.05)
_PLANNED = RoleStyle(_SKY, _SKY, width=3.6, halo=True)
_FLOWN = RoleStyle("#000000", "#f4f4f4", width=1.1)
_FAIL = RoleStyle(_PURPLE, "#e87cc4", width=2.2, size=12.0)
_ZONE = RoleStyle(_BROWN, "#e89090", fill=0.14, hatch="////")
_SECOND = RoleStyle(_BLUE, "#7cc0f5", width=1.8)
_GREY = "#6b6b6b"
_PALE_GREY = "#a9adb5"
# Styles of the path by the outcome of a return to launch, and by the destination within reach without an engine.
_SAFE = RoleStyle(_GREEN, "#2fc79a", width=4.4, halo=True)
_WRONG = RoleStyle(_PURPLE, "#e87cc4", width=4.4, dash=(5.0, 1.0), halo=True)
_SHORT = RoleStyle(_ORANGE, "#ffb938", width=4.4, dash=(9.0, 2.0), halo=True)
_SPARE = 1.8  # width of a line of altitude to spare
_NOT_KNOWN = RoleStyle(_GREY, _PALE_GREY, width=4.4, dash=(2.0, 3.0), halo=True)

# Style of each role of the data.
ROLE_STYLES = {
    "missile": _MISSILE,
    "missile-reach": RoleStyle(_MISSILE.light, _MISSILE.dark, width=0.0, fill=0.3),
    "radar": _RADAR,
    "limit": RoleStyle(_VIOLET, "#b9a2ec", width=1.4, dash=(6.0, 2.5)),
    "steady-limit": RoleStyle(_VIOLET, "#b9a2ec", width=1.8),
    "planned": _PLANNED,
    "planned-leg": RoleStyle("#1d1d1f", "#e8e8ea", width=0.8, size=7.0, face="planned"),
    "searched": RoleStyle("#555555", "#a9adb5", width=1.2, dash=(6.0, 2.0, 1.5, 2.0)),
    "flown": _FLOWN,
    "moment": RoleStyle(_FLOWN.light, _FLOWN.dark, size=2.4, fill=0.3),
    "commanded": RoleStyle(_ORANGE, "#ffb938", width=2.0),
    "second": _SECOND,
    "other": RoleStyle(_VERMILLION, "#ff8033", width=1.4, dash=(5.0, 2.0)),
    "band": RoleStyle(_VERMILLION, "#ff8033", width=0.0, fill=0.25),
    "difference": RoleStyle(_GREY, _PALE_GREY, width=1.0, fill=0.25),
    "waypoint": RoleStyle(_BLUE, "#7cc0f5", width=1.0, size=4.6, face="paper"),
    "waypoint-small": RoleStyle(_BLUE, "#7cc0f5", width=0.5, size=1.6, face="paper"),
    "start": RoleStyle("#000000", "#000000", width=1.0, size=9.0, face="highlight", marker="triangle"),
    "destination": RoleStyle("#000000", "#000000", width=1.0, size=13.0, face="highlight", marker="star"),
    "unit": RoleStyle("#333333", "#e8e8ea", width=0.8, size=3.5, marker="cross"),
    "fail": _FAIL,
    "failing-leg": RoleStyle(_FAIL.light, _FAIL.dark, width=9.5, fill=0.9),
    "inside": RoleStyle(_FAIL.light, _FAIL.dark, width=3.6),
    "entered": RoleStyle(_FAIL.light, _FAIL.dark, width=1.8, fill=0.16),
    "held": RoleStyle(_FAIL.light, _FAIL.dark, width=0.0, fill=0.25),
    "zone": _ZONE,
    "stay-in": RoleStyle(_ZONE.light, _ZONE.dark, width=2.2),
    "terrain": RoleStyle("#cdbf9f", "#6e6447", width=0.9, fill=1.0, edge="contour"),
    "contour": RoleStyle("#6b5a3a", "#c9b994", width=0.6),
    "clearance": RoleStyle("#f8dfa6", "#4d3d1d", width=0.0, fill=1.0, edge="commanded", hatch="////"),
    "area": RoleStyle("#555555", "#a9adb5", width=0.9, dash=(8.0, 3.0)),
    "pole": RoleStyle("#555555", "#a9adb5", width=0.7),
    "level-ground": RoleStyle("#8b8b92", "#7d838d", width=0.8, fill=0.1),
    "aircraft": RoleStyle("#c8102e", "#ff5a6e", width=2.0),
    "return-safe": _SAFE,
    "return-ground": _WRONG,
    "return-threat": RoleStyle(_MISSILE.light, _MISSILE.dark, width=4.4, dash=(3.0, 1.5), halo=True),
    "return-zone": RoleStyle(_BROWN, "#e89090", width=4.4, dash=(9.0, 2.0, 2.0, 2.0), halo=True),
    "return-lost": RoleStyle(_BLUE, "#7cc0f5", width=4.4, dash=(6.0, 2.0, 2.0, 2.0), halo=True),
    "return-energy": RoleStyle(_BLUE, "#7cc0f5", width=4.4, dash=(2.0, 1.5), halo=True),
    "return-low": _SHORT,
    "return-unknown": _NOT_KNOWN,
    "return-power": RoleStyle(_BLUE, "#7cc0f5", width=4.4, dash=(6.0, 3.0), halo=True),
    "return-used": RoleStyle(_BLUE, "#7cc0f5", width=4.4, dash=(2.0, 3.0), halo=True),
    "return-unsure": RoleStyle(_GREY, _PALE_GREY, width=4.4, dash=(6.0, 3.0), halo=True),
    "return-way": RoleStyle("#1d1d1f", "#f4f4f4", width=1.5, dash=(9.0, 2.0), halo=True),
    "reach-home": _SAFE,
    "reach-site": RoleStyle(_BLUE, "#7cc0f5", width=4.4, dash=(14.0, 2.0), halo=True),
    "reach-flat": _SHORT,
    "reach-nothing": _WRONG,
    "reach-unknown": _NOT_KNOWN,
    "left-home": RoleStyle(_GREEN, "#2fc79a", width=_SPARE),
    "left-site": RoleStyle(_BLUE, "#7cc0f5", width=2.4 * _SPARE),
    "left-flat": RoleStyle(_ORANGE, "#ffb938", width=_SPARE, dash=(4.0, 1.5)),
    "glide-near": RoleStyle(_BLUE, "#7cc0f5", width=0.0, fill=0.58),
    "glide-middle": RoleStyle(_BLUE, "#7cc0f5", width=0.0, fill=0.4),
    "glide-far": RoleStyle(_BLUE, "#7cc0f5", width=0.0, fill=0.22),
    "landable": RoleStyle(_YELLOW, _YELLOW, width=0.0, fill=0.45, hatch="..."),
    "coverage-weak": RoleStyle(_ORANGE, "#ffb938", width=0.0, fill=0.32),
    "coverage-lost": RoleStyle(_PURPLE, "#e87cc4", width=0.0, fill=0.22, hatch="\\\\"),
    "coverage-ground": RoleStyle(_GREY, _PALE_GREY, width=0.0, fill=0.45, hatch="xxx"),
    "flight-geography": RoleStyle(_GREEN, "#2fc79a", width=1.8, fill=0.06, halo=True),
    "contingency-volume": RoleStyle(_ORANGE, "#ffb938", width=2.2, dash=(8.0, 2.0), fill=0.06, halo=True),
    "ground-risk-buffer": RoleStyle(_VERMILLION, "#ff8033", width=2.4, dash=(4.0, 1.5), fill=0.06, halo=True),
    "population-0": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.04),
    "population-1": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.14),
    "population-2": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.28),
    "population-3": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.44),
    "population-4": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.62),
    "population-5": RoleStyle(_VIOLET, "#b9a2ec", width=0.0, fill=0.85),
    "front-other": RoleStyle(_GREY, _PALE_GREY, width=0.9, size=4.0, halo=True),
    "front-shortest": RoleStyle(_BLUE, "#7cc0f5", width=2.2, size=7.0, halo=True),
    "front-unseen": RoleStyle(_PURPLE, "#e87cc4", width=2.2, dash=(8.0, 2.0), size=7.0, marker="triangle", halo=True),
    "front-high": RoleStyle(_ORANGE, "#ffb938", width=2.2, dash=(4.0, 1.5), size=9.0, marker="star", halo=True),
    "front-sparing": RoleStyle(
        _FLOWN.light, _FLOWN.dark, width=2.2, dash=(8.0, 1.5, 1.5, 1.5), size=7.0, marker="cross", halo=True
    ),
    "comes-down": RoleStyle("#333333", "#e8e8ea", width=1.0, size=3.4, face="paper"),
}

# Colours of axes and page, light and dark, by the element that has them.
PAGE = {
    "paper": ("#ffffff", "#16181c"),
    "plot": ("#ffffff", "#1d2026"),
    "sky": ("#edf2f7", "#10141a"),
    "unknown": ("#f4f4f4", "#22252b"),
    "ink": ("#1d1d1f", "#e8e8ea"),
    "quiet": ("#5c5c61", "#a9adb5"),
    "grid": ("#e2e2e2", "#383c44"),
    "rule": ("#d9d9de", "#383c44"),
    "rim": ("#8b8b92", "#7d838d"),
    "link": ("#00568f", "#7cc4ff"),
    "code": ("#f4f4f6", "#22252b"),
    "highlight": (_YELLOW, _YELLOW),
    "good": ("#006b4f", "#4cc9a0"),
    "good-back": ("#eef8f4", "#12291f"),
    "bad": ("#a3260b", "#ff9a84"),
    "bad-back": ("#fdf2ef", "#331a14"),
    "open": ("#7a5200", "#ffc861"),
    "open-back": ("#fff5dc", "#33270c"),
    "unjudged-back": ("#f6f6f7", "#22252b"),
    "on-badge": ("#ffffff", "#16181c"),
}

# Size of a label, points, and gap between the label and its position, pixels, by the label's rank.
LABELS = {"fail": (7.0, 16.0), "end": (8.0, 12.0), "number": (7.5, 8.0), "name": (6.2, 4.0)}

# Colours of the ground from valley to summit.  The lightness increases, so that heights are readable without colour.
GROUND = ("#9fbfa5", "#cfd8b0", "#efe7c8", "#f6efe2", "#ffffff")
GROUND_DARK = ("#2b3a31", "#3f4737", "#565341", "#6d6758", "#8c877f")

# Colours of several lines of the same kind, from dark to light.
SHADES = (_FLOWN.light, _BLUE, _GREEN, _ORANGE, _PURPLE)
# Colours of the algorithms in a figure of the paper.
SERIES = (_BLUE, _PURPLE, "#1d1d1f", _ORANGE, _SKY, "#5c5c61")
# Colours of the modes of an aircraft's motion: short period, phugoid, Dutch roll, roll-spiral, roll, spiral.
MODES = (_BLUE, _VERMILLION, _GREEN, "#1d1d1f", _PURPLE, _ORANGE)
# The aircraft's model in 3-D scenes: body, left wing and right wing, with the colours of navigation lights.
AIRCRAFT_PARTS = ("#ebebe0", "#d91a1a", "#1a9933")


def colour(name: str, *, dark: bool = False) -> str:
    """Return a colour of the theme, "#rrggbb".

    Raises KeyError for an unknown name.

    name: role of the data in `ROLE_STYLES`, or element of axes and page in `PAGE`.
    dark: True for the colour on dark background.

    >>> colour("flown"), colour("paper", dark=True)
    ('#000000', '#16181c')
    """
    role_style = ROLE_STYLES.get(name)
    light, night = (role_style.light, role_style.dark) if role_style is not None else PAGE[name]
    return night if dark else light


def rgb(text: str) -> tuple[float, float, float]:
    """Convert a colour "#rrggbb" to red, green and blue, 0 to 1.

    >>> rgb("#ff0033")
    (1.0, 0.0, 0.2)
    """
    red, green, blue = (int(text[start : start + 2], 16) / 255.0 for start in (1, 3, 5))
    return red, green, blue


def rgba(name: str, opacity: float = 1.0, *, dark: bool = False) -> tuple[float, float, float, float]:
    """Return red, green, blue and opacity of a theme colour, 0 to 1.

    name: role or page element, as in `colour`.
    dark: True for the colour on dark background.

    >>> rgba("flown", 0.5)
    (0.0, 0.0, 0.0, 0.5)
    """
    return (*rgb(colour(name, dark=dark)), opacity)


def palette_colours() -> tuple[str, ...]:
    """Return the light colours that a picture with a reduced palette keeps.

    They are the colours of all roles, and paper, ink and highlight.

    >>> colour("missile") in palette_colours()
    True
    """
    return tuple(
        dict.fromkeys(
            [
                *(role_style.light for role_style in ROLE_STYLES.values()),
                colour("paper"),
                colour("ink"),
                colour("highlight"),
            ]
        )
    )


def css_variables() -> str:
    """Return CSS rules that define a variable such as ``--missile`` for each colour of the theme.

    The variables have the light colours, and the dark colours on screens that prefer a dark scheme.

    >>> "--missile: #" in css_variables()
    True
    """
    rules = []
    for dark in (False, True):
        names = {name: colour(name, dark=dark) for name in (*PAGE, *ROLE_STYLES)}
        names |= {f"ground-{k}": text for k, text in enumerate(GROUND_DARK if dark else GROUND)}
        values = " ".join(f"--{name}: {text};" for name, text in names.items())
        rules.append(f":root {{ color-scheme: {'dark' if dark else 'light'}; {values} }}")
    light, night = rules
    return f"{light}\n@media screen and (prefers-color-scheme: dark) {{ {night} }}\n"


_HEX = re.compile(r"#[0-9a-f]{6}\b")


def replace_colours_by_css_variables(svg: str) -> str:
    """Replace the theme's light colours in the text of an SVG by the variables of `css_variables`.

    If several names share a light colour, the first is used; names in `PAGE` come before names in `ROLE_STYLES`.

    >>> replace_colours_by_css_variables("fill: #1d1d1f; stroke: #123456")
    'fill: var(--ink); stroke: #123456'
    """
    variable_by_colour = {text: f"ground-{k}" for k, text in reversed(list(enumerate(GROUND)))}
    variable_by_colour |= {colour(name): name for name in reversed((*PAGE, *ROLE_STYLES))}

    def replace_colour(match: re.Match[str]) -> str:
        """Return the variable of a matched colour, or the colour itself if it has no variable."""
        variable = variable_by_colour.get(match[0])
        return match[0] if variable is None else f"var(--{variable})"

    return _HEX.sub(replace_colour, svg)


# Pixels of a page per point of print.
_PIXELS = 1.25
# plotly.js' names of the markers.
_SYMBOLS = {"circle": "circle", "triangle": "triangle-up", "star": "star", "cross": "x-thin"}


def page_styles() -> dict[str, dict[str, object]]:
    """Return the style of each role for the page's scripts.

    Colours are not included; `css_variables` defines them.  Widths, dashes and sizes are in pixels.

    >>> page_styles()["missile"]["dash"]
    'solid'
    """
    return {
        name: {
            "width": round(_PIXELS * role_style.width, 2),
            "dash": ",".join(f"{_PIXELS * part:g}px" for part in role_style.dash) or "solid",
            "fill": role_style.fill,
            "size": round(_PIXELS * role_style.size, 2),
            "face": role_style.face or name,
            "edge": role_style.edge or name,
            "symbol": _SYMBOLS[role_style.marker],
        }
        for name, role_style in ROLE_STYLES.items()
    }
