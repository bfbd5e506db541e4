"""One scene to the outside: what renders, is measured and is opened is the recording, not its windows."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from small_recording import FRAMES, WANTED, settings, trained, write_recording

import endotsr
from endotsr.errors import InputError
from endotsr.results.evaluation.baselines import two_neighbours
from endotsr.results.evaluation.metrics import image_metrics
from endotsr.results.export.scene import open_scene
from endotsr.studies.windows.make import plan_recording
from endotsr.studies.windows.measure import measure_windows
from endotsr.studies.windows.plan import Wanted
from endotsr.studies.windows.record import Window, WindowsRecord
from endotsr.studies.windows.scene import WindowedScene, WindowFrames, open_any, open_windows


@pytest.fixture(scope="module")
def scene(cold_run):
    return open_windows(cold_run)


@pytest.fixture(scope="module")
def windows(cold_run):
    return [open_scene(cold_run / "windows" / name) for name in ("000", "001")]


def test_the_record_is_that_of_the_recording(scene):
    record = scene.record
    assert record.names == [f"{i:06d}" for i in range(FRAMES)]
    np.testing.assert_allclose(record.times, np.arange(FRAMES) / FRAMES)
    assert record.test_index == list(range(1, FRAMES, 8))
    assert sorted(record.test_index + record.train_index) == list(range(FRAMES))


def test_cameras_that_rest_at_two_places_are_not_one_camera(scene, cold_run, tmp_path):
    """After a cut a mesh would otherwise be that of the first place."""
    run = shutil.copytree(cold_run, tmp_path / "run")
    file = run / "windows" / "001" / "sequence.json"
    record = json.loads(file.read_text(encoding="utf-8"))
    record["cameras"][0]["translation"] = [30.0, 0.0, 0.0]
    file.write_text(json.dumps(record), encoding="utf-8")
    assert scene.record.static_camera and not open_windows(run).record.static_camera


@pytest.mark.parametrize(
    ("frame", "window", "local"), [(5, 0, 5 / 32), (24, 0, 24 / 32), (40, 1, 16 / 32), (55, 1, 31 / 32)]
)
def test_outside_of_an_overlap_the_picture_is_that_of_the_window(scene, windows, frame, window, local):
    camera = scene.cameras[frame]
    shown, alone = scene.render(frame / FRAMES, camera), windows[window].render(local, camera)
    np.testing.assert_array_equal(shown.colour, alone.colour)
    np.testing.assert_array_equal(shown.depth, alone.depth)


@pytest.mark.parametrize("frame", [25, 28.0, 30.5, 31])
def test_in_an_overlap_both_are_blended_linearly_in_time(scene, windows, frame):
    camera, weight = scene.cameras[28], (frame - 24) / 8
    shown = scene.render(frame / FRAMES, camera)
    before, after = windows[0].render(frame / 32, camera), windows[1].render((frame - 24) / 32, camera)
    for name in ("colour", "depth", "opacity"):
        expected = (1 - weight) * getattr(before, name) + weight * getattr(after, name)
        np.testing.assert_allclose(getattr(shown, name), expected, atol=1e-4 if name == "depth" else 1e-6)
    assert np.abs(before.colour - after.colour).max() > 1e-3, "the windows differ, so that a wrong weight is seen"


@pytest.mark.parametrize(("cut", "count"), [(58, 100), (31, 102), (32, 107)])
def test_the_first_frame_after_a_cut_shows_the_window_that_begins_there(cut, count, cold_run):
    """g / G times G is less than g for many frames, and what is before the cut is another scene."""
    both = [Window(name="000", first=0, end=cut, start="cold", begins=""),
            Window(name="001", first=cut, end=count, start="cold", begins="cut")]  # fmt: skip
    plan = WindowsRecord(source="", frames=count, overlap=8, chain=1, windows=both)
    scene = WindowedScene(open_windows(cold_run).record, run=cold_run, plan=plan)
    times = [np.arange(window.count) / window.count for window in both]
    vars(scene).update(_times=times, window=lambda k: SimpleNamespace(at=lambda time, taken_out: (k, time)))
    assert scene.at(cut / count) == (1, 0.0)
    assert scene.at((cut - 1) / count) == (0, (cut - 1) / cut) and scene.at(1.0) == (1, 1.0)


def test_the_scene_is_continuous_where_an_overlap_begins_and_ends(scene):
    for frame in (24, 32):
        a, b = (scene.render((frame + step) / FRAMES, scene.cameras[frame]).colour for step in (-1e-6, 1e-6))
        assert np.abs(a - b).max() < 1e-4


def test_the_last_frame_and_the_end_of_the_recording_are_shown(scene):
    assert [part.window for part in scene.parts(FRAMES)] == [1]
    assert scene.parts(FRAMES)[0].time == 1.0


def test_the_gaussians_of_a_time_are_those_of_the_larger_weight(scene, windows):
    assert scene.at(26 / FRAMES).position.tobytes() == windows[0].at(26 / 32).position.tobytes()
    assert scene.at(30 / FRAMES).position.tobytes() == windows[1].at(6 / 32).position.tobytes()


def test_python_opens_a_run_of_windows_as_a_run(cold_run, scene):
    run = endotsr.open_run(cold_run)
    np.testing.assert_array_equal(run.render(28 / FRAMES).colour, scene.render(28 / FRAMES, scene.cameras[28]).colour)
    assert len(run.windows) == 2 and endotsr.open_run(run.windows[1].path).iteration == 20
    assert run.sequence_record.names[-1] == "000055" and "2 windows, 56 frames" in repr(run)
    with pytest.raises(InputError, match="a number in"):
        run.render(1.5)
    with pytest.raises(InputError, match="from 0 to 55"):
        run.render(0.5, 56)


@pytest.fixture(scope="module")
def metrics(scene):
    return measure_windows(scene, WindowFrames(scene))


def test_every_held_out_frame_is_measured_once_with_the_blended_picture(scene, recording, metrics):
    rows = metrics["held_out"]["per_frame"]
    assert [row["frame"] for row in rows] == list(range(1, FRAMES, 8)) == metrics["frames"]["held_out"]
    whole = endotsr.load_sequence(recording)
    for row in rows:
        g = row["frame"]
        shown = scene.render(g / FRAMES, scene.cameras[g]).colour
        found = image_metrics(shown, whole.images[g] / np.float32(255), whole.masks[g])
        assert row["psnr_tissue"] == pytest.approx(found["psnr_tissue"], abs=1e-6) and row["name"] == f"{g:06d}"
    assert metrics["held_out"]["mean"]["psnr_tissue"] == pytest.approx(np.mean([row["psnr_tissue"] for row in rows]))
    for row in metrics["baselines"]["two_neighbours"]["per_frame"]:
        g = row["frame"]
        found = image_metrics(two_neighbours(whole, g), whole.images[g] / np.float32(255), whole.masks[g])
        assert row["psnr_tissue"] == pytest.approx(found["psnr_tissue"], abs=1e-6)


def test_totals_count_a_frame_of_two_windows_once(metrics, recording):
    whole, frames = endotsr.load_sequence(recording), metrics["frames"]
    assert (frames["total"], frames["training"]) == (FRAMES, len(whole.train_index))
    assert frames["tissue_fraction"] == pytest.approx(whole.tissue_fraction)


def test_training_frames_are_none_that_are_held_out(metrics):
    sample = metrics["frames"]["training_sample"]
    assert len(set(sample)) == len(sample) and not set(sample) & set(metrics["frames"]["held_out"])


def test_each_window_says_what_it_cost(metrics):
    first = metrics["windows"][0]
    assert (first["first"], first["end"], first["start"], first["iterations"], first["saved"]) == (0, 32, "cold", 20, 0)
    assert first["seconds"] > 0 and first["peak_memory_bytes"] > 0 and 5 < first["psnr_tissue"] < 60


def test_flicker_is_larger_at_a_seam_that_jumps(scene, metrics, monkeypatch):
    seams = metrics["seams"]
    assert seams["seam_frames"] + seams["inside_frames"] == FRAMES - 2 and seams["seam_frames"] == 10
    assert 0 < seams["model"]["ratio"] < 5 and 0.5 < seams["recorded"]["ratio"] < 2
    from endotsr.studies.windows import scene as module

    monkeypatch.setattr(module, "blended", lambda renders, weights: renders[int(np.argmax(weights))])
    hard = measure_windows(scene, WindowFrames(scene))["seams"]
    assert hard["model"]["seams"] > 1.05 * seams["model"]["seams"]
    assert hard["model"]["inside"] == pytest.approx(seams["model"]["inside"])


def test_a_time_that_no_window_shows_is_refused_with_the_reason(tmp_path):
    source = write_recording(tmp_path / "source")
    for i in (28, 29, 30):
        (source / "depth" / f"{i:06d}.png").write_bytes(b"")
    trained(source, tmp_path / "run", Wanted(), settings(4))
    scene = open_windows(tmp_path / "run")
    assert len(scene.record.names) == FRAMES - 3
    scene.render(28 / FRAMES, scene.cameras[0])  # one frame behind the last of a window is its end
    with pytest.raises(InputError, match=r"no window covers.*29:30 are left out.*000029\.png"):
        scene.render(29.5 / FRAMES, scene.cameras[0])
    found = measure_windows(scene, WindowFrames(scene))
    assert not {28, 29, 30} & set(found["frames"]["held_out"]) and found["left_out"][0]["first"] == 28


def test_a_run_that_is_not_trained_yet_says_how_to_go_on(recording, tmp_path):
    plan_recording(recording, settings(), WANTED, tmp_path / "my run")
    command = r"`endotsr train --out '/.*/my run' --resume`"
    with pytest.raises(InputError, match=f"000: not trained yet; continue with {command}"):
        open_any(tmp_path / "my run")


def test_commands_take_a_run_of_windows(cold_run, tmp_path, capsys):
    from endotsr.cli.main import main

    film = tmp_path / "film.gif"
    assert main(["render", str(cold_run), "--film", str(film), "--count", "6", "--rate", "5"]) == 0
    assert film.stat().st_size > 0
    assert main(["render", str(cold_run), "--out", str(tmp_path / "views"), "--times", "0.3", "0.5", "0.9"]) == 0
    assert len(json.loads((tmp_path / "views" / "render.json").read_text())["pictures"]) == 3
    assert main(["evaluate", str(cold_run)]) == 0
    said = capsys.readouterr().out
    assert "window 001: frames 24:56, cold" in said and "7 held-out frames" in said and "at seams" in said
    assert json.loads((cold_run / "metrics.json").read_text())["seams"]["seam_frames"] == 10


def test_a_run_of_windows_is_compared_with_the_pictures_of_another_method(cold_run, recording, tmp_path, capsys):
    from endotsr.cli.main import main

    whole = endotsr.load_sequence(recording)
    (tmp_path / "blend").mkdir()
    for i in whole.test_index:
        np.save(tmp_path / "blend" / f"{whole.names[i]}.npy", two_neighbours(whole, int(i)))
    assert main(["evaluate", str(cold_run)]) == 0
    assert main(["evaluate", "--compare", str(cold_run)]) == 0
    words = ["evaluate", f"windows={cold_run}", str(tmp_path / "blend"), "--sequence", str(recording)]
    assert main([*words, "--json", str(tmp_path / "found.json")]) == 0
    assert "differences to windows, frame by frame" in capsys.readouterr().out
    rows = {row["label"]: row for row in json.loads((tmp_path / "found.json").read_text())["rows"]}
    assert rows["blend"]["mean"] == pytest.approx(rows["Blend of the two neighbouring training frames"]["mean"])


def test_one_time_is_exported_and_what_holds_one_set_of_gaussians_is_refused(cold_run, tmp_path, capsys):
    from endotsr.cli.main import main

    assert main(["export", str(cold_run), "--out", str(tmp_path / "a.ply"), "--times", "0.9"]) == 0
    assert (tmp_path / "a.ply").stat().st_size > 10_000
    assert main(["export", str(cold_run), "--out", str(tmp_path / "model.npz")]) == 2
    assert str(cold_run / "windows" / "000") in capsys.readouterr().err
    assert main(["tradeoff", "--run", str(cold_run), "--out", str(tmp_path / "tradeoff")]) == 2
    assert f"use a window, such as {cold_run / 'windows' / '000'}" in capsys.readouterr().err
    assert main(["export", str(cold_run / "windows" / "000"), "--out", str(tmp_path / "model.npz")]) == 0


def test_a_film_shows_truth_and_error_from_the_frames_of_the_windows(cold_run, tmp_path):
    from endotsr.cli.main import main

    film = tmp_path / "film.gif"
    assert main(["render", str(cold_run), "--film", str(film), "--frames", "test", "--panels", "truth", "error"]) == 0
    assert film.stat().st_size > 0


def test_frames_are_those_of_the_recording(scene, recording):
    whole, frames = endotsr.load_sequence(recording), WindowFrames(scene)
    for g in (0, 27, 29, 55):
        found, expected = frames.frame(g), whole.frame(g)
        np.testing.assert_array_equal(found.image, expected.image)
        assert found.time == pytest.approx(expected.time)
