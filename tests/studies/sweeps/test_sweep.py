"""A sweep in one process: what is run, kept, refused and written; with runs that are made here, or made up."""

import csv
import errno
import json
import os
import shutil
from types import SimpleNamespace

import pytest
from tiny_sweep import BASE, CONFIGURATIONS, assert_same_arrays, iterations, rows_of, write_spec

from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.studies.sweeps import cluster, jobs, local
from endotsr.studies.sweeps.execute import FAILED, FINISHED, INTERRUPTED, Outcome, execute
from endotsr.studies.sweeps.jobs import finished_folder, jobs_of
from endotsr.studies.sweeps.locks import file_lock, run_lock
from endotsr.studies.sweeps.results import results_markdown
from endotsr.studies.sweeps.spec import read_spec
from endotsr.studies.sweeps.sweep import Inputs, planned, run_sweep
from endotsr.training.runs.folder import open_run
from endotsr.training.runs.sources import load_sequence
from synthetic_folder import write_synthetic_folder

pytestmark = pytest.mark.slow

ONE = BASE.replace("seeds = [0, 1]", "seeds = [0]")
START = '[configurations."A from base"]\nstart = { configuration = "base", iteration = 15 }\ndensity = { until = 0 }\n'


class Told:
    """A reporter that keeps what it is told."""

    def __init__(self):
        self.lines, self.total, self.done = [], 0, 0

    def begin(self, steps):
        self.total = steps

    def step(self, count=1):
        self.done += count

    def say(self, message):
        self.lines.append(message)


