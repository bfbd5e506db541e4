"""Masks in NumPy files: what they hold is what `prepare` writes, and what is no mask is refused with the remedy."""

import numpy as np
import pytest
from made_videos import files

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png

FRAMES, HEIGHT, WIDTH = 5, 24, 32
TOOL = np.zeros((FRAMES, HEIGHT, WIDTH), bool)
for _i in range(FRAMES):
    TOOL[_i, 4:12, 2 * _i : 2 * _i + 10] = True
KINDS = {
    "truth values": TOOL, "0 and 255": TOOL.astype(np.uint8) * 255, "0 and 1 as float32": TOOL.astype(np.float32),
    "int64": TOOL.astype(np.int64), "a channel axis": TOOL[:, None], "0 and 40": TOOL.astype(np.uint8) * 40,
    "16 bits": TOOL.astype(np.uint16) * 65535,
}  # fmt: skip


def prepared(folder, *words):
    """The exit status of `prepare`, and the masks that it writes, True = excluded."""
    files(folder, "source", np.random.default_rng(0).integers(90, 200, (FRAMES, HEIGHT, WIDTH, 3), np.uint8))
    camera = ["--camera", "30", "30", "16", "12"]
    status = main(["prepare", str(folder / "source"), "--out", str(folder / "clip"), *camera, *words])
    return status, [read_png(file) > 0 for file in sorted((folder / "clip").glob("masks/*"))]


@pytest.mark.parametrize("array", KINDS.values(), ids=KINDS)
def test_an_array_of_a_clip(tmp_path, array):
    np.save(tmp_path / "m.npy", array)
    status, masks = prepared(tmp_path, "--masks", str(tmp_path / "m.npy"))
    assert status == 0 and (np.array(masks) == TOOL).all()


def test_a_compressed_archive_an_inverted_one_and_numbers_of_objects(tmp_path):
    for name, array, value in (
        ("a", TOOL, "white"),
        ("b", ~TOOL, "black"),
        ("c", np.where(TOOL, 2 + np.arange(WIDTH) % 2, 0), "nonzero"),
    ):
        (tmp_path / name).mkdir()
        np.savez_compressed(tmp_path / name / "m.npz", masks=array)
        file = str(tmp_path / name / "m.npz")
        status, masks = prepared(tmp_path / name, "--masks", file, "--excluded-value", value)
        assert status == 0 and (np.array(masks) == TOOL).all()


def test_one_file_a_frame_and_one_for_all(tmp_path, capsys):
    files(tmp_path, "masks", TOOL, "npy")
    np.save(tmp_path / "scope.npy", ~TOOL.any(axis=0))
    words = ["--masks", str(tmp_path / "masks"), "--unite-masks", str(tmp_path / "scope.npy")]
    status, masks = prepared(tmp_path, *words)
    assert status == 0 and (np.array(masks) == (TOOL | ~TOOL.any(axis=0))).all()
    assert "not read" not in capsys.readouterr().out


@pytest.mark.parametrize("array, said", [
    (TOOL * 0.7, "holds 0.7; use whole numbers from 0 to 65535, or True and False; a threshold makes a mask"),
    (TOOL * -1, "holds -1; use"),
    (TOOL * 70_000, "holds 70000; use"),
    (np.where(TOOL, np.nan, 0), "holds nan; use"),
    (TOOL[:, :, :20], "20x24"),
    (TOOL[:4], "1 of 5 frames have no mask"),
    (TOOL[..., None].repeat(4, axis=3), "use one array of real numbers, (frames, height, width)"),
], ids=["probabilities", "negative", "too large", "NaN", "another shape", "too few frames", "colours"])  # fmt: skip
def test_what_is_no_mask_of_this_clip_is_refused(tmp_path, capsys, array, said):
    np.save(tmp_path / "m.npy", array)
    status, _ = prepared(tmp_path, "--masks", str(tmp_path / "m.npy"))
    error = capsys.readouterr().err
    assert status == 2 and said in error
