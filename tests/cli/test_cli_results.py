"""Commands that read a finished run: render, evaluate, calibrate; and bench, demo, gradcheck at their smallest."""

import json
import shutil
from pathlib import Path

import numba
import numpy as np
import pytest
from tiny import SETTINGS, assert_refused, render

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
from endotsr.method.kernels.threads import use_threads
from endotsr.results.report.run_text import held_out_table
from endotsr.results.views.pictures import depth_bytes, depth_step
from endotsr.studies.bench.clock import REST, STAGES
from endotsr.training.runs.files import os_error_line, write_json

CALIBRATE = ("train", "--calibrate-only", "--out")


def test_render_at_any_time(finished_run, tmp_path):
    out = tmp_path / "pictures"
    about = render(finished_run, out, "--times", "0", "0.06", "1", "--npy")
    assert [p["time"] for p in about["pictures"]] == [0, 0.06, 1]
    assert [p["camera_of_frame"] for p in about["pictures"]] == [0, 1, 8]
    for picture in about["pictures"]:
        stem = picture["file"].removesuffix(".png")
        colour, depth, opacity = (np.load(out / name / f"{stem}.npy") for name in ("colour", "depth", "opacity"))
        assert colour.shape == (3, 32, 48) and depth.shape == opacity.shape == (32, 48)
        assert (
            np.abs(read_png(out / "colour" / picture["file"]).transpose(2, 0, 1) / 255 - colour.clip(0, 1)).max()
            < 0.003
        )
        stored = read_png(out / "depth" / picture["file"])
        assert stored.dtype == np.uint16
        assert np.abs(stored * about["depth_step"] - depth).max() <= 0.51 * about["depth_step"]
        assert read_png(out / "opacity" / picture["file"]).shape == (32, 48)


@pytest.mark.parametrize(("which", "count"), [("test", 1), ("train", 8), ("all", 9)])
def test_render_frames(which, count, finished_run, tmp_path):
    about = render(finished_run, tmp_path / "pictures", "--frames", which)
    assert len(about["pictures"]) == count == len(list((tmp_path / "pictures" / "colour").iterdir()))


def test_render_between_frames_is_between_times(finished_run, tmp_path):
    about = render(finished_run, tmp_path / "pictures", "--count", "5", "--camera", "3")
    assert [p["time"] for p in about["pictures"]] == [0, 0.25, 0.5, 0.75, 1]
    assert {p["camera_of_frame"] for p in about["pictures"]} == {3}


def test_render_of_a_held_out_frame_is_that_of_the_evaluation(finished_run, tmp_path):
    render(finished_run, tmp_path / "pictures", "--frames", "test")
    again = read_png(tmp_path / "pictures" / "colour" / "000001.png")
    assert np.array_equal(again, read_png(finished_run / "renders" / "000001.png"))


def test_render_without_a_component_differs(finished_run, tmp_path):
    render(finished_run, tmp_path / "a", "--times", "0.4", "--npy")
    render(finished_run, tmp_path / "b", "--times", "0.4", "--npy", "--without", "appearance", "spectral_motion")
    a, b = (np.load(tmp_path / name / "colour" / "00000.npy") for name in "ab")
    assert not np.array_equal(a, b)


def test_depth_pictures_keep_a_known_step():
    depth = np.array([[0.0, 50.0], [99.9, np.nan]])
    step = depth_step(80.0, depth)
    assert np.log2(step) == round(np.log2(step))
    stored = depth_bytes(depth, step)
    assert stored[0, 0] == 0 and stored[1, 1] == 0
    assert np.abs(stored * step - np.nan_to_num(depth)).max() <= step / 2
    assert depth_bytes(np.array([[1e9]]), step)[0, 0] == 65535


