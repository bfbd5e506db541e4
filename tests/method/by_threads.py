"""The same computation with one thread and with all threads of the process."""

import numba
import numpy as np


def assert_threads_change_no_bit(compute):
    """`compute` returns arrays and numbers; each has the same bits, however many threads compute it."""
    found, before = [], numba.get_num_threads()
    try:
        for threads in (1, numba.config.NUMBA_NUM_THREADS):
            numba.set_num_threads(threads)
            found.append([np.asarray(value).tobytes() for value in compute()])
    finally:
        numba.set_num_threads(before)
    assert found[0] == found[1]
