"""A headless browser that is driven as a person drives it: real presses, drags and keys, and pictures of the window.

The browser reads commands of the DevTools protocol from a pipe, file descriptor 3, and answers on 4: JSON that ends
with a zero byte. No port is opened.
"""

import base64
import itertools
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Any

from browser import FLAGS, browser

SECONDS = 200  # to wait for an answer on a loaded machine
MODIFIERS = {"shift": 8, "control": 2}


class Remote:
    """A browser with one page, `open`. Use it as a context manager."""

    def __init__(self, profile: Path) -> None:
        to_browser, from_test = os.pipe()
        to_test, from_browser = os.pipe()
        words = [
            browser(), *FLAGS, "--remote-debugging-pipe", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip

        def connect() -> None:
            os.dup2(to_browser, 13)
            os.dup2(from_browser, 14)
            os.dup2(13, 3)
            os.dup2(14, 4)

        self._process = subprocess.Popen(
            words, preexec_fn=connect, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_browser)
        os.close(from_browser)
        self._in, self._out, self._rest, self._id, self._session = from_test, to_test, b"", 0, ""
        self._target = ""

    def open(self, page: Path, downloads: Path, width: int = 1400, height: int = 900, images: int = 1) -> "Remote":
        """Show a page with so many images instead of the one before, which is not asked whether it may be closed."""
        old, self._session = self._target, ""
        self._target = self._send("Target.createTarget", url="about:blank")["targetId"]
        if old:
            self._send("Target.closeTarget", targetId=old)
        self._session = self._send("Target.attachToTarget", targetId=self._target, flatten=True)["sessionId"]
        self._send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
        self.size(width, height)
        self._send("Page.navigate", url=page.as_uri())
        self.until(f"document.readyState === 'complete' && document.images.length >= {images}")
        return self

    @property
    def process(self) -> int:
        """The number of the process of the browser."""
        return self._process.pid

    def __enter__(self) -> "Remote":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def _send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a command; events in between are dropped."""
        self._id += 1
        message: dict[str, Any] = {"id": self._id, "method": method, "params": parameters}
        if self._session and not method.startswith(("Target.", "Browser.")):
            message["sessionId"] = self._session
        os.write(self._in, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            if b"\0" not in self._rest:
                assert select.select([self._out], [], [], SECONDS)[0], f"no answer to {method}"
                self._rest += os.read(self._out, 1 << 20)
                continue
            line, _, self._rest = self._rest.partition(b"\0")
            answer = json.loads(line)
            if answer.get("id") == self._id:
                assert "error" not in answer, (method, answer)
                return answer["result"]
        raise TimeoutError(method)

    def size(self, width: int, height: int) -> None:
        """The size of the window, px."""
        self._send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def value(self, code: str) -> Any:
        """The value of an expression in the page."""
        found = self._send("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def until(self, code: str) -> None:
        """Wait until an expression holds."""
        end = time.monotonic() + SECONDS
        while not self.value(code):
            assert time.monotonic() < end, code
            time.sleep(0.05)

    def mouse(
        self, kind: str, x: float, y: float, button: str = "left", pointer: str = "mouse", count: int = 1
    ) -> None:
        """One event of mouse or pen: `Pressed`, `Moved` or `Released`, at a position in the window."""
        held = {"left": 1, "right": 2, "middle": 4}[button] if kind != "Released" else 0
        self._send(
            "Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, button=button, buttons=held,
            clickCount=count, pointerType=pointer,
        )  # fmt: skip

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """One event of all fingers that touch the window: `touchStart`, `touchMove` or `touchEnd`."""
        fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        self._send("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    def click(self, x: float, y: float) -> None:
        """Press and release."""
        self.mouse("Pressed", x, y)
        self.mouse("Released", x, y)

    def drag(self, points: list[tuple[float, float]], **how: Any) -> None:
        """Press at the first point, move over the others in small steps, release at the last one."""
        self.mouse("Pressed", *points[0], **how)
        for (x0, y0), (x1, y1) in itertools.pairwise(points):
            for k in range(1, 9):
                self.mouse("Moved", x0 + (x1 - x0) * k / 8, y0 + (y1 - y0) * k / 8, **how)
        self.mouse("Released", *points[-1], **how)

    def key(self, key: str, times: int = 1, held: str = "") -> None:
        """Press a key, `a`, `ArrowLeft`, ` `, some times."""
        text = {"text": key} if len(key) == 1 and not held else {}
        for _ in range(times):
            for kind in ("keyDown", "keyUp"):
                more = text if kind == "keyDown" else {}
                self._send("Input.dispatchKeyEvent", type=kind, key=key, modifiers=MODIFIERS.get(held, 0), **more)

    def picture(self, file: Path) -> None:
        """Save the whole page as PNG, without a scroll bar, which would cut the right side off."""
        self._send("Emulation.setScrollbarsHidden", hidden=True)
        shot = self._send("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        file.write_bytes(base64.b64decode(shot))
