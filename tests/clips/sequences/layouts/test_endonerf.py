"""Reading EndoNeRF folders: what is right is read exactly, what is wrong is named."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from builders import builder

from data_folder import data_folder, recorded_masks
from endonerf_writer import write_endonerf
from endotsr.clips.formats.files import check_pairing
from endotsr.clips.sequences.depth_files import clip_depth
from endotsr.clips.sequences.read import file_hashes, read_sequence
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from synthetic_folder import FOCAL, identity_rows, write_synthetic_folder

EVERYTHING = SequenceConfig(depth_percentiles=(0.0, 100.0))
VERSIONED = lambda i, kind: f"frame_v1_{i:04d}.png" if kind == "mask" else f"frame_{i:04d}.png"


@pytest.mark.parametrize(
    ("excluded", "mask_folder", "white", "name", "pose_file"),
    [
        ("white", "masks", 255, lambda i, kind: f"frame-{i:06d}.{kind}.png", "poses_bounds.npy"),
        ("black", "gt_masks", 255, lambda i, kind: f"left 640x512 {i * 10}_{kind}.PNG", "pose_bounds.npy"),
        ("white", "gt_masks", 1, lambda i, kind: f"{i + 8}.png", "poses_bounds.npy"),
        ("black", "masks", 255, lambda i, kind: f"{'abcde'[i]}.png", "poses_bounds.npy"),
        ("white", "masks", 255, VERSIONED, "poses_bounds.npy"),
    ],
)
def test_reads_exactly_what_was_written(tmp_path, excluded, mask_folder, white, name, pose_file):
    written = write_synthetic_folder(
        tmp_path, excluded=excluded, mask_folder=mask_folder, white=white, name=name, pose_file=pose_file
    )
    config = SequenceConfig(masks=mask_folder, excluded_value=excluded, depth_percentiles=(0.0, 100.0))
    sequence = read_sequence(tmp_path, config)
    np.testing.assert_array_equal(sequence.images, written.images)  # also: 10 follows 9 although it sorts before
    np.testing.assert_array_equal(sequence.masks, written.tissue)
    np.testing.assert_array_equal(sequence.depth, written.depth)
    np.testing.assert_array_equal(sequence.times, np.arange(5) / 5)
    np.testing.assert_array_equal(sequence.test_index, [1])
    assert sequence.unit == "mm" and sequence.static_camera
    assert all(camera is sequence.cameras[0] for camera in sequence.cameras)
    assert sequence.cameras[0][2:] == (FOCAL, FOCAL, 16.0, 12.0, 32, 24)
    assert any(f"{excluded} = excluded" in note and "of the pixels" in note for note in sequence.notes)


def test_frame_converts_to_the_precision_asked_for(tmp_path):
    written = write_synthetic_folder(tmp_path)
    sequence = read_sequence(tmp_path, EVERYTHING)
    for dtype in (np.float32, np.float64):
        frame = sequence.frame(2, dtype)
        assert frame.image.dtype == dtype and frame.depth.dtype == dtype and frame.time == 0.4
        np.testing.assert_array_equal(frame.image, written.images[2].astype(dtype) / dtype(255))
    with pytest.raises(IndexError):
        sequence.frame(5)


def test_a_known_point_lands_on_its_pixel_for_every_pose(tmp_path):
    """The columns are camera-to-world with x right, y up, z backward; written here without the package."""
    rng = np.random.default_rng(0)
    rows = identity_rows(5, 32, 24)
    truth = []
    for row in rows:
        rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        rotation *= np.sign(np.linalg.det(rotation))
        position = rng.standard_normal(3)
        matrix = row[:15].reshape(3, 5)
        matrix[:, :3], matrix[:, 3] = rotation, position
        right, up, ahead = 0.3, 0.2, 2.0
        world = position + rotation @ [right, up, -ahead]
        truth.append((world, 16 + FOCAL * right / ahead, 12 - FOCAL * up / ahead))
    write_synthetic_folder(tmp_path, rows=rows)
    sequence = read_sequence(tmp_path, EVERYTHING)
    assert not sequence.static_camera
    for camera, (world, column, row) in zip(sequence.cameras, truth):
        x, y, z = camera.rotation @ world + camera.translation
        assert z == pytest.approx(2.0)
        assert (camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy) == pytest.approx((column, row))


def test_write_then_read_returns_the_same_sequence(tmp_path):
    rows = identity_rows(5, 32, 24)
    rows[3, 3] = 2.5  # the camera moves
    write_synthetic_folder(tmp_path / "a", rows=rows)
    first = read_sequence(tmp_path / "a", EVERYTHING)
    write_endonerf(first, tmp_path / "b")
    second = read_sequence(tmp_path / "b", EVERYTHING)
    for name in ("images", "masks", "depth", "times"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    for a, b in zip(first.cameras, second.cameras):
        np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-15)
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-15)
        assert a[2:] == b[2:]


def test_write_refuses_a_camera_the_format_cannot_hold(tmp_path):
    write_synthetic_folder(tmp_path / "a")
    sequence = read_sequence(tmp_path / "a", EVERYTHING)
    sequence.cameras[:] = [sequence.cameras[0]._replace(cx=15.0)] * 5
    with pytest.raises(InputError, match=r"frame 0.*central principal point.*cx 15"):
        write_endonerf(sequence, tmp_path / "b")


def test_frame_range_comes_before_split_and_time(tmp_path):
    written = write_synthetic_folder(tmp_path, frames=12)
    sequence = read_sequence(tmp_path, SequenceConfig(frames="1:12:2", depth_percentiles=(0.0, 100.0)))
    np.testing.assert_array_equal(sequence.images, written.images[1:12:2])
    np.testing.assert_array_equal(sequence.times, np.arange(6) / 6)
    np.testing.assert_array_equal(sequence.test_index, [1])
    assert sequence.names[0].startswith("frame-000001")


def test_depth_is_clipped_to_percentiles_of_its_non_zero_values():
    depth = np.zeros((20, 20), np.uint16)
    depth[:10] = np.arange(200).reshape(10, 20) + 1
    clipped = clip_depth(depth, (3.0, 99.8))
    values = np.sort(depth[depth > 0].astype(float))
    position = lambda q: values[int(q)] + (q % 1) * (values[min(int(q) + 1, 199)] - values[int(q)])
    low, high = position(0.03 * 199), position(0.998 * 199)
    assert (clipped[10:] == 0).all()
    assert clipped[:10].min() == np.float32(low) and clipped[:10].max() == np.float32(high)
    np.testing.assert_array_equal(clip_depth(np.zeros((2, 2), np.uint8), (3.0, 99.8)), 0)


def test_scale_keeps_only_what_all_parents_agree_on(tmp_path):
    written = write_synthetic_folder(tmp_path, width=48, height=40)
    sequence = read_sequence(tmp_path, SequenceConfig(scale=0.5, depth_percentiles=(0.0, 100.0)))
    parents = lambda a: a.reshape(*a.shape[:-2], 20, 2, 24, 2).swapaxes(-3, -2).reshape(*a.shape[:-2], 20, 24, 4)
    np.testing.assert_array_equal(sequence.masks, parents(written.tissue).all(axis=-1))
    count = np.maximum((parents(written.depth) > 0).sum(axis=-1), 1)
    np.testing.assert_allclose(sequence.depth, parents(written.depth).sum(axis=-1) / count, rtol=1e-6)
    assert np.abs(sequence.images - parents(written.images).mean(axis=-1)).max() <= 0.5
    camera = sequence.cameras[0]
    assert camera[2:] == (FOCAL / 2, FOCAL / 2, 12.0, 10.0, 24, 20) and sequence.cameras[4] is camera


@pytest.mark.parametrize("mask_folder", ["masks", "gt_masks"])
@pytest.mark.parametrize("depth_behind_tool", [False, True])
def test_hard_E1_wrong_polarity_is_recognised(tmp_path, mask_folder, depth_behind_tool):
    """By missing depth, and where the tool has depth too, by colour."""
    write_synthetic_folder(tmp_path, mask_folder=mask_folder, depth_behind_tool=depth_behind_tool)
    wrong = SequenceConfig(masks=mask_folder, excluded_value="black")
    toml = r'\(TOML: \[sequence\] excluded_value = "white"\).* --sequence.allow-tissue-fraction'
    with pytest.raises(
        InputError, match=rf"{mask_folder}: .*other polarity: set --sequence.excluded-value white {toml}"
    ):
        read_sequence(tmp_path, wrong)
    forced = SequenceConfig(masks=mask_folder, excluded_value="black", allow_tissue_fraction=True)
    assert read_sequence(tmp_path, forced).tissue_fraction < 0.5


def test_hard_E1_implausible_tissue_share_is_refused_unless_allowed(tmp_path):
    write_synthetic_folder(tmp_path)
    for value, share in ((0, "100.0%"), (255, "0.0%")):
        for file in (tmp_path / "masks").iterdir():
            cv2.imwrite(str(file), np.full((24, 32), value, np.uint8))
        with pytest.raises(
            InputError,
            match=rf"masks: {share} of the pixels count as tissue; .*--sequence.allow-tissue-fraction .*_fraction",
        ):
            read_sequence(tmp_path, SequenceConfig())
        sequence = read_sequence(tmp_path, SequenceConfig(allow_tissue_fraction=True))
        assert sequence.tissue_fraction == (value == 0)


def test_hard_E2_soft_masks_are_thresholded_and_noted_or_refused(tmp_path):
    written = write_synthetic_folder(tmp_path)
    file = tmp_path / "masks" / "frame-000003.mask.png"
    mask = np.where(written.tissue[3], 0, 255).astype(np.uint8)
    mask[20, 5:9] = [1, 127, 128, 254]
    cv2.imwrite(str(file), mask)
    sequence = read_sequence(tmp_path, SequenceConfig())
    np.testing.assert_array_equal(sequence.masks[3, 20, 4:10], [True, True, True, False, False, True])
    assert any("4 mask pixels are between 0 and 255" in note for note in sequence.notes)
    cv2.imwrite(str(file), np.where(written.tissue[3], 0, 1).astype(np.uint8))  # one file on another scale
    with pytest.raises(InputError, match=r"frame-000003.mask.png: .* neither 0 nor 255"):
        read_sequence(tmp_path, SequenceConfig())


@builder
def _rewrite_rows(folder, change):
    rows = np.load(folder / "poses_bounds.npy")
    rows = change(rows)
    np.save(folder / "poses_bounds.npy", rows, allow_pickle=True)


@builder
def _set(rows, row, column, value):
    rows[row, column] = value
    return rows


@builder
def _cut(folder, name, keep):
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: int(keep * len(data))])


@builder
def _flip_byte(folder, name):
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 0xFF
    (folder / name).write_bytes(data)


def _picture(name, pixels):
    return lambda folder: cv2.imwrite(str(folder / name), pixels)


def _no_depth(folder):
    for file in (folder / "depth").iterdir():
        cv2.imwrite(str(file), np.zeros((24, 32), np.uint8))


@builder
def _empty(folder, name):
    for file in (folder / name).iterdir():
        file.unlink()


def _rename(old, new):
    return lambda folder: (folder / old).rename(folder / new)


def _remove(name):
    return lambda folder: (folder / name).unlink()


IMAGE, MASK, DEPTH = "images/frame-000002.color.png", "masks/frame-000002.mask.png", "depth/frame-000002.depth.png"
GREY = np.full((24, 32), 9, np.uint8)

DAMAGES = {
    "no image folder": (_rename("images", "pictures"), {}, r"images: folder not found"),
    "no mask folder": (lambda folder: None, {"masks": "gt_masks"}, r"gt_masks: folder not found"),
    "empty depth folder": (_empty("depth"), {}, r"depth: holds no PNG"),
    "image missing": (_remove(IMAGE), {},
        r"images: has no file for frame 2 \(masks/frame-000002.mask.png\); .*4 .*5"),
    "mask missing": (_remove(MASK), {}, r"masks: has no file for frame 2 \(images/frame-000002.color.png\); .*5.*4"),
    "E3 other frame": (_rename(DEPTH, "depth/frame-000009.depth.png"), {}, r"depth: has no file for frame 2 "),
    "same number twice": (_rename(IMAGE, "images/frame-01.color.png"), {},
        r"images: two files .* frame-000001.* frame-01"),
    "image cut": (_cut(IMAGE, 0.7), {}, r"frame-000002.color.png: truncated PNG"),
    "depth empty file": (_cut(DEPTH, 0.0), {}, r"frame-000002.depth.png: not a PNG file: it is empty"),
    "image damaged": (_flip_byte(IMAGE), {}, r"frame-000002.color.png: damaged PNG: wrong checksum in chunk IDAT"),
    "image size": (_picture(IMAGE, np.zeros((24, 30, 3), np.uint8)), {},
        r"frame-000002.color.png: 30x24 .*first .*32x24"),
    "mask size": (_picture(MASK, GREY[:20]), {}, r"frame-000002.mask.png: 32x20 pixels"),
    "depth size": (_picture(DEPTH, GREY.T.copy()), {}, r"frame-000002.depth.png: 24x32 pixels"),
    "grey image": (_picture(IMAGE, GREY), {}, r"frame-000002.color.png: grey picture"),
    "deep image": (_picture(IMAGE, np.zeros((24, 32, 3), np.uint16)), {}, r"frame-000002.color.png: 16-bit"),
    "coloured depth": (_picture(DEPTH, np.dstack([GREY, GREY, GREY + 1])), {}, r"frame-000002.depth.png: coloured"),
    "grey mask": (_picture(MASK, GREY), {}, r"frame-000002.mask.png: areas of the number 9, .* neither 0 nor 255"),
    "no depth": (_no_depth, {}, r"depth: no pixel of the 5 frames has a depth"),
    "no poses": (_remove("poses_bounds.npy"), {}, r"poses_bounds.npy: file not found"),
    "poses cut": (_cut("poses_bounds.npy", 0.5), {}, r"poses_bounds.npy: not a plain NumPy array"),
    "poses empty": (_cut("poses_bounds.npy", 0), {}, r"poses_bounds.npy: not a plain .* an .npy file of numbers"),
    "poses pickled": (_rewrite_rows(lambda r: np.array([{}] * 5, object)), {}, r"poses_bounds.npy: not a plain"),
    "poses shape": (_rewrite_rows(lambda r: r[:, :15]), {}, r"poses_bounds.npy: shape \(5, 15\), expected"),
    "poses count": (_rewrite_rows(lambda r: r[:4]), {}, r"poses_bounds.npy: 4 poses for 5 images"),
    "poses NaN": (_rewrite_rows(_set(3, 8, np.nan)), {}, r"poses_bounds.npy: frame 3: value 8 of the row is nan"),
    "poses Inf": (_rewrite_rows(_set(1, 3, np.inf)), {}, r"poses_bounds.npy: frame 1: value 3 of the row is inf"),
    "focal zero": (_rewrite_rows(_set(2, 14, 0.0)), {}, r"frame 2: focal length 0, must be positive"),
    "HWF height": (_rewrite_rows(_set(4, 4, 48.0)), {}, r"frame 4: states an image of 32x48, .* are 32x24"),
    "HWF swapped": (_rewrite_rows(lambda r: r[:, [*range(4), 9, *range(5, 9), 4, *range(10, 17)]]), {}, r"swapped"),
    "no rotation": (_rewrite_rows(_set(1, 0, 1.1)), {}, r"frame 1: .*not perpendicular unit vectors"),
    "mirrored": (_rewrite_rows(_set(1, 0, -1.0)), {}, r"frame 1: .*mirror image"),
    "too few frames": (lambda f: None, {"frames": "0:2"}, r"frames '0:2': selects 2 of 5 .* at least 3"),
    "range outside": (lambda f: None, {"frames": "0:9"}, r"frames '0:9': 9 is outside the 5 frames"),
    "range text": (lambda f: None, {"frames": "all"}, r"frames 'all': not a range; write start:stop"),
    "range backwards": (lambda f: None, {"frames": "::-1"}, r"frames '::-1': the step must be 1 or more"),
    "no block fits": (lambda f: None, {"split": "blocks"}, r"no held-out block of 8 frames fits into 5 frames"),
    "scale too small": (lambda f: None, {"scale": 0.5}, r"scale 0.5 makes 16x12 .* at least 16 on each side"),
    "scale above one": (lambda f: None, {"scale": 2.0}, r"scale 2: .*\(0, 1\]"),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGES)
def test_bad_input_names_file_frame_and_reason(tmp_path, case):
    damage, settings, message = DAMAGES[case]
    write_synthetic_folder(tmp_path)
    damage(tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        read_sequence(tmp_path, SequenceConfig(**settings))
    assert "\n" not in str(caught.value) and str(tmp_path) in str(caught.value)
    assert "pickle" not in str(caught.value), "no advice that would run a stranger's code"


def test_hard_E3_time_stamps_in_file_names_order_and_pair_the_frames(tmp_path):
    stamp = lambda i, kind: f"2021-03-04 12_{59 + i // 2 - 1}_{(i * 30) % 60:02d} {kind}.png"
    written = write_synthetic_folder(tmp_path, name=stamp)
    np.testing.assert_array_equal(read_sequence(tmp_path, EVERYTHING).images, written.images)
    (tmp_path / "masks" / stamp(4, "mask")).rename(tmp_path / "masks" / stamp(5, "mask"))
    with pytest.raises(InputError, match=r"masks: has no file for frame 60-0 "):
        read_sequence(tmp_path, EVERYTHING)


NUMBERED = lambda i, kind: f"frame{i + 1}.png"
LETTERS = lambda i, kind: f"{'abcdefghij'[i]}.{kind}.png"


@pytest.mark.parametrize(("name", "old", "new", "message"), [
    (NUMBERED, "masks/frame3.png", "masks/frame3_v2.png",
        r"masks/frame3_v2.png: numbers in this name: 2; .*9 of.*10"),
    (NUMBERED, "masks/frame4.png", "masks/zz.png", r"masks/zz.png: numbers in this name: 0; .* frame1.png .*: 1; "),
    (NUMBERED, None, "images/overview.png", r"images/overview.png: numbers in this name: 0; .*10 of the 11 files"),
    (LETTERS, "masks/d.mask.png", "masks/zz.png", r"masks: has no file for frame d \(images/d.color.png\)"),
    (LETTERS, "depth/a.depth.png", "depth/a7.depth.png", r"depth/a7.depth.png: numbers in this name: 1"),
    (VERSIONED, "masks/frame_v1_0003.png", "masks/frame_v2_0003.png", r"masks/frame_v2_0003.png: the names of masks"),
    (lambda i, kind: f"{'abcdefghij'[i]}.png" if kind == "mask" else NUMBERED(i, kind), None, None,
        r"masks/a.png: no"),
])  # fmt: skip
def test_hard_E3_a_name_out_of_pattern_never_shifts_the_others(tmp_path, name, old, new, message):
    written = write_synthetic_folder(tmp_path, frames=10, width=40, name=name)
    if new is not None:
        cv2.imwrite(str(tmp_path / new), np.where(written.tissue[3], 0, 255).astype(np.uint8))
    if old is not None:
        (tmp_path / old).unlink()
    with pytest.raises(InputError, match=message):
        read_sequence(tmp_path, EVERYTHING)


def test_hard_E3_one_name_in_two_spellings_does_not_pair():
    images = [Path("images/a.png"), Path("images/b.png")]
    with pytest.raises(InputError, match=r"masks: the files do not match one to one; images holds 2 files, masks 3"):
        check_pairing(images, [Path("masks/a.PNG"), Path("masks/a.png"), Path("masks/b.png")])


@pytest.mark.parametrize("where", ["images", "masks", "depth"])
def test_a_file_name_that_is_not_utf8_is_named(tmp_path, where):
    written = write_synthetic_folder(tmp_path, name=NUMBERED)
    np.testing.assert_array_equal(read_sequence(tmp_path, EVERYTHING).images, written.images)
    file = tmp_path / where / "frame3.png"
    try:
        file.rename(tmp_path / where / os.fsdecode(b"caf\xe9-frame3.png"))
    except (OSError, UnicodeDecodeError):
        pytest.skip("this file system takes UTF-8 names only")
    with pytest.raises(InputError, match=rf"{where}/caf\\xe9-frame3.png: the name is not UTF-8; use") as caught:
        file_hashes(tmp_path, EVERYTHING)
    str(caught.value).encode("utf-8")


@pytest.mark.parametrize("percentiles", [(99.0, 3.0), (-1.0, 99.0), (1.0, 100.5), (float("nan"), 99.0)])
def test_bad_percentiles_are_named(tmp_path, percentiles):
    write_synthetic_folder(tmp_path)
    with pytest.raises(InputError, match="depth_percentiles"):
        read_sequence(tmp_path, SequenceConfig(depth_percentiles=percentiles))


def test_missing_sequence_folder(tmp_path):
    with pytest.raises(InputError, match=r"nowhere: sequence folder not found"):
        read_sequence(tmp_path / "nowhere", SequenceConfig())


def test_a_file_in_place_of_the_sequence_folder(tmp_path):
    (tmp_path / "clip.mp4").write_bytes(b"")
    with pytest.raises(InputError, match=r"clip.mp4: a video file; `endotsr prepare"):
        read_sequence(tmp_path / "clip.mp4", SequenceConfig())


def test_all_depth_in_front_of_the_near_plane(tmp_path):
    write_synthetic_folder(tmp_path)
    with pytest.raises(InputError, match=r"largest depth is 60, in front of the near plane at 80"):
        read_sequence(tmp_path, EVERYTHING, near=80.0)
    assert any("in front of the near plane" in note for note in read_sequence(tmp_path, EVERYTHING, near=50.0).notes)


def test_input_hashes_cover_every_file_that_is_read_and_notice_a_change(tmp_path):
    write_synthetic_folder(tmp_path)
    hashes = file_hashes(tmp_path, SequenceConfig())
    assert len(hashes) == 3 * 5 + 1 and "poses_bounds.npy" in hashes
    _flip_byte(MASK)(tmp_path)
    after = file_hashes(tmp_path, SequenceConfig())
    assert [name for name in hashes if hashes[name] != after[name]] == [MASK]


@pytest.mark.data
@pytest.mark.parametrize(
    ("masks", "step", "found"), [("masks", 1, []), ("gt_masks", 3, [("straight-border", "row 507")])]
)
def test_real_sequence(masks, step, found):
    """`gt_masks` excludes instruments alone: the display of the console at the lower edge counts as tissue there."""
    folder = data_folder("endonerf_pulling")
    sequence = read_sequence(folder, SequenceConfig(masks=masks, frames=f"0:63:{step}"))
    assert sequence.images.shape == (63 // step, 3, 512, 640)
    assert list(sequence.test_index) == list(range(1, 63 // step, 8))
    assert sequence.tissue_fraction == pytest.approx(np.mean(recorded_masks(folder.name, masks)[::step]), abs=1e-6)
    assert sequence.static_camera and sequence.cameras[0].fx == pytest.approx(569.468, abs=1e-3)
    assert (sequence.cameras[0].cx, sequence.cameras[0].cy) == (320, 256)
    assert len(sequence.notes) == 2 + len(found)
    for (kind, place), note in zip(found, sequence.notes[2:], strict=True):
        assert kind in note and place in note
    with pytest.raises(InputError, match="other polarity"):
        read_sequence(folder, SequenceConfig(masks=masks, excluded_value="black", frames="0:6"))


@pytest.mark.data
def test_the_display_of_the_console_in_cutting_is_at_rest_within_gt_masks():
    notes = read_sequence(data_folder("endonerf_cutting"), SequenceConfig(masks="gt_masks", frames="0:156:4")).notes
    assert [note for note in notes if "burnt-in" in note and "rows 501 to 510" in note]
