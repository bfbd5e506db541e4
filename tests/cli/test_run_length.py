"""The length of a run is exactly what a user gives; only where nobody gives it does it follow the number of frames.

Expected lengths are written out, not computed: `sharp` has 3000 iterations, or 72 for each training frame where these
are more. 55 frames make 3960, and 42 make 3024, the least number of frames that makes a run longer.
"""

import msgspec
import pytest
from tiny import assert_refused, assert_same_run, written_folder

import endotsr
from endotsr.cli.ablate import AblateOptions, spec_data
from endotsr.cli.main import main
from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.cli.train import TrainOptions, of_length
from endotsr.config import (
    PRESETS,
    SHARP,
    Config,
    config_to_toml,
    lengthened,
    load_config,
    with_iterations,
    with_settings,
)
from endotsr.studies.sweeps.jobs import jobs_of
from endotsr.studies.sweeps.spec import read_spec, spec_of
from endotsr.training.runs.folder import open_run

GIVEN = (2999, 3000, 3001, 3960)
FRAMES = (20, 42, 55, 100)
TINY = ("--initialisation.first-frame-points", "150", "--initialisation.other-frame-points", "40", "--threads", "1")


def trained(words: list[str], frames: int) -> Config:
    """The settings that `endotsr train` trains with."""
    line = ["sequence", "--out", "run", *words]
    options = parse(TrainOptions, line, "train", TrainOptions(settings=base_settings(line)[0]))
    return of_length(options.settings, frames, "")[0]


def swept(text: str, folder, frames: int) -> set[int]:
    """The lengths of the runs of a sweep."""
    file = folder / "SPEC.toml"
    file.write_text(f'sequences = ["simulated"]\n{text}')
    return {job.config.training.iterations for job in jobs_of(read_spec(file), folder, lambda job: frames)}


