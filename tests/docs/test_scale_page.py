"""The estimates of minutes and memory on the page of times are those of the package."""

import json

import scale


def test_the_table_and_the_recorded_runs_are_those_of_the_page():
    page = scale.PAGE.read_text(encoding="utf-8")
    assert scale.parts()["minutes"] in page


def test_the_estimate_of_gaussians_is_near_the_recorded_runs():
    for preset, name in scale.RECORDS.items():
        run = json.loads((scale.DOCS / "results" / f"{name}.json").read_text(encoding="utf-8"))["run"]
        iterations, cost = scale.estimated(preset, 63, 640, 512)
        assert iterations == run["iterations_planned"]
        assert abs(cost.gaussians - run["gaussians"]) < 0.05 * run["gaussians"], preset
