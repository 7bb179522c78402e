"""The film of the studio in docs/: a waypoint is dragged into a threat, the suggestion is applied, the mission saved.

``python -m tests.planfly.studio.draw_film docs/studio.webp`` films it in a headless Chromium.  What is awaited is cut:
each step is shown for as long as it is to be read, whatever the machine took for it.
"""

import base64
import io
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from PIL import Image, ImageDraw

from benchmarks.studio import drawn, running, write_missions
from tests.browser import Browser
from tests.planfly.studio.draw_studio import CENTRE, MARK

SIZE, SHOWN = (1200, 740), (900, 555)
# How far the waypoint is dragged, pixels.
WAY = (-18.0, 38.0)
# Between two frames of what moves, ms.
FRAME = 80
FLOWN = "['ok', 'fail', 'open'].includes(document.getElementById('flown').dataset.state)"
MIDDLE = """(() => {{
 const one = [...document.querySelectorAll('button')].find((b) => b.textContent === '{}' && b.checkVisibility());
 const r = one.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"""
# The pointer, which a browser without a head does not draw.
ARROW = ((0, 0), (0, 17), (4, 13), (7, 20), (10, 19), (7, 12), (13, 12))


@dataclass
class Film:
    """A page that is filmed. at: where the pointer is; frames: with how long each is shown, ms."""

    browser: Browser
    at: tuple[float, float] = (SIZE[0] * 0.8, SIZE[1] * 0.6)
    frames: list[tuple[Image.Image, int]] = field(default_factory=list)

    def show(self, shown: int = FRAME) -> None:
        """Add what is seen now."""
        self.browser.settle()
        data = base64.b64decode(self.browser.call("Page.captureScreenshot", format="png")["data"])
        picture = Image.open(io.BytesIO(data)).convert("RGB")
        pen = ImageDraw.Draw(picture)
        pen.polygon([(self.at[0] + x, self.at[1] + y) for x, y in ARROW], fill="white", outline="black", width=1)
        self.frames.append((picture.resize(SHOWN, Image.Resampling.LANCZOS), shown))

    def go(self, to: tuple[float, float], steps: int = 8, *, held: bool = False) -> None:
        """Move the pointer."""
        more = {"button": "left", "buttons": 1} if held else {}
        (x, y), (far, further) = self.at, to
        for k in range(1, steps + 1):
            share = k * k * (3 * steps - 2 * k) / steps**3
            self.at = (x + share * (far - x), y + share * (further - y))
            self.browser.mouse("mouseMoved", *self.at, **more)
            self.show()

    def press(self) -> None:
        """Press the button of the mouse."""
        self.browser.mouse("mousePressed", *self.at, button="left", clickCount=1)

    def let_go(self) -> None:
        """Let it go."""
        self.browser.mouse("mouseReleased", *self.at, button="left", clickCount=1)

    def click(self, words: str) -> None:
        """Click the button with these words."""
        x, y = self.browser.value(MIDDLE.format(words))
        self.go((x, y))
        self.press()
        self.let_go()

    def until(self, condition: str, shown: int) -> None:
        """Wait for something, and show it."""
        self.browser.wait_for(condition)
        self.show(shown)


def play(film: Film) -> None:
    """All of it."""
    x, y = (one + 6.0 for one in film.browser.value(CENTRE.format(MARK)))
    film.show(900)
    film.go((x, y))
    film.press()
    film.go((x + WAY[0], y + WAY[1]), 18, held=True)
    film.until("document.getElementById('geometry').dataset.state === 'fail'", 200)
    film.until("!document.getElementById('geometry').textContent.includes('place')", 1100)
    film.let_go()
    film.until(f"{FLOWN} && !document.querySelector('#panel-verdict .stale')", 1300)
    film.click("Apply")
    film.until("document.getElementById('geometry').dataset.state === 'ok'", 500)
    film.until(f"{FLOWN} && !document.querySelector('#panel-verdict .stale')", 1300)
    film.click("Save")
    film.until("document.getElementById('panel-files').textContent.includes('is saved')", 2000)


def draw(target: Path) -> None:
    """Film it into a file."""
    with (
        tempfile.TemporaryDirectory(prefix="missions-", dir=Path.home()) as place,
        tempfile.TemporaryDirectory() as profile,
    ):
        folder = Path(place)
        write_missions(folder)
        for name in ("w100.waypoints", "w500.waypoints", "zones.geojson"):
            (folder / name).unlink()
        with running(folder, ("demo.json",)) as (address, _), Browser(Path(profile), *SIZE) as browser:
            drawn(browser, address)
            film = Film(browser)
            play(film)
    pictures, shown = zip(*film.frames, strict=True)
    settings = {"quality": 62, "method": 6, "minimize_size": True, "loop": 0}
    pictures[0].save(target, save_all=True, append_images=pictures[1:], duration=list(shown), **settings)
    print(f"{target}: {len(pictures)} frames, {sum(shown) / 1000:.1f} s, {target.stat().st_size / 2**20:.2f} MB")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
