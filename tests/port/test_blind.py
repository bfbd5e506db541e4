"""The draw of a blind set: real operations, distinct pairs, the same ones for a seed; a set is judged to its end."""

import sys
from pathlib import Path

import blind

from endotsr.port.contract import all_operations

SETS = Path(__file__).parent / "blind_sets"


def test_every_operation_exists_and_a_draw_is_repeatable():
    families = {name.split("/")[0] for name in all_operations()}
    assert set(blind.OPERATIONS) <= families | set(all_operations())
    first = blind.drawn(7)
    assert first == blind.drawn(7) != blind.drawn(8) and len(set(first)) == blind.COUNT


def test_a_port_that_ends_with_an_error_does_not_end_the_judgement_of_its_set(monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", [str(SETS), *sys.path])
    import judged

    def answer(entry, _):
        if entry["number"] == 4:
            raise KeyError("appearance_coefficients")
        return ["judged"]

    monkeypatch.setattr(judged, "answer_to", answer)
    assert judged.main([str(SETS / "2026_11_26_second.toml")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines.count("    judged") == 49
    assert lines.count("    the port ends with an error: KeyError('appearance_coefficients')") == 1
