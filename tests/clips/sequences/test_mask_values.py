"""What the numbers of masks mean: by all files of a folder together, in training and in `check` as in `prepare`."""

import cv2
import numpy as np
import pytest
from common_folder import written

from endotsr.cli.main import main
from endotsr.clips.sequences.mask_values import MaskLevels, levels_of, white_pixels
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from synthetic_folder import write_synthetic_folder


@pytest.mark.parametrize("values, levels", [
    ([0, 1], (0, 1, False)), ([0], (0, 255, False)), ([1], (0, 1, False)), ([0, 255], (0, 255, False)),
    ([255], (0, 255, False)), ([16, 235], (16, 235, False)), ([0, 2], (0, 2, False)), ([1, 2], (1, 2, False)),
    ([0, 65535], (0, 65535, False)), ([254, 255], (0, 255, True)), ([*range(11), 250, 255], (0, 255, True)),
    ([*range(0, 256, 5)], (0, 255, True)), ([0, 1, 2, 255], (0, 255, False)),
])  # fmt: skip
def test_the_numbers_of_all_masks_decide(values, levels):
    assert levels_of(values, "masks") == MaskLevels(*levels)


@pytest.mark.parametrize("values", [[0, 1, 2], [0, 3, 10], [0, 31, 2], [0, 32, 64], [7], [0, 500, 4000]])
def test_numbers_of_objects_are_refused(values):
    with pytest.raises(InputError, match=r"masks: .*--excluded-value nonzero"):
        levels_of(values, "masks")


def test_an_area_of_another_number_is_an_object_unless_the_masks_are_coded():
    plane = np.zeros((20, 30), np.uint8)
    plane[:5, :5], plane[10:13, 10:13] = 255, 3
    assert white_pixels(plane, MaskLevels(0, 255, True), "m")[0].sum() == 25
    with pytest.raises(InputError, match="m: areas of the number 3, which is neither 0 nor 255"):
        white_pixels(plane, MaskLevels(0, 255, False), "m")
    plane[12, 12] = 0  # no area of 3x3 pixels any more: an edge
    assert white_pixels(plane, MaskLevels(0, 255, False), "m") == (pytest.approx(plane > 128), 8)


def _coded(folder, masks, quality):
    """The masks as JPEG. The first is black with the numbers 0 to 10, as a codec leaves them."""
    height, width = masks[0].shape
    rough = np.random.default_rng(0).integers(0, 11, (height // 8 + 1, width // 8 + 1))
    rough = np.kron(rough, np.ones((8, 8)))[:height, :width].astype(np.uint8)
    for file, mask in zip(sorted(folder.iterdir()), masks):
        file.unlink()
        empty = mask is masks[0]
        plane = rough if empty else np.where(mask, 0, 255).astype(np.uint8)
        cv2.imwrite(str(file.with_suffix(".jpg")), plane, [cv2.IMWRITE_JPEG_QUALITY, quality])


def test_training_reads_coded_masks_with_an_empty_frame(tmp_path):
    made = write_synthetic_folder(tmp_path)
    _coded(tmp_path / "masks", list(made.tissue), 90)
    sequence = read_sequence(tmp_path, SequenceConfig())
    assert sequence.masks[0].all()
    assert (sequence.masks[1:] != made.tissue[1:]).mean() < 0.01


def test_check_reads_the_masks_as_training_does(tmp_path, capsys):
    written(tmp_path / "clip")
    folder = tmp_path / "clip/masks"
    made = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) < 128 for file in sorted(folder.iterdir())]
    _coded(folder, made, 90)
    assert main(["check", str(tmp_path / "clip")]) == 0, capsys.readouterr()
    assert "mask-values" not in capsys.readouterr().out


def test_masks_of_objects_are_one_finding(tmp_path, capsys):
    written(tmp_path / "clip")
    for file in sorted((tmp_path / "clip/masks").iterdir()):
        plane = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) // 255
        plane[:3, :3] = 2
        cv2.imwrite(str(file), plane)
    assert main(["check", str(tmp_path / "clip")]) == 1
    assert capsys.readouterr().out.count("numbers up to 2 in all pictures") == 1
