"""The files of open questions: each is a sweep that can run, and the table says what its record holds."""

import json

import pytest
from pages.full_size import other_views, sweeps
from pages.store.intervals import interval
from pages.store.program import RESULTS

from endotsr.errors import InputError
from endotsr.results.evaluation import right_view

KEPT_BY_A_CHECKPOINT = ("deformation", "exposure", "pose_correction", "bases", "harmonics_degree", "frequencies")
FILES = {file.stem: file for file in sweeps.files()}


def row(configuration, seed, psnr, **changes):
    values = {"sequence": "clip", "split": "every_eighth", "configuration": configuration, "seed": seed}
    metrics = {"psnr_full": psnr, "psnr_tissue": psnr - 2, "ssim_full": 0.9, "lpips": None}
    return values | metrics | {"status": "finished", "arrays_sha256": {"images": "a"}} | changes


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_a_sweep_of_three_seeds_with_a_question(name):
    spec, clips = sweeps.read(FILES[name])
    assert sweeps.question(FILES[name]).count("?") >= 1
    assert spec.seeds == (0, 1, 2) and set(clips) <= {"endonerf_pulling", "endonerf_cutting", "pulling_pairs"}
    assert all(len(c.name) < 40 for c in spec.configurations) and len(spec.configurations) >= 2


@pytest.mark.parametrize("name", FILES)
def test_a_configuration_can_continue_from_its_start(name):
    """A checkpoint holds no exposures, poses or other bases than those it was trained with."""
    made = configurations(name)
    for configuration in sweeps.read(FILES[name])[0].configurations:
        if configuration.start:
            began, goes_on = made[configuration.start.configuration], configuration.config
            for key in KEPT_BY_A_CHECKPOINT:
                assert getattr(began.model, key) == getattr(goes_on.model, key), (configuration.name, key)
            assert configuration.start.iteration == goes_on.training.residual_activation and goes_on.density.until == 0


def configurations(name):
    return {c.name: c.config for c in sweeps.read(FILES[name])[0].configurations}


def test_the_files_ask_what_they_say():
    assert {c.loss.ssim_weight for c in configurations("similarity_weight").values()} == {0.0, 0.05, 0.1, 0.2}
    weights = [c.loss.lambda_msp for name, c in configurations("matern_weight").items() if name != "base"]
    assert weights == [0.0, 1.0, 1e2, 1e4, 1e6]
    assert sweeps.read(FILES["blocks"])[0].splits == ("blocks 4", "blocks 8", "blocks 16")
    assert sweeps.read(FILES["other_views"])[0].measures == ("right_view", "depth")
    light = configurations("light")
    assert light["A"].model.appearance and not light["A"].model.exposure
    assert light["exposure"].model.exposure and not light["exposure"].model.appearance


def test_frozen_geometry_leaves_the_rate_of_the_colour_residual_as_it_is():
    light = configurations("frozen_geometry")
    free, frozen = light["A fixed"].optimiser, light["A frozen"].optimiser
    rate = lambda optimiser: optimiser.deformation * optimiser.appearance_factor
    assert rate(frozen) == pytest.approx(rate(free)) and frozen.deformation < 1e-5 * free.deformation
    assert (frozen.position, frozen.opacity, frozen.scale, frozen.rotation) == (0, 0, 0, 0)


def test_a_configuration_is_compared_with_the_base_of_its_own_kind():
    spec = sweeps.read(FILES["frozen_geometry"])[0]
    assert [sweeps.reference(spec, name) for name in ("base", "A frozen", "A fixed", "base fixed")] == [
        "base", "base frozen", "base fixed", "base fixed",
    ]  # fmt: skip
    assert sweeps.reference(sweeps.read(FILES["matern_weight"])[0], "lambda_msp 100") == "lambda_msp 0"
    assert sweeps.reference(sweeps.read(FILES["similarity_weight"])[0], "w 0") == "w 0.1"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "w.toml").write_text(
        '# Does it matter?\nsequences = ["clip"]\nseeds = [0, 1, 2]\n[configurations.one]\n[configurations.two]\n'
    )
    monkeypatch.setattr(sweeps, "FOLDER", tmp_path)
    return tmp_path


def stored(folder, rows):
    (folder / "results.json").write_text(json.dumps({"rows": rows}))
    sweeps.store("w", folder / "results.json")


def test_differences_are_paired_by_seed(folder):
    """The same gain on every seed has no width; an open run is not stored, a later one replaces an earlier one."""
    stored(
        folder,
        [row("one", s, 30.0 + s) for s in range(3)] + [row("two", 0, 1.0), {**row("two", 2, 9.9), "status": "open"}],
    )
    stored(folder, [row("two", s, 30.5 + s) for s in range(2)])
    table = sweeps.tables()
    assert "| `w` | Does it matter? | 6 | 5 |" in table
    assert "| one | 3 | 31.00 ± 2.48 | 29.00 ± 2.48 | 0.9000 ± 0.0000 | - |" in table
    assert "| two, difference to one | 2 | +0.50 ± 0.00 | +0.50 ± 0.00 | +0.0000 ± 0.0000 | - |" in table


