"""The Python interface: the same numbers as the command line, stable names, and an import that loads nothing heavy."""

import dataclasses
import errno
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

import endotsr
from endonerf_writer import write_endonerf
from endotsr.cli.main import main
from endotsr.training.runs.files import finite

SIMULATOR = {"width": 48, "height": 32, "frames": 9}
POINTS = {"first_frame_points": 150, "other_frame_points": 40}
HEAVY = ("numpy", "numba", "cv2", "scipy", "matplotlib", "msgspec", "typing")


@pytest.fixture(autouse=True)
def threads_as_before():
    import numba

    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="module")
def sequence():
    return endotsr.load_sequence("simulated", simulator=SIMULATOR)


def test_settings_of_the_simulator_are_refused_for_a_folder(tmp_path):
    with pytest.raises(endotsr.InputError, match=r"simulator with the folder .* is not allowed; use 'simulated'"):
        endotsr.load_sequence(tmp_path, simulator=SIMULATOR)


def tiny(sequence, **more):
    """Eight iterations on one thread."""
    given = {"preset": "demo", "iterations": 8, "initialisation": POINTS, "training": {"threads": 1}, **more}
    return endotsr.train(sequence, **given, on_message=lambda line: None)


@pytest.fixture(scope="module")
def run(sequence):
    return tiny(sequence)


def arrays(run):
    return {k: v.tobytes() for k, v in run.model.gaussians._asdict().items() if v is not None}


def without_seconds(log):
    return [{key: value for key, value in entry.items() if key != "seconds"} for entry in log]


