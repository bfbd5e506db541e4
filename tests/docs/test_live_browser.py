"""A chapter runs in its page, opened from a folder: a wrong formula fails the gradient check, and Undo mends it.

ENDOTSR_PYODIDE names a folder filled by `python docs/make.py live.fetch FOLDER`. Without it, the tests that need Python
in the browser are skipped; that the button says why nothing runs is tested always.
"""

import base64
import functools
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "results" / "views"))
from browser import browser
from remote import Remote

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]  # a browser that starts Python
ROOT = Path(__file__).parents[2]
CHAPTER = "02_colour_residual"
FORMULA, OLD, NEW = "appearance_reverse", "beta / Y00 *", "beta *"
STATUS = "document.querySelector('.live-bar [role=status]').textContent"
EDITOR = f"document.querySelector('textarea[aria-label=\"formula {FORMULA}\"]')"
ROW = f"{EDITOR}.parentNode.querySelector('.live-row span').textContent"
SECONDS = 500


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """A page of the book without its recorded outputs."""
    browser()
    out = tmp_path_factory.mktemp("book")
    words = [sys.executable, "docs/make.py", "book.preview", f"notebooks/{CHAPTER}.py", str(out)]
    environment = os.environ | {"ENDOTSR_DOCS_EXECUTE": "0"}
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert not done.returncode, done.stderr
    shutil.rmtree(out / "_static" / "pyodide", ignore_errors=True)
    return out


@pytest.fixture(scope="module")
def filled():
    """A folder with Pyodide."""
    if not (folder := os.environ.get("ENDOTSR_PYODIDE")):
        pytest.skip("ENDOTSR_PYODIDE names no folder filled by `python docs/make.py live.fetch FOLDER`")
    assert (Path(folder) / "filled.js").is_file(), f"{folder} is not filled"
    return Path(folder)


@pytest.fixture
def page(book, tmp_path):
    """A browser, and a function that opens the chapter; `host` replaces the host of Pyodide."""
    package = book / "_static" / "live" / "package.js"
    text = package.read_text(encoding="utf-8")
    with Remote(tmp_path / "profile") as remote:

        def opened(host="http://127.0.0.1:9/"):
            package.write_text(re.sub(r'"host": "[^"]*"', f'"host": "{host}"', text), encoding="utf-8")
            file = book / "notebooks" / f"{CHAPTER}.html"
            remote.open(file, tmp_path, images=0)
            return remote

        yield opened
    package.write_text(text, encoding="utf-8")


def until(remote, code):
    """Wait for a condition of the page; Python starts slowly on a loaded machine."""
    end = time.monotonic() + SECONDS
    while not remote.value(code):
        assert time.monotonic() < end, remote.value(STATUS)
        time.sleep(0.2)


def requests(remote):
    """Everything that the page has read."""
    return remote.value("performance.getEntriesByType('resource').map((entry) => entry.name)")


def press_button(remote):
    remote.value("document.querySelector('.live-bar button').click()")


def edit(remote, old, new):
    """Change a text of the formula and press Shift+Enter in it."""
    remote.value(f"{EDITOR}.value = {EDITOR}.value.replace({json.dumps(old)}, {json.dumps(new)})")
    remote.value(f"{EDITOR}.dispatchEvent(new Event('input'))")
    remote.value(f"{EDITOR}.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Enter', shiftKey: true}}))")


def test_nothing_is_read_before_the_press_and_the_button_says_why_it_cannot_run(page):
    remote = page()
    time.sleep(1)
    assert remote.value("endotsrLive.supply === undefined && endotsrLive.worker === undefined"), "read before the press"
    press_button(remote)
    until(remote, f"{STATUS}.includes('does not run')")
    assert "_static/pyodide of this book is not filled" in remote.value(STATUS)
    assert remote.value("document.querySelectorAll('textarea, .live-pane').length") == 0, "the page is as before"
    assert remote.value("document.querySelector('.live-bar button').disabled") is False


