"""docs/bench.md: its generated parts are what the committed results say."""

import json

import pytest
from pages.bench import page as bench
from pages.bench import start as bench_start
from pages.bench.parts import MAIN

from endotsr.errors import InputError


@pytest.fixture
def found():
    return bench.read(bench.RESULTS)


def test_command_fills_a_page_and_keeps_its_words(found, tmp_path):
    folder, page = tmp_path / "results", tmp_path / "page.md"
    folder.mkdir()
    changed = found | {"start": found["start"] | {"warm": dict.fromkeys(bench_start.MOMENTS, 123.4)}}
    for name, file in bench.FILES.items():
        (folder / file).write_text(json.dumps(changed[name]), encoding="utf-8")
    marked = "<!-- bench:start:start -->\nto be replaced\n<!-- bench:start:end -->"
    page.write_text(f"before {marked} after", encoding="utf-8")
    bench.main([str(folder)], page)
    once = page.read_text(encoding="utf-8")
    assert once.startswith("before ") and once.endswith(" after") and "123.4" in once and "to be replaced" not in once
    bench.main([str(folder)], page)
    assert page.read_text(encoding="utf-8") == once
    assert {path.name for path in folder.glob("*.png")} == {"bench_stages.png", "scaling.png"}


def test_target_that_is_missed_says_so(found):
    slow = dict.fromkeys(bench_start.MOMENTS, 99.0)
    text = bench.fragments(found | {"start": found["start"] | {"cold": slow}}, {})["targets"]
    line = next(line for line in text.splitlines() if "cold start" in line)
    assert "99 s" in line and "**not met**" in line
    assert "not measured" in next(line for line in text.splitlines() if "6000" in line)


def test_page_names_what_is_missing(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("<!-- bench:colour:start -->\n<!-- bench:colour:end -->")
    with pytest.raises(SystemExit, match=r"page\.md: mark bench:colour has no end or no meaning; allowed: machine,"):
        bench.main([], page)
    with pytest.raises(SystemExit, match=r"bench_stages\.json: cannot be read.*make\.py bench measure"):
        bench.main([str(tmp_path)], page)
    with pytest.raises(SystemExit, match=r"python docs/make\.py bench"):
        bench.main(["one", "two"], page)


def test_page_refuses_results_of_other_sizes(found):
    cases = [case for case in found["stages"]["cases"] if any(case["case"][k] != v for k, v in MAIN.items())]
    with pytest.raises(InputError, match="no case with"):
        bench.fragments(found | {"stages": found["stages"] | {"cases": cases}}, {})