def test_import_is_light():
    code = f"import sys, endotsr; endotsr.InputError; print([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-S", "-c", f"import sys; sys.path[:0] = {sys.path!r}; {code}"],
                          capture_output=True, text=True, timeout=60)  # fmt: skip
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_the_guide_names_every_public_name():
    guide = (Path(__file__).parents[1] / "docs" / "guides" / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `endotsr\.(\w+)` \|", guide, re.MULTILINE))
    assert named == set(endotsr.__all__) - {"__version__", "Run"}, "Run is listed by its methods"


def test_every_public_name_exists_and_is_typed():
    assert set(endotsr.__all__) <= set(dir(endotsr))
    for name in endotsr.__all__:
        assert getattr(endotsr, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'trian'"):
        _ = endotsr.trian
    from importlib.resources import files

    assert (files("endotsr") / "py.typed").is_file()


def test_settings_are_those_of_the_command_line(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "sharp"\n[model]\nbases = 9\nbeta = 0.2\n')
    config = endotsr.make_config(file=file, iterations=3000, model={"beta": 0.1}, training={"seed": 4})
    assert (config.preset, config.model.bases, config.model.beta, config.training.seed) == ("sharp", 9, 0.1, 4)
    assert config.training.residual_activation == 1500, "milestones keep their fraction of the run"
    absolute = endotsr.make_config(training={"iterations": 3000})
    assert (absolute.training.iterations, absolute.training.residual_activation) == (3000, 3000)


@pytest.mark.parametrize(
    "given, named",
    [
        ({"preset": "papper"}, "paper, sharp, quick, demo"),
        ({"modell": {}}, "unknown key modell"),
        ({"model": {"basis": "cubic"}}, "quartic or gaussian"),
        ({"model": {"base": 3}}, "unknown key model.base"),
        ({"model": 3}, "model = 3 is not allowed"),
        ({"iterations": 0}, "an integer >= 1"),
        ({"file": "absent.toml"}, "absent.toml: cannot be read"),
    ],
)
def test_settings_that_cannot_be_used(given, named):
    with pytest.raises(endotsr.InputError, match=named):
        endotsr.make_config(**given)


def test_a_sequence_is_loaded_as_the_command_loads_it(sequence, tmp_path):
    assert sequence.images.shape == (9, 3, 32, 48) and sequence.source == "simulated"
    write_endonerf(sequence, tmp_path / "folder")
    half = endotsr.load_sequence(tmp_path / "folder", scale=0.5, frames="1:8")
    assert half.images.shape == (7, 3, 16, 24) and half.settings.scale == 0.5
    near = endotsr.make_config(raster={"near": 1e6})
    with pytest.raises(endotsr.InputError, match="in front of the near plane"):
        endotsr.load_sequence(tmp_path / "folder", near)


@pytest.mark.parametrize(
    "given, named",
    [
        ({"source": "absent"}, "absent: sequence folder not found"),
        ({"source": "simulated", "scale": 0.0}, "sequence.scale = 0.0 is not allowed"),
        ({"source": "simulated", "size": 2}, "unknown key sequence.size"),
        ({"source": "simulated", "simulator": {"frame": 9}}, "simulator: unknown key frame"),
        ({"source": "simulated", "simulator": {"frames": 2}}, "simulator: frames = 2 is not allowed"),
        ({"source": "arrays in memory"}, "a folder with the same frames"),
    ],
)
def test_sequences_that_cannot_be_loaded(given, named):
    with pytest.raises(endotsr.InputError, match=named):
        endotsr.load_sequence(**given)


@pytest.fixture(scope="module")
def folder(sequence, tmp_path_factory):
    """The simulated sequence as a folder that the commands read."""
    place = tmp_path_factory.mktemp("folder") / "sequence"
    write_endonerf(sequence, place)
    return place


def test_training_is_that_of_the_command(folder, tmp_path):
    run = tiny(endotsr.load_sequence(folder, preset="demo"))
    words = [
        "--preset=demo",
        "--iterations=8",
        "--initialisation.first-frame-points=150",
        "--initialisation.other-frame-points=40",
    ]
    out = tmp_path / "command"
    assert main(["train", str(folder), "--out", str(out), *words, "--threads=1", "--no-evaluate"]) == 0
    commanded = endotsr.open_run(out)
    assert commanded.config == run.config
    assert arrays(commanded) == arrays(run)
    assert without_seconds(commanded.log) == without_seconds(run.log)
    assert commanded.record.keys() == run.record.keys()


def test_depth_outliers_that_the_preset_would_remove_are_said(folder, tmp_path):
    clip = tmp_path / "clip"
    shutil.copytree(folder, clip)
    file = sorted((clip / "depth").iterdir())[4]
    depth = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    depth[:, :8] = 5 * depth.max()
    cv2.imwrite(str(file), depth)
    for preset, count in ((None, 1), ("demo", 0)):
        said = []
        more = {"iterations": 1, "training": {"threads": 1}, "initialisation": POINTS}
        endotsr.train(endotsr.load_sequence(clip, preset=preset), preset="demo", on_message=said.append, **more)
        assert len([line for line in said if "outliers" in line and "preset='demo'" in line]) == count
    with pytest.raises(endotsr.InputError, match="one of the two"):
        endotsr.load_sequence(clip, endotsr.make_config("sharp"), preset="sharp")


def test_the_callback_sees_every_entry_and_its_answer_is_ignored(sequence, run):
    seen = []
    tiny(sequence, on_iteration=lambda entry: seen.append(entry) or True)
    assert [entry["iteration"] for entry in seen] == list(range(1, 9))
    assert without_seconds(seen) == without_seconds(run.log)
    assert all(entry["seconds"] >= 0 and np.isfinite(entry["loss"]) for entry in seen)


def test_the_callback_stops_and_the_run_resumes_to_the_same_bits(sequence, run, tmp_path):
    def stop_at_three(entry):
        if entry["iteration"] == 3:
            raise endotsr.StopTraining

    stopped = tiny(sequence, on_iteration=stop_at_three)
    assert (stopped.iteration, len(stopped.log), stopped.record["status"]) == (3, 3, "interrupted")
    assert repr(stopped).startswith("Run(iteration 3 of 8")
    reopened = endotsr.open_run(stopped.save(tmp_path / "three"))
    for half in (stopped, reopened):
        assert half.resume(on_message=lambda line: None) is half
        assert (half.iteration, half.record["status"]) == (8, "finished")
        assert half.record["resumed"][0]["after_iteration"] == 3
        assert arrays(half) == arrays(run)
        assert without_seconds(half.log) == without_seconds(run.log)


def test_a_finished_run_resumes_without_effect(run, tmp_path):
    """Nor does it need its clip, or write the threads and seconds of a training that did not take place."""
    opened = endotsr.open_run(run.save(tmp_path / "done"), tmp_path / "no clip")
    opened.config = msgspec.structs.replace(
        opened.config, training=msgspec.structs.replace(opened.config.training, threads=2)
    )
    before, said = dict(opened.record), []
    assert opened.resume(on_message=said.append) is opened
    assert opened.record == before and arrays(opened) == arrays(run) and said == []


def test_a_full_disk_ends_a_save_with_an_input_error_and_leaves_nothing(run, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(endotsr.api, "save_training", full)
    with pytest.raises(endotsr.InputError, match=r"mine: the disk is full"):
        run.save(tmp_path / "mine")
    assert not list(tmp_path.iterdir())


def test_a_callback_reaches_the_model_of_each_iteration(sequence, run):
    """What it renders is the scene of that moment and changes no bit of the training."""
    seen = []

    def watch(now):
        view = now.render(0.3)
        seen.append(
            (now.iteration, now.log[-1]["iteration"], now.log[-1]["gaussians"], now.model.gaussians.count, view)
        )
        if now.iteration == 8:
            raise endotsr.StopTraining

    watched = tiny(sequence, on_run=watch)
    assert [entry[:2] for entry in seen] == [(k, k) for k in range(1, 9)]
    assert [entry[2] for entry in seen] == [entry[3] for entry in seen]
    assert arrays(watched) == arrays(run) and without_seconds(watched.log) == without_seconds(run.log)
    assert np.array_equal(seen[-1][4].colour, run.render(0.3).colour)
    assert len({entry[4].colour.tobytes() for entry in seen}) == 8


def test_an_error_of_the_callback_is_raised(sequence):
    with pytest.raises(ZeroDivisionError):
        tiny(sequence, on_iteration=lambda entry: 1 / 0)


def test_what_cannot_be_trained_on(sequence):
    with pytest.raises(endotsr.InputError, match="sequence is str"):
        endotsr.train("my_sequence")  # type: ignore[arg-type]
    with pytest.raises(endotsr.InputError, match="one of the two"):
        endotsr.train(sequence, endotsr.make_config(), preset="sharp")


def test_rendering_at_any_time_and_camera(sequence, run):
    view = run.render(time=0.37)
    assert view.colour.shape == (3, 32, 48) and view.depth.shape == view.opacity.shape == (32, 48)
    frame = run.render(sequence.times[4], 4)
    assert np.array_equal(run.render(4 / 9, np.int64(4)).colour, frame.colour)
    assert np.array_equal(frame.colour, run.render(sequence.times[4], sequence.cameras[4]).colour)
    moved = sequence.cameras[4]._replace(translation=np.array([5.0, 0.0, 0.0]))
    assert not np.array_equal(frame.colour, run.render(sequence.times[4], moved).colour)
    assert 0 <= view.opacity.min() and view.opacity.max() <= 1
    plain = run.render(0.37, without=("appearance", "spectral_motion"))
    assert not np.array_equal(view.colour, plain.colour), "both components contribute"


@pytest.mark.parametrize(
    "given, named",
    [
        ({"time": 1.2}, "a number in"),
        ({"time": float("nan")}, "a number in"),
        ({"time": 0.5, "camera": 9}, "a frame from 0 to 8"),
        ({"time": 0.5, "camera": -1}, "a frame from 0 to 8"),
        ({"time": 0.5, "without": ("laplacian",)}, "appearance or spectral_motion"),
    ],
)
def test_views_that_do_not_exist(run, given, named):
    with pytest.raises(endotsr.InputError, match=named):
        run.render(**given)


def test_a_saved_run_opens_with_the_same_bits_and_the_commands_read_it(run, tmp_path):
    path = run.save(tmp_path / "deep" / "mine")
    opened = endotsr.open_run(path)
    assert arrays(opened) == arrays(run) and opened.config == run.config and opened.log == run.log
    for name in ("colour", "depth", "opacity"):
        a, b = getattr(opened.render(0.37), name), getattr(run.render(0.37), name)
        assert a.tobytes() == b.tobytes(), name
    with pytest.raises(endotsr.InputError, match="already contains a run"):
        run.save(path)
    metrics = run.evaluate()
    assert opened.evaluate() == metrics
    assert metrics["held_out"]["mean"]["psnr_tissue"] > 5 and set(metrics["baselines"])
    assert main(["evaluate", str(path)]) == 0
    written = msgspec.json.decode((path / "metrics.json").read_bytes())
    assert written["held_out"] == msgspec.json.decode(msgspec.json.encode(metrics["held_out"]))


def test_arrays_in_memory_train_and_are_saved(sequence, run, tmp_path):
    plain = dataclasses.replace(sequence, source="arrays in memory", settings=None, simulator=None)
    trained = tiny(plain)
    assert arrays(trained) == arrays(run)
    path = trained.save(tmp_path / "run")
    opened = endotsr.open_run(path)
    assert arrays(opened) == arrays(run)
    with pytest.raises(endotsr.InputError, match="a folder with the same frames"):
        opened.evaluate()


def test_film_view_and_export_are_those_of_the_commands(run, tmp_path):
    """Of a run in memory; the files equal those that the commands make of the saved run."""
    saved = run.save(tmp_path / "run")
    run.film(tmp_path / "a.gif", count=3, camera="sway")
    run.view(tmp_path / "a.html")
    assert str(tmp_path / "a.ply") in run.export(tmp_path / "a.ply", times=(0.25,))
    assert main(["render", str(saved), "--film", str(tmp_path / "b.gif"), "--count", "3", "--camera", "sway"]) == 0
    words = ["export", str(saved), "--out"]
    assert main([*words, str(tmp_path / "b.html"), "--no-held-out", "--title", "a"]) == 0
    assert main([*words, str(tmp_path / "b.ply"), "--times", "0.25"]) == 0
    for ending in ("gif", "html", "ply"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes(), ending
    with pytest.raises(endotsr.InputError, match="not a film"):
        run.film(tmp_path / "a.avi")
    place = {"rotation": np.eye(3).tolist(), "translation": [0, 0, 0]}
    (tmp_path / "path.json").write_text(json.dumps({"cameras": [place, {**place, "width": 20}]}))
    with pytest.raises(endotsr.InputError, match="use one size"):
        run.film(tmp_path / "c.gif", count=2, camera=str(tmp_path / "path.json"))


WRITERS = {
    "a.gif": lambda run, file, **more: run.film(file, count=2, **more),
    "a.html": lambda run, file, **more: run.view(file, **more),
    "a.ply": lambda run, file, **more: run.export(file, times=(0.5,), **more),
    "a.glb": lambda run, file, **more: run.export(file, **more),
    "a.npz": lambda run, file, **more: run.export(file, **more),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_of_the_user_is_replaced_with_permission_alone(name, run, tmp_path):
    file, write = tmp_path / name, WRITERS[name]
    file.write_bytes(b"notes of a user\n")
    said = f"{file}: exists already, and does not show that endotsr wrote it; use another name, or replace=True"
    with pytest.raises(endotsr.InputError, match=f"^{re.escape(said)}$"):
        write(run, file)
    assert file.read_bytes() == b"notes of a user\n" and [path.name for path in tmp_path.iterdir()] == [name]
    write(run, file, replace=True)
    written = file.read_bytes()
    assert write(run, file) and file.read_bytes() == written, "its own file is replaced without a word"


def test_a_page_and_a_folder_of_a_run_are_not_replaced(run, tmp_path):
    saved = run.save(tmp_path / "run")
    page = saved / "report.html"
    page.write_text("a report")
    with pytest.raises(endotsr.InputError, match=r"belongs to the folder of run\.json"):
        run.view(page, replace=True)
    for write in (run.save, run.export):
        with pytest.raises(endotsr.InputError, match="already"):
            write(saved)
    assert page.read_text() == "a report"


def test_runs_that_cannot_be_opened(tmp_path):
    with pytest.raises(endotsr.InputError, match="run folder not found"):
        endotsr.open_run(tmp_path / "absent")


def python_blocks(page):
    text = (Path(__file__).parents[1] / page).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", ["README.md", "docs/guides/python.md"])
def test_the_code_of_the_pages_runs(page, sequence, tmp_path, monkeypatch, capsys):
    """As printed, but for the length of the runs."""
    monkeypatch.chdir(tmp_path)
    write_endonerf(endotsr.load_sequence("simulated", simulator=SIMULATOR | {"height": 48}), Path("my_sequence"))
    code = "\n".join(python_blocks(page))
    assert len(code.splitlines()) >= 8 and "endotsr.load_sequence(" in code
    short = {"training": {"checkpoint_every": 4}, "iterations": 4}
    real = endotsr.api.make_config
    monkeypatch.setattr(endotsr.api, "make_config", lambda *a, **k: real(*a, **(k | short)))
    monkeypatch.setattr(endotsr, "make_config", endotsr.api.make_config)
    found = {}
    exec(compile(code, page, "exec"), found)
    assert found["run"].iteration == 4 and found["view"].depth.shape == (24, 24)
    assert endotsr.open_run("runs/mine").iteration == 4


def test_a_run_in_memory_renders_with_the_exposure_of_its_frames(tmp_path):
    sequence = endotsr.load_sequence("simulated", simulator=SIMULATOR)
    first = {"first_frame_points": 100, "other_frame_points": 0}
    settings = {"model": {"exposure": True}, "optimiser": {"exposure": 0.5}, "initialisation": first}
    run = endotsr.train(sequence, iterations=2, on_message=lambda line: None, **settings)
    again = endotsr.open_run(run.save(tmp_path / "run"))
    assert (run.render(0.3).colour == again.render(0.3).colour).all()


def test_inspect_gives_what_the_command_writes(folder, tmp_path, capsys):
    page = tmp_path / "found.json"
    assert main(["inspect", str(folder), "--json", str(page)]) == 0
    assert json.loads(page.read_text()) == finite(endotsr.inspect(endotsr.load_sequence(folder)))


def test_effects_auto_follows_the_plan_and_given_keys_stay(capsys):
    still = {name: {"on": False} for name in ("breathing", "pulsation", "pull", "exposure", "brightening")}
    loaded = endotsr.load_sequence("simulated", simulator=SIMULATOR | still)
    said = []
    short = {"checkpoint_every": 4}
    run = endotsr.train(
        loaded, iterations=4, effects="auto", on_message=said.append, model={"appearance": True}, training=short
    )
    assert not run.config.model.deformation and run.config.model.appearance
    assert run.record["effects"]["plan"]["changes"] and said[0] == "effects: auto"
    with pytest.raises(endotsr.InputError, match="effects = 'some'"):
        endotsr.train(loaded, effects="some")
