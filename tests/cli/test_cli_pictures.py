"""`evaluate --pictures` and `compare`: any method's renders beside the baselines of a run."""

import csv
import json
import shutil

import numpy as np
import pytest
from tiny import assert_refused, written_folder

from endotsr.cli.main import main
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import SequenceConfig
from endotsr.results.evaluation.baselines import flow_interpolation
from endotsr.training.runs.folder import open_run
from endotsr.training.runs.sources import load_run_sequence


@pytest.fixture(scope="module")
def flow_pictures(finished_run, tmp_path_factory):
    """Float pictures of the flow baseline on the held-out frames of the run."""
    folder = tmp_path_factory.mktemp("pictures") / "flow"
    folder.mkdir()
    sequence = load_run_sequence(open_run(finished_run))
    for i in sequence.test_index:
        np.save(folder / f"{sequence.names[i]}.npy", flow_interpolation(sequence, int(i)))
    return folder


def test_pictures_of_the_flow_baseline_equal_its_row(finished_run, flow_pictures, tmp_path, capsys):
    before = {p: p.stat().st_mtime_ns for p in finished_run.rglob("*")}
    words = ["--json", str(tmp_path / "m.json"), "--csv", str(tmp_path / "m.csv"), "--label", "mine"]
    assert main(["evaluate", str(finished_run), "--pictures", str(flow_pictures), *words]) == 0
    said = capsys.readouterr().out
    rows = {line[:40].strip(): line[40:].split() for line in said.splitlines()}
    assert rows["mine"] == rows["Optical-flow interpolation (DIS)"], said
    metrics = json.loads((tmp_path / "m.json").read_text())
    run = json.loads((finished_run / "metrics.json").read_text())
    assert metrics["held_out"]["mean"] == run["baselines"]["flow_interpolation"]["mean"]
    assert metrics["baselines"] == run["baselines"] and metrics["label"] == "mine"
    table = list(csv.DictReader((tmp_path / "m.csv").open()))
    assert [row["method"] for row in table][:2] == ["mine", "Temporal mean of the training frames"]
    assert before == {p: p.stat().st_mtime_ns for p in finished_run.rglob("*")}, "the run is not changed"


def test_pictures_on_a_named_sequence(tmp_path, capsys):
    folder = written_folder(tmp_path)
    sequence = read_sequence(folder, SequenceConfig(scale=0.5))
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for i in sequence.test_index:
        np.save(pictures / f"{i}.npy", flow_interpolation(sequence, int(i)))
    words = ["evaluate", "--pictures", str(pictures), "--sequence", str(folder), "--sequence.scale", "0.5"]
    assert main([*words, "--json", str(tmp_path / "m.json")]) == 0
    found = json.loads((tmp_path / "m.json").read_text())
    assert found["held_out"]["mean"] == found["baselines"]["flow_interpolation"]["mean"]
    assert "1 picture, paired" in capsys.readouterr().out
    words[-1] = "0.75"
    assert_refused(capsys, words, f"{pictures}", "a picture of 36x24")


def test_pictures_that_are_the_frames_themselves_are_named(finished_run, tmp_path, capsys):
    """Before, their PSNR was empty, and nothing said why."""
    sequence = load_run_sequence(open_run(finished_run))
    for i in sequence.test_index:
        np.save(tmp_path / f"{sequence.names[i]}.npy", sequence.images[i].astype(np.float32) / np.float32(255))
    for words in (["--pictures", str(tmp_path)], [str(tmp_path)]):
        assert main(["evaluate", str(finished_run), *words]) == 0
        assert f"{tmp_path}: warning: 1 of 1 pictures equal the recorded frames" in capsys.readouterr().out


def test_evaluate_refuses_what_it_cannot_measure(finished_run, flow_pictures, tmp_path, capsys):
    run, pictures = str(finished_run), str(flow_pictures)
    assert_refused(capsys, ["evaluate"], "evaluate: RUN is missing", "--pictures FOLDER")
    assert_refused(capsys, ["evaluate", "--pictures", pictures], "--sequence is missing")
    for scale in ("0.5", "1.0"):  # also the default, which is not that of every run
        words = ["evaluate", run, "--sequence.scale", scale]
        assert_refused(capsys, words, "--sequence.*", "the settings of a run are fixed")
    words = ["evaluate", run, "--pictures", pictures]
    assert_refused(capsys, [*words, "--sequence.scale", "0.5"], "--sequence.*", "the settings of a run are fixed")
    assert_refused(capsys, [*words, "--no-view"], "--no-view with --pictures: no view.html is written")
    assert_refused(capsys, [*words, "--csv", str(tmp_path / "no" / "m.csv")], "m.csv: cannot be written")
    assert_refused(capsys, [*words[:-1], str(tmp_path)], f"{tmp_path}: contains no picture")