def test_evaluate_again_gives_the_same_numbers(finished_run, run_copy, capsys):
    out = run_copy
    (out / "report.html").unlink()
    shutil.rmtree(out / "renders")
    assert main(["evaluate", str(out), "--no-view"]) == 0
    said = capsys.readouterr().out
    before, after = (json.loads((folder / "metrics.json").read_text()) for folder in (finished_run, out))
    assert before["held_out"] == after["held_out"] and before["baselines"] == after["baselines"]
    for row in ("this model", "Temporal mean", "nearest", "two neighbouring", "Optical-flow"):
        assert row in said
    assert str(out / "report.html") in said
    page = (out / "report.html").read_text()
    assert "rendered without A, colour residual" in page
    assert not (out / "view.html").exists() and "view.html" not in page, "neither page nor link"
    assert 'href="view.html"' in (finished_run / "report.html").read_text() and (finished_run / "view.html").exists()


def test_an_evaluation_names_what_it_measures_no_longer(run_copy, capsys):
    metrics = json.loads((run_copy / "metrics.json").read_text())
    metrics["held_out"]["mean"]["lpips"] = 0.1  # as with weights, which are no part of the project
    write_json(run_copy / "metrics.json", metrics)
    flicker = ("--measures", "flicker")
    for words, said in ((flicker, ": LPIPS (--lpips FILE)\n"), ((), ": flicker (--measures flicker)\n"), ((), None)):
        assert main(["evaluate", str(run_copy), "--no-view", *words]) == 0
        printed = capsys.readouterr().out
        assert f"any more{said}" in printed if said else "any more" not in printed


@pytest.mark.parametrize("content", ["", "{}", '{"held_out": {"mean": 3}, "measures": [1]}'])
def test_a_damaged_record_of_an_earlier_evaluation_is_replaced(content, run_copy, capsys):
    (run_copy / "metrics.json").write_text(content)
    assert main(["evaluate", str(run_copy), "--no-view"]) == 0
    assert "any more" not in capsys.readouterr().out


def test_table_writes_a_dash_for_no_value():
    metrics = {
        "held_out": {
            "mean": {"psnr_full": None, "psnr_tissue": 20.0},
            "per_frame": [
                {"frame": 1, "name": "right", "psnr_tissue": 20.0},
                {"frame": 9, "name": "covered", "psnr_tissue": None},
            ],
        },
        "baselines": {},
        "training": {"mean": {}},
        "run": {"iteration": 7, "iterations_planned": 7},
        "lpips_reason": "no weights",
    }
    table = held_out_table(metrics)
    assert "20.00" in table and "no weights" in table and "nan" not in table.lower()
    assert "(no finite value): covered" in table


