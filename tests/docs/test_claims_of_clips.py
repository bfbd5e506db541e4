"""Claims over two clips: no table mixes them, and a verdict has the seeds of the clip with the fewest."""

from pages.claims.answer import gains
from pages.claims.estimates import Estimate, averaged
from pages.claims.parts import protocols
from pages.claims.rules import increment_verdict


def test_the_table_of_held_out_frames_does_not_mix_clips():
    def row(clip, psnr, blend):
        baselines = {"two_neighbours": {"mean": {"psnr_tissue": blend}}}
        return {
            "configuration": "A+S+L", "split": "every_eighth", "preset": "paper", "sequence": clip,
            "baselines": baselines, "psnr_tissue": psnr, "training_psnr_tissue": 44.0, "cross_fade_psnr_tissue": 38.0,
        }  # fmt: skip

    pulling = {"rows": [row("endonerf_pulling", 37.0, 38.7)]}
    cutting = {"rows": [row("endonerf_cutting", 39.0, 41.4), row("endonerf_cutting", 40.0, 41.4)]}
    found = protocols([cutting, pulling], []).splitlines()[2:]
    assert found == [
        "| endonerf_pulling | every_eighth, paper | 1 | 44.00 | 37.00 | 38.00 | 38.70 | - |",
        "| endonerf_cutting | every_eighth, paper | 2 | 44.00 | 39.50 | 38.00 | 41.40 | - |",
    ]


def test_a_mean_over_clips_has_the_seeds_of_the_clip_with_the_fewest():
    one = Estimate((0.5,), 0.5, 0.5, None, (0.4, 0.6))
    three = Estimate((0.2, 0.3, 0.4), 0.3, 0.3, (0.1, 0.5), (0.2, 0.4))
    found = averaged([three, one])
    assert found.seeds == 1 and len(found.values) == 4 and (one.seeds, three.seeds) == (1, 3)
    assert increment_verdict(0.4, found.common, found.seeds) == "not decided: 1 of 3 seeds"
    assert averaged([three, three]).seeds == 3


def test_a_step_of_fewer_seeds_than_the_whole_says_so():
    def row(configuration, seed, psnr):
        return {"configuration": configuration, "seed": seed, "psnr_full": psnr, "split": "every_eighth",
                "sequence": "endonerf_cutting"}  # fmt: skip

    rows = [row(name, seed, psnr) for name, psnr in (("base", 40.1), ("A+S+L", 40.8)) for seed in range(3)]
    rows += [row("S", 0, 40.2), row("A+S", 0, 40.7)]
    said = gains({"cutting": {"rows": rows}})
    assert "| +0.31 to +0.66 | cutting | +0.70 | +0.70 to +0.70 | direction reproduced, size not | " in said
    assert "| A, over S | +0.29 | cutting | +0.50 | - | not decided: 1 of 3 seeds | " in said
    assert "mean of both |" not in said
