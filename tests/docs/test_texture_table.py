"""What README.md and docs/interpolation.md say of renders with recorded texture is what the records hold."""

import pytest
from pages.book.texture import difference, runs_of
from pages.store.intervals import interval

FLOWS = ("flow_interpolation", "flow_interpolation_tissue")
MEASURED = [("pulling", "quick"), ("pulling", "sharp"), ("cutting", "quick")]


@pytest.mark.parametrize(("clip", "preset"), MEASURED)
@pytest.mark.parametrize("flow", FLOWS)
def test_the_lpips_is_below_that_of_both_flows_by_more_than_the_interval(clip, preset, flow):
    mean, half = interval(difference(clip, preset, flow, "lpips"))
    assert mean + half < 0 and len(runs_of(clip, preset)) == 3


@pytest.mark.parametrize(("clip", "preset"), MEASURED)
def test_the_psnr_is_above_the_flow_that_obeys_the_masks_and_level_with_the_other(clip, preset):
    plain, half = interval(difference(clip, preset, "flow_interpolation", "psnr_tissue"))
    assert -half < plain < 0
    mean, half = interval(difference(clip, preset, "flow_interpolation_tissue", "psnr_tissue"))
    assert mean > 0 and (mean > half) == ((clip, preset) == ("pulling", "sharp"))