@pytest.mark.parametrize("command", ["evaluate", "render"])
def test_threads_below_zero_are_refused(command, finished_run, tmp_path, capsys):
    more = ["--out", str(tmp_path / "out")] if command == "render" else []
    words = [command, str(finished_run), *more, "--threads", "-1"]
    assert_refused(capsys, words, "threads", "-1 is not allowed; use ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["missing/found.json", "file/found.json", ""])
def test_files_are_refused_before_the_work(name, finished_run, tmp_path, capsys):
    (tmp_path / "file").touch()
    file = str(tmp_path / name)
    for words in (
        [*CALIBRATE, str(finished_run), "--json", file],
        ["gradcheck", "--json", file],
        ["golden", "judge", str(tmp_path), "--level", "0", "--json", file],
        ["golden", "judge", str(tmp_path), "--level", "0", "--html", file],
        ["golden", "run", "--port", "true {requests} {outputs}", "--level", "0", "--html", file],
        ["bench", "--json", file],
    ):
        assert_refused(capsys, words, f"error: {file}: cannot be written: ", "use ")


@pytest.mark.parametrize("option, name", [("--json", "found.html"), ("--html", "page.pdf"), ("--html", "page.JSON")])
def test_a_file_with_the_ending_of_another_kind_is_refused(option, name, tmp_path, capsys):
    words = ["check", "simulated", option, str(tmp_path / name)]
    assert_refused(capsys, words, option, name, f"use .{option[2:]}")
    assert list(tmp_path.iterdir()) == []


def test_the_working_folder_is_judged(tmp_path, capsys, monkeypatch):
    golden = str(Path(__file__).parents[2] / "golden")
    monkeypatch.chdir(tmp_path)
    assert main(["golden", "judge", ".", "--level", "0", "--search", "0", "--golden", golden]) == 1
    assert "no level is complete" in capsys.readouterr().out
    assert_refused(capsys, ["golden", "judge"], "OUTDIR is missing")


def test_an_error_while_writing_names_the_file_that_was_asked_for(tmp_path):
    for folder in (tmp_path / "missing", tmp_path / "file"):
        (tmp_path / "file").touch()
        with pytest.raises(OSError, match=r"found\.json") as refused:
            write_json(folder / "found.json", {})
        assert os_error_line(refused.value).startswith(f"{folder / 'found.json'}: ")


def test_more_threads_than_cores_are_all_cores():
    most = numba.config.NUMBA_NUM_THREADS
    assert use_threads(10_000) == most and 1 <= use_threads(0) <= most and use_threads(1) == 1


def test_calibrate_prints_the_table_and_leaves_the_run_alone(finished_run, tmp_path, capsys):
    before = {p: p.stat().st_mtime_ns for p in finished_run.rglob("*")}
    words = [*CALIBRATE, str(finished_run), "--json", str(tmp_path / "found.json"), "--loss.ssim-weight", "0.2"]
    assert main(words) == 0
    said = capsys.readouterr().out
    found = json.loads((tmp_path / "found.json").read_text())
    assert f"lambda_lap = {found['lambda_lap']:.6g} ({len(found['ratios'])} views)" in said
    assert "000000" in said and "loss.ssim_weight = 0.2 (run: 0.1)" in said
    assert before == {p: p.stat().st_mtime_ns for p in finished_run.rglob("*")}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--sequence.scale", "0.5"], "sequence.scale = 0.5 (run: 1.0)"),
        (
            ["--model.frequencies", "4", "--model.bases", "9"],
            "model.bases = 9 (run: 17), model.frequencies = 4 (run: 8)",
        ),
        (["--preset", "sharp"], "preset = 'sharp' (run: 'paper')"),
        (["--training.precision", "float64"], "training.precision = 'float64' (run: 'float32')"),
        (["--loss.depth-weight", "2"], "loss.depth_weight = 2.0 (run: 1.0)"),
    ],
)
def test_calibrate_refuses_settings_that_it_would_not_use(words, named, finished_run, capsys):
    assert_refused(
        capsys,
        [*CALIBRATE, str(finished_run), *words],
        f"--calibrate-only: {named}: fixed by the run",
        "use one of",
    )


@pytest.mark.parametrize(
    "words",
    [
        ["--loss.upsampling", "half_pixel"],
        ["--loss.gradient-ratio", "0.5"],
        ["--loss.calibration-views", "3"],
        ["--raster.alpha-cutoff", "0.2"],
    ],
)
def test_every_setting_that_calibrate_takes_changes_the_answer(words, finished_run, tmp_path):
    main([*CALIBRATE, str(finished_run), "--json", str(tmp_path / "as_it_is.json")])
    assert main([*CALIBRATE, str(finished_run), *words, "--json", str(tmp_path / "replaced.json")]) == 0
    before, after = (json.loads((tmp_path / name).read_text()) for name in ("as_it_is.json", "replaced.json"))
    assert before["lambda_lap"] != after["lambda_lap"]


