"""The table of a sweep as text: means over the seeds of a configuration, and what it gains over the first one."""

from endotsr.studies.sweeps.execute import FAILED, FINISHED
from endotsr.studies.sweeps.results import results_markdown


def test_the_table_has_means_over_seeds_and_differences_paired_by_seed():
    def row(configuration, seed, psnr, status=FINISHED):
        about = {"name": f"{configuration}{seed}", "sequence": "clip", "split": "every_eighth", "status": status}
        return {**about, "configuration": configuration, "seed": seed, "psnr_full": 40.0, "psnr_tissue": psnr}

    rows = [row("narrow", 0, 30.0), row("wide", 0, 30.5), row("narrow", 1, 33.0), row("wide", 1, 34.5)]
    *_, heads, _, first, second = results_markdown(rows).splitlines()
    assert heads.split(" | ")[3:6] == ["seeds", "mean PSNR full", "mean PSNR tissue"] and "LPIPS" not in heads
    assert first == "| clip | every_eighth | narrow | 2 | 40.00 | 31.50 | - |"
    assert second == "| clip | every_eighth | wide | 2 | 40.00 | 32.50 | +1.00 (+0.50 to +1.50) |"
    rows[2:3] = [row("narrow", 1, None, FAILED)]  # its partner has none then
    assert results_markdown(rows).splitlines()[-3].endswith("| wide | 2 | 40.00 | 32.50 | +0.50 (+0.50 to +0.50) |")
    assert "mean PSNR" not in results_markdown([row("narrow", 0, 30.0), row("wide", 0, 30.5)])
