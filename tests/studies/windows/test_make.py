"""Windows trained as runs of their own: equal to runs by hand, resumed, and not ended by one that fails."""

import json

import pytest
from small_recording import WANTED, Heard, here, settings, write_recording

import endotsr
from endotsr.errors import InputError
from endotsr.studies.sweeps.execute import Outcome, execute
from endotsr.studies.windows.make import make_windows, plan_recording, window_folder, window_length
from endotsr.studies.windows.plan import Wanted
from endotsr.studies.windows.record import read_record
from endotsr.training.runs.folder import open_run
from endotsr.training.runs.model import load_model
from endotsr.training.runs.stopping import signals_stop


def positions(run, k):
    return load_model(open_run(window_folder(run, read_record(run).windows[k]))).gaussians.position.tobytes()


def test_a_window_is_a_run_on_its_frames(recording, cold_run):
    import endotsr

    sequence = endotsr.load_sequence(recording, settings(), frames="24:56")
    alone = endotsr.train(sequence, settings(), on_message=lambda line: None)
    assert alone.model.gaussians.position.tobytes() == positions(cold_run, 1)
    record = open_run(cold_run / "windows" / "001").sequence_record()
    assert record.names[0] == "000024" and record.times[0] == 0.0


def test_finished_windows_are_kept_and_the_rest_goes_on_from_its_checkpoint(recording, cold_run, tmp_path):
    run, heard = tmp_path / "run", Heard()
    plan_recording(recording, settings(), WANTED, run)

    def stopped(jobs):
        yield execute(jobs[0], 1)
        left = iter([False] * 6 + [True] * 99)
        outcome = execute(jobs[1], 1, stop=lambda: next(left))
        assert outcome.status == "interrupted"
        raise KeyboardInterrupt

    with signals_stop(), pytest.raises(KeyboardInterrupt, match=r"1 of 2 windows are finished.*--resume"):
        make_windows(run, stopped, heard)
    before = (run / "windows" / "000" / "checkpoint.npz").stat().st_mtime_ns
    made = []
    make_windows(run, lambda jobs: (made.extend(jobs), here(jobs))[1], heard)
    assert [job.name for job in made] == ["001"]
    assert (run / "windows" / "000" / "checkpoint.npz").stat().st_mtime_ns == before
    assert json.loads((run / "windows" / "001" / "run.json").read_text())["resumed"][0]["after_iteration"] > 0
    assert [positions(run, k) for k in (0, 1)] == [positions(cold_run, k) for k in (0, 1)]


def test_a_window_that_fails_is_named_and_a_warm_one_behind_it_starts_cold(recording, cold_run, tmp_path):
    run, heard = tmp_path / "run", Heard()
    plan_recording(recording, settings(), Wanted(32, 8, 2), run)

    def failing(jobs):
        for job in jobs:
            yield Outcome("000", "failed", "no luck") if job.name == "000" else execute(job, 1)

    outcomes = make_windows(run, failing, heard)
    assert [outcome.status for outcome in outcomes] == ["failed", "finished"]
    assert any("window 000 (frames 0:32): failed: no luck" in line for line in heard.lines)
    assert any("window 001: window 000 is not finished; starting cold" in line for line in heard.lines)
    assert positions(run, 1) == positions(cold_run, 1)
    made = []
    outcomes = make_windows(run, lambda jobs: (made.extend(jobs), here(jobs))[1], heard)
    assert [job.name for job in made] == ["000"], "the window that started cold is finished, and stays as it is"
    assert [outcome.status for outcome in outcomes] == ["finished"] * 2


def test_a_window_is_named_by_the_frames_of_the_plan(recording, tmp_path):
    """Not by those of the folder: with `--frames 4:56:2` the recording has 26 frames."""
    run, heard = tmp_path / "run", Heard()
    plan_recording(recording, settings(sequence={"frames": "4:56:2"}), Wanted(), run)
    make_windows(run, lambda jobs: (Outcome(job.name, "failed", "no luck") for job in jobs), heard)
    assert heard.lines == ["window 000 (frames 0:26): failed: no luck"]


def test_a_recording_without_a_window_is_refused(tmp_path):
    source = write_recording(tmp_path / "source")
    for i in range(5, 56, 10):
        (source / "images" / f"{i:06d}.png").write_bytes(b"")
    with pytest.raises(InputError, match="no window remains"):
        plan_recording(source, settings(), Wanted(), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_folder_that_holds_something_is_not_overwritten(recording, cold_run):
    with pytest.raises(InputError, match="exists already"):
        plan_recording(recording, settings(), WANTED, cold_run)


@pytest.mark.parametrize("preset, visits, frames, length", [
    ("demo", 36, 84, 3024), ("demo", 36, 20, 1500), ("sharp", 128, 84, 9344), ("demo", 5, 400, 2000),
    ("demo", 0, 84, 1500),
])  # fmt: skip
def test_a_window_of_many_frames_has_its_least_iterations_per_frame(preset, visits, frames, length):
    """Also beyond 64 frames, where the length of a clip grows more slowly; given visits and lengths are kept."""
    config = endotsr.make_config(preset, training={"visits_per_frame": visits})
    assert window_length(config, frames).training.iterations == length
