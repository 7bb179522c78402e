"""What the pages carry beside their words: style, scripts and plotly.js, and the policy that lets in no others."""

import base64
import gzip
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources

# The scripts in the order in which they stand; the comparison has charts and no view.
CHART_SCRIPTS = (
    "page_data", "theme", "ground", "chart_library", "chart_layout", "chart_panels", "chart_map", "charts",
)  # fmt: skip
VIEW_SCRIPTS = (
    "moments", "clock", "player", "view_gl", "view_shapes", "view_aircraft", "view_camera", "view_labels", "view_hands",
    "view",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class PageLibrary:
    """plotly.js as a page carries it.

    packed: compressed (gzip) and in base64.
    digest: of the script, as a policy names it.
    version: its own.
    """

    packed: str
    digest: str
    version: str


def script_text(names: tuple[str, ...]) -> str:
    """Scripts as one, each from its own file of ``templates/scripts``; ``start`` comes last, whatever is asked for."""
    files = resources.files("logs.report").joinpath("templates", "scripts")
    parts = [files.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in (*names, "start")]
    return '\n(function () {\n"use strict";\n' + "\n".join(parts) + "})();\n"


def style_text(*names: str) -> str:
    """Style sheets of ``templates`` as one: "style" is what both pages share."""
    files = resources.files("logs.report").joinpath("templates")
    return "\n".join(files.joinpath(f"{name}.css").read_text(encoding="utf-8") for name in names)


def script_digest(text: str) -> str:
    """A script as a policy names it (Content Security Policy Level 3, "hash-source").

    >>> script_digest("")
    'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='
    """
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


@cache
def page_library() -> PageLibrary:
    """plotly.js of the installed package, a third of its size; the same text gives the same bytes."""
    from plotly.offline import get_plotlyjs, get_plotlyjs_version

    text = get_plotlyjs()
    packed = gzip.compress(text.encode("utf-8"), mtime=0, compresslevel=6)
    return PageLibrary(base64.b64encode(packed).decode("ascii"), script_digest(text), get_plotlyjs_version())
