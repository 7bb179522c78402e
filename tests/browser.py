"""Chromium without a head, driven over its own debugging pipe: no driver, no socket, no port."""

import base64
import itertools
import json
import os
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from tests.clients import need

_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--mute-audio",
    "--remote-debugging-pipe",
    # A browser on a machine with other work takes itself for stuck or unseen, and draws no more.
    "--disable-gpu-watchdog",
    "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
    "--disable-background-timer-throttling",
)
_PATIENCE = 60.0
# The browser reads from descriptor 3 and writes to descriptor 4.
_START = """
import os, sys
read, write = (os.dup(os.dup(os.dup(int(text)))) for text in sys.argv[1:3])
os.dup2(read, 3)
os.dup2(write, 4)
os.execvp(sys.argv[3], sys.argv[3:])
"""


class Browser:
    """One page in one browser; a context manager.

    problems: what the page's console said as error or warning, exceptions, refused policies and failed loads.
    requests: addresses that the page asked for, other than its own and data.
    """

    def __init__(
        self, profile: Path, width: int, height: int, *, phone: bool = False, flags: tuple[str, ...] = ()
    ) -> None:
        names = ("chromium", "chromium-browser", "google-chrome")
        program = need(next((path for name in names if (path := shutil.which(name))), None), "chromium", "apt package")
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.seen: list[str] = []
        self._numbers = itertools.count(1)
        self._answers: dict[int, dict[str, Any]] = {}
        self._rest = b""
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()
        command = [
            program,
            *_FLAGS,
            *flags,
            f"--user-data-dir={profile}",
            f"--window-size={width},{height}",
            "about:blank",
        ]
        start = [sys.executable, "-c", _START, str(to_read), str(to_write), *command]
        self._process = subprocess.Popen(
            start, pass_fds=(to_read, to_write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_read)
        os.close(to_write)
        self._session = ""
        try:
            self._begin(width, height, phone)
        except BaseException:
            self.__exit__(None, None, None)
            raise

    def _begin(self, width: int, height: int, phone: bool) -> None:
        target = self._wait_for_page()
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        if phone:
            self.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def _wait_for_page(self) -> str:
        deadline = time.monotonic() + _PATIENCE
        while time.monotonic() < deadline:
            for target in self.call("Target.getTargets")["targetInfos"]:
                if target["type"] == "page":
                    return str(target["targetId"])
            time.sleep(0.05)
        raise TimeoutError("the browser opened no page")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol and return its result."""
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + _PATIENCE
        while number not in self._answers:
            self._listen(deadline)
        answer = self._answers.pop(number)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return dict(answer["result"])

    def _listen(self, deadline: float) -> None:
        if not select.select([self._read], [], [], max(0.0, deadline - time.monotonic()))[0]:
            raise TimeoutError("the browser does not answer")
        data = os.read(self._read, 1 << 20)
        if not data:
            raise ConnectionError("the browser has gone")
        *whole, self._rest = (self._rest + data).split(b"\0")
        for text in whole:
            message = json.loads(text)
            if "id" in message:
                self._answers[message["id"]] = message
            else:
                self._note(message["method"], message["params"])

    def _note(self, method: str, said: dict[str, Any]) -> None:
        self.seen.append(method)
        if method == "Runtime.exceptionThrown":
            self.problems.append(str(said["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and said["type"] in ("error", "warning", "assert"):
            self.problems.append(str(said["args"]))
        elif method == "Log.entryAdded" and said["entry"]["level"] in ("error", "warning"):
            self.problems.append(str(said["entry"]["text"]))
        elif method == "Network.requestWillBeSent" and not said["request"]["url"].startswith(("data:", "file:")):
            self.requests.append(said["request"]["url"])

    def open(self, page: Path) -> None:
        """Load a file and wait until it is there."""
        self.go(page.resolve().as_uri())

    def go(self, address: str) -> None:
        """Load an address and wait until it is there."""
        self.seen.clear()
        self.call("Page.navigate", url=address)
        deadline = time.monotonic() + _PATIENCE
        while "Page.loadEventFired" not in self.seen:
            self._listen(deadline)

    def value(self, expression: str) -> Any:
        """Evaluate JavaScript in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, expression: str, patience: float = _PATIENCE) -> Any:
        """Wait until an expression in the page is true, and give what it is."""
        deadline = time.monotonic() + patience
        while not (value := self.value(expression)):
            if time.monotonic() > deadline:
                raise TimeoutError(f"never true: {expression}")
            time.sleep(0.02)
        return value

    def settle(self) -> None:
        """Wait for two frames: what was asked for is then drawn."""
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    def picture(self, selector: str | None = None) -> bytes:
        """PNG of one element, or of the whole page."""
        if selector is None:
            size = self.call("Page.getLayoutMetrics")["cssContentSize"]
            box, beyond = [0, 0, size["width"], size["height"]], True
        else:
            # A picture of what is in view alone needs no new layout of the page.
            *box, beyond = self.value(
                f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
                " const beyond = b.x < 0 || b.y < 0 || b.right > innerWidth || b.bottom > innerHeight;"
                " return [b.x + scrollX, b.y + scrollY, b.width, b.height, beyond]; })()"
            )
        clip = {"x": box[0], "y": box[1], "width": box[2], "height": box[3], "scale": 1}
        answer = self.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=beyond)
        return base64.b64decode(answer["data"])

    def printed(self) -> bytes:
        """The page as a PDF."""
        answer = self.call("Page.printToPDF", printBackground=False, preferCSSPageSize=True)
        return base64.b64decode(answer["data"])

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """Send a mouse event."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def key(self, key: str) -> None:
        """Press and let go of a key."""
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 and kind == "keyDown" else ""
            )
