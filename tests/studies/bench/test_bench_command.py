"""The cases of `endotsr bench`; the pictures, tables and refusals of the measurements for docs/bench.md."""

import json
from pathlib import Path

import numpy as np
import pytest
from pages.bench import charts as bench_charts
from pages.bench import page as bench
from pages.bench import peers as bench_peers
from pages.bench import scaling as bench_scaling
from pages.bench import start as bench_start

from endotsr.cli.bench import BenchOptions, cases_of
from endotsr.cli.main import main
from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.results.export import npz
from endotsr.studies.bench import stages
from endotsr.studies.bench.case import DEPTH, BenchCase, measure, trained_gaussians
from endotsr.studies.bench.limits import limits
from endotsr.studies.bench.stages import ns_per_pair
from endotsr.training.runs.machine import dated

PEAKS = {
    "threads": 1,
    "flop_per_second": {"float32": 1e11, "float64": 5e10},
    "bytes_per_second": {"triad": 1e10, "update": 2e10},
}
RESULTS = Path(__file__).parents[3] / "docs" / "results"


@pytest.fixture(scope="module")
def results():
    """What two of the measurements return, at the smallest sizes."""
    small = [BenchCase(gaussians=n, width=48, height=32, repeats=1, threads=1, densifications=1) for n in (60, 30, 90)]
    measured = [measure(case) for case in small]
    for result in measured:
        result |= {"limits": limits(result, PEAKS), "ns_per_pair": ns_per_pair(result)}
    axis = bench_scaling.axes(1000)["gaussians"]._replace(along=lambda result: float(result["view"]["visible"]))
    grown = {"gaussians": bench_scaling.summary(axis, measured)}
    return {
        bench.FILES["stages"]: {"peaks": [PEAKS], "cases": measured},
        bench.FILES["scaling"]: {"axes": grown, "memory": bench_scaling.memory(grown)},
    }


def keys(result) -> object:
    """The names in a result at every depth, without its values; of a list, those of its first entry."""
    if isinstance(result, dict):
        return {name: keys(value) for name, value in result.items()}
    return [keys(result[0])] if isinstance(result, list) and result else None


def test_results_have_the_keys_of_the_committed_ones(results):
    """The pages are made from the committed files: a key that changes has to change there too."""
    committed = {name: json.loads((RESULTS / name).read_text(encoding="utf-8")) for name in results}
    made = dated(results[bench.FILES["stages"]])
    known = committed[bench.FILES["stages"]]
    records = [found | {"versions": {}} for found in (made, known)]  # other libraries are others
    assert keys(records[0]) == keys(records[1])
    grown, known = (found[bench.FILES["scaling"]]["axes"]["gaussians"] for found in (results, committed))
    assert keys(grown) == keys(known)


def test_pictures_are_drawn(results, tmp_path):
    bench_charts.stage_bars(results[bench.FILES["stages"]]["cases"], tmp_path / "bars.png")
    bench_charts.scaling_curves(results[bench.FILES["scaling"]]["axes"], tmp_path / "curves.svg")
    assert (tmp_path / "bars.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "curves.svg").read_text()


def test_cases_are_every_combination():
    """The common workload first, grouped by size, for the command and for the page."""
    chosen = BenchOptions((10, 20), (Path("a.npz"),), ("float32", "float64"), (1, 2))
    for cases, sizes in ((cases_of(chosen), 2), (bench.grid((Path("a.npz"),)), 3)):
        assert len(set(cases)) == len(cases) and {(c.precision, c.threads) for c in cases[:4]} == {
            (precision, threads) for precision in ("float32", "float64") for threads in (1, 2)
        }
        assert len({c.gaussians for c in cases if not c.scene}) == sizes and cases[-1].scene == "a.npz"


@pytest.mark.parametrize("measure", [lambda scene: main(["bench", "--scenes", scene]),
                                     lambda scene: bench.PROGRAM.run(["measure", "--scenes", scene])])  # fmt: skip
def test_wrong_scene_is_refused_before_anything_is_measured(measure, tmp_path, monkeypatch, capsys):
    measured = lambda *arguments: pytest.fail("measured before the scenes were looked at")
    monkeypatch.setattr(stages, "apart", measured)
    monkeypatch.setattr(bench_start, "measure_start", measured)
    try:
        assert measure(str(tmp_path / "none.npz")) == 2
        said = capsys.readouterr().err
    except SystemExit as refusal:
        said = str(refusal)
    assert "none.npz: cannot be read: No such file" in said


def test_an_unknown_measurement_is_refused():
    with pytest.raises(SystemExit, match="'iteration' is not allowed; use one of start, stages, peers,"):
        bench.PROGRAM.run(["measure", "iteration"])


@pytest.mark.parametrize("names", [("peers",), ("peers", "scaling")])
def test_peers_without_torch_say_what_to_install(names, monkeypatch, tmp_path):
    """The last figures stay; it is an error where nothing else is asked for."""
    said: list[str] = []
    monkeypatch.setattr(bench_peers, "apart", lambda function: "ModuleNotFoundError: No module named 'torch'")
    monkeypatch.setattr(bench_scaling, "measure_scaling", lambda *_: {"axes": {}, "memory": {}})
    if len(names) == 1:
        with pytest.raises(InputError) as refusal:
            bench.run_all(tmp_path, names, (), said.append)
        said.append(str(refusal.value))
    else:
        bench.run_all(tmp_path, names, (), said.append)
    assert [path.name for path in tmp_path.iterdir()] == ["scaling.json"] * (len(names) - 1)
    assert "No module named 'torch'" in said[0] and all(line in said[0] for line in bench_peers.PIP_LINES)


def test_error_beyond_the_limit_is_said():
    case = {"precision": "float64", "errors": {"colour": 1e-12, "position": 2e-9}}
    assert bench_peers.verdict(case) == "2.0e-09 (position), BEYOND 1e-09"
    assert bench_peers.relative_error(np.array([3.0, 4.5]), np.array([3.0, 4.0])) == pytest.approx(0.1)


def test_trained_scene_fills_the_picture(tmp_path):
    rng, file = np.random.default_rng(2), tmp_path / "scene.npz"
    found = {name: rng.uniform(0.1, 0.9, (50, *rest)).astype(np.float32) for name, rest in npz.ARRAYS.items()}
    found["xyz"] *= 30
    np.savez(file, allow_pickle=False, **found)
    scene = trained_gaussians(file, PAPER)
    column = 570 * scene.position[0] / DEPTH
    assert scene.position[2].mean() == pytest.approx(DEPTH, abs=1)
    assert 150 < np.abs(column).max() <= 400 and scene.position.dtype == np.float32
    np.savez(file, allow_pickle=False, **(found | {"rgb": found["rgb"][:7]}))
    with pytest.raises(InputError, match=r"rgb has shape \(7, 3\)"):
        trained_gaussians(file, PAPER)
    np.savez(file, allow_pickle=False, xyz=found["xyz"])
    with pytest.raises(InputError, match=r"scene\.npz: not a trained scene: log_scale is missing; use an npz"):
        trained_gaussians(file, PAPER)
    with pytest.raises(InputError, match=r"none\.npz: cannot be read: No such file"):
        trained_gaussians(tmp_path / "none.npz", PAPER)
