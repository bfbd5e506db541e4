"""Where a setting comes from, and what is said when it cannot be used."""

import msgspec
import pytest
from tiny import assert_refused

from endotsr.cli.check import CheckOptions
from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.cli.train import TrainOptions
from endotsr.config import PAPER, SHARP, Config, config_from_dict, load_config, with_iterations
from endotsr.errors import InputError
from endotsr.training.fitting.schedules import densify_now


def settings(*words: str) -> Config:
    """The settings that `endotsr train` ends up with."""
    line = ["sequence", "--out", "run", *words]
    base, _ = base_settings(line)
    return parse(TrainOptions, line, "train", TrainOptions(settings=base)).settings


def test_defaults_are_the_paper_preset():
    assert settings() == PAPER


def test_order_preset_file_command_line(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "sharp"\n[model]\nbeta = 0.4\ninitial_width = 0.02\n[loss]\nssim_weight = 0.3\n')
    config = settings("--config", str(file), "--model.beta", "0.5")
    assert config.model.beta == 0.5  # command line over file
    assert config.model.initial_width == 0.02  # file over preset
    assert config.loss.ssim_weight == 0.3
    assert config.loss.lambda_lap == SHARP.loss.lambda_lap  # preset over default
    assert config.preset == "sharp"


def test_preset_of_the_command_line_wins_over_that_of_the_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "sharp"\n[model]\nbeta = 0.4\n')
    config = settings("--config", str(file), "--preset", "paper")
    assert config.preset == "paper" and config.model.beta == 0.4
    assert config.model.initial_width == PAPER.model.initial_width


def test_iterations_stretch_the_schedule():
    config = settings("--iterations", "600")
    assert (config.training.iterations, config.training.residual_activation) == (600, 300)
    assert (config.loss.laplacian_from, config.loss.laplacian_full, config.density.until) == (100, 250, 400)


def test_absolute_schedule_keeps_milestones():
    config = settings("--iterations", "600", "--schedule", "absolute")
    assert config.training.iterations == 600
    assert config.loss == PAPER.loss and config.density == PAPER.density


def test_named_milestone_is_not_stretched():
    config = settings("--iterations", "600", "--training.residual-activation", "250")
    assert config.training.residual_activation == 250


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--model.appearance", "false"), False),
        (("--model.appearance=False",), False),
        (("--model.no-appearance",), False),
        (("--model.appearance",), True),
        (("--model.appearance", "true"), True),
    ],
)
def test_a_switch_reads_as_in_toml_or_as_a_flag(words, expected):
    assert settings(*words).model.appearance is expected


def test_short_names_are_settings():
    config = settings("--seed", "5", "--scale", "0.5")
    assert (config.training.seed, config.sequence.scale) == (5, 0.5)


def test_a_check_takes_the_short_names_of_a_training():
    """`check SEQUENCE --scale 0.5` is what a user types before `train SEQUENCE --scale 0.5`."""
    words = ["clip", "--scale", "0.5", "--frames", "0:9", "--masks", "none", "--threads", "1"]
    found = parse(CheckOptions, words, "check").settings
    assert (found.sequence.scale, found.sequence.frames, found.sequence.masks) == (0.5, "0:9", "none")
    assert found.training.threads == 1


def test_number_or_word():
    assert settings("--loss.lambda-lap", "auto").loss.lambda_lap == "auto"
    assert settings("--loss.lambda_lap", "0.5").loss.lambda_lap == 0.5


BAD = [
    (["--model.basis", "cubic"], ["model.basis", "'cubic'", "quartic or gaussian"]),
    (["--model.betta", "1"], ["unknown key model.betta", "beta"]),
    (["--modle.beta", "1"], ["unknown key modle", "model"]),
    (["--model.beta", "x"], ["model.beta", "'x'", "a number > 0"]),
    (["--model.beta", "-1"], ["model.beta", "-1", "a number > 0"]),
    (["--model.beta", "nan"], ["model.beta", "nan", "finite"]),
    (["--loss.lambda-lap", "much"], ["loss.lambda_lap", "'much'", "a number >= 0 or auto"]),
    (["--loss.ssim-weight", "1.5"], ["loss.ssim_weight", "1.5", "<= 1"]),
    (["--training.seed", "1.5"], ["training.seed", "'1.5'", "an integer >= 0"]),
    (["--seed", "-1"], ["training.seed", "-1", "an integer >= 0"]),
    (["--masks", "tools"], ["sequence.masks", "'tools'", "masks, gt_masks"]),
    (["--schedule", "short"], ["--schedule", "'short'", "absolute"]),
    (["--iterations", "0"], ["--iterations", "0", ">= 1"]),
    (["--iterations", "many"], ["--iterations", "many"]),
    (["--config", "nowhere.toml"], ["nowhere.toml", "cannot be read"]),
    (["--simulator.width", "48"], ["unknown key simulator", "sequence, model"]),
    (["--model.frequency-max", "0.5"], ["model.frequency_max", "model.frequency_min"]),
    (["--density.until", "200"], ["density.until = 200", "density.start = 500", "or 0"]),
    (["--raster.alpha-max", "0.1", "--raster.alpha-cutoff", "0.2"], ["raster.alpha_max = 0.1", "alpha_cutoff = 0.2"]),
    (["--minutes", "5", "--density.maximum", "900"], ["--minutes with --density.maximum", "use one of them"]),
    (["--minutes", "5", "--training.no-coarse-start"], ["--minutes with --training.no-coarse-start"]),
    (["--optimiser.beta1", "1"], ["optimiser.beta1 = 1", "a number >= 0 and < 1"]),
    (["--optimiser.epsilon", "1e-46"], ["optimiser.epsilon = 1e-46", "a number >= 1e-37"]),
    (["--optimiser.beta2", "1.0"], ["optimiser.beta2 = 1.0", "a number >= 0 and < 1"]),
]


