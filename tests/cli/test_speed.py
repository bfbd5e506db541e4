"""The speed of the machine between trainings: kept only if enough was timed, and never in the way."""

import pytest
from tiny import scene, train_words, written_folder

from endotsr.cli.main import main
from endotsr.cli.parts import waiting
from endotsr.clips.sequences.forecast.seconds import Beside, assumed_unit
from endotsr.errors import InputError
from endotsr.training.runs import pace, speed, training


@pytest.fixture
def kept(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "speed_file", lambda threads: tmp_path / f"speed-{threads}.json")
    return tmp_path / "speed-2.json"


def test_a_speed_is_kept_for_its_number_of_threads(kept):
    assert speed.remembered_unit(2) is None
    speed.remember_unit(2, 0.0625, 200, 80_000)
    assert speed.remembered_unit(2) == 0.0625 and speed.remembered_unit(1) is None


@pytest.mark.parametrize("unit, iterations, pixels", [(0.1, 199, 80_000), (0.1, 200, 79_999), (None, 900, 90_000)])
def test_too_short_or_too_small_a_training_tells_no_speed(kept, unit, iterations, pixels):
    speed.remember_unit(2, unit, iterations, pixels)
    assert not kept.exists()


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"seconds_per_unit": "fast"}', '{"seconds_per_unit": 0}', "\0"])
def test_a_damaged_file_is_no_speed(kept, content):
    kept.write_text(content)
    assert speed.remembered_unit(2) is None


def test_a_folder_that_cannot_be_written_does_not_stop_a_training(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "speed_file", lambda threads: tmp_path / "missing" / "speed.json")
    speed.remember_unit(2, 0.1, 900, 90_000)
    assert not list(tmp_path.iterdir())


def test_the_speeds_of_the_parts_are_kept_beside_one_another(kept):
    assert speed.remembered_beside(2) == Beside()
    speed.remember_unit(2, 0.1, 900, 90_000)
    speed.remember_beside(2, Beside(start=0.2), 90_000)
    speed.remember_beside(2, Beside(evaluation=0.3), 90_000)
    assert speed.remembered_unit(2) == 0.1 and speed.remembered_beside(2) == Beside(0.2, 0.3)
    speed.remember_beside(2, Beside(9.0, 9.0), 79_999)
    speed.remember_beside(2, Beside(float("inf"), 0.0), 90_000)
    assert speed.remembered_beside(2) == Beside(0.2, 0.3)
    kept.write_text(kept.read_text().replace("0.2", '"fast"'))
    assert speed.remembered_beside(2) == Beside(None, 0.3), "one damaged number"


def test_the_last_training_is_the_speed_then_the_timed_iterations_and_an_assumed_one(kept):
    speed.remember_beside(2, Beside(start=0.17), 90_000)
    assert speed.known_speed(2, lambda: 0.3) == speed.KnownSpeed(0.3, Beside(0.17), speed.TIMED)
    assert speed.known_speed(2) == speed.KnownSpeed(assumed_unit(2), Beside(0.17), speed.ASSUMED)
    speed.remember_unit(2, 0.1, 900, 90_000)
    assert speed.known_speed(2, pytest.fail) == speed.KnownSpeed(0.1, Beside(0.17), speed.TRAINED)


@pytest.mark.parametrize(
    ("least", "source"), [(1, "at the speed of a few iterations"), (80_000, "the speed of this machine is assumed")]
)
def test_the_first_training_on_a_machine_times_iterations_of_a_large_clip(least, source, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(speed, "LEAST_PIXELS", least)
    monkeypatch.setattr(speed, "speed_file", lambda threads: tmp_path / "speed.json")
    monkeypatch.setattr(waiting, "waiting_line", lambda plan, found, *rest: f"{found.source}, {found.unit:.4f} s")
    timed = []
    monkeypatch.setattr(pace, "seconds_of_unit", lambda sequence, config: timed.append(config) or 0.4321)
    assert main(train_words(tmp_path / "run", "--no-evaluate", "--iterations", "1")) == 0
    assert source in capsys.readouterr().out and len(timed) == (least == 1)


def test_check_says_that_its_minutes_assume_a_speed(kept, tmp_path, capsys):
    words = ["check", str(written_folder(tmp_path)), "--threads", "2"]
    main(words)
    assert f"({speed.ASSUMED})" in capsys.readouterr().out
    speed.remember_unit(2, 0.1, 900, 90_000)
    main(words)
    assert "training needs about" in (said := capsys.readouterr().out) and "assumed" not in said


@pytest.mark.parametrize("least", [1, 80_000])
def test_a_training_of_given_minutes_times_its_iterations_once(least, tmp_path, capsys, monkeypatch):
    """It ends before the training. Its first line has the timed speed, also of frames below the least size."""

    def ended(*_):
        raise InputError("ended")

    monkeypatch.setattr(speed, "LEAST_PIXELS", least)
    monkeypatch.setattr(speed, "speed_file", lambda threads: tmp_path / "speed.json")
    monkeypatch.setattr(training, "train_new_run", ended)
    timed = []
    monkeypatch.setattr(pace, "seconds_of_unit", lambda sequence, config: timed.append(config) or 0.1)
    assert main(["train", scene(), "--out", str(tmp_path / "run"), "--no-evaluate", "--minutes", "9"]) == 2
    said = capsys.readouterr()
    assert "minutes: 9" in said.out and speed.TIMED in said.out and "ended" in said.err and len(timed) == 1
