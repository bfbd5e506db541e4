"""What the guide on recordings says of the length of a window, from the record of the table beside it."""

import numpy as np
import pytest
from pages.recordings.window_length import BASELINES, LENGTHS, PROGRAM, SPLITS
from pages.store.intervals import interval

RUNS = PROGRAM.read()["runs"]


def of(split, length, key="held_out"):
    """Mean over the seeds, and half of its 95 % interval, dB."""
    return interval([run[key] for run in RUNS[split][str(length)]])


def baselines(split):
    return RUNS[split][str(LENGTHS[0])][0]["baselines"]


def test_every_run_is_there_and_the_baselines_do_not_depend_on_it():
    for split in SPLITS:
        for length in LENGTHS:
            runs = RUNS[split][str(length)]
            assert len(runs) == 3 and all(run["iterations"] == length for run in runs)
            for name in BASELINES:
                assert {run["baselines"][name] for run in runs} == {baselines(split)[name]}


def test_with_fewer_iterations_a_window_fits_its_own_frames_several_decibels_less_well():
    assert of("every_eighth", 1500, "training")[0] - of("every_eighth", 600, "training")[0] > 4


def test_no_row_comes_close_to_the_blend_where_every_eighth_frame_is_held_out():
    assert all(baselines("every_eighth")["two_neighbours"] - sum(of("every_eighth", k)) > 2 for k in LENGTHS)


@pytest.mark.parametrize(("length", "baseline"), [(1500, "flow_interpolation"), (3000, "two_neighbours")])
def test_where_blocks_are_missing_the_model_is_level_with(length, baseline):
    mean, half = of("blocks", length)
    assert np.isclose(mean, baselines("blocks")[baseline], rtol=0, atol=half)
