"""Lay pages out in a headless browser at three widths: no page is wider than its window, and no table than its box.

Run after the build: python tests/docs/check_layout.py docs/_build/html [PAGE ...]
At 1400 and 1000 px every column of every table is visible. On a telephone (390 px) a wide table may scroll inside its
box. At every width a page shows at most one search box. Without a browser the check says so and ends with exit code 0.
"""

import functools
import json
import subprocess
import sys
import tempfile
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "views"))
from browser import FLAGS, found_browser

WIDTHS = (1400, 1000, 390)  # px
ALL_COLUMNS_FROM = 800  # px: from this width on, a table shows all of its columns
LEFT_OUT = ("_static", "_modules", "_sources")  # folders of a book that hold no pages of its own
SECONDS_A_PAGE = 20.0
RUNNER = """<!doctype html><body><img src="/wait"><script>
const pages = PAGES, widths = WIDTHS, found = [];
const frame = document.createElement("iframe");
frame.style = "border:0;height:900px";
document.body.append(frame);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const loaded = (url) => new Promise((done) => { frame.onload = done; frame.src = url; });
const name = (table) => (table.caption || table.rows[0] || table).textContent.trim().replace(/\\s+/g, " ").slice(0, 60);
function box(table) {
  for (let up = table.parentElement; up; up = up.parentElement)
    if (["auto", "scroll"].includes(frame.contentWindow.getComputedStyle(up).overflowX)) return up;
  return frame.contentDocument.documentElement;
}
function measure(page, width) {
  const root = frame.contentDocument.documentElement, shown = (e) => e.checkVisibility() && e.getClientRects().length;
  const say = (kind, what, by) => found.push({page, width, kind, what, by: Math.round(by)});
  if (root.scrollWidth > width + 1) say("page", widest(root, width), root.scrollWidth - width);
  for (const table of frame.contentDocument.querySelectorAll("table")) {
    const by = table.getBoundingClientRect().right - box(table).getBoundingClientRect().right;
    if (shown(table) && width >= ALL_COLUMNS_FROM && by > 1) say("table", name(table), by);
  }
  const boxes = [...frame.contentDocument.querySelectorAll("input[type=search], .search-button-field")].filter(shown);
  if (boxes.length > 1) say("search", boxes.length + " search boxes", 0);
}
function widest(root, width) {
  const wide = [...root.querySelectorAll("article *, main > *")].filter((e) =>
    e.getBoundingClientRect().right > width + 1 && box(e) === root);
  const inner = wide.find((e) => ![...e.children].some((child) => wide.includes(child)));
  return inner ? inner.tagName.toLowerCase() + " " + inner.textContent.trim().slice(0, 40) : "";
}
(async () => {
  for (const page of pages) for (const width of widths) {
    frame.style.width = width + "px";
    await loaded("/pages/" + page);
    await pause(50);
    for (const folded of frame.contentDocument.querySelectorAll("details")) folded.open = true;
    measure(page, width);
  }
  fetch("/done", {method: "POST", body: JSON.stringify(found)});
})().catch((error) => fetch("/done", {method: "POST", body: JSON.stringify([{kind: "error", what: String(error)}])}));
</script></body>"""


def layout_problems(root: Path, pages: list[str]) -> list[dict[str, Any]]:
    """Problems of the pages below `root`: page, width, kind (page, table, search, error), what, by how many pixels.

    Raises: RuntimeError without a browser or an answer.
    """
    program = found_browser()
    if program is None:
        raise RuntimeError("no browser found")
    runner = RUNNER.replace("PAGES", json.dumps(pages)).replace("WIDTHS", json.dumps(WIDTHS))
    runner = runner.replace("ALL_COLUMNS_FROM", str(ALL_COLUMNS_FROM))
    done, answers = threading.Event(), []
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
    return answers


def pages_of(root: Path) -> list[str]:
    """The pages of a book, relative to its folder."""
    files = (file.relative_to(root) for file in sorted(root.rglob("*.html")))
    return [file.as_posix() for file in files if not set(file.parts) & set(LEFT_OUT)]


def main(words: list[str]) -> int:
    """Print every problem; exit code 1 if there is one."""
    root = Path(words[0]).resolve()
    pages = words[1:] or pages_of(root)
    if found_browser() is None:
        print("layout not checked: no browser found")
        return 0
    found = layout_problems(root, pages)
    lines = [
        f"{p.get('page')} at {p.get('width')} px: {p['kind']}: {p['what']}, {p.get('by')} px too wide" for p in found
    ]
    print("\n".join(lines) or f"{len(pages)} pages at {len(WIDTHS)} widths, nothing too wide")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