def test_a_wrong_formula_fails_the_gradient_check_and_undo_mends_it(page, book, filled):
    shutil.copytree(filled, book / "_static" / "pyodide")
    remote = page()
    press_button(remote)
    until(remote, f"/cells ran|does not run/.test({STATUS})")
    assert re.fullmatch(r"\d+ cells ran: passed", remote.value(STATUS))
    edit(remote, OLD, NEW)
    until(remote, f"/gradient check/.test({ROW})")
    assert "failed" in remote.value(ROW)
    shown = remote.value("document.querySelector('.live-failed .live-output').textContent")
    assert "AssertionError" in shown and "assert report.passed" in shown and "FAILED" in shown
    remote.value(f"{EDITOR}.parentNode.querySelectorAll('button')[1].click()")
    until(remote, f"/gradient check: passed/.test({ROW})")
    assert remote.value(f"{EDITOR}.value.includes({json.dumps(OLD)})")
    assert remote.value("document.querySelectorAll('.live-failed').length") == 0
    assert remote.value("document.querySelectorAll('.live-output img').length") >= 1
    # Files are not listed; the addresses of a host are, as the test below sees.
    assert {name.split(":")[0] for name in requests(remote)} <= {"file", "data", "blob"}, "no request leaves the host"
    for width in (1400, 390):
        remote.size(width, 900)
        assert remote.value("document.documentElement.scrollWidth") <= width


def test_stop_ends_an_endless_cell_and_the_next_run_starts_again(page, book, filled):
    shutil.copytree(filled, book / "_static" / "pyodide", dirs_exist_ok=True)
    remote = page()
    press_button(remote)
    until(remote, f"/cells ran|does not run/.test({STATUS})")
    cell = "document.querySelector('textarea[aria-label=\"cell 2\"]')"
    word, button = (f"{cell}.parentNode.querySelector('{name}')" for name in (".live-row span", "button"))
    remote.value(f"{cell}.value = 'while True: pass'")
    remote.value(f"{cell}.dispatchEvent(new Event('input'))")
    remote.value(f"{button}.click()")
    until(remote, f"{word}.textContent.startsWith('cell 2')")
    assert remote.value(f"{button}.textContent") == "Stop"
    remote.value(f"{button}.click()")
    until(remote, f"{word}.textContent === 'stopped' && {button}.textContent === 'Run'")
    assert "starts Python again" in remote.value(STATUS)
    remote.value(f"{cell}.parentNode.querySelectorAll('button')[1].click()")
    until(remote, f"/^2 cells ran/.test({STATUS})")
    assert remote.value(f"{word}.textContent") == "passed"


class Host(SimpleHTTPRequestHandler):
    """The files of Pyodide, for pages of any origin."""

    def end_headers(self) -> None:
        self.send_header("Access-Control-Allow-Origin", "*")
        super().end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def host(filled, tmp_path):
    """The address of a host with the files, and its folder."""
    folder = tmp_path / "published"
    folder.mkdir()
    for script in filled.glob("*.*.js"):
        content = re.fullmatch(r'endotsrLive\.keep\("(.+?)", "(.*)"\);\n', script.read_text())
        assert content
        (folder / content[1]).write_bytes(base64.b64decode(content[2]))
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Host, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/", folder
        server.shutdown()


def test_a_chapter_runs_from_the_host_of_pyodide_and_another_file_is_refused(page, book, host):
    address, folder = host
    shutil.rmtree(book / "_static" / "pyodide", ignore_errors=True)
    wheel = next(folder.glob("numpy-*.whl"))
    content = wheel.read_bytes()
    wheel.write_bytes(content[:-1] + b"?")
    remote = page(address)
    press_button(remote)
    until(remote, f"/cells ran|does not run/.test({STATUS})")
    assert f"{wheel.name} cannot be read or has another SHA-256" in remote.value(STATUS)
    wheel.write_bytes(content)
    press_button(remote)
    until(remote, f"/cells ran/.test({STATUS})")
    assert any(name.startswith(address) for name in requests(remote))
    assert re.fullmatch(r"\d+ cells ran: passed", remote.value(STATUS))