@pytest.mark.parametrize(("words", "named"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_unusable_setting_is_one_line(words, named, tmp_path, capsys):
    out = tmp_path / "run"
    assert_refused(capsys, ["train", "simulated", "--out", str(out), *words], *named)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--frame", "0:5"], "--frame: no such option; did you mean --frames?"),
        (["--iteration", "10"], "--iteration: no such option; did you mean --iterations?"),
        (["--scal", "0.5"], "--scal: no such option; did you mean --scale?"),
        (["--scal=0.5"], "--scal: no such option; did you mean --scale?"),
        (["--ou", "y2"], "--ou: no such option; did you mean --out?"),
        (["--excluded-value", "black"], "--excluded-value: no such option; did you mean --sequence.excluded-value?"),
        (["--resum"], "--resum: no such option; did you mean --resume?"),
        (["--epochs", "9"], "--epochs: no such option; did you mean --iterations?"),
        (["--model_path", "y2"], "--model-path: no such option; did you mean --out?"),
        (["-s", "clip"], "-s: no such option; write SEQUENCE without an option: `endotsr train SEQUENCE`"),
        (["--device", "cuda"], "--device: no such option; the computation is on the CPU; --threads states how many"),
        (["--fps", "9"], "--fps: no such option; `endotsr train --help` lists the options"),  # train has no such rate
        (["--frobnicate"], "--frobnicate: no such option; `endotsr train --help` lists the options"),
        (
            ["\N{EM DASH}scale", "0.5"],
            "\N{EM DASH}scale: begins with a dash in place of two hyphens; did you mean --scale?",
        ),
        (["\N{EN DASH}seed=2"], "\N{EN DASH}seed=2: begins with a dash in place of two hyphens; did you mean --seed?"),
        (["again"], "'again': unexpected argument; `endotsr train --help` lists the options"),
    ],
)
def test_a_mistyped_option_is_named_with_the_one_that_was_meant(words, said, tmp_path, capsys):
    assert_refused(capsys, ["train", "simulated", "--out", str(tmp_path / "run"), *words], f"error: {said}\n")
    assert list(tmp_path.iterdir()) == []


PRESETS_ALLOWED = "is not allowed; use one of paper, sharp, quick, demo\n"


@pytest.mark.parametrize(
    ("line", "said"),
    [  # choices are listed in their order and without None
        ("train simulated --preset fast", f"--preset 'fast' {PRESETS_ALLOWED}"),
        ("train simulated --preset None", f"--preset 'None' {PRESETS_ALLOWED}"),
        (
            "render run --frames x --out y",
            "--frames 'x' is not allowed; use one of test, train, all; the view of one frame is --camera",
        ),
        ("render run --frames 12 --out y", "the view of one frame is --camera FRAME"),
        ("train simulated --out=", "--out '' is not allowed; use a path"),
        # a mistyped option is named before the words that are missing
        ("tradeoff .", "'.': unexpected argument; if the result goes there: --out .; `endotsr"),  # takes no path
        ("train simulated .", "'.': a second path; give one, such as the folder"),
        ("train simulated runs/a", "'runs/a': unexpected argument; if the result goes there: --out runs/a; `endotsr"),
        ("simulate breathing --size 96x80", "--size: no such option; use --width and --height\n"),
        ("render --ot x", "--ot: no such option; did you mean --out?"),
        ("render run --out x --model.beta 1", "--model.beta: no such option"),
        ("demo --ou x", "--ou: no such option; did you mean --out?"),
        ("train simulated", "--out"),
        ("train --out run", "SEQUENCE"),
        ("render", "missing: SCENE"),
        ("render run", "--out DIR or --film FILE is missing"),
        ("demo", "demo: --out RUN is missing"),
    ],
)
def test_a_word_that_is_wrong_or_missing_is_named(line, said, capsys):
    assert_refused(capsys, line.split(), said)


