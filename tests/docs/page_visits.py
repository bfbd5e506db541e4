"""Visits the pages of a book in a headless browser, one after another, and hands back what a script says of each.

In: the folder of the book, the pages, and a script that defines `async function visit(page)`. It opens the page with
`open(page)`, reads `frame.contentDocument`, and calls `found.push(...)` for what it has to say. The book is served from
a port of this machine; nothing else is reached.
"""

import functools
import json
import subprocess
import sys
import tempfile
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "results" / "views"))
from browser import FLAGS, found_browser

LEFT_OUT = ("_static", "_modules", "_sources")  # folders of a book that hold no pages of its own
SECONDS_A_PAGE = 20.0
DRIVER = """<!doctype html><body><img src="/wait"><script>
const found = [], frame = document.createElement("iframe");
frame.style = "border:0;height:900px";
document.body.append(frame);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const open = (page) => new Promise((done) => { frame.onload = done; frame.src = "/pages/" + page; });
SCRIPT
(async () => {
  for (const page of PAGES) await visit(page);
  fetch("/done", {method: "POST", body: JSON.stringify(found)});
})().catch((error) => fetch("/done", {method: "POST", body: JSON.stringify([{kind: "error", what: String(error)}])}));
</script></body>"""


class Visits(NamedTuple):
    """What the script found, and the addresses below the folder that the pages asked for in vain."""

    found: list[dict[str, Any]]
    missing: list[str]


def visits(root: Path, pages: list[str], script: str) -> Visits:
    """Visit the pages below `root`; an error of the script is found as kind "error".

    Raises: RuntimeError without a browser or an answer.
    """
    program = found_browser()
    if program is None:
        raise RuntimeError("no browser found")
    runner = DRIVER.replace("SCRIPT", script).replace("PAGES", json.dumps(pages))
    done, answers, missing = threading.Event(), [], []
    longest = 60 + SECONDS_A_PAGE * len(pages)

    class Handler(SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/wait":  # the browser ends when everything is loaded: not before the answer
                done.wait(longest)
            if self.path.startswith("/pages/"):
                self.path = self.path.removeprefix("/pages")
                return super().do_GET()
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(runner.encode() if self.path == "/" else b"")

        def do_POST(self) -> None:
            answers.extend(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()
            done.set()

        def send_error(self, code: int, *words: Any) -> None:
            missing.append(self.path)
            super().send_error(code, *words)

        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Handler, directory=str(root))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, tempfile.TemporaryDirectory() as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        words = [program, *FLAGS, f"--user-data-dir={profile}", "--window-size=1500,1000", "--dump-dom"]
        with subprocess.Popen(
            [*words, f"http://127.0.0.1:{server.server_port}/"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as running:
            answered = done.wait(longest)
            try:
                running.wait(20)
            except subprocess.TimeoutExpired:
                running.kill()
        server.shutdown()
    if not answered:
        raise RuntimeError(f"no answer of the browser within {longest:.0f} s")
    return Visits(answers, missing)


def pages_of(root: Path) -> list[str]:
    """The pages of a book, relative to its folder."""
    files = (file.relative_to(root) for file in sorted(root.rglob("*.html")))
    return [file.as_posix() for file in files if not set(file.parts) & set(LEFT_OUT)]
