"""What tests of pages in a browser share: pictures as numbers, the page's problems, waiting for charts, and axe."""

import io
import json
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from tests.browser import Browser
from tests.clients import NODE_MODULES, need

# Messages of a software renderer about a screenshot, not about the page.
_RENDERER = re.compile(r"GL Driver Message|GPU stall|swiftshader", re.IGNORECASE)
_PATIENCE = 60.0
_GRAVE = ("critical", "serious")


def pixels(png: bytes) -> np.ndarray:
    """(height, width, 3), 0 to 255."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(np.int16)


def spread(png: bytes) -> int:
    """How many clearly different colours a picture has."""
    red, green, blue = np.moveaxis(pixels(png) // 17, -1, 0)
    return int(np.count_nonzero(np.bincount((red * 256 + green * 16 + blue).ravel())))


def changed(png: bytes, before: bytes) -> float:
    """Share of a picture's pixels that are clearly others than before."""
    return float((np.abs(pixels(png) - pixels(before)).max(axis=-1) > 25).mean())


def apart(one: bytes, other: bytes) -> float:
    """Mean difference of two pictures, 0 to 1."""
    return float(np.abs(pixels(one) - pixels(other)).mean()) / 255.0


def own_problems(browser: Browser) -> list[str]:
    return [text for text in browser.problems if not _RENDERER.search(text)]


def picture_when(browser: Browser, selector: str, shows: Callable[[bytes], bool]) -> bytes:
    """PNG of an element as soon as it shows what is asked for: a software renderer is behind on a loaded machine.

    After a minute the picture as it is then, whatever it shows.
    """
    deadline = time.monotonic() + _PATIENCE
    while True:
        browser.settle()
        png = browser.picture(selector)
        if shows(png) or time.monotonic() > deadline:
            return png


def until(browser: Browser, condition: str) -> None:
    """Wait until an expression of the page is true."""
    deadline = time.monotonic() + _PATIENCE
    while not browser.value(f"Boolean({condition})"):
        assert own_problems(browser) == []
        assert time.monotonic() < deadline, condition
        time.sleep(0.05)


def show_chart(browser: Browser, name: str) -> None:
    """Open a chart's section, bring the chart into the picture and wait until it is drawn."""
    chart = f"document.querySelector('[data-chart={name}]')"
    browser.value(f"for (const fold of [{chart}.closest('details')]) if (fold) fold.open = true")
    browser.value(f"{chart}.scrollIntoView({{block: 'center'}})")
    until(browser, f"{chart}.dataset.drawn")
    browser.settle()


def show_all_charts(browser: Browser) -> list[str]:
    """Draw each chart of the page; returns their names."""
    names: list[str] = browser.value("[...document.querySelectorAll('.charted .chart')].map(c => c.dataset.chart)")
    for name in names:
        show_chart(browser, name)
    return names


def prefer(browser: Browser, scheme: str, width: int, height: int = 900) -> None:
    """Show the page in a colour scheme ("light", "dark") and so wide, as a phone where it is narrow."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.call("Emulation.setEmulatedMedia", media="", features=features)
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.call("Emulation.setDeviceMetricsOverride", **size)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=width < 600, maxTouchPoints=2)


def grave_findings(browser: Browser) -> list[str]:
    """What axe calls critical or serious, a line each: its rule, why, and the first element."""
    script = need(NODE_MODULES / "axe-core" / "axe.min.js", "axe-core", "make clients")
    browser.value(Path(script).read_text(encoding="utf-8") + ";0")
    found = browser.value(
        "axe.run(document, {resultTypes: ['violations']}).then(r => JSON.stringify({passes: r.passes.length,"
        " violations: r.violations.map(v => [v.impact, `${v.id}: ${v.help}: ${v.nodes[0].html.slice(0, 200)}`])}))"
    )
    answer = json.loads(found)
    # A page on which nothing was looked at passes nothing.
    assert answer["passes"] > 10
    return [words for impact, words in answer["violations"] if impact in _GRAVE]