def sweep(spec, out, make=lambda job: execute(job, 1), told=None, **options):
    """The sweep in this process; `make` makes one run."""
    made = lambda jobs: (make(job) for job in jobs)
    return run_sweep(read_spec(spec), out, made, told or Told(), inputs=Inputs(keep=False), **options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Three configurations of one seed, trained."""
    folder = tmp_path_factory.mktemp("sweep")
    spec, told = write_spec(folder, ONE + CONFIGURATIONS + START), Told()
    rows = sweep(spec, folder / "out", told=told)
    return spec, folder / "out", rows, told


def test_every_run_is_trained_measured_and_told(whole):
    _, out, rows, told = whole
    assert [row["configuration"] for row in rows] == ["base", "A", "A from base"]
    assert {row["status"] for row in rows} == {FINISHED}
    assert told.total == told.done == 90
    for row in rows:
        metrics = json.loads((out / "runs" / row["name"] / "metrics.json").read_text())
        assert row["psnr_tissue"] == metrics["held_out"]["mean"]["psnr_tissue"]
        assert row["training_psnr_tissue"] == metrics["training"]["mean"]["psnr_tissue"]
        assert row["cross_fade_psnr_tissue"] == metrics["cross_fade"]["mean"]["psnr_tissue"]
        assert row["baselines"]["two_neighbours"]["mean"] == metrics["baselines"]["two_neighbours"]["mean"]


def test_the_table_has_three_forms_with_the_same_numbers(whole):
    _, out, rows, _ = whole
    stored = rows_of(out)
    assert list(stored) == [row["name"] for row in rows]
    with (out / "results.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [float(line["psnr_full"]) for line in lines] == [row["psnr_full"] for row in stored.values()]
    text = (out / "results.md").read_text()
    assert text.startswith("3 of 3 runs finished, 0 failed.") and all(f"| {r['configuration']} |" in text for r in rows)


def test_a_bar_in_the_name_of_a_clip_begins_no_cell():
    row = {"name": "x", "sequence": "a|b", "split": "every_eighth", "configuration": "A", "seed": 0, "psnr_full": 30.0}
    assert results_markdown([row | {"status": FINISHED}]).splitlines()[-1].startswith("| a\\|b | every_eighth | A |")


def test_a_run_with_a_start_begins_with_that_state_and_keeps_its_gaussians(whole):
    _, out, rows, _ = whole
    run = open_run(out / "runs" / rows[2]["name"])
    assert iterations(run.path) == list(range(16, 31))
    counts = {json.loads(line)["gaussians"] for line in run.log.read_text().splitlines()}
    assert counts == {rows[2]["gaussians"]}
    assert run.record()["start"] == {"configuration": "base", "iteration": 15}


def test_the_start_is_the_other_configuration_at_that_iteration(whole, tmp_path):
    """Continued as it is, without another setting, the start gives the whole run of that configuration, bit for bit."""
    text = ONE + CONFIGURATIONS + '[configurations.again]\nstart = { configuration = "base", iteration = 15 }\n'
    text += "model = { appearance = false, spectral_motion = false, laplacian = false }\n"
    rows = sweep(write_spec(tmp_path, text), tmp_path / "out", make=lambda job: _only(job, "again"))
    assert_same_arrays(tmp_path / "out" / "runs" / rows[2]["name"], whole[1] / "runs" / whole[2][0]["name"])


def _only(job, configuration):
    return execute(job, 1) if job.configuration == configuration else Outcome(job.name, INTERRUPTED)


def test_what_is_finished_is_not_run_again(whole):
    spec, out, rows, _ = whole
    again = sweep(spec, out, make=lambda job: pytest.fail(f"made {job.name} again"))
    assert [row["psnr_full"] for row in again] == [row["psnr_full"] for row in rows]


def test_measurements_that_finished_runs_lack_are_named(whole, capsys):
    """New `measures` do not apply to finished runs; the command that adds them is printed."""
    spec, out, rows, _ = whole
    other, told = spec.parent / "measured.toml", Told()
    other.write_text('measures = ["depth"]\n' + spec.read_text())
    sweep(other, out, make=lambda job: pytest.fail(f"made {job.name} again"), told=told)
    assert told.lines[0] == "depth: 3 of the finished runs are without it; a finished run is not measured again"
    assert f"endotsr evaluate {out}/runs/{rows[0]['name']} --measures depth; then the same command" in told.lines[1]
    assert len(told.lines) == 2
    assert main(["sweep", str(other), "--out", str(out), "--dry-run"]) == 0
    assert told.lines[1] in capsys.readouterr().out


def test_a_measurement_is_added_to_a_finished_run_as_the_sweep_says(whole, tmp_path):
    spec, out, rows, _ = whole
    shutil.copytree(out, tmp_path / "out")
    other, told = tmp_path / "measured.toml", Told()
    other.write_text('measures = ["depth"]\n' + spec.read_text())
    for row in rows:
        assert main(["evaluate", str(tmp_path / "out/runs" / row["name"]), "--measures", "depth"]) == 0
    again = sweep(other, tmp_path / "out", make=lambda job: pytest.fail(f"made {job.name} again"), told=told)
    assert told.lines == [] and all("depth" in row["measures"] for row in again)


def test_runs_without_checkpoints_cannot_be_measured_again(whole, tmp_path):
    spec, out, _, _ = whole
    shutil.copytree(out, tmp_path / "out")
    for file in (tmp_path / "out").glob("runs/*/checkpoint*.npz"):
        file.unlink()
    other, told = tmp_path / "measured.toml", Told()
    other.write_text('measures = ["depth"]\n' + spec.read_text())
    sweep(other, tmp_path / "out", make=lambda job: pytest.fail(f"made {job.name} again"), told=told)
    assert "their checkpoints are not kept: delete the folders of these runs" in told.lines[1]


def test_a_run_that_was_killed_before_its_last_record_is_finished_without_training(whole, tmp_path):
    """The last checkpoint is there, run.json still says running, and metrics.json is that of an earlier checkpoint."""
    spec, out, rows, _ = whole
    shutil.copytree(out, tmp_path / "out")
    run = open_run(tmp_path / "out" / "runs" / rows[1]["name"])
    metrics = json.loads((run.path / "metrics.json").read_text())
    metrics["run"]["iteration"] = 21
    metrics["held_out"]["mean"]["psnr_tissue"] = 1.0
    (run.path / "metrics.json").write_text(json.dumps(metrics))
    run.update({"status": "running"})
    made = []

    def make(job):
        made.append(job.name)
        return execute(job, 1)

    again = sweep(spec, tmp_path / "out", make)
    assert made == [rows[1]["name"]] and again[1]["psnr_tissue"] == rows[1]["psnr_tissue"]
    assert run.record()["status"] == FINISHED and iterations(run.path) == list(range(1, 31))


def test_a_run_that_was_stopped_before_its_report_is_measured_again(tmp_path, monkeypatch):
    def stopped(data):
        raise KeyboardInterrupt

    job = first_job(tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr("endotsr.results.report.run_files.report_html", stopped)
        assert execute(job, 1).status == INTERRUPTED and finished_folder(job) is None
    assert execute(job, 1).status == FINISHED and (finished_folder(job).path / "report.html").is_file()


@pytest.mark.parametrize(
    "before, after, said",
    [
        ("other_frame_points = 40", "other_frame_points = 41", "other_frame_points = 40, but the sweep has 41"),
        ("height = 32", "height = 40", "simulator.height = 32, but the sweep has 40"),
        ("iteration = 15", "iteration = 12", "start.iteration = 15, but the sweep has 12"),
    ],
)
def test_a_finished_run_of_other_settings_is_refused(whole, before, after, said):
    spec, out, _, _ = whole
    other = spec.parent / "other.toml"
    other.write_text(spec.read_text().replace(before, after))
    with pytest.raises(InputError, match=rf"{said}; use .* another --out"):
        sweep(other, out)


def test_finished_runs_of_other_frames_are_refused(tmp_path, monkeypatch):
    """Files that changed without a change of any array, such as a comment in sequence.toml, are no other frames."""
    clip, spec = tmp_path / "clip", write_spec(tmp_path, ONE + CONFIGURATIONS, sequences='["clip"]')
    spec.write_text(spec.read_text().replace("[simulator]\nwidth = 48\nheight = 32\nframes = 9\n", ""))
    write_synthetic_folder(clip, frames=9)
    rows = sweep(spec, tmp_path / "out")
    monkeypatch.setattr("endotsr.clips.sequences.read.file_hashes", lambda path, config: {"other": ""})
    loaded = []
    with monkeypatch.context() as patched:
        patched.setattr(jobs, "load_sequence", lambda *words: loaded.append(words) or load_sequence(*words))
        again = sweep(spec, tmp_path / "out", make=lambda job: pytest.fail(f"made {job.name} again"))
    assert [row["psnr_full"] for row in again] == [row["psnr_full"] for row in rows] and len(loaded) == 1
    picture = sorted((clip / "images").iterdir())[3]
    picture.write_bytes(sorted((clip / "images").iterdir())[4].read_bytes())
    with pytest.raises(InputError, match=r"clip: images differ from those the run .*base-seed0 was trained on"):
        sweep(spec, tmp_path / "out")


def test_a_sweep_that_runs_already_is_refused(whole):
    spec, out, _, _ = whole
    with file_lock(out / "sweep.lock"), pytest.raises(InputError, match="another process runs this sweep"):
        sweep(spec, out)


def test_a_failed_run_is_named_kept_out_and_retried_on_request(tmp_path):
    spec, out, made = write_spec(tmp_path, ONE + CONFIGURATIONS), tmp_path / "out", []

    def make(job):
        made.append(job.configuration)
        return (
            Outcome(job.name, FAILED, "no luck | today") if job.configuration == "A" else Outcome(job.name, INTERRUPTED)
        )

    rows = sweep(spec, out, make)
    assert made == ["base", "A"] and [row["status"] for row in rows] == ["open", FAILED]
    assert "no luck \\| today" in (out / "results.md").read_text()
    told = Told()
    sweep(spec, out, make, told)
    assert made == ["base", "A", "base"] and "no luck" in told.lines[0]
    sweep(spec, out, make, retry=True)
    assert made == ["base", "A", "base", "base", "A"]


def first_job(folder):
    return jobs_of(read_spec(write_spec(folder)), folder, lambda job: 8)[0]


def test_a_full_disk_ends_the_sweep_in_one_line(tmp_path, monkeypatch):
    def full(folder, *others):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))

    monkeypatch.setattr("endotsr.training.runs.training.train_new_run", full)
    made = []

    def make(job):
        made.append(job)
        return execute(job, 1)

    with pytest.raises(InputError) as refused:
        sweep(write_spec(tmp_path), tmp_path / "out", make)
    assert len(made) == 1
    assert str(refused.value).endswith("the disk is full; 0 of 4 runs are finished; the same command continues")


def test_a_full_disk_behind_the_error_of_a_training_is_seen(tmp_path, monkeypatch):
    def stopped(*arguments):
        try:
            raise OSError(errno.ENOSPC, "full")
        except OSError:
            raise InputError("run stopped") from None

    monkeypatch.setattr("endotsr.training.runs.training.train_new_run", stopped)
    assert execute(first_job(tmp_path), 1).ends_sweep


@pytest.mark.parametrize(
    "error, said",
    [(MemoryError(), "not enough memory"), (FloatingPointError("iteration 3"), "iteration 3"),
     (RuntimeError("two\nlines"), "RuntimeError: two lines")],
)  # fmt: skip
def test_errors_are_outcomes_of_one_line(tmp_path, monkeypatch, error, said):
    def fails(*arguments):
        raise error

    monkeypatch.setattr("endotsr.training.runs.training.train_new_run", fails)
    outcome = execute(first_job(tmp_path), 1)
    assert outcome.status == FAILED and said in outcome.reason and "\n" not in outcome.reason
    assert not outcome.ends_sweep


@pytest.mark.parametrize("module", [local, cluster])
def test_an_error_of_a_worker_is_one_line_even_without_words(module):
    errors = ((AssertionError(), "AssertionError:"), (RuntimeError("two\nlines"), "RuntimeError: two lines"))
    for error, said in errors:
        future = SimpleNamespace(status="error", exception=lambda error=error: error)
        assert module._outcome(SimpleNamespace(name="run"), future) == Outcome("run", FAILED, said)


def test_the_lock_of_a_run_is_waited_for_as_long_as_its_log_grows(whole):
    _, out, rows, _ = whole
    run = open_run(out / "runs" / rows[0]["name"])
    with run.locked(), pytest.raises(InputError, match="another process trains this run"), run_lock(run, patience=0.6):
        pytest.fail("two processes hold one run")
    with run_lock(run):
        pass


def test_a_plan_lists_what_is_left(whole, capsys):
    spec, out, _, _ = whole
    plan = planned(read_spec(spec), out, Inputs(keep=False), retry=False)
    assert plan.left == [] and len(plan.jobs) == 3
    assert main(["sweep", str(spec), "--out", str(out), "--dry-run"]) == 0
    assert capsys.readouterr().out.count(FINISHED) == 3


def test_a_dry_run_with_retry_lists_a_failed_run_as_one_to_execute(tmp_path, capsys):
    spec, out = write_spec(tmp_path), tmp_path / "out"
    name = planned(read_spec(spec), out, Inputs(keep=False), retry=False).jobs[0].name
    out.mkdir()
    row = {"name": name, "status": FAILED, "reason": "no memory"}
    (out / "results.json").write_text(json.dumps({"format": 1, "rows": [row]}))
    for words, count in (([], 1), (["--retry"], 0)):
        assert main(["sweep", str(spec), "--out", str(out), "--dry-run", *words]) == 0
        assert capsys.readouterr().out.count(FAILED) == count


@pytest.mark.parametrize(
    "words, said",
    [(["--out"], "--out: missing value"), ([], "missing: --out DIR"),
     (["--out", "x", "--workers", "0"], "--workers 0"),
     (["--out", "x", "--workers", "2", "--scheduler", "tcp://a:1"], "--workers with --scheduler")],
)  # fmt: skip
def test_options_that_are_wrong_are_one_line(tmp_path, capsys, words, said):
    assert main(["sweep", str(write_spec(tmp_path)), *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
