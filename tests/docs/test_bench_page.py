"""docs/bench.md: its generated parts are what the committed results say."""

import json

import pytest
from pages.bench import page as bench
from pages.bench import start as bench_start
from pages.bench.parts import MAIN, targets
from pages.store.marks import write_marked

from endotsr.errors import InputError


@pytest.fixture
def found():
    return bench.read()


def test_pictures_are_drawn_beside_their_measurements(found, tmp_path):
    for name, measured in found.items():
        (tmp_path / bench.READ[name]).write_text(json.dumps(measured), encoding="utf-8")
    bench.draw(tmp_path)
    assert {path.name for path in tmp_path.glob("*.png")} == {"bench_stages.png", "scaling.png"}


def test_target_that_is_missed_says_so(found):
    slow = dict.fromkeys(bench_start.MOMENTS, 99.0)
    text = bench.fragments(found | {"start": found["start"] | {"cold": slow}}, {})["targets"]
    line = next(line for line in text.splitlines() if "cold start" in line)
    assert "99 s" in line and "**not met**" in line
    assert "not measured" in next(line for line in text.splitlines() if "6000" in line)


def test_every_whole_run_with_two_threads_stands_among_the_targets(found):
    """Not the fastest alone: a machine on which the target is missed says so."""
    run = {"threads": 2, "seconds": 636.0, "machine": {"processor": "slow"}}
    runs = {
        "pulling_paper_seed0": run,
        "pulling_paper_seed1": run | {"seconds": 401.0, "machine": {"processor": "fast"}},
        "pulling_paper_seed2": run | {"threads": 1},
        "pulling_sharp_seed0": run,
    }
    made = targets(found["stages"], found["scaling"], found["peers"], found["start"], runs)
    lines = [line for line in made.splitlines() if "6000 iterations" in line]
    assert lines == [
        "| run of 6000 iterations, `pulling_paper_seed0.json`, slow | 10.6 min | at most 10 min | **not met** |",
        "| run of 6000 iterations, `pulling_paper_seed1.json`, fast | 6.68 min | at most 10 min | met |",
    ]


def test_every_table_of_times_names_its_machine_and_day(found):
    made = bench.fragments(found, {})
    for name in ("cases", "scaling", "start", "machine", "peers"):
        assert "AMD EPYC" in made[name] and "2026-11-25" in made[name], name


def test_a_mark_without_a_meaning_and_a_missing_result_are_named(found, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("<!-- bench:colour:start -->\n<!-- bench:colour:end -->")
    with pytest.raises(InputError, match=r"page\.md: mark bench:colour has no end or no meaning; use one of machine,"):
        write_marked(page, bench.fragments(found, {}), "bench")
    with pytest.raises(InputError, match=r"bench_stages\.json: cannot be read.*make\.py bench measure"):
        bench.read(tmp_path)


def test_a_part_is_replaced_and_the_words_around_it_stay(found, tmp_path):
    page, warm = tmp_path / "page.md", dict.fromkeys(bench_start.MOMENTS, 123.4)
    page.write_text("before <!-- bench:start:start -->\nto be replaced\n<!-- bench:start:end --> after")
    made = bench.fragments(found | {"start": found["start"] | {"warm": warm}}, {})
    write_marked(page, made, "bench")
    once = page.read_text(encoding="utf-8")
    assert once.startswith("before ") and once.endswith(" after") and "123.4" in once and "to be replaced" not in once
    write_marked(page, made, "bench")
    assert page.read_text(encoding="utf-8") == once


def test_page_refuses_results_of_other_sizes(found):
    cases = [case for case in found["stages"]["cases"] if any(case["case"][k] != v for k, v in MAIN.items())]
    with pytest.raises(InputError, match="no case with"):
        bench.fragments(found | {"stages": found["stages"] | {"cases": cases}}, {})


def test_what_the_page_says_of_float64_by_stage(found):
    """The forward blend takes twice the time, binning less than the blends; the largest ratios are of two others."""
    times = {
        (case["case"]["gaussians"], case["case"]["threads"], case["case"]["precision"]): case["stages"]
        for case in found["stages"]["cases"]
        if case["case"]["scene"] is None
    }
    largest = {}
    for gaussians, threads, precision in times:
        if precision == "float64":
            pair = [times[gaussians, threads, p] for p in ("float32", "float64")]
            ratio = {stage: pair[1][stage]["median_ms"] / pair[0][stage]["median_ms"] for stage in pair[0]}
            assert 1.9 < ratio["blend forward"] < 2.1
            assert ratio["binning"] < min(ratio["blend forward"], ratio["blend reverse"])
            assert (ratio["Adam"] < ratio["blend forward"]) if threads == 1 else True
            largest = {stage: max(value, largest.get(stage, 0)) for stage, value in ratio.items()}
    assert set(sorted(largest, key=lambda stage: largest[stage])[-2:]) == {"Fourier", "Adam"}
