"""`endotsr ablate` from the command line to its three files."""

import json
import shutil

import pytest
from tiny_sweep import rows_of

from endotsr.cli.ablate import without_folders
from endotsr.cli.main import main

pytestmark = pytest.mark.slow
WORDS = (
    *("ablate", "simulated", "--preset", "demo", "--iterations", "12", "--seeds", "1", "--workers", "1"),
    *("--scale", "0.3"),
    *("--configurations", "base", "A", "--measures", "depth"),
)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ablate")
    assert main([*WORDS, "--out", str(folder / "out"), "--json", str(folder / "ablation.json")]) == 0
    return folder


def test_configurations_differ_in_their_components_and_fixed_ones_in_no_gaussian(done):
    rows = {row["configuration"]: row for row in rows_of(done / "out").values()}
    assert set(rows) == {"base", "A", "base fixed", "A fixed"}
    for name, row in rows.items():
        model = row["settings"]["model"]
        assert model["appearance"] == name.startswith("A") and not model["spectral_motion"] and not model["laplacian"]
        assert row["measures"]["depth"]["rows"][0]["label"] == "this model"
    assert rows["base fixed"]["gaussians"] == rows["A fixed"]["gaussians"]
    assert not list((done / "out").glob("runs/*/checkpoint*.npz"))  # a model is kept on request
    assert len(list((done / "out" / "shared").glob("*.npz"))) == 1


def test_the_results_are_paired_and_written_three_times_over(done):
    record = json.loads((done / "ablation.json").read_text())
    assert record == json.loads((done / "out" / "ablation.json").read_text())
    found = {(f["claim"], f["metric"]): f for f in record["increments"]}
    rows = {row["configuration"]: row for row in record["rows"]}
    entry = found["A alone", "psnr_tissue"]
    assert entry["mean"] == pytest.approx(rows["A"]["psnr_tissue"] - rows["base"]["psnr_tissue"])
    assert entry["mean_low"] is None and entry["pairs"] == 1
    assert ("A, fixed count", "psnr_full") in found
    assert "| A alone (ours) |" in (done / "out" / "ablation.md").read_text()
    assert (done / "out" / "ablation.png").stat().st_size > 1000


def test_results_do_not_tell_where_files_lie(done, tmp_path, monkeypatch):
    command = json.loads((done / "ablation.json").read_text())["command"]
    assert command[:3] == ["endotsr", "ablate", "simulated"]
    assert command[-4:] == ["--out", "out", "--json", "ablation.json"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clip").mkdir()
    words = ["../x/none", "clip", "--out=/a/b/c", "--out", "/a/b", "blocks 4", "A+S"]
    assert [without_folders(word) for word in words] == [
        "../x/none",
        "clip",
        "--out=c",
        "--out",
        "b",
        "blocks 4",
        "A+S",
    ]


def test_collect_writes_the_finished_runs_and_trains_nothing(done, capsys):
    more = [word if word != "1" else "2" for word in WORDS[:8]] + list(WORDS[8:])
    assert more[more.index("--seeds") + 1] == "2"
    assert main([*more, "--out", str(done / "out"), "--collect"]) == 0
    assert "4 of 8 runs finished, 0 failed." in capsys.readouterr().out
    assert len(list((done / "out" / "runs").iterdir())) == 4


@pytest.mark.parametrize(
    "digest, said",
    [("0" * 64, "simulated-every_eighth-A-seed0 and simulated-every_eighth-base-seed0 differ in arrays_sha256"),
     (None, "metrics.json")],
)  # fmt: skip
def test_a_pair_with_different_input_or_without_its_hash_is_refused(done, tmp_path, capsys, digest, said):
    """The files of the second run were changed after the first, or its record was made without hashes."""
    out = shutil.copytree(done / "out", tmp_path / "out")
    file = out / "runs" / "simulated-every_eighth-A-seed0" / "metrics.json"
    metrics = json.loads(file.read_text())
    assert set(metrics["run"]["input"]["arrays_sha256"]) >= {"images", "masks", "cameras", "times"}
    if digest is None:
        del metrics["run"]["input"]["arrays_sha256"]
    else:
        metrics["run"]["input"]["arrays_sha256"]["images"] = digest
    file.write_text(json.dumps(metrics))
    assert main([*WORDS, "--out", str(out), "--collect"]) == 2
    error = capsys.readouterr().err
    print(error)
    assert said in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "words, said",
    [(["--seeds", "0"], "--seeds 0 is not allowed"), (["--iterations", "1"], "--iterations 1 is not allowed"),
     (["--configurations", "B"], "'B' is not allowed; use one of base, A, S, L"),
     (["--splits", "middle"], "splits = 'middle' is not allowed"), (["--measures", "beauty"], "use one of depth")],
)  # fmt: skip
def test_mistakes_are_one_line(tmp_path, capsys, words, said):
    assert main(["ablate", "simulated", "--out", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_folder_is_needed(capsys):
    assert main(["ablate", "simulated"]) == 2
    assert "missing: --out DIR" in capsys.readouterr().err
