"""One gradient check per registered pair: two seeds in float64, and float32 against float64."""

import pytest

from endotsr.gradcheck import all_pairs, check_pair, check_precision, one_thread, pair_stream, table

PAIRS = all_pairs()
SEEDS = (0, 1)


@pytest.mark.parametrize("name", list(PAIRS))
def test_gradcheck(name):
    pair = PAIRS[name]
    with one_thread():
        for seed in SEEDS:
            report = check_pair(pair, pair_stream(name, seed))
            assert report.passed, f"seed {seed}\n{table([report])}"
            precision = check_precision(pair, pair_stream(name, seed))
            assert precision.passed, f"seed {seed}\n" + "\n".join(precision.failures)
