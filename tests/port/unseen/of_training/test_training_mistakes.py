"""Each mistake of a training, or of a port that is formulated otherwise, is named or said to be where it is."""

import pytest
import training_mistakes as mistakes

from endotsr.port.judge.store import golden_folder, read_golden
from makers.copies import changed_text


def test_every_mistake_fits_its_source_and_says_what_is_asked_for():
    for port, entries in mistakes.TABLE.items():
        for name, entry in entries.items():
            mistake = mistakes.inject.Mistake(name, mistakes.edits_of(entry), ())
            assert entry["text"].endswith(".") and entry["says"]
            if port == "c99":
                assert mistakes.inject.changed("c99", mistake)
            for module in {edit.module for edit in mistake.edits} if port == "reference" else ():
                assert changed_text(module, [edit for edit in mistake.edits if edit.module == module])


def test_a_mistake_of_a_schedule_is_explained():
    assert mistakes.says_it(read_golden(golden_folder()), "reference", "densified_one_later")[0]


@pytest.mark.slow
@pytest.mark.parametrize("port, name", [(port, name) for port, of in mistakes.TABLE.items() for name in of])
def test_the_report_says_what_is_wrong_or_where(port, name):
    right, lines = mistakes.says_it(read_golden(golden_folder()), port, name)
    assert right, lines
