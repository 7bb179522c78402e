"""The pictures of the studio in docs/: the demo while a waypoint is dragged into a threat, light and wide.

``python -m tests.planfly.studio.draw_studio docs/studio.png`` draws it in a headless Chromium.
"""

import base64
import io
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageColor

from benchmarks.studio import drawn, running, write_missions
from logs.theme import palette_colours
from tests.browser import Browser

# The waypoint that is dragged, and by how much, pixels.
MARK, WAY = 7, (-30.0, 62.0)
CENTRE = (
    "(() => {{ const r = document.querySelectorAll('.mark .dot')[{}].getBoundingClientRect(); return [r.x, r.y]; }})()"
)


def draw(target: Path) -> None:
    """Draw it into a file, in 256 colours."""
    with tempfile.TemporaryDirectory() as place, tempfile.TemporaryDirectory() as profile:
        write_missions(Path(place))
        with running(Path(place), ("demo.json",)) as (address, _), Browser(Path(profile), 1400, 860) as browser:
            drawn(browser, address)
            x, y = (one + 6.0 for one in browser.value(CENTRE.format(MARK)))
            browser.mouse("mousePressed", x, y, button="left", clickCount=1)
            for k in range(1, 11):
                browser.mouse("mouseMoved", x + k * WAY[0] / 10, y + k * WAY[1] / 10, button="left", buttons=1)
            browser.wait_for("document.getElementById('geometry').dataset.state === 'fail'")
            browser.wait_for("!document.getElementById('geometry').textContent.includes('place')")
            browser.settle()
            picture = base64.b64decode(browser.call("Page.captureScreenshot", format="png")["data"])
    _few_colours(Image.open(io.BytesIO(picture)).convert("RGB")).save(target, optimize=True)


def _few_colours(picture: Image.Image) -> Image.Image:
    """A picture in 256 colours, those of the roles as they are."""
    kept = [channel for colour in palette_colours() for channel in ImageColor.getrgb(colour)[:3]]
    others = picture.quantize(256 - len(kept) // 3).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([*kept, *others][: 3 * 256])
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
