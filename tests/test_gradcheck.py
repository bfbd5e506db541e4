"""One gradient check per registered pair: two seeds in float64, and float32 against float64."""

import pytest

from endotsr.port.gradcheck import all_pairs, check_pair, check_precision, one_thread, pair_stream, table

PAIRS = all_pairs()
SEEDS = (0, 1)


@pytest.mark.parametrize("name", list(PAIRS))
@pytest.mark.parametrize("seed", SEEDS)  # varies last: two workers take one seed each
def test_gradcheck(name, seed):
    pair = PAIRS[name]
    with one_thread():
        report = check_pair(pair, pair_stream(name, seed))
        assert report.passed, table([report])
        precision = check_precision(pair, pair_stream(name, seed))
        assert precision.passed, "\n".join(precision.failures)
