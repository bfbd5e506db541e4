"""The pictures, the tables and the refusals of `endotsr bench`."""

import json
from pathlib import Path

import numpy as np
import pytest

from endotsr.bench import charts, peers, scaling, stages, start, suite, trained
from endotsr.bench.case import Case, measure
from endotsr.bench.limits import limits
from endotsr.bench.stages import grid, ns_per_pair
from endotsr.cli.main import main
from endotsr.cli.parts.bench_options import StagesOptions
from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.export import npz

PEAKS = {
    "threads": 1,
    "flop_per_second": {"float32": 1e11, "float64": 5e10},
    "bytes_per_second": {"triad": 1e10, "update": 2e10},
}
RESULTS = Path(__file__).parents[2] / "docs" / "results"


@pytest.fixture(scope="module")
def results():
    """What two of the measurements return, at the smallest sizes."""
    small = [Case(gaussians=n, width=48, height=32, repeats=1, threads=1, densifications=1) for n in (60, 30, 90)]
    measured = [measure(case) for case in small]
    for result in measured:
        result |= {"limits": limits(result, PEAKS), "ns_per_pair": ns_per_pair(result)}
    axis = scaling.axes(1000)["gaussians"]._replace(along=lambda result: float(result["view"]["visible"]))
    grown = {"gaussians": scaling.summary(axis, measured)}
    return {
        suite.STAGES_FILE: {"peaks": [PEAKS], "cases": measured},
        suite.SCALING_FILE: {"axes": grown, "memory": scaling.memory(grown)},
    }


def keys(result) -> object:
    """The names in a result at every depth, without its values; of a list, those of its first entry."""
    if isinstance(result, dict):
        return {name: keys(value) for name, value in result.items()}
    return [keys(result[0])] if isinstance(result, list) and result else None


def test_results_have_the_keys_of_the_committed_ones(results):
    """The pages are made from the committed files: a key that changes has to change there too."""
    committed = {name: json.loads((RESULTS / name).read_text(encoding="utf-8")) for name in results}
    made = suite.dated(results[suite.STAGES_FILE])
    records = [found | {"versions": {}} for found in (made, committed[suite.STAGES_FILE])]  # other libraries are others
    assert keys(records[0]) == keys(records[1])
    grown, known = (found[suite.SCALING_FILE]["axes"]["gaussians"] for found in (results, committed))
    assert keys(grown) == keys(known)


def test_pictures_are_drawn(results, tmp_path):
    charts.stage_bars(results[suite.STAGES_FILE]["cases"], tmp_path / "bars.png")
    charts.scaling_curves(results[suite.SCALING_FILE]["axes"], tmp_path / "curves.svg")
    assert (tmp_path / "bars.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "curves.svg").read_text()


def test_grid_is_every_combination():
    cases = grid(StagesOptions(gaussians=(10, 20), scenes=(Path("a.npz"),), threads=(1, 2)))
    assert len(cases) == 3 * 2 * 2 and len(set(cases)) == 12
    assert [c.scene for c in cases[-4:]] == ["a.npz"] * 4


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["everything"], "allowed: iteration, stages, effects, scaling, peers, start, all"),
        (["stages", "--gaussians", "3"], "--gaussians 3 is not allowed"),
        (["stages", "--plot", "bars.pdf"], "--plot bars.pdf is not allowed; allowed: a file whose name ends in .png"),
        (["scaling", "--largest", "10"], "--largest 10 is not allowed"),
        (["start", "--repeats", "0"], "--repeats 0 is not allowed"),
        (["stages", "--precisions", "float16"], "float16"),
    ],
)
def test_refusals(words, said, capsys):
    assert main(["bench", *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("words", [["stages"], ["all", "--out", "{}/out"]])
def test_wrong_scene_is_refused_before_anything_is_measured(words, tmp_path, monkeypatch, capsys):
    measured = lambda *arguments: pytest.fail("measured before the scenes were looked at")
    monkeypatch.setattr(stages, "apart", measured)
    monkeypatch.setattr(start, "measure_start", measured)
    words = [word.format(tmp_path) for word in words]
    assert main(["bench", *words, "--scenes", str(tmp_path / "none.npz")]) == 2
    assert "none.npz: cannot be read: No such file" in capsys.readouterr().err


def test_peers_without_torch_say_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(peers, "apart", lambda function: "ModuleNotFoundError: No module named 'torch'")
    assert main(["bench", "peers"]) == 2
    said = capsys.readouterr().err
    assert "No module named 'torch'" in said and all(line in said for line in peers.PIP_LINES)


def test_error_beyond_the_limit_is_said():
    case = {"precision": "float64", "errors": {"colour": 1e-12, "position": 2e-9}}
    assert peers.verdict(case) == "2.0e-09 (position), BEYOND 1e-09"
    assert peers.relative_error(np.array([3.0, 4.5]), np.array([3.0, 4.0])) == pytest.approx(0.1)


def test_trained_scene_fills_the_picture(tmp_path):
    rng, file = np.random.default_rng(2), tmp_path / "scene.npz"
    found = {name: rng.uniform(0.1, 0.9, (50, *rest)).astype(np.float32) for name, rest in npz.ARRAYS.items()}
    found["xyz"] *= 30
    np.savez(file, allow_pickle=False, **found)
    scene = trained.trained_gaussians(file, PAPER)
    column = 570 * scene.position[0] / trained.DEPTH
    assert scene.position[2].mean() == pytest.approx(trained.DEPTH, abs=1)
    assert 150 < np.abs(column).max() <= 400 and scene.position.dtype == np.float32
    np.savez(file, allow_pickle=False, **(found | {"rgb": found["rgb"][:7]}))
    with pytest.raises(InputError, match=r"rgb has shape \(7, 3\)"):
        trained.trained_gaussians(file, PAPER)
    np.savez(file, allow_pickle=False, xyz=found["xyz"])
    with pytest.raises(InputError, match=r"scene\.npz: not a trained scene: log_scale is missing; allowed: an npz"):
        trained.trained_gaussians(file, PAPER)
    with pytest.raises(InputError, match=r"none\.npz: cannot be read: No such file"):
        trained.trained_gaussians(tmp_path / "none.npz", PAPER)
