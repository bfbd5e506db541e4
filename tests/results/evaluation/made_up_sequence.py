"""A stand-in for a sequence: only what the evaluation reads."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MadeUpSequence:
    images: np.ndarray
    masks: np.ndarray
    times: np.ndarray
    train_index: np.ndarray
    test_index: np.ndarray
    names: list[str]
    static_camera: bool = True


def made_up(images: np.ndarray, test: list[int], masks: np.ndarray | None = None) -> MadeUpSequence:
    count = len(images)
    if masks is None:
        masks = np.ones((count, *images.shape[2:]), bool)
    train = [i for i in range(count) if i not in test]
    names, times = [f"frame-{i:06d}.png" for i in range(count)], np.arange(count) / count
    return MadeUpSequence(images, masks, times, np.array(train, int), np.array(test, int), names)
