"""Check the built book offline: every internal link and anchor exists, and no TeX stands outside mathematics.

Run after the build: python tests/docs/check_html.py docs/_build/html
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TEX = re.compile(r"\\(?:frac|sum|mathcal|begin|omega|tilde|bigl|qquad)(?![a-z])|\{(?:eq|doc|ref|py:\w+)\}`")
UNCHECKED = {"script", "style", "pre", "code"}


class Page(HTMLParser):
    """Anchors, links and stray markup of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.stray: list[str] = []
        self._quiet: list[str] = []  # open elements whose text is no prose
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {key: value or "" for key, value in attrs}
        self.anchors |= {values[key] for key in ("id", "name") if key in values}
        self.links += [values[key] for key in ("href", "src") if key in values]
        math = "math" in values.get("class", "").split()
        if self._quiet and tag == self._quiet[0]:
            self._quiet.append(tag)
        elif not self._quiet and (tag in UNCHECKED or math):
            self._quiet = [tag]

    def handle_endtag(self, tag: str) -> None:
        if self._quiet and tag == self._quiet[0]:
            self._quiet.pop()

    def handle_data(self, data: str) -> None:
        if not self._quiet and TEX.search(data):
            self.stray.append(data.strip()[:80])


def problems(root: Path) -> list[str]:
    """One sentence for each link that leads nowhere inside the book, each remote script, and each stray command."""
    pages = {
        file: Page(file.read_text(encoding="utf-8"))
        for file in sorted(root.rglob("*.html"))
        if "_static" not in file.parts
    }
    found = []
    for file, page in pages.items():
        name = file.relative_to(root)
        found += [f"{name}: raw markup {text!r}" for text in page.stray]
        for link in page.links:
            reason = broken(link, file, pages)
            if reason:
                found.append(f"{name}: {link}: {reason}")
    return found


def broken(link: str, file: Path, pages: dict[Path, Page]) -> str:
    """Why a link is bad, or nothing. Links to other sites are left alone; files that a page loads must be here."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return "loaded from the network" if parts.path.endswith((".js", ".css")) else ""
    target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
    if not target.exists():
        return "no such file"
    anchor = unquote(parts.fragment)
    if anchor and target in pages and anchor not in pages[target].anchors:
        return "no such anchor"
    return ""


def main(folder: str) -> int:
    root = Path(folder).resolve()
    if not (root / "index.html").is_file():
        print(f"{folder}: no book here; build it first")
        return 2
    found = problems(root)
    print("\n".join(found) or f"{len(list(root.rglob('*.html')))} pages, all links lead somewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
