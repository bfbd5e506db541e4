"""The draw of a blind set: real operations, distinct pairs, and the same ones for a seed."""

import blind

from endotsr.port.contract import all_operations


def test_every_operation_exists_and_a_draw_is_repeatable():
    families = {name.split("/")[0] for name in all_operations()}
    assert set(blind.OPERATIONS) <= families | set(all_operations())
    first = blind.drawn(7)
    assert first == blind.drawn(7) != blind.drawn(8) and len(set(first)) == blind.COUNT
