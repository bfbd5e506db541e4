"""SPEC.toml: what it makes, and what is refused in one line."""

import pytest
from tiny_sweep import BASE, CONFIGURATIONS, write_spec

from endotsr.cli.main import main
from endotsr.config import PAPER, SequenceConfig
from endotsr.errors import InputError
from endotsr.studies.sweeps.jobs import jobs_of
from endotsr.studies.sweeps.spec import read_spec, split_name, split_settings

START = """
[configurations."A from base"]
start = { configuration = "base", iteration = 15 }
model = { spectral_motion = false }
"""


def test_a_sequence_that_is_refused_leaves_no_folder(tmp_path, capsys):
    spec = write_spec(tmp_path, BASE.replace("seeds = [0, 1]", 'seeds = [0]\nsplits = ["blocks 8"]') + CONFIGURATIONS)
    assert main(["sweep", str(spec), "--out", str(tmp_path / "out")]) == 2
    assert "no held-out block of 8 frames fits into" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_runs_are_all_combinations_with_their_settings(tmp_path):
    text = BASE.replace("seeds = [0, 1]", 'seeds = [3, 5]\nsplits = ["every_second", "blocks 2"]')
    spec = read_spec(write_spec(tmp_path, text + CONFIGURATIONS + START))
    jobs = jobs_of(spec, tmp_path, lambda job: 8)
    assert len(jobs) == 2 * 2 * 3 == len({job.name for job in jobs})
    assert [job.seed for job in jobs] == [3] * 6 + [5] * 6
    job = next(job for job in jobs if job.name == "simulated-blocks_2-A_from_base-seed5")
    assert (job.config.sequence.split, job.config.sequence.block_length, job.config.training.seed) == ("blocks", 2, 5)
    assert job.config.density.interval == 5 and job.config.training.iterations == 30
    assert job.config.training.residual_activation == 15  # the schedule is stretched before the settings apply
    assert job.config.model.appearance and not job.config.model.spectral_motion
    assert job.start is not None and job.start.config.training.seed == 5
    assert not job.start.config.model.appearance and job.start.config.sequence == job.config.sequence
    assert job.folder == str(tmp_path / "runs" / job.name)


def test_runs_that_begin_alike_name_one_checkpoint(tmp_path):
    more = START.replace("A from base", "L from base")
    jobs = jobs_of(read_spec(write_spec(tmp_path, BASE + CONFIGURATIONS + START + more)), tmp_path, lambda job: 8)
    files = {(job.seed, job.shared_checkpoint) for job in jobs if job.start}
    assert len(files) == 2 and len([job for job in jobs if job.start]) == 4


def test_a_preset_that_follows_the_number_of_frames_gets_its_length(tmp_path):
    text = BASE.replace("iterations = 30", 'preset = "sharp"') + CONFIGURATIONS
    jobs = jobs_of(read_spec(write_spec(tmp_path, text)), tmp_path, lambda job: 100)
    assert {job.config.training.iterations for job in jobs} == {5760}


@pytest.mark.parametrize("split", ["every_eighth", "every_second", "blocks 4", "end 8"])
def test_names_of_splits_read_back(split):
    assert split_name(SequenceConfig(**split_settings(split))) == split
    assert split_name(PAPER.sequence) == "every_eighth"