@pytest.mark.parametrize("frames", FRAMES)
@pytest.mark.parametrize("given", GIVEN)
def test_a_given_length_is_kept_through_every_door(given, frames, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(f'preset = "sharp"\n[training]\niterations = {given}\n')
    sharp, length = ["--preset", "sharp"], ["--iterations", str(given)]
    for words in (
        [*sharp, *length],
        [*sharp, "--training.iterations", str(given)],
        [*sharp, *length, "--schedule", "absolute"],
        ["--config", str(file)],
    ):
        assert trained(words, frames).training.iterations == given, words
    for config in (
        endotsr.make_config("sharp", iterations=given),
        endotsr.make_config("sharp", training={"iterations": given}),
        endotsr.make_config(file=file),
        endotsr.make_config(endotsr.make_config("sharp").preset, training={"iterations": given, "seed": 3}),
    ):
        assert lengthened(config, frames).training.iterations == given
    for text in (
        f'preset = "sharp"\niterations = {given}\n[configurations.a]\n',
        f'preset = "sharp"\n[settings.training]\niterations = {given}\n[configurations.a]\n',
        f'preset = "sharp"\n[configurations.a]\niterations = {given}\n',
        f'preset = "sharp"\n[configurations.a.training]\niterations = {given}\n',
    ):
        assert swept(text, tmp_path, frames) == {given}, text
    assert ablated(tmp_path, frames, *length) == {given}


def ablated(folder, frames: int, *words: str) -> set[int]:
    """The lengths of the runs of an ablation of `sharp`."""
    line = ["simulated", "--out", "runs", "--preset", "sharp", "--configurations", "base", "A", *words]
    options = parse(AblateOptions, line, "ablate")
    spec = spec_of(spec_data(options), "ablate", folder)
    return {job.config.training.iterations for job in jobs_of(spec, folder, lambda job: frames)}


@pytest.mark.parametrize(
    "frames, length", [(20, 3000), (42, 3024), (55, 3960), (64, 4608), (65, 4608), (100, 5760), (400, 11520)]
)
def test_a_length_that_nobody_gives_follows_the_number_of_frames(frames, length, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "sharp"\n[training]\nseed = 4\n')
    assert trained(["--preset", "sharp"], frames).training.iterations == length
    assert trained(["--config", str(file)], frames).training.iterations == length
    assert lengthened(endotsr.make_config("sharp", training={"seed": 3}), frames).training.iterations == length
    assert swept('preset = "sharp"\n[configurations.a]\n', tmp_path, frames) == {length}
    assert ablated(tmp_path, frames) == {length}
    assert trained([], frames).training.iterations == 6000  # `paper` has one length
    assert trained(["--preset", "demo"], frames).training.iterations == 1500


@pytest.mark.parametrize("frames, length", [(8, 1600), (55, 1600), (56, 1624), (64, 1856), (136, 2697), (262, 3741)])
def test_a_first_look_makes_29_visits_per_frame(frames, length):
    """136 training frames count as 93, the rounded root of 64 x 136, and 262 as 129."""
    found = trained(["--preset", "quick"], frames)
    assert found.training.iterations == length
    assert found.density.until == round(PRESETS["quick"].density.until * length / 1600)
    assert trained(["--preset", "quick", "--iterations", "1600"], frames).training.iterations == 1600


@pytest.mark.parametrize("frames, length", [(20, 4000), (47, 4700), (55, 5500), (100, 8000)])
def test_where_both_are_given_the_longer_of_the_two_holds(frames, length, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[training]\niterations = 4000\nvisits_per_frame = 100\n")
    stretched = with_iterations(SHARP, 4000)
    for words in (
        ["--preset", "sharp", "--iterations", "4000", "--training.visits-per-frame", "100"],
        ["--preset", "sharp", "--training.iterations", "4000", "--training.visits-per-frame", "100"],
        ["--preset", "sharp", "--config", str(file)],
    ):
        found = trained(words, frames)
        assert (found.training.iterations, found.training.visits_per_frame) == (length, 0), words
        if words[2] == "--iterations":  # the milestones are written for 4000 iterations
            assert found.density.until == round(stretched.density.until * length / 4000)
    given = {"iterations": 4000, "visits_per_frame": 100}
    assert lengthened(endotsr.make_config("sharp", training=given), frames).training.iterations == length


def test_visits_above_64_lengthen_from_a_square_of_frames_on():
    """As in `make_config`: 6000 / 72 is above 64, and (6000 / 72)^2 / 64 is 108.5."""
    config = endotsr.make_config("paper", training={"visits_per_frame": 72})
    assert [lengthened(config, n).training.iterations for n in (84, 108, 109)] == [6000, 6000, 6048]


def test_a_milestone_of_0_becomes_1():
    config = with_settings(PRESETS["paper"], training={"residual_activation": 0})
    assert with_iterations(config, 3000).training.residual_activation == 1


def test_a_later_source_ends_the_visits_of_an_earlier_one(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[training]\nvisits_per_frame = 100\n")
    assert trained(["--config", str(file)], 64).training.iterations == 6400
    assert trained(["--config", str(file), "--iterations", "300"], 64).training.iterations == 300
    assert lengthened(endotsr.make_config(file=file, iterations=300), 64).training.iterations == 300
    file.write_text("[training]\niterations = 300\n")
    assert trained(["--config", str(file), "--training.visits-per-frame", "5"], 64).training.iterations == 320


def test_the_stored_settings_of_a_run_are_of_one_length_and_repeat_it(tmp_path, capsys):
    folder, first, second = written_folder(tmp_path), tmp_path / "first", tmp_path / "second"
    words = ["train", str(folder), "--no-evaluate", *TINY]
    visits = ["--iterations", "10", "--training.visits-per-frame", "2"]
    assert main([*words, *visits, "--out", str(first)]) == 0
    said = capsys.readouterr().out
    assert "schedule: stretched from 10 to 16 iterations, 2 per training frame" in said
    stored = load_config(first / "config.toml")
    assert (stored.training.iterations, stored.training.visits_per_frame) == (16, 0)
    again = ["train", str(folder), "--no-evaluate", "--config", str(first / "config.toml"), "--out", str(second)]
    assert main(again) == 0
    assert_same_run(first, second)
    assert main([*words, *visits, "--out", str(first), "--resume"]) == 0  # the same words ask for the same length
    capsys.readouterr()
    assert_refused(
        capsys, [*words, *visits[:-1], "1", "--out", str(first), "--resume"], "training.iterations = 10 (run: 16)"
    )
    assert main([*words, "--iterations", "18", "--out", str(first), "--resume"]) == 0
    assert load_config(first / "config.toml").training.iterations == 18


def test_a_run_of_an_earlier_version_keeps_its_length(tmp_path):
    """Such a run stored the length beside the visits of its preset, and its checkpoint has them too."""
    folder, out = written_folder(tmp_path), tmp_path / "run"
    words = ["train", str(folder), "--no-evaluate", "--preset", "sharp", "--iterations", "12", *TINY, "--out", str(out)]
    assert main(words) == 0
    stored = load_config(out / "config.toml")
    training = msgspec.structs.replace(stored.training, visits_per_frame=128)
    (out / "config.toml").write_text(config_to_toml(msgspec.structs.replace(stored, training=training)))
    found = open_run(out).config()
    assert (found.training.iterations, found.training.visits_per_frame) == (12, 0)
    assert endotsr.open_run(out).iteration == 12
    assert main([*words, "--resume"]) == 0
    assert main([*words[:-4], "--iterations", "14", "--threads", "1", "--out", str(out), "--resume"]) == 0
    assert endotsr.open_run(out).iteration == 14


def test_what_a_short_run_leaves_out_is_printed(tmp_path, capsys):
    words = [
        "train",
        str(written_folder(tmp_path)),
        "--no-evaluate",
        "--iterations",
        "2",
        "--schedule",
        "absolute",
        *TINY,
    ]
    assert main([*words, "--density.until", "0", "--out", str(tmp_path / "run")]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("not in these 2 iterations: ")]
    assert len(lines) == 4 and lines[0].endswith("the residuals of A and S (training.residual_activation = 3000)")
