"""The reason of a verdict: one sentence of the clauses that apply."""

from endotsr.clips.effects.verdict import sentence

CLAUSES = {"gain": "the gain drifts", "local": "the light changes", "noise": "LEDs flicker"}


def test_clauses_are_joined_in_the_order_in_which_they_were_found():
    assert sentence(CLAUSES, ["gain", "local"], "Nothing.") == "The gain drifts, the light changes."
    assert sentence(CLAUSES, ["noise"], "Nothing.") == "LEDs flicker."


def test_nothing_found_has_a_sentence_of_its_own():
    assert sentence(CLAUSES, [], "Nothing.") == "Nothing."