REFUSED = {
    "no such key": ("colour = 1", "unknown key colour; use one of sequences, seeds"),
    "seeds": ("seeds = [-1]", "seeds = [-1] is not allowed; use a list, each an integer >= 0 and <= "),
    "seed twice": ("seeds = [1, 1]", "seeds: duplicate entry"),
    "no seed": ("seeds = []", " at least 1 of them"),
    "sequence": ('sequences = ["nowhere"]', "sequences = 'nowhere' is not allowed; use a folder, or simulated"),
    "no sequence": ("sequences = []", "sequences = [] is not allowed; use a list, each text, at least 1 of them"),
    "split": (
        'splits = ["blocks"]',
        "splits = 'blocks' is not allowed; use one of every_eighth, every_second, blocks N",
    ),
    "length": ('splits = ["blocks 0"]', "with N >= 1"),
    "no length": ('splits = ["every_second 2"]', "splits = 'every_second 2' is not allowed"),
    "measure": ('measures = ["beauty"]', "measures = 'beauty' is not allowed; use one of depth, flicker, right_view"),
    "preset": ('preset = "best"', "preset = 'best' is not allowed; use one of paper, sharp, quick, demo"),
    "iterations": ("iterations = 0", "iterations = 0 is not allowed; use an integer >= 1 and <= "),
    "switch": ("keep_checkpoints = 1", "keep_checkpoints = 1 is not allowed; use true or false"),
    "simulator": ("simulator.colour = 1", "unknown key simulator.colour"),
    "setting": ("settings.model.apearance = true", "unknown key model.apearance; use one of appearance"),
    "seed in settings": ("settings.training.seed = 5", "training.seed has no effect: seeds sets it in every run"),
    "split twice": (
        'splits = ["blocks 8"]\nsettings.sequence.split = "end"',
        "sequence.split has no effect: splits sets it in every run; use splits alone",
    ),
    "preset in settings": ("settings.preset = { a = 1 }", "settings.preset is not allowed; use preset next to"),
    "long name": ('sequences = ["' + "x" * 5000 + '"]', "is not allowed; use a folder, or simulated"),
    "large seed": ("seeds = [99999999999999999999]", "use a list, each an integer >= 0 and <= "),
    "section": ("settings.model = 3", "model = 3 is not allowed; use a section of settings"),
    "value": ("settings.model.bases = 0", "model.bases = 0 is not allowed; use an integer >= 1"),
    "name": ('configurations."a/b".model.appearance = true', "a/b: the name is not allowed; use letters"),
    "start": ('configurations.A.start = { configuration = "base" }', "start.iteration is missing"),
    "late start": (
        'configurations.A.start = { configuration = "A", iteration = 6000 }',
        "start.iteration: 6000 is not allowed; use an integer >= 1 and <= 5999",
    ),
    "start of another kind": ("configurations.A.start = 3", "start = 3 is not allowed; use a section of settings"),
    "late and negative": (
        'configurations.A.start = { configuration = "A", iteration = -6 }',
        "start.iteration = -6 is not allowed; use an integer >= 1",
    ),
    "no configuration": (
        "configurations = {}",
        "configurations = {} is not allowed; use a table of keys, at least 1",
    ),
    "configuration": ("configurations.A = 3", "configurations.A = 3 is not allowed; use a table of keys"),
    "no such start": ('configurations.A.start = { configuration = "B", iteration = 3 }', "use A"),
    "chain": (
        "[configurations.A]\n[configurations.B]\nstart = { configuration = 'A', iteration = 3 }\n"
        "[configurations.C]\nstart = { configuration = 'B', iteration = 3 }",
        "configurations.C.start: B has its own start",
    ),
    "not TOML": ("seeds = [", "not valid TOML"),
}


@pytest.mark.parametrize("line, said", REFUSED.values(), ids=REFUSED)
def test_mistakes_are_one_line_with_key_and_allowed_values(tmp_path, line, said):
    needed = {"sequences": 'sequences = ["simulated"]', "configurations": "configurations.A = {}"}
    lines = [value for key, value in needed.items() if not line.lstrip("[").startswith(key)]
    if line.startswith("["):
        lines.append(line)
    else:
        lines.insert(0, line)
    file = tmp_path / "SPEC.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_spec(file)
    assert said in str(refused.value) and "\n" not in str(refused.value) and str(file) in str(refused.value)


def test_a_file_that_lacks_a_part_is_told_what_to_write(tmp_path):
    """The remedies of the messages, one after the other, make a sweep of one run."""
    file = tmp_path / "SPEC.toml"
    text = "seeds = [3]\n"
    for key, line in (("sequences", "sequences = ["), ("configurations", "[configurations.base]")):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=f"{key} is missing") as refused:
            read_spec(file)
        assert line in str(refused.value), refused.value
        text += 'sequences = ["simulated"]\n' if line.startswith("s") else f"{line}\n"
    file.write_text(text, encoding="utf-8")
    (only,) = read_spec(file).configurations
    assert only.name == "base" and only.config == PAPER


def test_two_names_that_one_disk_cannot_tell_apart_are_refused(tmp_path):
    text = BASE + "[configurations.a]\n[configurations.A]\n"
    with pytest.raises(InputError, match="two runs have this name"):
        jobs_of(read_spec(write_spec(tmp_path, text)), tmp_path, lambda job: 8)
