"""One bad picture among good ones, which no sum over the frames shows: named, or noted where it can be right."""

import cv2
import numpy as np
import pytest

from endotsr.clips.sequences.mask_polarity import check_single_masks
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from synthetic_folder import write_synthetic_folder

EVERYTHING = SequenceConfig(depth_percentiles=(0.0, 100.0))


def _write_mask(folder, frame, tissue):
    cv2.imwrite(str(folder / "masks" / f"frame-{frame:06d}.mask.png"), np.where(tissue, 0, 255).astype(np.uint8))


@pytest.mark.parametrize("depth_behind_tool", [False, True])
@pytest.mark.parametrize("inverted", [[0], [3], [9], [4, 5], [8, 9]])
def test_hard_E5_an_inverted_mask_among_right_ones_is_named(tmp_path, inverted, depth_behind_tool):
    """Alone by its neighbours; two in a row by the pictures: missing depth, or colour where the tool has depth."""
    written = write_synthetic_folder(tmp_path, frames=10, depth_behind_tool=depth_behind_tool)
    for frame in inverted:
        _write_mask(tmp_path, frame, ~written.tissue[frame])
    name = f"masks/frame-{inverted[0]:06d}.mask.png: "
    with pytest.raises(InputError, match=rf"{name}.* set --sequence.allow-tissue-fraction \(TOML: \[sequence\] allow_"):
        read_sequence(tmp_path, SequenceConfig())
    allowed = read_sequence(tmp_path, SequenceConfig(allow_tissue_fraction=True))
    assert any(name in note for note in allowed.notes)


def test_hard_E5_a_mask_with_hardly_any_tissue_is_named(tmp_path):
    written = write_synthetic_folder(tmp_path, frames=10)
    _write_mask(tmp_path, 6, written.tissue[6] & (np.arange(24) == 23)[:, None])
    with pytest.raises(InputError, match=r"masks/frame-000006.mask.png: 4.2% of the pixels count as tissue, .* 78.1%"):
        read_sequence(tmp_path, SequenceConfig())
    assert read_sequence(tmp_path, SequenceConfig(allow_tissue_fraction=True)).masks[6].mean() < 0.05


def test_hard_E5_masks_of_one_side_only_are_noted(tmp_path):
    """Legal: the instrument leaves the view, or covers it."""
    written = write_synthetic_folder(tmp_path, frames=10)
    assert len(read_sequence(tmp_path, SequenceConfig()).notes) == 2
    for frame in (2, 4):
        _write_mask(tmp_path, frame, np.zeros_like(written.tissue[frame]))
    _write_mask(tmp_path, 7, np.ones_like(written.tissue[7]))
    notes = read_sequence(tmp_path, SequenceConfig()).notes
    assert notes[2:] == [
        "no tissue, hence nothing to compare: mask frame-000002.mask.png, frame-000004.mask.png",
        "nothing excluded: mask frame-000007.mask.png",
    ]


def test_hard_E5_an_instrument_that_covers_most_of_the_view_for_a_while_is_accepted(tmp_path):
    """Its masks differ from those before and after, but the pictures support them: no mask is named."""
    written = write_synthetic_folder(tmp_path, frames=10)
    for frame in (4, 5):
        tissue = np.zeros((24, 32), bool)
        tissue[20:] = True
        _write_mask(tmp_path, frame, tissue)
        picture = np.where(tissue, written.images[frame], 120).transpose(1, 2, 0)[..., ::-1]
        cv2.imwrite(str(tmp_path / "images" / f"frame-{frame:06d}.color.png"), picture)
        depth = np.where(tissue, written.depth[frame], 0).astype(np.uint16)
        cv2.imwrite(str(tmp_path / "depth" / f"frame-{frame:06d}.depth.png"), depth)
    notes = read_sequence(tmp_path, SequenceConfig()).notes
    said = [" ".join(note.split(": ")[1:3]) for note in notes[2:]]
    assert said == ["colour-jump frame 4", "colour-jump frame 6"]


def test_hard_E5_masks_of_mixed_bit_depth_are_named(tmp_path):
    written = write_synthetic_folder(tmp_path, frames=10)
    deep = np.where(written.tissue[3], 0, 65535).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "masks" / "frame-000003.mask.png"), deep)
    with pytest.raises(
        InputError, match=r"frame-000003.mask.png: 16-bit picture; 9 of the 10 masks have 8 bits, frame"
    ):
        read_sequence(tmp_path, SequenceConfig())


@pytest.mark.parametrize("stretched", [0, 4])
def test_hard_E6_one_depth_picture_stretched_to_16_bits_is_named(tmp_path, stretched):
    written = write_synthetic_folder(tmp_path)
    for frame in range(5):
        path = tmp_path / "depth" / f"frame-{frame:06d}.depth.png"
        deep = frame == stretched
        cv2.imwrite(str(path), written.depth[frame] * np.uint16(256) if deep else written.depth[frame].astype(np.uint8))
    message = rf"depth/frame-00000{stretched}.depth.png: 16-bit picture, .* 25\d times the usual one, .* has 8 bits"
    with pytest.raises(InputError, match=message):
        read_sequence(tmp_path, SequenceConfig())
    whole = written.depth[stretched].copy()  # millimetres again, with one far value that needs 16 bits: legal
    whole[5, 25] = 6000
    cv2.imwrite(str(tmp_path / "depth" / f"frame-00000{stretched}.depth.png"), whole)
    assert len(read_sequence(tmp_path, SequenceConfig()).notes) == 2


def test_hard_E6_a_depth_picture_on_another_scale_is_noted(tmp_path):
    written = write_synthetic_folder(tmp_path)
    cv2.imwrite(str(tmp_path / "depth" / "frame-000002.depth.png"), written.depth[2] * np.uint16(10))
    notes = read_sequence(tmp_path, EVERYTHING).notes
    assert any("depth-far-off: frame 2: median of frame-000002.depth.png is" in note for note in notes)


def test_one_mask_against_its_picture_is_wrong_if_the_pictures_support_more_masks_than_they_contradict():
    """The other pictures may say nothing: two that support their masks are more than one that contradicts its own."""
    masks = np.zeros((10, 40, 40), bool)
    masks[:, :, :24] = True
    masks[:2] = ~masks[:2]  # two in a row, so that neither differs from both of its neighbours
    images, depth = np.full((10, 3, 40, 40), 100, np.uint8), np.ones((10, 40, 40))
    names = [f"masks/{k}.png" for k in range(10)]
    images[0, 0, :, :24] = 180
    for supporting in (1, 2):
        images[3 + supporting, 0, :, :24] = 180
        notes = check_single_masks(masks, depth, images, names, allow=True)
        found = [note for note in notes if "masks/0.png" in note and "red minus blue" in note]
        assert bool(found) is (supporting == 2)
