"""The study of training: one setting changed at a time, restartable, honest clock."""

import json

import msgspec
import numpy as np
import pytest
from pages.tradeoff import parts, training
from pages.tradeoff.text import summary, training_rows
from pages.tradeoff.training import changed, configurations, measured, run_training_study

from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.cli.train import TrainOptions
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import DEMO, InitialisationConfig, with_iterations
from endotsr.errors import InputError
from endotsr.training.fitting.state import new_training
from endotsr.training.fitting.trainer import train
from endotsr.training.runs.sources import load_sequence

pytestmark = pytest.mark.slow

SMALL = SimulatorSettings(width=64, height=64, frames=9)
BASE = msgspec.structs.replace(
    DEMO, initialisation=InitialisationConfig(first_frame_points=60, other_frame_points=10)
)  # fmt: skip


def load(config):
    return load_sequence("simulated", config, SMALL)


def study(file, **options):
    return run_training_study(file, BASE, load, "simulated", say=lambda line: None, **({"minutes": 9} | options))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    file = tmp_path_factory.mktemp("whole") / "training.json"
    return study(file, iterations=8), file


def numbers(result):
    """What no clock changes."""
    return [
        (c["name"], [{k: v for k, v in row.items() if k != "seconds"} for row in c["milestones"]])
        for c in result["configurations"]
    ]


def test_every_question_is_answered(whole):
    result, file = whole
    asked = {c["dial"] for c in result["configurations"]}
    assert asked == {"base", "residuals", "Laplacian loss", "image scale", "Gaussians", "cutoffs", "precision"}
    assert json.loads(file.read_text()) == json.loads(json.dumps(result))
    for c in result["configurations"]:
        iterations = [row["iteration"] for row in c["milestones"]]
        assert iterations == sorted(set(iterations)) and iterations[-1] == 8
        seconds = [row["seconds"] for row in c["milestones"]]
        assert seconds == sorted(seconds) and c["seconds"] == seconds[-1]


def test_the_last_milestone_is_an_ordinary_training(whole):
    """The same settings, trained and measured without the study."""
    for configuration in configurations(with_iterations(BASE, 8)):
        if configuration.name not in ("base", "half size", "float64"):
            continue
        config = changed(with_iterations(BASE, 8), configuration)
        sequence = load(config)
        state = train(new_training(sequence, config), sequence, config, lambda e: None, lambda s: None)
        entry = next(c for c in whole[0]["configurations"] if c["name"] == configuration.name)
        alone = measured(state, config, sequence, load(BASE), None)
        assert {k: entry["milestones"][-1][k] for k in alone} == alone
        assert entry["milestones"][-1]["gaussians"] == state.gaussians.count


def test_a_study_goes_on_where_it_stopped(whole, tmp_path, monkeypatch):
    file, run, done = tmp_path / "training.json", training.run_configuration, []

    def interrupted(configuration, *arguments):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(configuration.name)
        return run(configuration, *arguments)

    monkeypatch.setattr(training, "run_configuration", interrupted)
    with pytest.raises(KeyboardInterrupt):
        study(file, iterations=8)
    assert [c["name"] for c in json.loads(file.read_text())["configurations"]] == done

    def counted(configuration, *arguments):
        assert configuration.name not in done[:2]
        done.append(configuration.name)
        return run(configuration, *arguments)

    monkeypatch.setattr(training, "run_configuration", counted)
    result = study(file)
    assert done == [c["name"] for c in result["configurations"]] and len(done) > 10
    assert numbers(result) == numbers(whole[0])


def test_another_sequence_or_length_is_refused(whole):
    _, file = whole
    with pytest.raises(InputError, match="another sequence, length or settings"):
        study(file, iterations=9)
    with pytest.raises(InputError, match="another sequence, length or settings"):
        run_training_study(file, DEMO, load, "simulated", minutes=1)


def test_what_the_time_does_not_allow_is_left_out_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "planned_iterations", lambda *a: 4)
    result = study(tmp_path / "training.json", minutes=1e-9)
    assert result["configurations"] == [] and set(result["left_out"]) == {c.name for c in configurations(BASE)}
    assert "- 2 N: no time left for it" in parts.training("name", result)


def test_the_words_of_a_configuration_make_its_settings():
    base = with_iterations(DEMO, 8)
    for configuration in configurations(base):
        words = ["--preset", "demo", "--iterations", "8", *configuration.words()]
        start, _ = base_settings(words)
        config = parse(TrainOptions, words, "train", TrainOptions(settings=start)).settings
        wanted = changed(base, configuration)
        assert msgspec.structs.replace(config, raster=wanted.raster) == wanted, configuration.name
        for name in ("alpha_cutoff", "transmittance_stop"):
            value, other = getattr(config.raster, name), getattr(wanted.raster, name)
            assert value == other or np.isclose(value, other, rtol=1e-5), configuration.name


def test_a_training_is_beaten_only_beyond_chance():
    ends = {"base": (60, 30.0), "float64": (90, 30.5), "slow": (70, 29.4), "near": (70, 29.6), "small": (20, 25.0)}
    result = {
        "configurations": [
            {"name": name, "seconds": seconds, "milestones": [{"psnr_full": psnr}]}
            for name, (seconds, psnr) in ends.items()
        ]
    }
    chance, beaten = summary(result)
    assert "ends 0.50 dB from it" in chance
    assert beaten == "*slow* took longer than the following, and is worse by more than this difference: base."
    del result["configurations"][0]
    assert summary(result) == []


def test_the_table_stands_beside_the_base(whole):
    rows = training_rows(whole[0])
    assert rows[0][:3] == ["base", rows[0][1], "+0.00"] and len(rows) == len(whole[0]["configurations"])
