"""Pictures a second of a viewer page in a browser: python tests/results/views/frame_rate.py PAGE.html [SECONDS]

The browser draws with the processor (SwiftShader), so this is a lower limit: a graphics card is much faster. The time
of a picture includes sorting, drawing, and waiting until the last pixel is there. The page is served to the browser
on this machine alone, because a page without a server cannot hand a time back.
"""

import contextlib
import json
import statistics
import subprocess
import sys
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from browser import FLAGS, found_browser

LONGEST = 170.0  # seconds until a browser without an answer is ended
WRAPPER = """<!doctype html><iframe id="page" src="/page.html#t=0.4&probe" width="1200" height="900"></iframe>
<img src="/wait"><script>
const watch = setInterval(() => {
  const probe = document.getElementById("page").contentDocument.getElementById("probe");
  if (!probe) return;
  clearInterval(watch);
  const {milliseconds, errors} = JSON.parse(probe.textContent);
  fetch("/done", {method: "POST", body: JSON.stringify({milliseconds, errors})});
}, 200);
</script>"""


def milliseconds_a_picture(page: Path, longest: float = LONGEST) -> float:
    """Median over twenty pictures, in the browser. Raises: RuntimeError without a browser or an answer."""
    program = found_browser()
    if program is None:
        raise RuntimeError("no browser found")
    answers, done = [], threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/wait":  # the browser ends when everything is loaded: not before the answer
                done.wait(longest)
            known = {"/": WRAPPER.encode(), "/page.html": page.read_bytes()}
            with contextlib.suppress(BrokenPipeError):  # the browser has ended
                self.send_response(200 if self.path in known else 404)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.end_headers()
                self.wfile.write(known.get(self.path, b""))

        def do_POST(self) -> None:
            answers.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()
            done.set()

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server, tempfile.TemporaryDirectory() as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        words = [program, *FLAGS, f"--user-data-dir={profile}", "--dump-dom", f"http://127.0.0.1:{server.server_port}/"]
        with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
            done.wait(longest)
            try:
                running.wait(20)
            except subprocess.TimeoutExpired:
                running.kill()
        server.shutdown()
    if not answers or answers[0]["errors"]:
        raise RuntimeError(f"the page gave no picture: {answers or 'no answer'}")
    return statistics.median(answers[0]["milliseconds"])


def main(words: list[str]) -> int:
    """Print the figure."""
    taken = milliseconds_a_picture(Path(words[0]), float(words[1]) if len(words) > 1 else LONGEST)
    print(f"{taken:.1f} ms a picture, {1000 / taken:.0f} pictures a second, drawn by the processor")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