def test_compare_runs_and_pictures(finished_run, flow_pictures, tmp_path, capsys):
    words = ["evaluate", f"ours={finished_run}", str(flow_pictures), "--json", str(tmp_path / "c.json")]
    assert main([*words, "--csv", str(tmp_path / "c.csv")]) == 0
    said = capsys.readouterr().out
    assert "differences to ours, frame by frame" in said
    rows = {(row["label"], row["metric"]): row for row in json.loads((tmp_path / "c.json").read_text())["rows"]}
    ours, flow = rows["ours", "psnr_tissue"], rows["flow", "psnr_tissue"]
    assert flow["difference"]["mean"] == pytest.approx(flow["mean"] - ours["mean"])
    assert rows["Optical-flow interpolation (DIS)", "psnr_tissue"]["difference"] == flow["difference"]
    assert (tmp_path / "c.csv").read_text().startswith("method,metric,mean,difference")
    assert main([*words[:3], "--no-baselines"]) == 0
    assert "Optical-flow" not in capsys.readouterr().out


def test_a_method_is_a_folder_of_png_files_too(finished_run, capsys):
    """Such a folder could be prepared as a clip; a clip itself is refused in `test_cli_bad_input.py`."""
    (renders,) = (finished_run / "test").glob("ours_*/renders")
    assert main(["evaluate", f"ours={finished_run}", f"files={renders}"]) == 0
    assert "files" in capsys.readouterr().out


def test_a_single_run_is_compared_with_its_baselines(finished_run, capsys):
    assert main(["evaluate", "--compare", f"ours={finished_run}"]) == 0
    said = capsys.readouterr().out
    assert "differences to ours, frame by frame" in said and "Optical-flow" in said


def test_compare_refuses_what_it_cannot_compare(finished_run, flow_pictures, tmp_path, capsys):
    run, pictures = str(finished_run), str(flow_pictures)
    assert_refused(capsys, ["evaluate", "--compare"], "--compare has no effect without methods")
    assert_refused(capsys, ["evaluate", "--compare", pictures], "--sequence is missing")
    assert_refused(capsys, ["evaluate", run, run], "two methods are called 'run'")
    assert_refused(capsys, ["evaluate", run, str(tmp_path / "none.json")], "none.json: cannot be read")
    fresh = shutil.copytree(finished_run, tmp_path / "my run")
    (fresh / "metrics.json").unlink()
    assert_refused(capsys, ["evaluate", run, str(fresh)], f"not evaluated yet; `endotsr evaluate '{fresh}'` writes")
    assert_refused(capsys, ["evaluate", "--compare", run, "--seed", "-1"], "--seed -1 is not allowed")
    assert_refused(capsys, ["evaluate", run, pictures, "--label", "x"], "--label has no effect with several methods")
    assert_refused(capsys, ["evaluate", run, pictures, "--no-view"], "--no-view has no effect with several methods")
    assert_refused(capsys, ["evaluate", "--compare", run, "--no-view"], "--no-view with --compare: no view.html")
    assert_refused(capsys, ["evaluate", "--compare", run, "--measures", "depth"], "--measures with --compare")
    for words in (["--lpips", "w.npz"], ["--sequence", run], ["--sequence.scale", "0.5"]):
        said = "has no effect: no METHOD is a folder of pictures"
        assert_refused(capsys, ["evaluate", "--compare", run, *words], words[0].split(".")[0], said)
    assert_refused(capsys, ["evaluate", run, "--label", "x"], "--label has no effect without --pictures")
    assert_refused(
        capsys, ["evaluate", run, "--seed", "1"], "--seed has no effect without several methods or --compare"
    )
    assert_refused(
        capsys, ["evaluate", run, "--no-baselines"], "--no-baselines has no effect without several methods or"
    )
    (tmp_path / "m.json").write_text("{}")
    assert_refused(capsys, ["evaluate", run, str(tmp_path / "m.json")], "m.json", "that `endotsr evaluate` wrote")
