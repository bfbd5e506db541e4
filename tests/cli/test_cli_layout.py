"""Every kind of page that a command writes, laid out in a browser at three widths."""

import sys
from pathlib import Path

import pytest
from tiny import written_folder

from endotsr.cli.main import main

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))
from check_layout import found_browser, layout_problems  # noqa: E402

pytestmark = pytest.mark.skipif(found_browser() is None, reason="no browser found")
PAGE = '<!doctype html><meta name="viewport" content="width=device-width"><body style="margin:0">{}</body>'
ROW = "<tr>" + "<td>a long heading</td>" * 20 + "</tr>"
WIDE = f'<div style="overflow-x:auto"><table style="white-space:nowrap">{ROW}</table></div>'
FAULTS = {
    "wide.html": '<div style="width:1200px;height:9px"></div>',
    "table.html": WIDE,
    "search.html": '<input type="search"><button class="search-button-field">Search</button>',
    "folded.html": f"<details>{WIDE}</details>",
    "word.html": '<p style="width:2em;overflow-wrap:anywhere">a statistical word</p>',
    "cut.html": '<p style="width:4em;overflow:hidden;white-space:nowrap">a statistical word</p>',
    "book.html": '<article class="bd-article" style="width:2em;overflow-wrap:anywhere">a statistical word',
    "code.html": '<article class="bd-article" style="width:2em;overflow-wrap:anywhere"><code>statistical</code>',
    "good.html": '<input type="search"><input type="search" hidden><table><tr><td>1</td></tr></table>',
}


def test_faults_of_a_layout_are_found(tmp_path):
    for name, body in FAULTS.items():
        (tmp_path / name).write_text(PAGE.format(body), encoding="utf-8")
    found = {(p["page"], p["width"], p["kind"]) for p in layout_problems(tmp_path, [*FAULTS])}
    assert found == {
        ("wide.html", 1000, "page"), ("wide.html", 390, "page"),
        *((name, width, "table") for name in ("table.html", "folded.html") for width in (1400, 1000)),
        *((f"{kind}.html", width, kind) for kind in ("word", "cut") for width in (1400, 1000, 390)),
        *(("book.html", width, "word") for width in (1400, 1000, 390)),
        *(("search.html", width, "search") for width in (1400, 1000, 390)),
    }  # fmt: skip


def test_pages_of_commands_fit_their_window(finished_run, tmp_path):
    folder = written_folder(tmp_path)
    main(["check", str(folder), "--html", str(tmp_path / "check.html")])
    assert main(["inspect", str(folder), "--out", str(tmp_path / "inspect.html")]) == 0
    (tmp_path / "outputs").mkdir()
    assert main(["golden", "judge", str(tmp_path / "outputs"), "--html", str(tmp_path / "golden.html")]) == 1
    pages = ["check.html", "inspect.html", "golden.html"]
    for name in ("report.html", "view.html"):
        (tmp_path / name).write_bytes((finished_run / name).read_bytes())
    found = layout_problems(tmp_path, [*pages, "report.html", "view.html"])
    assert not found, "\n".join(map(str, found))