@pytest.mark.parametrize("words", [["--iterations", "40"], ["--resume"], ["--config", "mine.toml"]])
def test_calibrate_refuses_options_of_a_training(words, finished_run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    said = f"--calibrate-only with {words[0]}: the settings of a run are fixed"
    assert_refused(capsys, [*CALIBRATE, str(finished_run), *words], said)


def test_calibration_without_an_answer_is_one_line(finished_run, capsys, monkeypatch):
    from endotsr.errors import CalibrationError
    from endotsr.training.fitting import objective

    def no_answer(*_):
        raise CalibrationError("calibration: none of the 2 views is valid\nview a\nview b")

    monkeypatch.setattr(objective, "calibrate_on", no_answer)
    assert main([*CALIBRATE, str(finished_run)]) == 2
    said = capsys.readouterr()
    assert said.err == "endotsr: error: calibration: none of the 2 views is valid\n"
    assert "view a\nview b" in said.out


def test_bench_times_every_stage(tmp_path, capsys):
    file = tmp_path / "bench.json"
    sizes = ["--gaussians", "200", "--width", "48", "--height", "32", "--repeats", "3", "--threads", "1"]
    assert main(["bench", *sizes, "--json", str(file)]) == 0
    said = capsys.readouterr().out
    (result,) = json.loads(file.read_text())["cases"]
    assert set(result["stages"]) == {*STAGES, REST}
    slowest = max(stage["median_ms"] for stage in result["stages"].values())
    assert 0 < slowest and result["iteration"]["quartiles_ms"][1] > 0  # times themselves are not for a test
    assert all(name in said for name in result["stages"]) and "limit ms" in said and "first iteration" in said
    assert "blended pairs" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--threads", "0"], "--threads 0 is not allowed; use an integer >= 1"),
        (["--gaussians", "3"], "--gaussians 3 is not allowed; use an integer >= 4"),
        (["--repeats", "0"], "--repeats 0 is not allowed"),
        (["--precisions", "float16"], "float16"),
        (["--scenes"], "--scenes: missing value "),
        (["--precisions"], "--precisions: missing value "),
        (["--threads"], "--threads: missing value "),
        (["--gaussians"], "--gaussians is empty and there are no --scenes; use one or more"),
        (["--gaussians", "--scenes", "none.npz"], "none.npz"),  # no mistake beside a scene, which is not found here
    ],
)  # fmt: skip
def test_bench_refuses_what_cannot_be_timed(words, said, capsys):
    assert_refused(capsys, ["bench", *words], said)


def test_demo_is_the_simulated_sequence_on_its_preset(tmp_path, capsys):
    out = tmp_path / "run"
    words = ["--out", str(out), "--scale", "0.3", *SETTINGS, "--iterations", "4"]
    assert main(["demo", *words]) == 0
    assert f"report: {out / 'report.html'}" in capsys.readouterr().out
    assert json.loads((out / "metrics.json").read_text())["run"]["settings"]["preset"] == "demo"


def test_check_command_names_what_it_does_not_know(capsys):
    assert_refused(capsys, ["gradcheck", "no_such_operation"], "no_such_operation")


def test_tradeoff_takes_a_run_without_held_out_frames(run_copy):
    """As a training in Python on a sequence without a split leaves it."""
    from endotsr.studies.tradeoff.scenes import run_scene

    assert run_scene(run_copy).about.endswith("held-out frame 1")
    file = run_copy / "sequence.json"
    record = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps(record | {"test_index": []}), encoding="utf-8")
    assert run_scene(run_copy).about.endswith(f"training frame {record['train_index'][4]}")


def test_a_slim_model_of_the_previous_checkpoint_is_written_and_said(run_copy, tmp_path, capsys):
    """A kill between two renames leaves it alone, where the file system has no hard links."""
    (run_copy / "checkpoint.npz").replace(run_copy / "checkpoint.previous.npz")
    assert main(["export", str(run_copy), "--out", str(tmp_path / "a.npz")]) == 0
    assert "of the checkpoint" in capsys.readouterr().out


def test_a_run_folder_that_cannot_be_written_is_refused_before_it_is_evaluated(finished_run, monkeypatch, capsys):
    monkeypatch.setattr("os.access", lambda path, mode: False)
    monkeypatch.setattr("endotsr.results.evaluation.run.measure_model", pytest.fail)
    assert_refused(capsys, ["evaluate", str(finished_run)], f"{finished_run}: cannot be written: no permission")


def test_a_file_in_a_folder_that_cannot_be_written_is_refused_at_the_start(finished_run, tmp_path, monkeypatch, capsys):
    """A file is written beside its place and renamed: its own permission is not enough."""
    file = tmp_path / "metrics.json"
    file.write_text("{}")
    monkeypatch.setattr("os.access", lambda path, mode: path != tmp_path)
    assert_refused(capsys, ["evaluate", str(finished_run), "--json", str(file)], "metrics.json: cannot be written")
