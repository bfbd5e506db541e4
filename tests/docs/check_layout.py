"""Lay pages out in a headless browser at three widths: no page is wider than its window, and no table than its box.

Run after the build: python tests/docs/check_layout.py docs/_build/html [PAGE ...]
At 1400 and 1000 px every column of every table, every formula and every picture of a chapter is visible. On a
telephone (390 px) a table of many columns, a formula and a picture may scroll inside their boxes. At every width no
line of code and no output of a chapter is cut, a page shows at most one search box, and no word is broken over two
lines. In the pages that commands write no text is cut at the edge of its box. Without a browser the check says
so and ends with exit code 0.
"""

import json
import sys
from pathlib import Path
from typing import Any

from page_visits import found_browser, pages_of, visits

STATIC_STYLE = Path(__file__).parents[2] / "docs" / "_static" / "endotsr.css"
WIDTHS = (1400, 1000, 390)  # px
ALL_COLUMNS_FROM = 800  # px: from this width on, a table shows all of its columns
SCRIPT = """
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
    const whole = width >= ALL_COLUMNS_FROM || box(table).matches(".few, .listed");
    if (shown(table) && whole && by > 1) say("table", name(table), by);
  }
  for (const word of brokenWords(root.querySelector("article.bd-article") || root)) say("word", word, 0);
  if (!root.querySelector("article.bd-article")) cutText(root, say, shown);  // the theme cuts within formulas
  for (const block of root.querySelectorAll("article:has(div.cell) pre")) {  // code and outputs of the chapters
    for (const e of [block, box(block)].filter(shown)) {
      const by = e.scrollWidth - e.clientWidth;
      if (by > 1 && e !== root) { say("output", block.textContent.trim().slice(0, 40), by); break; }
    }
  }
  for (const picture of root.querySelectorAll("article.bd-article div.cell_output img")) {
    const by = picture.getBoundingClientRect().right - box(picture).getBoundingClientRect().right;
    if (width >= ALL_COLUMNS_FROM && shown(picture) && by > 1) say("picture", picture.alt || "a figure", by);
  }
  for (const formula of root.querySelectorAll("article.bd-article mjx-container[display]")) {
    const drawn = formula.firstElementChild, edge = box(formula).getBoundingClientRect().right;
    const by = drawn ? drawn.getBoundingClientRect().right - edge : 0;
    if (width >= ALL_COLUMNS_FROM && shown(formula) && by > 1) say("formula", heading(formula), by);
  }
  const boxes = [...frame.contentDocument.querySelectorAll("input[type=search], .search-button-field")].filter(shown);
  if (boxes.length > 1) say("search", boxes.length + " search boxes", 0);
}
function heading(e) {  // of the section of an element
  const section = e.closest("section"), title = section && section.querySelector("h1, h2, h3, h4");
  return title ? title.textContent.trim().slice(0, 40) : "";
}
function cutText(root, say, shown) {
  for (const e of root.querySelectorAll("*")) {
    const flow = frame.contentWindow.getComputedStyle(e).overflowX, hides = ["hidden", "clip"].includes(flow);
    const by = e.scrollWidth - e.clientWidth;
    if (hides && by > 1 && shown(e) && e.textContent.trim()) say("cut", e.textContent.trim().slice(0, 40), by);
  }
}
function brokenWords(root) {  // words and numbers on two lines; names and signatures may break
  const page = frame.contentDocument, walker = page.createTreeWalker(root, 4), range = page.createRange();
  const broken = new Set(), apart = "script,style,code,pre,svg,mjx-container,dt.sig";
  const words = /(?<![^\\s(\u201c"])(?:\\p{L}{2,}|[\u2212-]?\\d[\\d.]+)(?![^\\s.,;:)!?\u201d"])/gu;
  for (let node; (node = walker.nextNode());) {
    if (!node.parentElement.checkVisibility() || node.parentElement.closest(apart)) continue;
    for (const word of node.data.matchAll(words)) {
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      const tops = [...range.getClientRects()].map((r) => r.top);
      if (tops.length > 1 && Math.max(...tops) - Math.min(...tops) > 4) broken.add(word[0]);
    }
  }
  return broken;
}
function widest(root, width) {
  const wide = [...root.querySelectorAll("article *, main > *")].filter((e) =>
    e.getBoundingClientRect().right > width + 1 && box(e) === root);
  const inner = wide.find((e) => ![...e.children].some((child) => wide.includes(child)));
  return inner ? inner.tagName.toLowerCase() + " " + inner.textContent.trim().slice(0, 40) : "";
}
async function visit(page) {
  for (const width of WIDTHS) {
    frame.style.width = width + "px";
    await open(page);
    await pause(50);
    for (const folded of frame.contentDocument.querySelectorAll("details")) folded.open = true;
    measure(page, width);
  }
}
"""


def layout_problems(root: Path, pages: list[str]) -> list[dict[str, Any]]:
    """Problems of the pages below `root`: page, width, kind (page, table, search, error), what, by how many pixels.

    Raises: RuntimeError without a browser or an answer.
    """
    script = SCRIPT.replace("WIDTHS", json.dumps(WIDTHS)).replace("ALL_COLUMNS_FROM", str(ALL_COLUMNS_FROM))
    return visits(root, pages, script).found


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
