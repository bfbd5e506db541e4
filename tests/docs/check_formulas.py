"""Typeset the formulas of every page in a headless browser: none is left as TeX, and none has an error.

Run after the build: python tests/docs/check_formulas.py docs/_build/html [PAGE ...]
A formula is unrendered if MathJax put nothing in its place, shows an error or an unknown command, or left TeX behind.
A file of MathJax that is not there is a problem of the book. Without a browser the check says so and ends with exit
code 0.
"""

import sys
from pathlib import Path
from typing import Any, NamedTuple

from page_visits import found_browser, pages_of, visits

SCRIPT = r"""
const SECONDS = 60;
async function typeset(MathJax) {
  if (!MathJax || !MathJax.startup || !MathJax.startup.promise) return "MathJax did not start";
  const late = pause(1000 * SECONDS).then(() => "MathJax did not end within " + SECONDS + " s");
  return Promise.race([MathJax.startup.promise.then(() => ""), late]).catch((error) => "MathJax: " + error);
}
// Unknown commands are no errors of MathJax: it shows their names, in red.
const unknown = (formula) => [...formula.querySelectorAll("mtext[mathcolor=red]")].map((e) => e.textContent)[0];
function fault(formula) {
  const error = formula.querySelector("mjx-merror, merror, [data-mjx-error]");
  if (error) return error.getAttribute("data-mjx-error") || "error of MathJax";
  if (unknown(formula)) return "unknown command " + unknown(formula);
  if (/\\[(\[]/.test(formula.textContent)) return "left as TeX";
  return formula.querySelector("mjx-container") ? "" : "not typeset";
}
function source(formula, MathJax) {
  const items = MathJax && MathJax.startup ? [...MathJax.startup.document.math] : [];
  const item = items.find((item) => item.typesetRoot && formula.contains(item.typesetRoot));
  return (item ? item.math : formula.textContent).trim().replace(/\s+/g, " ").slice(0, 80);
}
async function visit(page) {
  await open(page);
  const root = frame.contentDocument, MathJax = frame.contentWindow.MathJax;
  const all = [...root.querySelectorAll(".math")], failed = all.length ? await typeset(MathJax) : "";
  if (failed) found.push({page, kind: "page", what: failed});
  for (const formula of all) {
    const what = fault(formula);
    found.push({page, kind: what ? "unrendered" : "rendered", what, tex: what ? source(formula, MathJax) : ""});
  }
  for (const error of root.querySelectorAll("mjx-merror"))
    if (!error.closest(".math")) found.push({page, kind: "unrendered", what: "error outside a formula", tex: ""});
}
"""


class Formulas(NamedTuple):
    """What is wrong, and how many formulas there are."""

    problems: list[str]
    unrendered: int
    total: int


def formulas(root: Path, pages: list[str]) -> Formulas:
    """The formulas of the pages below `root`. Raises: RuntimeError without a browser or an answer."""
    found, missing = visits(root, pages, SCRIPT)
    problems = [f"{path}: no such file" for path in dict.fromkeys(missing) if "mathjax" in path.lower()]
    problems += [_line(entry) for entry in found if entry["kind"] != "rendered"]
    total = sum("tex" in entry for entry in found)
    return Formulas(problems, sum(entry["kind"] == "unrendered" for entry in found), total)


def _line(entry: dict[str, Any]) -> str:
    tex = f": {entry['tex']}" if entry.get("tex") else ""
    return f"{entry.get('page')}: {entry['what']}{tex}"


def main(words: list[str]) -> int:
    """Print every problem and the count; exit code 1 if there is a problem."""
    root = Path(words[0]).resolve()
    pages = words[1:] or pages_of(root)
    if found_browser() is None:
        print("formulas not checked: no browser found")
        return 0
    problems, unrendered, total = formulas(root, pages)
    print("\n".join([*problems, f"{unrendered} of {total} formulas unrendered on {len(pages)} pages"]))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
