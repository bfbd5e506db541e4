"""Pictures that were written by mistake are named; baselines and honest renders are not."""

import dataclasses

import numpy as np
import pytest

from endotsr.clips.sequences.splits import blocks, every_eighth
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
from endotsr.results.evaluation.baselines import BASELINES
from endotsr.results.evaluation.doubts import doubt


@pytest.fixture(scope="module")
def sequence():
    return simulate(SimulatorSettings(width=64, height=48, frames=20)).sequence


@pytest.fixture(scope="module")
def renders(sequence):
    """Pictures of the held-out frames with the error of a model."""
    noise = np.random.default_rng(0)
    return {int(i): truth(sequence, i) + noise.normal(0, 0.02, (3, 48, 64)).astype(np.float32)
            for i in sequence.test_index}  # fmt: skip


def truth(sequence, i):
    return sequence.images[int(i)].astype(np.float32) / np.float32(255)


MISTAKES = {
    "BGR": (lambda picture: picture[::-1], "red and blue exchanged"),
    "mirrored": (lambda picture: picture[:, :, ::-1], "mirrored"),
    "from the bottom": (lambda picture: picture[:, ::-1], "upside down"),
    "turned": (lambda picture: picture[:, ::-1, ::-1], "turned by 180 degrees"),
    "linear": (lambda picture: np.maximum(picture, 0) ** 2.2, "linear light"),
    "grey": (lambda picture: np.broadcast_to(picture.mean(axis=0), picture.shape), "are grey"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_of_all_pictures_is_named(case, sequence, renders):
    change, said = MISTAKES[case]
    found = doubt(sequence, lambda i: change(renders[i]))
    assert said in found


@pytest.mark.parametrize(("step", "said"), [(-1, "the frame before"), (1, "the frame after")])
def test_numbers_that_are_off_by_one_are_named(step, said, sequence):
    found = doubt(sequence, lambda i: truth(sequence, i + step))
    assert said in found and "60.0 dB nearer" in found


def test_frames_in_another_order_are_named(sequence, renders):
    frames = list(renders)
    turned = dict(zip(frames, frames[1:] + frames[:1]))
    found = doubt(sequence, lambda i: renders[turned[i]])
    assert f"{sequence.names[frames[0]]} shows {sequence.names[frames[1]]}" in found and "another order" in found


def test_the_frames_themselves_are_no_renders(sequence, renders):
    one = int(sequence.test_index[0])
    found = doubt(sequence, lambda i: truth(sequence, i) if i == one else renders[i])
    assert found.startswith(
        f"warning: 1 of {len(renders)} pictures equal the recorded frames on tissue: {sequence.names[one]}"
    )


@pytest.mark.parametrize("effects", [(), ("noise",), ("breathing", "noise"), ("pull", "camera_motion")])
def test_baselines_raise_no_doubt(effects):
    """A blend repeats the noise of training frames, in a still scene above all; it resembles both alike."""
    whole = simulate(with_effects(SimulatorSettings(width=64, height=48, frames=25), *effects)).sequence
    for train, test in (every_eighth(25), blocks(25, 2), blocks(25, 8)):
        sequence = dataclasses.replace(whole, train_index=train, test_index=test)
        for baseline in BASELINES.keys() - {"nearest_frame"}:
            said = doubt(sequence, BASELINES[baseline][1](sequence))
            assert said == "" or (not effects and "equal the recorded frames" in said), (baseline, test)


def test_a_copy_of_the_frame_before_is_called_that(sequence):
    found = doubt(sequence, BASELINES["nearest_frame"][1](sequence))
    assert "seem to show the frame before" in found


def test_renders_raise_no_doubt_and_neither_do_frames_without_tissue(sequence, renders):
    assert doubt(sequence, renders.__getitem__) == ""
    assert doubt(dataclasses.replace(sequence, masks=sequence.masks & False), renders.__getitem__) == ""
