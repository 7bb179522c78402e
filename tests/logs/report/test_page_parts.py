"""The page's scripts are whole files of their own, and plotly.js comes out of the page as it went in."""

import base64
import gzip
import hashlib
from importlib import resources

from plotly.offline import get_plotlyjs

from logs.report.page_parts import CHART_SCRIPTS, VIEW_SCRIPTS, page_library, script_text, style_text


def test_plotly_comes_out_as_it_went_in_and_its_hash_is_named() -> None:
    library = page_library()
    text = gzip.decompress(base64.b64decode(library.packed))
    assert text.decode("utf-8") == get_plotlyjs()
    assert library.digest == "sha256-" + base64.b64encode(hashlib.sha256(text).digest()).decode()
    assert library.version in text[:200].decode()
    # A third of the script, so that a page with all it may hold stays below 8 MB.
    assert len(library.packed) < 2.2e6


def test_every_script_stands_in_the_page_once_and_none_is_long() -> None:
    folder = resources.files("logs.report").joinpath("templates", "scripts")
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
