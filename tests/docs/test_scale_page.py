"""The estimates of minutes and memory on the page of times are those of the package."""

from pages.bench import scale
from pages.store.commands import loaded
from pages.store.program import RESULTS


def test_the_estimates_are_near_the_timed_trainings():
    """The ratio of estimate to time belongs to the machine and is nearly equal for all presets."""
    rows = loaded(RESULTS / "minutes.json")["rows"]
    ratios = {}
    for preset in scale.COLOURS:
        iterations, cost = scale.estimated(preset, 63, 640, 512)
        run = rows[preset][-1]
        assert iterations == run["iterations"]
        assert abs(cost.gaussians - run["gaussians"]) < 0.05 * run["gaussians"], preset
        ratios[preset] = 60 * cost.minutes / run["seconds"]
    assert max(ratios.values()) < 1.25 * min(ratios.values()), ratios