def test_a_pair_of_different_frames_is_refused(folder):
    stored(folder, [row("one", 0, 30.0), row("two", 0, 31.0, arrays_sha256={"images": "b"})])
    with pytest.raises(InputError, match="two and one, seed 0: the runs of a pair must read the same frames"):
        sweeps.tables()


def test_an_unknown_sweep_is_refused(folder):
    with pytest.raises(InputError, match="use one of: w"):
        sweeps.store("other", folder / "results.json")


def test_the_prior_moves_psnr_by_less_than_its_interval_at_any_measured_weight():
    """The sentences below the table: PSNR is not decided at a million times the published weight, LPIPS is."""
    rows = sweeps.rows_of(FILES["matern_weight"])
    apart = {key: sweeps.differences(rows, "lambda_msp 1000000", "lambda_msp 0", key) for key in ("psnr_full", "lpips")}
    assert [len(values) for values in apart.values()] == [3, 3]
    (psnr, of_psnr), (lpips, of_lpips) = map(interval, apart.values())
    assert abs(psnr) < of_psnr and lpips > of_lpips


def test_a_gains_by_colour_alone():
    """The sentence on frozen geometry: both gains are decided, and their difference is not."""
    rows = sweeps.rows_of(FILES["frozen_geometry"])
    frozen, fixed = (sweeps.differences(rows, f"A {kind}", f"base {kind}", "psnr_full") for kind in ("frozen", "fixed"))
    assert len(frozen) == len(fixed) == 3
    for values in (frozen, fixed):
        mean, half = interval(values)
        assert mean > half
    mean, half = interval([a - b for a, b in zip(frozen, fixed)])
    assert abs(mean) < half


@pytest.mark.parametrize(("clip", "gain", "without"), [("pulling", "A", "base"), ("cutting", "A+S", "S")])
def test_an_exposure_does_not_do_what_a_does(clip, gain, without):
    """The sentences on `light`: no gain on either clip, and A, or A beside S, gains more in every seed."""
    rows = [row for row in sweeps.rows_of(FILES["light"]) if row["sequence"] == f"endonerf_{clip}"]
    exposure = sweeps.differences(rows, "exposure", "base", "psnr_full")
    mean, half = interval(exposure)
    assert len(exposure) == 3 and abs(mean) < half
    stored = json.loads((RESULTS / f"ablation_{clip}.json").read_text(encoding="utf-8"))["rows"]
    psnr = {(row["configuration"], row["seed"]): row["psnr_full"] for row in stored}
    assert all(psnr[gain, seed] - psnr[without, seed] > exposure[seed] for seed in range(3))


def test_the_bases_of_light_are_those_of_other_records():
    """On pulling that of `frozen_geometry`, on cutting that of the claims: the settings are equal."""
    bases = {
        clip: [
            row for row in sweeps.rows_of(FILES["light"]) if (row["sequence"], row["configuration"]) == (clip, "base")
        ]
        for clip in ("endonerf_pulling", "endonerf_cutting")
    }
    frozen = [row for row in sweeps.rows_of(FILES["frozen_geometry"]) if row["configuration"] == "base"]
    assert bases["endonerf_pulling"] == frozen
    assert configurations("light")["base"] == configurations("frozen_geometry")["base"]
    stored = json.loads((RESULTS / "ablation_cutting.json").read_text(encoding="utf-8"))["rows"]
    psnr = {row["seed"]: row["psnr_full"] for row in stored if row["configuration"] == "base"}
    assert {row["seed"]: row["psnr_full"] for row in bases["endonerf_cutting"]} == psnr


def test_differences_of_two_clips_are_not_mixed():
    """Equal configurations and seeds of two clips are six pairs, not three."""
    rows = sweeps.rows_of(FILES["light"])
    of_clips = [
        sweeps.differences([row for row in rows if row["sequence"] == clip], "exposure", "base", "psnr_full")
        for clip in ("endonerf_cutting", "endonerf_pulling")
    ]
    together = sweeps.differences(rows, "exposure", "base", "psnr_full")
    assert sorted(together) == sorted([*of_clips[0], *of_clips[1]]) and len(together) == 6


def test_what_is_said_of_the_right_camera_and_of_held_out_depth():
    """In every seed `sharp` is ahead of the moved left picture, and behind moved flow and the blend of the priors."""
    record = json.loads((RESULTS / "other_views.json").read_text(encoding="utf-8"))
    without = other_views.labelled(record["measures"])
    runs = [row for row in sweeps.rows_of(FILES["other_views"]) if row["configuration"] == "sharp"]
    assert len(runs) == 3
    moved, flow = without["right_view", other_views.MOVED], without["right_view", right_view.FLOW]
    blend = without["depth", "blend of the neighbouring priors"]
    for row in runs:
        scene = other_views.labelled(row["measures"])
        seen, depth = scene["right_view", other_views.MODEL], scene["depth", other_views.MODEL]
        assert moved["held_out_psnr"] < seen["held_out_psnr"] < flow["held_out_psnr"]
        assert moved["training_psnr"] < seen["training_psnr"] and depth["mean_absolute"] > blend["mean_absolute"]


def test_scenes_and_predictions_of_different_frames_are_refused():
    record = json.loads((RESULTS / "other_views.json").read_text(encoding="utf-8"))
    with pytest.raises(InputError, match="must be of the same frames"):
        other_views.table(record | {"arrays_sha256": {"images": "other"}})