@pytest.mark.parametrize("command", ["render", "ablate"])
def test_help_lists_no_choice_called_none(command, capsys):
    from endotsr.cli.main import main

    assert main([command, "--help"]) == 0
    assert "None," not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[model]\nbetta = 1\n", ["unknown key model.betta", "use one of appearance", "did you mean beta?"]),
        ("[model]\nbeta = 'x'\n", ["model.beta", "'x'", "a number > 0"]),
        ("[model]\nbasis = 'cubic'\n", ["model.basis", "'cubic'", "quartic or gaussian"]),
        ("[training]\nseed = true\n", ["training.seed", "True", "an integer >= 0"]),
        ("[sequence]\ndepth_percentiles = [99, 1]\n", ["sequence.depth_percentiles", "low < 50 < high"]),
        ("[sequence]\ndepth_percentiles = [0.03, 0.998]\n", ["sequence.depth_percentiles", "percent"]),
        ("[training]\nseed = 9007199254740992\n", ["training.seed", "an integer from 0 to 9007199254740991"]),
        ("[loss]\nlambda_lap = inf\n", ["loss.lambda_lap", "finite"]),
        ("model = 3\n", ["model", "a section of settings"]),
        ("preset = 'fast'\n", ["preset", "'fast'", "paper, sharp"]),
        ("beta = \n", ["not valid TOML"]),
    ],
)
def test_unusable_file_is_one_line(text, named, tmp_path, capsys):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    words = ["train", "simulated", "--out", str(tmp_path / "run"), "--config", str(file)]
    assert_refused(capsys, words, str(file), *named)
    assert not (tmp_path / "run").exists()


def test_a_file_with_a_byte_order_mark_is_read(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[model]\nbeta = 0.4\n", encoding="utf-8-sig")
    assert file.read_bytes().startswith(b"\xef\xbb\xbf")
    assert load_config(file).model.beta == 0.4


def test_every_setting_of_every_preset_is_read_back(tmp_path):
    from endotsr.config import PRESETS, config_to_toml

    for config in PRESETS.values():
        file = tmp_path / "config.toml"
        file.write_text(config_to_toml(config))
        assert load_config(file) == config


@pytest.mark.parametrize("until", [0, 1, 500, 501])
def test_no_densification_is_a_choice_at_any_length(until):
    """Stored settings are checked again, and a longer run may not make refused ones of them."""
    for iterations in (1, 30, 6000, 60_000):
        words = ("--density.until", str(until))
        found = with_iterations(settings(*words), iterations)
        assert config_from_dict(msgspec.to_builtins(found)) == found
        assert not any(densify_now(i, found) for i in range(iterations + 1)) or until > 1
        assert (found.density.until <= 1) == (until <= 1 or iterations < 30)


def test_message_of_a_wrong_section_value():
    with pytest.raises(InputError, match=r"training\.iterations = None is not allowed; use an integer >= 1"):
        config_from_dict({"training": {"iterations": None}})


# --- keys of earlier versions ---

FORMER = """
[initialisation]
motion_flow = "dis"
[training]
time_jitter = 0.0
bridge_target = "{}"
bridge_flow = "dis"
"""


def test_keys_of_earlier_versions_are_read_at_the_value_that_remains(tmp_path):
    file = tmp_path / "old.toml"
    file.write_text(FORMER.format("neighbour"))  # the former default: no time is bridged in `paper`
    assert load_config(file) == PAPER
    file.write_text('preset = "sharp"' + FORMER.format("flow"))
    assert load_config(file) == SHARP
    assert settings("--config", str(file)) == SHARP


def test_the_stored_length_of_an_earlier_version_is_kept_on_any_number_of_frames(tmp_path):
    from endotsr.config import lengthened

    file = tmp_path / "old.toml"
    file.write_text('preset = "sharp"' + FORMER.format("flow") + "iterations = 300\nvisits_per_frame = 128\n")
    assert lengthened(load_config(file), 55).training.iterations == 300


@pytest.mark.parametrize(
    ("section", "key", "value", "allowed"),
    [
        ("training", "time_jitter", 1.0, "use 0"),
        ("training", "bridge_flow", "tvl1", "use 'dis'"),
        ("training", "bridge_target", "neighbour", "use 'flow'"),
        ("initialisation", "motion_flow", "farneback", "use 'dis'"),
    ],
)
def test_a_key_of_an_earlier_version_with_another_value_is_refused(section, key, value, allowed):
    with pytest.raises(InputError) as refused:
        config_from_dict({"preset": "sharp", section: {key: value}}, "old.toml")
    said = str(refused.value)
    assert said.startswith(f"old.toml: {section}.{key} = {value!r} is not allowed") and allowed in said
    assert "or no such key" in said


def test_a_folder_whose_name_begins_with_a_dash_is_told_to_be_written_otherwise(tmp_path, monkeypatch, capsys):
    (tmp_path / "-clip").mkdir()
    monkeypatch.chdir(tmp_path)
    assert_refused(
        capsys, ["check", "-clip"], "-clip: no such option; for the file or folder of this name, write ./-clip"
    )
    assert_refused(capsys, ["check", "-" + "x" * 5000], "no such option")
