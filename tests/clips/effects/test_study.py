"""The study of the tests: its clips are known, its seeds are fresh, its counts are those of the answers."""

import pytest
from pages.effects.study import (
    ANSWERS,
    FIRST_SEED,
    FOUND,
    SPOILED,
    SWEEPS,
    UNITS,
    answer_of,
    expectation,
    summary,
    trials,
    wrong,
)

from endotsr.clips.simulator.settings import EFFECTS

SEEDS = range(FIRST_SEED, FIRST_SEED + 2)


def right(trial):
    """What a perfect inspection says; where neither answer is wrong it says no."""
    return {name: bool(expected) for name, expected in trial.expected.items()}


def made_up(**said):
    """Answers of perfect tests, but for those given."""
    found = {t.key: {"size": t.amplitude, "noise": 0.01, "said": right(t) | said} for t in trials(SEEDS)}
    return found


def test_every_clip_has_its_own_key_and_knows_what_is_in_it():
    clips = list(trials(SEEDS))
    assert len({trial.key for trial in clips}) == len(clips)
    assert {trial.seed for trial in clips} == set(SEEDS)
    for trial in clips:
        assert set(trial.expected) == set(FOUND)
        assert not trial.swept or trial.expected[ANSWERS[trial.swept]] is not False
    assert set(ANSWERS) == set(UNITS) == set(SWEEPS) | set(SPOILED) and set(SWEEPS) < set(EFFECTS)


def test_another_seed_gives_the_same_clips_with_another_seed():
    one, other = list(trials([3])), list(trials([4]))
    assert [t._replace(seed=0) for t in one] == [t._replace(seed=0) for t in other]


def test_perfect_answers_have_no_false_positive_and_every_detection():
    result = summary(SEEDS, 16, made_up())
    assert result["first_seed"] == FIRST_SEED and result["clips"] == len(list(trials(SEEDS)))
    for name, counts in result["effects"].items():
        assert counts["false"] == 0 and counts["detected"] == counts["positives"], name
    assert result["effects"]["topology change"]["positives"] == len(SEEDS)
    for rows in result["sweeps"].values():
        assert all(row["detected"] == row["clips"] == len(SEEDS) for row in rows)


def test_a_test_that_always_says_yes_or_no_is_counted_as_that():
    always = summary(SEEDS, 16, made_up(motion=True))["effects"]["motion"]
    assert always["false"] == always["negatives"] > 0 and always["detected"] == always["positives"] > 0
    never = summary(SEEDS, 16, made_up(motion=False))
    assert never["effects"]["motion"]["detected"] == 0
    assert all(row["detected"] == 0 for row in never["sweeps"]["breathing"])


def test_a_missing_answer_is_an_error():
    found = made_up()
    del found[next(iter(found))]
    with pytest.raises(KeyError):
        summary(SEEDS, 16, found)


def test_a_slit_changes_the_topology_and_moves_tissue():
    expected = expectation(("noise", "cutting"))
    assert expected["topology change"] and expected["motion"] and expected["photometric"] is None
    assert expected["periodic motion"] is False


def test_an_answer_is_that_of_the_tests():
    trial = next(t for t in trials([FIRST_SEED]) if t.scene == "exposure" and t.strongest)
    answer = answer_of(trial, 12)
    assert answer["key"] == trial.key and answer["size"] == pytest.approx(15.0)
    assert answer["said"]["photometric"] and wrong(trial, answer["said"]) == []
    assert wrong(trial, answer["said"] | {"motion": True}) == ["motion"]
