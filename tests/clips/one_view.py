"""Relative inverse depth of a network for a clip from one camera."""

import numpy as np
from depth_folders import FRAMES, recording, true_depth

from endotsr.cli.main import main
from endotsr.clips.sequences.layouts import describe


def relative(i):
    """An affine map of 1 / z, another one in every frame."""
    return (1800 + 100 * i) / true_depth(i) - 3 + 2 * i


def clip(folder, values=relative, kind="npy"):
    """A prepared clip without depth, and the files of r; returns both."""
    words = recording(folder, values, "relative", kind)
    assert main(words[:-2]) == 0
    return folder / "o", folder / "relative"


def given(where, files, *words):
    return main(["depth", str(where), "--given", str(files), "--kind", "relative", *words])


def sparse(where, count=60, wrong=0.0):
    """Enter true depth at a few pixels a frame; a part of it is wrong by a third."""
    rng = np.random.default_rng(2)
    (where.parent / "sparse").mkdir()
    for i in range(FRAMES):
        plane = np.zeros(true_depth(i).size)
        chosen = rng.choice(plane.size, count, replace=False)
        plane[chosen] = true_depth(i).reshape(-1)[chosen] * np.where(rng.random(count) < wrong, 1.33, 1.0)
        np.save(where.parent / "sparse" / f"{i:06d}.npy", plane.reshape(true_depth(i).shape).astype(np.float32))
    assert main(["depth", str(where), "--given", str(where.parent / "sparse"), "--kind", "depth"]) == 0


def error(where):
    """The largest relative error of the depth of every frame."""
    read = describe(where).depth
    return max(np.abs(read(i) / true_depth(i) - 1).max() for i in range(FRAMES))
