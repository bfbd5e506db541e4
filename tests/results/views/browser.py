"""A headless browser that opens the viewer page and hands back what it drew."""

import base64
import html
import io
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
ATTEMPTS = 3  # on a loaded machine the browser can hand back the document before the picture is drawn
VIRTUAL_MILLISECONDS = 30000  # of the page's own clock; the browser ends as soon as nothing is left to do


def found_browser() -> str | None:
    """The program, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def browser() -> str:
    """The program, or the test is skipped."""
    found = found_browser()
    if found is None:
        pytest.skip(f"no browser found: {', '.join(NAMES)}")
    return found


def dom(page: Path, moment: str, *more: str) -> str:
    """The document after the page has drawn; `more` are further flags."""
    words = [browser(), *FLAGS, *more, f"--user-data-dir={page.parent / 'profile'}"]
    words += [f"--virtual-time-budget={VIRTUAL_MILLISECONDS}", "--dump-dom", f"{page.as_uri()}#{moment}"]
    return subprocess.run(words, capture_output=True, text=True, timeout=200).stdout


def seen(page: Path, *more: str) -> dict[str, Any]:
    """What a page wrote as JSON into its element `probe`."""
    content = dom(page, "", *more)
    found = re.search(r'<pre id="probe"[^>]*>(.+?)</pre>', content, re.S)
    assert found, content[-2000:]
    return json.loads(html.unescape(found[1]))


def drawn(page: Path, moment: str) -> np.ndarray:
    """The picture of the page at `t=0.4&layer=depth`, (H, W, 3) uint8."""
    for _ in range(ATTEMPTS):
        content = dom(page, f"{moment}&probe")
        found = re.search(r'<pre id="probe"[^>]*>(.*?)</pre>', content, re.S)
        if found:
            break
    assert found, content[-2000:] if "WebGL" not in content else re.findall(r'id="failure"[^>]*>([^<]*)', content)
    probe = json.loads(html.unescape(found[1]))
    assert probe["errors"] == 0, "an error of WebGL"
    picture = Image.open(io.BytesIO(base64.b64decode(probe["picture"].split(",")[1])))
    return np.asarray(picture.convert("RGB"))
